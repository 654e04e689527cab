//! Reading. Regions and sets of points are found as in [`super::super::vtu`].

use super::numbers::{Kind, Numbers};
use crate::mesh::MeshPlace;
use crate::mesh::io::cells::Cells;
use crate::mesh::io::content::Content;
use crate::mesh::io::error::{Fault, Place, ReadProblem};
use crate::mesh::io::lines::{Line, Words, bad_word, parse_word};
use crate::mesh::io::parsed::{Format, Patch};
use crate::mesh::io::text::shorten;
use crate::mesh::io::vtk_cells::{
    A_REGION, CellFault, MOST_UNUSED, REGION_NAMES, REGION_NUMBERS, VtkCells, is_worth_a_word,
    named_regions, patches_of, rank_of_regions, regions_of,
};
use crate::scalar::{Vec3, vec3};

/// Lists of cells of a file.
#[derive(Default)]
struct List {
    /// The type of all of them; zero where types follow.
    kind: u64,
    ends: Vec<usize>,
    corners: Vec<u32>,
    places: Vec<Place>,
}

/// What values belong to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Owner {
    Points,
    Cells,
    Nothing,
}

/// A file as far as it has been read.
struct File<'a> {
    numbers: Numbers<'a>,
    vertices: Vec<Vec3<f64>>,
    places: Vec<Place>,
    lists: Vec<List>,
    types: Vec<u64>,
    owner: Owner,
    /// Entries of an array of values.
    entries: usize,
    /// The best array of regions so far, and its rank.
    regions: Option<(usize, Vec<u32>)>,
    patches: Vec<Patch>,
    /// Names of arrays of whole numbers at cells.
    at_cells: Vec<String>,
    region_numbers: Vec<u32>,
    region_names: Vec<String>,
}

pub(in crate::mesh::io) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let mut file = File {
        numbers: Numbers::new(bytes),
        vertices: Vec::new(),
        places: Vec::new(),
        lists: Vec::new(),
        types: Vec::new(),
        owner: Owner::Nothing,
        entries: 0,
        regions: None,
        patches: Vec::new(),
        at_cells: Vec::new(),
        region_numbers: Vec::new(),
        region_names: Vec::new(),
    };
    file.read_header()?;
    while let Some(line) = file.numbers.line() {
        file.read_part(line)?;
    }
    file.finish()
}

impl<'a> File<'a> {
    /// Two lines of text, how numbers stand, and what the file is.
    fn read_header(&mut self) -> Result<(), Fault> {
        self.numbers.line();
        let mut line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
        // The title may be blank.
        let coding = |line: Line| match line.text.to_ascii_uppercase().as_slice() {
            b"ASCII" => Some(false),
            b"BINARY" => Some(true),
            _ => None,
        };
        if coding(line).is_none() {
            line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
        }
        let Some(is_binary) = coding(line) else {
            return Err(line.fault(bad_word("ASCII or BINARY", line.text)));
        };
        let line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
        let mut words = line.words();
        let (first, kind) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        if !first.eq_ignore_ascii_case(b"DATASET") {
            return Err(line.fault(bad_word("a line that begins with DATASET", line.text)));
        }
        if !matches!(kind.to_ascii_uppercase().as_slice(), b"UNSTRUCTURED_GRID" | b"POLYDATA") {
            let found = format!("a VTK file with the data set {}", shorten(kind));
            let advice = "save it as an unstructured grid or as polygonal data";
            return Err(line.fault(ReadProblem::Unsupported { found, advice }));
        }
        self.numbers.is_binary = is_binary;
        Ok(())
    }

