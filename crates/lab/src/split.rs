//! The same body in eight times as many tetrahedra: each gives way to four at its corners and four around the shortest
//! diagonal of what is left (J. Bey, "Tetrahedral grid refinement", Computing 55, 1995).

use anyhow::{Context as _, Result};
use viscera::mesh::TetMesh;
use viscera::mesh::topology::{TET_EDGES, edges};

/// Opposite edges, by their numbers in [`TET_EDGES`]: the diagonals of the middle.
const DIAGONALS: [[usize; 2]; 3] = [[0, 5], [1, 4], [2, 3]];

/// Vertices keep their numbers; the middles of the edges follow, in the order of [`edges`]. Regions are those of the
/// tetrahedra before.
pub fn split(mesh: &TetMesh) -> Result<TetMesh> {
    let edges = edges(mesh);
    let mut vertices = mesh.vertices().to_vec();
    for [a, b] in edges.iter().map(|edge| edge.map(|v| mesh.vertices()[v as usize])) {
        vertices.push((a + b) * 0.5);
    }
    let (mut tets, mut regions) = (Vec::new(), Vec::new());
    for (tet, region) in mesh.tets().iter().zip(mesh.regions()) {
        let middle = TET_EDGES.map(|[a, b]| {
            let edge = [tet[a].min(tet[b]), tet[a].max(tet[b])];
            // Every edge of the mesh is in the list.
            let place = edges.binary_search(&edge).unwrap_or_default();
            (mesh.vertices().len() + place) as u32
        });
        let [ab, ac, ad, bc, bd, cd] = middle;
        let [a, b, c, d] = *tet;
        tets.extend([[a, ab, ac, ad], [b, ab, bc, bd], [c, ac, bc, cd], [d, ad, bd, cd]]);
        let length = |&[p, q]: &[usize; 2]| {
            let [p, q] = [middle[p], middle[q]].map(|v| vertices[v as usize]);
            (p - q).length_squared()
        };
        let shortest = DIAGONALS.iter().min_by(|a, b| length(a).total_cmp(&length(b)));
        let &[p, q] = shortest.unwrap_or(&DIAGONALS[0]);
        // Around the diagonal: the ends of the others, by turns.
        let [first, second] = [0, 1].map(|k| DIAGONALS.iter().filter(|d| d[0] != p).nth(k));
        let (Some(&[r, s]), Some(&[t, u])) = (first, second) else { continue };
        for [v, w] in [[r, t], [t, s], [s, u], [u, r]] {
            tets.push([middle[p], middle[q], middle[v], middle[w]]);
        }
        regions.extend([*region; 8]);
    }
    Ok(TetMesh::new(vertices, tets, regions).context("a mesh in eight times as many tetrahedra")?.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::mesh::tet_volume;
    use viscera::scalar::vec3;

    #[test]
    fn eight_alike_fill_each() {
        let corners = vec![
            vec3(0.0, 0.0, 0.0),
            vec3(1.0, 0.1, 0.2),
            vec3(0.3, 1.1, 0.0),
            vec3(0.2, 0.1, 0.9),
            vec3(1.2, 1.0, 1.1),
        ];
        let mesh = TetMesh::new(corners, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![7, 9]);
        let mesh = mesh.expect("two tetrahedra").0;
        let fine = split(&mesh).expect("sixteen");
        assert_eq!(fine.vertices().len(), mesh.vertices().len() + 9);
        assert_eq!(fine.vertices()[..5], *mesh.vertices());
        for tet in 0..16 {
            let whole = tet_volume(mesh.corners(tet / 8));
            assert!((tet_volume(fine.corners(tet)) / whole - 0.125).abs() < 1e-14, "{tet}");
            assert_eq!(fine.regions()[tet], [7, 9][tet / 8]);
        }
        // Of 16 tetrahedra with 64 sides all but 4 on each of the 6 outer faces are shared.
        let outer = viscera::mesh::boundary_surface(&fine).surface.triangles.len();
        assert_eq!(outer, 6 * 4);
    }
}
