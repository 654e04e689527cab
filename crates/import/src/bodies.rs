//! Bodies of a file.

use std::collections::BTreeMap;

use viscera::mesh::io::{MeshNames, ReadReport};
use viscera::mesh::tetrahedralize::{Spacing, TetrahedralizeError};
use viscera::mesh::topology::{BoundingBox, count_open_edges};
use viscera::mesh::winding::{self, FillError};
use viscera::mesh::{SurfaceMesh, TetMesh, tet_volume};
use viscera::scalar::{Vec3, vec3};
use viscera::simulation::Balance;
use viscera_volume::VolumeReport;

use crate::filling::{Filled, KEPT, Wanted, fill_to, first_spacing};
use crate::hold::{BACK, Hold, at_the_back};
use crate::name::{name_of, stem_of};
use crate::open::{Found, rename};
use crate::organs::of_labels;
use crate::size::{Fineness, MOST_OF_SURFACES, finest, spacing_of, tets_of};
use crate::tissue::Tissue;
use crate::unit::{Unit, doubt, edge_below, guess, length_text, millilitres};
use crate::{ImportError, tissue};

/// What is asked for.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How fine bodies are filled; as many tetrahedra as run in real time where nobody says.
    pub fineness: Option<Fineness>,
    /// The length of 1 in a mesh [m]; guessed where nobody says.
    pub unit: Option<f64>,
    /// Labels by name or number; all soft organs where there are none.
    pub labels: Vec<String>,
    /// Names of labels by number, in place of those in the file.
    pub names: Vec<(u16, String)>,
    /// Whether tetrahedra grow inwards, away from the surface, which stays as fine.
    pub graded: bool,
    /// Whether hollow organs are a wall around a cavity, in place of filled.
    pub hollow: bool,
    /// Whether bodies are wanted for their shapes, also of bones, and not for a scene.
    pub shapes_only: bool,
}

/// How often edges double towards the inside of graded bodies, where there is room.
const DOUBLINGS: u32 = 3;

impl Options {
    /// Edges of a length [m] at the surface.
    pub(crate) fn spacing(&self, surface: f64) -> Spacing {
        Spacing { surface, doublings: if self.graded { DOUBLINGS } else { 0 } }
    }
}

/// A surface that is finer than the tetrahedra, and moves with them.
pub type Skin = SurfaceMesh;

/// A part of a body that is made of something else.
#[derive(Clone, Debug, PartialEq)]
pub struct Inner {
    /// The label of its tetrahedra.
    pub region: u32,
    /// Its name.
    pub name: String,
    /// What it is made of.
    pub tissue: Tissue,
}

/// A body of a scene.
#[derive(Clone, Debug)]
pub struct Part {
    /// A name that scenes take.
    pub name: String,
    /// Its tetrahedra [m].
    pub mesh: TetMesh,
    /// The volume that it has in the file [m^3], where that is known without tetrahedra.
    pub wanted: Option<f64>,
    /// Its fine surface [m], if it has one.
    pub skin: Option<Skin>,
    /// What it is made of.
    pub tissue: Tissue,
    /// Parts of it that are made of something else.
    pub inner: Vec<Inner>,
    /// What its file has names for.
    pub names: MeshNames,
    /// Where it is held.
    pub holds: Vec<Hold>,
    /// Whether it rests under gravity as it is; else it begins without load.
    pub is_balanced: bool,
    /// What people should know of it.
    pub notes: Vec<String>,
}

/// Two bodies that touch, and are tied.
#[derive(Clone, Debug, PartialEq)]
pub struct Touching {
    /// The smaller one, by its place in the list of parts.
    pub from: usize,
    /// The larger one.
    pub to: usize,
    /// The share of the smaller one's surface that touches.
    pub share: f64,
    /// Points further away are not tied [m].
    pub distance: f64,
}

