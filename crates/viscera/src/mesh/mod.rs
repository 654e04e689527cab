//! Meshes: tetrahedra that carry the physics, surfaces that carry the looks.
//!
//! A [`TetMesh`] can only be built valid: finite vertices, indices in range, no tetrahedron flat
//! relative to its own size, every tetrahedron wound so that its volume is positive, every vertex
//! part of some tetrahedron.

mod corners;
mod error;
mod inspect;
pub mod io;
pub mod quality;
pub mod refine;
pub mod topology;

pub use corners::{edge_matrix, tet_volume};
pub use error::{MeshError, MeshPlace};
pub use inspect::{MeshSummary, SurfaceSummary, inspect, inspect_surface};
pub use topology::boundary_surface;

pub mod distance;
pub mod embed;
mod lattice;
pub mod liver;
pub mod mend;
pub(crate) mod nearest;
pub mod normals;
pub mod shapes;
pub mod tetrahedralize;
pub mod verdict;
pub mod winding;

use crate::scalar::Vec3;

/// Largest coordinate `[m]`. Kernels multiply up to four lengths in single precision: `(1e9)^4` is
/// below its largest number, 3e38. A larger bound would let them overflow.
pub const MAX_COORDINATE: f64 = 1e9;

/// Shortest length `[m]` that the longest edge of a tetrahedron may have: `(1e-9)^4` is above the
/// smallest normal number in single precision, 1e-38. A smaller bound would let it underflow.
pub const MIN_EDGE: f64 = 1e-9;

/// Lowest [`shape_quality`](quality::shape_quality) of a tetrahedron that is not flat. Single
/// precision rounds a volume by about 1e-7 of the cube of its edges, so that below 1e-6 neither
/// sign nor size of the volume is known. Larger values refuse poor but usable anatomical meshes.
pub const MIN_SHAPE_QUALITY: f64 = 1e-6;

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
    /// Positions `[m]`, shape `[vertex_count]`.
    pub vertices: Vec<Vec3<f64>>,
    /// Vertex indices, shape `[triangle_count]`; below vertex_count, which readers make sure of.
    pub triangles: Vec<[u32; 3]>,
}

/// Repairs that made a mesh usable; empty for a clean mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshRepairs {
    /// Tetrahedra whose winding was reversed.
    pub rewound_tets: usize,
    /// Given vertices that no tetrahedron uses, ascending. They would have no mass, so they are
    /// removed and the later vertices move up; see [`MeshRepairs::vertex_after`].
    pub removed_vertices: Vec<u32>,
}

impl MeshRepairs {
    /// The index in the mesh of a vertex as given to [`TetMesh::new`]; `None` if it was removed.
    pub fn vertex_after(&self, given: u32) -> Option<u32> {
        match self.removed_vertices.binary_search(&given) {
            Ok(_) => None,
            Err(removed_before) => Some(given - removed_before as u32),
        }
    }
}

impl TetMesh {
    /// Checks the numbers, repairs what can be repaired (winding, unused vertices) and builds the
    /// mesh.
    ///
    /// `vertices` `[m]`, shape `[vertex_count]`; `tets` and `regions`, shape `[tet_count]`.
    pub fn new(
        vertices: Vec<Vec3<f64>>,
        mut tets: Vec<[u32; 4]>,
        regions: Vec<u32>,
    ) -> Result<(Self, MeshRepairs), MeshError> {
        check_counts(&vertices, &tets, &regions)?;
        for (vertex, &position) in vertices.iter().enumerate() {
            check_vertex(vertex, position)?;
        }
        let mut rewound_tets = 0;
        for (index, tet) in tets.iter_mut().enumerate() {
            check_indices(index, tet, vertices.len())?;
            if check_shape(index, tet.map(|v| vertices[v as usize]))? < 0.0 {
                tet.swap(2, 3);
                rewound_tets += 1;
            }
        }
        check_repeated_tets(&tets)?;
        if let Some((tet, face)) = corners::find_crowded_face(&tets) {
            return Err(MeshError::CrowdedFace { tet, face });
        }
        let (vertices, removed_vertices) = remove_unused_vertices(vertices, &mut tets);
        Ok((Self { vertices, tets, regions }, MeshRepairs { rewound_tets, removed_vertices }))
    }

    /// Positions `[m]`, shape `[vertex_count]`.
    pub fn vertices(&self) -> &[Vec3<f64>] {
        &self.vertices
    }

    /// Four vertex indices per tetrahedron, positively wound, shape `[tet_count]`.
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.tets
    }

    /// Region label per tetrahedron (Gmsh physical group, VTU cell array), shape `[tet_count]`.
    pub fn regions(&self) -> &[u32] {
        &self.regions
    }

    /// The four corner positions `[m]` of a tetrahedron.
    pub fn corners(&self, tet: usize) -> [Vec3<f64>; 4] {
        self.tets[tet].map(|v| self.vertices[v as usize])
    }

    /// Total volume `[m^3]`.
    pub fn volume(&self) -> f64 {
        (0..self.tets.len()).map(|tet| tet_volume(self.corners(tet))).sum()
    }
}

