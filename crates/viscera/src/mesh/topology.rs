//! How a mesh hangs together: faces, boundary, edges, components, tetrahedra around a vertex.
//!
//! Every result has a fixed order (ascending vertex or tetrahedron), so runs can be repeated.

use super::corners::sorted_face_sides;
pub use super::corners::{BoundingBox, TET_EDGES, TET_FACES};
use super::{SurfaceMesh, TetMesh};

/// The boundary of a tetrahedral mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoundarySurface {
    /// The boundary triangles, wound outwards, by tetrahedron.
    pub surface: SurfaceMesh,
    /// The vertex of the tetrahedral mesh behind each vertex of the surface, ascending,
    /// shape `[surface vertex_count]`.
    pub mesh_vertices: Vec<u32>,
    /// The tetrahedron behind each triangle, ascending, shape `[triangle_count]`.
    pub tets: Vec<u32>,
}

/// The faces of tetrahedra that belong to one of them only, with its number, wound outwards; by tetrahedron.
pub fn boundary_faces(tets: &[[u32; 4]]) -> Vec<(u32, [u32; 3])> {
    let sides = sorted_face_sides(tets);
    let mut outer: Vec<(u32, u8)> = sides
        .chunk_by(|a, b| a.key == b.key)
        .filter(|sides| sides.len() == 1)
        .map(|sides| (sides[0].tet, sides[0].face))
        .collect();
    outer.sort_unstable();
    let corners = |face: u8, tet: u32| TET_FACES[face as usize].map(|c| tets[tet as usize][c]);
    outer.into_iter().map(|(tet, face)| (tet, corners(face, tet))).collect()
}

/// The faces that belong to one tetrahedron only.
pub fn boundary_surface(mesh: &TetMesh) -> BoundarySurface {
    let outer = boundary_faces(mesh.tets());
    let mut on_boundary = vec![false; mesh.vertices().len()];
    for side in &outer {
        for vertex in side.1 {
            on_boundary[vertex as usize] = true;
        }
    }
    let mut surface_vertex = vec![0u32; on_boundary.len()];
    let mut mesh_vertices = Vec::new();
    for vertex in (0..on_boundary.len()).filter(|&v| on_boundary[v]) {
        surface_vertex[vertex] = mesh_vertices.len() as u32;
        mesh_vertices.push(vertex as u32);
    }
    BoundarySurface {
        surface: SurfaceMesh {
            vertices: mesh_vertices.iter().map(|&v| mesh.vertices()[v as usize]).collect(),
            triangles: outer
                .iter()
                .map(|(_, corners)| corners.map(|v| surface_vertex[v as usize]))
                .collect(),
        },
        mesh_vertices,
        tets: outer.iter().map(|&(tet, _)| tet).collect(),
    }
}

/// Counts the faces whose two tetrahedra lie on the same side of it, so that they overlap. A mesh
/// with an inverted tetrahedron has some once its winding is repaired.
pub fn count_folded_faces(mesh: &TetMesh) -> usize {
    sorted_face_sides(mesh.tets())
        .chunk_by(|a, b| a.key == b.key)
        .filter(|sides| sides.len() == 2 && sides[0].even == sides[1].even)
        .count()
}

/// Every edge once, as ascending vertices, in ascending order.
pub fn edges(mesh: &TetMesh) -> Vec<[u32; 2]> {
    edges_of(mesh.tets())
}

/// The same of tetrahedra that are no mesh of their own.
pub fn edges_of(tets: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = tets.iter().flat_map(ends_of).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// The six edges of a tetrahedron in the order of [`TET_EDGES`], each with its ends ascending.
pub fn ends_of(tet: &[u32; 4]) -> [[u32; 2]; 6] {
    TET_EDGES.map(|[a, b]| [tet[a].min(tet[b]), tet[a].max(tet[b])])
}

/// Counts the edges of a surface that do not have exactly two triangles.
pub fn count_open_edges(surface: &SurfaceMesh) -> usize {
    let mut edges: Vec<[u32; 2]> = surface
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|uses| uses.len() != 2).count()
}

/// The parts of a mesh that no tetrahedron ties together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Components {
    /// How many parts there are.
    pub count: usize,
    /// The part of each vertex, numbered by their lowest vertex, shape `[vertex_count]`.
    pub labels: Vec<u32>,
}

/// Splits a mesh into parts; tetrahedra that share a vertex belong together.
pub fn connected_components(mesh: &TetMesh) -> Components {
    // A forest in which every root is the lowest vertex of its tree.
    let mut parent: Vec<u32> = (0..mesh.vertices().len() as u32).collect();
    for tet in mesh.tets() {
        for &vertex in &tet[1..] {
            let a = find_root(&mut parent, tet[0]);
            let b = find_root(&mut parent, vertex);
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut labels = vec![0; parent.len()];
    let mut count = 0;
    for vertex in 0..parent.len() {
        let root = find_root(&mut parent, vertex as u32) as usize;
        if root == vertex {
            labels[vertex] = count;
            count += 1;
        } else {
            labels[vertex] = labels[root];
        }
    }
    Components { count: count as usize, labels }
}

fn find_root(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        let grandparent = parent[parent[vertex as usize] as usize];
        parent[vertex as usize] = grandparent;
        vertex = grandparent;
    }
    vertex
}

/// The tetrahedra around each vertex, stored one after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VertexTets {
    /// Where the list of a vertex starts in `tets`, shape `[vertex_count + 1]`.
    pub offsets: Vec<u32>,
    /// Tetrahedra, ascending for each vertex, shape `[4 tet_count]`.
    pub tets: Vec<u32>,
}

impl VertexTets {
    /// The tetrahedra that have this vertex, ascending.
    pub fn around(&self, vertex: usize) -> &[u32] {
        &self.tets[self.offsets[vertex] as usize..self.offsets[vertex + 1] as usize]
    }
}

/// Lists the tetrahedra around each vertex.
pub fn vertex_tets(mesh: &TetMesh) -> VertexTets {
    let mut offsets = vec![0u32; mesh.vertices().len() + 1];
    for vertex in mesh.tets().iter().flatten() {
        offsets[*vertex as usize + 1] += 1;
    }
    for vertex in 1..offsets.len() {
        offsets[vertex] += offsets[vertex - 1];
    }
    let mut next = offsets.clone();
    let mut tets = vec![0; 4 * mesh.tets().len()];
    for (tet, corners) in mesh.tets().iter().enumerate() {
        for &vertex in corners {
            tets[next[vertex as usize] as usize] = tet as u32;
            next[vertex as usize] += 1;
        }
    }
    VertexTets { offsets, tets }
}
