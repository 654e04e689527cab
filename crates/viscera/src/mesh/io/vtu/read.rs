//! Reading unstructured grids and polygonal data, of any number of pieces. Regions come from a cell array of whole numbers
//! that is named as such, 0 without it; sets of points from arrays of whole numbers at points.

use std::borrow::Cow;

use roxmltree::{Document, Node};

use super::arrays::{DataArray, is_whole};
use super::codec::{Appended, Codec};
use super::places::{LineIndex, fault_at};
use crate::mesh::MeshPlace;
use crate::mesh::io::cells::Cells;
use crate::mesh::io::content::Content;
use crate::mesh::io::error::{Fault, Place, ReadProblem};
use crate::mesh::io::lines::bad_word;
use crate::mesh::io::parsed::{Format, Patch};
use crate::mesh::io::text::{name_of, shorten};
use crate::mesh::io::vtk_cells::{
    A_REGION, CellFault, MOST_UNUSED, REGION_NAMES, REGION_NUMBERS, VtkCells, is_worth_a_word,
    named_regions, patches_of, rank_of_regions, regions_of,
};
use crate::scalar::{Vec3, vec3};

const GRID_ADVICE: &str = "save the volume as one unstructured grid (.vtu), for example with \
    ParaView's filter \"Append Datasets\"";

/// Where things stand in a file whose numbers are text.
#[derive(Default)]
struct LinesOf {
    vertices: Vec<usize>,
    cells: Vec<usize>,
}

/// What has been read of all pieces.
#[derive(Default)]
struct Pieces {
    vertices: Vec<Vec3<f64>>,
    cells: Cells,
    cell_count: usize,
    patches: Vec<Patch>,
    lines: LinesOf,
}

pub(in crate::mesh::io) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let Halves { text, appended } = split(bytes)?;
    let document = parse(&text)?;
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    let format = match kind {
        "UnstructuredGrid" => Format::Vtu,
        "PolyData" => Format::Vtp,
        _ => {
            let found = format!("a VTK file of type `{}`", shorten(kind.as_bytes()));
            let problem = ReadProblem::Unsupported { found, advice: GRID_ADVICE };
            return Err(fault_at(root, problem));
        }
    };
    if !root.has_tag_name("VTKFile") {
        let expected = "the element <VTKFile>";
        return Err(fault_at(root, bad_word(expected, root.tag_name().name().as_bytes())));
    }
    let appended = appended.map(|halves| Appended::new(halves, &document));
    let lines = LineIndex::new(&text);
    let codec = Codec::of(root, appended.as_ref(), &lines)?;
    let grid = child(root, kind)?;
    let mut all = Pieces::default();
    for piece in grid.children().filter(|node| node.has_tag_name("Piece")) {
        all.read(piece, codec, format)?;
    }
    if all.vertices.is_empty() && child(grid, "Piece")?.attribute("NumberOfPoints") != Some("0") {
        return Err(missing(grid, "points".into()));
    }
    let region_names = read_region_names(grid, codec)?;
    let Pieces { vertices, cells, patches, lines, .. } = all;
    let places = Box::new(move |place| match place {
        MeshPlace::Whole => None,
        MeshPlace::Vertex(vertex) => lines.vertices.get(vertex).copied().map(Place::Line),
        MeshPlace::Tet(cell) => lines.cells.get(cell).copied().map(Place::Line),
    });
    Ok(Content { format, vertices, cells, patches, region_names, places })
}

