//! PLY surfaces, text and binary in both byte orders: Turk, "The PLY polygon file format", 1994. Vertices and faces are read,
//! other elements and properties passed over.

use std::fmt::Write;

use super::cells::Cells;
use super::content::Content;
use super::error::{Fault, Place, ReadProblem};
use super::lines::{Lines, Words, bad_word, parse_word};
use super::parsed::Format;
use super::text::shorten;
use crate::mesh::{MeshPlace, SurfaceMesh};
use crate::scalar::vec3;

/// A type of numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn named(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// From bytes in little-endian order.
    fn decode(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(bytes),
        }
    }
}

struct Property {
    name: String,
    kind: Kind,
    /// The type of the number of entries, of a list.
    count: Option<Kind>,
}

struct Element {
    name: String,
    count: u64,
    line: usize,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Coding {
    Text,
    Little,
    Big,
}

/// Goes through the numbers behind the header.
struct Numbers<'a> {
    lines: Lines<'a>,
    words: Option<Words<'a>>,
    total: usize,
    coding: Coding,
}

impl Numbers<'_> {
    fn place(&self) -> Place {
        match self.coding {
            Coding::Text => Place::Line(self.lines.number()),
            _ => Place::Byte(self.total - self.lines.bytes_left()),
        }
    }

    fn fault(&self, problem: ReadProblem) -> Fault {
        Fault { place: Some(self.place()), problem }
    }

    fn cut_short(&self, element: &Element) -> Fault {
        let reading = format!("element `{}`", shorten(element.name.as_bytes()));
        self.fault(ReadProblem::UnexpectedEnd { reading })
    }

    fn begin(&mut self, element: &Element) -> Result<(), Fault> {
        if self.coding == Coding::Text {
            let line = self.lines.next().ok_or_else(|| self.cut_short(element))?;
            self.words = Some(line.words());
        }
        Ok(())
    }

    fn number(&mut self, kind: Kind, element: &Element) -> Result<f64, Fault> {
        if self.coding == Coding::Text {
            let word = self.words.as_mut().and_then(Iterator::next).unwrap_or_default();
            return parse_word(word).ok_or_else(|| self.fault(bad_word("a number", word)));
        }
        let Some(taken) = self.lines.bytes(kind.bytes()) else {
            return Err(self.cut_short(element));
        };
        let mut bytes = [0; 8];
        bytes[..taken.len()].copy_from_slice(taken);
        if self.coding == Coding::Big {
            bytes[..taken.len()].reverse();
        }
        Ok(kind.decode(bytes))
    }

    /// A number that counts, or names a vertex.
    fn natural(&mut self, kind: Kind, element: &Element) -> Result<u32, Fault> {
        let value = self.number(kind, element)?;
        if value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0 {
            return Ok(value as u32);
        }
        let expected = "a whole number of 0 or more";
        Err(self.fault(bad_word(expected, value.to_string().as_bytes())))
    }

    fn bytes_left(&self) -> usize {
        self.lines.bytes_left()
    }
}

/// Reads a surface.
pub(super) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let mut lines = Lines::new(bytes);
    let (coding, elements) = read_header(&mut lines)?;
    let mut numbers = Numbers { lines, words: None, total: bytes.len(), coding };
    let (mut vertices, mut of_vertices) = (Vec::new(), Vec::new());
    let (mut cells, mut of_cells) = (Cells::default(), Vec::new());
    let mut list = Vec::new();
    // Without properties an entry is no bytes, however many are announced.
    for element in elements.iter().filter(|element| !element.properties.is_empty()) {
        let smallest: usize =
            element.properties.iter().map(|p| p.count.unwrap_or(p.kind).bytes()).sum();
        let smallest = if coding == Coding::Text { 2 } else { smallest };
        let bytes_left = numbers.bytes_left();
        if element.count > (bytes_left / smallest + 1) as u64 {
            let (what, claimed) = ("entries", element.count);
            let problem = ReadProblem::TooManyClaimed { what, claimed, bytes_left };
            return Err(Fault::at(element.line, problem));
        }
        for _ in 0..element.count {
            numbers.begin(element)?;
            let place = numbers.place();
            let mut x = [f64::NAN; 3];
            let mut corners: Option<Vec<u32>> = None;
            for property in &element.properties {
                let Some(count) = property.count else {
                    let value = numbers.number(property.kind, element)?;
                    if let Some(axis) = ["x", "y", "z"].iter().position(|n| *n == property.name) {
                        x[axis] = value;
                    }
                    continue;
                };
                list.clear();
                let is_corners = property.name.starts_with("vertex_ind");
                for _ in 0..numbers.natural(count, element)? {
                    if is_corners {
                        list.push(numbers.natural(property.kind, element)?);
                    } else {
                        numbers.number(property.kind, element)?;
                    }
                }
                if is_corners {
                    corners = Some(list.clone());
                }
            }
            match (element.name.as_str(), corners) {
                ("vertex", _) => {
                    vertices.push(vec3(x[0], x[1], x[2]));
                    of_vertices.push(place);
                }
                ("face", Some(corners)) => {
                    cells.add_polygon(&corners, of_cells.len());
                    of_cells.push(place);
                }
                (name, _) => cells.skip(name),
            }
        }
    }
    if cells.triangles.is_empty() {
        return Err(Fault::whole_file(ReadProblem::Missing { what: "faces".into() }));
    }
    let format = if coding == Coding::Text { Format::Ply } else { Format::PlyBinary };
    let places = Box::new(move |place| match place {
        MeshPlace::Whole => None,
        MeshPlace::Vertex(vertex) => of_vertices.get(vertex).copied(),
        MeshPlace::Tet(cell) => of_cells.get(cell).copied(),
    });
    Ok(Content::of_cells(format, vertices, cells, places))
}

