//! Files by other programs: `tests/fixtures/make_meshes.py` writes them with meshio, Gmsh and VTK.

use std::path::{Path, PathBuf};

use viscera::mesh::io::{Format, Mesh, MeshFile, Patch, ReadReport, gmsh};
use viscera::mesh::topology::count_open_edges;
use viscera::mesh::{SurfaceMesh, TetMesh};
use viscera::scalar::vec3;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/meshes")
}

/// A file of the folder, with the one beside it.
pub fn fixture(name: &str) -> MeshFile {
    let load = |name: &str| std::fs::read(folder().join(name));
    MeshFile::load(name, load).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Names of all files that begin so, and of tetrahedra only one of two files.
pub fn fixtures(start: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder()).expect("the folder of fixtures");
    let name = |entry: std::fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
    let mut names: Vec<String> = entries.flatten().map(name).collect();
    names.retain(|name| name.starts_with(start) && !name.ends_with(".node"));
    names.sort();
    names
}

fn tets(name: &str) -> (TetMesh, ReadReport) {
    fixture(name).tets(1.0).unwrap_or_else(|error| panic!("{error}"))
}

/// Two cubes of a quarter of a metre, each six tetrahedra around a diagonal.
fn bar() -> TetMesh {
    let number = |x: u32, y: u32, z: u32| 4 * x + 2 * y + z;
    let mut vertices = Vec::new();
    for x in 0..3 {
        for (y, z) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            vertices.push(vec3(f64::from(x), f64::from(y), f64::from(z)) * 0.25);
        }
    }
    let ring = [(1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1), (1, 0, 1)];
    let (mut tets, mut regions) = (Vec::new(), Vec::new());
    for x in 0..2 {
        let at = ring.map(|(a, b, c)| number(x + a, b, c));
        for i in 0..6 {
            tets.push([number(x, 0, 0), at[i], at[(i + 1) % 6], number(x + 1, 1, 1)]);
            regions.push(5 + x);
        }
    }
    TetMesh::new(vertices, tets, regions).expect("a bar").0
}

#[test]
fn every_coding_of_every_format_gives_the_same_mesh() {
    let expected = bar();
    let names = fixtures("bar");
    assert!(names.len() > 40, "{names:?}");
    for name in names {
        let (mesh, report) = tets(&name);
        assert_eq!(mesh.vertices(), expected.vertices(), "{name}");
        assert_eq!(mesh.tets(), expected.tets(), "{name}");
        // Abaqus names its sets and does not number them: regions count from 1.
        let first = if name.ends_with(".inp") { 1 } else { 5 };
        let regions: Vec<u32> = expected.regions().iter().map(|r| r - 5 + first).collect();
        assert_eq!(mesh.regions(), regions, "{name}");
        assert_eq!(report.repairs, Default::default(), "{name}");
    }
}

#[test]
fn formats_are_told_by_content() {
    let of = |name: &str| tets(name).1.format.expect("a format");
    assert_eq!(of("bar_gmsh22.msh"), Format::Gmsh2);
    assert_eq!(of("bar_gmsh22_binary.msh"), Format::Gmsh2Binary);
    assert_eq!(of("bar_gmsh40_ascii_by_gmsh.msh"), Format::Gmsh4);
    assert_eq!(of("bar_gmsh41_binary_by_gmsh.msh"), Format::Gmsh4Binary);
    assert_eq!(of("bar_vtk51_ascii.vtk"), Format::Vtk);
    assert_eq!(of("bar_vtk42_binary.vtk"), Format::VtkBinary);
    assert_eq!(of("bar.ele"), Format::TetGen);
    assert_eq!(of("bar.mesh"), Format::Medit);
    assert_eq!(of("bar.inp"), Format::Abaqus);
    for name in fixtures("") {
        let mut file = fixture(&name);
        let by_name = file.mesh(1.0).unwrap_or_else(|error| panic!("{error}"));
        if file.beside.is_none() {
            file.name = "mesh.xyz".into();
            assert!(file.mesh(1.0).as_ref() == Ok(&by_name), "{name}");
        }
    }
}