impl Pieces {
    fn read(&mut self, piece: Node, codec: Codec, format: Format) -> Result<(), Fault> {
        let point_count = announced_count(piece, "NumberOfPoints")?;
        if point_count == 0 {
            return Ok(());
        }
        let points = DataArray::new(find_points(piece)?, codec)?;
        let coordinates: Vec<f64> = points.numbers("a coordinate")?;
        let wanted = point_count.saturating_mul(3);
        check_count(piece, "coordinates of points", wanted, coordinates.len())?;
        let first = (self.vertices.len() as u32, self.cell_count);
        self.vertices.extend(coordinates.chunks_exact(3).map(|x| vec3(x[0], x[1], x[2])));
        let lines = points.lines_of((0..point_count).map(|vertex| 3 * vertex));
        self.lines.vertices.extend(lines);

        let (regions, unused) = read_regions(piece, codec)?;
        for name in unused {
            if self.cells.unused.len() < MOST_UNUSED && !self.cells.unused.contains(&name) {
                self.cells.unused.push(name);
            }
        }
        // Data of polygons come after those of points and lines.
        let mut before = 0;
        let lists: &[(&str, &str, u64)] = match format {
            Format::Vtp => &[
                ("Verts", "NumberOfVerts", 2),
                ("Lines", "NumberOfLines", 4),
                ("Strips", "NumberOfStrips", 6),
                ("Polys", "NumberOfPolys", 7),
            ],
            _ => &[("Cells", "NumberOfCells", 0)],
        };
        for &(name, count, kind) in lists {
            let is_absent = kind != 0 && piece.attribute(count).is_none();
            let announced = if is_absent { 0 } else { announced_count(piece, count)? };
            if announced == 0 && kind != 0 {
                continue;
            }
            let of_list = regions.as_ref().and_then(|all| all.get(before..));
            let of_list = of_list.unwrap_or_default();
            self.read_cells(child(piece, name)?, codec, (announced, kind), (first, of_list))?;
            before += announced;
        }
        if let Some(regions) = regions {
            check_count(piece, "regions of cells", before, regions.len())?;
        }
        self.read_patches(piece, codec, first.0, point_count)
    }

    /// A list of cells, all of one type unless there is an array of types.
    fn read_cells(
        &mut self,
        node: Node,
        codec: Codec,
        (count, kind): (usize, u64),
        (first, regions): ((u32, usize), &[u32]),
    ) -> Result<(), Fault> {
        let array = |name| DataArray::new(find_array(node, name)?, codec);
        let (connectivity, offsets) = (array("connectivity")?, array("offsets")?);
        let corners: Vec<u32> = connectivity.numbers("a point index, 0 or more")?;
        let ends: Vec<usize> = offsets.numbers("an offset, 0 or more")?;
        check_count(offsets.node, "offsets of cells", count, ends.len())?;
        let kinds = if kind == 0 {
            let types = array("types")?;
            let kinds: Vec<u8> = types.numbers("a cell type, 0 to 255")?;
            check_count(types.node, "types of cells", count, kinds.len())?;
            kinds.into_iter().map(u64::from).collect()
        } else {
            vec![kind; count]
        };
        let list = VtkCells { kinds: &kinds, ends: &ends, corners: &corners };
        list.add_to(&mut self.cells, regions, first).map_err(|fault| match fault {
            CellFault::Offset(cell) => {
                let expected = "offsets that ascend and stay within the connectivity";
                let found = ends[cell].to_string();
                let problem = ReadProblem::BadWord { expected, found };
                Fault { place: offsets.line_of(cell), problem }
            }
            CellFault::Corners { cell, shape, wanted, found } => {
                let what = format!("points of cell {cell}, a {}", shape.name());
                let problem = ReadProblem::CountMismatch { what, claimed: wanted, found };
                Fault { place: offsets.line_of(cell), problem }
            }
        })?;
        let starts = std::iter::once(0).chain(ends.iter().copied()).take(count);
        self.lines.cells.extend(connectivity.lines_of(starts));
        self.cell_count += count;
        Ok(())
    }

    fn read_patches(
        &mut self,
        piece: Node,
        codec: Codec,
        first: u32,
        count: usize,
    ) -> Result<(), Fault> {
        let data = piece.children().find(|child| child.has_tag_name("PointData"));
        let arrays = data.into_iter().flat_map(|data| data.children());
        for node in arrays.filter(|node| node.has_tag_name("DataArray")) {
            let is_set = is_scalar(node) && is_whole(node);
            let Some(name) = node.attribute("Name").filter(|_| is_set) else { continue };
            let values: Vec<i64> = DataArray::new(node, codec)?.numbers("a whole number")?;
            check_count(node, "values at points", count, values.len())?;
            for mut patch in patches_of(name, &values) {
                patch.vertices.iter_mut().for_each(|vertex| *vertex += first);
                self.patches.push(patch);
            }
        }
        Ok(())
    }
}

