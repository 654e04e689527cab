//! Files that are written: read again as they were, and valid for others.

use std::time::{Duration, Instant};

use serde_json::Value;
use viscera::mesh::io::gltf::{self, Surface};
use viscera::mesh::io::{
    Format, MeshNames, Patch, ReadReport, WriteError, gmsh, obj, ply, pvd, read_surface,
    read_tet_mesh, stl, vtk, vtu,
};
use viscera::mesh::{SurfaceMesh, TetMesh, boundary_surface};
use viscera::scalar::{Vec3, vec3};

/// Cubes in a row of this number each way, six tetrahedra each, of two regions that alternate.
fn cubes(count: u32) -> TetMesh {
    let across = count + 1;
    let number = |x: u32, y: u32, z: u32| (x * across + y) * across + z;
    let mut vertices = Vec::new();
    for (x, y) in (0..across).flat_map(|x| (0..across).map(move |y| (x, y))) {
        vertices.extend((0..across).map(|z| vec3(f64::from(x), f64::from(y), f64::from(z)) * 0.3));
    }
    let ring = [(1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1), (1, 0, 1)];
    let (mut tets, mut regions) = (Vec::new(), Vec::new());
    for (x, y) in (0..count).flat_map(|x| (0..count).map(move |y| (x, y))) {
        for z in 0..count {
            let at = ring.map(|(a, b, c)| number(x + a, y + b, z + c));
            for i in 0..6 {
                tets.push([number(x, y, z), at[i], at[(i + 1) % 6], number(x + 1, y + 1, z + 1)]);
                regions.push(7 * (x % 2));
            }
        }
    }
    TetMesh::new(vertices, tets, regions).expect("cubes").0
}

/// A side, of which triangles are known, and vertices that no triangle joins.
fn patches(mesh: &TetMesh) -> Vec<Patch> {
    let of = |name: &str, inside: &dyn Fn(Vec3<f64>) -> bool| {
        let vertices = (0u32..).zip(mesh.vertices()).filter(|(_, x)| inside(**x)).map(|(v, _)| v);
        Patch { name: name.into(), vertices: vertices.collect() }
    };
    vec![of("left wall", &|x| x.x == 0.0), of("line", &|x| x.y == 0.0 && x.z == 0.0)]
}

fn sorted(mut report: ReadReport) -> ReadReport {
    report.patches.sort_by(|a, b| a.name.cmp(&b.name));
    report
}

#[test]
fn tetrahedra_regions_and_patches_are_read_again_as_they_were() {
    let mesh = cubes(3);
    let patches = patches(&mesh);
    let regions = vec![(0, "größer & <b>".to_owned()), (7, "lobe \"a\" %20".to_owned())];
    let names = MeshNames { patches: patches.clone(), regions };
    let gmsh = gmsh::write_binary(&mesh, &names).expect("a file");
    let vtk = vtk::write(&mesh, &names).expect("a file");
    // Places in single precision.
    let single = mesh.vertices().iter().map(|x| x.cast::<f32>().cast()).collect();
    let single = TetMesh::new(single, mesh.tets().to_vec(), mesh.regions().to_vec());
    let vtu = vtu::write_mesh(&mesh, &names).expect("a file");
    for (name, bytes, format) in [
        ("a.msh", gmsh, Format::Gmsh4Binary),
        ("a.vtk", vtk, Format::VtkBinary),
        ("a.vtu", vtu, Format::Vtu),
    ] {
        let (back, report) =
            read_tet_mesh(name, &bytes, 1.0).unwrap_or_else(|error| panic!("{error}"));
        let report = sorted(report);
        let expected = if name == "a.vtu" { &single.as_ref().expect("cubes").0 } else { &mesh };
        assert!(back == *expected, "{name}");
        assert_eq!(report.format, Some(format));
        let mut found = report.names();
        if name == "a.msh" {
            assert_eq!(found.regions[1].1, "lobe 'a' %20");
            found.regions[1].1.clone_from(&names.regions[1].1);
        }
        assert_eq!(found, names, "{name}");
        for end in 0..bytes.len() {
            let cut = read_tet_mesh(name, &bytes[..end], 1.0);
            // Without its patches, or without a line end, a legacy file is whole.
            assert!(cut.is_err() || format == Format::VtkBinary || end + 1 == bytes.len(), "{end}");
        }
    }
}

