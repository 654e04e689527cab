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

/// Two tetrahedra of two regions with names, and a surface with one.
const NAMED: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n2 1 \"wall\"\n3 5 \"lobe\"\n3 6 \"tumour\"\n\
    $EndPhysicalNames\n$Nodes\n5\n1 0 0 0\n2 60 0 0\n3 0 60 0\n4 0 0 60\n5 60 60 60\n$EndNodes\n\
    $Elements\n3\n1 2 2 1 1 1 2 3\n2 4 2 5 1 1 2 3 4\n3 4 2 6 1 2 3 4 5\n$EndElements\n";

#[test]
fn a_conversion_keeps_names_and_chooses_regions_by_them() {
    let bench = Bench::new("");
    bench.write("organ.msh", NAMED.as_bytes());
    for name in ["all.vtu", "all.vtk", "all.msh"] {
        let end = bench.end_of(&["mesh", "convert", "organ.msh", name, "--unit", "1 mm"]);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        let said = "1 x triangle on surfaces of the mesh: those with a name are kept";
        assert!(end.stdout.contains(said), "{}", end.stdout);
        let inspect = bench.end_of(&["mesh", "inspect", name]).stdout;
        for part in ["`wall`", "`lobe`", "`tumour`"] {
            assert!(inspect.contains(part), "{name}: {part}: {inspect}");
        }
    }
    for (wanted, kept, others) in
        [("tumour", "region 6", "region 5"), ("5", "region 5", "region 6")]
    {
        let choose = ["mesh", "convert", "organ.msh", "part.vtu", "--region", wanted];
        let end = bench.end_of(&choose);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        let inspect = bench.end_of(&["mesh", "inspect", "part.vtu"]).stdout;
        assert!(inspect.contains(kept) && !inspect.contains(others), "{inspect}");
    }
    let end = bench.end_of(&["mesh", "convert", "organ.msh", "b.vtu", "--region", "tumor"]);
    let expected = "no tetrahedron has the label tumor; its regions are 5 `lobe`, 6 `tumour`";
    assert!(end.error().contains(expected), "{}", end.stderr);
    assert!(!bench.path("b.vtu").exists());
}

#[test]
fn a_file_is_not_written_over_itself() {
    let bench = Bench::new("");
    bench.write("organ.msh", NAMED.as_bytes());
    bench.write("cube.obj", CUBE.as_bytes());
    std::fs::create_dir(bench.path("folder")).expect("a folder");
    for (file, out) in [
        ("organ.msh", "organ.msh"),
        ("organ.msh", "./organ.msh"),
        ("organ.msh", "folder/../organ.msh"),
        ("cube.obj", "cube.obj"),
    ] {
        let end = bench.end_of(&["mesh", "convert", file, out]);
        assert!(end.error().contains("is the file that is read"), "{}", end.stderr);
    }
    assert_eq!(bench.read("organ.msh"), NAMED.as_bytes());
    assert_eq!(bench.read("cube.obj"), CUBE.as_bytes());
}

#[test]
fn a_mesh_is_looked_at_in_the_unit_that_a_run_would_guess() {
    let bench = Bench::new("");
    bench.write("spleen.obj", CUBE.as_bytes());
    let end = bench.end_of(&["mesh", "inspect", "spleen.obj"]);
    for part in ["1 in the file as 1 mm: a spleen of 216 ml", "216.0 ml"] {
        assert!(end.stdout.contains(part), "{part}: {}", end.stdout);
    }
    let json = bench.end_of(&["mesh", "inspect", "spleen.obj", "--json"]).stdout;
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["unit"], 1e-3);
    let volume = json["volume"].as_f64().expect("a volume");
    assert!((volume / 216e-6 - 1.0).abs() < 1e-9, "{volume}");
    let end = bench.end_of(&["mesh", "inspect", "spleen.obj", "--unit", "1 cm"]);
    assert!(
        end.stdout.contains("unit as given") && end.stdout.contains("216.0 l\n"),
        "{}",
        end.stdout
    );
}

#[test]
fn a_scan_is_sent_to_the_command_for_scans() {
    let bench = Bench::new("");
    for name in ["scan.nrrd", "scan.seg.nrrd", "scan.nii", "scan.nii.gz"] {
        bench.write(name, &scan());
        let end = bench.end_of(&["mesh", "inspect", name]);
        assert!(end.error().contains(&format!("`viscera mesh labels {name}`")), "{}", end.stderr);
    }
}
