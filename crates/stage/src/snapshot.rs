//! What one simulation looks like after a frame: places, values, forces.

use viscera::measure::Energies;
use viscera::scalar::Vec3;
use viscera::solver::Ledger;
use viscera::solver::gpu::{DevicePositions, TissueValue};

use crate::tools::ToolSnapshot;

/// The caller's number for something it holds.
pub type HoldId = u64;

/// What the tissue's colour shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Coloring {
    /// The tissue's own colour.
    #[default]
    Plain,
    /// Each body's own.
    Bodies,
    /// Distance from rest [m].
    Displacement,
    /// Largest principal stretch less one.
    Strain,
    /// Von Mises stress [Pa].
    Stress,
    /// Pressure of tools on the surface [Pa].
    Pressure,
}

impl Coloring {
    /// What a device finds for it.
    pub fn of_tissue(self) -> Option<TissueValue> {
        match self {
            Self::Plain | Self::Bodies => None,
            Self::Displacement => Some(TissueValue::Displacement),
            Self::Strain => Some(TissueValue::Strain),
            Self::Stress => Some(TissueValue::Stress),
            Self::Pressure => Some(TissueValue::Pressure),
        }
    }
}

/// The state of one simulation at that time.
#[derive(Debug, Default)]
pub struct RunSnapshot {
    /// Positions [m] of the tetrahedra's vertices, the user's order, shape [vertex_count].
    pub positions: Vec<Vec3<f32>>,
    /// Frames since the one that `positions` are of; above zero only where they stay on the device that draws.
    pub unread: u64,
    /// Those of this frame, where the device that draws has computed them.
    pub on_device: Option<DevicePositions>,
    /// Values of the surfaces' vertices, one body after the other; empty for plain tissue, and while positions are unread: the
    /// device that draws has them.
    pub values: Vec<f32>,
    /// Patches held by hand.
    pub held: Vec<HeldPatch>,
    /// The scene's tools.
    pub tools: Vec<ToolSnapshot>,
    /// What tools have put into tissue, where what computes keeps account of it.
    pub ledger: Option<Ledger>,
    /// Wall time of the last frame [s].
    pub wall: f64,
    /// Substeps per frame and iterations of each in force: what the method has chosen where it chooses.
    pub counts: [u32; 2],
    /// What is measured now and then.
    pub measures: Measures,
}

impl RunSnapshot {
    /// The largest distance [m] of a vertex from where another simulation has it.
    pub fn distance(&self, other: &Self) -> f64 {
        let pairs = self.positions.iter().zip(&other.positions);
        pairs.fold(0.0, |most, (a, b)| f64::max(most, f64::from((*a - *b).length())))
    }
}

/// How many tetrahedra are inverted, in words; nothing where there are none.
pub fn inverted(run: &RunSnapshot) -> Option<String> {
    match run.measures.inverted {
        0 => None,
        1 => Some("1 tetrahedron is inverted".to_owned()),
        count => Some(format!("{count} tetrahedra are inverted")),
    }
}

/// What takes a while to measure, and is measured ten times a second unless colours need it more often.
#[derive(Clone, Debug, Default)]
pub struct Measures {
    /// Unbalanced forces over loads, see [`viscera::simulation::FrameReport::relative_residual`].
    pub residual: f64,
    /// Energies [J].
    pub energy: Energies,
    /// Rejected substeps so far.
    pub rejected: u64,
    /// Tetrahedra that are turned inside out.
    pub inverted: usize,
    /// Patches that the scene itself moves and pulls.
    pub scene_patches: Vec<ScenePatch>,
}

/// A patch that the scene moves or pulls.
#[derive(Clone, Debug)]
pub struct ScenePatch {
    /// Its name.
    pub name: String,
    /// Its vertices, the user's order.
    pub vertices: Vec<u32>,
    /// Force on the tissue [N].
    pub force: Vec3<f64>,
}

/// A patch of tissue that is held by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldPatch {
    /// The caller's number for it.
    pub id: HoldId,
    /// The middle of the patch [m].
    pub place: Vec3<f64>,
    /// Where that is pulled to [m].
    pub target: Vec3<f64>,
    /// Force on the tissue [N].
    pub force: Vec3<f64>,
}
