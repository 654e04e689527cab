//! Mesh files: what is read, what is refused and in which words, what is written.

use viscera::mesh::io::{
    Format, ReadError, ReadProblem, ReadReport, WriteError, gmsh, obj, read_surface, read_tet_mesh,
    vtu,
};
use viscera::mesh::topology::count_open_edges;
use viscera::mesh::{MeshError, SurfaceMesh, TetMesh, boundary_surface, inspect, inspect_surface};
use viscera::scalar::{Vec3, vec3};

const GMSH_1: &str = "$NOD\n5\n10 0 0 0\n20 1 0 0\n30 0 1 0\n7 0 0 1\n40 1 1 1\n$ENDNOD\n\
    $ELM\n3\n1 2 0 0 3 10 20 30\n2 4 5 1 4 10 20 30 7\n3 4 6 1 4 20 30 7 40\n$ENDELM\n";

const GMSH_2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 5 \"liver\"\n\
    $EndPhysicalNames\n$Nodes\n5\n10 0 0 0\n20 1 0 0\n30 0 1 0\n7 0 0 1\n40 1 1 1\n$EndNodes\n\
    $Elements\n3\n1 2 2 0 0 10 20 30\n2 4 2 5 1 10 20 30 7\n3 4 2 6 1 20 30 7 40\n$EndElements\n";

const VTU: &str = r#"<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">
<UnstructuredGrid>
<Piece NumberOfPoints="5" NumberOfCells="3">
<Points>
<DataArray type="Float32" NumberOfComponents="3" format="ascii">
0 0 0
1 0 0  0 1 0
0 0 1
1 1 1
</DataArray>
</Points>
<Cells>
<DataArray type="Int32" Name="connectivity" format="ascii">
0 1 2
0 1 2 3
1 2 3 4
</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">3 7 11</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">5 10 10</DataArray>
</Cells>
<CellData>
<DataArray type="Int32" Name="region" format="ascii">0 5 6</DataArray>
</CellData>
</Piece>
</UnstructuredGrid>
</VTKFile>
"#;

fn read(name: &str, text: &str) -> Result<(TetMesh, ReadReport), ReadError> {
    read_tet_mesh(name, text.as_bytes(), 1.0)
}

fn problem(name: &str, text: &str) -> (Option<usize>, ReadProblem) {
    let error = read(name, text).unwrap_err();
    (error.line(), error.problem)
}

fn sample_surface() -> SurfaceMesh {
    let (mesh, _) = read("cube.msh", GMSH_2).unwrap();
    boundary_surface(&mesh).surface
}

#[test]
fn three_formats_give_the_same_mesh() {
    let (one, report_1) = read("a.msh", GMSH_1).unwrap();
    let (two, report_2) = read("a.msh", GMSH_2).unwrap();
    let (xml, report_3) = read("a.vtu", VTU).unwrap();
    assert_eq!(one, two);
    assert_eq!(one, xml);
    assert_eq!(one.regions(), [5, 6]);
    assert_eq!(
        [report_1.format, report_2.format, report_3.format],
        [Some(Format::Gmsh1), Some(Format::Gmsh2), Some(Format::Vtu)]
    );
    for report in [report_1, report_2, report_3] {
        assert_eq!(report.skipped.len(), 1);
        assert_eq!((report.skipped[0].kind.as_str(), report.skipped[0].count), ("triangle", 1));
    }
}

#[test]
fn content_decides_over_extension() {
    assert_eq!(read("misnamed.vtu", GMSH_1).unwrap().1.format, Some(Format::Gmsh1));
    assert_eq!(read("misnamed.msh", VTU).unwrap().1.format, Some(Format::Vtu));
    assert_eq!(read("no_extension", GMSH_2).unwrap().1.format, Some(Format::Gmsh2));
}

#[test]
fn windows_line_ends_and_byte_order_marks_change_nothing() {
    let expected = read("a.msh", GMSH_1).unwrap().0;
    for text in [GMSH_1, GMSH_2, VTU] {
        let text = format!("\u{feff}{}", text.replace('\n', "\r\n"));
        assert_eq!(read("a", &text).unwrap().0, expected);
    }
}

