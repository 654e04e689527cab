//! Reading tetrahedra. Other cells are skipped and counted; regions come from an integer cell
//! array named `region`, 0 without it.

use std::borrow::Cow;

use roxmltree::{Document, Node};

use super::VTK_TETRA;
use super::arrays::{ASCII_ADVICE, Appended, DataArray, fault_at};
use crate::mesh::io::error::{Fault, ReadProblem};
use crate::mesh::io::lines::bad_word;
use crate::mesh::io::parsed::{Format, Parsed, SkippedElements};
use crate::mesh::{MeshPlace, TetMesh};
use crate::scalar::vec3;

const GRID_ADVICE: &str = "save the volume as one unstructured grid (.vtu), for example with \
    ParaView's filter \"Append Datasets\"";

/// Reads the tetrahedra of a grid; positions are multiplied by the unit.
pub(in crate::mesh::io) fn read(
    bytes: &[u8],
    unit_in_meters: f64,
) -> Result<Parsed<TetMesh>, Fault> {
    let Halves { text, appended } = split(bytes)?;
    let document = parse(&text)?;
    let piece = find_piece(&document)?;
    let appended =
        appended.map(|bytes| Appended::of(document.root_element(), bytes)).transpose()?;
    let array = |node| DataArray::new(node, appended);

    let points = array(find_points(piece)?)?;
    let coordinates: Vec<f64> = points.numbers("a coordinate")?;
    let announced = announced_count(piece, "NumberOfPoints")?;
    check_count(piece, "coordinates of points", 3 * announced, coordinates.len())?;

    let cells = child(piece, "Cells")?;
    let connectivity = array(find_array(cells, "connectivity")?)?;
    let offsets = array(find_array(cells, "offsets")?)?;
    let types = array(find_array(cells, "types")?)?;
    let corners: Vec<u32> = connectivity.numbers("a point index, 0 or more")?;
    let ends: Vec<usize> = offsets.numbers("an offset, 0 or more")?;
    let kinds: Vec<u8> = types.numbers("a cell type, 0 to 255")?;
    let cell_count = announced_count(piece, "NumberOfCells")?;
    check_count(offsets.node, "offsets of cells", cell_count, ends.len())?;
    check_count(types.node, "types of cells", cell_count, kinds.len())?;
    let labels = read_regions(piece, cell_count, array)?;

    let mut tets = Vec::new();
    let mut regions = Vec::new();
    let mut first_corner = Vec::new();
    let mut skipped = Vec::new();
    let mut start = 0;
    for (cell, (&end, &kind)) in ends.iter().zip(&kinds).enumerate() {
        let Some(cell_corners) = corners.get(start..end) else {
            let problem = ReadProblem::BadWord {
                expected: "offsets that ascend and stay within the connectivity",
                found: end.to_string(),
            };
            return Err(Fault { line: offsets.line_of(cell), problem });
        };
        if kind == VTK_TETRA {
            let tet = <[u32; 4]>::try_from(cell_corners).map_err(|_| {
                let what = format!("points of cell {cell}, a tetrahedron");
                let found = cell_corners.len();
                let problem = ReadProblem::CountMismatch { what, claimed: 4, found };
                Fault { line: offsets.line_of(cell), problem }
            })?;
            tets.push(tet);
            regions.push(labels.as_ref().map_or(0, |labels| labels[cell]));
            first_corner.push(start);
        } else {
            SkippedElements::count(&mut skipped, kind_name(kind));
        }
        start = end;
    }
    if tets.is_empty() {
        let others = SkippedElements::list(&skipped);
        return Err(fault_at(piece, ReadProblem::NoTets { others }));
    }

    let vertices =
        coordinates.chunks_exact(3).map(|x| vec3(x[0], x[1], x[2]) * unit_in_meters).collect();
    let (mesh, repairs) = TetMesh::new(vertices, tets, regions).map_err(|error| {
        let line = match error.place() {
            MeshPlace::Whole => None,
            MeshPlace::Vertex(vertex) => points.line_of(3 * vertex),
            MeshPlace::Tet(tet) => first_corner.get(tet).and_then(|&at| connectivity.line_of(at)),
        };
        Fault { line, problem: ReadProblem::Mesh(error) }
    })?;
    Ok(Parsed { mesh, repairs, format: Format::Vtu, skipped })
}

