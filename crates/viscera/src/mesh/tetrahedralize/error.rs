//! Why a shape cannot be filled with tetrahedra.

use crate::mesh::MeshError;

/// Largest lattice `[vertices]`: about half a gigabyte of signs and indices.
pub const MAX_LATTICE_VERTICES: usize = 100_000_000;

/// Why a shape cannot be filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TetrahedralizeError {
    /// The spacing is not a positive number.
    #[error("a lattice spacing of {spacing} m is impossible; give a positive length")]
    Spacing {
        /// What was asked for `[m]`.
        spacing: f64,
    },
    /// The bounds are not finite, or the upper corner is below the lower one.
    #[error("the shape's bounds are not a box: check that its sizes are positive and finite")]
    Bounds,
    /// The lattice would be too large.
    #[error(
        "a spacing of {spacing} m needs {lattice_vertices:.3e} lattice vertices, more than \
         {MAX_LATTICE_VERTICES}; use at least {suggestion:.3e} m"
    )]
    TooFine {
        /// What was asked for `[m]`.
        spacing: f64,
        /// How many lattice vertices that takes.
        lattice_vertices: f64,
        /// A spacing that fits `[m]`.
        suggestion: f64,
    },
    /// No lattice vertex fell inside, or the few that did moved onto the surface.
    #[error(
        "a spacing of {spacing} m misses the shape, whose box is {:.3e} x {:.3e} x {:.3e} m; use at most {suggestion:.3e} m",
        size[0], size[1], size[2]
    )]
    TooCoarse {
        /// What was asked for `[m]`.
        spacing: f64,
        /// Edge lengths of the shape's box `[m]`.
        size: [f64; 3],
        /// A spacing that finds the shape `[m]`.
        suggestion: f64,
    },
    /// The function is negative nowhere, as far as could be found.
    #[error("the distance function is negative nowhere within its bounds: the shape is empty")]
    Empty,
    /// The shape reaches past its bounds.
    #[error("the shape reaches past its bounds at ({}, {}, {}) m; enlarge them", point[0], point[1], point[2])]
    BoundsTooTight {
        /// A point inside the shape on the rim of the lattice `[m]`.
        point: [f64; 3],
    },
    /// The function returned something that is not a number.
    #[error("the distance at ({}, {}, {}) m is not a finite number", point[0], point[1], point[2])]
    NotFinite {
        /// Where `[m]`.
        point: [f64; 3],
    },
    /// The mesh was refused.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}
