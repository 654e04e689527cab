//! Wavefront OBJ surfaces: `v` and `f` lines; everything else is looks and is passed over.
//!
//! A face names vertices as `i`, `i/j`, `i//k` or `i/j/k` and only `i` counts here; a negative
//! `i` counts back from the last vertex. A polygon becomes a fan of triangles.

use std::fmt::Write;

use super::cells::Cells;
use super::content::Content;
use super::error::{Fault, Place, ReadProblem, WriteError};
use super::lines::{Line, Lines, bad_word, parse_word};
use super::parsed::Format;
use super::text::shorten;
use crate::mesh::{MeshPlace, SurfaceMesh};
use crate::scalar::{Vec3, vec3};

/// Reads a surface.
pub(super) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let (mut vertices, mut lines) = (Vec::new(), Vec::new());
    let mut cells = Cells::default();
    let mut faces = Vec::new();
    for line in Lines::new(bytes) {
        let mut words = line.words();
        match words.next() {
            Some(b"v") => {
                let mut coordinate = || words.parse::<f64>("a coordinate");
                vertices.push(vec3(coordinate()?, coordinate()?, coordinate()?));
                lines.push(line.number);
            }
            Some(b"f") => {
                let corners = words.map(|word| read_corner(word, line, vertices.len()));
                let corners = corners.collect::<Result<Vec<u32>, Fault>>()?;
                if corners.len() < 3 {
                    return Err(line.fault(bad_word("three vertices or more", line.text)));
                }
                cells.add_polygon(&corners, faces.len());
                faces.push(line.number);
            }
            Some(b"l") => cells.skip("line"),
            Some(b"p") => cells.skip("point"),
            _ => {}
        }
    }
    if cells.triangles.is_empty() {
        let what = "faces (lines that begin with `f`)".into();
        return Err(Fault::whole_file(ReadProblem::Missing { what }));
    }
    let places = Box::new(move |place| match place {
        MeshPlace::Whole => None,
        MeshPlace::Vertex(vertex) => lines.get(vertex).copied().map(Place::Line),
        MeshPlace::Tet(face) => faces.get(face).copied().map(Place::Line),
    });
    Ok(Content::of_cells(Format::Obj, vertices, cells, places))
}

/// The vertex that a word such as `12/3/4` of a face names.
fn read_corner(word: &[u8], line: Line, vertex_count: usize) -> Result<u32, Fault> {
    let number = word.split(|&byte| byte == b'/').next().unwrap_or_default();
    let expected = "a vertex number, not 0";
    let number: i64 = match parse_word(number) {
        Some(0) | None => return Err(line.fault(bad_word(expected, word))),
        Some(number) => number,
    };
    let counted = vertex_count as i64;
    let index = if number > 0 { number - 1 } else { counted.saturating_add(number) };
    match u32::try_from(index) {
        Ok(index) if i64::from(index) < counted => Ok(index),
        _ => Err(line.fault(ReadProblem::UnknownVertex {
            element: "the face".into(),
            vertex: shorten(word),
            vertex_count,
            numbers: None,
        })),
    }
}

/// A surface as OBJ, in metres, with a normal for each vertex if they are given.
pub fn write(mesh: &SurfaceMesh, normals: Option<&[Vec3<f64>]>) -> Result<String, WriteError> {
    let vertex_count = mesh.vertices.len();
    if let Some(normals) = normals.filter(|normals| normals.len() != vertex_count) {
        let (array, found) = ("normals".into(), normals.len());
        return Err(WriteError::Length { array, what: "point", wanted: vertex_count, found });
    }
    let mut text = String::new();
    for (keyword, vectors) in [("v", Some(&mesh.vertices[..])), ("vn", normals)] {
        for v in vectors.unwrap_or_default() {
            // Writing to a string cannot fail. `{:?}` is the shortest text that reads back.
            let _ = writeln!(text, "{keyword} {:?} {:?} {:?}", v.x, v.y, v.z);
        }
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|vertex| u64::from(vertex) + 1);
        let _ = match normals {
            Some(_) => writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}"),
            None => writeln!(text, "f {a} {b} {c}"),
        };
    }
    Ok(text)
}
