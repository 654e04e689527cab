//! Abaqus input (`.inp`): nodes, elements, sets; "Abaqus Keywords Reference Guide". Element sets of solids are regions, node sets
//! are patches. Materials, steps and loads are passed over.

use std::collections::BTreeMap;

use super::cells::{Cells, Shape};
use super::content::Content;
use super::error::{Fault, Place, ReadProblem};
use super::lines::{Line, Lines, bad_word, parse_word};
use super::numbered::Vertices;
use super::parsed::{Format, Patch};
use crate::mesh::MeshPlace;
use crate::scalar::vec3;

/// An element as listed.
struct Element {
    number: u64,
    shape: Shape,
    nodes: Vec<u64>,
    line: usize,
}

/// What the data lines below a keyword are.
enum Block {
    Nodes { set: Option<String> },
    Elements { kind: Option<(Shape, usize)>, set: Option<String> },
    NodeSet { name: String, is_range: bool },
    ElementSet { name: String, is_range: bool },
    Instance,
    Other,
}

#[derive(Default)]
struct File {
    vertices: Vertices,
    elements: Vec<Element>,
    skipped: Cells,
    node_sets: BTreeMap<String, Vec<u64>>,
    element_sets: Vec<(String, Vec<u64>)>,
    instances: usize,
}

/// A parameter of a keyword's line, upper-case names before `=`.
fn parameter(line: Line, wanted: &str) -> Option<String> {
    line.text.split(|&byte| byte == b',').skip(1).find_map(|part| {
        let text = String::from_utf8_lossy(part);
        let (name, value) = text.split_once('=').unwrap_or((&text, ""));
        let is_wanted = name.trim().eq_ignore_ascii_case(wanted);
        is_wanted.then(|| value.trim().trim_matches('"').to_owned())
    })
}

/// The shape of a type, and how many nodes an element has.
fn shape_of(kind: &str) -> Option<(Shape, usize)> {
    let kind = kind.to_ascii_uppercase();
    let solid = ["C3D", "DC3D", "AC3D"].iter().find_map(|start| kind.strip_prefix(start));
    if let Some(rest) = solid {
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        return Some(match digits.as_str() {
            "4" => (Shape::Tet, 4),
            "5" => (Shape::Pyramid, 5),
            "6" => (Shape::Wedge, 6),
            "8" => (Shape::Hexahedron, 8),
            "10" => (Shape::Tet, 10),
            "15" => (Shape::Wedge, 15),
            "20" => (Shape::Hexahedron, 20),
            _ => return None,
        });
    }
    match kind.as_str() {
        "S3" | "S3R" | "STRI3" | "M3D3" | "R3D3" | "SFM3D3" => Some((Shape::Triangle, 3)),
        "STRI65" | "M3D6" => Some((Shape::Triangle, 6)),
        "S4" | "S4R" | "M3D4" | "R3D4" | "SFM3D4" => Some((Shape::Quad, 4)),
        _ => None,
    }
}

fn block_of(line: Line, file: &mut File) -> Result<Block, Fault> {
    let keyword = line.text.split(|&byte| byte == b',').next().unwrap_or_default().trim_ascii();
    let need = |name: &str| {
        let what = format!("parameter {name}=");
        parameter(line, name)
            .filter(|value| !value.is_empty())
            .ok_or_else(|| line.fault(ReadProblem::Missing { what }))
    };
    let is_range = parameter(line, "GENERATE").is_some();
    Ok(match keyword.to_ascii_uppercase().as_slice() {
        b"*NODE" => Block::Nodes { set: parameter(line, "NSET") },
        b"*ELEMENT" => {
            let kind = need("TYPE")?;
            Block::Elements { kind: shape_of(&kind), set: parameter(line, "ELSET") }
        }
        b"*NSET" => Block::NodeSet { name: need("NSET")?, is_range },
        b"*ELSET" => Block::ElementSet { name: need("ELSET")?, is_range },
        b"*INSTANCE" => {
            file.instances += 1;
            if file.instances > 1 {
                let found = "an assembly of several instances".to_owned();
                let advice = "export one part, or mesh the assembly as one part";
                return Err(line.fault(ReadProblem::Unsupported { found, advice }));
            }
            Block::Instance
        }
        b"*INCLUDE" => {
            let found = "a file that includes another".to_owned();
            let advice = "put both into one file";
            return Err(line.fault(ReadProblem::Unsupported { found, advice }));
        }
        _ => Block::Other,
    })
}

