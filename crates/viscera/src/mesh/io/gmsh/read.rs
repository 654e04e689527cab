//! Sections of a Gmsh file.

use std::collections::BTreeMap;

use super::kinds::kind_of;
use super::numbers::{Coding, Numbers};
use super::records::{Elements, SHORTEST_ELEMENT, SHORTEST_ENTITY, SHORTEST_VERTEX};
use crate::mesh::MeshPlace;
use crate::mesh::io::cells::Shape;
use crate::mesh::io::content::Content;
use crate::mesh::io::error::{Fault, ReadProblem};
use crate::mesh::io::lines::{Line, bad_word};
use crate::mesh::io::numbered::Vertices;
use crate::mesh::io::parsed::{Format, Patch};
use crate::mesh::io::text::shorten;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Version {
    One,
    Two,
    /// 4.0.
    Four,
    /// 4.1.
    FourOne,
}

/// A file as far as it has been read.
struct File<'a> {
    numbers: Numbers<'a>,
    version: Option<Version>,
    vertices: Option<Vertices>,
    elements: Option<Elements>,
    /// Names by dimension and tag of a physical group.
    names: BTreeMap<(u64, u64), String>,
    /// The first physical group of an entity, by dimension and tag.
    groups: BTreeMap<(u64, i64), u64>,
}

pub(in crate::mesh::io) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let mut file = File {
        numbers: Numbers::new(bytes),
        version: None,
        vertices: None,
        elements: None,
        names: BTreeMap::new(),
        groups: BTreeMap::new(),
    };
    while let Some(line) = file.numbers.line() {
        let section = match line.text {
            [b'$', section @ ..] => section,
            other => return Err(line.fault(bad_word("a section such as $Nodes", other))),
        };
        file.numbers.enter(section);
        match section {
            b"MeshFormat" if file.version.is_some() => {
                let what = "$MeshFormat".to_owned();
                return Err(line.fault(ReadProblem::SecondPart { what }));
            }
            b"MeshFormat" => file.read_format(section)?,
            b"PhysicalNames" => file.read_names()?,
            b"Entities" if file.is_four() => file.read_entities()?,
            b"NOD" | b"Nodes" => {
                file.begin(line, file.vertices.is_some())?;
                let mut vertices =
                    if file.is_four() { file.read_vertex_blocks()? } else { file.read_vertices()? };
                file.numbers.expect_end()?;
                vertices.number()?;
                file.vertices = Some(vertices);
            }
            b"ELM" | b"Elements" => {
                file.begin(line, file.elements.is_some())?;
                let mut elements = match (file.is_four(), file.numbers.is_binary()) {
                    (true, _) => file.read_element_blocks()?,
                    (_, true) => file.read_binary_elements()?,
                    _ => file.read_elements()?,
                };
                file.numbers.expect_end()?;
                elements.first.push(elements.nodes.len());
                file.elements = Some(elements);
            }
            _ => file.numbers.skip_section(section)?,
        }
    }
    file.finish()
}

impl<'a> File<'a> {
    fn is_four(&self) -> bool {
        matches!(self.version, Some(Version::Four | Version::FourOne))
    }

    /// A section must be the first of its kind, and something must have said how it is laid out.
    fn begin(&mut self, line: Line<'a>, is_second: bool) -> Result<(), Fault> {
        if is_second {
            return Err(line.fault(ReadProblem::SecondPart { what: shorten(line.text) }));
        }
        let is_old = matches!(line.text, b"$NOD" | b"$ELM");
        if self.version.is_none() && !is_old {
            return Err(line.fault(ReadProblem::Missing { what: "section $MeshFormat".into() }));
        }
        if is_old && self.version.is_some_and(|version| version != Version::One) {
            return Err(line.fault(bad_word("a section such as $Nodes", line.text)));
        }
        self.version.get_or_insert(Version::One);
        Ok(())
    }