#[test]
fn surfaces_are_read_again_as_they_were() {
    let mesh = boundary_surface(&cubes(2)).surface;
    let text = obj::write(&mesh, None).expect("a file").into_bytes();
    let vtk = vtk::write_surface(&mesh).expect("a file");
    for (name, bytes) in [("a.obj", text), ("a.ply", ply::write(&mesh)), ("a.vtk", vtk)] {
        let back = read_surface(name, &bytes, 1.0).unwrap_or_else(|error| panic!("{error}")).0;
        assert!(back == mesh, "{name}");
    }
    let corners = |mesh: &SurfaceMesh| -> Vec<Vec3<f32>> {
        mesh.triangles.as_flattened().iter().map(|&v| mesh.vertices[v as usize].cast()).collect()
    };
    let back = read_surface("a.stl", &stl::write(&mesh), 1.0).expect("a surface").0;
    assert_eq!(corners(&back), corners(&mesh));
    assert_eq!(back.vertices.len(), mesh.vertices.len());
}

#[test]
fn what_has_no_room_in_a_format_is_refused() {
    let mesh = cubes(1);
    let patches = vec![Patch { name: "a".into(), vertices: vec![3, 8] }];
    let names = MeshNames { patches, ..MeshNames::default() };
    for error in [
        gmsh::write_binary(&mesh, &names).expect_err("a vertex too many"),
        vtk::write(&mesh, &names).expect_err("a vertex too many"),
        vtu::write_mesh(&mesh, &names).expect_err("a vertex too many"),
    ] {
        assert_eq!(error.to_string(), "patch `a` has vertex 8; the mesh has 8");
    }
    let regions = vec![u32::MAX; mesh.tets().len()];
    let mesh = TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), regions).expect("ok").0;
    let error = gmsh::write_binary(&mesh, &MeshNames::default()).expect_err("a region").to_string();
    assert!(error.starts_with("region 4294967295 has no room in Gmsh files"), "{error}");
    assert!(vtk::write(&mesh, &MeshNames::default()).is_ok());
}

#[test]
fn series_lists_every_frame_with_its_time() {
    let text = pvd::write(&[(0.0, "frame_0.vtu"), (0.1, "a&b.vtu")]);
    assert!(text.contains(r#"<DataSet timestep="0.1" part="0" file="a&amp;b.vtu"/>"#), "{text}");
    assert_eq!(text.matches("<DataSet").count(), 2);
}

/// Reads a mesh of so many cubes each way in every compact format, and says how long it takes.
fn read_large(count: u32, longest: Duration) {
    let mesh = cubes(count);
    let regions = vtu::Array::integers("region", mesh.regions());
    let points: Vec<Vec3<f32>> = mesh.vertices().iter().map(|x| x.cast()).collect();
    let names = MeshNames { patches: patches(&mesh), ..MeshNames::default() };
    for (name, bytes) in [
        ("a.vtu", vtu::write(&points, mesh.tets(), &[], &[regions]).expect("a file")),
        ("a.msh", gmsh::write_binary(&mesh, &names).expect("a file")),
        ("a.vtk", vtk::write(&mesh, &names).expect("a file")),
    ] {
        let start = Instant::now();
        let (back, _) = read_tet_mesh(name, &bytes, 1.0).unwrap_or_else(|error| panic!("{error}"));
        let took = start.elapsed();
        let (tets, size) = (back.tets().len(), bytes.len() / 1_000_000);
        println!("{name}: {tets} tetrahedra, {size} MB, {took:.2?}");
        assert!(back.tets() == mesh.tets() && back.regions() == mesh.regions(), "{name}");
        assert!(took < longest, "{name}: {took:?}");
    }
}

#[test]
fn large_files_are_read_soon() {
    read_large(10, Duration::from_secs(1));
}

#[test]
#[ignore = "slow: a million tetrahedra"]
fn large_files_are_read_soon_at_length() {
    // A second, but for what tests check beside.
    let longest = if cfg!(debug_assertions) { 5 } else { 1 };
    read_large(55, Duration::from_secs(longest));
}

/// The JSON and the bytes of a `.glb` file.
fn open(file: &[u8]) -> (Value, &[u8]) {
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("four bytes"));
    assert_eq!((&file[..4], word(4), word(8) as usize), (&b"glTF"[..], 2, file.len()));
    let json = word(12) as usize;
    assert_eq!((&file[16..20], json % 4), (&b"JSON"[..], 0));
    let value = serde_json::from_slice(&file[20..20 + json]).expect("JSON");
    let rest = &file[20 + json..];
    if rest.is_empty() {
        return (value, rest);
    }
    assert_eq!((&rest[4..8], rest.len() % 4), (&b"BIN\0"[..], 0));
    assert_eq!(word(20 + json) as usize, rest.len() - 8);
    (value, &rest[8..])
}

/// Numbers of an accessor, after a look at its bounds.
fn values(json: &Value, bytes: &[u8], accessor: &Value) -> Vec<f32> {
    let accessor = &json["accessors"][accessor.as_u64().expect("an index") as usize];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().expect("an index") as usize];
    let number = |value: &Value| value.as_u64().expect("a number") as usize;
    let (start, length) = (number(&view["byteOffset"]), number(&view["byteLength"]));
    let width = if accessor["type"] == "VEC3" { 3 } else { 1 };
    assert_eq!((length, start % 4), (4 * width * number(&accessor["count"]), 0));
    let (words, _) = bytes[start..start + length].as_chunks::<4>();
    let is_float = accessor["componentType"] == 5126;
    let value = |word: &[u8; 4]| match is_float {
        true => f32::from_le_bytes(*word),
        false => u32::from_le_bytes(*word) as f32,
    };
    let values: Vec<f32> = words.iter().map(value).collect();
    for (bound, pick) in [("min", f32::min as fn(f32, f32) -> f32), ("max", f32::max)] {
        let Some(bounds) = accessor.get(bound) else { continue };
        for axis in 0..width {
            let found = values.chunks(width).map(|entry| entry[axis]).reduce(pick);
            let found = found.expect("an entry");
            assert_eq!(bounds[axis].as_f64().map(|value| value as f32), Some(found), "{bound}");
        }
    }
    values
}