    /// What a keyword opens. Lines of metadata are passed over.
    fn read_part(&mut self, line: Line<'a>) -> Result<(), Fault> {
        let mut words = line.words();
        let keyword = words.next().unwrap_or_default().to_ascii_uppercase();
        match keyword.as_slice() {
            b"POINTS" => self.read_points(line, words),
            b"CELLS" => self.read_list(words, 0),
            b"VERTICES" => self.read_list(words, 2),
            b"LINES" => self.read_list(words, 4),
            b"TRIANGLE_STRIPS" => self.read_list(words, 6),
            b"POLYGONS" => self.read_list(words, 7),
            b"CELL_TYPES" => {
                let count = self.count(&mut words, "cells", Kind::INT)?;
                self.numbers.reading = "the types of cells";
                let types = &mut self.types;
                let expected = "a cell type, 0 or more";
                self.numbers.wholes((count, Kind::INT), expected, |kind, _| {
                    types.push(u64::try_from(kind).unwrap_or(u64::MAX));
                })
            }
            b"POINT_DATA" => self.own(line, words, Owner::Points),
            b"CELL_DATA" => self.own(line, words, Owner::Cells),
            b"SCALARS" => self.read_scalars(line, words),
            b"VECTORS" | b"NORMALS" => self.skip_values(line, words, 3),
            b"TENSORS" => self.skip_values(line, words, 9),
            b"TENSORS6" => self.skip_values(line, words, 6),
            b"TEXTURE_COORDINATES" => {
                words.next();
                let components: u64 = words.parse("a number of coordinates")?;
                let kind = kind_of(line, &mut words)?;
                self.skip(components, self.entries as u64, kind)
            }
            b"COLOR_SCALARS" => {
                words.next();
                let components: u64 = words.parse("a number of components")?;
                // Numbers between 0 and 1 in text, bytes in binary files.
                self.skip(components, self.entries as u64, Kind::BYTE)
            }
            b"LOOKUP_TABLE" => {
                words.next();
                let size: u64 = words.parse("the size of a table")?;
                self.skip(4, size, Kind::BYTE)
            }
            b"FIELD" => self.read_field(words),
            b"METADATA" | b"INFORMATION" | b"NAME" | b"DATA" | b"COMPONENT_NAMES" => Ok(()),
            // Names of components, one on each line.
            _ if self.owner != Owner::Nothing => Ok(()),
            _ => Err(line.fault(bad_word("a part such as POINTS or CELLS", line.text))),
        }
    }

    fn count(&self, words: &mut Words, what: &'static str, kind: Kind) -> Result<usize, Fault> {
        let claimed = words.parse("a count")?;
        self.numbers.check_count(what, claimed, kind)
    }

    fn read_points(&mut self, line: Line<'a>, mut words: Words) -> Result<(), Fault> {
        if !self.vertices.is_empty() {
            return Err(line.fault(ReadProblem::SecondPart { what: "POINTS".into() }));
        }
        let claimed: u64 = words.parse("a count")?;
        let kind = kind_of(line, &mut words)?;
        let count = self.numbers.check_count("coordinates", claimed.saturating_mul(3), kind)?;
        self.numbers.reading = "the points";
        let (mut at, vertices, places) = ([0.0; 3], &mut self.vertices, &mut self.places);
        let mut next = 0;
        self.numbers.floats((count, kind), "a coordinate", |value, place| {
            if next == 0 {
                places.push(place);
            }
            at[next] = value;
            next = (next + 1) % 3;
            if next == 0 {
                vertices.push(vec3(at[0], at[1], at[2]));
            }
        })
    }