/// The XML, and the bytes behind it where a file has any.
struct Halves<'a> {
    text: Cow<'a, [u8]>,
    appended: Option<&'a [u8]>,
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
    if !rest[..tag].windows(5).any(|window| matches!(window, b"\"raw\"" | b"'raw'")) {
        return Err(unsupported("a VTU file with encoded appended data"));
    }
    let data = rest[tag + 1..].trim_ascii_start().strip_prefix(b"_").ok_or_else(cut)?;
    Ok(Halves { text: Cow::Owned([&bytes[..begin], END].concat()), appended: Some(data) })
}

fn parse(bytes: &[u8]) -> Result<Document<'_>, Fault> {
    let broken = |reason: String, line: usize| Fault::at(line, ReadProblem::Xml { reason });
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
        broken("text that is not UTF-8".into(), line)
    })?;
    Document::parse(text).map_err(|error| broken(error.to_string(), error.pos().row as usize))
}

fn unsupported(found: &str) -> Fault {
    Fault::whole_file(ReadProblem::Unsupported { found: found.into(), advice: ASCII_ADVICE })
}

fn missing(node: Node, what: String) -> Fault {
    fault_at(node, ReadProblem::Missing { what })
}

fn child<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Result<Node<'a, 'input>, Fault> {
    node.children()
        .find(|child| child.has_tag_name(name))
        .ok_or_else(|| missing(node, format!("element <{name}>")))
}

fn find_piece<'a, 'input>(document: &'a Document<'input>) -> Result<Node<'a, 'input>, Fault> {
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    if !root.has_tag_name("VTKFile") || kind != "UnstructuredGrid" {
        let found = format!("a VTK file of type `{kind}`");
        return Err(fault_at(root, ReadProblem::Unsupported { found, advice: GRID_ADVICE }));
    }
    let grid = child(root, "UnstructuredGrid")?;
    let piece = child(grid, "Piece")?;
    let next = piece.next_siblings().skip(1).find(|node| node.has_tag_name("Piece"));
    match next {
        Some(second) => Err(fault_at(second, ReadProblem::SecondPart { what: "<Piece>".into() })),
        None => Ok(piece),
    }
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
    named_array(node, name).ok_or_else(|| missing(node, format!("array named `{name}`")))
}

fn named_array<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    node.children()
        .find(|child| child.has_tag_name("DataArray") && child.attribute("Name") == Some(name))
}

fn announced_count(piece: Node, attribute: &str) -> Result<usize, Fault> {
    let text =
        piece.attribute(attribute).ok_or_else(|| missing(piece, format!("count {attribute}")))?;
    // A third, so that three coordinates for each can be counted as well.
    match text.trim().parse() {
        Ok(count) if count <= usize::MAX / 3 => Ok(count),
        _ => Err(fault_at(piece, bad_word("a count", text.as_bytes()))),
    }
}

fn check_count(node: Node, what: &str, claimed: usize, found: usize) -> Result<(), Fault> {
    if claimed == found {
        return Ok(());
    }
    Err(fault_at(node, ReadProblem::CountMismatch { what: what.into(), claimed, found }))
}

fn read_regions<'a, 'input>(
    piece: Node<'a, 'input>,
    cell_count: usize,
    array: impl Fn(Node<'a, 'input>) -> Result<DataArray<'a, 'input>, Fault>,
) -> Result<Option<Vec<u32>>, Fault> {
    let cell_data = piece.children().find(|child| child.has_tag_name("CellData"));
    let Some(node) = cell_data.and_then(|data| named_array(data, "region")) else {
        return Ok(None);
    };
    let labels = array(node)?.numbers("a region, a whole number of 0 or more")?;
    check_count(node, "regions of cells", cell_count, labels.len())?;
    Ok(Some(labels))
}

/// VTK's name of a cell type.
fn kind_name(kind: u8) -> String {
    let name = match kind {
        1 => "vertex",
        3 => "line",
        5 => "triangle",
        9 => "quad",
        12 => "hexahedron",
        13 => "wedge",
        14 => "pyramid",
        24 => "second-order tetrahedron",
        other => return format!("cell of type {other}"),
    };
    name.into()
}