    fn read_format(&mut self, section: &'a [u8]) -> Result<(), Fault> {
        let line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
        let mut words = line.words();
        let version: f64 = words.parse("a format version")?;
        let file_type: u32 = words.parse("a file type: 0 for text, 1 for binary")?;
        self.version = Some(match version {
            v if (2.0..3.0).contains(&v) => Version::Two,
            v if (4.0..4.1).contains(&v) => Version::Four,
            v if (4.1..4.2).contains(&v) => Version::FourOne,
            _ => {
                let found = format!("a Gmsh {version} file");
                let advice =
                    "known are versions 1, 2, 4.0 and 4.1; in Gmsh export it as one of them";
                return Err(line.fault(ReadProblem::Unsupported { found, advice }));
            }
        });
        if file_type == 0 {
            return self.numbers.skip_section(section);
        }
        if let Some(size) = words.next() {
            self.numbers.size_bytes = match size {
                b"4" => 4,
                b"8" => 8,
                other => return Err(line.fault(bad_word("a size of numbers, 4 or 8", other))),
            };
        }
        self.numbers.coding = Coding::Binary { is_swapped: false };
        let place = self.numbers.place();
        let is_swapped = match self.numbers.whole("the number 1")? {
            1 => false,
            0x0100_0000 => true,
            other => {
                let problem = bad_word("the number 1 in four bytes", other.to_string().as_bytes());
                return Err(Fault { place: Some(place), problem });
            }
        };
        self.numbers.coding = Coding::Binary { is_swapped };
        // Counts are eight bytes in version 4.0 whatever the size of coordinates is.
        if self.version == Some(Version::Four) {
            self.numbers.size_bytes = 8;
        }
        self.numbers.expect_end()
    }

    /// `dimension tag "name"`, text in all files.
    fn read_names(&mut self) -> Result<(), Fault> {
        let line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
        let count: u64 = line.words().parse("a count")?;
        for _ in 0..count {
            let line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
            let mut words = line.words();
            let key = (words.parse("a dimension, 0 to 3")?, words.parse("a physical tag")?);
            let text = String::from_utf8_lossy(line.text);
            let name = text.split_once('"').and_then(|(_, rest)| rest.rsplit_once('"'));
            let (name, _) =
                name.ok_or_else(|| line.fault(bad_word("a name in quotes", line.text)))?;
            self.names.insert(key, name.to_owned());
        }
        self.numbers.expect_end()
    }

    /// Which physical groups points, curves, surfaces and volumes belong to.
    fn read_entities(&mut self) -> Result<(), Fault> {
        let is_new = self.version == Some(Version::FourOne);
        let numbers = &mut self.numbers;
        numbers.record()?;
        let mut counts = [0; 4];
        for count in &mut counts {
            let claimed = numbers.size("a count")?;
            *count = numbers.check_count("entities", claimed, SHORTEST_ENTITY)?;
        }
        for (dimension, count) in (0..).zip(counts) {
            for _ in 0..count {
                numbers.record()?;
                let tag = numbers.whole("the tag of an entity")?;
                // Where a point is, or the box around it and all others.
                let box_numbers = if is_new && dimension == 0 { 3 } else { 6 };
                for _ in 0..box_numbers {
                    numbers.float("a coordinate")?;
                }
                let claimed = numbers.size("a count of physical groups")?;
                for at in 0..numbers.check_count("physical groups", claimed, SHORTEST_ENTITY)? {
                    let group = numbers.whole("a physical tag")?;
                    if at == 0 {
                        self.groups.insert((dimension, tag), group.unsigned_abs());
                    }
                }
                if dimension > 0 {
                    let claimed = numbers.size("a count of boundary entities")?;
                    for _ in 0..numbers.check_count("entities", claimed, SHORTEST_ENTITY)? {
                        numbers.whole("the tag of a boundary entity")?;
                    }
                }
            }
        }
        numbers.expect_end()
    }

    /// The number of entries, which stands on a line of its own also in binary files.
    fn read_count(&mut self, what: &'static str, shortest: [usize; 2]) -> Result<usize, Fault> {
        let line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
        let claimed: u64 = line.words().parse("a count")?;
        self.numbers.check_count(what, claimed, shortest).map_err(|fault| line.fault(fault.problem))
    }