#[test]
fn sets_that_have_names_are_patches_and_regions() {
    for name in fixtures("bar") {
        let report = tets(&name).1;
        // TetGen has none in this file; meshio gives no physical groups of triangles to Medit and Abaqus.
        let expected = match name.rsplit_once('.').expect("an extension").1 {
            "ele" => continue,
            "mesh" => "surface 7",
            _ => "wall",
        };
        let patch = Patch { name: expected.into(), vertices: vec![0, 1, 2, 3] };
        assert_eq!(report.patches, [patch], "{name}");
        if name.ends_with(".msh") {
            assert_eq!(report.region_names, [(5, "left".to_owned())], "{name}");
        }
    }
    let names = [(1, "left".to_owned()), (2, "right".to_owned())];
    assert_eq!(tets("bar.inp").1.region_names, names);
}

/// As VTK writes text beside numbers.
#[test]
fn names_of_regions_are_read_from_field_data() {
    let names = fixtures("named");
    assert_eq!(names.len(), 5, "{names:?}");
    for name in names {
        let (mesh, report) = tets(&name);
        assert_eq!(mesh, bar(), "{name}");
        let regions = [(5, "left lobe".to_owned()), (6, "rest".to_owned())];
        assert_eq!(report.region_names, regions, "{name}");
    }
}

/// As Gmsh exports a box of two volumes: a set of each entity, then its physical groups.
const BY_GMSH: &str = "*Heading\n box.inp\n*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n5, 1, 1, 1\n\
    ******* E L E M E N T S *************\n*ELEMENT, type=T3D2, ELSET=Line3\n1, 1, 2\n\
    *ELEMENT, type=CPS3, ELSET=Surface1\n7, 1, 2, 3\n8, 1, 4, 2\n*ELEMENT, type=CPS3, ELSET=Surface2\n9, 3, 4, 5\n\
    *ELEMENT, type=C3D4, ELSET=Volume1\n11, 1, 2, 3, 4\n*ELEMENT, type=C3D4, ELSET=Volume2\n12, 2, 3, 4, 5\n\
    *ELSET,ELSET=PhysicalSurface1\n7, 8,\n*ELSET,ELSET=outlet\n9,\n*ELSET,ELSET=lobe\n12,\n";

#[test]
fn element_sets_of_abaqus_are_patches_of_surfaces_and_regions_of_solids() {
    let file = MeshFile { name: "box.inp".into(), bytes: BY_GMSH.into(), beside: None };
    let (mesh, report) = file.tets(1.0).unwrap_or_else(|error| panic!("{error}"));
    let patch =
        |name: &str, vertices: &[u32]| Patch { name: name.into(), vertices: vertices.into() };
    let expected = [
        patch("Line3", &[0, 1]),
        patch("Surface1", &[0, 1, 2, 3]),
        patch("Surface2", &[2, 3, 4]),
        patch("PhysicalSurface1", &[0, 1, 2, 3]),
        patch("outlet", &[2, 3, 4]),
    ];
    assert_eq!(report.patches, expected);
    // A group that a person has named counts before the volume that it is made of.
    assert_eq!(mesh.regions(), [4, 8]);
    assert_eq!(report.region_names, [(4, "Volume1".to_owned()), (8, "lobe".to_owned())]);
}

