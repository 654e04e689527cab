//! Files that are small and ask for much: every reader takes time and memory by the bytes of a file, not by pairs of its
//! entries nor by what a number in it claims.

use std::time::{Duration, Instant};

use viscera::mesh::io::MeshFile;

use crate::common::counting::peak_of;

/// Text that repeats an entry, with its number, until it has so many bytes.
fn repeated(size: usize, entry: impl Fn(usize) -> String) -> String {
    let mut text = String::with_capacity(size + 1000);
    for number in 1.. {
        text.push_str(&entry(number));
        if text.len() >= size {
            break;
        }
    }
    text
}

const ABAQUS: &str =
    "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT, TYPE=C3D4, ELSET=a\n1,1,2,3,4\n";

/// Abaqus: sets of sets, ranges, names.
fn abaqus(size: usize) -> Vec<(&'static str, String)> {
    let with = |text: String| format!("{ABAQUS}{text}");
    vec![
        ("sets.inp", with(repeated(size, |n| format!("*ELSET, ELSET=s{n}\n1\n")))),
        (
            "doubled.inp",
            with(repeated(size, |n| {
                let (set, other) = if n % 2 == 0 { ("p", "q") } else { ("q", "p") };
                let first = if n == 1 { "*ELSET, ELSET=p\n1\n" } else { "" };
                format!("{first}*ELSET, ELSET={set}\n{other}, {other}\n")
            })),
        ),
        (
            "itself.inp",
            with(format!("*ELSET, ELSET=a\n{}", repeated(size, |_| "a, a, a, a\n".into()))),
        ),
        (
            "ranges.inp",
            with(format!("*NSET, NSET=r, GENERATE\n{}", repeated(size, |_| "1, 9999\n".into()))),
        ),
        ("nodes.inp", repeated(size, |n| format!("*NODE, NSET=a{}\n{n},0,0,0\n", n % 1000))),
        (
            "named.inp",
            format!(
                "*NODE, NSET={}\n{}",
                "x".repeat(size / 2),
                repeated(size / 2, |n| format!("{n},0,0,0\n"))
            ),
        ),
        ("tets.inp", with(repeated(size, |_| "1,1,2,3,4\n".into()))),
    ]
}

/// Kinds of elements, of which there are as many as elements.
fn kinds(size: usize) -> Vec<(&'static str, String)> {
    let lines = repeated(size, |n| format!("{n} {} 0\n", n + 1000));
    let count = lines.lines().count();
    let gmsh = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n{count}\n{lines}$EndElements\n"
    );
    let count = size / 8;
    let types = repeated(0, |_| (0..count).map(|n| format!("{}\n", n + 1000)).collect());
    let vtk = format!(
        "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n0 0 0\nCELLS {count} {count}\n{}CELL_TYPES {count}\n{types}",
        "0\n".repeat(count)
    );
    let sections = repeated(size, |n| format!("A{n} 1 1\n"));
    vec![
        ("kinds.msh", gmsh),
        ("kinds.vtk", vtk),
        ("kinds.mesh", format!("MeshVersionFormatted 2\nVertices 1\n0 0 0 0\n{sections}End\n")),
        ("kinds.ply", {
            let elements = repeated(size, |n| format!("element a{n} 1\nproperty char c\n"));
            let count = elements.lines().count() / 2;
            format!("ply\nformat ascii 1.0\n{elements}end_header\n{}", "1\n".repeat(count))
        }),
        (
            "nothing.ply",
            format!(
                "ply\nformat binary_little_endian 1.0\n{}end_header\n{}",
                repeated(size, |_| "element vertex 99999\n".into()),
                "1".repeat(100_000)
            ),
        ),
    ]
}

fn grid(inside: &str) -> String {
    format!(
        "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>{inside}</UnstructuredGrid></VTKFile>"
    )
}

const CELL: &str = "<Cells><DataArray type=\"Int8\" Name=\"connectivity\">0 1 2 3</DataArray><DataArray type=\"Int8\" \
    Name=\"offsets\">4</DataArray><DataArray type=\"Int8\" Name=\"types\">10</DataArray></Cells>";
const POINTS: &str =
    "<Points><DataArray type=\"Float32\">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>";