#[test]
fn a_moving_surface_is_where_it_was_in_every_frame_of_its_file() {
    let shell = boundary_surface(&cubes(2)).surface;
    let rest: Vec<Vec3<f32>> = shell.vertices.iter().map(|x| x.cast()).collect();
    let moved = |k: f32| rest.iter().map(move |x| vec3(x.x + k * x.z * x.z, x.y, x.z - 0.1 * k));
    let frames: Vec<Vec<Vec3<f32>>> = [0.0, 0.5, 1.0].map(|k| moved(k).collect()).to_vec();
    let times = [0.0, 0.25, 1.5];
    let surface = Surface {
        name: "liver \"left\" \\ \n",
        color: [0.5, 0.1, 0.1, 0.9],
        triangles: &shell.triangles,
        rest: &rest,
        frames: &frames,
    };
    let second = Surface { name: "other", ..surface };
    let file = gltf::write(&times, &[surface, second]).expect("a file");
    let (json, bytes) = open(&file);
    assert_eq!(json["asset"]["version"], "2.0");
    for (at, node) in [(0, "liver \"left\" \\ ?"), (1, "other")] {
        assert_eq!(
            (&json["nodes"][at]["name"], &json["nodes"][at]["mesh"]),
            (&node.into(), &at.into())
        );
    }
    // A turn that takes z to y.
    let turn: Vec<f64> =
        serde_json::from_value(json["nodes"][2]["rotation"].clone()).expect("four");
    let (axis, w) = (vec3(turn[0], turn[1], turn[2]), turn[3]);
    let z = vec3(0.0, 0.0, 1.0);
    let turned = z + axis.cross(axis.cross(z) + z * w) * 2.0;
    assert!((turned - vec3(0.0, 1.0, 0.0)).length() < 1e-15, "{turned:?}");
    assert_eq!(json["scenes"][0]["nodes"][0], 2);

    let part = &json["meshes"][1]["primitives"][0];
    let corners = values(&json, bytes, &part["indices"]);
    let expected = shell.triangles.as_flattened().iter().map(|&vertex| vertex as f32);
    assert!(corners.into_iter().eq(expected));
    let at_rest = values(&json, bytes, &part["attributes"]["POSITION"]);
    let normals = values(&json, bytes, &part["attributes"]["NORMAL"]);
    let sampler = &json["animations"][0]["samplers"][0];
    assert_eq!(values(&json, bytes, &sampler["input"]), times);
    let weights = values(&json, bytes, &sampler["output"]);
    for (frame, positions) in frames.iter().enumerate() {
        let of_frame = &weights[3 * frame..3 * frame + 3];
        let (mut x, mut n) = (at_rest.clone(), normals.clone());
        for (target, weight) in part["targets"].as_array().expect("targets").iter().zip(of_frame) {
            for (sum, name) in [(&mut x, "POSITION"), (&mut n, "NORMAL")] {
                let moves = values(&json, bytes, &target[name]);
                sum.iter_mut().zip(moves).for_each(|(sum, d)| *sum += weight * d);
            }
        }
        let expected = positions.iter().flat_map(|x| x.to_array());
        // A difference and a sum are rounded once each.
        assert!(x.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 2.0 * f32::EPSILON));
        for n in n.as_chunks::<3>().0 {
            let length = n.iter().map(|value| value * value).sum::<f32>();
            assert!((length - 1.0).abs() < 8.0 * f32::EPSILON, "{length}");
        }
    }
}

