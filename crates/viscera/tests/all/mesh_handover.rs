//! Tetrahedra that one module of the page hands to the other: the same as they were, or an error that says what is wrong.

use viscera::mesh::TetMesh;
use viscera::mesh::io::{Format, MeshFile, MeshNames, Patch, handover, read_tet_mesh, vtu};
use viscera::scalar::vec3;

/// Two tetrahedra of two regions, in places that single precision does not hold.
fn mesh() -> TetMesh {
    let vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]];
    let vertices = vertices.map(|x| {
        let [x, y, z] = x.map(|value| f64::from(value) / 3.0 - 0.1);
        vec3(x, y, z)
    });
    TetMesh::new(vertices.to_vec(), vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![0, 7]).expect("a mesh").0
}

fn names() -> MeshNames {
    let patch =
        |name: &str, vertices: &[u32]| Patch { name: name.into(), vertices: vertices.into() };
    MeshNames {
        patches: vec![patch("left wall", &[0, 2, 3]), patch("", &[4])],
        regions: vec![(0, "größer & <b>".to_owned()), (7, "lobe \"a\" %20".to_owned())],
    }
}

/// A file with everything that one may have.
pub fn file() -> MeshFile {
    let bytes = handover::write(&mesh(), &names()).expect("a file");
    MeshFile { name: "handed.msh".into(), bytes, beside: None }
}

/// Bytes of the file in front of the counts, of the counts, and where lists begin.
const COUNTS: usize = 20;
const POSITIONS: usize = COUNTS + 4 * 4;
const TETS: usize = POSITIONS + 5 * 24;
const REGIONS: usize = TETS + 2 * 16;
const NAMES: usize = REGIONS + 2 * 4;
/// Behind the names of regions: the number and the length of each, and the letters.
const PATCHES: usize = NAMES + 2 * 8 + 14 + 12;

#[test]
fn what_is_handed_over_is_the_same_to_the_bit() {
    let MeshFile { name, bytes, .. } = file();
    // The name is the one that a scene has for it: the content tells what it is.
    for name in [&name, "a.vtu", "a.stl", "a"] {
        let (found, report) = read_tet_mesh(name, &bytes, 1.0).expect("a mesh");
        assert_eq!((&found, report.names()), (&mesh(), names()));
        assert_eq!(report.format, Some(Format::Handover));
        assert!(report.repairs == Default::default() && report.skipped.is_empty());
    }
    let (found, _) = read_tet_mesh(&name, &bytes, 0.032).expect("a mesh");
    let scaled: Vec<_> = mesh().vertices().iter().map(|x| *x * 0.032).collect();
    assert_eq!(found.vertices(), scaled);
}

/// It took the place of VTK's XML, whose numbers are in single precision.
#[test]
fn what_is_handed_over_says_what_vtk_xml_does() {
    let xml = vtu::write_mesh(&mesh(), &names()).expect("a file");
    let (of_xml, report_of_xml) = read_tet_mesh("a.vtu", &xml, 1.0).expect("a mesh");
    let MeshFile { name, bytes, .. } = file();
    let (found, report) = read_tet_mesh(&name, &bytes, 1.0).expect("a mesh");
    assert_eq!((found.tets(), found.regions()), (of_xml.tets(), of_xml.regions()));
    assert_eq!(report.names(), report_of_xml.names());
    for (x, of_xml) in found.vertices().iter().zip(of_xml.vertices()) {
        assert_eq!(x.cast::<f32>(), of_xml.cast::<f32>());
    }
}

#[test]
fn a_patch_of_vertices_that_are_not_there_is_not_written() {
    let patches = vec![Patch { name: "a".into(), vertices: vec![4, 5] }];
    let names = MeshNames { patches, ..MeshNames::default() };
    let error = handover::write(&mesh(), &names).expect_err("a vertex too many").to_string();
    assert_eq!(error, "patch `a` has vertex 5; the mesh has 5");
}

#[test]
fn what_is_cut_anywhere_is_an_error() {
    let MeshFile { name, bytes, .. } = file();
    for end in 0..bytes.len() {
        let error = read_tet_mesh(&name, &bytes[..end], 1.0).expect_err("a cut file").to_string();
        let is_told = end < COUNTS || error.contains("cut short");
        assert!(is_told && error.starts_with("handed.msh"), "{end}: {error}");
    }
}

#[test]
fn each_damage_is_told_with_its_place() {
    let bytes = file().bytes;
    let told = |at: usize, with: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[at..at + with.len()].copy_from_slice(with);
        read_tet_mesh("a", &bytes, 1.0).expect_err("damage").to_string()
    };
    let most = u32::MAX.to_le_bytes();
    let left = |at: usize| bytes.len() - at;
    let claimed = |at: usize, what: &str| {
        format!("a, byte {at}: 4294967295 {what} are announced, but only {} bytes follow", left(at))
    };
    for (at, with, message) in [
        (COUNTS, &most[..], claimed(POSITIONS, "vertices")),
        (COUNTS + 4, &most, claimed(TETS, "tetrahedra")),
        (COUNTS + 8, &most, claimed(NAMES, "named regions")),
        (COUNTS + 12, &most, claimed(PATCHES, "patches")),
        (NAMES + 4, &most, claimed(NAMES + 8, "letters of a name")),
        (PATCHES, &most, claimed(PATCHES + 4, "letters of a name")),
        (PATCHES + 4 + 9, &most, claimed(PATCHES + 8 + 9, "vertices of a patch")),
        (POSITIONS + 24, &f64::NAN.to_le_bytes(), format!("a, byte {}: vertex 1", POSITIONS + 24)),
        (
            TETS + 16,
            &5u32.to_le_bytes(),
            format!("a, byte {}: tetrahedron 1 refers to vertex 5; the mesh has 5", TETS + 16),
        ),
        (NAMES + 8, b"\xff", format!("a, byte {}: expected a name in UTF-8", NAMES + 8)),
        (
            PATCHES + 8 + 9,
            &5u32.to_le_bytes(),
            format!("a, byte {}: `left wall` refers to vertex 5; the file has 5", PATCHES + 8 + 9),
        ),
        (COUNTS + 12, &1u32.to_le_bytes(), format!("a, byte {}: bytes: ", bytes.len() - 12)),
        (0, b"\x88", "a: not a mesh file".to_owned()),
    ] {
        let error = told(at, with);
        assert!(error.starts_with(&message), "{at}: {error}\nwanted: {message}");
    }
    let behind = read_tet_mesh("a", &[&bytes[..], b"\n"].concat(), 1.0).expect_err("a byte more");
    let (all, more) = (bytes.len(), bytes.len() + 1);
    let message = format!("a, byte {all}: bytes: {all} are announced, {more} are there");
    assert!(behind.to_string().starts_with(&message), "{behind}");
    // Nothing but vertices.
    let bare = [&bytes[..COUNTS], &[0; 16]].concat();
    let error = read_tet_mesh("a", &bare, 1.0).expect_err("nothing").to_string();
    assert!(error.starts_with("a: the file has no tetrahedra"), "{error}");
}
