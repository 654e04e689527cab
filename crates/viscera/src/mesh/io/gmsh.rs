//! Gmsh meshes in ASCII: versions 1 (`$NOD`, `$ELM`) and 2.x (`$MeshFormat`, `$Nodes`,
//! `$Elements`), see "File formats" in the Gmsh reference manual.
//!
//! Vertex numbers may be any, in any order. Elements other than tetrahedra of four vertices are
//! skipped and counted. The region of a tetrahedron is its physical tag, 0 without one.

use std::fmt::Write;

use super::error::{Fault, ReadProblem};
use super::lines::{Line, Lines, Words, bad_word, shorten};
use super::parsed::{Format, Parsed, SkippedElements};
use crate::mesh::{MeshError, MeshPlace, MeshRepairs, TetMesh};
use crate::scalar::{Vec3, vec3};

const TET: u32 = 4;

const EXPORT_ADVICE: &str = "in Gmsh export it as \"Version 2 ASCII\", or run \
    `gmsh OLD.msh -save -format msh22 -o NEW.msh`";

/// The shortest line of an element or a vertex, `1 0 0 0` without its line end [bytes]: bounds
/// what a file can hold, so that no number in it can ask for more memory than its size warrants.
const SHORTEST_ENTRY: usize = 7;

#[derive(Clone, Copy, PartialEq)]
enum Version {
    One,
    Two,
}

/// Vertices as listed in the file.
#[derive(Default)]
struct VertexList {
    /// Positions in the unit of the file.
    positions: Vec<Vec3<f64>>,
    /// Number in the file and index in `positions`, ascending.
    index_of_number: Vec<(u64, u32)>,
    lines: Vec<usize>,
}

impl VertexList {
    fn number_range(&self) -> Option<(u64, u64)> {
        let (first, last) = (self.index_of_number.first()?, self.index_of_number.last()?);
        Some((first.0, last.0))
    }
}

/// Tetrahedra as listed in the file.
#[derive(Default)]
struct TetList {
    /// Number in the file and the numbers of the vertices.
    entries: Vec<(u64, [u64; 4])>,
    regions: Vec<u32>,
    lines: Vec<usize>,
    skipped: Vec<SkippedElements>,
}

/// Reads a Gmsh mesh; positions are multiplied by the unit.
pub(super) fn read(bytes: &[u8], unit_in_meters: f64) -> Result<Parsed<TetMesh>, Fault> {
    let mut lines = Lines::new(bytes);
    let mut version = None;
    let mut vertices = None;
    let mut tets = None;
    while let Some(line) = lines.next() {
        match line.text {
            b"$MeshFormat" => {
                read_format(&mut lines)?;
                version = Some(Version::Two);
            }
            b"$NOD" | b"$Nodes" => {
                let header = begin_section(line, &mut version, vertices.is_some())?;
                vertices = Some(read_vertices(&mut lines, header)?);
            }
            b"$ELM" | b"$Elements" => {
                let header = begin_section(line, &mut version, tets.is_some())?;
                let version = if line.text == b"$ELM" { Version::One } else { Version::Two };
                tets = Some(read_tets(&mut lines, header, version)?);
            }
            [b'$', name @ ..] => skip_section(&mut lines, name)?,
            other => {
                return Err(line.fault(bad_word("a section such as $Nodes", other)));
            }
        }
    }
    let missing = |what: &str| Fault::whole_file(ReadProblem::Missing { what: what.into() });
    let vertices = vertices.ok_or_else(|| missing("section of vertices ($Nodes or $NOD)"))?;
    let tets = tets.ok_or_else(|| missing("section of elements ($Elements or $ELM)"))?;
    let format = if version == Some(Version::Two) { Format::Gmsh2 } else { Format::Gmsh1 };
    build(vertices, tets, unit_in_meters, format)
}

/// Name of a section without its `$`, once it is known to be the first of its kind.
fn begin_section<'a>(
    line: Line<'a>,
    version: &mut Option<Version>,
    seen: bool,
) -> Result<&'a [u8], Fault> {
    let name = &line.text[1..];
    if seen {
        return Err(line.fault(ReadProblem::SecondPart { what: shorten(line.text) }));
    }
    let old_style = matches!(name, b"NOD" | b"ELM");
    if version.is_none() && !old_style {
        // Without $MeshFormat nothing says how an element's line is laid out.
        return Err(line.fault(ReadProblem::Missing { what: "section $MeshFormat".into() }));
    }
    version.get_or_insert(Version::One);
    Ok(name)
}