#[test]
fn a_surface_without_frames_stands_still_and_a_scene_may_be_empty() {
    let rest = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), Vec3::ZERO];
    let triangles = [[0, 1, 2]];
    let surface =
        Surface { name: "", color: [1.0; 4], triangles: &triangles, rest: &rest, frames: &[] };
    let file = gltf::write(&[], &[surface]).expect("a file");
    let (json, bytes) = open(&file);
    assert!(json.get("animations").is_none());
    let part = &json["meshes"][0]["primitives"][0];
    assert!(part.get("targets").is_none());
    assert_eq!(json["materials"][0]["alphaMode"], "OPAQUE");
    // A vertex of no triangle has a normal too.
    let normals = values(&json, bytes, &part["attributes"]["NORMAL"]);
    assert_eq!(normals, [0.0, 0.0, 1.0].repeat(4));
    let file = gltf::write(&[0.0], &[]).expect("a file");
    let (json, bytes) = open(&file);
    assert!(bytes.is_empty() && json.get("meshes").is_none());
}

#[test]
fn surfaces_that_viewers_refuse_are_not_written() {
    let rest = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
    let frames = [rest.to_vec()];
    let good = Surface {
        name: "a",
        color: [1.0; 4],
        triangles: &[[0, 1, 2]],
        rest: &rest,
        frames: &frames,
    };
    assert!(gltf::write(&[0.5], &[good]).is_ok());
    let error = |times: &[f32], surface| gltf::write(times, &[surface]).expect_err("no file");
    assert_eq!(error(&[-0.5], good), WriteError::Time { frame: 0, time: -0.5 });
    assert_eq!(error(&[0.5, 0.5], good), WriteError::Time { frame: 1, time: 0.5 });
    assert!(matches!(error(&[f32::NAN], good), WriteError::Time { .. }));
    assert!(matches!(error(&[], good), WriteError::Length { what: "frame", .. }));
    let a = || "a".to_owned();
    let bad = Surface { triangles: &[], ..good };
    assert_eq!(error(&[0.5], bad), WriteError::NoTriangles { surface: a() });
    let bad = Surface { triangles: &[[0, 1, 3]], ..good };
    let expected = WriteError::IndexOutOfRange { cell: 0, point: 3, point_count: 3 };
    assert_eq!(error(&[0.5], bad), expected);
    for component in [-0.1, 1.1, f32::NAN] {
        let bad = Surface { color: [0.0, component, 0.0, 1.0], ..good };
        assert_eq!(error(&[0.5], bad), WriteError::Color { surface: a() });
    }
    let short = [rest[..2].to_vec()];
    let bad = Surface { frames: &short, ..good };
    assert!(matches!(error(&[0.5], bad), WriteError::Length { what: "point", .. }));
    let far = [vec![rest[0], rest[1], vec3(0.0, f32::INFINITY, 0.0)]];
    let bad = Surface { frames: &far, ..good };
    assert_eq!(error(&[0.5], bad), WriteError::NonFinite { array: a(), entry: 2 });
    let bad = Surface { rest: &far[0], ..good };
    assert_eq!(error(&[0.5], bad), WriteError::NonFinite { array: a(), entry: 2 });
}
