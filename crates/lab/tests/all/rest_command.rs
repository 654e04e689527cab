//! The program `viscera-lab rest`.

use std::fs;
use std::path::Path;
use std::process::Command;

/// A bar of 40 mm held at one end; its weight is 0.016 kg times 9.81 m/s^2.
const BAR: &str = r#"
title = "Bar"
time = { duration = "0.5 s", velocity_factor = 0.9 }

[[body]]
name = "bar"
shape = "block"
size = ["40 mm", "20 mm", "20 mm"]
cells = [4, 2, 2]
material = { young = "30 kPa", poisson = 0.4, density = "1000 kg/m^3" }
"#;

const WALL: &str = r#"
[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
"#;

const BED: &str = r#"
[[fixing]]
name = "bed"
body = "bar"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
stiffness = "500 N/m"
"#;

const GRIP: &str = r#"
[[motion]]
name = "grip"
body = "bar"
half_space = { point = ["40 mm", 0, 0], normal = [1, 0, 0] }
keys = [{ time = "0.3 s", translation = ["10 mm", 0, 0] }]
"#;

const WEIGHT: f64 = 0.016 * 9.81;

/// How the program ended and what it said.
struct End {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl End {
    /// The one line that says why the program refused.
    fn error(&self) -> &str {
        assert_eq!(self.code, Some(1), "{}", self.stderr);
        let error = self.stderr.strip_prefix("error: ");
        let error = error.unwrap_or_else(|| panic!("no error: {:?}", self.stderr)).trim_end();
        assert_eq!(error.lines().count(), 1, "{error}");
        error
    }

    /// What follows a name at the start of a line.
    fn after(&self, name: &str) -> &str {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        let rest = self.stdout.lines().find_map(|line| line.trim_start().strip_prefix(name));
        rest.unwrap_or_else(|| panic!("no {name:?} in {}", self.stdout)).trim()
    }

    /// The force [N] on a patch, as a vector.
    fn force(&self, patch: &str) -> Vec<f64> {
        let text = self.after(&format!("{patch}: force"));
        let vector = text.split_once('(').and_then(|(_, rest)| rest.split_once(')'));
        let (vector, _) = vector.unwrap_or_else(|| panic!("no vector in {text}"));
        let numbers = vector.split(", ").map(|number| number.parse::<f64>());
        numbers.collect::<Result<_, _>>().unwrap_or_else(|error| panic!("{vector}: {error}"))
    }
}

/// Runs the program on `scene.toml` in a folder, blind to the data folder of whoever runs the tests.
fn rest_in(folder: &Path, scene: &str, arguments: &[&str]) -> End {
    fs::write(folder.join("scene.toml"), scene).expect("a scene for the test");
    let output = Command::new(env!("CARGO_BIN_EXE_viscera-lab"))
        .current_dir(folder)
        .env_remove("VISCERA_DATA")
        .args(["rest", "scene.toml"])
        .args(arguments)
        .output()
        .expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    End { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) }
}

fn rest(scene: &str, arguments: &[&str]) -> End {
    rest_in(tempfile::tempdir().expect("a folder").path(), scene, arguments)
}

#[test]
fn a_wall_carries_the_whole_weight() {
    let end = rest(&[BAR, WALL].concat(), &[]);
    let force = end.force("wall");
    let error = (force[2] - WEIGHT).abs().max(force[0].abs()).max(force[1].abs());
    // Six decimals are printed.
    assert!(error < 1e-6, "{force:?} for {WEIGHT} N");
    assert_eq!(end.after("minimum"), "yes");
    assert_eq!(end.after("inverted tetrahedra"), "0");
    let gradient = end.after("|grad| / load").split(' ').next().unwrap_or("");
    let gradient: f64 = gradient.parse().expect("a number");
    assert!(gradient < 1e-10, "{gradient:e}");
}

/// What it costs comes before everything else.
#[test]
fn the_cost_is_told_first() {
    let end = rest(&[BAR, WALL].concat(), &[]);
    let (cost, answer) = (end.stdout.find("reference: "), end.stdout.find("at rest at"));
    assert!(cost < answer && cost.is_some(), "{}", end.stdout);
    // Nine of 45 vertices are held.
    assert!(end.after("reference:").starts_with("108 unknowns, "), "{}", end.stdout);
}

#[test]
fn elastic_fixings_and_forces_are_in_balance() {
    let push = "[[force]]\nname = \"push\"\nbody = \"bar\"\nforce = [0, 0, \"-0.2 N\"]\n\
                half_space = { point = [0, 0, \"20 mm\"], normal = [0, 0, 1] }\n";
    let end = rest(&[BAR, BED, push].concat(), &[]);
    let (bed, push) = (end.force("bed"), end.force("push"));
    assert_eq!(push, [0.0, 0.0, -0.2]);
    assert!((bed[2] - WEIGHT - 0.2).abs() < 1e-6, "{bed:?}");
}

/// The grip has come to its place by the end, and wall and grip carry the weight between them.
#[test]
fn motions_are_followed_to_the_end_and_let_go_when_the_scene_does() {
    let scene = [BAR, WALL, GRIP].concat();
    let held = rest(&scene, &["--parts", "4"]);
    let (wall, grip) = (held.force("wall"), held.force("grip"));
    assert!((wall[2] + grip[2] - WEIGHT).abs() < 2e-6, "{wall:?} {grip:?}");
    assert!((wall[0] + grip[0]).abs() < 2e-6 && grip[0] > 1.0, "{wall:?} {grip:?}");

    let free = rest(&[&scene, "release = \"0.4 s\"\n"].concat(), &["--parts", "4"]);
    assert_eq!(free.force("grip"), [0.0; 3]);
    assert!((free.force("wall")[2] - WEIGHT).abs() < 1e-6);
    let never = rest(&[BAR, WALL].concat(), &[]);
    let moved = "largest displacement";
    assert_eq!(free.after(moved), never.after(moved));
}

#[test]
fn the_state_of_rest_is_a_mesh_that_the_library_reads() {
    let folder = tempfile::tempdir().expect("a folder");
    let end = rest_in(folder.path(), &[BAR, WALL].concat(), &["--out", "new/rest.vtu"]);
    assert_eq!(end.after("state of rest:"), "new/rest.vtu");
    let bytes = fs::read(folder.path().join("new/rest.vtu")).expect("the mesh");
    let (mesh, report) = viscera::mesh::io::read_tet_mesh("rest.vtu", &bytes, 1.0).expect("a mesh");
    assert_eq!(mesh.vertices().len(), 45);
    assert_eq!(report.repairs.rewound_tets, 0);
    // It hangs down: the lowest vertex is below the block's underside at z = 0.
    assert!(mesh.vertices().iter().any(|x| x.z < -1e-4));
    // Nothing half-written stays behind.
    assert_eq!(fs::read_dir(folder.path().join("new")).expect("the folder").count(), 1);
}

#[test]
fn the_library_settles_where_the_reference_rests() {
    let scene = [BAR, WALL, GRIP].concat();
    let end = rest(&scene, &["--compare", "--set", "solver.precision=f64"]);
    assert_eq!(end.after("the library is at"), "the reference's state of rest");
    let stiffness: f64 = end.after("apparent stiffness").parse().expect("a number");
    assert!((stiffness - 1.0).abs() < 1e-3, "{stiffness}");
    let lines: Vec<&str> = end.stderr.lines().collect();
    // Not a terminal: one line for each of the two, with its seconds.
    let [reference, library] = lines[..] else { panic!("{}", end.stderr) };
    assert!(reference.starts_with("reference: ") && library.starts_with("library: "));
}

#[test]
fn too_little_memory_is_refused_after_the_cost_with_the_option_to_change() {
    // A million bytes hold no factor of 4000 vertices.
    let cells = "body.bar.cells=[20, 10, 10]";
    let end = rest(&[BAR, WALL].concat(), &["--memory", "1 MB", "--set", cells]);
    let error = end.error();
    assert!(error.contains("more than the 1 MB allowed"), "{error}");
    assert!(error.contains("--memory \"") && error.starts_with("scene.toml: "), "{error}");
    assert!(
        end.stdout.contains("reference: ") && !end.stdout.contains("at rest"),
        "{}",
        end.stdout
    );
}

#[test]
fn a_body_that_nothing_holds_fails_before_any_work() {
    let end = rest(BAR, &[]);
    let error = end.error();
    assert!(error.contains("body `bar` is not held by anything"), "{error}");
    assert!(error.contains("[[fixing]]") && end.stdout.is_empty(), "{error}");

    let released = [BAR, GRIP, "release = \"0.4 s\"\n"].concat();
    let error = rest(&released, &[]).error().to_owned();
    assert!(error.contains("not held by anything at 0.500 s"), "{error}");
}

#[test]
fn bad_input_is_answered_in_one_line_with_the_next_move() {
    let scene = [BAR, WALL].concat();
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("file"), "").expect("a file");
    for (arguments, parts) in [
        (["--out", "file/rest.vtu"], ["cannot write to file", "--out"]),
        (["--out", "rest.obj"], ["rest.obj", ".vtu"]),
        (["--set", "solver.iteration=3"], ["solver.iteration", "iterations"]),
        (["--set", "solver.iterations"], ["KEY=VALUE", "solver.iterations=20"]),
    ] {
        let end = rest_in(folder.path(), &scene, &arguments);
        assert!(parts.iter().all(|part| end.error().contains(part)), "{}", end.error());
        assert!(end.stdout.is_empty(), "{}", end.stdout);
    }
    let file = BAR.replace("shape = \"block\"", "mesh = \"no.msh\"\nunit = \"1 mm\"");
    let file: Vec<&str> = file
        .lines()
        .filter(|line| !line.starts_with("size") && !line.starts_with("cells"))
        .collect();
    let error = rest(&[&file.join("\n"), WALL].concat(), &[]).error().to_owned();
    assert!(error.contains("no.msh: there is no such file") && error.contains("--data"), "{error}");
}