    /// `number x y z`: versions 1 and 2.
    fn read_vertices(&mut self) -> Result<Vertices, Fault> {
        let count = self.read_count("vertices", SHORTEST_VERTEX)?;
        let mut list = Vertices::default();
        for _ in 0..count {
            self.numbers.record()?;
            list.places.push(self.numbers.place());
            list.numbers.push(self.numbers.natural("a vertex number, 1 or more")?);
            list.positions.push(self.numbers.position()?);
        }
        Ok(list)
    }

    /// Blocks of entities: version 4.
    fn read_vertex_blocks(&mut self) -> Result<Vertices, Fault> {
        let is_new = self.version == Some(Version::FourOne);
        let numbers = &mut self.numbers;
        let [blocks, count] = numbers.block_header("vertices", SHORTEST_VERTEX, is_new)?;
        let mut list = Vertices::default();
        for _ in 0..blocks {
            let block = numbers.entity(is_new)?;
            // So many parameters of the vertex on its curve or surface follow its coordinates.
            let is_parametric = block.third != 0;
            let parameters = if is_parametric { block.dimension as usize } else { 0 };
            let claimed = block.count;
            let size = numbers.check_count("vertices of a block", claimed, SHORTEST_VERTEX)?;
            if is_new {
                for _ in 0..size {
                    numbers.record()?;
                    list.numbers.push(numbers.size("a vertex number, 1 or more")?);
                }
            }
            for _ in 0..size {
                numbers.record()?;
                list.places.push(numbers.place());
                if !is_new {
                    list.numbers.push(numbers.natural("a vertex number, 1 or more")?);
                }
                list.positions.push(numbers.position()?);
                numbers.pass_over(8 * parameters)?;
            }
        }
        numbers.expect_count("vertices", count, list.positions.len())?;
        Ok(list)
    }

    /// `number type ... nodes`: versions 1 and 2 as text.
    fn read_elements(&mut self) -> Result<Elements, Fault> {
        let count = self.read_count("elements", SHORTEST_ELEMENT)?;
        let is_old = self.version == Some(Version::One);
        let numbers = &mut self.numbers;
        let mut list = Elements::default();
        for _ in 0..count {
            numbers.record()?;
            let place = numbers.place();
            let number = numbers.natural("an element number")?;
            let kind = numbers.natural("an element type")?;
            let group;
            if is_old {
                // Physical tag, elementary tag, number of nodes.
                group = numbers.natural("a physical tag, 0 or more")?;
                numbers.whole("an elementary tag")?;
                let nodes = numbers.natural("a number of vertices")?;
                if let Some(kind) = kind_of(kind).filter(|kind| kind.nodes as u64 != nodes) {
                    let what = format!("vertices of a {}", kind.shape.name());
                    let (claimed, found) = (nodes as usize, kind.nodes);
                    return Err(numbers.fault(ReadProblem::CountMismatch { what, claimed, found }));
                }
            } else {
                let tags = numbers.natural("a number of tags")?;
                group = numbers.first_tag(tags)?;
            }
            list.add(numbers, (place, number, kind, group), true)?;
        }
        Ok(list)
    }

    /// Blocks of one type: version 2, binary.
    fn read_binary_elements(&mut self) -> Result<Elements, Fault> {
        let count = self.read_count("elements", SHORTEST_ELEMENT)?;
        let numbers = &mut self.numbers;
        let mut list = Elements::default();
        let mut done = 0;
        while done < count {
            let kind = numbers.natural("an element type")?;
            let claimed = numbers.natural("a number of elements")?;
            let size = numbers.check_count("elements of a block", claimed, SHORTEST_ELEMENT)?;
            let tags = numbers.natural("a number of tags")?;
            if size == 0 {
                let problem = bad_word("a number of elements above 0", b"0");
                return Err(numbers.fault(problem));
            }
            for _ in 0..size {
                let place = numbers.place();
                let number = numbers.natural("an element number")?;
                let group = numbers.first_tag(tags)?;
                list.add(numbers, (place, number, kind, group), true)?;
            }
            done += size;
        }
        numbers.expect_count("elements", count, done)?;
        Ok(list)
    }

