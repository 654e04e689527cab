//! Files from elsewhere: scenes of them, and conversions.

use crate::common::Bench;

/// A cube of 60 mm in millimetres, wound outwards.
const CUBE: &str = "v 0 0 0\nv 60 0 0\nv 60 60 0\nv 0 60 0\nv 0 0 60\nv 60 0 60\nv 60 60 60\nv 0 60 60\n\
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A label map: a box of 12 x 12 x 12 voxels of 3 mm is a liver, half as large a one beside it a spleen.
fn scan() -> Vec<u8> {
    let names = "Segment0_LabelValue:=5\nSegment0_Name:=liver\nSegment1_LabelValue:=6\nSegment1_Name:=spleen\n";
    label_map([26, 16, 16], names, |[x, y, z]| match [x, y, z] {
        at if at.iter().all(|at| (2..14).contains(at)) => 5,
        _ if (17..23).contains(&x) && (2..14).contains(&y) && (2..14).contains(&z) => 6,
        _ => 0,
    })
}

/// An NRRD file of voxels of 3 mm.
fn label_map(size: [usize; 3], names: &str, label: impl Fn([usize; 3]) -> u16) -> Vec<u8> {
    let [x, y, z] = size;
    let mut text = format!(
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: {x} {y} {z}\nencoding: text\nspace: right-anterior-superior\n\
         space directions: (3,0,0) (0,3,0) (0,0,3)\nspace origin: (0,0,0)\n{names}\n",
    );
    for n in 0..x * y * z {
        text.push_str(&format!("{} ", label([n % x, n / x % y, n / x / y])));
    }
    text.into_bytes()
}

