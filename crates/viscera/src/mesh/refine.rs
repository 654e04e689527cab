//! Finer meshes of the same body: every tetrahedron in eight, by the middles of its edges.
//!
//! Four tetrahedra keep a corner each; the octahedron between them is split along its shortest diagonal, so that shapes do not
//! get worse from level to level (Bey, "Tetrahedral grid refinement", Computing 55, 1995). The boundary stays the
//! polyhedron that it is.

use super::topology::{TET_EDGES, edges, ends_of};
use super::{MeshError, TetMesh, tet_volume};

/// Where the middles of a tetrahedron's edges stand in [`TET_EDGES`]: opposite edges in pairs, the octahedron's diagonals.
const OPPOSITE: [[usize; 2]; 3] = [[0, 5], [1, 4], [2, 3]];

/// The vertices of a refined mesh that the coarser one did not have: the middles of its edges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Middles {
    /// Their first number: as many as the coarser mesh has vertices, which keep theirs.
    first: u32,
    /// The ends of the edge in whose middle each lies, ascending.
    edges: Vec<[u32; 2]>,
}

/// The finer mesh, and what is new in it.
pub fn refine(mesh: &TetMesh) -> Result<(TetMesh, Middles), MeshError> {
    let edges = edges(mesh);
    let first = mesh.vertices().len();
    let mut vertices = mesh.vertices().to_vec();
    vertices.extend(
        edges
            .iter()
            .map(|&[a, b]| (mesh.vertices()[a as usize] + mesh.vertices()[b as usize]) * 0.5),
    );
    let mut tets = Vec::with_capacity(8 * mesh.tets().len());
    for tet in mesh.tets() {
        // Every edge of every tetrahedron is in the list.
        let middle = ends_of(tet)
            .map(|edge| (first + edges.binary_search(&edge).unwrap_or_default()) as u32);
        for a in 0..4 {
            // At a corner: each other corner gives way to the middle of the edge to it.
            let mut child = *tet;
            for (edge, [p, q]) in TET_EDGES.into_iter().enumerate() {
                if p == a || q == a {
                    child[p + q - a] = middle[edge];
                }
            }
            tets.push(child);
        }
        let length = |[p, q]: [usize; 2]| {
            let ends = [middle[p], middle[q]].map(|v| vertices[v as usize]);
            (ends[0] - ends[1]).length_squared()
        };
        let [mut axis, mut around] = [OPPOSITE[0], OPPOSITE[1]];
        let mut others = OPPOSITE[2];
        for (shorter, rest) in
            [(OPPOSITE[1], [OPPOSITE[0], OPPOSITE[2]]), (OPPOSITE[2], [OPPOSITE[0], OPPOSITE[1]])]
        {
            if length(shorter) < length(axis) {
                [axis, around, others] = [shorter, rest[0], rest[1]];
            }
        }
        // The other four go around the diagonal: neighbours are those that are not opposite.
        let ring = [around[0], others[0], around[1], others[1]].map(|edge| middle[edge]);
        for i in 0..4 {
            let mut child = [middle[axis[0]], middle[axis[1]], ring[i], ring[(i + 1) % 4]];
            if tet_volume(child.map(|v| vertices[v as usize])) < 0.0 {
                child.swap(2, 3);
            }
            tets.push(child);
        }
    }
    let regions = mesh.regions().iter().flat_map(|&region| [region; 8]).collect();
    let (mesh, _) = TetMesh::new(vertices, tets, regions)?;
    Ok((mesh, Middles { first: first as u32, edges }))
}

impl Middles {
    /// The vertices of a patch on the finer mesh, ascending: those that it had, and the middles of edges between two of
    /// them. `patch` is ascending.
    pub fn patch(&self, patch: &[u32]) -> Vec<u32> {
        let has = |v: &u32| patch.binary_search(v).is_ok();
        let middles = (self.first..).zip(&self.edges).filter(|(_, edge)| edge.iter().all(has));
        patch.iter().copied().chain(middles.map(|(v, _)| v)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::quality::shape_quality;
    use crate::mesh::shapes;
    use crate::mesh::topology::{boundary_surface, count_open_edges};
    use crate::scalar::vec3;

    fn worst(mesh: &TetMesh) -> f64 {
        (0..mesh.tets().len()).map(|t| shape_quality(mesh.corners(t))).fold(1.0, f64::min)
    }

    /// Twice refined: the same body without a gap, every child of an eighth, shapes no worse than after the first time.
    #[test]
    fn eight_fill_the_room_of_one() {
        let coarse = shapes::liver(0.04, 1.0).expect("a liver").tets;
        let (once, _) = refine(&coarse).expect("a mesh");
        let (twice, _) = refine(&once).expect("a mesh");
        for (before, mesh) in [(&coarse, &once), (&once, &twice)] {
            assert_eq!(mesh.tets().len(), 8 * before.tets().len());
            for (t, children) in mesh.tets().chunks(8).enumerate() {
                let eighth = tet_volume(before.corners(t)) / 8.0;
                for child in children {
                    let volume = tet_volume(child.map(|v| mesh.vertices()[v as usize]));
                    assert!((volume / eighth - 1.0).abs() < 1e-9, "{t}");
                }
            }
            let outside = boundary_surface(mesh).surface;
            assert_eq!(count_open_edges(&outside), 0);
            let of_coarse = boundary_surface(before).surface;
            assert_eq!(outside.triangles.len(), 4 * of_coarse.triangles.len());
        }
        assert!(worst(&once) > 0.5 * worst(&coarse));
        assert!(worst(&twice) > 0.99 * worst(&once));
    }

    /// A face of a block stays its face.
    #[test]
    fn patches_keep_their_place() {
        let coarse = shapes::block(vec3(0.02, 0.03, 0.04), [2, 3, 4]).expect("a block");
        let (fine, middles) = refine(&coarse).expect("a mesh");
        let face = |mesh: &TetMesh| -> Vec<u32> {
            (0..).zip(mesh.vertices()).filter(|(_, x)| x.z < 1e-9).map(|(v, _)| v).collect()
        };
        assert_eq!(middles.patch(&face(&coarse)), face(&fine));
        assert_eq!(middles.patch(&[3]), [3]);
    }
}
