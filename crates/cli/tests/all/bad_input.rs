//! Bad input: one line that names the place and the next move, and no results.

use crate::common::{Bench, End, TINY};

/// The message of a run that must be refused without leaving anything behind.
fn refusal(bench: &Bench, arguments: &[&str]) -> String {
    let end = bench.run(arguments);
    assert_eq!(bench.files("out").len(), 0, "results of a refused run");
    assert!(end.stdout.is_empty(), "{}", end.stdout);
    end.error().to_owned()
}

/// The message for the tiny scene with one text replaced by another.
fn refusal_with(old: &str, new: &str) -> String {
    assert!(TINY.contains(old), "the tiny scene has no {old}");
    refusal(&Bench::new(&TINY.replace(old, new)), &[])
}

/// A body from a mesh file, held at one corner.
const FROM_FILE: &str = r#"
time = { duration = "0.1 s" }
[[body]]
name = "organ"
mesh = "organ.msh"
unit = "100 mm"
material = { young = "10 kPa" }
[[fixing]]
name = "corner"
body = "organ"
nearest = { point = [0, 0, 0] }
[output]
picture_size = [64, 48]
"#;

const CORNERS: [&str; 5] = ["0 0 0", "1 0 0", "0 1 0", "0 0 1", "1 1 1"];
const TETS: [&str; 2] = ["1 2 3 4", "2 3 4 5"];

/// A Gmsh 2.2 file; vertices are counted from 1.
fn gmsh(corners: &[&str], tets: &[&str]) -> String {
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n".to_owned();
    text.push_str(&format!("$Nodes\n{}\n", corners.len()));
    for (index, corner) in corners.iter().enumerate() {
        text.push_str(&format!("{} {corner}\n", index + 1));
    }
    text.push_str(&format!("$EndNodes\n$Elements\n{}\n", tets.len()));
    for (index, tet) in tets.iter().enumerate() {
        text.push_str(&format!("{} 4 2 1 1 {tet}\n", index + 1));
    }
    text + "$EndElements\n"
}

fn organ(mesh: &str) -> Bench {
    let bench = Bench::new(FROM_FILE);
    bench.write("organ.msh", mesh.as_bytes());
    bench
}

/// The message for a mesh that must be refused, by `run` and by `mesh inspect` alike.
fn mesh_refusal(mesh: &str) -> String {
    let bench = organ(mesh);
    let message = refusal(&bench, &[]);
    assert_eq!(bench.end_of(&["mesh", "inspect", "organ.msh"]).error(), message);
    message
}

