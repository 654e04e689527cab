//! Scenes: the content of a scene file, checked and in SI units.
//!
//! A scene file is TOML. [`Scene::parse`] reads it, with overrides laid over it, and either gives a
//! scene in which every number is possible and every reference leads somewhere, or one error that
//! names the line and the next move. It opens no file: [`Scene::files`] lists what the caller must
//! load. [`describe`] lists every key there is.
//!
//! ```
//! use viscera::scene::Scene;
//!
//! let text = r#"
//!     [[body]]
//!     name = "bar"
//!     shape = "beam"
//!     length = "200 mm"
//!     width = "50 mm"
//!     height = "50 mm"
//!     material = { preset = "liver", poisson = 0.4 }
//!
//!     [[fixing]]
//!     body = "bar"
//!     half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
//! "#;
//! let scene = Scene::parse("bar.toml", text, &[("body.bar.material.young", "8 kPa")])?;
//! assert_eq!(scene.bodies[0].material.young(), 8000.0);
//! # Ok::<(), viscera::scene::SceneError>(())
//! ```

mod build;
mod build_instrument;
mod build_parts;
mod change;
mod checks;
mod common;
mod describe;
mod hand;
mod hand_tables;
mod instrument;
mod instrument_path;
mod instrument_tables;
mod keys;
mod lookup;
mod motion;
mod moved;
mod region;
mod selector;
mod solid;
mod tables;
mod tray;
mod write;

pub(crate) use build_instrument::check_angle;
pub use common::Interpolation;
pub use describe::{describe, describe_markdown, describe_settings, describe_text};
pub use hand::Hand;
pub(crate) use hand::key_of;
pub use instrument::{Course, Instrument, JawDrive, Jaws, Part, ToolKind};
pub use instrument_path::{PathError, read_path};
pub use keys::{JawKey, MotionKey};
pub use motion::{Force, ForceKey, Motion};

pub use crate::scalar::rigid::RigidTransform;
pub use region::{Ball, Region, RegionLabel};
pub use selector::{Patch, SelectError, Selector, nearest_pair};
pub use solid::{RidgedJaw, Solid, SolidSource, Tube};
pub use tables::{ContactSettings, OutputSettings, PictureColors, TimeSettings, WorldSettings};
pub use tray::read_tray;

use crate::contact::{ContactLaw, TissueContact};
use crate::material::{Material, MaterialError};
use crate::settings::{Node, Place, SettingError, SolverSettings, Value};
use std::collections::BTreeMap;

/// Settings that change at a time; positions and velocities stay.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// At the beginning of the first frame that does not begin earlier than this [s].
    pub time: f64,
    /// Keys and values, as in overrides.
    pub settings: Vec<(String, String)>,
}

/// The content of a scene file.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The name the file was given.
    pub name: String,
    /// A title for tables and pictures; the name where the file gives none.
    pub title: String,
    /// What the scene shows; may be empty.
    pub description: String,
    /// How long it lasts.
    pub time: TimeSettings,
    /// Loads on all bodies.
    pub world: WorldSettings,
    /// At least one, no two of a name.
    pub bodies: Vec<Body>,
    /// Where bodies are held.
    pub fixings: Vec<Fixing>,
    /// Patches moved along a path.
    pub motions: Vec<Motion>,
    /// Patches pulled with a force.
    pub forces: Vec<Force>,
    /// Springs between two vertices.
    pub springs: Vec<Spring>,
    /// Ties between the surfaces of two bodies.
    pub ties: Vec<Tie>,
    /// How tissue meets tissue.
    pub contact: ContactSettings,
    /// Tools that touch tissue, and fixed obstacles.
    pub tools: Vec<Instrument>,
    /// Settings that change while it runs, times ascending.
    pub changes: Vec<Change>,
    /// How a step is solved.
    pub solver: SolverSettings,
    /// Files that a run writes.
    pub output: OutputSettings,
    /// What was written, overrides and changes laid over it: changes to come begin with it.
    tree: Written,
}

/// A text that was read. Scenes that say the same are equal, however they were written.
#[derive(Clone, Debug)]
struct Written(Node);

impl Default for Written {
    fn default() -> Self {
        let place = Place::Override { key: "".into() };
        Self(Node { place, value: Value::Table(BTreeMap::new()) })
    }
}