/// All of a scene that comes from a file.
pub struct Import {
    /// The file's name.
    pub file: String,
    /// Bodies.
    pub parts: Vec<Part>,
    /// Bodies that touch.
    pub touching: Vec<Touching>,
    /// How far off surfaces contact begins [m], where the scene's default is not enough for bodies that overlap.
    pub thickness: Option<f64>,
    /// Downwards, of length 1.
    pub down: Vec3<f64>,
    /// What is probably not as it was meant, a line each.
    pub warnings: Vec<String>,
    /// What was found and what was assumed, a line each.
    pub notes: Vec<String>,
    /// How bodies carry gravity that rest as they are, where that was solved for: what an assembly of the scene needs not find
    /// again.
    pub balance: Option<Balance>,
}

/// Turns a file into bodies; calls `observe` with the name of each before it is filled.
pub fn parts(
    file: &str,
    found: Found,
    options: &Options,
    observe: &mut dyn FnMut(&str),
) -> Result<Import, ImportError> {
    let mut import = bodies(file, found, options, observe)?;
    if !options.shapes_only {
        import.balance(observe);
    }
    Ok(import)
}

fn bodies(
    file: &str,
    found: Found,
    options: &Options,
    observe: &mut dyn FnMut(&str),
) -> Result<Import, ImportError> {
    let stem = stem_of(file);
    let name = name_of(stem);
    refuse_unused(file, &found, options)?;
    match found {
        Found::Labels(mut map, mut report) => {
            rename(file, &mut map, &mut report, &options.names)?;
            of_scan(file, &map, &report, options, observe)
        }
        Found::Tets(mesh, report) => {
            observe(&name);
            let (unit, doubt) = unit_of(stem, mesh.vertices(), mesh.volume(), options);
            let mut notes = vec![unit.reason.clone()];
            notes.extend(notes_of(&report, unit.meters));
            let mesh = scaled(file, &mesh, unit.meters)?;
            let inner = inner_of(&mesh, &report, &mut notes);
            let warnings = doubt.into_iter().collect();
            let mut import = alone(file, name, mesh, None, inner);
            import.parts.iter_mut().for_each(|part| part.names = report.names());
            Ok(Import { notes, warnings, ..import })
        }
        Found::Surface(surface, report) => {
            observe(&name);
            let volume = surface.enclosed_volume().abs();
            let (unit, doubt) = unit_of(stem, &surface.vertices, volume, options);
            let mut notes = vec![unit.reason.clone()];
            notes.extend(notes_of(&report, unit.meters));
            let mut surface = surface;
            surface.vertices.iter_mut().for_each(|x| *x = *x * unit.meters);
            let (filled, wanted) = fill_surface(file, &surface, options, &mut notes)?;
            if filled.invented > 0.001 {
                let percent = 100.0 * filled.invented;
                notes.push(format!(
                    "the surface has holes: {percent:.1} % of the boundary closes them"
                ));
            }
            if filled.report.components > 1 {
                let count = filled.report.components;
                notes.push(format!("{count} unconnected parts, each with a hold"));
            }
            let mut import = alone(file, name, filled.mesh, Some(surface), Vec::new());
            import.parts[0].wanted = wanted;
            import.warnings.extend(doubt);
            let more = format!(
                "more tetrahedra keep more of it, such as --count {}; or parts of its surface overlap",
                8 * import.parts[0].mesh.tets().len()
            );
            import.warnings.extend(told_loss(&import.parts[0], &more));
            Ok(Import { notes, ..import })
        }
    }
}