#[test]
fn unit_scales_to_meters() {
    let (mesh, _) = read_tet_mesh("a.msh", GMSH_1.as_bytes(), 0.032).unwrap();
    assert_eq!(mesh.vertices()[1], vec3(0.032, 0.0, 0.0));
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = read_tet_mesh("a.msh", GMSH_1.as_bytes(), unit).unwrap_err();
        assert!(matches!(error.problem, ReadProblem::Unit { .. }), "{error}");
    }
    let error = read_tet_mesh("a.msh", GMSH_1.as_bytes(), 1e300).unwrap_err();
    assert!(matches!(error.problem, ReadProblem::Mesh(MeshError::TooFar { .. })), "{error}");
}

#[test]
fn errors_name_file_line_and_next_move() {
    let error = read("liver.msh", &GMSH_1.replace("20 30 7 40\n", "20 30 7 1203\n")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "liver.msh, line 13: tetrahedron 3 refers to vertex 1203; the file has 5, numbered \
         7 to 40; export all vertices"
    );
    let error = read("liver.vtu", &VTU.replace("1 2 3 4", "1 2 3 5")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "liver.vtu, line 17: tetrahedron 1 refers to vertex 5; the mesh has 5 (counting from 0)"
    );
}

#[test]
fn empty_file_says_so() {
    for text in ["", "\n \r\n\t"] {
        for name in ["a.msh", "a.vtu", "a.obj"] {
            assert_eq!(problem(name, text), (None, ReadProblem::Empty));
            let error = read_surface(name, text.as_bytes(), 1.0).unwrap_err();
            assert_eq!(error.problem, ReadProblem::Empty);
        }
    }
}

#[test]
fn two_billion_claimed_vertices_allocate_nothing() {
    let text = GMSH_1.replace("$NOD\n5\n", "$NOD\n2000000000\n");
    let (line, found) = problem("a.msh", &text);
    assert_eq!(line, Some(2));
    assert!(matches!(found, ReadProblem::TooManyClaimed { claimed: 2_000_000_000, .. }));
    let text = GMSH_2.replace("$Elements\n3\n", "$Elements\n18446744073709551615\n");
    assert!(matches!(problem("a.msh", &text).1, ReadProblem::TooManyClaimed { .. }));
    for (from, line) in [("NumberOfPoints=\"5\"", 4), ("NumberOfCells=\"3\"", 19)] {
        let to = from.replace(['5', '3'], "2000000000");
        let (at, found) = problem("a.vtu", &VTU.replace(from, &to));
        assert_eq!(at, Some(line));
        assert!(matches!(found, ReadProblem::CountMismatch { .. }));
    }
}

#[test]
fn nan_coordinate_is_named_with_its_line() {
    let expected = ReadProblem::Mesh(MeshError::NonFinite { vertex: 2 });
    assert_eq!(problem("a.msh", &GMSH_1.replace("30 0 1 0", "30 0 nan 0")).0, Some(5));
    assert_eq!(problem("a.msh", &GMSH_1.replace("30 0 1 0", "30 0 nan 0")).1, expected);
    assert_eq!(problem("a.vtu", &VTU.replace("  0 1 0", "  0 NaN 0")), (Some(8), expected.clone()));
    let error = read_surface("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n", 1.0).unwrap_err();
    assert_eq!((error.line(), error.problem), (Some(3), expected));
}

#[test]
fn negative_index_is_named_with_its_line() {
    for (name, text, line) in [
        ("a.msh", GMSH_1.replace("4 10 20 30 7", "4 10 -20 30 7"), 12),
        ("a.msh", GMSH_2.replace("1 10 20 30 7", "1 10 20 30 -7"), 19),
        ("a.vtu", VTU.replace("0 1 2 3", "0 1 -2 3"), 16),
    ] {
        let (at, found) = problem(name, &text);
        assert_eq!(at, Some(line));
        assert!(matches!(found, ReadProblem::BadWord { .. }), "{found}");
    }
}

#[test]
fn repeated_tet_is_named_with_its_line() {
    let expected = ReadProblem::Mesh(MeshError::RepeatedTet { tet: 1, first: 0 });
    let text = GMSH_1.replace("20 30 7 40\n", "7 20 30 10\n");
    assert_eq!(problem("a.msh", &text), (Some(13), expected.clone()));
    assert_eq!(problem("a.vtu", &VTU.replace("1 2 3 4", "3 2 1 0")), (Some(17), expected));
}

#[test]
fn flat_tet_is_named_with_its_line() {
    let (line, found) = problem("a.msh", &GMSH_1.replace("40 1 1 1", "40 0.3 0.3 0.4"));
    assert_eq!(line, Some(13));
    assert!(matches!(found, ReadProblem::Mesh(MeshError::FlatTet { tet: 1, .. })), "{found}");
}