impl PartialEq for Written {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// A body: its mesh, its place and its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// The name.
    pub name: String,
    /// Where its mesh comes from.
    pub shape: BodyShape,
    /// How often every tetrahedron is divided into eight.
    pub refine: u32,
    /// Whether the mesh is its shape at rest under gravity, not that without load.
    pub balanced: bool,
    /// From the mesh's frame to the world.
    pub placement: RigidTransform,
    /// Its material, where no region says otherwise.
    pub material: Material,
    /// Parts made of something else; no two of a label.
    pub regions: Vec<Region>,
}

/// Where a body's mesh comes from. Lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyShape {
    /// From files.
    File {
        /// File with tetrahedra.
        mesh: String,
        /// The length [m] that 1 in the files stands for, the body's `scale` included.
        unit: f64,
        /// File with a fine surface in the same unit and frame.
        surface: Option<String>,
    },
    /// Along +x from the plane x = 0, its cross-section centred on the x axis.
    Beam {
        /// Along x [m].
        length: f64,
        /// Along y [m].
        width: f64,
        /// Along z [m].
        height: f64,
        /// Cells across the smaller of width and height.
        cells_across: u32,
        /// Depth of a cut across the middle, as a share of the height.
        cut: f64,
    },
    /// From the origin along +x, +y and +z.
    Block {
        /// Edge lengths [m].
        size: [f64; 3],
        /// Cells along the edges.
        cells: [u32; 3],
    },
    /// Centred at the origin.
    Sphere {
        /// [m].
        radius: f64,
        /// Lattice spacing [m].
        spacing: f64,
    },
    /// Along x, centred at the origin.
    Capsule {
        /// [m].
        radius: f64,
        /// Of the straight part [m].
        length: f64,
        /// Lattice spacing [m].
        spacing: f64,
    },
    /// A procedural liver, centred near the origin.
    Liver {
        /// Lattice spacing [m].
        spacing: f64,
        /// Size relative to the standard liver, which is about 20 cm wide.
        scale: f64,
    },
}

/// Where a body is held.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixing {
    /// The name, or "fixing 0" and so on.
    pub name: String,
    /// The patch that is held.
    pub patch: Patch,
    /// Total stiffness [N/m] of an elastic attachment of each vertex to its rest position; a vertex
    /// has this divided by the number of vertices. `None` holds rigidly.
    pub stiffness: Option<f64>,
}

/// A spring between two vertices: of two patches, those of [`nearest_pair`].
#[derive(Clone, Debug, PartialEq)]
pub struct Spring {
    /// The name, or "spring 0" and so on.
    pub name: String,
    /// One end.
    pub from: Patch,
    /// The other end.
    pub to: Patch,
    /// [N/m].
    pub stiffness: f64,
    /// Length without force [m]; `None` is the distance at rest.
    pub rest_length: Option<f64>,
}

/// Connective tissue between the surfaces of two bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct Tie {
    /// The name, or "tie 0" and so on.
    pub name: String,
    /// The patch whose points are tied.
    pub from: Patch,
    /// What they are tied to, of another body.
    pub to: Patch,
    /// Points further apart at rest are not tied [m].
    pub distance: f64,
    /// Stiffness per area [Pa/m].
    pub stiffness: f64,
    /// Stress at which a point tears off [Pa]; `None` where nothing tears it.
    pub strength: Option<f64>,
    /// Where the scene has it.
    pub place: Place,
}

impl ContactSettings {
    /// As models have it.
    pub fn tissue(&self) -> TissueContact {
        let Self { self_: itself, bodies, friction, stiffness, thickness } = *self;
        TissueContact { itself, bodies, law: ContactLaw { stiffness, thickness, friction } }
    }
}