/// Squeezed, pushed through itself and turned by half a turn at once, the bar ends inside out.
/// At once it would turn tissue inside out.
#[test]
fn a_way_too_long_for_one_part_leads_where_many_lead() {
    let twist = GRIP.replace(
        "translation = [\"10 mm\", 0, 0]",
        "translation = [0, 0, 0], rotation_axis = [1, 0, 0], rotation_angle = \"170 deg\"",
    );
    let scene = [BAR, WALL, &twist].concat();
    let ends = ["1", "8"].map(|parts| rest(&scene, &["--parts", parts]));
    for end in &ends {
        assert_eq!(end.after("inverted tetrahedra"), "0");
        assert_eq!(end.after("elastic energy"), ends[0].after("elastic energy"));
        assert_eq!(end.force("grip"), ends[0].force("grip"));
    }
}

/// Until a grip moves, weightless tissue is at rest to the last digit, which is no failure.
#[test]
fn where_nothing_acts_nothing_moves() {
    let weightless = ["--set", "world.gravity=0 m/s^2", "--compare", "--set"];
    let still = [&weightless[..], &["time.duration=0.1 s"]].concat();
    let late = GRIP.replace("keys = [", "keys = [{ time = \"0.2 s\", translation = [0, 0, 0] }, ");
    let scene = [BAR, WALL, &late].concat();
    let end = rest(&scene, &still);
    assert_eq!(end.force("wall"), [0.0; 3]);
    assert_eq!(end.after("the library is at"), "the reference's state of rest");
    let moved = rest(&scene, &weightless[..2]);
    let (wall, grip) = (moved.force("wall"), moved.force("grip"));
    assert!((wall[0] + grip[0]).abs() < 2e-6 && grip[0] > 1.0, "{wall:?} {grip:?}");
}

