//! Why a scene cannot be put together.

use crate::contact::SolidError;
use crate::mesh::MeshError;
use crate::mesh::embed::EmbeddingError;
use crate::mesh::io::ReadError;
use crate::mesh::shapes::ShapeError;
use crate::model::ModelError;
use crate::scene::{PathError, RegionLabel, SceneError};
use crate::settings::Place;

/// Tetrahedra that refinement makes at most: some gigabytes. Finer meshes are read from files.
pub(super) const MOST_REFINED: usize = 10_000_000;

/// Why a scene cannot be put together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AssembleError {
    /// A file could not be loaded; the caller's words.
    #[error("{message}")]
    Load {
        /// What the caller said.
        message: String,
    },
    /// A mesh file is damaged or of another kind.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A shape cannot be made.
    #[error("body `{body}`: {error}")]
    Shape {
        /// The body.
        body: String,
        /// Why not.
        error: ShapeError,
    },
    /// A placement that takes a mesh out of the world.
    #[error("body `{body}` where the scene puts it: {error}")]
    Placement {
        /// The body.
        body: String,
        /// Why not.
        error: MeshError,
    },
    /// A refinement with more tetrahedra than a machine has memory for.
    #[error(
        "body `{body}`: `refine = {refine}` makes {count} tetrahedra of {before}, more than {MOST_REFINED}; lower it"
    )]
    TooFine {
        /// The body.
        body: String,
        /// How often it was to be refined.
        refine: u32,
        /// Tetrahedra before.
        before: usize,
        /// And after.
        count: usize,
    },
    /// A surface that cannot be bound to its tetrahedra.
    #[error("body `{body}`: {error}")]
    Embedding {
        /// The body.
        body: String,
        /// Why not.
        error: EmbeddingError,
    },
    /// A material for a region that the mesh does not have.
    #[error("body `{body}` has no region {label}; its regions are {known}")]
    UnknownRegion {
        /// The body.
        body: String,
        /// The label given.
        label: RegionLabel,
        /// The labels there are.
        known: String,
    },
    /// A patch selects nothing.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A spring between two patches without two different points.
    #[error("{spring} finds no two vertices apart from each other; choose other patches")]
    Spring {
        /// The spring.
        spring: String,
    },
    /// A ball that gives no tetrahedron its label.
    #[error(
        "body `{body}`, region {label}: no tetrahedron has its middle in the ball, the nearest one is {:.3} mm outside; \
         move or enlarge the ball, or take a finer mesh", 1e3 * .distance
    )]
    EmptyBall {
        /// The body.
        body: String,
        /// The region's label.
        label: u32,
        /// From the ball to the nearest middle [m].
        distance: f64,
    },
    /// A tool's path cannot be read.
    #[error("{place}: tool `{tool}`: {error}")]
    Path {
        /// Where the scene has the tool.
        place: Place,
        /// The tool.
        tool: String,
        /// Why not.
        error: Box<PathError>,
    },
    /// A surface that is no solid.
    #[error("{place}: tool `{tool}`: {file}{error}")]
    Solid {
        /// Where the scene has the tool.
        place: Place,
        /// The tool.
        tool: String,
        /// The file and a colon, or nothing where none has the surface.
        file: String,
        /// Why not.
        error: Box<SolidError>,
    },
    /// Jaws from a file that are none.
    #[error("{place}: tool `{tool}`: {problem}")]
    Jaws {
        /// Where the scene has the tool.
        place: Place,
        /// The tool.
        tool: String,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A tool that would slip between the samples of a surface.
    #[error(
        "{place}: tool `{tool}` has a radius of {:.3} mm at its thinnest, and `{body}` is touched at points about {:.3} \
         mm apart; take a finer mesh of `{body}` or a thicker tool", 1e3 * .radius, 1e3 * .spacing
    )]
    ThinTool {
        /// Where the scene has the tool.
        place: Place,
        /// The tool.
        tool: String,
        /// The body.
        body: String,
        /// Of the tool's thinnest part [m].
        radius: f64,
        /// Of the body's samples [m].
        spacing: f64,
    },
    /// A tool that begins where tissue is.
    #[error(
        "{place}: tool `{tool}` begins {:.3} mm inside body `{body}`; move its position away from it", 1e3 * .depth
    )]
    ToolInside {
        /// Where the scene has the tool.
        place: Place,
        /// The tool.
        tool: String,
        /// The body.
        body: String,
        /// The deepest sample's [m].
        depth: f64,
    },
    /// Bodies that are deep inside each other at rest.
    #[error(
        "bodies `{one}` and `{other}` overlap by {:.2} mm at rest, more than contact is thick ({:.2} mm); move one of them, \
         or let bodies pass through each other with `contact.bodies = false`", 1e3 * .depth, 1e3 * .thickness
    )]
    BodiesOverlap {
        /// One of them.
        one: String,
        /// The other.
        other: String,
        /// How deep [m].
        depth: f64,
        /// Of contact [m].
        thickness: f64,
    },
    /// A tie between patches that are far apart.
    #[error(
        "{place}: tie `{tie}` ties nothing: no point of `from` is within {:.3} mm of `to`, the nearest is {:.3} mm away; raise \
         `distance`, or choose other patches", 1e3 * .distance, 1e3 * .nearest
    )]
    TiesNothing {
        /// Where the scene has it.
        place: Place,
        /// The tie.
        tie: String,
        /// Its distance [m].
        distance: f64,
        /// Of the nearest points [m].
        nearest: f64,
    },
    /// A body that cannot rest under gravity as it was given.
    #[error(transparent)]
    Balance(#[from] BalanceError),
    /// The model cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// Why a body does not rest under gravity as it was given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BalanceError {
    /// Nothing carries its weight.
    #[error(
        "body `{body}` is to be balanced, and no fixing holds it, nor a tie to a body that is held, so that nothing carries \
         its weight; hold some of it, or leave out `balanced`"
    )]
    NotHeld {
        /// The body.
        body: String,
    },
    /// Ties along a line carry it.
    #[error(
        "body `{body}` is to be balanced, and would turn about the few points that tie it; tie more of it, hold some of it, or \
         leave out `balanced`"
    )]
    Turns {
        /// The body.
        body: String,
    },
    /// Its tissue is too soft.
    #[error(
        "body `{body}` cannot rest under gravity as it was given: whatever shape it had without load, it would not carry its \
         weight (rho g L/E is {:.2}); {}, or hold more of it, or leave out `balanced`", .softness, .way_out
    )]
    TooSoft {
        /// The body.
        body: String,
        /// The weight of its longest extent, per area, over Young's modulus.
        softness: f64,
        /// Which density or stiffness it could carry.
        way_out: String,
    },
    /// Its shape without load is none.
    #[error(transparent)]
    Model(#[from] ModelError),
}
