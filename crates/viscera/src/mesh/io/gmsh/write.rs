//! Writing.

use std::fmt::Write;

use crate::mesh::TetMesh;

/// A mesh as Gmsh 2.2 ASCII, in metres, regions as physical tags.
pub fn write(mesh: &TetMesh) -> String {
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n");
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}", mesh.vertices().len());
    for (index, x) in mesh.vertices().iter().enumerate() {
        let _ = writeln!(text, "{} {:?} {:?} {:?}", index + 1, x.x, x.y, x.z);
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", mesh.tets().len());
    for (index, (tet, region)) in mesh.tets().iter().zip(mesh.regions()).enumerate() {
        let [a, b, c, d] = tet.map(|vertex| u64::from(vertex) + 1);
        let _ = writeln!(text, "{} 4 2 {region} {region} {a} {b} {c} {d}", index + 1);
    }
    text.push_str("$EndElements\n");
    text
}