#[test]
fn help_teaches_by_examples() {
    let help = rest("", &["--help"]).stdout;
    for part in ["--memory", "8 GB", "--parts", "--compare", "Examples:", "scenes/grab.toml"] {
        assert!(help.contains(part), "the help lacks {part}: {help}");
    }
}

const BALL: &str = r#"
[[tool]]
name = "finger"
kind = "probe"
radius = "6 mm"
length = "40 mm"
position = ["20 mm", "10 mm", "26 mm"]
friction = 0
keys = [{ time = "0.3 s", translation = [0, 0, "-3 mm"] }]
"#;

const TABLE: &str = r#"
[[fixing]]
name = "table"
body = "bar"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
"#;

#[test]
fn a_table_carries_what_a_finger_presses() {
    let end = rest(&[BAR, TABLE, BALL].concat(), &[]);
    let (table, finger) = (end.force("table"), end.force("finger"));
    // What the table pushes up bears the weight and the finger, whose own force is the tissue's answer.
    let error = (table[2] - WEIGHT - finger[2]).abs();
    assert!(error < 2e-6 && finger[2] > 0.05, "{table:?}, {finger:?}");
    assert!(!end.stderr.contains("friction"), "{}", end.stderr);
    let rough = rest(&[BAR, TABLE, &BALL.replace("friction = 0", "friction = 0.4")].concat(), &[]);
    assert!(rough.stderr.contains("tool `finger` for one"), "{}", rough.stderr);
    assert_eq!(rough.force("finger"), finger);
}