#[test]
fn inverted_tets_are_repaired_and_reported() {
    let text = GMSH_1.replace("10 20 30 7\n", "20 10 30 7\n").replace("20 30 7 40", "30 20 7 40");
    let (mesh, report) = read("a.msh", &text).unwrap();
    assert_eq!(report.repairs.rewound_tets, 2);
    assert_eq!(mesh.volume(), read("a.msh", GMSH_1).unwrap().0.volume());
}

#[test]
fn wrong_counts_are_refused() {
    for text in [
        GMSH_1.replace("$NOD\n5\n", "$NOD\n4\n"),
        GMSH_1.replace("$NOD\n5\n", "$NOD\n6\n"),
        GMSH_2.replace("$Elements\n3\n", "$Elements\n2\n"),
        VTU.replace("NumberOfPoints=\"5\"", "NumberOfPoints=\"4\""),
        VTU.replace("NumberOfCells=\"3\"", "NumberOfCells=\"4\""),
        VTU.replace("3 7 11", "3 7 12"),
        VTU.replace("3 7 11", "3 2 11"),
        VTU.replace("5 10 10", "5 10"),
        VTU.replace("0 5 6", "0 5"),
    ] {
        let error = read("a", &text).unwrap_err();
        assert!(error.line().is_some(), "{error}");
    }
}

#[test]
fn lines_are_counted_across_comments_and_windows_line_ends() {
    let commented = VTU.replace("0 0 1\n", "0 0 1 <!-- a\ncomment -->\n");
    assert_eq!(read("a.vtu", &commented).unwrap().0, read("a.vtu", VTU).unwrap().0);
    let bad = commented.replace("1 1 1\n", "1 x 1\n");
    for text in [bad.replace('\n', "\r\n"), bad] {
        assert_eq!(problem("a.vtu", &text).0, Some(11));
    }
}

#[test]
fn grid_without_regions_is_region_zero() {
    let (mesh, _) = read("a.vtu", &VTU.replace("\"region\"", "\"pressure\"")).unwrap();
    assert_eq!(mesh.regions(), [0, 0]);
}

#[test]
fn repeated_vertex_number_is_refused() {
    let found = problem("a.msh", &GMSH_1.replace("40 1 1 1", "20 1 1 1"));
    assert_eq!(found, (Some(7), ReadProblem::RepeatedNumber { number: 20 }));
}

#[test]
fn surface_elements_alone_are_refused_with_what_is_there() {
    let lines = GMSH_2.replace("2 4 2 5 1 10 20 30 7", "2 1 2 5 1 10 20");
    let lines = lines.replace("3 4 2 6 1 20 30 7 40", "3 15 2 6 1 20");
    let error = read("a.msh", &lines).unwrap_err().to_string();
    assert!(error.contains("a surface of 1 triangles") && error.contains("tetrahedralize"));
    let error = read("a.msh", &lines.replace("1 2 2 0 0 10 20 30", "1 137 2 0 0 10")).unwrap_err();
    let expected = "(it has 1 x element of type 137, 1 x line, 1 x point)";
    assert!(error.to_string().contains(expected), "{error}");
}

#[test]
fn variants_that_are_not_read_say_how_to_convert() {
    let gmsh_5 = "$MeshFormat\n5.0 0 8\n$EndMeshFormat\n";
    let kind = "type=\"UnstructuredGrid\"";
    let lz4 = VTU.replacen(kind, &format!("{kind} compressor=\"vtkLZ4DataCompressor\""), 1);
    let vtk_legacy = "# vtk DataFile Version 3.0\nat\nASCII\nDATASET STRUCTURED_GRID\n";
    let elsewhere = "*HEADING\n*INCLUDE, INPUT=mesh.inp\n";
    let image = VTU.replace("UnstructuredGrid", "ImageData");
    for (name, text, advice) in [
        ("a.msh", gmsh_5, "4.1"),
        ("a.vtu", &lz4, "ZLib"),
        ("a.vtk", vtk_legacy, "unstructured"),
        ("a.vti", &image, "unstructured"),
        ("a.obj", "v 0 0 0\n", "faces"),
        ("a.ply", "ply\nformat ascii 1.0\n", "cut short"),
        ("a.ele", "1 4 0\n1 1 2 3 4\n", "a.node"),
        ("a.inp", elsewhere, "one file"),
        ("a.meshb", "\u{1}\0\0\0", "text"),
        ("a.msh.gz", "\u{1f}\u{0}", "known"),
    ] {
        let error = read(name, text).unwrap_err().to_string();
        assert!(error.starts_with(name) && error.contains(advice), "{error}");
    }
    let error = read_tet_mesh("a.msh.gz", b"\x1f\x8b\x08\0", 1.0).unwrap_err();
    assert!(error.to_string().contains("unpack"), "{error}");
}

