//! Tetrahedra by their corners, and lists of them: what needs no mesh.

use std::f64::consts::SQRT_2;

use crate::scalar::{Mat3, Vec3};

/// The faces of a positively wound tetrahedron as corners, wound outwards; face i is opposite to
/// corner i.
pub const TET_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The six edges of a tetrahedron as pairs of corners.
pub const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Lengths `[m]` of the six edges, in the order of [`TET_EDGES`].
pub fn edge_lengths(x: [Vec3<f64>; 4]) -> [f64; 6] {
    TET_EDGES.map(|[a, b]| (x[b] - x[a]).length())
}

/// Shape quality in `[-1, 1]`, see the head of this module. Zero where all corners coincide.
pub fn shape_quality(x: [Vec3<f64>; 4]) -> f64 {
    let squares = TET_EDGES.map(|[a, b]| (x[b] - x[a]).length_squared());
    let mean_square = squares.iter().sum::<f64>() / 6.0;
    if mean_square > 0.0 {
        6.0 * SQRT_2 * tet_volume(x) / (mean_square * mean_square.sqrt())
    } else {
        0.0
    }
}

/// Signed volume `[m^3]` of a tetrahedron: `det(Ds) / 6`.
pub fn tet_volume(x: [Vec3<f64>; 4]) -> f64 {
    edge_matrix(x).determinant() / 6.0
}

/// Edge vectors from corner 0 as columns, `[m]`: `Ds = [x1-x0, x2-x0, x3-x0]`.
pub fn edge_matrix(x: [Vec3<f64>; 4]) -> Mat3<f64> {
    Mat3::from_columns(x[1] - x[0], x[2] - x[0], x[3] - x[0])
}

/// One side of a face: which tetrahedron has it, and as which of its faces.
pub(super) struct FaceSide {
    /// Vertices, ascending: equal for all sides of a face.
    pub key: [u32; 3],
    pub tet: u32,
    pub face: u8,
    /// True if the outward winding is an even permutation of `key`.
    pub even: bool,
}

/// All sides of all faces; the sides of one face follow one another, by tetrahedron.
pub(super) fn sorted_face_sides(tets: &[[u32; 4]]) -> Vec<FaceSide> {
    let mut sides = Vec::with_capacity(4 * tets.len());
    for (tet, corners) in tets.iter().enumerate() {
        for (face, local) in TET_FACES.iter().enumerate() {
            let [a, b, c] = local.map(|corner| corners[corner]);
            let mut key = [a, b, c];
            key.sort_unstable();
            // Sorting three different numbers is an even permutation exactly for the rotations.
            let even = key == [a, b, c] || key == [b, c, a] || key == [c, a, b];
            sides.push(FaceSide { key, tet: tet as u32, face: face as u8, even });
        }
    }
    sides.sort_unstable_by_key(|side| (side.key, side.tet));
    sides
}

/// A tetrahedron that is the third on a face, with that face, if there is one.
pub(super) fn find_crowded_face(tets: &[[u32; 4]]) -> Option<(usize, [u32; 3])> {
    sorted_face_sides(tets)
        .chunk_by(|a, b| a.key == b.key)
        .filter_map(|sides| sides.get(2).map(|third| (third.tet as usize, third.key)))
        .min()
}

/// Vertices on faces that belong to one tetrahedron only, or to two of different regions.
pub(super) fn boundary_vertices(tets: &[[u32; 4]], regions: &[u32], count: usize) -> Vec<bool> {
    let mut is_boundary = vec![false; count];
    for sides in sorted_face_sides(tets).chunk_by(|a, b| a.key == b.key) {
        let region = |side: &FaceSide| regions[side.tet as usize];
        let is_inside = sides.len() == 2 && region(&sides[0]) == region(&sides[1]);
        if !is_inside {
            sides[0].key.iter().for_each(|&v| is_boundary[v as usize] = true);
        }
    }
    is_boundary
}

/// The smallest box along the axes that holds all points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoundingBox {
    /// Lowest corner `[m]`.
    pub min: Vec3<f64>,
    /// Highest corner `[m]`.
    pub max: Vec3<f64>,
}

impl BoundingBox {
    /// The box around points `[m]`; a single point at the origin if there are none.
    pub fn around(points: &[Vec3<f64>]) -> Self {
        let Some((&first, rest)) = points.split_first() else {
            return Self::default();
        };
        rest.iter().fold(Self { min: first, max: first }, |bounds, &point| Self {
            min: bounds.min.min(point),
            max: bounds.max.max(point),
        })
    }

    /// Extent along the axes `[m]`.
    pub fn size(&self) -> Vec3<f64> {
        self.max - self.min
    }

    /// How far a point is from it, squared [m^2]; zero inside.
    pub fn distance_squared(&self, p: Vec3<f64>) -> f64 {
        (self.min - p).max(p - self.max).max(Vec3::ZERO).length_squared()
    }

    /// Centre `[m]`.
    pub fn center(&self) -> Vec3<f64> {
        (self.min + self.max) * 0.5
    }
}
