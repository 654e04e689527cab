//! Mesh files that are damaged at random, the same ones on every machine: no reader may panic, hang, or ask for memory that
//! the file does not warrant, and what it says must fit on a line of a terminal.

use std::time::Duration;

use viscera::mesh::io::MeshFile;

use crate::common::damage::{LARGEST_DEFLATE_RATIO, Reader};
use crate::mesh_formats::{fixture, fixtures};
use crate::mesh_handover;

/// So many inputs of a slow test, which ends after three minutes at the latest.
const MANY: (u64, Duration) = (250_000, Duration::from_secs(180));

/// Inputs of a fast test: at most about a second's.
const FEW: (u64, Duration) = (10_000, Duration::from_secs(3600));

fn gmsh_text() -> Reader {
    let words = &[
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n",
        "$PhysicalNames\n1\n3 5 \"a\u{1b}[2J\"\n$EndPhysicalNames\n",
        "$Nodes\n",
        "$EndNodes\n",
        "$Elements\n",
        "$EndElements\n",
        "$NOD\n",
        "$ENDELM\n",
        "$Entities\n",
        " 4 ",
        " 15 ",
        " 93 ",
        "\n",
        "\"",
    ];
    let own = "$NOD\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$ENDNOD\n$ELM\n2\n1 2 7 1 3 1 2 3\n\
        2 4 5 1 4 1 2 3 4\n$ENDELM\n";
    let parts = ["gmsh22.msh", "gmsh22_ascii", "gmsh40_ascii", "gmsh41_ascii", "gmsh41.msh"];
    Reader::new(&parts, &[("one.msh", own)], words, 1)
}

fn gmsh_binary() -> Reader {
    let words = &[
        "$MeshFormat\n2.2 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n",
        "$MeshFormat\n4 1 4\n\0\0\0\u{1}\n$EndMeshFormat\n",
        "$Nodes\n",
        "\n$EndNodes\n",
        "$Elements\n",
        "\n$EndElements\n",
        "\u{f}\0\0\0",
        "\0\0\0\0",
    ];
    Reader::new(&["gmsh22_binary", "gmsh41_binary"], &[], words, 1)
}

const VTK_WORDS: &[&str] = &[
    "CELL_DATA 14\n",
    "POINT_DATA 12\n",
    "SCALARS a\u{9b}%1b int 1\nLOOKUP_TABLE default\n",
    "SCALARS region float\n",
    "FIELD f 2\n",
    "wall 1 12 int\n",
    "LOOKUP_TABLE t 3\n",
    "TEXTURE_COORDINATES t 3 float\n",
    "COLOR_SCALARS c 3\n",
    "TENSORS t double\n",
    "CELLS 14 68\n",
    "CELL_TYPES 14\n",
    "POLYGONS 1 4\n",
    "TRIANGLE_STRIPS 1 5\n4 0 1 2 3\n",
    "OFFSETS vtktypeint64\n",
    "CONNECTIVITY long\n",
    "METADATA\n",
    "POINTS 1 float\n",
    " 7 ",
    " 42 ",
    " 71 ",
];

fn vtk_text() -> Reader {
    let own = "# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n\
        0 0 0 1 0 0 0 1 0 1 1 0 0 2 0\nLINES 1 3\n2 0 1\nTRIANGLE_STRIPS 1 6\n5 0 1 2 3 4\n\
        POINT_DATA 5\nSCALARS mark int 1\nLOOKUP_TABLE default\n0 1 1 2 2\n";
    let parts = ["vtk42_ascii", "vtk51_ascii", "shell_ascii.vtk", "mixed.vtk"];
    Reader::new(&parts, &[("strip.vtk", own)], VTK_WORDS, 1)
}

fn vtk_binary() -> Reader {
    Reader::new(&["vtk42_binary", "vtk51_binary", "shell_binary.vtk"], &[], VTK_WORDS, 1)
}

const XML_WORDS: &[&str] = &[
    "<DataArray type=\"Int8\" Name=\"a&#x9b;\" format=\"ascii\">1 0 0 0 1 1 1 1 2 2 2 2</DataArray>",
    "<DataArray type=\"UInt8\" Name=\"b\" format=\"appended\" offset=\"0\"/>",
    "<DataArray type=\"Int64\" Name=\"c\" format=\"binary\">DAAAAA==AAAAAAAAAAAAAAAA</DataArray>",
    "<Piece NumberOfPoints=\"1\" NumberOfCells=\"0\">",
    "</Piece>",
    "<!-- -->",
    "<![CDATA[1 2 3]]>",
    "<!DOCTYPE a [<!ENTITY b \"c\">]>",
    "&b;",
    "&#10;",
    " format=\"appended\"",
    " offset=\"8\"",
    " NumberOfComponents=\"0\"",
    " compressor=\"vtkZLibDataCompressor\"",
    " header_type=\"UInt64\"",
    " byte_order=\"BigEndian\"",
    "<AppendedData encoding=\"raw\">_",
    "</AppendedData>",
    "AAAA",
    "=",
    "\u{85}",
];

