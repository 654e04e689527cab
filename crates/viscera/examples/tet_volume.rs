//! Builds the smallest mesh there is and measures it.

use viscera::mesh::{TetMesh, tet_volume};
use viscera::scalar::vec3;

fn main() -> Result<(), viscera::mesh::MeshError> {
    let vertices =
        vec![vec3(0.0, 0.0, 0.0), vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.0), vec3(0.0, 0.0, 0.1)];
    let (mesh, repairs) = TetMesh::new(vertices, vec![[0, 1, 3, 2]], vec![0])?;
    println!("{} tetrahedron turned the right way round", repairs.rewound_tets);
    println!("{:.1} ml", tet_volume(mesh.corners(0)) * 1e6);
    Ok(())
}