/// VTK XML: pieces, arrays, names, comments, attributes, namespaces.
fn xml(size: usize) -> Vec<(&'static str, String)> {
    let piece = format!("<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">{POINTS}{CELL}");
    let points = "<Piece NumberOfPoints=\"1\" NumberOfCells=\"0\"><Points><DataArray>0 0 0</DataArray></Points><Cells>\
        <DataArray Name=\"connectivity\"/><DataArray Name=\"offsets\"/><DataArray Name=\"types\"/></Cells></Piece>\n";
    let array = |n| format!("<DataArray type=\"Int8\" Name=\"a{n}\">1 2 3 4</DataArray>");
    vec![
        ("pieces.vtu", grid(&repeated(size, |_| points.to_owned()))),
        (
            "arrays.vtu",
            grid(&format!("{piece}<PointData>{}</PointData></Piece>", repeated(size, array))),
        ),
        (
            "comments.vtu",
            grid(&format!(
                "<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points><DataArray>{}</DataArray></Points>{CELL}</Piece>",
                repeated(size, |_| "0<!---->".to_owned())
            )),
        ),
        ("attributes.vtu", grid(&format!("<a {}/>", repeated(size, |n| format!("a{n}=\"\" "))))),
        (
            "namespaces.vtu",
            grid(&format!(
                "<a {}>{}</a>",
                repeated(size / 2, |n| format!("xmlns:a{n}=\"a{n}\" ")),
                repeated(size / 2, |n| format!("<a xmlns:b{n}=\"b\"/>"))
            )),
        ),
        ("elements.vtu", grid(&repeated(size, |_| "<a/>".to_owned()))),
        ("kind.vtu", format!("<VTKFile type=\"{}\"/>", "x".repeat(size))),
    ]
}

/// VTK XML with data behind it that many arrays share, and in many blocks of zlib.
fn appended(size: usize) -> Vec<(&'static str, String)> {
    let file = |encoding: &str, compressor: &str, arrays: &str, data: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\" {compressor}><UnstructuredGrid><Piece NumberOfPoints=\"4\" \
            NumberOfCells=\"1\">{POINTS}{CELL}<PointData>{arrays}</PointData></Piece></UnstructuredGrid>\
            <AppendedData encoding=\"{encoding}\">_{data}</AppendedData></VTKFile>"
        )
    };
    let shared = repeated(size / 2, |_| {
        "<DataArray type=\"Int8\" Name=\"a\" format=\"appended\" offset=\"0\"/>".to_owned()
    });
    let one = "<DataArray type=\"Int8\" Name=\"a\" format=\"appended\" offset=\"0\"/>";
    let blocks = size as u32 / 8;
    let mut front = blocks.to_le_bytes().to_vec();
    // As text these bytes are below 128, so that they stay what they are.
    front.iter_mut().for_each(|byte| *byte &= 0x7f);
    let front = String::from_utf8(front).expect("text");
    vec![
        (
            "shared.vtu",
            file("base64", "", &shared, &format!("BAAAAAECAwQ={}", "AAAA".repeat(size / 8))),
        ),
        (
            "shared_raw.vtu",
            file(
                "raw",
                "",
                &shared,
                &format!("\u{4}\0\0\0\u{1}\u{1}\u{1}\u{1}{}", "A".repeat(size / 2)),
            ),
        ),
        (
            "blocks.vtu",
            file(
                "raw",
                "compressor=\"vtkZLibDataCompressor\"",
                one,
                &format!("{front}{}", "\0".repeat(size)),
            ),
        ),
        ("ends.vtu", file("base64", "", one, &format!("AAAA{}", "=".repeat(size)))),
    ]
}

/// As many vertices, elements or numbers as fit.
fn dense(size: usize) -> Vec<(&'static str, String)> {
    let half = size / 2;
    let obj = repeated(half, |_| "v 0 0 0\n".to_owned());
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\n";
    let strip = repeated(size, |n| format!("{} ", n % 4));
    let count = strip.len() / 2;
    let vtk = "# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n";
    let lines = repeated(size, |n| format!("{n} 15 0 1\n"));
    vec![
        ("vertices.obj", format!("{triangle}f 1 2 3\n{obj}")),
        ("faces.obj", format!("{triangle}{}", repeated(size, |_| "f 1 2 3 4\n".to_owned()))),
        (
            "polygon.obj",
            format!("{triangle}f 1 {}\n", repeated(size, |n| format!("{} ", 2 + n % 3))),
        ),
        ("strip.vtk", format!("{vtk}TRIANGLE_STRIPS 1 {}\n{count} {strip}\n", count + 1)),
        (
            "points.msh",
            format!(
                "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n{}\n{lines}$EndElements\n",
                lines.lines().count()
            ),
        ),
        (
            "curved.mesh",
            format!(
                "MeshVersionFormatted 2\nVertices 4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\nTrianglesP2\n{}\n{}End\n",
                size / 14,
                "1 2 3 1 2 3 0\n".repeat(size / 14)
            ),
        ),
        (
            "facets.stl",
            format!(
                "solid\n{}endsolid\n",
                repeated(size, |n| format!(
                    "facet\nvertex {n} 0 0\nvertex 0 {n} 0\nvertex 0 0 1\nendfacet\n"
                ))
            ),
        ),
        ("vertices.inp", format!("*NODE\n{}", repeated(size, |n| format!("{n},0,0,0\n")))),
        (
            "numbers.vtu",
            grid(&format!(
                "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"1\"><Points><DataArray>{}</DataArray></Points>{CELL}</Piece>",
                size / 6,
                "0 0 0 ".repeat(size / 6)
            )),
        ),
    ]
}

/// Each is read in a second, and takes no more than so many times its size of memory.
fn cost(size: usize) {
    // Two characters of text are a number or a triangle, four an element of XML; lists that grow are half empty.
    const MEMORY: usize = 24;
    let lists = [abaqus(size), kinds(size), xml(size), appended(size), dense(size)];
    for (name, text) in lists.into_iter().flatten() {
        let bytes = text.into_bytes();
        let length = bytes.len();
        let file = MeshFile { name: name.into(), bytes, beside: None };
        for kind in 0..2 {
            let start = Instant::now();
            let (said, peak) = peak_of(|| match kind {
                0 => file.tets(1.0).map(|_| ()).map_err(|error| error.to_string()),
                _ => file.surface(1.0).map(|_| ()).map_err(|error| error.to_string()),
            });
            let took = start.elapsed();
            let ratio = peak as f64 / length as f64;
            println!(
                "{name}: {length} bytes, {took:?}, {ratio:.1} bytes of memory a byte, {said:?}"
            );
            assert!(took < Duration::from_secs(1), "{name}: {took:?}");
            assert!(peak < MEMORY * length + (64 << 10), "{name}: {ratio:.1} bytes a byte");
        }
    }
}

#[test]
fn files_cost_no_more_than_their_size_warrants() {
    cost(50_000);
}

#[test]
#[ignore = "slow: files of a megabyte"]
fn files_cost_no_more_than_their_size_warrants_at_length() {
    cost(1_000_000);
}