#[test]
fn obj_reads_every_way_to_name_a_vertex() {
    let text = "# comment \u{e9}\nmtllib a.mtl\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\n\
        vn 0 0 1\nvt 0 0\ng front\ns 1\nf 1 2 3 4\nf 1/1 3/1 4/1\nf 1//1 3//1 4//1\n\
        f 1/1/1 3/1/1 4/1/1\nf -4 -2 -1\nf 1 1 2\n";
    let (surface, report) = read_surface("a.obj", text.as_bytes(), 2.0).unwrap();
    assert_eq!(surface.vertices[2], vec3(2.0, 2.0, 0.0));
    assert_eq!(surface.triangles[0], [0, 1, 2]);
    for triangle in &surface.triangles[1..] {
        assert_eq!(triangle, &[0, 2, 3]);
    }
    assert_eq!(surface.triangles.len(), 6);
    assert_eq!(report.skipped[0].count, 1);
    // Bytes that are no text are fine where they do not matter.
    let latin = text.replace('\u{e9}', "?").into_bytes();
    let latin: Vec<u8> = latin.iter().map(|&b| if b == b'?' { 0xe9 } else { b }).collect();
    assert_eq!(read_surface("a.obj", &latin, 2.0).unwrap().0, surface);
}

#[test]
fn obj_refuses_faces_that_name_no_vertex() {
    for face in
        ["1 2 4", "1 2 0", "1 2 -4", "1 2", "", "1 2 x", "1 2 /3", "1 2 99999999999999999999"]
    {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {face}\n");
        let error = read_surface("a.obj", text.as_bytes(), 1.0).unwrap_err();
        assert_eq!(error.line(), Some(4), "{error}");
    }
    let error = read_surface("a.obj", b"v 0 0 0\n", 1.0).unwrap_err();
    assert!(matches!(error.problem, ReadProblem::Missing { .. }), "{error}");
}

#[test]
fn gmsh_round_trip_is_exact() {
    let thirds = |x: Vec3<f64>| x * (1.0 / 3.0);
    let (mesh, _) = read("a.msh", GMSH_2).unwrap();
    let vertices = mesh.vertices().iter().map(|&x| thirds(x)).collect();
    let mesh = TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec()).unwrap().0;
    assert_eq!(read("b.msh", &gmsh::write(&mesh)).unwrap().0, mesh);
}

#[test]
fn vtu_round_trip_keeps_single_precision() {
    let (mesh, _) = read("a.msh", GMSH_2).unwrap();
    let vertices: Vec<Vec3<f32>> =
        mesh.vertices().iter().map(|&x| (x * (1.0 / 3.0)).cast::<f32>()).collect();
    let displacement = vec![vec3(1e-7f32, -2.5e20, 0.0); 5];
    let bytes = vtu::write(
        &vertices,
        mesh.tets(),
        &[vtu::Array::vectors("displacement <\"&>", &displacement)],
        &[vtu::Array::integers("region", mesh.regions()), vtu::Array::scalars("J", &[1.0f64, 0.1])],
    )
    .unwrap();
    let (back, _) = read_tet_mesh("b.vtu", &bytes, 1.0).unwrap();
    let back_single: Vec<Vec3<f32>> = back.vertices().iter().map(|x| x.cast()).collect();
    assert_eq!(back_single, vertices);
    assert_eq!((back.tets(), back.regions()), (mesh.tets(), mesh.regions()));
    let numbers = displacement.iter().flat_map(|u| u.to_array()).flat_map(f32::to_le_bytes);
    let numbers: Vec<u8> = numbers.collect();
    assert!(bytes.windows(numbers.len()).any(|window| window == numbers));
}