/// Arrays of one tetrahedron with values of each type, under names that are known and others.
#[test]
fn arrays_that_are_not_taken_as_regions_are_told() {
    let vtu = |arrays: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\
             <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>\
             <Cells><DataArray type=\"Int32\" Name=\"connectivity\">0 1 2 3</DataArray>\
             <DataArray type=\"Int32\" Name=\"offsets\">4</DataArray><DataArray type=\"UInt8\" Name=\"types\">10</DataArray>\
             </Cells><CellData>{arrays}</CellData></Piece></UnstructuredGrid></VTKFile>"
        )
    };
    let array = |kind: &str, name: &str, value: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\">{value}</DataArray>")
    };
    let of_vtu = [
        array("Int32", "organ", "3"),
        array("Float32", "stress", "0.5"),
        array("Int32", "vtkOriginalCellIds", "0"),
    ]
    .concat();
    let legacy = |arrays: &str| {
        format!(
            "# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n\
             CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nCELL_DATA 1\n{arrays}"
        )
    };
    let of_vtk = "SCALARS organ int\nLOOKUP_TABLE default\n3\nSCALARS stress float\nLOOKUP_TABLE default\n0.5\n";
    let label = array("Int32", "label", "7");
    let of_vtk_too = of_vtk.to_owned() + "SCALARS label int\nLOOKUP_TABLE default\n7\n";
    for (name, text, region) in [
        ("a.vtu", vtu(&of_vtu), 0),
        ("a.vtu", vtu(&(of_vtu.clone() + &label)), 7),
        ("a.vtk", legacy(of_vtk), 0),
        ("a.vtk", legacy(&of_vtk_too), 7),
    ] {
        let read = viscera::mesh::io::read_tet_mesh(name, text.as_bytes(), 1.0);
        let (mesh, report) = read.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(
            (mesh.regions(), &report.unused_arrays[..]),
            (&[region][..], &["organ".to_owned()][..])
        );
        let summary = viscera::mesh::inspect(&mesh, &report).to_string();
        assert!(summary.contains("cell array `organ` is not used"), "{summary}");
        assert!(summary.contains("gmsh:physical") && summary.contains("region"), "{summary}");
    }
    assert_eq!(tets("bar_vtk_ascii.vtu").1.unused_text(), None);
}

#[test]
fn other_cells_are_cut_into_tetrahedra() {
    for name in fixtures("mixed") {
        let (mesh, report) = tets(&name);
        // A cube, half a cube, a pyramid of height 1 on it, and a tetrahedron beside.
        let volume = 1.0 + 0.5 + 1.0 / 3.0 + 0.25;
        assert!((mesh.volume() - volume).abs() < 1e-14, "{name}: {}", mesh.volume());
        assert_eq!(mesh.tets().len(), 6 + 3 + 2 + 1, "{name}");
        let split: Vec<&str> = report.split.iter().map(|split| split.kind.as_str()).collect();
        let mut sorted = split.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, ["hexahedron", "pyramid", "wedge"], "{name}");
        // Conforming: no face of one lies across two of another.
        let surface = viscera::mesh::boundary_surface(&mesh).surface;
        assert_eq!(count_open_edges(&surface), 0, "{name}");
        assert!((surface.enclosed_volume() - volume).abs() < 1e-14);
    }
}

#[test]
fn second_order_cells_become_straight_and_say_by_how_much() {
    for name in fixtures("curved") {
        let (mesh, report) = tets(&name);
        assert_eq!((mesh.vertices().len(), mesh.tets().len()), (5, 2), "{name}");
        assert!((mesh.volume() - 0.5).abs() < 1e-15, "{name}");
        assert_eq!((report.curved, report.bulge), (2, 0.125), "{name}");
        assert_eq!(report.repairs.removed_vertices.len(), 9, "{name}");
    }
}

fn surface(name: &str) -> SurfaceMesh {
    let read = fixture(name).mesh(1.0).unwrap_or_else(|error| panic!("{error}"));
    match read.0 {
        Mesh::Surface(surface) => surface,
        Mesh::Tets(_) => panic!("{name} has no tetrahedra"),
    }
}

#[test]
fn surfaces_are_closed_and_hold_the_bar() {
    let names = fixtures("shell");
    assert_eq!(names.len(), 8, "{names:?}");
    for name in names {
        let shell = surface(&name);
        assert_eq!((shell.vertices.len(), shell.triangles.len()), (12, 20), "{name}");
        assert_eq!(count_open_edges(&shell), 0, "{name}");
        assert!((shell.enclosed_volume() - 2.0 / 64.0).abs() < 1e-15, "{name}");
        let error = fixture(&name).tets(1.0).expect_err("a surface").to_string();
        assert!(error.contains("20 triangles") && error.contains("tetrahedralize"), "{error}");
    }
    let of_tets = fixture("bar.inp").surface(1.0).expect("triangles").0;
    assert_eq!(of_tets.triangles.len(), 2, "the two that the file lists");
}