/// The XML, and the bytes behind it where a file has any.
struct Halves<'a> {
    text: Cow<'a, [u8]>,
    /// And whether they are Base64.
    appended: Option<(&'a [u8], bool)>,
}

/// Appended bytes are no text, and would break the XML around them.
fn split(bytes: &[u8]) -> Result<Halves<'_>, Fault> {
    const ELEMENT: &[u8] = b"<AppendedData";
    const END: &[u8] = b"</VTKFile>";
    let Some(begin) = bytes.windows(ELEMENT.len()).position(|window| window == ELEMENT) else {
        return Ok(Halves { text: Cow::Borrowed(bytes), appended: None });
    };
    let cut = || {
        let reading = "the appended data".to_owned();
        Fault::whole_file(ReadProblem::UnexpectedEnd { reading })
    };
    let rest = bytes[begin..].trim_ascii_end().strip_suffix(END).ok_or_else(cut)?;
    let tag = rest.iter().position(|&byte| byte == b'>').ok_or_else(cut)?;
    let encoding = |names: [&[u8]; 2]| {
        rest[..tag].windows(names[0].len()).any(|window| names.contains(&window))
    };
    let is_base64 = encoding([b"\"base64\"", b"'base64'"]);
    if !is_base64 && !encoding([b"\"raw\"", b"'raw'"]) {
        let found = "appended data that are neither raw nor Base64".to_owned();
        let advice = "export the file again";
        return Err(Fault::whole_file(ReadProblem::Unsupported { found, advice }));
    }
    let data = rest[tag + 1..].trim_ascii_start().strip_prefix(b"_").ok_or_else(cut)?;
    let data = if is_base64 {
        let end = data.iter().position(|&byte| byte == b'<').ok_or_else(cut)?;
        &data[..end]
    } else {
        data
    };
    let text = Cow::Owned([&bytes[..begin], END].concat());
    Ok(Halves { text, appended: Some((data, is_base64)) })
}

fn parse(bytes: &[u8]) -> Result<Document<'_>, Fault> {
    let broken = |reason: String, line: usize| Fault::at(line, ReadProblem::Xml { reason });
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
        broken("text that is not UTF-8".into(), line)
    })?;
    check_tags(bytes)?;
    Document::parse(text)
        .map_err(|error| broken(name_of(&error.to_string()), error.pos().row as usize))
}

/// The parser compares each attribute of an element with all others, and hands namespaces on to all elements inside: a file of
/// a megabyte could keep it busy for minutes. VTK has a dozen attributes and no namespaces.
fn check_tags(text: &[u8]) -> Result<(), Fault> {
    const MOST_ATTRIBUTES: usize = 256;
    let mut line = 1;
    for tag in text.split(|&byte| byte == b'<') {
        let attributes = tag.iter().filter(|&&byte| byte == b'=').count();
        let has_namespaces = || tag.windows(6).any(|window| window == b"xmlns:");
        if attributes > MOST_ATTRIBUTES || (tag.contains(&b':') && has_namespaces()) {
            let reason = "an element with other attributes than VTK has".to_owned();
            return Err(Fault::at(line, ReadProblem::Xml { reason }));
        }
        line += tag.iter().filter(|&&byte| byte == b'\n').count();
    }
    Ok(())
}

fn missing(node: Node, what: String) -> Fault {
    fault_at(node, ReadProblem::Missing { what })
}

fn child<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Result<Node<'a, 'input>, Fault> {
    node.children()
        .find(|child| child.has_tag_name(name))
        .ok_or_else(|| missing(node, format!("element <{name}>")))
}

