//! Files from elsewhere: scenes of them, and conversions.

use crate::common::Bench;

/// A cube of 60 mm in millimetres, wound outwards.
const CUBE: &str = "v 0 0 0\nv 60 0 0\nv 60 60 0\nv 0 60 0\nv 0 0 60\nv 60 0 60\nv 60 60 60\nv 0 60 60\n\
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A label map of one organ, a box of 12 x 12 x 12 voxels of 3 mm.
fn scan() -> Vec<u8> {
    let mut text = String::from(
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 16 16 16\nencoding: text\nspace: right-anterior-superior\n\
         space directions: (3,0,0) (0,3,0) (0,0,3)\nspace origin: (0,0,0)\nSegment0_LabelValue:=5\nSegment0_Name:=liver\n\n",
    );
    for n in 0..16 * 16 * 16 {
        let is_inside = [n % 16, n / 16 % 16, n / 256].iter().all(|at| (2..14).contains(at));
        text.push_str(if is_inside { "5 " } else { "0 " });
    }
    text.into_bytes()
}

#[test]
fn a_surface_is_run_at_once() {
    let bench = Bench::new("");
    bench.write("spleen.obj", CUBE.as_bytes());
    let end = bench.end_of(&["run", "spleen.obj", "--frames", "2", "--out", "out"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    for part in ["1 in the file as 1 mm", "spleen", "scene.toml"] {
        assert!(end.stdout.contains(part), "{part}: {}", end.stdout);
    }
    let scene = std::fs::read_to_string(bench.path("out/scene/scene.toml")).expect("a scene");
    assert!(
        scene.contains("preset = \"spleen\"") && scene.contains("# 1 in the file as"),
        "{scene}"
    );
    assert!(bench.path("out/picture.png").exists());
    // And again, as anybody would who has changed it.
    let again = ["run", "out/scene/scene.toml", "--frames", "1", "--out", "again"];
    assert_eq!(bench.end_of(&again).code, Some(0));
    // What a person has changed is not overwritten.
    let changed = scene.replace("velocity_factor = 0.95", "velocity_factor = 0.9");
    bench.write("out/scene/scene.toml", changed.as_bytes());
    let end = bench.end_of(&["run", "spleen.obj", "--frames", "2", "--out", "out"]);
    assert_eq!(end.code, Some(1));
    assert!(end.stderr.contains("viscera run out/scene/scene.toml"), "{}", end.stderr);
    let new = ["scene", "new", "spleen.obj", "--out", "out/scene"];
    assert_eq!(bench.end_of(&new).code, Some(1));
    assert_eq!(bench.read("out/scene/scene.toml"), changed.as_bytes());
    assert_eq!(bench.end_of(&[&new[..], &["--force"]].concat()).code, Some(0));
    assert_eq!(bench.read("out/scene/scene.toml"), scene.as_bytes());
}

#[test]
fn a_scan_becomes_a_scene() {
    let bench = Bench::new("");
    bench.write("scan.nrrd", &scan());
    let list = bench.end_of(&["mesh", "labels", "scan.nrrd"]);
    assert_eq!(list.code, Some(0), "{}", list.stderr);
    // 12^3 voxels of 27 mm^3.
    assert!(list.stdout.contains("liver") && list.stdout.contains("46.7"), "{}", list.stdout);
    let end = bench.end_of(&["scene", "new", "scan.nrrd", "--count", "500", "--out", "made"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert!(end.stdout.contains("next:  viscera run made/scene.toml"), "{}", end.stdout);
    assert!(bench.path("made/liver.vtu").exists() && bench.path("made/liver_skin.ply").exists());
    let wrong = bench.end_of(&["scene", "new", "scan.nrrd", "--labels", "kidney"]);
    assert_eq!(wrong.code, Some(1));
    assert!(wrong.stderr.contains("no label `kidney`; labels are 5 liver"), "{}", wrong.stderr);
}

#[test]
fn surfaces_are_filled_turned_and_written() {
    let bench = Bench::new("");
    bench.write("cube.obj", CUBE.as_bytes());
    let fill = [
        "mesh",
        "tetrahedralize",
        "cube.obj",
        "--out",
        "cube.msh",
        "--edge",
        "12 mm",
        "--unit",
        "1 mm",
    ];
    let end = bench.end_of(&fill);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let inspect = bench.end_of(&["mesh", "inspect", "cube.msh"]);
    // 60^3 mm^3 are 216 ml.
    assert!(inspect.stdout.contains("Gmsh 4 binary"), "{}", inspect.stdout);
    assert!(
        inspect.stdout.contains("216.") || inspect.stdout.contains("215."),
        "{}",
        inspect.stdout
    );
    // Mirrored, it is still wound outwards.
    let turn = ["mesh", "convert", "cube.obj", "turned.stl", "--unit", "1 mm", "--axes", "x,z,y"];
    let end = bench.end_of(&turn);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let inspect = bench.end_of(&["mesh", "inspect", "turned.stl"]);
    assert!(
        inspect.stdout.contains("216.0 ml") && !inspect.stdout.contains("inwards"),
        "{}",
        inspect.stdout
    );
    for (arguments, expected) in [
        (&["mesh", "convert", "cube.obj", "cube.vtu"][..], "tetrahedralize"),
        (&["mesh", "convert", "cube.obj", "cube.abc"], "cannot write this format"),
        (&["mesh", "convert", "cube.obj", "a.stl", "--axes", "x,x,z"], "once each"),
        (
            &["mesh", "convert", "cube.msh", "a.vtu", "--region", "7"],
            "no tetrahedron has the label 7",
        ),
        (&["mesh", "convert", "cube.msh", "a.vtu", "--component", "3"], "no component 3"),
        (&["mesh", "labels", "cube.obj"], "mesh inspect"),
        (&["mesh", "tetrahedralize", "cube.obj", "--out", "a.obj"], ".vtu, .vtk or .msh"),
        (&["scene", "new", "cube.obj", "--edge", "0 mm"], "above zero"),
        (&["scene", "new", "none.stl"], "no such file"),
    ] {
        let end = bench.end_of(arguments);
        assert_eq!(end.code, Some(1), "{arguments:?}: {}", end.stdout);
        assert!(end.stderr.contains(expected), "{arguments:?}: {}", end.stderr);
        assert_eq!(end.stderr.trim_end().lines().count(), 1, "{}", end.stderr);
    }
    assert!(!bench.path("a.stl").exists() && !bench.path("a.vtu").exists());
}