/// Version 4.0 as bytes, which no program at hand writes: made of the text by the layout in the manual.
#[test]
fn gmsh_4_0_is_read_as_bytes_in_both_orders() {
    let text = String::from_utf8(fixture("bar_gmsh40_ascii_by_gmsh.msh").bytes).expect("text");
    let expected = tets("bar_gmsh40_ascii_by_gmsh.msh").0;
    for is_big in [false, true] {
        let bytes = as_bytes_of_4_0(&text, is_big);
        let (mesh, report) = viscera::mesh::io::read_tet_mesh("a.msh", &bytes, 1.0)
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(mesh, expected);
        assert_eq!(report.format, Some(Format::Gmsh4Binary));
        assert_eq!(report.patches[0].name, "wall");
    }
}

fn as_bytes_of_4_0(text: &str, is_big: bool) -> Vec<u8> {
    let mut out = Vec::new();
    let put = |out: &mut Vec<u8>, mut bytes: Vec<u8>| {
        if is_big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    let mut section = "";
    // Entries of the block that are still to come, of vertices or of elements.
    let (mut left, mut is_first) = (0, true);
    for line in text.lines() {
        if line.starts_with('$') {
            section = line;
            (left, is_first) = (0, true);
            out.extend(
                format!(
                    "{}{line}\n",
                    if line.starts_with("$End") && section != "$EndPhysicalNames" {
                        "\n"
                    } else {
                        ""
                    }
                )
                .bytes(),
            );
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let int = |word: &str| word.parse::<i32>().expect("a number").to_le_bytes().to_vec();
        let long = |word: &str| word.parse::<u64>().expect("a number").to_le_bytes().to_vec();
        let float = |word: &str| word.parse::<f64>().expect("a number").to_le_bytes().to_vec();
        match section {
            "$MeshFormat" => {
                out.extend(b"4.0 1 8\n");
                put(&mut out, 1i32.to_le_bytes().to_vec());
            }
            "$Entities" if is_first => words.iter().for_each(|w| put(&mut out, long(w))),
            "$Entities" => {
                put(&mut out, int(words[0]));
                words[1..7].iter().for_each(|w| put(&mut out, float(w)));
                let groups: usize = words[7].parse().expect("a count");
                put(&mut out, long(words[7]));
                words[8..8 + groups].iter().for_each(|w| put(&mut out, int(w)));
                put(&mut out, long(words[8 + groups]));
            }
            "$Nodes" | "$Elements" if is_first => {
                words.iter().for_each(|w| put(&mut out, long(w)));
            }
            "$Nodes" | "$Elements" if left == 0 => {
                words[..3].iter().for_each(|w| put(&mut out, int(w)));
                put(&mut out, long(words[3]));
                left = words[3].parse().expect("a count");
            }
            "$Nodes" => {
                put(&mut out, int(words[0]));
                words[1..].iter().for_each(|w| put(&mut out, float(w)));
                left -= 1;
            }
            "$Elements" => {
                words.iter().for_each(|w| put(&mut out, int(w)));
                left -= 1;
            }
            _ => out.extend(format!("{line}\n").bytes()),
        }
        is_first = false;
    }
    out
}

#[test]
fn what_is_written_is_read_again() {
    let mesh = bar();
    let text = gmsh::write(&mesh);
    let back = viscera::mesh::io::read_tet_mesh("a.msh", text.as_bytes(), 1.0).expect("a mesh").0;
    assert_eq!(back, mesh);
    let shell = surface("shell.obj");
    for (name, bytes) in [
        ("a.stl", viscera::mesh::io::stl::write(&shell)),
        ("a.ply", viscera::mesh::io::ply::write(&shell)),
    ] {
        let back = viscera::mesh::io::read_surface(name, &bytes, 1.0).expect("a surface").0;
        // STL lists corners by triangles.
        assert_eq!(back.triangles.len(), shell.triangles.len(), "{name}");
        assert_eq!(back.enclosed_volume(), shell.enclosed_volume(), "{name}");
    }
}
