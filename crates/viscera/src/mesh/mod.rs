//! Meshes: tetrahedra that carry the physics, surfaces that carry the looks.
//!
//! A [`TetMesh`] can only be built valid: finite vertices, indices in range, no tetrahedron flat
//! relative to its own size, every tetrahedron wound so that its volume is positive.

use crate::scalar::{Mat3, Vec3};

/// A tetrahedral mesh in SI units. Valid by construction, see [`TetMesh::new`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    vertices: Vec<Vec3<f64>>,
    tets: Vec<[u32; 4]>,
    regions: Vec<u32>,
}

/// A triangle mesh in SI units, used to show an organ. Triangles are wound outwards
/// (counter-clockwise seen from outside).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceMesh {
    /// Positions [m], shape [vertex_count].
    pub vertices: Vec<Vec3<f64>>,
    /// Vertex indices, shape [triangle_count].
    pub triangles: Vec<[u32; 3]>,
}

impl TetMesh {
    /// Positions [m], shape [vertex_count].
    pub fn vertices(&self) -> &[Vec3<f64>] {
        &self.vertices
    }

    /// Four vertex indices per tetrahedron, positively wound, shape [tet_count].
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.tets
    }

    /// Region label per tetrahedron (Gmsh physical group, VTU cell array), shape [tet_count].
    pub fn regions(&self) -> &[u32] {
        &self.regions
    }

    /// The four corner positions [m] of a tetrahedron.
    pub fn corners(&self, tet: usize) -> [Vec3<f64>; 4] {
        self.tets[tet].map(|v| self.vertices[v as usize])
    }
}

/// Edge vectors from corner 0 as columns, [m]: `Ds = [x1-x0, x2-x0, x3-x0]`.
pub fn edge_matrix(x: [Vec3<f64>; 4]) -> Mat3<f64> {
    Mat3::from_columns(x[1] - x[0], x[2] - x[0], x[3] - x[0])
}

/// Signed volume [m^3] of a tetrahedron: `det(Ds) / 6`.
pub fn tet_volume(x: [Vec3<f64>; 4]) -> f64 {
    edge_matrix(x).determinant() / 6.0
}