/// Why a text is not a scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A key or value is wrong by itself.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// There is nothing to simulate.
    #[error("{place}: a scene needs a body; write [[body]] with a name, a shape and a material")]
    NoBody {
        /// Where the list of bodies is.
        place: Place,
    },
    /// Two of a kind have one name.
    #[error("{place}: there is already a {kind} named `{name}`; give this one another name")]
    NameTaken {
        /// Where the second is.
        place: Place,
        /// Body, motion and so on.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A reference to a body that does not exist.
    #[error("{place}: there is no body `{body}`; {hint}")]
    UnknownBody {
        /// Where the reference is.
        place: Place,
        /// The name.
        body: String,
        /// The nearest name, or all of them.
        hint: String,
    },
    /// A patch with no selector, or with several.
    #[error(
        "{place}: {purpose} has {count} selectors; write exactly one of box, sphere, half_space, \
         nearest, region, patch"
    )]
    SelectorCount {
        /// Where the patch is.
        place: Place,
        /// What the patch is for.
        purpose: String,
        /// How many there are.
        count: usize,
    },
    /// A selector that cannot contain anything.
    #[error("{place}: {purpose}: the box's min is beyond its max along {axis}; swap them")]
    InvertedBox {
        /// Where the patch is.
        place: Place,
        /// What the patch is for.
        purpose: String,
        /// x, y or z.
        axis: char,
    },
    /// A body without a mesh, or with keys that do not go together.
    #[error("{place}: body `{body}`: {problem}")]
    Shape {
        /// Where the body is.
        place: Place,
        /// The body.
        body: String,
        /// What is wrong and what to write.
        problem: String,
    },
    /// A tie between patches of one body.
    #[error("{place}: {purpose} ties body `{body}` to itself; name another body in `to`")]
    TieToItself {
        /// Where the tie is.
        place: Place,
        /// What it is.
        purpose: String,
        /// The body.
        body: String,
    },
    /// A tool without sizes, or with keys that do not go together.
    #[error("{place}: {purpose}: {problem}")]
    Tool {
        /// Where the tool is.
        place: Place,
        /// Which tool, in messages: "tool `probe`".
        purpose: String,
        /// What is wrong and what to write.
        problem: String,
    },
    /// A material that says too little.
    #[error("{place}: {owner} needs a `young` or a `preset`, for example preset = \"liver\"")]
    NoMaterial {
        /// Where the material is missing.
        place: Place,
        /// The body.
        owner: String,
    },
    /// A material that cannot be.
    #[error("{place}: {owner}: {error}")]
    Material {
        /// Where the material is.
        place: Place,
        /// The body or region.
        owner: String,
        /// Why not.
        error: MaterialError,
    },
    /// Times of keys that do not ascend, or none.
    #[error("{place}: {purpose}: {problem}")]
    Keys {
        /// Where the keys are.
        place: Place,
        /// What the keys are for.
        purpose: String,
        /// What is wrong and what to write.
        problem: String,
    },
    /// More frames than anybody waits for.
    #[error(
        "{name}: {frames:.1e} frames are too many; shorten time.duration or lengthen time.frame"
    )]
    TooManyFrames {
        /// The scene.
        name: String,
        /// How many there would be.
        frames: f64,
    },
    /// A change that is no setting.
    #[error(
        "{place}: `{setting}` is no change; write KEY = VALUE, for example \
             \"solver.iterations = 20\""
    )]
    ChangeText {
        /// Where the change is.
        place: Place,
        /// What is written.
        setting: String,
    },
    /// A change that cannot be made.
    #[error("{place}: the change at {time} s: {error}")]
    Change {
        /// Where the change is.
        place: Place,
        /// When it was to happen [s].
        time: f64,
        /// Why not.
        error: Box<SceneError>,
    },
    /// A change of what cannot change while a scene runs.
    #[error(
        "`{key}` cannot change while the scene runs; of `solver` all but `solver.precision` can, `world`, and \
         the materials of bodies, such as `body.NAME.material.young`"
    )]
    FixedKey {
        /// The key.
        key: String,
    },
    /// A hand that takes a tool which is not there.
    #[error("{place}: there is no tool `{tool}`; {hint}")]
    UnknownTool {
        /// Where the hand is.
        place: Place,
        /// The name.
        tool: String,
        /// The nearest name, or all of them.
        hint: String,
    },
    /// A selector finds nothing.
    #[error("{place}: {purpose} selects nothing: {error}")]
    Selection {
        /// Where the selector is.
        place: Place,
        /// What it is for.
        purpose: String,
        /// Why.
        error: Box<SelectError>,
    },
}

impl Scene {
    /// How many frames the scene lasts: its duration in frames, rounded, at least one.
    pub fn frame_count(&self) -> u64 {
        (self.time.duration / self.time.frame).round().max(1.0) as u64
    }

    /// The files the scene needs, as it names them, each once.
    pub fn files(&self) -> Vec<&str> {
        let mut files: Vec<&str> = Vec::new();
        for body in &self.bodies {
            if let BodyShape::File { mesh, surface, .. } = &body.shape {
                for file in std::iter::once(mesh).chain(surface) {
                    if !files.contains(&file.as_str()) {
                        files.push(file);
                    }
                }
            }
        }
        for tool in &self.tools {
            if let Course::File { path } = &tool.course
                && !files.contains(&path.as_str())
            {
                files.push(path);
            }
            for solid in &tool.solids {
                if let SolidSource::File { mesh, .. } = &solid.source
                    && !files.contains(&mesh.as_str())
                {
                    files.push(mesh);
                }
            }
        }
        files
    }
}