/// As other programs write appended data: 32-bit lengths, other types of numbers, blanks around.
#[test]
fn appended_data_of_other_programs_is_read() {
    let mut data = Vec::new();
    let mut offsets = Vec::new();
    let mut push = |bytes: Vec<u8>| {
        offsets.push(data.len());
        data.extend((bytes.len() as u32).to_le_bytes());
        data.extend(bytes);
    };
    let points = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0f64];
    push(points.iter().flat_map(|x| x.to_le_bytes()).collect());
    push([0i64, 1, 2, 0, 1, 2, 3, 1, 2, 3, 4].iter().flat_map(|v| v.to_le_bytes()).collect());
    push([3i16, 7, 11].iter().flat_map(|v| v.to_le_bytes()).collect());
    push(vec![5, 10, 10]);
    let [points, corners, ends, types] = offsets[..] else { panic!("four arrays") };
    let head = |regions: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\">\n<UnstructuredGrid>\
             <Piece NumberOfPoints=\"5\" NumberOfCells=\"3\"><Points>\
             <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"appended\" offset=\"{points}\"/>\
             </Points><Cells>\
             <DataArray type=\"Int64\" Name=\"connectivity\" format=\"appended\" offset=\"{corners}\"/>\
             <DataArray type=\"Int16\" Name=\"offsets\" format=\"appended\" offset=\"{ends}\"/>\
             <DataArray type=\"UInt8\" Name=\"types\" format=\"appended\" offset=\"{types}\"/>\
             </Cells><CellData>\n{regions}\n</CellData></Piece></UnstructuredGrid>\n  \
             <AppendedData encoding=\"raw\">\n   _"
        )
    };
    let file =
        |head: String| [head.as_bytes(), &data, b"\n  </AppendedData>\n</VTKFile>\n"].concat();
    let text = "<DataArray type=\"Int32\" Name=\"region\" format=\"ascii\">0 5 6</DataArray>";
    let (mesh, _) = read_tet_mesh("a.vtu", &file(head(text)), 1.0).unwrap();
    assert_eq!(mesh, read("a.vtu", VTU).unwrap().0);
    let float = format!(
        "<DataArray type=\"Float64\" Name=\"region\" format=\"appended\" offset=\"{ends}\"/>"
    );
    for (bytes, expected) in [
        (file(head(&float)), "part of a number"),
        (file(head(&text.replace("5", "5.5"))), "expected a region"),
        (file(head(text).replace("LittleEndian", "BigEndian")), "cut short"),
        (file(head(text).replace("byte_order", "compressor=\"z\" byte_order")), "compressed"),
        (file(head(text).replace("Int16", "Float16")), "found `Float16`"),
        (file(head(text).replace("Int16", "Int32")), "part of a number"),
        (file(head(text).replace(&format!("offset=\"{ends}\""), "offset=\"9999\"")), "cut short"),
        (file(head(text).replace(&format!("offset=\"{ends}\""), "offset=\"-1\"")), "an offset"),
    ] {
        let error = read_tet_mesh("a.vtu", &bytes, 1.0).unwrap_err();
        assert!(error.to_string().contains(expected), "{expected}: {error}");
        assert!(error.line().is_some() && error.line() < Some(6), "{error}");
    }
}

/// Frames share what stays, and are the files that are written one by one.
#[test]
fn frames_of_a_grid_are_whole_files() {
    let (mesh, _) = read("a.msh", GMSH_2).unwrap();
    let regions = vtu::Array::integers("region", mesh.regions());
    let grid = vtu::Grid::of_tets(5, mesh.tets(), vec![regions.clone()]).unwrap();
    for scale in [1.0, 2.0] {
        let points: Vec<Vec3<f64>> = mesh.vertices().iter().map(|&x| x * scale).collect();
        let volumes = vtu::Array::scalars("J", &[1.0, scale]);
        let parts = grid.frame(&points, vec![], vec![volumes.clone()]).unwrap();
        let alone = vtu::write(&points, mesh.tets(), &[], &[volumes.clone(), regions.clone()]);
        assert_eq!(parts.concat(), alone.unwrap());
    }
    let error = grid.frame(&mesh.vertices()[..4], vec![], vec![]).unwrap_err();
    assert!(matches!(error, WriteError::Length { wanted: 5, found: 4, .. }), "{error}");
    let error = vtu::Grid::of_tets(5, mesh.tets(), vec![vtu::Array::integers("region", &[1])]);
    assert!(matches!(error, Err(WriteError::Length { wanted: 2, found: 1, .. })));
}

