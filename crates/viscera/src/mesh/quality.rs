//! Shape of tetrahedra.
//!
//! Shape quality, the volume-length measure: `q = 6 sqrt(2) V / l_rms^3`, with the signed volume
//! `V` and the root mean square `l_rms` of the six edges. It is 1 for the regular tetrahedron, 0
//! for a flat one, negative for an inverted one, and does not depend on size or placement.
//! V. N. Parthasarathy, C. M. Graichen, A. F. Hathaway, "A comparison of tetrahedron quality
//! measures", Finite Elements in Analysis and Design 15 (1994); J. R. Shewchuk, "What is a good
//! linear finite element?" (2002), section 6.
//!
//! Dihedral angle at the edge of two faces with outward normals `m` and `n`:
//! `atan2(|m x n|, -m . n)`, accurate for small and for flat angles alike.

use super::TetMesh;
use super::corners::TET_FACES;
pub use super::corners::{TET_EDGES, edge_lengths, shape_quality};
use crate::scalar::Vec3;

/// Dihedral angles `[rad]` at the six edges, in the order of [`TET_EDGES`].
pub fn dihedral_angles(x: [Vec3<f64>; 4]) -> [f64; 6] {
    let normals = TET_FACES.map(|[a, b, c]| (x[b] - x[a]).cross(x[c] - x[a]));
    // Two faces meet at the edge that neither is opposite to: edge (a, b) and faces c, d.
    TET_EDGES.map(|[a, b]| {
        let mut faces = (0..4).filter(|&corner| corner != a && corner != b);
        let (m, n) = match (faces.next(), faces.next()) {
            (Some(c), Some(d)) => (normals[c], normals[d]),
            _ => return 0.0,
        };
        libm::atan2(m.cross(n).length(), -m.dot(n))
    })
}

/// Shape of a whole mesh.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct QualitySummary {
    /// Lowest shape quality, dimensionless, 0 to 1.
    pub worst: f64,
    /// The tetrahedron that has it.
    pub worst_tet: usize,
    /// Mean shape quality, dimensionless, 0 to 1.
    pub mean: f64,
    /// Smallest dihedral angle `[rad]`.
    pub min_dihedral: f64,
    /// Largest dihedral angle `[rad]`.
    pub max_dihedral: f64,
}

/// Worst and mean shape quality and the extreme dihedral angles of a mesh.
pub fn summarize_quality(mesh: &TetMesh) -> QualitySummary {
    let mut summary = QualitySummary {
        worst: f64::INFINITY,
        worst_tet: 0,
        mean: 0.0,
        min_dihedral: f64::INFINITY,
        max_dihedral: 0.0,
    };
    for tet in 0..mesh.tets().len() {
        let corners = mesh.corners(tet);
        let quality = shape_quality(corners);
        if quality < summary.worst {
            summary.worst = quality;
            summary.worst_tet = tet;
        }
        summary.mean += quality;
        for angle in dihedral_angles(corners) {
            summary.min_dihedral = summary.min_dihedral.min(angle);
            summary.max_dihedral = summary.max_dihedral.max(angle);
        }
    }
    summary.mean /= mesh.tets().len().max(1) as f64;
    summary
}

#[cfg(test)]
mod tests {
    use super::super::corners::tet_volume;
    use super::*;
    use crate::scalar::vec3;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn regular() -> [Vec3<f64>; 4] {
        [vec3(1., 1., 1.), vec3(-1., 1., -1.), vec3(1., -1., -1.), vec3(-1., -1., 1.)]
    }

    #[test]
    fn regular_tet_has_quality_one_and_dihedral_arccos_one_third() {
        // A handful of roundings each, so a few units in the last place.
        let tolerance = 16.0 * f64::EPSILON;
        let mut corners = regular();
        if tet_volume(corners) < 0.0 {
            corners.swap(2, 3);
        }
        assert!((shape_quality(corners) - 1.0).abs() < tolerance);
        for angle in dihedral_angles(corners) {
            assert!((angle - (1.0f64 / 3.0).acos()).abs() < tolerance);
        }
    }

    #[test]
    fn corner_tet_has_three_right_dihedrals() {
        let corners = [vec3(0., 0., 0.), vec3(1., 0., 0.), vec3(0., 1., 0.), vec3(0., 0., 1.)];
        let angles = dihedral_angles(corners);
        // The three edges at the right corner come first; the others have cos = 1/sqrt(3).
        for angle in &angles[..3] {
            assert!((angle - FRAC_PI_2).abs() < 16.0 * f64::EPSILON);
        }
        for angle in &angles[3..] {
            assert!((angle - (1.0 / 3f64.sqrt()).acos()).abs() < 16.0 * f64::EPSILON);
        }
    }

    #[test]
    fn quality_does_not_depend_on_size_and_changes_sign_with_winding() {
        let corners = regular().map(|x| x + vec3(0.1, 0.2, 0.3));
        let mut mirrored = corners;
        mirrored.swap(0, 1);
        assert_eq!(shape_quality(corners), -shape_quality(mirrored));
        // Powers of two scale without rounding.
        assert_eq!(shape_quality(corners), shape_quality(corners.map(|x| x * 2f64.powi(-20))));
    }

    #[test]
    fn needle_has_a_dihedral_near_zero_and_one_near_pi() {
        let h = 1e-7;
        let sliver = [vec3(-1., 0., 0.), vec3(1., 0., 0.), vec3(0., -1., h), vec3(0., 1., h)];
        let angles = dihedral_angles(sliver);
        let smallest = angles.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = angles.iter().copied().fold(0.0, f64::max);
        assert!(smallest > 0.0 && smallest < 4.0 * h, "{smallest}");
        assert!(largest < PI && largest > PI - 4.0 * h, "{largest}");
    }
}