/// Fills a surface with edges that are short enough for its volume, where it encloses one: it is returned then.
fn fill_surface(
    file: &str,
    surface: &SurfaceMesh,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<(Filled, Option<f64>), ImportError> {
    let fail = |error| match error {
        FillError::Fill(TetrahedralizeError::TooCoarse { spacing, suggestion, .. }) => {
            let (long, short) = (length_text(spacing), edge_below(suggestion));
            ImportError::Thin { file: file.into(), long, short }
        }
        error => ImportError::Fill { file: file.into(), error },
    };
    let volume = surface.enclosed_volume().abs();
    let size = BoundingBox::around(&surface.vertices).size();
    let whole_box = size.x * size.y * size.z;
    let fineness = options.fineness.unwrap_or_default();
    // What encloses nothing yet may do so once its holes are closed.
    let is_closed = count_open_edges(surface) == 0 && volume > 0.0;
    let likely = if is_closed { volume } else { volume.max(0.1 * whole_box) };
    let asked = fineness.affordable(file, likely, whole_box, MOST_OF_SURFACES)?;
    let fill_with = |spacing| {
        let winding::Filled { mesh, report, invented } =
            winding::fill(surface, options.spacing(spacing))?;
        Ok(Filled { mesh, report, invented, spacing })
    };
    if !is_closed {
        return Ok((fill_with(asked).map_err(fail)?, None));
    }
    let least = Fineness::default().spacing(volume);
    let finest = spacing_of(volume, tets_of(volume, asked.min(least))).max(finest(
        volume,
        whole_box,
        MOST_OF_SURFACES,
    ));
    let first = first_spacing(volume, surface, asked, finest);
    // Parts of a surface may overlap, and lie in each other: how many bodies they are is not known.
    let wanted = Wanted { volume, parts: usize::MAX };
    let filled = fill_to(wanted, first, finest, fill_with).map_err(fail)?;
    notes.extend(told_edges(filled.spacing, asked));
    Ok((filled, Some(volume)))
}

/// That a body has shorter edges [m] than it was to have.
pub fn told_edges(edge: f64, asked: f64) -> Option<String> {
    let (short, long) = (1e3 * edge, 1e3 * asked);
    (edge < 0.99 * asked).then(|| {
        format!("edges of {short:.1} mm in place of {long:.1} mm, so that it keeps its volume")
    })
}

/// What of a body's volume its tetrahedra lack, with what to do.
pub fn told_loss(part: &Part, advice: &str) -> Option<String> {
    let (wanted, has) = (part.wanted?, part.mesh.volume());
    let off = has / wanted - 1.0;
    (off.abs() > KEPT).then(|| {
        let less = if off < 0.0 { "less" } else { "more" };
        let percent = 100.0 * off.abs();
        format!(
            "`{}` has {} ml of the {} ml in the file, {percent:.0} % {less}: it is too thin for its edges; {advice}",
            part.name,
            millilitres(has),
            millilitres(wanted)
        )
    })
}

/// The unit that was given, with a doubt where it makes no organ of the file; or a guess.
fn unit_of(
    name: &str,
    vertices: &[Vec3<f64>],
    volume: f64,
    options: &Options,
) -> (Unit, Option<String>) {
    match options.unit {
        None => (guess(name, vertices, volume), None),
        Some(meters) => {
            let unit = Unit { meters, reason: String::from("unit as given") };
            (unit, doubt(name, vertices, volume, meters))
        }
    }
}

/// Refuses options that a file has no use for, rather than ignore them.
fn refuse_unused(file: &str, found: &Found, options: &Options) -> Result<(), ImportError> {
    let refuse = |is, option, why: String| {
        Err(ImportError::Option { file: file.to_owned(), is, option, why })
    };
    let of_scans = [
        ("--labels", !options.labels.is_empty()),
        ("--names", !options.names.is_empty()),
        ("--hollow", options.hollow),
    ];
    let of_scans = of_scans.iter().find(|(_, is_given)| *is_given).map(|(option, _)| *option);
    match (found, of_scans) {
        (Found::Labels(..), _) if options.unit.is_some() => refuse(
            "is a scan",
            "--unit",
            "is for meshes: a scan has the size of its voxels in its header; correct that, for example in 3D Slicer".into(),
        ),
        (Found::Tets(..), Some("--labels")) => refuse(
            "is a mesh of tetrahedra",
            "--labels",
            format!(
                "chooses labels of scans; regions of a mesh are chosen by `viscera mesh convert {file} part.vtu --region NUMBER`"
            ),
        ),
        (Found::Tets(..), None) if options.fineness.is_some() || options.graded => refuse(
            "is a mesh of tetrahedra",
            match options.fineness {
                Some(Fineness::Edge(_)) => "--edge",
                Some(Fineness::Count(_)) => "--count",
                None => "--graded",
            },
            format!(
                "says how surfaces and scans are filled; to fill its surface anew, write that by `viscera mesh convert {file} \
                 surface.stl` and take surface.stl"
            ),
        ),
        (Found::Tets(..) | Found::Surface(..), Some(option)) => {
            refuse("is a mesh", option, "is for the labels of scans; leave it out".into())
        }
        _ => Ok(()),
    }
}

/// A scene of one body that is held at its lowest part.
fn alone(file: &str, name: String, mesh: TetMesh, skin: Option<Skin>, inner: Vec<Inner>) -> Import {
    let down = vec3(0.0, 0.0, -1.0);
    let holds = at_the_back(&name, &mesh, down, ("lowest", BACK));
    let tissue = tissue::of_name(&name);
    let names = MeshNames::default();
    let (wanted, notes) = (None, Vec::new());
    let part =
        Part { name, mesh, wanted, skin, tissue, inner, names, holds, is_balanced: true, notes };
    let (file, parts) = (file.to_owned(), vec![part]);
    let (touching, warnings, notes) = (Vec::new(), Vec::new(), Vec::new());
    Import { file, parts, touching, thickness: None, down, warnings, notes, balance: None }
}

fn of_scan(
    file: &str,
    map: &viscera_volume::LabelMap,
    report: &VolumeReport,
    options: &Options,
    observe: &mut dyn FnMut(&str),
) -> Result<Import, ImportError> {
    let mut notes: Vec<String> = report.to_string().lines().map(str::to_owned).collect();
    // Patients lie on their backs, and the frame's y is to the front.
    let down = vec3(0.0, -1.0, 0.0);
    notes.push("the patient lies on the back: gravity is along -y".into());
    let mut import = of_labels(file, map, options, down, observe)?;
    notes.append(&mut import.notes);
    Ok(Import { notes, ..import })
}

fn scaled(file: &str, mesh: &TetMesh, unit: f64) -> Result<TetMesh, ImportError> {
    let vertices = mesh.vertices().iter().map(|&x| x * unit).collect();
    let scaled = TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec());
    let fail = |error| ImportError::Scale { file: file.into(), unit: length_text(unit), error };
    scaled.map(|(mesh, _)| mesh).map_err(fail)
}