/// A run that must succeed, with what it says on the way.
fn accepted(mesh: &str) -> End {
    let bench = organ(mesh);
    let end = bench.run(&[]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert_eq!(bench.summary("out")["finished"], true);
    end
}

#[test]
fn a_sound_mesh_file_is_accepted_without_a_word() {
    let end = accepted(&gmsh(&CORNERS, &TETS));
    assert_eq!(end.stderr, "");
}

#[test]
fn missing_scene_file() {
    let end = Bench::new(TINY).end_of(&["run", "nowhere.toml", "--out", "out"]);
    assert_eq!(end.error(), "nowhere.toml: there is no such file; check the name");
}

/// A word without an ending is the name of a scene.
#[test]
fn misspelt_scenes_are_told_with_the_one_that_is_meant() {
    let end = Bench::new(TINY).end_of(&["run", "twst", "--out", "out"]);
    let expected = "twst: there is neither such a file nor a built-in scene; did you mean `twist`?";
    assert_eq!(end.error(), expected);
    let end = Bench::new(TINY).end_of(&["run", "a/twst", "--out", "out"]);
    assert_eq!(end.error(), "a/twst: there is no such file; check the name");
}

#[test]
fn folder_in_place_of_a_scene() {
    let end = Bench::new(TINY).end_of(&["run", ".", "--out", "out"]);
    assert_eq!(end.error(), ". is a folder; name a file in it");
}

#[test]
fn scene_that_is_not_text() {
    let bench = Bench::new("");
    bench.write("scene.toml", b"title = \"\xff\xfe\"");
    let message = refusal(&bench, &[]);
    assert_eq!(
        message,
        "scene.toml is neither a scene (TOML in UTF-8) nor a mesh or a scan by its ending; open one of those"
    );
}

#[test]
fn empty_scene() {
    let message = refusal(&Bench::new(""), &[]);
    assert!(message.starts_with("scene.toml, line 1"), "{message}");
    assert!(message.contains("needs the key `body`"), "{message}");
}

#[test]
fn missing_mesh_file() {
    let message = refusal(&Bench::new(FROM_FILE), &[]);
    assert!(message.starts_with("organ.msh: there is no such file in this folder"), "{message}");
    assert!(message.contains("--data"), "{message}");
}

#[test]
fn folder_in_place_of_a_mesh() {
    let bench = Bench::new(FROM_FILE);
    std::fs::create_dir(bench.path("organ.msh")).expect("a folder");
    assert_eq!(refusal(&bench, &[]), "organ.msh is a folder; name a file in it");
}

#[test]
fn empty_mesh_file() {
    assert_eq!(mesh_refusal(""), "organ.msh: the file is empty; export the mesh again");
}

#[test]
fn mesh_cut_in_each_section() {
    let whole = gmsh(&CORNERS, &TETS);
    for section in ["2.2 0 8", "$EndMeshFormat", "4 0 0 1", "$EndNodes", "2 4 2", "$EndElements"] {
        let end = whole.find(section).expect("the section");
        let message = mesh_refusal(&whole[..end]);
        assert!(message.starts_with("organ.msh, line "), "{message}");
        assert!(message.contains("ends") || message.contains("cut short"), "{message}");
    }
}

#[test]
fn two_billion_vertices_in_a_small_file() {
    let mesh = gmsh(&CORNERS, &TETS).replace("$Nodes\n5\n", "$Nodes\n2000000000\n");
    let message = mesh_refusal(&mesh);
    assert!(message.starts_with("organ.msh, line 5"), "{message}");
    assert!(message.contains("2000000000"), "{message}");
}

#[test]
fn coordinate_that_is_not_a_number() {
    let message = mesh_refusal(&gmsh(&["0 0 0", "1 0 0", "0 nan 0", "0 0 1", "1 1 1"], &TETS));
    assert!(message.starts_with("organ.msh, line 8"), "{message}");
}

#[test]
fn negative_vertex_number() {
    let message = mesh_refusal(&gmsh(&CORNERS, &["1 2 3 4", "2 3 4 -5"]));
    assert!(message.starts_with("organ.msh, line 15") && message.contains("-5"), "{message}");
}

#[test]
fn vertex_number_beyond_the_last() {
    let message = mesh_refusal(&gmsh(&CORNERS, &["1 2 3 4", "2 3 4 6"]));
    assert!(message.starts_with("organ.msh, line 15") && message.contains('6'), "{message}");
}

#[test]
fn tet_given_twice() {
    let message = mesh_refusal(&gmsh(&CORNERS, &["1 2 3 4", "3 1 2 4"]));
    assert!(message.starts_with("organ.msh, line 15") && message.contains("repeats"), "{message}");
}

#[test]
fn one_flat_tet() {
    let message = mesh_refusal(&gmsh(&["0 0 0", "1 0 0", "0 1 0", "0 0 1", "1 1 -1"], &TETS));
    assert!(message.starts_with("organ.msh, line 15") && message.contains("flat"), "{message}");
}

#[test]
fn tets_all_inverted_run_and_it_is_said() {
    let end = accepted(&gmsh(&CORNERS, &["2 1 3 4", "2 4 3 5"]));
    let note = "note: body `organ`: reversed the winding of 2 tetrahedra";
    assert!(end.stderr.lines().any(|line| line == note), "{}", end.stderr);
}

#[test]
fn two_components_run_and_it_is_said() {
    let corners = ["0 0 0", "1 0 0", "0 1 0", "0 0 1", "5 0 0", "6 0 0", "5 1 0", "5 0 1"];
    let end = accepted(&gmsh(&corners, &["1 2 3 4", "5 6 7 8"]));
    assert!(end.stderr.contains("note: body `organ` is in 2 parts"), "{}", end.stderr);
    // One corner is held, and with it one of the two.
    assert!(end.stderr.contains("gravity pulls 1 of them down"), "{}", end.stderr);
}

#[test]
fn unknown_key() {
    let message = refusal_with("velocity_factor", "velocity_facto");
    assert!(message.starts_with("scene.toml, line 3, column 30"), "{message}");
    assert!(message.contains("did you mean `velocity_factor`?"), "{message}");
}

#[test]
fn misspelt_value() {
    let message = refusal_with("\"block\"", "\"blok\"");
    assert!(message.starts_with("scene.toml, line 7, column 1"), "{message}");
    assert!(message.contains("did you mean `block`?"), "{message}");
}

#[test]
fn negative_time_step() {
    let message = refusal_with("duration = \"0.2 s\"", "frame = \"-1 ms\"");
    assert!(message.starts_with("scene.toml, line 3, column 10"), "{message}");
    assert!(message.contains("at least 1 us"), "{message}");
}

#[test]
fn incompressible_poisson_ratio() {
    let message = refusal_with("0.45", "0.5");
    assert!(message.starts_with("scene.toml, line 10"), "{message}");
    assert!(message.contains("incompressible; use at most 0.499"), "{message}");
}

#[test]
fn fixing_that_selects_nothing() {
    let message = refusal_with("point = [0, 0, 0]", "point = [\"-1 m\", 0, 0]");
    assert!(message.starts_with("scene.toml, line 12"), "{message}");
    assert!(message.contains("wall") && message.contains("selects nothing"), "{message}");
    // Where the mesh is.
    assert!(message.contains("40"), "{message}");
}

#[test]
fn region_that_the_mesh_does_not_have() {
    let bench = organ(&gmsh(&CORNERS, &TETS));
    let scene = FROM_FILE.replace("nearest = { point = [0, 0, 0] }", "region = 7");
    bench.write("scene.toml", scene.as_bytes());
    let message = refusal(&bench, &[]);
    assert!(message.contains("no tetrahedron has the label 7"), "{message}");
    assert!(message.ends_with("the body's labels are 1"), "{message}");
}

/// A folder below a file can be made by nobody, not even by an administrator.
#[test]
fn output_folder_that_cannot_be_written() {
    let bench = Bench::new(TINY);
    bench.write("file", b"here first");
    for folder in ["file", "file/below"] {
        let end = bench.end_of(&["run", "scene.toml", "--out", folder]);
        let message = end.error();
        assert!(message.starts_with(&format!("cannot write to {folder}: ")), "{message}");
        assert!(message.ends_with("choose another folder with --out"), "{message}");
    }
    assert_eq!(bench.read("file"), b"here first");
}

#[test]
fn no_frames_at_all() {
    for option in ["--frames", "--every"] {
        let message = refusal(&Bench::new(TINY), &[option, "0"]);
        assert!(message.contains(option), "{message}");
    }
}

#[test]
fn setting_without_a_value() {
    let message = refusal(&Bench::new(TINY), &["--set", "solver.iterations"]);
    let advice = "--set solver.iterations: write KEY=VALUE, for example --set solver.iterations=20";
    assert_eq!(message, advice);
}

#[test]
fn setting_with_a_misspelt_key() {
    let message = refusal(&Bench::new(TINY), &["--set", "solver.iteration=3"]);
    assert!(message.contains("did you mean `iterations`?"), "{message}");
    let message = refusal(&Bench::new(TINY), &["--set", "body.bra.material.poisson=0.4"]);
    assert!(message.contains("`bra`") && message.contains("bar"), "{message}");
}

#[test]
fn unit_that_is_none() {
    let bench = organ(&gmsh(&CORNERS, &TETS));
    for unit in ["5", "0 mm", "3 parsec"] {
        let end = bench.end_of(&["mesh", "inspect", "organ.msh", "--unit", unit]);
        assert!(end.error().starts_with("--unit: "), "{}", end.error());
    }
}

#[test]
fn triangles_without_area_are_left_out_of_a_surface_and_it_is_said() {
    let bench = organ(&gmsh(&CORNERS, &TETS));
    let scene = FROM_FILE.replace("unit =", "surface = \"skin.obj\"\nunit =");
    bench.write("scene.toml", scene.as_bytes());
    bench.write("skin.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n");
    let end = bench.run(&[]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert!(end.stderr.contains("left out 1 x triangle without area"));
}

#[test]
fn surface_given_as_tetrahedra() {
    let bench = Bench::new(&FROM_FILE.replace("organ.msh", "organ.obj"));
    bench.write("organ.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let message = refusal(&bench, &[]);
    assert!(message.starts_with("organ.obj"), "{message}");
}

#[test]
fn mesh_that_does_not_fit_into_memory_is_refused_before_the_simulation() {
    let message = refusal(&Bench::new(TINY), &["--memory", "1 kB"]);
    assert!(message.contains("10 tetrahedra needs about"), "{message}");
    assert!(message.contains("1 kB are allowed") && message.contains("coarser"), "{message}");
    assert_eq!(Bench::new(TINY).run(&["--memory", "1 MB"]).code, Some(0));
    let message = Bench::new(TINY).run(&["--memory", "1"]).error().to_owned();
    assert!(message.contains("--memory"), "{message}");
}

/// Devices never end and pipes wait for ever: neither is opened.
#[cfg(target_os = "linux")]
#[test]
fn what_is_no_file_is_not_read() {
    let bench = Bench::new(&FROM_FILE.replace("organ.msh", "pipe.msh"));
    let pipe = std::process::Command::new("mkfifo").arg(bench.path("pipe.msh")).status();
    assert!(pipe.expect("mkfifo").success());
    let message = refusal(&bench, &[]);
    assert!(message.contains("pipe.msh is a device or a pipe"), "{message}");
    let device = Bench::new(&FROM_FILE.replace("organ.msh", "/dev/zero"));
    let message = refusal(&device, &[]);
    assert!(message.contains("/dev/zero is a device or a pipe"), "{message}");
    std::os::unix::fs::symlink("/dev/zero", device.path("link.toml")).expect("a link");
    for arguments in [["run", "/dev/zero"], ["run", "link.toml"]] {
        let end = device.end_of(&arguments);
        assert!(end.error().contains("is a device or a pipe"), "{}", end.stderr);
    }
    for file in ["/dev/zero", "pipe.msh"] {
        let end = bench.end_of(&["mesh", "inspect", file]);
        assert!(end.error().contains("is a device or a pipe"), "{}", end.stderr);
    }
}

#[test]
fn numbers_that_mean_nothing_are_refused() {
    for (setting, asked) in [
        ("solver.relaxation=1e-320", "at least 0.001 and below 2"),
        ("solver.explicit_safety=1e-300", "at least 0.001 and at most 1"),
        ("solver.chebyshev_damping=5e-324", "at least 0.001 and at most 1"),
        ("time.duration=1e-300 s", "at least 1 us"),
    ] {
        let message = refusal(&Bench::new(TINY), &["--set", setting]);
        assert!(message.contains(asked), "{setting}: {message}");
    }
    for option in ["--frames", "--every"] {
        let end = Bench::new(TINY).run(&[option, "-1"]);
        let error = end.error();
        assert!(error.contains("-1") && error.contains("from 1 on"), "{}", end.stderr);
        assert!(!end.stderr.contains("-- -1") && !error.contains("9223"), "{}", end.stderr);
    }
}

/// A mesh whose points are all one.
#[test]
fn a_tetrahedron_without_size_is_told_in_words() {
    let message = mesh_refusal(&gmsh(&["1 1 1"; 5], &TETS));
    assert!(!message.contains("0e0"), "{message}");
}

/// Where no folder for displays is set, as in containers and jobs, drivers have nothing to complain of.
#[test]
fn a_good_run_without_a_display_says_nothing_on_standard_error() {
    let bench = Bench::new(TINY);
    for device in ["auto", "gpu"] {
        let arguments =
            ["run", "scene.toml", "--out", "out", "--set", "output.picture=false", "--set"];
        let device = format!("solver.device={device}");
        let mut command = bench.viscera(&[&arguments[..], &[device.as_str()]].concat());
        let end = End::of(&command.env_remove("XDG_RUNTIME_DIR").output().expect("viscera starts"));
        assert!(!end.stderr.contains("XDG"), "{device}: {}", end.stderr);
        assert!(device.contains("gpu") || end.stderr.is_empty(), "{device}: {}", end.stderr);
    }
}
