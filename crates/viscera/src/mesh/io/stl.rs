//! STL surfaces, text and binary: triangles that each bring their own corners, which become one vertex where they are the same.

use std::collections::HashMap;

use super::cells::Cells;
use super::content::Content;
use super::error::{Fault, Place, ReadProblem};
use super::lines::{Lines, bad_word};
use super::parsed::Format;
use crate::mesh::{MeshPlace, SurfaceMesh};
use crate::scalar::{Vec3, vec3};

/// Bytes before the number of triangles, and of a triangle: normal, corners, two that mean nothing.
const HEADER: usize = 80;
const TRIANGLE: usize = 50;

/// Whether bytes are a binary file: as long as their number of triangles says. Text may begin with the same word.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    count_of(bytes).is_some_and(|count| {
        let data = bytes.len() - HEADER - 4;
        data as u64 == u64::from(count) * TRIANGLE as u64
    })
}

fn count_of(bytes: &[u8]) -> Option<u32> {
    let (count, _) = bytes.get(HEADER..)?.split_first_chunk::<4>()?;
    Some(u32::from_le_bytes(*count))
}

/// Corners that are the same become one vertex.
#[derive(Default)]
struct Corners {
    vertices: Vec<Vec3<f64>>,
    places: Vec<Place>,
    known: HashMap<[u64; 3], u32>,
}

impl Corners {
    fn add(&mut self, x: Vec3<f64>, place: Place) -> u32 {
        // Minus zero is zero.
        let key = [x.x, x.y, x.z].map(|value| (value + 0.0).to_bits());
        *self.known.entry(key).or_insert_with(|| {
            self.vertices.push(x);
            self.places.push(place);
            self.vertices.len() as u32 - 1
        })
    }
}

/// Reads a surface.
pub(super) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let mut corners = Corners::default();
    let mut cells = Cells::default();
    let mut of_cells = Vec::new();
    let format = if is_binary(bytes) {
        let (triangles, _) = bytes[HEADER + 4..].as_chunks::<TRIANGLE>();
        for (number, triangle) in triangles.iter().enumerate() {
            let place = Place::Byte(HEADER + 4 + number * TRIANGLE);
            let at = |corner: usize| {
                let value = |axis: usize| {
                    let start = 12 + 12 * corner + 4 * axis;
                    let word = triangle[start..].first_chunk::<4>().copied();
                    f64::from(f32::from_le_bytes(word.unwrap_or_default()))
                };
                vec3(value(0), value(1), value(2))
            };
            of_cells.push(place);
            let corners = [0, 1, 2].map(|corner| corners.add(at(corner), place));
            cells.add_polygon(&corners, number);
        }
        Format::StlBinary
    } else {
        read_text(bytes, &mut corners, &mut cells, &mut of_cells)?;
        Format::Stl
    };
    if cells.triangles.is_empty() {
        return Err(Fault::whole_file(ReadProblem::Missing { what: "triangles".into() }));
    }
    let Corners { vertices, places, .. } = corners;
    let places = Box::new(move |place| match place {
        MeshPlace::Whole => None,
        MeshPlace::Vertex(vertex) => places.get(vertex).copied(),
        MeshPlace::Tet(cell) => of_cells.get(cell).copied(),
    });
    Ok(Content::of_cells(format, vertices, cells, places))
}

fn read_text(
    bytes: &[u8],
    corners: &mut Corners,
    cells: &mut Cells,
    of_cells: &mut Vec<Place>,
) -> Result<(), Fault> {
    let mut facet: Option<(usize, Vec<u32>)> = None;
    let mut last = 1;
    let mut is_open = false;
    for line in Lines::new(bytes) {
        last = line.number;
        let mut words = line.words();
        match words.next().unwrap_or_default().to_ascii_lowercase().as_slice() {
            b"solid" => is_open = true,
            b"facet" => facet = Some((line.number, Vec::new())),
            b"vertex" => {
                let mut coordinate = || words.parse::<f64>("a coordinate");
                let x = vec3(coordinate()?, coordinate()?, coordinate()?);
                let vertex = corners.add(x, Place::Line(line.number));
                match &mut facet {
                    Some((_, facet)) => facet.push(vertex),
                    None => {
                        return Err(line.fault(bad_word("a facet before its vertices", line.text)));
                    }
                }
            }
            b"endfacet" => {
                let (start, facet) = facet.take().unwrap_or((line.number, Vec::new()));
                if facet.len() < 3 {
                    let what = "vertices of a facet".to_owned();
                    let problem =
                        ReadProblem::CountMismatch { what, claimed: 3, found: facet.len() };
                    return Err(line.fault(problem));
                }
                cells.add_polygon(&facet, of_cells.len());
                of_cells.push(Place::Line(start));
            }
            b"endsolid" => is_open = false,
            b"outer" | b"endloop" | b"color" => {}
            _ => return Err(line.fault(bad_word("a line of a facet", line.text))),
        }
    }
    if facet.is_some() || is_open {
        let reading = "a solid (no endsolid)".to_owned();
        return Err(Fault::at(last, ReadProblem::UnexpectedEnd { reading }));
    }
    Ok(())
}

/// A surface as binary STL, in metres, single precision.
pub fn write(mesh: &SurfaceMesh) -> Vec<u8> {
    let mut bytes = vec![b' '; HEADER];
    bytes.extend_from_slice(&(mesh.triangles.len() as u32).to_le_bytes());
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|vertex| mesh.vertices[vertex as usize]);
        let normal = (b - a).cross(c - a);
        let length = normal.length();
        let normal = if length > 0.0 { normal * (1.0 / length) } else { Vec3::ZERO };
        for x in [normal, a, b, c] {
            for value in x.to_array() {
                bytes.extend_from_slice(&(value as f32).to_le_bytes());
            }
        }
        bytes.extend_from_slice(&[0, 0]);
    }
    bytes
}