fn read_format(lines: &mut Lines) -> Result<(), Fault> {
    let Some(line) = lines.next() else {
        return Err(cut_short(lines, b"MeshFormat"));
    };
    let mut words = line.words();
    let version: f64 = words.parse("a format version")?;
    let file_type: u32 = words.parse("a file type, 0 for ASCII")?;
    let found = if file_type != 0 {
        format!("a binary Gmsh {version} file")
    } else if !(2.0..3.0).contains(&version) {
        format!("a Gmsh {version} file")
    } else {
        return skip_section(lines, b"MeshFormat");
    };
    Err(line.fault(ReadProblem::Unsupported { found, advice: EXPORT_ADVICE }))
}

/// Reads the number of entries that open a section, and checks that the file can hold them.
fn read_count(lines: &mut Lines, section: &[u8], what: &'static str) -> Result<usize, Fault> {
    let Some(line) = lines.next() else {
        return Err(cut_short(lines, section));
    };
    let claimed: u64 = line.words().parse("a count")?;
    let bytes_left = lines.bytes_left();
    match usize::try_from(claimed) {
        Ok(count) if count <= bytes_left / SHORTEST_ENTRY => Ok(count),
        _ => Err(line.fault(ReadProblem::TooManyClaimed { what, claimed, bytes_left })),
    }
}

/// The next line of a section.
fn next_entry<'a>(lines: &mut Lines<'a>, section: &[u8]) -> Result<Line<'a>, Fault> {
    lines.next().ok_or_else(|| cut_short(lines, section))
}

/// The problem of a file that ends inside a section.
fn cut_short(lines: &Lines, section: &[u8]) -> Fault {
    let reading = format!("${}", shorten(section));
    Fault::at(lines.number(), ReadProblem::UnexpectedEnd { reading })
}

fn is_end_of(line: Line, section: &[u8]) -> bool {
    [&b"$END"[..], &b"$End"[..]].iter().any(|end| line.text.strip_prefix(*end) == Some(section))
}

fn skip_section(lines: &mut Lines, section: &[u8]) -> Result<(), Fault> {
    match lines.find(|&line| is_end_of(line, section)) {
        Some(_) => Ok(()),
        None => Err(cut_short(lines, section)),
    }
}

/// The end of a section must follow its last entry.
fn expect_end(lines: &mut Lines, section: &[u8]) -> Result<(), Fault> {
    let line = next_entry(lines, section)?;
    if is_end_of(line, section) {
        return Ok(());
    }
    // At the very end of a file, half an end mark means a cut rather than a wrong count.
    if lines.bytes_left() == 0 && line.text.starts_with(b"$") {
        return Err(cut_short(lines, section));
    }
    Err(line.fault(bad_word("the end of the section (its count may be wrong)", line.text)))
}

fn read_vertices(lines: &mut Lines, section: &[u8]) -> Result<VertexList, Fault> {
    let count = read_count(lines, section, "vertices")?;
    let mut list = VertexList::default();
    for index in 0..count {
        let line = next_entry(lines, section)?;
        let mut words = line.words();
        let number: u64 = words.parse("a vertex number, 1 or more")?;
        let mut coordinate = || words.parse("a coordinate");
        list.positions.push(vec3(coordinate()?, coordinate()?, coordinate()?));
        list.index_of_number.push((number, index as u32));
        list.lines.push(line.number);
    }
    expect_end(lines, section)?;
    list.index_of_number.sort_unstable();
    let repeated = list.index_of_number.windows(2).find(|pair| pair[0].0 == pair[1].0);
    if let Some(&[_, (number, index)]) = repeated {
        let line = list.lines[index as usize];
        return Err(Fault::at(line, ReadProblem::RepeatedNumber { number }));
    }
    Ok(list)
}

fn read_tets(lines: &mut Lines, section: &[u8], version: Version) -> Result<TetList, Fault> {
    let count = read_count(lines, section, "elements")?;
    let mut list = TetList::default();
    for _ in 0..count {
        let line = next_entry(lines, section)?;
        let mut words = line.words();
        let number: u64 = words.parse("an element number")?;
        let kind: u32 = words.parse("an element type")?;
        if kind != TET {
            SkippedElements::count(&mut list.skipped, kind_name(kind));
            continue;
        }
        let region = match version {
            Version::One => read_tags_1(&mut words, line)?,
            Version::Two => read_tags_2(&mut words)?,
        };
        let mut corner = || words.parse("a vertex number, 1 or more");
        list.entries.push((number, [corner()?, corner()?, corner()?, corner()?]));
        list.regions.push(region);
        list.lines.push(line.number);
    }
    expect_end(lines, section)?;
    Ok(list)
}

