//! Medit meshes as text (`.mesh`): Frey, "MEDIT: an interactive mesh visualization software", 2001. References of solids are
//! regions, those of triangles, edges and points are patches.

use std::collections::BTreeMap;

use super::cells::{Cells, Shape};
use super::content::Content;
use super::error::{Fault, Place, ReadProblem};
use super::lines::{Lines, Words, bad_word, parse_word};
use super::parsed::{Format, Patch};
use super::text::shorten;
use crate::mesh::MeshPlace;
use crate::scalar::{Vec3, vec3};

/// Words of a file, from line to line, without comments.
struct Reader<'a> {
    lines: Lines<'a>,
    words: Option<Words<'a>>,
}

impl<'a> Reader<'a> {
    fn word(&mut self) -> Option<&'a [u8]> {
        loop {
            match self.words.as_mut().and_then(Iterator::next) {
                Some([b'#', ..]) => self.words = None,
                Some(word) => return Some(word),
                None => self.words = Some(self.lines.next()?.words()),
            }
        }
    }

    fn fault(&self, problem: ReadProblem) -> Fault {
        Fault::at(self.lines.number(), problem)
    }

    fn parse<T: std::str::FromStr>(
        &mut self,
        expected: &'static str,
        section: &str,
    ) -> Result<T, Fault> {
        let Some(word) = self.word() else {
            let reading = section.to_owned();
            return Err(self.fault(ReadProblem::UnexpectedEnd { reading }));
        };
        parse_word(word).ok_or_else(|| self.fault(bad_word(expected, word)))
    }

    /// A number of entries that the rest of the file can hold.
    fn count(&mut self, section: &str) -> Result<usize, Fault> {
        let claimed: u64 = self.parse("a count", section)?;
        let bytes_left = self.lines.bytes_left();
        match usize::try_from(claimed) {
            Ok(count) if count <= bytes_left / 2 => Ok(count),
            _ => {
                let what = "entries";
                Err(self.fault(ReadProblem::TooManyClaimed { what, claimed, bytes_left }))
            }
        }
    }
}

/// The shape of a section's cells, and how many nodes each has.
fn cells_of(section: &str) -> Option<(Shape, usize)> {
    Some(match section {
        "Corners" | "RequiredVertices" => return None,
        "Edges" => (Shape::Line, 2),
        "Triangles" => (Shape::Triangle, 3),
        "TrianglesP2" => (Shape::Triangle, 6),
        "Quadrilaterals" => (Shape::Quad, 4),
        "Tetrahedra" => (Shape::Tet, 4),
        "TetrahedraP2" => (Shape::Tet, 10),
        "Pyramids" => (Shape::Pyramid, 5),
        "Prisms" => (Shape::Wedge, 6),
        "Hexahedra" | "Hexaedra" => (Shape::Hexahedron, 8),
        _ => return None,
    })
}

/// Cells of all sections.
#[derive(Default)]
struct Elements {
    cells: Cells,
    places: Vec<Place>,
    /// Vertices by shape and reference of points, edges and faces.
    patches: BTreeMap<(Shape, i64), Vec<u32>>,
}

impl Elements {
    /// Adds the cells of a section: vertices and a reference each.
    fn read(
        &mut self,
        reader: &mut Reader,
        (shape, count): (Shape, usize),
        section: &str,
    ) -> Result<(), Fault> {
        for _ in 0..reader.count(section)? {
            let mut nodes = [0; 10];
            for node in &mut nodes[..count] {
                let expected = "a vertex number, 1 or more";
                let number: u32 = reader.parse(expected, section)?;
                let index = number.checked_sub(1);
                *node = index.ok_or_else(|| reader.fault(bad_word(expected, b"0")))?;
            }
            let place = Place::Line(reader.lines.number());
            let reference: i64 = reader.parse("a reference", section)?;
            let nodes = &nodes[..count];
            let is_solid = !matches!(shape, Shape::Line | Shape::Triangle | Shape::Quad);
            if !is_solid && reference != 0 {
                let shape = if shape == Shape::Quad { Shape::Triangle } else { shape };
                self.patches.entry((shape, reference)).or_default().extend_from_slice(nodes);
            }
            let region = if is_solid { u32::try_from(reference) } else { Ok(0) };
            let region = region.map_err(|_| {
                let found = reference.to_string();
                reader.fault(bad_word("a reference of 0 or more", found.as_bytes()))
            })?;
            self.cells.add(shape, nodes, region, self.places.len());
            self.places.push(place);
        }
        Ok(())
    }
}