#[test]
fn surface_grid_is_well_formed_and_holds_triangles() {
    let surface = sample_surface();
    let bytes = vtu::write_surface(&surface.vertices, &surface.triangles, &[], &[]).unwrap();
    let error = read_tet_mesh("surface.vtu", &bytes, 1.0).unwrap_err();
    let triangles = surface.triangles.len();
    assert_eq!(error.problem, ReadProblem::OnlySurface { format: Format::Vtu, triangles });
    let (back, _) = read_surface("surface.vtu", &bytes, 1.0).unwrap();
    assert_eq!(back, surface);
}

#[test]
fn arrays_that_do_not_fit_are_not_written() {
    let (mesh, _) = read("a.msh", GMSH_2).unwrap();
    let write = |array| vtu::write(mesh.vertices(), mesh.tets(), &[array], &[]).unwrap_err();
    let error = write(vtu::Array::scalars("speed", &[1.0f32]));
    assert!(matches!(error, WriteError::Length { wanted: 5, found: 1, .. }), "{error}");
    let mut mixed = vtu::Array::with_room::<1>("speed", 5);
    (0..4).for_each(|_| mixed.push([1.0]));
    mixed.push([1.0, 2.0, 3.0]);
    let error = write(mixed);
    assert!(matches!(error, WriteError::Length { wanted: 5, found: 7, .. }), "{error}");
    for bad in [f64::NAN, 1e300] {
        let error = write(vtu::Array::scalars("speed", &[0.0, 0.0, bad, 0.0, 0.0]));
        assert_eq!(error, WriteError::NonFinite { array: "speed".into(), entry: 2 });
    }
    let error = vtu::write(mesh.vertices(), &[[0, 1, 2, 9]], &[], &[]).unwrap_err();
    assert!(matches!(error, WriteError::IndexOutOfRange { point: 9, .. }), "{error}");
    let surface = sample_surface();
    assert!(obj::write(&surface, Some(&[])).is_err());
}

#[test]
fn obj_round_trip_is_exact() {
    let mut surface = sample_surface();
    for vertex in &mut surface.vertices {
        *vertex = *vertex * (1.0 / 3.0);
    }
    let normals = vec![vec3(0.0, 0.0, 1.0); surface.vertices.len()];
    for normals in [None, Some(&normals[..])] {
        let text = obj::write(&surface, normals).unwrap();
        assert_eq!(read_surface("b.obj", text.as_bytes(), 1.0).unwrap().0, surface);
    }
}

/// The bytes of a real mesh, or none where the data folder is not at hand.
fn anatomy(name: &str) -> Option<Vec<u8>> {
    crate::common::data::data_folder().map(|folder| std::fs::read(folder.join(name)).unwrap())
}

#[test]
fn liver_loads_at_life_size() {
    let Some(bytes) = anatomy("liver_coarse.msh") else { return };
    let (mesh, report) = read_tet_mesh("liver_coarse.msh", &bytes, 0.032).unwrap();
    let summary = inspect(&mesh, &report);
    println!("{summary}");
    assert_eq!((summary.vertex_count, summary.tet_count), (181, 596));
    assert_eq!(summary.components.len(), 1);
    // 36.6 cubic units of 32 mm, as the data's description says.
    assert!((summary.volume / (36.6 * 0.032f64.powi(3)) - 1.0).abs() < 0.01);
    assert_eq!(open_edge_count(&mesh), 0);
}

#[test]
fn liver_surface_is_closed() {
    let Some(bytes) = anatomy("liver_surface.obj") else { return };
    let (surface, report) = read_surface("liver_surface.obj", &bytes, 0.032).unwrap();
    let summary = inspect_surface(&surface, &report);
    println!("{summary}");
    assert_eq!((summary.vertex_count, summary.triangle_count), (2194, 4384));
    assert_eq!(summary.open_edge_count, 0);
    assert!(summary.volume > 0.0);
}

#[test]
fn tongue_loads_with_its_poor_tets() {
    let Some(bytes) = anatomy("tongue.vtu") else { return };
    let (mesh, report) = read_tet_mesh("tongue.vtu", &bytes, 0.03).unwrap();
    let summary = inspect(&mesh, &report);
    println!("{summary}");
    assert_eq!((summary.vertex_count, summary.tet_count), (2238, 10980));
    assert!(summary.quality.worst > 0.0);
    assert_eq!(open_edge_count(&mesh), 0);
}

/// Open edges of the boundary; none, for the boundary of a volume has no boundary.
fn open_edge_count(mesh: &TetMesh) -> usize {
    count_open_edges(&boundary_surface(mesh).surface)
}
