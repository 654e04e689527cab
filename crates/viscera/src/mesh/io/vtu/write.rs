//! Writing grids of tetrahedra or of triangles with data on points and cells.
//!
//! Numbers are single precision in the shortest text that reads back exactly: every program that
//! knows VTK opens such a file, and so does a person.

use std::fmt::Write;

use super::{VTK_TETRA, VTK_TRIANGLE};
use crate::mesh::io::error::WriteError;
use crate::mesh::io::pvd::escape_xml;
use crate::scalar::{Real, Vec3};

/// A named array with one entry for each point or for each cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    name: String,
    values: Values,
}

#[derive(Clone, Debug, PartialEq)]
enum Values {
    Scalars(Vec<f32>),
    Vectors(Vec<[f32; 3]>),
    Integers(Vec<u32>),
}

impl Array {
    /// One number for each entry.
    pub fn scalars<R: Real>(name: &str, values: &[R]) -> Self {
        let values = values.iter().map(|value| value.to_f64() as f32).collect();
        Self { name: name.into(), values: Values::Scalars(values) }
    }

    /// Three components for each entry.
    pub fn vectors<R: Real>(name: &str, values: &[Vec3<R>]) -> Self {
        let values = values.iter().map(|value| value.cast::<f32>().to_array()).collect();
        Self { name: name.into(), values: Values::Vectors(values) }
    }

    /// One whole number for each entry, such as a region.
    pub fn integers(name: &str, values: &[u32]) -> Self {
        Self { name: name.into(), values: Values::Integers(values.to_vec()) }
    }

    fn len(&self) -> usize {
        match &self.values {
            Values::Scalars(values) => values.len(),
            Values::Vectors(values) => values.len(),
            Values::Integers(values) => values.len(),
        }
    }
}

/// A grid of tetrahedra as the bytes of a `.vtu` file.
///
/// `points` `[m]`, shape `[point_count]`; `tets`, shape `[tet_count]`; each of `point_data` has an
/// entry for each point, each of `cell_data` for each tetrahedron.
pub fn write<R: Real>(
    points: &[Vec3<R>],
    tets: &[[u32; 4]],
    point_data: &[Array],
    cell_data: &[Array],
) -> Result<Vec<u8>, WriteError> {
    write_grid(points, tets, VTK_TETRA, point_data, cell_data)
}

/// A grid of triangles as the bytes of a `.vtu` file; shapes as for [`write()`].
pub fn write_surface<R: Real>(
    points: &[Vec3<R>],
    triangles: &[[u32; 3]],
    point_data: &[Array],
    cell_data: &[Array],
) -> Result<Vec<u8>, WriteError> {
    write_grid(points, triangles, VTK_TRIANGLE, point_data, cell_data)
}

fn write_grid<R: Real, const CORNERS: usize>(
    points: &[Vec3<R>],
    cells: &[[u32; CORNERS]],
    cell_type: u8,
    point_data: &[Array],
    cell_data: &[Array],
) -> Result<Vec<u8>, WriteError> {
    check_cells(cells, points.len())?;
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\n\
         <UnstructuredGrid>\n",
    );
    // Writing to a string cannot fail, here and below.
    let (point_count, cell_count) = (points.len(), cells.len());
    let _ = writeln!(
        text,
        "<Piece NumberOfPoints=\"{point_count}\" NumberOfCells=\"{cell_count}\">\n<Points>"
    );
    push_array(&mut text, &Array::vectors("points", points))?;
    text.push_str("</Points>\n<Cells>\n");
    push_integers(&mut text, "Int64", "connectivity", CORNERS, cells.iter().flatten().copied());
    let offsets = (1..=cell_count).map(|cell| cell * CORNERS);
    push_integers(&mut text, "Int64", "offsets", WORDS_PER_LINE, offsets);
    let types = std::iter::repeat_n(cell_type, cell_count);
    push_integers(&mut text, "UInt8", "types", WORDS_PER_LINE, types);
    text.push_str("</Cells>\n");
    for (what, section, wanted, arrays) in [
        ("point", "PointData", point_count, point_data),
        ("cell", "CellData", cell_count, cell_data),
    ] {
        let _ = writeln!(text, "<{section}>");
        for array in arrays {
            let found = array.len();
            if found != wanted {
                let array = array.name.clone();
                return Err(WriteError::Length { array, what, wanted, found });
            }
            push_array(&mut text, array)?;
        }
        let _ = writeln!(text, "</{section}>");
    }
    text.push_str("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    Ok(text.into_bytes())
}

fn check_cells<const CORNERS: usize>(
    cells: &[[u32; CORNERS]],
    point_count: usize,
) -> Result<(), WriteError> {
    for (cell, corners) in cells.iter().enumerate() {
        if let Some(&point) = corners.iter().find(|&&point| point as usize >= point_count) {
            return Err(WriteError::IndexOutOfRange { cell, point, point_count });
        }
    }
    Ok(())
}

const WORDS_PER_LINE: usize = 16;

fn push_array(text: &mut String, array: &Array) -> Result<(), WriteError> {
    let name = &array.name;
    match &array.values {
        Values::Scalars(values) => push_floats(text, name, 1, values),
        Values::Vectors(values) => push_floats(text, name, 3, values.as_flattened()),
        Values::Integers(values) => {
            push_integers(text, "UInt32", name, WORDS_PER_LINE, values.iter().copied());
            Ok(())
        }
    }
}

fn push_floats(
    text: &mut String,
    name: &str,
    components: usize,
    values: &[f32],
) -> Result<(), WriteError> {
    if let Some(bad) = values.iter().position(|value| !value.is_finite()) {
        return Err(WriteError::NonFinite { array: name.into(), entry: bad / components });
    }
    let escaped = escape_xml(name);
    let _ = writeln!(
        text,
        "<DataArray type=\"Float32\" Name=\"{escaped}\" NumberOfComponents=\"{components}\" \
         format=\"ascii\">"
    );
    let per_line = if components == 3 { 3 } else { WORDS_PER_LINE };
    for line in values.chunks(per_line) {
        // `{:?}` is the shortest text that reads back, with an exponent where that is shorter.
        push_line(text, line, |text, value| {
            let _ = write!(text, "{value:?}");
        });
    }
    text.push_str("</DataArray>\n");
    Ok(())
}

fn push_integers<I: Copy + std::fmt::Display>(
    text: &mut String,
    vtk_type: &str,
    name: &str,
    per_line: usize,
    values: impl Iterator<Item = I>,
) {
    let escaped = escape_xml(name);
    let _ = writeln!(
        text,
        "<DataArray type=\"{vtk_type}\" Name=\"{escaped}\" NumberOfComponents=\"1\" \
         format=\"ascii\">"
    );
    let values: Vec<I> = values.collect();
    for line in values.chunks(per_line) {
        push_line(text, line, |text, value| {
            let _ = write!(text, "{value}");
        });
    }
    text.push_str("</DataArray>\n");
}

fn push_line<T: Copy>(text: &mut String, values: &[T], push: impl Fn(&mut String, T)) {
    for (index, &value) in values.iter().enumerate() {
        if index > 0 {
            text.push(' ');
        }
        push(text, value);
    }
    text.push('\n');
}