fn xml_text() -> Reader {
    let own = "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"4\" NumberOfStrips=\"1\">\
        <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0 1 0 0 0 1 0 1 1 0</DataArray>\
        </Points><Strips><DataArray type=\"Int32\" Name=\"connectivity\">0 1 2 3</DataArray>\
        <DataArray type=\"Int32\" Name=\"offsets\">4</DataArray></Strips></Piece></PolyData></VTKFile>";
    let parts = ["ascii.vtu", "curved.vtu", "mixed.vtu"];
    Reader::new(&parts, &[("strip.vtp", own)], XML_WORDS, 1)
}

fn xml_bytes() -> Reader {
    let parts =
        ["base64.vtu", "binary.vtu", "binary_64", "binary_big", "appended_64", "appended_big"];
    let parts = [&parts[..], &["appended.vtu", "appended_base64", ".vtp"]].concat();
    Reader::new(&parts, &[], XML_WORDS, 1)
}

fn xml_zlib() -> Reader {
    Reader::new(&["zlib"], &[], XML_WORDS, LARGEST_DEFLATE_RATIO)
}

fn tetgen() -> Reader {
    let words = &["# ", "\n", "12 3 1 1\n", "12 4 0\n", "12 10 1\n", " 5", " 4294967296 "];
    Reader::new(&["bar.ele"], &[], words, 1)
}

fn medit() -> Reader {
    let words = &[
        "Vertices\n1\n0 0 0 0\n",
        "Tetrahedra\n",
        "TetrahedraP2\n",
        "Triangles\n1\n1 2 99 7\n",
        "Edges\n1\n1 2 3\n",
        "Quadrilaterals ",
        "Hexahedra ",
        "RequiredVertices 2 1 2\n",
        "Dimension 3\n",
        "End\n",
        "#",
        "\n",
    ];
    Reader::new(&["bar.mesh", "mixed.mesh"], &[], words, 1)
}

fn abaqus() -> Reader {
    let words = &[
        "*NSET, NSET=wall, GENERATE\n1, 12, 1\n",
        "*ELSET, ELSET=all, GENERATE\n0, 18446744073709551615\n",
        "*ELSET, ELSET=left\nleft, left\n",
        "*NSET, NSET=wall\nwall, wall, wall, wall\n",
        "*ELSET, ELSET=a\u{1b}\u{9b}\nleft\n",
        "*NODE, NSET=n\n",
        "*ELEMENT, TYPE=C3D10, ELSET=e\n",
        "*ELEMENT, TYPE=C3D8\n",
        "*ELEMENT, TYPE=B31\n",
        "*INSTANCE, NAME=i\n",
        "*MATERIAL\n",
        "** \n",
        ",",
        "\n",
    ];
    let own = "*NODE, NSET=all\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n5, 1, 1, 1\n\
        *ELEMENT, TYPE=C3D4, ELSET=one\n1, 1, 2, 3,\n4\n2, 2, 3, 4, 5\n*NSET, NSET=some, GENERATE\n\
        1, 5, 2\n*NSET, NSET=more\nsome, 2\n*ELSET, ELSET=both\none, 2\n";
    Reader::new(&[".inp"], &[("sets.inp", own)], words, 1)
}

fn obj() -> Reader {
    let words =
        &["v ", "f ", "l 1 2\n", "p 1\n", "vn 0 0 1\n", "/", "//", " -1", "\n", "\\\n", "#"];
    Reader::new(&[".obj"], &[], words, 1)
}

const STL_WORDS: &[&str] = &[
    "solid a\n",
    "facet normal 0 0 1\n",
    "outer loop\n",
    "vertex 0 0 0\n",
    "endloop\n",
    "endfacet\n",
    "endsolid\n",
    "color 1 1 1\n",
    "\n",
];

fn stl_text() -> Reader {
    Reader::new(&["ascii.stl"], &[], STL_WORDS, 1)
}

fn stl_binary() -> Reader {
    Reader::new(&["binary.stl"], &[], STL_WORDS, 1)
}

const PLY_WORDS: &[&str] = &[
    "element vertex 12\n",
    "element face 20\n",
    "element edge 100\n",
    "element \u{9b} 1\n",
    "property float x\n",
    "property list uchar int vertex_index\n",
    "property list uint double marks\n",
    "property char c\n",
    "format ascii 1.0\n",
    "format binary_big_endian 1.0\n",
    "comment\n",
    "end_header\n",
];

fn ply_text() -> Reader {
    Reader::new(&["ascii.ply"], &[], PLY_WORDS, 1)
}