impl SurfaceMesh {
    /// Without vertices that no triangle uses, and which those are, ascending. All triangles name vertices that there are.
    fn without_unused(self) -> (Self, Vec<u32>) {
        let Self { vertices, mut triangles } = self;
        let mut number = vec![u32::MAX; vertices.len()];
        for &vertex in triangles.iter().flatten() {
            number[vertex as usize] = 0;
        }
        let (mut kept, mut removed) = (Vec::with_capacity(vertices.len()), Vec::new());
        for (vertex, x) in vertices.into_iter().enumerate() {
            if number[vertex] == u32::MAX {
                removed.push(vertex as u32);
            } else {
                number[vertex] = kept.len() as u32;
                kept.push(x);
            }
        }
        for vertex in triangles.iter_mut().flatten() {
            *vertex = number[*vertex as usize];
        }
        (Self { vertices: kept, triangles }, removed)
    }

    /// Enclosed volume `[m^3]`, negative if the triangles are wound inwards: the sum of the signed
    /// tetrahedra between a point and each triangle. Has a meaning for closed surfaces only.
    pub fn enclosed_volume(&self) -> f64 {
        // From the middle of the surface, so that a far-off placement costs no digits.
        let center = corners::BoundingBox::around(&self.vertices).center();
        self.triangles
            .iter()
            .map(|t| tet_volume([center, self.at(t[0]), self.at(t[1]), self.at(t[2])]))
            .sum()
    }

    /// Total area `[m^2]`.
    pub fn area(&self) -> f64 {
        let double: f64 = self
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|vertex| self.at(vertex));
                (b - a).cross(c - a).length()
            })
            .sum();
        0.5 * double
    }

    fn at(&self, vertex: u32) -> Vec3<f64> {
        self.vertices[vertex as usize]
    }
}

fn check_counts(
    vertices: &[Vec3<f64>],
    tets: &[[u32; 4]],
    regions: &[u32],
) -> Result<(), MeshError> {
    if tets.is_empty() {
        return Err(MeshError::Empty);
    }
    for (what, count, limit) in [
        ("vertices", vertices.len(), u32::MAX as usize),
        // Lists of the tetrahedra around each vertex hold four entries per tetrahedron.
        ("tetrahedra", tets.len(), u32::MAX as usize / 4),
    ] {
        if count > limit {
            return Err(MeshError::TooLarge { what, count, limit });
        }
    }
    if regions.len() != tets.len() {
        return Err(MeshError::RegionCount { regions: regions.len(), tets: tets.len() });
    }
    Ok(())
}

/// A vertex must be finite and near enough for single precision.
fn check_vertex(vertex: usize, position: Vec3<f64>) -> Result<(), MeshError> {
    if !position.is_finite() {
        return Err(MeshError::NonFinite { vertex });
    }
    let distance = position.x.abs().max(position.y.abs()).max(position.z.abs());
    if distance > MAX_COORDINATE {
        return Err(MeshError::TooFar { vertex, distance });
    }
    Ok(())
}

fn check_indices(index: usize, tet: &[u32; 4], vertex_count: usize) -> Result<(), MeshError> {
    for (corner, &vertex) in tet.iter().enumerate() {
        if vertex as usize >= vertex_count {
            return Err(MeshError::IndexOutOfRange { tet: index, vertex, vertex_count });
        }
        if tet[..corner].contains(&vertex) {
            return Err(MeshError::RepeatedVertex { tet: index, vertex });
        }
    }
    Ok(())
}

/// The shape quality of a tetrahedron that is neither flat nor too small; its sign is the winding.
fn check_shape(tet: usize, corners: [Vec3<f64>; 4]) -> Result<f64, MeshError> {
    let longest_edge = corners::edge_lengths(corners).into_iter().fold(0.0, f64::max);
    if longest_edge < MIN_EDGE {
        return Err(MeshError::TooSmall { tet, longest_edge });
    }
    let quality = corners::shape_quality(corners);
    if quality.abs() < MIN_SHAPE_QUALITY {
        return Err(MeshError::FlatTet { tet, quality: quality.abs() });
    }
    Ok(quality)
}

fn check_repeated_tets(tets: &[[u32; 4]]) -> Result<(), MeshError> {
    let mut keys: Vec<([u32; 4], usize)> = tets
        .iter()
        .enumerate()
        .map(|(index, &tet)| {
            let mut key = tet;
            key.sort_unstable();
            (key, index)
        })
        .collect();
    keys.sort_unstable();
    let repeated = keys.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    match repeated.map(|pair| (pair[1].1, pair[0].1)).min() {
        Some((tet, first)) => Err(MeshError::RepeatedTet { tet, first }),
        None => Ok(()),
    }
}

/// Drops the vertices that no tetrahedron uses; returns the others and the dropped indices.
fn remove_unused_vertices(
    vertices: Vec<Vec3<f64>>,
    tets: &mut [[u32; 4]],
) -> (Vec<Vec3<f64>>, Vec<u32>) {
    let mut used = vec![false; vertices.len()];
    for &vertex in tets.iter().flatten() {
        used[vertex as usize] = true;
    }
    if used.iter().all(|&used| used) {
        return (vertices, Vec::new());
    }
    let mut kept = Vec::with_capacity(vertices.len());
    let mut removed = Vec::new();
    let mut new_index = vec![0; vertices.len()];
    for (vertex, position) in vertices.into_iter().enumerate() {
        new_index[vertex] = kept.len() as u32;
        if used[vertex] {
            kept.push(position);
        } else {
            removed.push(vertex as u32);
        }
    }
    for vertex in tets.iter_mut().flatten() {
        *vertex = new_index[*vertex as usize];
    }
    (kept, removed)
}
