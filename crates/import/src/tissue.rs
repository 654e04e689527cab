//! What a name is made of.

use viscera::material::preset;
use viscera_volume::tissue::{ClassTissue, Kind as ClassKind, tissue_of};

/// What a body is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Tissue {
    /// The name of a preset; none where nothing is known.
    pub preset: Option<&'static str>,
    /// Young's modulus in place of the preset's [Pa].
    pub young: Option<f64>,
    /// Why it is a guess, or what to know.
    pub note: String,
}

impl Tissue {
    /// A share of the stiffness.
    pub fn soften(&mut self, share: f64) {
        let young = self.preset.and_then(|name| preset(name).ok()).map(|preset| preset.young);
        self.young = self.young.or(young).map(|young| young * share);
    }
}

/// What a label is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Soft through and through.
    Soft,
    /// Soft, with a wall of so much [m] around what is in it.
    Hollow(f64),
    /// A vessel, which is simulated where asked for.
    Vessel,
    /// Bone: a million times stiffer than an organ.
    Bone,
    /// A gas.
    Air,
    /// No name that is known.
    Unknown,
}

impl Kind {
    /// Whether a scene has it without being asked.
    pub fn is_organ(self) -> bool {
        matches!(self, Self::Soft | Self::Hollow(_))
    }

    /// How thick its wall is [m].
    pub fn wall(self) -> Option<f64> {
        match self {
            Self::Hollow(wall) => Some(wall),
            _ => None,
        }
    }
}

/// The class of a name, or of one of its words: `liver_surface` is of a liver.
fn find(name: &str) -> Option<&'static ClassTissue> {
    let words = || name.split(|c: char| !c.is_alphanumeric()).filter(|word| word.len() > 2);
    tissue_of(name).or_else(|| words().find_map(tissue_of))
}

/// What a label of this name is.
pub fn kind_of(name: &str) -> Kind {
    match find(name).map(|class| class.kind) {
        Some(ClassKind::Soft(_)) => Kind::Soft,
        Some(ClassKind::Hollow { wall, .. }) => Kind::Hollow(wall),
        Some(ClassKind::Vessel { .. }) => Kind::Vessel,
        Some(ClassKind::Rigid) => Kind::Bone,
        Some(ClassKind::Air) => Kind::Air,
        None => Kind::Unknown,
    }
}

/// What a body of this name is made of.
pub fn of_name(name: &str) -> Tissue {
    let class = find(name);
    let known = class.and_then(|class| Some((class, class.preset()?)));
    // A preset may have the name itself: "fat".
    match known.map(|(class, preset)| (preset, class.note)).or(preset(name).ok().map(|p| (p, ""))) {
        Some((preset, note)) => {
            Tissue { preset: Some(preset.name), young: None, note: note.to_owned() }
        }
        None => {
            let note = format!("nothing is known of `{name}`: set what it is made of");
            Tissue { preset: None, young: None, note }
        }
    }
}

/// As [`of_name`], of an organ whose wall of so much [m] and what it holds are one body of a volume [m^3]. The content has no
/// stiffness of shape, so that the body has the share of the wall's that the wall is of a ball of that volume.
pub fn of_filled(name: &str, filled: Option<(f64, f64)>) -> Tissue {
    let mut tissue = of_name(name);
    let wall_preset = tissue.preset.and_then(|name| preset(name).ok());
    if let (Some((wall, volume)), Some(preset)) = (filled, wall_preset) {
        let radius = libm::cbrt(volume * 0.75 / std::f64::consts::PI);
        let inner = (1.0 - wall / radius).clamp(0.0, 1.0);
        let share = 1.0 - inner * inner * inner;
        tissue.young = Some(preset.young * share);
        let percent = 100.0 * share;
        let note = format!(
            "filled: its wall is {percent:.0} % of it, and so is its stiffness of the wall's"
        );
        tissue.note = [note, tissue.note].join(". ").trim_end_matches(". ").to_owned();
    }
    tissue
}
