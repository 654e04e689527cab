//! Damaged mesh files: cut anywhere, changed anywhere, or never a mesh. Nothing may panic, and a
//! cut file is an error unless only blanks were lost.

use proptest::prelude::*;
use viscera::mesh::TetMesh;
use viscera::mesh::io::{MeshFile, Patch, gmsh, obj, read_surface, read_tet_mesh, vtu};
use viscera::mesh::{SurfaceMesh, boundary_surface};
use viscera::scalar::vec3;

/// A row of tetrahedra, two regions.
fn chain() -> TetMesh {
    let vertices = (0..12)
        .map(|i| {
            let turn = f64::from(i % 3);
            vec3(turn, turn * turn * 0.5, f64::from(i) * 0.4)
        })
        .collect();
    let tets: Vec<[u32; 4]> = (0..9).map(|i| [i, i + 1, i + 2, i + 3]).collect();
    let regions = (0..9).map(|i| i / 5).collect();
    TetMesh::new(vertices, tets, regions).unwrap().0
}

fn version_1(mesh: &TetMesh) -> String {
    gmsh::write(mesh)
        .replace("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", "")
        .replace("$Nodes", "$NOD")
        .replace("$EndNodes", "$ENDNOD")
        .replace("$Elements", "$ELM")
        .replace("$EndElements", "$ENDELM")
        .replace(" 4 2 0 0 ", " 4 0 0 4 ")
        .replace(" 4 2 1 1 ", " 4 1 1 4 ")
}