/// How numbers stand, and the elements in their order.
fn read_header(lines: &mut Lines) -> Result<(Coding, Vec<Element>), Fault> {
    let mut coding = None;
    let mut elements: Vec<Element> = Vec::new();
    for line in lines.by_ref() {
        let mut words = line.words();
        let keyword = words.next().unwrap_or_default();
        match keyword {
            b"ply" | b"comment" | b"obj_info" => {}
            b"format" => {
                let word = words.next().unwrap_or_default();
                coding = Some(match word {
                    b"ascii" => Coding::Text,
                    b"binary_little_endian" => Coding::Little,
                    b"binary_big_endian" => Coding::Big,
                    other => return Err(line.fault(bad_word("a format of PLY", other))),
                });
            }
            b"element" => {
                let name = shorten(words.next().unwrap_or_default());
                let count = words.parse("a number of entries")?;
                let line = line.number;
                elements.push(Element { name, count, line, properties: Vec::new() });
            }
            b"property" => {
                let first = words.next().unwrap_or_default();
                let (count, kind) = if first == b"list" {
                    let count = words.next().unwrap_or_default();
                    (Some(count), words.next().unwrap_or_default())
                } else {
                    (None, first)
                };
                let named = |word: &[u8]| {
                    let problem = bad_word("a type of numbers such as float", word);
                    Kind::named(word).ok_or_else(|| line.fault(problem))
                };
                let (count, kind) = (count.map(named).transpose()?, named(kind)?);
                let name = shorten(words.next().unwrap_or_default());
                match elements.last_mut() {
                    Some(element) => element.properties.push(Property { name, kind, count }),
                    None => return Err(line.fault(bad_word("an element first", line.text))),
                }
            }
            b"end_header" => {
                let what = || ReadProblem::Missing { what: "line `format`".into() };
                return Ok((coding.ok_or_else(|| line.fault(what()))?, elements));
            }
            _ => return Err(line.fault(bad_word("a line of a header of PLY", line.text))),
        }
    }
    let reading = "the header".to_owned();
    Err(Fault::at(lines.number(), ReadProblem::UnexpectedEnd { reading }))
}

/// A surface as binary PLY, in metres, double precision.
pub fn write(mesh: &SurfaceMesh) -> Vec<u8> {
    let mut head = String::from("ply\nformat binary_little_endian 1.0\ncomment metres\n");
    // Writing to a string cannot fail.
    let _ = writeln!(head, "element vertex {}", mesh.vertices.len());
    head.push_str("property double x\nproperty double y\nproperty double z\n");
    let _ = writeln!(head, "element face {}", mesh.triangles.len());
    head.push_str("property list uchar int vertex_indices\nend_header\n");
    let mut bytes = head.into_bytes();
    for value in mesh.vertices.iter().flat_map(|x| x.to_array()) {
        bytes.extend_from_slice(&value.to_le_bytes());
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        triangle.iter().for_each(|vertex| bytes.extend_from_slice(&vertex.to_le_bytes()));
    }
    bytes
}