    /// Blocks of entities: version 4.
    fn read_element_blocks(&mut self) -> Result<Elements, Fault> {
        let is_new = self.version == Some(Version::FourOne);
        let numbers = &mut self.numbers;
        let [blocks, count] = numbers.block_header("elements", SHORTEST_ELEMENT, is_new)?;
        let mut list = Elements::default();
        let mut done = 0;
        for _ in 0..blocks {
            let block = numbers.entity(is_new)?;
            let claimed = block.count;
            let size = numbers.check_count("elements of a block", claimed, SHORTEST_ELEMENT)?;
            let group = self.groups.get(&(block.dimension, block.tag)).copied().unwrap_or(0);
            for _ in 0..size {
                numbers.record()?;
                let place = numbers.place();
                let expected = "an element number";
                let number =
                    if is_new { numbers.size(expected)? } else { numbers.natural(expected)? };
                list.add(numbers, (place, number, block.third, group), !is_new)?;
            }
            done += size;
        }
        numbers.expect_count("elements", count, done)?;
        Ok(list)
    }

    fn finish(self) -> Result<Content<'a>, Fault> {
        let missing = |what: &str| Fault::whole_file(ReadProblem::Missing { what: what.into() });
        let vertices =
            self.vertices.ok_or_else(|| missing("section of vertices ($Nodes or $NOD)"))?;
        let elements =
            self.elements.ok_or_else(|| missing("section of elements ($Elements or $ELM)"))?;
        let format = match (self.version, self.numbers.is_binary()) {
            (Some(Version::One) | None, _) => Format::Gmsh1,
            (Some(Version::Two), false) => Format::Gmsh2,
            (Some(Version::Two), true) => Format::Gmsh2Binary,
            (_, false) => Format::Gmsh4,
            (_, true) => Format::Gmsh4Binary,
        };
        let mut cells = elements.unknown;
        let mut nodes = Vec::new();
        // Vertices of groups of points, curves and surfaces.
        let mut patches: BTreeMap<(u64, u64), Vec<u32>> = BTreeMap::new();
        for (cell, &(shape, number)) in elements.cells.iter().enumerate() {
            nodes.clear();
            for &node in &elements.nodes[elements.first[cell]..elements.first[cell + 1]] {
                nodes.push(vertices.find(node).ok_or_else(|| {
                    let element = format!("{} {number}", shape.name());
                    vertices.unknown(element, node, elements.places.get(cell).copied())
                })?);
            }
            let group = elements.groups[cell];
            let dimension = match shape {
                Shape::Point => 0,
                Shape::Line => 1,
                Shape::Triangle | Shape::Quad => 2,
                _ => 3,
            };
            if dimension < 3 && group > 0 {
                patches.entry((dimension, group)).or_default().extend_from_slice(&nodes);
            }
            let region = u32::try_from(group).map_err(|_| Fault {
                place: elements.places.get(cell).copied(),
                problem: bad_word("a physical tag below 4294967296", group.to_string().as_bytes()),
            })?;
            cells.add(shape, &nodes, region, cell);
        }
        let names = self.names;
        let (patches, region_names) = named(&names, patches);
        let (of_vertices, of_cells) = (vertices.places, elements.places);
        let places = move |place| match place {
            MeshPlace::Whole => None,
            MeshPlace::Vertex(vertex) => of_vertices.get(vertex).copied(),
            MeshPlace::Tet(cell) => of_cells.get(cell).copied(),
        };
        let places = Box::new(places);
        Ok(Content { format, vertices: vertices.positions, cells, patches, region_names, places })
    }
}

/// Patches and regions with their names.
fn named(
    names: &BTreeMap<(u64, u64), String>,
    patches: BTreeMap<(u64, u64), Vec<u32>>,
) -> (Vec<Patch>, Vec<(u32, String)>) {
    let patches = patches.into_iter().map(|(key, mut vertices)| {
        vertices.sort_unstable();
        vertices.dedup();
        let kind = ["points", "curve", "surface"][key.0 as usize];
        let name = names.get(&key).cloned().unwrap_or_else(|| format!("{kind} {}", key.1));
        Patch { name, vertices }
    });
    let volumes = names.iter().filter(|((dimension, _), _)| *dimension == 3);
    let region_names =
        volumes.filter_map(|((_, tag), name)| Some((u32::try_from(*tag).ok()?, name.clone())));
    (patches.collect(), region_names.collect())
}
