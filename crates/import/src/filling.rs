//! Edges that are short enough for a body to keep its volume.
//!
//! ```text
//! mean thickness:   t = 2 V/A     of a plate its thickness, of a rod half, of a ball a third of its diameter
//! ```
//!
//! A body is filled with the edges that are asked for, or with shorter ones where it is thin; then with shorter and shorter ones
//! until it has its volume and no more parts than its shape, as long as that costs no more than all bodies together were to cost.

use viscera::mesh::tetrahedralize::{TetrahedralizeError, TetrahedralizeReport};
use viscera::mesh::winding::{FillError, NoInside};
use viscera::mesh::{SurfaceMesh, TetMesh};

/// A lattice has vertices inside of a wall everywhere where it is so many edges thick.
pub const RESOLVED: f64 = 1.3;

/// A body has its volume where it is off by less than this share.
pub const KEPT: f64 = 0.02;

/// An edge is no longer than this share of the cube root of a body's volume.
const COARSEST: f64 = 0.4;

/// From one try to the next.
const FINER: f64 = 0.75;

/// What a body is to be like.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Its volume [m^3].
    pub volume: f64,
    /// How many unconnected parts it has.
    pub parts: usize,
}

/// A filled body.
pub struct Filled {
    pub mesh: TetMesh,
    pub report: TetrahedralizeReport,
    /// The share of its boundary that lies where its surface has no triangles.
    pub invented: f64,
    /// The edges that it was filled with [m].
    pub spacing: f64,
}

impl Filled {
    /// Of a shape without holes.
    pub fn new((mesh, report): (TetMesh, TetrahedralizeReport), spacing: f64) -> Self {
        Self { mesh, report, invented: 0.0, spacing }
    }
}

/// Whether a shape was not found: shorter edges may find it.
pub trait Missed {
    fn is_missed(&self) -> bool;
}

impl Missed for TetrahedralizeError {
    fn is_missed(&self) -> bool {
        matches!(self, Self::Empty | Self::TooCoarse { .. })
    }
}

impl Missed for FillError {
    fn is_missed(&self) -> bool {
        match self {
            // Nothing is inside where no vertex of the lattice is.
            Self::Inside(problem) => matches!(problem, NoInside::Open { .. }),
            Self::Fill(error) => error.is_missed(),
        }
    }
}

/// Edges [m] that resolve a body of this volume [m^3] and surface, at most as long as those that are asked for and no shorter
/// than the finest.
pub fn first_spacing(volume: f64, skin: &SurfaceMesh, asked: f64, finest: f64) -> f64 {
    let thickness = 2.0 * volume / skin.area();
    let resolving = (thickness / RESOLVED).min(COARSEST * libm::cbrt(volume));
    // What a body needs is no reason to take longer edges than are asked for.
    resolving.max(finest).min(asked)
}

/// Fills with edges of a length [m], and with shorter ones down to the finest until the body is as it is wanted.
pub fn fill_to<E: Missed>(
    wanted: Wanted,
    first: f64,
    finest: f64,
    mut fill: impl FnMut(f64) -> Result<Filled, E>,
) -> Result<Filled, E> {
    let off = |filled: &Filled| (filled.mesh.volume() / wanted.volume - 1.0).abs();
    let mut best: Option<Filled> = None;
    let mut spacing = first;
    loop {
        let is_last = spacing <= finest;
        match (fill(spacing), &best) {
            (Ok(filled), known) => {
                let is_kept = off(&filled) <= KEPT;
                let is_done = is_kept && filled.report.components <= wanted.parts;
                let is_better = known.as_ref().is_none_or(|best| off(&filled) < off(best));
                if is_better || is_kept {
                    best = Some(filled);
                }
                if is_done {
                    break;
                }
            }
            (Err(error), None) if is_last || !error.is_missed() => return Err(error),
            // What there is is the best.
            (Err(error), Some(_)) if !error.is_missed() => break,
            _ => {}
        }
        if is_last {
            break;
        }
        spacing = (spacing * FINER).max(finest);
    }
    // Without any the last error was returned.
    match best {
        Some(filled) => Ok(filled),
        None => fill(finest),
    }
}