/// Reads a mesh.
pub(super) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let mut file = File::default();
    let mut block = Block::Other;
    let mut pending: Option<Element> = None;
    for line in Lines::new(bytes).filter(|line| !line.text.starts_with(b"**")) {
        if line.text.starts_with(b"*") {
            file.finish_element(&mut pending)?;
            block = block_of(line, &mut file)?;
            continue;
        }
        match &block {
            Block::Nodes { set } => {
                let numbers = numbers::<f64>(line, "a node number and coordinates")?;
                let [number, x, y, z, ..] = numbers[..] else {
                    return Err(
                        line.fault(bad_word("a node number and three coordinates", line.text))
                    );
                };
                let number = natural(line, number)?;
                file.vertices.numbers.push(number);
                file.vertices.positions.push(vec3(x, y, z));
                file.vertices.places.push(Place::Line(line.number));
                if let Some(set) = set {
                    file.node_sets.entry(set.clone()).or_default().push(number);
                }
            }
            Block::Elements { kind: None, .. } => file.skipped.skip("element of another type"),
            Block::Elements { kind: Some((shape, count)), set } => {
                let numbers = numbers::<u64>(line, "element and node numbers")?;
                let element = match &mut pending {
                    Some(element) => {
                        element.nodes.extend(&numbers);
                        element
                    }
                    None => {
                        let [number, nodes @ ..] = &numbers[..] else { continue };
                        if let Some(set) = set {
                            file.element_set(set).push(*number);
                        }
                        let (nodes, shape) = (nodes.to_vec(), *shape);
                        pending.insert(Element { number: *number, shape, nodes, line: line.number })
                    }
                };
                // Elements go on in further lines until they have all nodes.
                if element.nodes.len() == *count {
                    file.elements.extend(pending.take());
                } else if element.nodes.len() > *count {
                    let what = format!("nodes of a {}", shape.name());
                    let found = element.nodes.len();
                    let problem = ReadProblem::CountMismatch { what, claimed: *count, found };
                    return Err(line.fault(problem));
                }
            }
            Block::NodeSet { name, is_range } => {
                let members = file.members(line, *is_range, true)?;
                file.node_sets.entry(name.clone()).or_default().extend(members);
            }
            Block::ElementSet { name, is_range } => {
                let members = file.members(line, *is_range, false)?;
                file.element_set(name).extend(members);
            }
            Block::Instance => {
                let found = "an instance that is moved or turned".to_owned();
                let advice = "export the part itself";
                return Err(line.fault(ReadProblem::Unsupported { found, advice }));
            }
            Block::Other => {}
        }
    }
    file.finish_element(&mut pending)?;
    file.finish()
}

/// Numbers between commas; a comma may end the line.
fn numbers<T: std::str::FromStr>(line: Line, expected: &'static str) -> Result<Vec<T>, Fault> {
    let text = line.text.strip_suffix(b",").unwrap_or(line.text);
    let words = text.split(|&byte| byte == b',').map(<[u8]>::trim_ascii);
    words.map(|word| parse_word(word).ok_or_else(|| line.fault(bad_word(expected, word)))).collect()
}

fn natural(line: Line, value: f64) -> Result<u64, Fault> {
    if value >= 0.0 && value.fract() == 0.0 && value < 9e15 {
        return Ok(value as u64);
    }
    Err(line.fault(bad_word("a number of 0 or more", value.to_string().as_bytes())))
}

impl File {
    fn element_set(&mut self, name: &str) -> &mut Vec<u64> {
        let at = self.element_sets.iter().position(|(known, _)| known == name);
        let at = at.unwrap_or_else(|| {
            self.element_sets.push((name.to_owned(), Vec::new()));
            self.element_sets.len() - 1
        });
        &mut self.element_sets[at].1
    }

