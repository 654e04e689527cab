//! Meshes: tetrahedra that carry the physics, surfaces that carry the looks.
//!
//! A [`TetMesh`] can only be built valid: finite vertices, indices in range, no tetrahedron flat
//! relative to its own size, every tetrahedron wound so that its volume is positive.

pub mod distance;
pub mod embed;
mod lattice;
pub mod liver;
pub mod shapes;
pub mod tetrahedralize;

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

/// What had to be put right to make a mesh usable; zero everywhere for a clean mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshRepairs {
    /// Tetrahedra whose winding was reversed.
    pub rewound_tets: usize,
}

/// Why numbers are not a mesh. Indices count from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A tetrahedron refers to a vertex that does not exist.
    #[error("tetrahedron {tet} refers to vertex {vertex}; the mesh has {vertex_count}")]
    IndexOutOfRange {
        /// The tetrahedron.
        tet: usize,
        /// The index it names.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
}

impl TetMesh {
    /// Checks the numbers, repairs what can be repaired (winding) and builds the mesh.
    ///
    /// `vertices` [m], shape [vertex_count]; `tets` and `regions`, shape [tet_count].
    pub fn new(
        vertices: Vec<Vec3<f64>>,
        mut tets: Vec<[u32; 4]>,
        regions: Vec<u32>,
    ) -> Result<(Self, MeshRepairs), MeshError> {
        let mut repairs = MeshRepairs::default();
        for (index, tet) in tets.iter_mut().enumerate() {
            for &vertex in tet.iter() {
                if vertex as usize >= vertices.len() {
                    let vertex_count = vertices.len();
                    return Err(MeshError::IndexOutOfRange { tet: index, vertex, vertex_count });
                }
            }
            if tet_volume(tet.map(|v| vertices[v as usize])) < 0.0 {
                tet.swap(2, 3);
                repairs.rewound_tets += 1;
            }
        }
        Ok((Self { vertices, tets, regions }, repairs))
    }

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
