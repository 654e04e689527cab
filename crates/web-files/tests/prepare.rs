//! Files of people's own as scenes that the page runs.

use viscera::mesh::io::{Format, MeshFile, MeshNames, Patch, gmsh, ply, read_tet_mesh, stl, vtu};
use viscera::mesh::{boundary_surface, shapes};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Balance};
use viscera_web_files::{Files, Prepared, Request, prepare};

fn files(list: &[(&str, &[u8])]) -> Files {
    list.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.to_vec())).collect()
}

fn request(first: &str) -> Request {
    Request { first: first.to_owned(), ..Request::default() }
}

fn prepared(first: &str, files: &Files) -> Prepared {
    prepare(&request(first), files, &mut |_| {}).unwrap_or_else(|error| panic!("{error}"))
}

/// Every file of it in a format that the page's module reads: OBJ, or what is handed over.
fn assert_plain(prepared: &Prepared) {
    for (name, bytes) in &prepared.files {
        let file = MeshFile { name: name.clone(), bytes: bytes.clone(), beside: None };
        let (_, report) = file.mesh(1.0).unwrap_or_else(|error| panic!("{error}"));
        assert!(
            matches!(report.format, Some(Format::Handover | Format::Obj)),
            "{name}: {report:?}"
        );
    }
}

fn assembled(prepared: &Prepared) -> Assembly {
    let scene = Scene::parse(&prepared.name, &prepared.text, &[]).expect("a legal scene");
    let mut load = |name: &str| prepared.files.get(name).cloned().ok_or_else(|| name.to_owned());
    let balance = prepared.balance.as_deref().and_then(Balance::from_bytes);
    Assembly::with_balance(&scene, &mut load, balance).expect("an assembly")
}

/// A ball of 4 cm in metres.
fn ball() -> viscera::mesh::TetMesh {
    shapes::sphere(0.02, 0.006).expect("a ball").tets
}

#[test]
fn a_mesh_and_a_surface_become_scenes_that_rest_as_they_are() {
    let mesh = ball();
    let surface = boundary_surface(&mesh).surface;
    let names = MeshNames::default();
    for (name, bytes) in [
        ("ball.msh", gmsh::write_binary(&mesh, &names).expect("a file")),
        ("ball.vtu", vtu::write_mesh(&mesh, &names).expect("a file")),
        ("ball.stl", stl::write(&surface)),
        ("ball.ply", ply::write(&surface)),
    ] {
        let mut told = Vec::new();
        let all = files(&[(name, &bytes)]);
        let prepared = prepare(&request(name), &all, &mut |doing| told.push(doing));
        let prepared = prepared.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(prepared.name, "ball.toml");
        assert_plain(&prepared);
        assert!(told.len() >= 3 && told[0].contains(name), "{told:?}");
        assert_eq!(prepared.notes, [""; 0]);
        let assembly = assembled(&prepared);
        let volume = assembly.bodies[0].mesh.volume();
        assert!((volume / mesh.volume() - 1.0).abs() < 0.02, "{name}: {volume}");
        assert!(prepared.balance.is_some() && !assembly.sags(), "{name}");
    }
}