fn find_points<'a, 'input>(piece: Node<'a, 'input>) -> Result<Node<'a, 'input>, Fault> {
    let array = child(child(piece, "Points")?, "DataArray")?;
    match array.attribute("NumberOfComponents") {
        Some("3") | None => Ok(array),
        Some(other) => {
            let problem = bad_word("three components for each point", other.as_bytes());
            Err(fault_at(array, problem))
        }
    }
}

fn find_array<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Result<Node<'a, 'input>, Fault> {
    node.children()
        .find(|child| child.has_tag_name("DataArray") && child.attribute("Name") == Some(name))
        .ok_or_else(|| missing(node, format!("array named `{name}`")))
}

fn announced_count(piece: Node, attribute: &str) -> Result<usize, Fault> {
    let text =
        piece.attribute(attribute).ok_or_else(|| missing(piece, format!("count {attribute}")))?;
    // Numbers of vertices have 32 bits.
    match text.trim().parse() {
        Ok(count) if count <= u32::MAX as usize => Ok(count),
        _ => Err(fault_at(piece, bad_word("a count", text.as_bytes()))),
    }
}

fn check_count(node: Node, what: &str, claimed: usize, found: usize) -> Result<(), Fault> {
    if claimed == found {
        return Ok(());
    }
    Err(fault_at(node, ReadProblem::CountMismatch { what: what.into(), claimed, found }))
}

/// Regions of cells, where an array is named as such, and other arrays of whole numbers.
fn read_regions(piece: Node, codec: Codec) -> Result<(Option<Vec<u32>>, Vec<String>), Fault> {
    let data = piece.children().find(|child| child.has_tag_name("CellData"));
    let arrays = data.into_iter().flat_map(|data| data.children());
    let arrays = arrays.filter(|node| node.has_tag_name("DataArray"));
    let named = arrays.filter_map(|node| Some((node.attribute("Name")?, node)));
    let ranked = named.clone().filter_map(|(name, node)| Some((rank_of_regions(name)?, node)));
    let best = ranked.min_by_key(|(rank, _)| *rank).map(|(_, node)| node);
    let others = named.filter(|(name, node)| {
        Some(*node) != best && is_scalar(*node) && is_whole(*node) && is_worth_a_word(name)
    });
    let others = others.take(MOST_UNUSED).map(|(name, _)| name.to_owned()).collect();
    let Some(node) = best else { return Ok((None, others)) };
    let values: Vec<f64> = DataArray::new(node, codec)?.numbers(A_REGION)?;
    let regions = regions_of(&values)
        .map_err(|value| fault_at(node, bad_word(A_REGION, value.to_string().as_bytes())))?;
    Ok((Some(regions), others))
}

fn is_scalar(node: Node) -> bool {
    matches!(node.attribute("NumberOfComponents"), None | Some("1" | "0"))
}

/// Names of regions, where the field data have them as [`super::write_mesh`] writes them.
fn read_region_names(grid: Node, codec: Codec) -> Result<Vec<(u32, String)>, Fault> {
    let data = grid.children().find(|child| child.has_tag_name("FieldData"));
    let Some(data) = data else { return Ok(Vec::new()) };
    // Arrays of text have an element of their own.
    let named = |name| data.children().find(|child| child.attribute("Name") == Some(name));
    let (Some(numbers), Some(names)) = (named(REGION_NUMBERS), named(REGION_NAMES)) else {
        return Ok(Vec::new());
    };
    if !is_whole(numbers) || names.attribute("type") != Some("String") {
        return Ok(Vec::new());
    }
    let numbers: Vec<u32> = DataArray::new(numbers, codec)?.numbers(A_REGION)?;
    let letters: Vec<u8> = DataArray::new(names, codec)?.numbers("a letter's number, 0 to 255")?;
    let texts = letters.strip_suffix(&[0]).unwrap_or(&letters).split(|&letter| letter == 0);
    let texts: Vec<String> = texts.map(|text| String::from_utf8_lossy(text).into_owned()).collect();
    check_count(names, "names of regions", numbers.len(), texts.len())?;
    Ok(named_regions(numbers, texts))
}
