//! TetGen meshes: `.node` lists vertices and `.ele` tetrahedra, numbered from 0 or from 1; Si, "TetGen" manual, "File formats".
//! The first attribute of a tetrahedron is its region; markers of vertices are patches.

use std::collections::BTreeMap;

use super::cells::{Cells, Shape};
use super::content::Content;
use super::error::{Fault, Place, ReadProblem};
use super::lines::{Line, Lines, Words, bad_word, parse_word};
use super::numbered::Vertices;
use super::parsed::{Format, Patch};
use crate::mesh::MeshPlace;
use crate::scalar::vec3;

/// Lines without comments.
fn entries(bytes: &[u8]) -> impl Iterator<Item = Line<'_>> {
    Lines::new(bytes).filter_map(|line| {
        let end = line.text.iter().position(|&byte| byte == b'#').unwrap_or(line.text.len());
        let text = line.text[..end].trim_ascii();
        (!text.is_empty()).then_some(Line { text, ..line })
    })
}

/// A number of entries that the file can hold.
fn count(words: &mut Words, line: Line, bytes: &[u8]) -> Result<usize, Fault> {
    let claimed: u64 = words.parse("a count")?;
    match usize::try_from(claimed) {
        Ok(count) if count <= bytes.len() / 4 => Ok(count),
        _ => {
            let (what, bytes_left) = ("entries", bytes.len());
            Err(line.fault(ReadProblem::TooManyClaimed { what, claimed, bytes_left }))
        }
    }
}

fn cut_short(reading: &str, last: usize) -> Fault {
    Fault::at(last, ReadProblem::UnexpectedEnd { reading: reading.into() })
}

/// Whether the first line is that of a list of tetrahedra or of vertices.
pub(super) fn looks_like(name: &str) -> Option<&'static str> {
    let extension = name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase());
    match extension.as_deref() {
        Some("ele") => Some("node"),
        Some("node") => Some("ele"),
        _ => None,
    }
}

/// Vertices, and those that have a marker.
pub(super) struct Nodes {
    vertices: Vertices,
    patches: Vec<Patch>,
}

/// Reads a mesh from both files; lines of faults are those of the `.ele`.
pub(super) fn read(nodes: Nodes, elements: &[u8]) -> Result<Content<'_>, Fault> {
    let Nodes { vertices, patches } = nodes;
    let (mut cells, mut lines) = (Cells::default(), Vec::new());
    let mut list = entries(elements);
    let head = list.next().ok_or_else(|| cut_short("the list of tetrahedra", 1))?;
    let mut words = head.words();
    let announced = count(&mut words, head, elements)?;
    let corners: usize = words.parse("a number of vertices of a tetrahedron, 4 or 10")?;
    if corners != 4 && corners != 10 {
        let expected = "4 or 10 vertices for each tetrahedron";
        return Err(head.fault(bad_word(expected, corners.to_string().as_bytes())));
    }
    let mut last = head.number;
    for line in list {
        if lines.len() == announced {
            let what = "tetrahedra".to_owned();
            let problem =
                ReadProblem::CountMismatch { what, claimed: announced, found: announced + 1 };
            return Err(line.fault(problem));
        }
        let mut words = line.words();
        let number: u64 = words.parse("the number of a tetrahedron")?;
        let mut nodes = [0; 10];
        for node in &mut nodes[..corners] {
            let named: u64 = words.parse("a vertex number")?;
            let place = Some(Place::Line(line.number));
            let unknown = || vertices.unknown(format!("tetrahedron {number}"), named, place);
            *node = vertices.find(named).ok_or_else(unknown)?;
        }
        // An attribute may be written as a broken number.
        let region = match words.next() {
            Some(word) => parse_word::<f64>(word)
                .filter(|value| *value >= 0.0 && *value <= f64::from(u32::MAX))
                .ok_or_else(|| line.fault(bad_word("a region of 0 or more", word)))?,
            None => 0.0,
        };
        cells.add(Shape::Tet, &nodes[..corners], region as u32, lines.len());
        lines.push(line.number);
        last = line.number;
    }
    if lines.len() != announced {
        return Err(cut_short("the list of tetrahedra", last));
    }
    let positions = vertices.positions;
    let places = Box::new(move |place| match place {
        // The vertices are in the other file.
        MeshPlace::Whole | MeshPlace::Vertex(_) => None,
        MeshPlace::Tet(cell) => lines.get(cell).copied().map(Place::Line),
    });
    let format = Format::TetGen;
    let region_names = Vec::new();
    Ok(Content { format, vertices: positions, cells, patches, region_names, places })
}

/// Reads the `.node`: `number x y z attributes marker`.
pub(super) fn read_nodes(bytes: &[u8]) -> Result<Nodes, Fault> {
    let mut list = entries(bytes);
    let head = list.next().ok_or_else(|| cut_short("the list of vertices", 1))?;
    let mut words = head.words();
    let announced = count(&mut words, head, bytes)?;
    let dimension: u32 = words.parse("a dimension, 3")?;
    let attributes: usize = words.next().and_then(parse_word).unwrap_or(0);
    let has_marker = words.next().and_then(parse_word::<u32>).unwrap_or(0) > 0;
    if dimension != 3 {
        return Err(head.fault(bad_word("three dimensions", dimension.to_string().as_bytes())));
    }
    let mut vertices = Vertices::default();
    let mut sets: BTreeMap<i64, Vec<u32>> = BTreeMap::new();
    let mut last = head.number;
    for line in list.take(announced) {
        let mut words = line.words();
        let number = words.parse("a vertex number")?;
        let mut coordinate = || words.parse::<f64>("a coordinate");
        let position = vec3(coordinate()?, coordinate()?, coordinate()?);
        if has_marker {
            let marker = words.nth(attributes).unwrap_or_default();
            let marker: i64 =
                parse_word(marker).ok_or_else(|| line.fault(bad_word("a marker", marker)))?;
            if marker != 0 {
                sets.entry(marker).or_default().push(vertices.positions.len() as u32);
            }
        }
        vertices.numbers.push(number);
        vertices.positions.push(position);
        vertices.places.push(Place::Line(line.number));
        last = line.number;
    }
    if vertices.positions.len() != announced {
        return Err(cut_short("the list of vertices", last));
    }
    let patch = |(marker, vertices)| Patch { name: format!("marker {marker}"), vertices };
    vertices.number()?;
    Ok(Nodes { vertices, patches: sets.into_iter().map(patch).collect() })
}