fn ply_binary() -> Reader {
    Reader::new(&["binary.ply"], &[], PLY_WORDS, 1)
}

fn handover() -> Reader {
    let words = &["\u{1}\0\0\0a", "\0\0\0\0\0\0\0\0", "\u{1b}[2J", "\u{5}\0\0\0"];
    Reader::of(vec![mesh_handover::file()], words, 1)
}

#[test]
fn damaged_gmsh_text_is_survived() {
    gmsh_text().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_gmsh_text_is_survived_at_length() {
    gmsh_text().survives(MANY);
}

#[test]
fn damaged_gmsh_bytes_is_survived() {
    gmsh_binary().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_gmsh_bytes_is_survived_at_length() {
    gmsh_binary().survives(MANY);
}

#[test]
fn damaged_vtk_text_is_survived() {
    vtk_text().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_vtk_text_is_survived_at_length() {
    vtk_text().survives(MANY);
}

#[test]
fn damaged_vtk_bytes_is_survived() {
    vtk_binary().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_vtk_bytes_is_survived_at_length() {
    vtk_binary().survives(MANY);
}

#[test]
fn damaged_vtk_xml_text_is_survived() {
    xml_text().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_vtk_xml_text_is_survived_at_length() {
    xml_text().survives(MANY);
}

#[test]
fn damaged_vtk_xml_bytes_is_survived() {
    xml_bytes().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_vtk_xml_bytes_is_survived_at_length() {
    xml_bytes().survives(MANY);
}

#[test]
fn damaged_vtk_xml_zlib_is_survived() {
    xml_zlib().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_vtk_xml_zlib_is_survived_at_length() {
    xml_zlib().survives(MANY);
}

#[test]
fn damaged_tetgen_is_survived() {
    tetgen().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_tetgen_is_survived_at_length() {
    tetgen().survives(MANY);
}

#[test]
fn damaged_medit_is_survived() {
    medit().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_medit_is_survived_at_length() {
    medit().survives(MANY);
}

#[test]
fn damaged_abaqus_is_survived() {
    abaqus().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_abaqus_is_survived_at_length() {
    abaqus().survives(MANY);
}

#[test]
fn damaged_obj_is_survived() {
    obj().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_obj_is_survived_at_length() {
    obj().survives(MANY);
}

#[test]
fn damaged_stl_text_is_survived() {
    stl_text().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_stl_text_is_survived_at_length() {
    stl_text().survives(MANY);
}

#[test]
fn damaged_stl_bytes_is_survived() {
    stl_binary().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_stl_bytes_is_survived_at_length() {
    stl_binary().survives(MANY);
}

#[test]
fn damaged_ply_text_is_survived() {
    ply_text().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_ply_text_is_survived_at_length() {
    ply_text().survives(MANY);
}

#[test]
fn damaged_ply_bytes_is_survived() {
    ply_binary().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_ply_bytes_is_survived_at_length() {
    ply_binary().survives(MANY);
}

#[test]
fn damaged_handover_is_survived() {
    handover().survives(FEW);
}

#[test]
#[ignore = "slow: a quarter of a million inputs"]
fn damaged_handover_is_survived_at_length() {
    handover().survives(MANY);
}

/// Every fixture without what comes after every so many bytes.
fn cut(stride: usize) {
    for name in fixtures("") {
        let whole = fixture(&name);
        let expected = whole.mesh(1.0).unwrap_or_else(|error| panic!("{error}"));
        // Lists without an end, of lines that may be left out, or of sections.
        let is_open = [".obj", ".inp", ".vtk"].iter().any(|end| name.ends_with(end));
        // Numbers of entries, and nothing behind the last.
        let is_counted = [".ele", "ascii.ply"].iter().any(|end| name.ends_with(end));
        let both = [(false, Some(&whole.bytes)), (true, whole.beside.as_ref())];
        for (is_beside, bytes) in both {
            let Some(bytes) = bytes else { continue };
            for end in (0..bytes.len()).step_by(stride) {
                let (kept, lost) = bytes.split_at(end);
                let mut file: MeshFile = whole.clone();
                *(if is_beside {
                    file.beside.as_mut().expect("a file beside")
                } else {
                    &mut file.bytes
                }) = kept.to_vec();
                let read = file.mesh(1.0);
                let Ok(read) = read else { continue };
                let lost = lost.trim_ascii();
                // A shorter number is one, too.
                let is_last_number = is_counted && !lost.contains(&b' ') && !lost.contains(&b'\n');
                let is_whole = lost.is_empty() && read == expected;
                assert!(is_open || is_last_number || is_whole, "{name} {end}");
            }
        }
    }
}

#[test]
fn files_that_are_cut_are_errors() {
    cut(7);
}

#[test]
#[ignore = "slow: at every byte"]
fn files_that_are_cut_are_errors_at_length() {
    cut(1);
}
