//! Abaqus input (`.inp`): nodes, elements, sets; "Abaqus Keywords Reference Guide". Element sets of solids are regions; node sets
//! and element sets of surfaces and lines are patches. Materials, steps and loads are passed over.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::cells::{Cells, Shape};
use super::content::Content;
use super::error::{Fault, Place, ReadProblem};
use super::lines::{Line, Lines, bad_word, parse_word};
use super::numbered::Vertices;
use super::parsed::{Format, Patch};
use crate::mesh::MeshPlace;
use crate::scalar::vec3;

/// An element as listed; its nodes are a range of those of all.
struct Element {
    number: u64,
    shape: Shape,
    nodes: Range<usize>,
    line: usize,
}

/// Sets of nodes or of elements, in the order in which they begin.
#[derive(Default)]
struct Sets {
    list: Vec<(String, Vec<u64>)>,
    by_name: BTreeMap<String, usize>,
}

impl Sets {
    /// The place in the list of a set, which is begun where there is none.
    fn open(&mut self, name: String) -> usize {
        let next = self.list.len();
        let at = *self.by_name.entry(name.clone()).or_insert(next);
        if at == next {
            self.list.push((name, Vec::new()));
        }
        at
    }

    fn add(&mut self, set: usize, member: u64) {
        self.list[set].1.push(member);
    }
}

/// What the data lines below a keyword are; sets by their place in the list.
enum Block {
    Nodes { set: Option<usize> },
    Elements { kind: Option<(Shape, usize)>, set: Option<usize> },
    NodeSet { set: usize, is_range: bool },
    ElementSet { set: usize, is_range: bool },
    Instance,
    Other,
}