/// Reads a mesh.
pub(super) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let mut reader = Reader { lines: Lines::new(bytes), words: None };
    let mut vertices: Option<Vec<Vec3<f64>>> = None;
    let mut of_vertices = Vec::new();
    let mut elements = Elements::default();
    let mut is_ended = false;
    while let Some(word) = reader.word() {
        let section = shorten(word);
        match section.as_str() {
            "MeshVersionFormatted" => {
                reader.parse::<u32>("a version", &section)?;
            }
            "Dimension" => {
                let dimension: u32 = reader.parse("a dimension", &section)?;
                if dimension != 3 {
                    let found = format!("a mesh of {dimension} dimensions");
                    let advice = "tissue needs three";
                    return Err(reader.fault(ReadProblem::Unsupported { found, advice }));
                }
            }
            "End" => {
                is_ended = true;
                break;
            }
            "Vertices" => {
                if vertices.is_some() {
                    return Err(reader.fault(ReadProblem::SecondPart { what: section }));
                }
                let mut list = Vec::new();
                for _ in 0..reader.count(&section)? {
                    let mut coordinate = || reader.parse::<f64>("a coordinate", "Vertices");
                    list.push(vec3(coordinate()?, coordinate()?, coordinate()?));
                    of_vertices.push(Place::Line(reader.lines.number()));
                    reader.parse::<i64>("a reference", "Vertices")?;
                }
                vertices = Some(list);
            }
            _ if section.starts_with(|c: char| c.is_ascii_alphabetic()) => {
                let Some((shape, count)) = cells_of(&section) else {
                    pass_over(&mut reader, &mut elements.cells, &section)?;
                    continue;
                };
                elements.read(&mut reader, (shape, count), &section)?;
            }
            _ => return Err(reader.fault(bad_word("a section such as Vertices", word))),
        }
    }
    if !is_ended {
        let reading = "the file (no End)".to_owned();
        return Err(reader.fault(ReadProblem::UnexpectedEnd { reading }));
    }
    let vertices = vertices.unwrap_or_default();
    if vertices.is_empty() {
        return Err(Fault::whole_file(ReadProblem::Missing { what: "section Vertices".into() }));
    }
    let Elements { cells, places: of_cells, patches } = elements;
    let patches = patches.into_iter().map(|((shape, reference), mut vertices)| {
        vertices.sort_unstable();
        vertices.dedup();
        let kind = if shape == Shape::Line { "curve" } else { "surface" };
        Patch { name: format!("{kind} {reference}"), vertices }
    });
    let patches = patches.collect();
    let places = Box::new(move |place| match place {
        MeshPlace::Whole => None,
        MeshPlace::Vertex(vertex) => of_vertices.get(vertex).copied(),
        MeshPlace::Tet(cell) => of_cells.get(cell).copied(),
    });
    let format = Format::Medit;
    Ok(Content { format, vertices, cells, patches, region_names: Vec::new(), places })
}

/// Entries of other sections: all numbers up to the next word.
fn pass_over(reader: &mut Reader, cells: &mut Cells, section: &str) -> Result<(), Fault> {
    let count = reader.count(section)?;
    let is_number = |word: &[u8]| parse_word::<f64>(word).is_some();
    loop {
        let before = (reader.lines.clone(), reader.words.clone());
        match reader.word() {
            Some(word) if is_number(word) => {}
            _ => {
                (reader.lines, reader.words) = before;
                break;
            }
        }
    }
    if count > 0 {
        cells.skip(section);
    }
    Ok(())
}