/// Physical tag, elementary tag, number of vertices: version 1.
fn read_tags_1(words: &mut Words, line: Line) -> Result<u32, Fault> {
    let region = words.parse("a physical tag, 0 or more")?;
    words.parse::<i64>("an elementary tag")?;
    let vertex_count: usize = words.parse("a number of vertices")?;
    if vertex_count != 4 {
        let what = "vertices of a tetrahedron".into();
        let problem = ReadProblem::CountMismatch { what, claimed: vertex_count, found: 4 };
        return Err(line.fault(problem));
    }
    Ok(region)
}

/// Number of tags, then the tags, the physical one first: version 2.
fn read_tags_2(words: &mut Words) -> Result<u32, Fault> {
    let tag_count: u32 = words.parse("a number of tags")?;
    let mut region = 0;
    for tag in 0..tag_count {
        if tag == 0 {
            region = words.parse("a physical tag, 0 or more")?;
        } else {
            words.parse::<i64>("a tag")?;
        }
    }
    Ok(region)
}

fn build(
    vertices: VertexList,
    tets: TetList,
    unit_in_meters: f64,
    format: Format,
) -> Result<Parsed<TetMesh>, Fault> {
    if tets.entries.is_empty() {
        let others = SkippedElements::list(&tets.skipped);
        return Err(Fault::whole_file(ReadProblem::NoTets { others }));
    }
    let index_of = |number: u64| {
        let table = &vertices.index_of_number;
        table.binary_search_by_key(&number, |entry| entry.0).map(|at| table[at].1)
    };
    let mut indices = Vec::with_capacity(tets.entries.len());
    for (&(element, numbers), &line) in tets.entries.iter().zip(&tets.lines) {
        let mut tet = [0; 4];
        for (index, number) in tet.iter_mut().zip(numbers) {
            *index = index_of(number).map_err(|_| {
                Fault::at(
                    line,
                    ReadProblem::UnknownVertex {
                        element: format!("tetrahedron {element}"),
                        vertex: number.to_string(),
                        vertex_count: vertices.positions.len(),
                        numbers: vertices.number_range(),
                    },
                )
            })?;
        }
        indices.push(tet);
    }
    let positions = vertices.positions.iter().map(|&x| x * unit_in_meters).collect();
    let (mesh, repairs): (TetMesh, MeshRepairs) = TetMesh::new(positions, indices, tets.regions)
        .map_err(|error: MeshError| {
            let line = match error.place() {
                MeshPlace::Whole => None,
                MeshPlace::Vertex(vertex) => vertices.lines.get(vertex).copied(),
                MeshPlace::Tet(tet) => tets.lines.get(tet).copied(),
            };
            Fault { line, problem: ReadProblem::Mesh(error) }
        })?;
    Ok(Parsed { mesh, repairs, format, skipped: tets.skipped })
}

/// The manual's name of an element type.
fn kind_name(kind: u32) -> String {
    let name = match kind {
        1 => "line",
        2 => "triangle",
        3 => "quadrangle",
        5 => "hexahedron",
        6 => "prism",
        7 => "pyramid",
        11 => "second-order tetrahedron",
        15 => "point",
        other => return format!("element of type {other}"),
    };
    name.into()
}

/// A mesh as Gmsh 2.2 ASCII, in metres, regions as physical tags.
pub fn write(mesh: &TetMesh) -> String {
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n");
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}", mesh.vertices().len());
    for (index, x) in mesh.vertices().iter().enumerate() {
        let _ = writeln!(text, "{} {:?} {:?} {:?}", index + 1, x.x, x.y, x.z);
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", mesh.tets().len());
    for (index, (tet, region)) in mesh.tets().iter().zip(mesh.regions()).enumerate() {
        let [a, b, c, d] = tet.map(|vertex| u64::from(vertex) + 1);
        let _ = writeln!(text, "{} 4 2 {region} {region} {a} {b} {c} {d}", index + 1);
    }
    text.push_str("$EndElements\n");
    text
}