#[derive(Default)]
struct File {
    vertices: Vertices,
    elements: Vec<Element>,
    nodes: Vec<u64>,
    skipped: Cells,
    node_sets: Sets,
    element_sets: Sets,
    instances: usize,
    /// How many more members sets may take from ranges and from other sets: lines that double a set each, or a range up to
    /// the largest number, ask for any amount of memory.
    room: usize,
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
        "STRI65" | "M3D6" | "SFM3D6" => Some((Shape::Triangle, 6)),
        "S4" | "S4R" | "M3D4" | "R3D4" | "SFM3D4" => Some((Shape::Quad, 4)),
        "S8R" | "M3D8" | "SFM3D8" => Some((Shape::Quad, 8)),
        // Plane stress and plane strain; Gmsh writes the surfaces of solids as such.
        "CPS3" | "CPE3" => Some((Shape::Triangle, 3)),
        "CPS6" | "CPE6" => Some((Shape::Triangle, 6)),
        "CPS4" | "CPS4R" | "CPE4" | "CPE4R" => Some((Shape::Quad, 4)),
        "CPS8" | "CPS8R" | "CPE8" | "CPE8R" => Some((Shape::Quad, 8)),
        "T3D2" | "B31" => Some((Shape::Line, 2)),
        "T3D3" | "B32" => Some((Shape::Line, 3)),
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
        b"*NODE" => {
            let set = parameter(line, "NSET").map(|name| file.node_sets.open(name));
            Block::Nodes { set }
        }
        b"*ELEMENT" => {
            let kind = shape_of(&need("TYPE")?);
            let set = parameter(line, "ELSET").map(|name| file.element_sets.open(name));
            Block::Elements { kind, set }
        }
        b"*NSET" => Block::NodeSet { set: file.node_sets.open(need("NSET")?), is_range },
        b"*ELSET" => Block::ElementSet { set: file.element_sets.open(need("ELSET")?), is_range },
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
    let mut file = File { room: bytes.len() / 2, ..File::default() };
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
                    file.node_sets.add(*set, number);
                }
            }
            Block::Elements { kind: None, .. } => file.skipped.skip("element of another type"),
            Block::Elements { kind: Some((shape, count)), set } => {
                let numbers = numbers::<u64>(line, "element and node numbers")?;
                let element = match &mut pending {
                    Some(element) => {
                        file.nodes.extend(&numbers);
                        element
                    }
                    None => {
                        let [number, nodes @ ..] = &numbers[..] else { continue };
                        if let Some(set) = set {
                            file.element_sets.add(*set, *number);
                        }
                        let (start, line) = (file.nodes.len(), line.number);
                        file.nodes.extend(nodes);
                        let (number, shape) = (*number, *shape);
                        pending.insert(Element { number, shape, nodes: start..start, line })
                    }
                };
                element.nodes.end = file.nodes.len();
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
            Block::NodeSet { set, is_range } => {
                file.node_sets.read(line, (*set, *is_range), &mut file.room)?;
            }
            Block::ElementSet { set, is_range } => {
                file.element_sets.read(line, (*set, *is_range), &mut file.room)?;
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

impl Sets {
    /// Adds the members that a line lists: numbers, names of other sets, or first, last and step.
    fn read(
        &mut self,
        line: Line,
        (set, is_range): (usize, bool),
        room: &mut usize,
    ) -> Result<(), Fault> {
        let mut take = |count: u64| -> Result<(), Fault> {
            let left = usize::try_from(count).ok().and_then(|count| room.checked_sub(count));
            *room = left.ok_or_else(|| {
                let found = "a file whose sets have more members than it has room for".to_owned();
                let advice = "export it without sets of sets and without ranges (GENERATE)";
                line.fault(ReadProblem::Unsupported { found, advice })
            })?;
            Ok(())
        };
        if is_range {
            let numbers = numbers::<u64>(line, "first, last and step")?;
            let (first, last, step) = match numbers[..] {
                [first, last] => (first, last, 1),
                [first, last, step] if step > 0 => (first, last, step),
                _ => return Err(line.fault(bad_word("first, last and step", line.text))),
            };
            let Some(steps) = last.checked_sub(first).map(|span| span / step) else {
                return Ok(());
            };
            take(steps.saturating_add(1))?;
            self.list[set].1.extend((0..=steps).map(|index| first + index * step));
            return Ok(());
        }
        let text = line.text.strip_suffix(b",").unwrap_or(line.text);
        for word in text.split(|&byte| byte == b',').map(<[u8]>::trim_ascii) {
            if let Some(number) = parse_word(word) {
                self.list[set].1.push(number);
                continue;
            }
            let Some(&other) = self.by_name.get(&*String::from_utf8_lossy(word)) else {
                let expected = "a number, or the name of a set above";
                return Err(line.fault(bad_word(expected, word)));
            };
            // A set that names itself stays what it is.
            if other != set {
                take(self.list[other].1.len() as u64)?;
                let members = std::mem::take(&mut self.list[other].1);
                self.list[set].1.extend_from_slice(&members);
                self.list[other].1 = members;
            }
        }
        Ok(())
    }
}

impl File {
    /// An element must have all its nodes where the next keyword comes.
    fn finish_element(&self, pending: &mut Option<Element>) -> Result<(), Fault> {
        let Some(element) = pending.take() else { return Ok(()) };
        let what = format!("nodes of element {}, a {}", element.number, element.shape.name());
        let (claimed, found) = (element.shape.corner_count(), element.nodes.len());
        Err(Fault::at(element.line, ReadProblem::CountMismatch { what, claimed, found }))
    }

    /// Numbers of elements with their places in the list, ascending. Of several elements of one number a set means the first.
    fn numbered(&self) -> Vec<(u64, u32)> {
        let numbers = self.elements.iter().zip(0u32..).map(|(element, at)| (element.number, at));
        let mut numbers: Vec<(u64, u32)> = numbers.collect();
        numbers.sort_unstable();
        numbers
    }

    /// The region of each element: the first set that it is in, since sets of all elements come last in files; 0 without any.
    /// Sets that Gmsh makes of each volume come last of all: groups with a name of their own follow them.
    fn regions(&self, numbers: &[(u64, u32)]) -> Vec<u32> {
        let mut regions = vec![0; self.elements.len()];
        let sets = || self.element_sets.list.iter().zip(1u32..);
        let named = sets().filter(|((name, _), _)| !is_of_one_volume(name));
        let of_volumes = sets().filter(|((name, _), _)| is_of_one_volume(name));
        for ((_, members), region) in named.chain(of_volumes) {
            for &member in members {
                let start = numbers.partition_point(|(number, _)| *number < member);
                let same = numbers[start..].iter().take_while(|(number, _)| *number == member);
                for &(_, element) in same {
                    let own = &mut regions[element as usize];
                    // All elements of one number have a region as soon as the first has.
                    if *own != 0 {
                        break;
                    }
                    *own = region;
                }
            }
        }
        regions
    }

    /// Nodes of each element set of surfaces or lines. One that has solids too is a region, or all there is.
    fn surfaces(&self, numbers: &[(u64, u32)]) -> Vec<Patch> {
        let mut patches = Vec::new();
        for (name, members) in &self.element_sets.list {
            let (mut vertices, mut has_solids) = (Vec::new(), false);
            for &member in members {
                let at = numbers.partition_point(|(number, _)| *number < member);
                let found = numbers.get(at).filter(|(number, _)| *number == member);
                let Some(element) = found.map(|&(_, at)| &self.elements[at as usize]) else {
                    continue;
                };
                if is_solid(element.shape) {
                    has_solids = true;
                    break;
                }
                let nodes = self.nodes[element.nodes.clone()].iter();
                vertices.extend(nodes.filter_map(|&node| self.vertices.find(node)));
            }
            if !vertices.is_empty() && !has_solids {
                patches.push(Patch { name: name.clone(), vertices });
            }
        }
        patches
    }

    fn finish<'a>(mut self) -> Result<Content<'a>, Fault> {
        self.vertices.number()?;
        if self.vertices.positions.is_empty() {
            return Err(Fault::whole_file(ReadProblem::Missing { what: "nodes (*NODE)".into() }));
        }
        let numbers = self.numbered();
        let regions = self.regions(&numbers);
        let mut cells = std::mem::take(&mut self.skipped);
        let (mut used, mut indices) = (BTreeSet::new(), Vec::new());
        for (cell, (element, &region)) in self.elements.iter().zip(&regions).enumerate() {
            indices.clear();
            for &node in &self.nodes[element.nodes.clone()] {
                indices.push(self.vertices.find(node).ok_or_else(|| {
                    let name = format!("element {}", element.number);
                    self.vertices.unknown(name, node, Some(Place::Line(element.line)))
                })?);
            }
            if is_solid(element.shape) {
                used.insert(region);
            }
            cells.add(element.shape, &indices, region, cell);
        }
        let mut patches = self.surfaces(&numbers);
        let lines: Vec<usize> = self.elements.iter().map(|element| element.line).collect();
        let regions = self.element_sets.list.into_iter().zip(1u32..);
        let region_names = regions.filter(|(_, region)| used.contains(region));
        let region_names = region_names.map(|((name, _), region)| (region, name)).collect();
        for (name, set) in self.node_sets.by_name {
            let members = std::mem::take(&mut self.node_sets.list[set].1);
            let vertices = members.iter().filter_map(|&number| self.vertices.find(number));
            patches.push(Patch { name, vertices: vertices.collect() });
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

fn is_solid(shape: Shape) -> bool {
    !matches!(shape, Shape::Point | Shape::Line | Shape::Triangle | Shape::Quad)
}

/// Whether a set is one of those that Gmsh makes of each volume: "Volume12".
fn is_of_one_volume(name: &str) -> bool {
    let number = name.strip_prefix("Volume");
    number.is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Whether text looks like input of Abaqus: its first line that is no comment begins with a star and a letter.
pub(super) fn looks_like(first: &[u8]) -> bool {
    matches!(first, [b'*', b'*', ..]) || matches!(first, [b'*', c, ..] if c.is_ascii_alphabetic())
}
