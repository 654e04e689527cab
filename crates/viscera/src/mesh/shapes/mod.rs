//! Ready-made shapes, so that a simulation needs no file.
//!
//! | shape | tetrahedra | fine surface |
//! |---|---|---|
//! | [`block`], [`beam`] | structured: every box of a grid is split alike | the boundary itself |
//! | [`sphere`], [`capsule`], [`liver`] | isosurface stuffing | up to three times as fine, for pictures |
//! | [`turned`], [`lofted`] | none | a surface around an axis, or between sections |

mod block;
mod swept;

use super::distance::{Capsule, SignedDistance, Sphere};
use super::liver::Liver;
use super::tetrahedralize::{TetrahedralizeError, TetrahedralizeReport, surface, tetrahedralize};
use super::{MeshError, SurfaceMesh, TetMesh};
use crate::scalar::{Vec3, vec3};

pub use block::{Block, Splitting};
pub use swept::{lofted, turned};

/// The fine surface's spacing is this fraction of the tetrahedra's: a surface triangle is then an
/// order of magnitude smaller than a tetrahedron's face, and pictures look smooth.
const SURFACE_FRACTION: f64 = 1.0 / 3.0;

/// But it is at least this fraction of the shape's longest side, unless the tetrahedra are finer
/// still: some fifty thousand triangles, beyond which a picture gains nothing.
const SURFACE_RESOLUTION: f64 = 1.0 / 100.0;

/// A curved shape: tetrahedra to compute with and a finer surface to show.
#[derive(Clone, Debug, PartialEq)]
pub struct CurvedShape {
    /// The tetrahedra, all in region 0.
    pub tets: TetMesh,
    /// The same shape's surface, up to three times as fine.
    pub surface: SurfaceMesh,
    /// How the filling went.
    pub report: TetrahedralizeReport,
}

/// Why a shape cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// A length that is not positive and finite.
    #[error("the {name} is {value} m; give a positive, finite length")]
    Length {
        /// Which length.
        name: &'static str,
        /// What was asked for `[m]`.
        value: f64,
    },
    /// A factor that is not positive and finite.
    #[error("the scale is {value}; give a positive, finite factor")]
    Scale {
        /// What was asked for.
        value: f64,
    },
    /// An axis without cells.
    #[error("a grid of {} x {} x {} cells is empty; every axis needs at least one", cells[0], cells[1], cells[2])]
    NoCells {
        /// What was asked for.
        cells: [usize; 3],
    },
    /// Too many tetrahedra.
    #[error("that takes {tets:.3e} tetrahedra, more than {MAX_TETS}; use fewer or larger cells")]
    TooManyTets {
        /// How many it would take.
        tets: f64,
    },
    /// A displacement that could turn tetrahedra inside out.
    #[error("a jitter of {jitter} is outside 0 to 0.9; beyond that tetrahedra can go flat")]
    Jitter {
        /// What was asked for.
        jitter: f64,
    },
    /// A cut that is none, or leaves nothing together.
    #[error(
        "a cut of {cut} of the height is outside 0 to below 1; give the share of the height that is cut, such as 0.6"
    )]
    Cut {
        /// What was asked for.
        cut: f64,
    },
    /// The filling failed.
    #[error(transparent)]
    Tetrahedralize(#[from] TetrahedralizeError),
    /// The mesh was refused.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Largest structured mesh `[tetrahedra]`: about two gigabytes with its vertices.
pub const MAX_TETS: usize = 50_000_000;

/// A block from the origin to `size` `[m]`, `cells` boxes along each axis, split by
/// [`Splitting::Five`]. More choices: [`Block`].
pub fn block(size: Vec3<f64>, cells: [usize; 3]) -> Result<TetMesh, ShapeError> {
    Block::new(size, cells).mesh()
}

/// A beam along +x from the plane x = 0, its cross-section centred on the x axis: `length` by
/// `width` (along y) by `height` (along z) `[m]`.
///
/// `cells_across` counts boxes over the thinner side of the cross-section; the other counts follow
/// so that boxes are as cubic as can be. `cut` is the depth of a cut across its middle, see [`Block::cut`].
pub fn beam(
    length: f64,
    width: f64,
    height: f64,
    cells_across: usize,
    cut: f64,
) -> Result<TetMesh, ShapeError> {
    check_length("beam's length", length)?;
    check_length("beam's width", width)?;
    check_length("beam's height", height)?;
    let edge = width.min(height) / cells_across as f64;
    // The cast saturates; what is too many is refused with the block.
    let cells = [length, width, height].map(|side| (side / edge).round().max(1.0) as usize);
    let cells = if cells_across == 0 { [0; 3] } else { cells };
    let mut block = Block::new(vec3(length, width, height), cells);
    block.corner = vec3(0.0, -0.5 * width, -0.5 * height);
    block.cut = cut;
    block.mesh()
}

/// A ball around the origin: `radius` `[m]`, lattice `spacing` `[m]`.
pub fn sphere(radius: f64, spacing: f64) -> Result<CurvedShape, ShapeError> {
    check_length("sphere's radius", radius)?;
    fill(&Sphere { center: Vec3::ZERO, radius }, spacing)
}

/// A capsule along x around the origin: a cylinder of `radius` and `length` `[m]`, without the caps,
/// closed by half-balls; lattice `spacing` `[m]`.
pub fn capsule(radius: f64, length: f64, spacing: f64) -> Result<CurvedShape, ShapeError> {
    check_length("capsule's radius", radius)?;
    check_length("capsule's length", length)?;
    let end = vec3(0.5 * length, 0.0, 0.0);
    fill(&Capsule { start: -end, end, radius }, spacing)
}

/// The procedural [`Liver`], life-size at `scale` 1; lattice `spacing` `[m]`, of which
/// [`LIVER_SPACING`] times the scale makes about three thousand tetrahedra.
pub fn liver(spacing: f64, scale: f64) -> Result<CurvedShape, ShapeError> {
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(ShapeError::Scale { value: scale });
    }
    fill(&Liver::scaled(scale), spacing)
}

/// Lattice spacing `[m]` that fills the life-size liver with about three thousand tetrahedra: enough
/// to bend both lobes, few enough for a real-time step on one core.
pub const LIVER_SPACING: f64 = 0.0186;

fn fill(shape: &dyn SignedDistance, spacing: f64) -> Result<CurvedShape, ShapeError> {
    let (tets, report) = tetrahedralize(shape, spacing)?;
    let (lower, upper) = shape.bounds();
    let size = upper - lower;
    let least = size.x.max(size.y).max(size.z) * SURFACE_RESOLUTION;
    let surface = surface(shape, (spacing * SURFACE_FRACTION).max(least).min(spacing))?;
    Ok(CurvedShape { tets, surface, report })
}

fn check_length(name: &'static str, value: f64) -> Result<(), ShapeError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ShapeError::Length { name, value }) }
}