/// The regions of a mesh besides the largest: those whose names say what they are made of; others are told.
fn inner_of(mesh: &TetMesh, report: &ReadReport, notes: &mut Vec<String>) -> Vec<Inner> {
    let mut volumes = BTreeMap::new();
    for (tet, &region) in mesh.regions().iter().enumerate() {
        *volumes.entry(region).or_insert(0.0) += tet_volume(mesh.corners(tet));
    }
    let largest = volumes.iter().max_by(|a, b| a.1.total_cmp(b.1)).map(|(region, _)| *region);
    let mut inner = Vec::new();
    for (&region, volume) in volumes.iter().filter(|(region, _)| Some(**region) != largest) {
        let named = report.region_names.iter().find(|(known, _)| *known == region);
        let name = named.map_or(format!("region {region}"), |(_, name)| name.clone());
        let tissue = tissue::of_name(&name);
        let size = format!("`{name}` (label {region}, {:.1} ml)", 1e6 * volume);
        if tissue.preset.is_some() {
            inner.push(Inner { region, name: name_of(&name), tissue });
        } else {
            notes.push(format!(
                "{size} is made of the same: give it a [[body.region]] where it is not"
            ));
        }
    }
    inner
}

/// What reading did to a mesh.
fn notes_of(report: &ReadReport, unit: f64) -> Vec<String> {
    let mut notes = Vec::new();
    if report.repairs.rewound_tets > 0 {
        notes.push(format!("reversed the winding of {} tetrahedra", report.repairs.rewound_tets));
    }
    for split in &report.split {
        notes.push(format!("cut {} x {} into tetrahedra", split.count, split.kind));
    }
    if report.curved > 0 {
        let bulge = 1e3 * report.bulge * unit;
        notes.push(format!(
            "took {} second-order elements by their corners; their edges were up to {bulge:.2} mm from straight",
            report.curved
        ));
    }
    notes.extend(report.unused_text());
    notes.extend(report.skipped_texts());
    notes
}