#[test]
fn a_scene_keeps_patches_regions_and_surfaces_of_its_files() {
    let mesh = ball();
    let top: Vec<u32> =
        (0u32..).zip(mesh.vertices()).filter(|(_, x)| x.z > 0.01).map(|(v, _)| v).collect();
    let names = MeshNames {
        patches: vec![Patch { name: "top".into(), vertices: top.clone() }],
        regions: vec![(0, "flesh".into())],
    };
    let bytes = gmsh::write_binary(&mesh, &names).expect("a file");
    let skin = stl::write(&boundary_surface(&mesh).surface);
    let text = r#"
[[body]]
name = "ball"
mesh = "meshes/ball.msh"
surface = "skin.stl"
unit = "1 m"
material = { preset = "liver" }
[[body.region]]
label = "flesh"
preset = "kidney_cortex"
[[fixing]]
name = "top"
body = "ball"
patch = "top"
"#;
    let all =
        files(&[("own.toml", text.as_bytes()), ("meshes/ball.msh", &bytes), ("skin.stl", &skin)]);
    let prepared = prepared("skin.stl", &all);
    assert_eq!(prepared.name, "own.toml");
    assert_eq!(prepared.text, text);
    assert_plain(&prepared);
    assert_eq!(prepared.balance, None);
    let assembly = assembled(&prepared);
    assert_eq!(assembly.fixings[0].vertices, top);
    assert!(assembly.bodies[0].has_fine_surface);
    let (read, report) =
        read_tet_mesh("ball.msh", &prepared.files["meshes/ball.msh"], 1.0).expect("a mesh");
    assert_eq!((&read, report.region_names), (&mesh, names.regions));

    // The same from a program that has the scene apart.
    let scene = Some(("own".to_owned(), text.to_owned()));
    let request = Request { scene, ..Request::default() };
    let apart = prepare(&request, &all, &mut |_| {}).expect("a scene");
    assert_eq!(apart.files, prepared.files);
}

/// TetGen's files come in pairs: both are used, whichever is named first.
#[test]
fn two_files_of_one_mesh_belong_together() {
    let mesh = ball();
    let rows = |count: usize, head: &str, row: &dyn Fn(usize) -> String| -> String {
        let rows = (0..count).map(|i| format!("{} {}\n", i + 1, row(i)));
        format!("{count} {head}\n{}", rows.collect::<String>())
    };
    let nodes = rows(mesh.vertices().len(), "3 0 0", &|v| {
        mesh.vertices()[v].to_array().map(|x| x.to_string()).join(" ")
    });
    let tets =
        rows(mesh.tets().len(), "4 0", &|t| mesh.tets()[t].map(|v| (v + 1).to_string()).join(" "));
    let all = files(&[("ball.node", nodes.as_bytes()), ("ball.ele", tets.as_bytes())]);
    for first in ["ball.node", "ball.ele"] {
        let prepared = prepared(first, &all);
        assert_eq!(prepared.notes, [""; 0]);
        assert_eq!(assembled(&prepared).bodies[0].mesh.tets().len(), mesh.tets().len());
    }
}

#[test]
fn what_is_wrong_is_told_with_its_file() {
    let mesh = vtu::write_mesh(&ball(), &MeshNames::default()).expect("a file");
    let scene = b"[[body]]\nname = \"a\"\nmesh = \"a.vtu\"\nunit = \"1 m\"\nmaterial = { preset = \"liver\" }\n";
    for (first, all, words) in [
        ("letter.txt", files(&[("letter.txt", b"Dear reader")]), "letter.txt"),
        ("a.toml", files(&[("a.toml", scene)]), "a.vtu: there is no such file; open it together"),
        ("a.toml", files(&[("a.toml", b"\xff")]), "a.toml: it is no text"),
        ("a.toml", files(&[("a.toml", b"title = ")]), "a.toml"),
        ("ball.ele", files(&[("ball.ele", b"1 4 0\n1 1 2 3 4\n")]), "ball.node"),
        ("half.vtu", files(&[("half.vtu", &mesh[..mesh.len() / 2])]), "half.vtu"),
    ] {
        let error = prepare(&request(first), &all, &mut |_| {}).expect_err(words);
        assert!(error.contains(words), "{error}");
    }
    // Of two meshes one is shown, and the other one named.
    let all = files(&[("a.vtu", &mesh), ("b.vtu", &mesh)]);
    let notes = prepared("b.vtu", &all).notes.concat();
    assert!(notes.contains("only b.vtu is shown, not a.vtu"), "{notes}");
    assert!(MeshFile::load("a.vtu", |name| all.get(name).cloned().ok_or(())).is_ok());
}