    /// Members of a set in a line: numbers, names of other sets, or first, last and step.
    fn members(&self, line: Line, is_range: bool, of_nodes: bool) -> Result<Vec<u64>, Fault> {
        if is_range {
            let numbers = numbers::<u64>(line, "first, last and step")?;
            let (first, last, step) = match numbers[..] {
                [first, last] => (first, last, 1),
                [first, last, step] if step > 0 => (first, last, step),
                _ => return Err(line.fault(bad_word("first, last and step", line.text))),
            };
            // No more than there are: a range is a line, whatever it claims.
            let known = if of_nodes { self.vertices.numbers.len() } else { self.elements.len() };
            let claimed = last.checked_sub(first).map_or(0, |span| span / step + 1);
            if claimed > known as u64 {
                let (what, bytes_left) = ("members of a set", line.text.len());
                return Err(line.fault(ReadProblem::TooManyClaimed { what, claimed, bytes_left }));
            }
            return Ok((0..claimed).map(|index| first + index * step).collect());
        }
        let text = line.text.strip_suffix(b",").unwrap_or(line.text);
        let mut members = Vec::new();
        for word in text.split(|&byte| byte == b',').map(<[u8]>::trim_ascii) {
            if let Some(number) = parse_word(word) {
                members.push(number);
                continue;
            }
            let name = String::from_utf8_lossy(word);
            let of_elements = self.element_sets.iter().find(|(known, _)| *known == name);
            let set = if of_nodes {
                self.node_sets.get(&*name)
            } else {
                of_elements.map(|(_, members)| members)
            };
            match set {
                Some(set) => members.extend(set),
                None => {
                    let expected = "a number, or the name of a set above";
                    return Err(line.fault(bad_word(expected, word)));
                }
            }
        }
        Ok(members)
    }

    /// An element must have all its nodes where the next keyword comes.
    fn finish_element(&self, pending: &mut Option<Element>) -> Result<(), Fault> {
        let Some(element) = pending.take() else { return Ok(()) };
        let what = format!("nodes of element {}, a {}", element.number, element.shape.name());
        let (claimed, found) = (element.shape.corner_count(), element.nodes.len());
        Err(Fault::at(element.line, ReadProblem::CountMismatch { what, claimed, found }))
    }

    fn finish<'a>(mut self) -> Result<Content<'a>, Fault> {
        self.vertices.number()?;
        if self.vertices.positions.is_empty() {
            return Err(Fault::whole_file(ReadProblem::Missing { what: "nodes (*NODE)".into() }));
        }
        // The first set that an element is in says which region it is of; sets of all elements come last in files.
        let mut region_of = BTreeMap::new();
        let mut region_names = Vec::new();
        for ((name, members), region) in self.element_sets.iter().zip(1u32..) {
            region_names.push((region, name.clone()));
            for member in members {
                region_of.entry(*member).or_insert(region);
            }
        }
        let mut cells = self.skipped;
        let mut lines = Vec::new();
        let mut used = std::collections::BTreeSet::new();
        for Element { number, shape, nodes, line } in &self.elements {
            let mut indices = Vec::with_capacity(nodes.len());
            for &node in nodes {
                indices.push(self.vertices.find(node).ok_or_else(|| {
                    let element = format!("element {number}");
                    self.vertices.unknown(element, node, Some(Place::Line(*line)))
                })?);
            }
            let region = region_of.get(number).copied().unwrap_or(0);
            used.insert(region);
            cells.add(*shape, &indices, region, lines.len());
            lines.push(*line);
        }
        region_names.retain(|(region, _)| used.contains(region));
        let mut patches = Vec::new();
        for (name, members) in self.node_sets {
            let mut vertices: Vec<u32> =
                members.iter().filter_map(|&number| self.vertices.find(number)).collect();
            vertices.sort_unstable();
            vertices.dedup();
            patches.push(Patch { name, vertices });
        }
        let Vertices { positions, places: of_vertices, .. } = self.vertices;
        let places = Box::new(move |place| match place {
            MeshPlace::Whole => None,
            MeshPlace::Vertex(vertex) => of_vertices.get(vertex).copied(),
            MeshPlace::Tet(cell) => lines.get(cell).copied().map(Place::Line),
        });
        let (format, vertices) = (Format::Abaqus, positions);
        Ok(Content { format, vertices, cells, patches, region_names, places })
    }
}

/// Whether text looks like input of Abaqus: its first line that is no comment begins with a star and a letter.
pub(super) fn looks_like(first: &[u8]) -> bool {
    matches!(first, [b'*', b'*', ..]) || matches!(first, [b'*', c, ..] if c.is_ascii_alphabetic())
}