    /// `CELLS cells numbers`, then for each cell how many corners it has and which; since version 5 `CELLS offsets corners`,
    /// then both as arrays of their own, the first of which begins with 0.
    fn read_list(&mut self, mut words: Words, kind: u64) -> Result<(), Fault> {
        self.numbers.reading = "the cells";
        let first: u64 = words.parse("a count")?;
        let second: u64 = words.parse("a count")?;
        let mut list = List { kind, ..List::default() };
        let (corner, size) = ("a point index, 0 or more", "a number of corners, 0 or more");
        // The first number that is none: where, what it should be, and what it is.
        let mut wrong: Option<(Place, &'static str, i64)> = None;
        let is_new = self.numbers.starts_with(b"OFFSETS");
        if !is_new {
            let count = self.numbers.check_count("corners of cells", second, Kind::INT)?;
            let mut left = 0;
            let (corners, ends, places) = (&mut list.corners, &mut list.ends, &mut list.places);
            self.numbers.wholes((count, Kind::INT), corner, |value, place| {
                let natural = u32::try_from(value);
                if left == 0 {
                    left = natural.unwrap_or(0);
                    places.push(place);
                    ends.push(corners.len().saturating_add(left as usize));
                    if natural.is_err() {
                        wrong = wrong.or(Some((place, size, value)));
                    }
                } else {
                    left -= 1;
                    if natural.is_err() {
                        wrong = wrong.or(Some((place, corner, value)));
                    }
                    corners.push(natural.unwrap_or(u32::MAX));
                }
            })?;
            if left > 0 || list.ends.len() as u64 != first {
                let what = "cells".to_owned();
                let (claimed, found) = (first as usize, list.ends.len());
                let problem = ReadProblem::CountMismatch { what, claimed, found };
                return Err(self.numbers.fault(problem));
            }
        } else {
            let kind = self.numbers.array_kind(b"OFFSETS")?;
            let count = self.numbers.check_count("offsets of cells", first, kind)?;
            let ends = &mut list.ends;
            self.numbers.wholes((count, kind), "an offset, 0 or more", |value, _| {
                ends.push(usize::try_from(value).unwrap_or(usize::MAX));
            })?;
            if !list.ends.is_empty() {
                list.ends.remove(0);
            }
            let kind = self.numbers.array_kind(b"CONNECTIVITY")?;
            let count = self.numbers.check_count("corners of cells", second, kind)?;
            let (corners, mut places) = (&mut list.corners, Vec::new());
            self.numbers.wholes((count, kind), corner, |value, place| {
                let natural = u32::try_from(value);
                if natural.is_err() {
                    wrong = wrong.or(Some((place, corner, value)));
                }
                corners.push(natural.unwrap_or(u32::MAX));
                places.push(place);
            })?;
            let starts = std::iter::once(0).chain(list.ends.iter().copied());
            let starts = starts.take(list.ends.len());
            let places = starts.map(|start| places.get(start).copied());
            list.places = places.map(|place| place.unwrap_or(Place::Line(1))).collect();
        }
        match wrong {
            Some((place, expected, value)) => {
                let problem = bad_word(expected, value.to_string().as_bytes());
                Err(Fault { place: Some(place), problem })
            }
            None => {
                self.lists.push(list);
                Ok(())
            }
        }
    }

    fn own(&mut self, line: Line, mut words: Words, owner: Owner) -> Result<(), Fault> {
        let claimed: usize = words.parse("a count")?;
        let (what, found) = match owner {
            Owner::Points => ("values at points", self.vertices.len()),
            _ => ("values of cells", self.lists.iter().map(|list| list.ends.len()).sum()),
        };
        if claimed != found {
            let what = what.to_owned();
            return Err(line.fault(ReadProblem::CountMismatch { what, claimed, found }));
        }
        self.entries = claimed;
        self.owner = owner;
        self.numbers.reading = "values at points or cells";
        Ok(())
    }

    /// `SCALARS name type components`, a line with the name of a table of colours, values.
    fn read_scalars(&mut self, line: Line<'a>, mut words: Words) -> Result<(), Fault> {
        let name = unescape(words.next().unwrap_or_default());
        let kind = kind_of(line, &mut words)?;
        let components: u64 = match words.next() {
            Some(word) => parse_word(word)
                .ok_or_else(|| line.fault(bad_word("a number of components", word)))?,
            None => 1,
        };
        if self.numbers.starts_with(b"LOOKUP_TABLE") {
            self.numbers.line();
        }
        self.read_values(&name, (components, self.entries as u64), kind)
    }

    /// `FIELD name arrays`, then `name components entries type` and values of each.
    fn read_field(&mut self, mut words: Words) -> Result<(), Fault> {
        words.next();
        let arrays: u64 = words.parse("a number of arrays")?;
        for _ in 0..arrays {
            let mut line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
            // What is known of the array before.
            while is_metadata(line) {
                line = self.numbers.line().ok_or_else(|| self.numbers.cut_short())?;
            }
            let mut words = line.words();
            let name = unescape(words.next().unwrap_or_default());
            let components: u64 = words.parse("a number of components")?;
            let entries: u64 = words.parse("a number of entries")?;
            if words.clone().next().is_some_and(|word| word.eq_ignore_ascii_case(b"string")) {
                let texts = self.numbers.texts(components.saturating_mul(entries))?;
                if name == REGION_NAMES {
                    // Only in lines a blank has to be written otherwise.
                    let plain = |text: &Vec<u8>| match self.numbers.is_binary {
                        true => String::from_utf8_lossy(text).into_owned(),
                        false => unescape(text),
                    };
                    self.region_names = texts.iter().map(plain).collect();
                }
                continue;
            }
            let kind = kind_of(line, &mut words)?;
            if name == REGION_NUMBERS && self.owner == Owner::Nothing && kind.is_whole() {
                let claimed = components.saturating_mul(entries);
                let count = self.numbers.check_count("values", claimed, kind)?;
                let numbers = &mut self.region_numbers;
                self.numbers.wholes((count, kind), A_REGION, |value, _| {
                    // What is no label is that of no tetrahedron.
                    numbers.extend(u32::try_from(value).ok());
                })?;
                continue;
            }
            self.read_values(&name, (components, entries), kind)?;
        }
        Ok(())
    }

    fn read_values(
        &mut self,
        name: &str,
        (components, entries): (u64, u64),
        kind: Kind,
    ) -> Result<(), Fault> {
        let rank = rank_of_regions(name).filter(|_| self.owner == Owner::Cells);
        let is_set = self.owner == Owner::Points;
        let is_scalar = components == 1 && entries as usize == self.entries;
        if self.owner == Owner::Cells && is_scalar && kind.is_whole() && is_worth_a_word(name) {
            self.at_cells.push(name.to_owned());
        }
        let is_wanted = is_scalar && (rank.is_some() || (is_set && kind.is_whole()));
        if !is_wanted {
            return self.skip(components, entries, kind);
        }
        let count = self.numbers.check_count("values", entries, kind)?;
        let Some(rank) = rank else {
            let mut values = Vec::new();
            self.numbers.wholes((count, kind), "a whole number", |value, _| values.push(value))?;
            self.patches.extend(patches_of(name, &values));
            return Ok(());
        };
        let mut values = Vec::new();
        self.numbers.floats((count, kind), A_REGION, |value, _| values.push(value))?;
        let regions = regions_of(&values).map_err(|value| {
            self.numbers.fault(bad_word(A_REGION, value.to_string().as_bytes()))
        })?;
        if self.regions.as_ref().is_none_or(|(known, _)| rank < *known) {
            self.regions = Some((rank, regions));
        }
        Ok(())
    }

    fn skip_values(&mut self, line: Line, mut words: Words, components: u64) -> Result<(), Fault> {
        words.next();
        let kind = kind_of(line, &mut words)?;
        self.skip(components, self.entries as u64, kind)
    }

    fn skip(&mut self, components: u64, entries: u64, kind: Kind) -> Result<(), Fault> {
        let claimed = components.saturating_mul(entries);
        let count = self.numbers.check_count("values", claimed, kind)?;
        self.numbers.skip(count, kind)
    }

    fn finish(self) -> Result<Content<'a>, Fault> {
        let is_binary = self.numbers.is_binary;
        let format = if is_binary { Format::VtkBinary } else { Format::Vtk };
        if self.vertices.is_empty() {
            return Err(Fault::whole_file(ReadProblem::Missing { what: "POINTS".into() }));
        }
        let mut cells = Cells::default();
        let mut of_cells: Vec<Place> = Vec::new();
        let (rank, regions) = self.regions.unzip();
        let regions = regions.unwrap_or_default();
        let others = self
            .at_cells
            .into_iter()
            .filter(|name| rank.is_none() || rank_of_regions(name) != rank);
        cells.unused = others.take(MOST_UNUSED).collect();
        for List { kind, ends, corners, places } in self.lists {
            let kinds = if kind == 0 { self.types.clone() } else { vec![kind; ends.len()] };
            if kinds.len() != ends.len() {
                let (what, claimed) = ("types of cells".to_owned(), ends.len());
                let problem = ReadProblem::CountMismatch { what, claimed, found: kinds.len() };
                return Err(Fault::whole_file(problem));
            }
            let list = VtkCells { kinds: &kinds, ends: &ends, corners: &corners };
            let before = of_cells.len();
            let of_list = regions.get(before..).unwrap_or_default();
            list.add_to(&mut cells, of_list, (0, before)).map_err(|fault| match fault {
                CellFault::Offset(cell) => {
                    let expected = "offsets that ascend and stay within the corners";
                    let found = ends[cell].to_string();
                    let place = places.get(cell).copied();
                    Fault { place, problem: ReadProblem::BadWord { expected, found } }
                }
                CellFault::Corners { cell, shape, wanted, found } => {
                    let what = format!("points of cell {cell}, a {}", shape.name());
                    let problem = ReadProblem::CountMismatch { what, claimed: wanted, found };
                    Fault { place: places.get(cell).copied(), problem }
                }
            })?;
            of_cells.extend(places);
        }
        let of_vertices = self.places;
        let places = Box::new(move |place| match place {
            MeshPlace::Whole => None,
            MeshPlace::Vertex(vertex) => of_vertices.get(vertex).copied(),
            MeshPlace::Tet(cell) => of_cells.get(cell).copied(),
        });
        let (vertices, patches) = (self.vertices, self.patches);
        let region_names = named_regions(self.region_numbers, self.region_names);
        Ok(Content { format, vertices, cells, patches, region_names, places })
    }
}

fn is_metadata(line: Line) -> bool {
    let first = line.words().next().unwrap_or_default();
    matches!(first, b"METADATA" | b"INFORMATION" | b"NAME" | b"DATA" | b"COMPONENT_NAMES")
}

fn kind_of(line: Line, words: &mut Words) -> Result<Kind, Fault> {
    let word = words.next().unwrap_or_default();
    let expected = "a type of numbers such as float or int";
    Kind::named(word).ok_or_else(|| line.fault(bad_word(expected, word)))
}

/// A name in which blanks and other characters stand as `%20`.
fn unescape(word: &[u8]) -> String {
    let (mut bytes, mut rest) = (Vec::new(), word);
    while let [first, after @ ..] = rest {
        let code = after.get(..2).and_then(|code| std::str::from_utf8(code).ok());
        let code = code.and_then(|code| u8::from_str_radix(code, 16).ok());
        match (first, code) {
            (b'%', Some(code)) => {
                bytes.push(code);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