#[test]
fn a_surface_is_run_at_once() {
    let bench = Bench::new("");
    bench.write("spleen.obj", CUBE.as_bytes());
    let end = bench.end_of(&["run", "spleen.obj", "--frames", "2", "--out", "out"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    for part in ["1 in the file as 1 mm", "spleen", "scene: out/scene/spleen.toml"] {
        assert!(end.stdout.contains(part), "{part}: {}", end.stdout);
    }
    let scene = std::fs::read_to_string(bench.path("out/scene/spleen.toml")).expect("a scene");
    assert!(
        scene.contains("preset = \"spleen\"") && scene.contains("# 1 in the file as"),
        "{scene}"
    );
    assert!(bench.path("out/picture.png").exists());
    // And again, as anybody would who has changed it: results have the organ's name.
    let again = ["run", "out/scene/spleen.toml", "--frames", "1"];
    assert_eq!(bench.end_of(&again).code, Some(0));
    assert!(bench.path("out/spleen/summary.json").exists());
    // What a person has changed is not overwritten.
    let changed = scene.replace("velocity_factor = 0.95", "velocity_factor = 0.9");
    bench.write("out/scene/spleen.toml", changed.as_bytes());
    let end = bench.end_of(&["run", "spleen.obj", "--frames", "2", "--out", "out"]);
    assert_eq!(end.code, Some(1));
    assert!(end.stderr.contains("viscera run out/scene/spleen.toml"), "{}", end.stderr);
    let new = ["scene", "new", "spleen.obj", "--out", "out/scene"];
    assert_eq!(bench.end_of(&new).code, Some(1));
    assert_eq!(bench.read("out/scene/spleen.toml"), changed.as_bytes());
    assert_eq!(bench.end_of(&[&new[..], &["--force"]].concat()).code, Some(0));
    assert_eq!(bench.read("out/scene/spleen.toml"), scene.as_bytes());
}

/// [`CUBE`], as large in all directions as a factor says.
fn cube(factor: usize) -> String {
    CUBE.replace("60", &(60 * factor).to_string())
}

#[test]
fn imports_replace_and_remove_only_what_imports_wrote() {
    let bench = Bench::new("");
    bench.write("phantom.obj", CUBE.as_bytes());
    let new = |file: &str, more: &[&str]| {
        bench.end_of(&[&["scene", "new", file, "--count", "300"], more].concat())
    };
    assert_eq!(new("phantom.obj", &[]).code, Some(0));
    let scene = "out/phantom/scene/phantom.toml";
    let first = bench.read(scene);
    // The same file with other options: nobody has changed the scene, and the command asks for a new one.
    let end = bench.end_of(&["scene", "new", "phantom.obj", "--count", "900"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert_ne!(bench.read(scene), first);
    // To run a file asks for none.
    let end = bench.end_of(&["run", "phantom.obj", "--frames", "1"]);
    assert_eq!(end.code, Some(1));
    assert!(end.stderr.contains("made with other options or changed by hand"), "{}", end.stderr);
    // Another file of the same name, by its ending or by what is in it.
    std::fs::create_dir(bench.path("other")).expect("a folder");
    bench.write("other/phantom.obj", cube(2).as_bytes());
    let stl = ["mesh", "convert", "phantom.obj", "phantom.stl"];
    assert_eq!(bench.end_of(&stl).code, Some(0));
    for (file, told) in
        [("phantom.stl", "made of phantom.obj"), ("other/phantom.obj", "another phantom.obj")]
    {
        let before = bench.read(scene);
        let end = new(file, &[]);
        assert_eq!(end.code, Some(1), "{}", end.stdout);
        assert!(end.stderr.contains(told), "{}", end.stderr);
        assert_eq!(bench.read(scene), before);
        // What the message says works.
        let command = end.stderr.split("(viscera ").nth(1).and_then(|rest| rest.split(')').next());
        let words: Vec<&str> = command.expect("a command").split(' ').collect();
        assert_eq!(bench.end_of(&words).code, Some(0), "{words:?}");
    }
    // A mesh from elsewhere.
    std::fs::create_dir(bench.path("shared")).expect("a folder");
    bench.write("shared/phantom.vtu", b"mine");
    let end = new("phantom.obj", &["--out", "shared"]);
    assert!(end.stderr.contains("shared/phantom.vtu: there is another file"), "{}", end.stderr);
    assert_eq!(bench.read("shared/phantom.vtu"), b"mine");
    assert_eq!(new("phantom.obj", &["--out", "shared", "--force"]).code, Some(0));
}

#[test]
fn meshes_of_an_earlier_scene_are_removed_and_changed_ones_kept() {
    let bench = Bench::new("");
    bench.write("scan.nrrd", &scan());
    let new = |labels: &str| {
        bench.end_of(&["scene", "new", "scan.nrrd", "--count", "300", "--labels", labels])
    };
    assert_eq!(new("5,6").code, Some(0));
    let folder = "out/scan/scene";
    assert!(bench.files(folder).contains("spleen.vtu"));
    bench.write(&format!("{folder}/notes.txt"), b"mine");
    bench.write(&format!("{folder}/spleen_skin.ply"), b"changed");
    let end = new("5");
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert!(end.stdout.contains("before: spleen.vtu\n"), "{}", end.stdout);
    assert!(end.stdout.contains("since it was changed: spleen_skin.ply"), "{}", end.stdout);
    let files = bench.files(folder);
    assert!(!files.contains("spleen.vtu") && files.contains("notes.txt"), "{files:?}");
    assert!(files.contains("spleen_skin.ply") && files.contains("liver.vtu"), "{files:?}");
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
    assert!(end.stdout.contains("next:  viscera run made/scan.toml"), "{}", end.stdout);
    assert!(bench.path("made/liver.vtu").exists() && bench.path("made/liver_skin.ply").exists());
    // Volumes of scan and mesh stand side by side.
    let columns = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let row = end.stdout.lines().map(columns).find(|row| row.first().is_some_and(|r| r == "liver"));
    assert_eq!(row.expect("a liver")[2..4], ["47", "47"], "{}", end.stdout);
    assert!(end.stdout.contains("ml in scan  ml in mesh"), "{}", end.stdout);
    let wrong = bench.end_of(&["scene", "new", "scan.nrrd", "--labels", "kidney"]);
    assert_eq!(wrong.code, Some(1));
    assert!(wrong.stderr.contains("no label `kidney`; labels are 5 liver"), "{}", wrong.stderr);
}

#[test]
fn labels_are_listed_with_names_and_without_voxels() {
    let bench = Bench::new("");
    let names = "Segment0_LabelValue:=5\nSegment0_Name:=Leber, links\nSegment1_LabelValue:=6\nSegment1_Name:=leber_links\n\
        Segment2_LabelValue:=7\nSegment2_Name:=Galle\n";
    let label = |at: [usize; 3]| match at {
        [4, 4, 4] => 6,
        at if at.iter().all(|at| (6..12).contains(at)) => 5,
        _ => 0,
    };
    bench.write("scan.nrrd", &label_map([16, 16, 16], names, label));
    let list = bench.end_of(&["mesh", "labels", "scan.nrrd"]).stdout;
    for part in ["named, without voxels: 7 Galle", "labels 5,6 have the same name", "0.027"] {
        assert!(list.contains(part), "{part}: {list}");
    }
    let list = bench.end_of(&["mesh", "labels", "scan.nrrd", "--names", "5=liver,6=vessel"]);
    assert!(list.stdout.contains("liver") && !list.stdout.contains("same name"), "{}", list.stdout);
    // By the name that its body has.
    let new = ["scene", "new", "scan.nrrd", "--labels", "leber_links", "--out", "a"];
    let end = bench.end_of(&new);
    assert!(bench.path("a/leber_links.vtu").exists(), "{}", end.stderr);
    let wrong = bench.end_of(&["scene", "new", "scan.nrrd", "--labels", "Leber, links"]);
    assert!(
        wrong.stderr.contains("labels are 5 leber_links (\"Leber, links\")"),
        "{}",
        wrong.stderr
    );
    let wrong = bench.end_of(&["mesh", "labels", "scan.nrrd", "--names", "liver"]);
    assert!(wrong.stderr.contains("1=liver,2=tumor"), "{}", wrong.stderr);
    // Without names, and with numbers of another program.
    bench.write("lits.nrrd", &label_map([16, 16, 16], "", |at| label(at).saturating_sub(4)));
    let list = bench.end_of(&["mesh", "labels", "lits.nrrd"]).stdout;
    assert!(list.contains("label_1") && list.contains("--names 1=liver,2=tumor"), "{list}");
    // What is no label map says what is.
    bench.write("scan.mha", b"ObjectType = Image\nNDims = 3\n");
    bench.write("scan.hdr", &[0; 400]);
    bench.write("scan.dat", b"0 1 2 3\n");
    for command in [
        ["mesh", "labels", "scan.mha"],
        ["scene", "new", "scan.mha"],
        ["mesh", "labels", "scan.dat"],
        ["scene", "new", "scan.hdr"],
    ] {
        let end = bench.end_of(&command);
        assert_eq!(end.code, Some(1), "{}", end.stdout);
        assert!(end.stderr.contains(".nii.gz"), "{command:?}: {}", end.stderr);
    }
    let end = bench.end_of(&["run", "scan.mha"]);
    assert!(end.stderr.contains(".nii.gz"), "{}", end.stderr);
}

#[test]
fn options_of_imports_are_told_where_they_work() {
    let bench = Bench::new("");
    bench.write("Cube.1.obj", CUBE.as_bytes());
    let message = bench.end_of(&["run", "Cube.1.obj", "--count", "300"]).error().to_owned();
    let commands: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    assert_eq!(commands.len(), 2, "{message}");
    for command in commands {
        let words = command.strip_prefix("viscera ").expect("a command").split(' ');
        let end = bench.end_of(&words.collect::<Vec<_>>());
        assert_eq!(end.code, Some(0), "{command}: {}", end.stderr);
    }
    assert!(bench.path("out/cube_1/scene/cube_1.toml").exists());
    assert!(bench.path("out/cube_1/summary.json").exists());
    let message = bench.end_of(&["run", "scene.toml", "--labels", "liver"]).error().to_owned();
    assert!(message.contains("viscera scene new FILE --labels"), "{message}");
    // A unit that makes no part of a body of it.
    let end = bench.end_of(&["scene", "new", "Cube.1.obj", "--unit", "1 m", "--out", "large"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert!(end.stdout.contains("warning: with --unit \"1000 mm\""), "{}", end.stdout);
    let scene = bench.read("large/cube_1.toml");
    assert!(String::from_utf8_lossy(&scene).contains("# with --unit"));
}

#[test]
fn bones_are_filled_as_shapes_and_made_obstacles() {
    let bench = Bench::new("");
    let names = "Segment0_LabelValue:=5\nSegment0_Name:=liver\nSegment1_LabelValue:=6\nSegment1_Name:=rib_left_1\n";
    let label = |[x, y, z]: [usize; 3]| match [x, y, z] {
        at if at.iter().all(|at| (2..14).contains(at)) => 5,
        _ if (17..23).contains(&x) && (2..14).contains(&y) && (2..14).contains(&z) => 6,
        _ => 0,
    };
    bench.write("scan.nrrd", &label_map([26, 16, 16], names, label));
    let new = ["scene", "new", "scan.nrrd", "--count", "500", "--out", "."];
    let message = bench.end_of(&[&new[..], &["--labels", "5,6"]].concat()).error().to_owned();
    let commands: Vec<&str> = message.split('`').skip(3).step_by(2).take(2).collect();
    for command in &commands {
        let words = command.strip_prefix("viscera ").expect("a command").split_whitespace();
        let end = bench.end_of(&words.collect::<Vec<_>>());
        assert_eq!(end.code, Some(0), "{command}: {}", end.stderr);
    }
    assert_eq!(bench.end_of(&new).code, Some(0));
    let scene = String::from_utf8(bench.read("scan.toml")).expect("text");
    let tool = "\n[[tool]]\nkind = \"mesh\"\nmesh = \"rib_left_1.stl\"\nunit = \"1 m\"\n";
    assert!(
        message.contains("kind = \"mesh\", mesh = \"rib_left_1.stl\", unit = \"1 m\""),
        "{message}"
    );
    bench.write("scan.toml", (scene + tool).as_bytes());
    let run = bench.end_of(&["run", "scan.toml", "--frames", "1"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
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
    assert!(end.stdout.ends_with("wrote cube.msh\n"), "{}", end.stdout);
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
        (&["scene", "new", "cube.msh", "--count", "9"], "surface.stl"),
        // Refused before anything is filled, with what works.
        (&["scene", "new", "cube.obj", "--edge", "0.01 mm"], "take --edge \"0.9"),
        (&["scene", "new", "cube.obj", "--count", "4000000000"], "take --count"),
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
