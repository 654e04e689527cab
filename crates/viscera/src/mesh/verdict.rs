//! What is wrong with a mesh that can be read.

use std::fmt;

use super::TetMesh;
use super::quality::dihedral_angles;

/// Tissue in tetrahedra with smaller dihedral angles [degrees] is stiffer than it should be, and its stress is wrong.
pub const POOR_ANGLE: usize = 5;

/// What makes a mesh simulate badly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Problem {
    /// Faces whose two tetrahedra overlap.
    Folded {
        /// How many.
        faces: usize,
    },
    /// Tetrahedra with dihedral angles below [`POOR_ANGLE`], or above 180 degrees less than that.
    Slivers {
        /// How many of their angles.
        angles: usize,
        /// As a share of all angles.
        share: f64,
    },
    /// Parts that no tetrahedron ties together.
    Parts {
        /// How many.
        count: usize,
    },
    /// Edges of a surface that do not have exactly two triangles.
    Open {
        /// How many.
        edges: usize,
    },
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folded { faces } => {
                write!(f, "tetrahedra overlap at {faces} faces: some are inside out")
            }
            Self::Slivers { angles, share } => {
                let percent = 100.0 * share;
                let percent =
                    if percent < 0.1 { "below 0.1".to_owned() } else { format!("{percent:.1}") };
                write!(
                    f,
                    "{angles} dihedral angles ({percent} %) are below {POOR_ANGLE} degrees or above {}: tissue is too stiff there, and its stress wrong",
                    180 - POOR_ANGLE
                )
            }
            Self::Parts { count } => {
                write!(f, "it has {count} unconnected parts: what is not held falls")
            }
            Self::Open { edges } => {
                write!(
                    f,
                    "{edges} edges do not have exactly two triangles: holes, or parts that cross"
                )
            }
        }
    }
}

/// Of a bin of [`count_angles`] [degrees].
pub const DEGREES: usize = 5;

/// How many dihedral angles lie in each bin of [`DEGREES`] from 0 to 180, shape `[36]`.
pub fn count_angles(mesh: &TetMesh) -> Vec<usize> {
    let mut counts = vec![0; 180 / DEGREES];
    for tet in 0..mesh.tets().len() {
        for angle in dihedral_angles(mesh.corners(tet)) {
            let bin = (angle.to_degrees() / DEGREES as f64) as usize;
            let last = counts.len() - 1;
            counts[bin.min(last)] += 1;
        }
    }
    counts
}
