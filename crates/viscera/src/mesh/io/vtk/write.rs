//! Writing version 4.2 as bytes: the version that every program reads, and half as many bytes as text.

use std::fmt::Write;

use crate::mesh::io::error::{WriteError, check_patch};
use crate::mesh::io::parsed::MeshNames;
use crate::mesh::io::text::name_of;
use crate::mesh::io::vtk_cells::{REGION_NAMES, REGION_NUMBERS};
use crate::mesh::{SurfaceMesh, TetMesh};
use crate::scalar::Vec3;

/// Cell types as VTK numbers them.
const VTK_TRIANGLE: i32 = 5;
const VTK_TETRA: i32 = 10;

/// A file in the making. Numbers are big-endian, and a line end follows them.
struct File(Vec<u8>);

impl File {
    fn new() -> Self {
        Self(b"# vtk DataFile Version 4.2\nmetres\nBINARY\nDATASET UNSTRUCTURED_GRID\n".to_vec())
    }

    fn line(&mut self, text: std::fmt::Arguments) {
        self.0.extend_from_slice(text.to_string().as_bytes());
        self.0.push(b'\n');
    }

    fn numbers<const N: usize>(&mut self, numbers: impl Iterator<Item = [u8; N]>) {
        numbers.for_each(|bytes| self.0.extend_from_slice(&bytes));
        self.0.push(b'\n');
    }

    fn region_names(&mut self, regions: &[(u32, String)]) {
        let count = regions.len();
        if count == 0 {
            return;
        }
        self.line(format_args!("FIELD FieldData 2\n{REGION_NUMBERS} 1 {count} unsigned_int"));
        self.numbers(regions.iter().map(|(number, _)| number.to_be_bytes()));
        self.line(format_args!("{REGION_NAMES} 1 {count} string"));
        for (_, name) in regions {
            let name = name_of(name);
            // Of a length of two bytes, as the highest bits say, which is enough for names as they are cut.
            let length = 0x8000 | (name.len() as u16 & 0x3fff);
            self.0.extend_from_slice(&length.to_be_bytes());
            self.0.extend_from_slice(name.as_bytes());
        }
        self.0.push(b'\n');
    }

    fn points(&mut self, points: &[Vec3<f64>]) {
        self.line(format_args!("POINTS {} double", points.len()));
        self.numbers(points.iter().flat_map(|x| x.to_array()).map(f64::to_be_bytes));
    }

    /// Cells of `N` corners each, which the number of corners precedes.
    fn cells<const N: usize>(&mut self, cells: &[[u32; N]], kind: i32) -> Result<(), WriteError> {
        let count = cells.len() * (N + 1);
        if count > i32::MAX as usize {
            let (what, value, limit) = ("number of corners", count as u64, i32::MAX as u64);
            let format = "legacy VTK files of version 4";
            return Err(WriteError::TooLarge { what, value, limit, format });
        }
        self.line(format_args!("CELLS {} {count}", cells.len()));
        let of_cell = |cell: &[u32; N]| std::iter::once(N as u32).chain(*cell);
        self.numbers(cells.iter().flat_map(of_cell).map(u32::to_be_bytes));
        self.line(format_args!("CELL_TYPES {}", cells.len()));
        self.numbers(cells.iter().map(|_| kind.to_be_bytes()));
        Ok(())
    }
}

/// Tetrahedra as a legacy file, in metres: the cell array `region`, and for each patch an array at points of its name, 1 at its
/// vertices and 0 at others; names of regions as field data, `region_numbers` and `region_names`.
pub fn write(mesh: &TetMesh, names: &MeshNames) -> Result<Vec<u8>, WriteError> {
    let patches = &names.patches;
    let (vertex_count, tet_count) = (mesh.vertices().len(), mesh.tets().len());
    let mut file = File::new();
    file.region_names(&names.regions);
    file.points(mesh.vertices());
    file.cells(mesh.tets(), VTK_TETRA)?;
    file.line(format_args!("CELL_DATA {tet_count}\nFIELD FieldData 1"));
    file.line(format_args!("region 1 {tet_count} unsigned_int"));
    file.numbers(mesh.regions().iter().map(|region| region.to_be_bytes()));
    if !patches.is_empty() {
        file.line(format_args!("POINT_DATA {vertex_count}\nFIELD FieldData {}", patches.len()));
    }
    for patch in patches {
        check_patch(patch, vertex_count)?;
        let mut is_member = vec![0u8; vertex_count];
        patch.vertices.iter().for_each(|&vertex| is_member[vertex as usize] = 1);
        file.line(format_args!("{} 1 {vertex_count} unsigned_char", escape(&patch.name)));
        file.numbers(is_member.into_iter().map(|value| [value]));
    }
    Ok(file.0)
}

/// A surface as a legacy file, in metres: an unstructured grid of triangles, which more programs read than polygonal data.
pub fn write_surface(mesh: &SurfaceMesh) -> Result<Vec<u8>, WriteError> {
    let mut file = File::new();
    file.points(&mesh.vertices);
    file.cells(&mesh.triangles, VTK_TRIANGLE)?;
    Ok(file.0)
}

/// A name as one word: other characters than letters, digits and marks stand as `%20`.
fn escape(name: &str) -> String {
    let mut word = String::new();
    for &byte in name_of(name).as_bytes() {
        if byte.is_ascii_graphic() && byte != b'%' && byte != b'"' {
            word.push(char::from(byte));
        } else {
            // Writing to a string cannot fail.
            let _ = write!(word, "%{byte:02X}");
        }
    }
    if word.is_empty() { "set".into() } else { word }
}