fn tet_files() -> [(&'static str, Vec<u8>); 3] {
    let mesh = chain();
    let regions = vtu::Array::integers("region", mesh.regions());
    let grid = vtu::write(mesh.vertices(), mesh.tets(), &[], &[regions]).unwrap();
    [
        ("chain_1.msh", version_1(&mesh).into_bytes()),
        ("chain_2.msh", gmsh::write(&mesh).into_bytes()),
        ("chain.vtu", grid),
    ]
}

fn surface_file() -> (SurfaceMesh, Vec<u8>) {
    let surface = boundary_surface(&chain()).surface;
    let text = obj::write(&surface, None).unwrap();
    (surface, text.into_bytes())
}

#[test]
fn file_cut_at_any_byte_is_an_error() {
    for (name, bytes) in tet_files() {
        let whole = read_tet_mesh(name, &bytes, 1.0).unwrap().0;
        for end in 0..bytes.len() {
            match read_tet_mesh(name, &bytes[..end], 1.0) {
                // Nothing but blanks was lost.
                Ok((mesh, _)) => {
                    assert!(bytes[end..].iter().all(u8::is_ascii_whitespace), "{name} {end}");
                    assert_eq!(mesh, whole);
                }
                Err(error) => assert!(error.to_string().starts_with(name)),
            }
        }
    }
}

#[test]
fn file_cut_at_each_section_says_that_it_is_cut() {
    for (name, bytes) in tet_files() {
        let marks = bytes.iter().enumerate().filter(|(_, byte)| b"$<".contains(byte));
        for (end, _) in marks.skip(1) {
            let error = read_tet_mesh(name, &bytes[..end], 1.0).unwrap_err().to_string();
            let says_so = ["cut short", "has no section"].iter().any(|part| error.contains(part));
            assert!(says_so, "{error}");
        }
    }
}

#[test]
fn surface_cut_at_any_byte_is_an_error_or_a_part_of_it() {
    // OBJ has neither counts nor an end mark, so a cut between lines cannot be seen.
    let (whole, bytes) = surface_file();
    for end in 0..bytes.len() {
        if let Ok((part, _)) = read_surface("chain.obj", &bytes[..end], 1.0) {
            assert!(part.triangles.len() <= whole.triangles.len());
            let count = part.vertices.len() as u32;
            assert!(part.triangles.iter().flatten().all(|&vertex| vertex < count));
        }
    }
}

#[test]
fn real_files_cut_at_every_37th_byte_are_errors() {
    let Some(folder) = crate::common::data::data_folder() else { return };
    let bytes = std::fs::read(folder.join("liver_coarse.msh")).unwrap();
    for end in (0..bytes.len() - 8).step_by(37) {
        assert!(read_tet_mesh("liver_coarse.msh", &bytes[..end], 1.0).is_err(), "{end}");
    }
    // Larger files at a stride that keeps the test in a second.
    let bytes = std::fs::read(folder.join("tongue.vtu")).unwrap();
    for end in (0..bytes.len() - 16).step_by(37 * 53) {
        assert!(read_tet_mesh("tongue.vtu", &bytes[..end], 1.0).is_err(), "{end}");
    }
}

#[test]
fn deeply_nested_xml_does_not_exhaust_the_stack() {
    let text = format!("<VTKFile>{}", "<a>".repeat(200_000));
    assert!(read_tet_mesh("deep.vtu", text.as_bytes(), 1.0).is_err());
}

#[test]
fn growing_xml_entities_are_refused() {
    let mut text = String::from("<!DOCTYPE x [<!ENTITY e0 \"1 1 1 1 1 1 1 1 1 1\">");
    for level in 1..12 {
        let uses = format!("&e{};", level - 1).repeat(10);
        text.push_str(&format!("<!ENTITY e{level} \"{uses}\">"));
    }
    text.push_str("]><VTKFile type=\"UnstructuredGrid\">&e11;</VTKFile>");
    assert!(read_tet_mesh("bomb.vtu", text.as_bytes(), 1.0).is_err());
}

fn error_of(name: &str, text: &str) -> String {
    let read = read_tet_mesh(name, text.as_bytes(), 1.0);
    read.map(|(_, report)| report).expect_err(name).to_string()
}

/// Four letters are three bytes, and none of them are none: a reader once waited for the end of such a group.
#[test]
fn base64_that_goes_on_with_its_end_is_an_error() {
    let text = "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"1\">\
        <Points><DataArray type=\"Float32\" format=\"binary\">AAAA=</DataArray></Points></Piece>\
        </UnstructuredGrid></VTKFile>";
    let error = error_of("a.vtu", text);
    assert!(error.starts_with("a.vtu, line 1: expected data in Base64"), "{error}");
}

const ABAQUS: &str = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n5, 1, 1, 1\n\
    *ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n2, 2, 3, 4, 5\n*ELEMENT, TYPE=T3D2\n3, 1, 2\n4, 2, 3\n";

#[test]
fn abaqus_sets_take_no_more_members_than_the_file_has_room_for() {
    for set in [
        "*NSET, NSET=a, GENERATE\n0, 18446744073709551615\n",
        "*ELSET, ELSET=a, GENERATE\n1, 4000000000, 2\n",
        &format!(
            "*ELSET, ELSET=a\n1\n{}",
            "*ELSET, ELSET=b\na, a\n*ELSET, ELSET=a\nb, b\n".repeat(40)
        ),
    ] {
        let error = error_of("a.inp", &format!("{ABAQUS}{set}"));
        assert!(error.contains("more members than it has room for"), "{error}");
    }
}

/// As files of programs have them: ranges over elements that are no solids, sets of sets, and one that names itself.
#[test]
fn abaqus_sets_name_ranges_and_other_sets() {
    let sets = "*ELSET, ELSET=all, GENERATE\n1, 4, 1\n*NSET, NSET=odd, GENERATE\n1, 5, 2\n\
        *NSET, NSET=more\nodd, 2\n*NSET, NSET=more\nmore\n*NSET, NSET=none, GENERATE\n5, 1\n";
    let text = format!("{ABAQUS}{sets}");
    let (mesh, report) = read_tet_mesh("a.inp", text.as_bytes(), 1.0).unwrap();
    assert_eq!(mesh.regions(), [1, 1]);
    assert_eq!(report.region_names, [(1, "all".to_owned())]);
    let patch =
        |name: &str, vertices: &[u32]| Patch { name: name.into(), vertices: vertices.into() };
    assert_eq!(report.patches, [patch("more", &[0, 1, 2, 4]), patch("odd", &[0, 2, 4])]);
}

#[test]
fn patch_of_vertices_that_are_not_there_is_an_error() {
    let text = "MeshVersionFormatted 2\nDimension 3\nVertices 4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n\
        Tetrahedra 1\n1 2 3 4 0\nEdges 1\n1 9 7\nEnd\n";
    let error = error_of("a.mesh", text);
    assert_eq!(error, "a.mesh: `curve 7` refers to vertex 9; the file has 4; export all vertices");
}

const VTK: &str = "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n\
    0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n";

#[test]
fn values_of_other_points_than_there_are_are_an_error() {
    let error = error_of("a.vtk", &format!("{VTK}POINT_DATA 5\nSCALARS a int\n1 1 1 1 1\n"));
    let says = "a.vtk, line 11: values at points: 5 are announced, 4 are there";
    assert!(error.starts_with(says), "{error}");
}

#[test]
fn sets_of_the_same_name_are_one() {
    let sets = "POINT_DATA 4\nSCALARS a int\n0 0 1 0\nSCALARS a int\n1 0 1 0\n";
    let report = read_tet_mesh("a.vtk", format!("{VTK}{sets}").as_bytes(), 1.0).unwrap().1;
    assert_eq!(report.patches, [Patch { name: "a".into(), vertices: vec![0, 2] }]);
}

/// They are printed to terminals, which take these for orders.
#[test]
fn names_and_errors_have_no_control_characters() {
    let name = "a\u{1b}[2J\u{9b}1A\u{202e}";
    let text = gmsh::write(&chain());
    let names = format!("$PhysicalNames\n1\n3 1 \"{name}\"\n$EndPhysicalNames\n$Nodes");
    let text = text.replacen("$Nodes", &names, 1);
    let report = read_tet_mesh("a.msh", text.as_bytes(), 1.0).unwrap().1;
    assert_eq!(report.region_names, [(1, "a?[2J?1A?".to_owned())]);
    let sets = format!("{ABAQUS}*NSET, NSET={name}\n1\n");
    let report = read_tet_mesh("a.inp", sets.as_bytes(), 1.0).unwrap().1;
    assert_eq!(report.patches[0].name, "a?[2J?1A?");
    let error = error_of("a.vtu", "<VTKFile type=\"a&#x9b;&#10;\"/>");
    assert!(error.contains("of type `a??`"), "{error}");
    let error = error_of("a.vtu", "<VTKFile \u{9b}/>");
    assert!(!error.contains(char::is_control), "{error}");
}

#[test]
fn gmsh_says_once_how_its_numbers_stand() {
    let head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
    let error = error_of("a.msh", &format!("{head}{}", gmsh::write(&chain())));
    assert!(error.starts_with("a.msh, line 4: a second $MeshFormat"), "{error}");
}

#[test]
fn faults_of_two_files_name_the_one_they_are_in() {
    let nodes = "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n";
    let elements = "1 4 0\n1 1 2 3 4\n";
    let read = |name: &str, nodes: &str, elements: &str| {
        let both = [nodes.as_bytes().to_vec(), elements.as_bytes().to_vec()];
        let [bytes, beside] =
            if name == "a.ele" { [both[1].clone(), both[0].clone()] } else { both };
        let file = MeshFile { name: name.into(), bytes, beside: Some(beside) };
        file.tets(1.0).map(|(mesh, _)| mesh.tets().len()).map_err(|error| error.to_string())
    };
    for name in ["a.node", "a.ele"] {
        assert_eq!(read(name, nodes, elements), Ok(1));
        let error = read(name, &nodes.replace("2 1 0 0", "2 1 x 0"), elements).unwrap_err();
        assert!(error.starts_with("a.node, line 3: "), "{error}");
        let error = read(name, nodes, &elements.replace("3 4", "3 5")).unwrap_err();
        assert!(error.starts_with("a.ele, line 2: "), "{error}");
    }
}

/// Reads bytes under every name; all that counts is that the calls return.
fn read_all_ways(bytes: &[u8]) {
    for name in ["a.msh", "a.vtu", "a.obj", "a"] {
        let _ = read_tet_mesh(name, bytes, 1.0).map_err(|error| error.to_string());
        let _ = read_surface(name, bytes, 1.0).map_err(|error| error.to_string());
    }
}

/// Words that mean something to one of the formats.
const WORDS: [&str; 22] = [
    "$NOD\n",
    "$ENDNOD\n",
    "$ELM\n",
    "$ENDELM\n",
    "$MeshFormat\n",
    "2.2 0 8\n",
    "$EndMeshFormat\n",
    "$Nodes\n",
    "$EndNodes\n",
    "$Elements\n",
    "$EndElements\n",
    "v ",
    "f ",
    "\n",
    " ",
    "4 ",
    "-1 ",
    "nan ",
    "1e999 ",
    "4294967296 ",
    "18446744073709551616 ",
    "/",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        read_all_ways(&bytes);
        for start in [&b"$NOD\n"[..], b"$MeshFormat\n2.2 0 8\n", b"<VTKFile", b"v 0 0 0\n"] {
            read_all_ways(&[start, &bytes].concat());
        }
    }

    #[test]
    fn random_words_never_panic(words in proptest::collection::vec(0..WORDS.len(), 0..60)) {
        let text: String = words.iter().map(|&word| WORDS[word]).collect();
        read_all_ways(text.as_bytes());
    }

    #[test]
    fn changed_files_never_panic(
        file in 0usize..4,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..WORDS.len(), 0u8..3), 1..6),
    ) {
        let mut bytes = match tet_files().into_iter().nth(file) {
            Some((_, bytes)) => bytes,
            None => surface_file().1,
        };
        for (place, byte, word, kind) in changes {
            let at = place.index(bytes.len().max(1)).min(bytes.len().saturating_sub(1));
            match kind {
                0 => bytes[at] = byte,
                1 => drop(bytes.splice(at..at, WORDS[word].bytes())),
                _ => drop(bytes.splice(at..(at + usize::from(byte)).min(bytes.len()), [])),
            }
            if bytes.is_empty() {
                break;
            }
        }
        read_all_ways(&bytes);
    }
}
