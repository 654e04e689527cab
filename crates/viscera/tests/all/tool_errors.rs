//! Tools that cannot be: each is one error with its place and the next move.

use viscera::scene::Scene;
use viscera::simulation::Assembly;

const GOOD: &str = r#"[[body]]
name = "block"
shape = "block"
size = ["20 mm", "20 mm", "10 mm"]
cells = [5, 5, 2]
material = { young = "5 kPa" }

[[fixing]]
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }

[[tool]]
name = "ball"
kind = "sphere"
radius = "4 mm"
position = ["10 mm", "10 mm", "20 mm"]
keys = [{ time = "1 s", translation = [0, 0, "-5 mm"] }]

[[tool]]
name = "pliers"
kind = "grasper"
jaw_size = ["8 mm", "4 mm", "16 mm"]
position = [0, 0, "50 mm"]
jaw = [{ time = 0, angle = "40 deg" }]

[[tool]]
kind = "half_space"
position = [0, 0, "-5 mm"]
"#;

fn parse(text: &str) -> Result<Scene, String> {
    Scene::parse("t.toml", text, &[]).map_err(|error| error.to_string())
}

/// With files that all hold the same bytes.
fn assemble(text: &str, file: Option<&str>) -> Result<Assembly, String> {
    let scene = parse(text)?;
    let mut load = |name: &str| match file {
        Some(text) => Ok(text.as_bytes().to_vec()),
        None => Err(format!("{name}: there is no such file beside the scene; put it there")),
    };
    Assembly::new(&scene, &mut load).map_err(|error| error.to_string())
}

fn replaced(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old), "{old}");
    GOOD.replacen(old, new, 1)
}

#[test]
fn good_tools_are_accepted() {
    let assembly = assemble(GOOD, None).unwrap_or_else(|e| panic!("{e}"));
    let names: Vec<_> = assembly.tools.iter().map(|tool| tool.name.as_str()).collect();
    assert_eq!(names, ["ball", "pliers", "tool 2"]);
    assert_eq!(assembly.tools.iter().map(|tool| tool.parts.len()).sum::<usize>(), 4);
}

#[test]
fn numbers_that_no_tool_has_are_refused() {
    let ball = "radius = \"4 mm\"\n";
    for (new, message) in [
        (
            "radius = \"4 mm\"\nfriction = 10\n",
            "t.toml, line 16, column 1: friction = 10: a coefficient of friction is between 0 and 5; 0.1 is slippery, \
             0.8 ridged jaws",
        ),
        (
            "radius = \"4 mm\"\nthickness = 0\n",
            "t.toml, line 16, column 1: thickness = 0: out of range; it must be at least 1 um and at most 1 m",
        ),
        (
            "radius = \"4 mm\"\nstiffness = -1\n",
            "t.toml, line 16, column 1: stiffness = -1: out of range; it must be at least 0.001 and at most 1000000",
        ),
        (
            "radius = \"-4 mm\"\n",
            "t.toml, line 15, column 1: radius = \"-4 mm\": out of range; it must be at least 1 um and at most 100 m",
        ),
        (
            "",
            "t.toml, line 12, column 1: tool `ball`: `radius` is missing, for example radius = \"5 mm\"",
        ),
        (
            "radius = \"4 mm\"\nlength = \"1 mm\"\n",
            "t.toml, line 12, column 1: tool `ball`: `length` means nothing for a sphere, which takes radius",
        ),
        (
            "radius = \"4 mm\"\npath = \"p.csv\"\n",
            "t.toml, line 12, column 1: tool `ball`: `keys` and `path` exclude each other; keep one",
        ),
    ] {
        assert_eq!(parse(&replaced(ball, new)).map(|_| ()), Err(message.to_owned()));
    }
    let error = parse(&replaced("kind = \"sphere\"", "kind = \"sphre\"")).map(|_| ());
    let message = "t.toml, line 14, column 1: kind = \"sphre\": did you mean `sphere`? Valid: half_space, sphere, capsule, \
                   box, probe, blade, hook, grasper, mesh, atraumatic_grasper, fan_retractor, suction_tip";
    assert_eq!(error, Err(message.to_owned()));
}

#[test]
fn jaws_that_cannot_be_are_refused() {
    for (old, new, message) in [
        (
            "angle = \"40 deg\"",
            "angle = \"-1 deg\"",
            "t.toml, line 24, column 8: tool `pliers`: at -1 deg its jaws overlap; close them to 0 deg at most, or give \
             them a larger `jaw_gap`",
        ),
        (
            "angle = \"40 deg\"",
            "angle = \"200 deg\"",
            "t.toml, line 24, column 8: tool `pliers`: 200 deg is no angle of jaws; open them to 160.428 deg at most",
        ),
        (
            "jaw = [{ time = 0, angle = \"40 deg\" }]",
            "",
            "t.toml, line 19, column 1: tool `pliers`: a grasper needs `jaw` or `closing_force`, for example jaw = [{ \
             time = 0, angle = \"40 deg\" }]",
        ),
        (
            "jaw = [",
            "closing_force = [{ time = 0, force = \"1 N\" }]\njaw = [",
            "t.toml, line 19, column 1: tool `pliers`: `jaw` and `closing_force` exclude each other; keep one",
        ),
        (
            "jaw = [",
            "closing_time = \"1 s\"\njaw = [",
            "t.toml, line 19, column 1: tool `pliers`: `closing_time` means nothing for jaws with `jaw`; leave it out",
        ),
        (
            "angle = \"40 deg\" }",
            "angle = \"40 deg\" }, { time = 0, angle = \"20 deg\" }",
            "t.toml, line 24, column 40: tool `pliers`: its key at 0 s follows one at 0 s; times must ascend",
        ),
        (
            "jaw = [",
            "lock = [{ from = \"2 s\", to = \"1 s\" }]\njaw = [",
            "t.toml, line 24, column 9: tool `pliers`: its lock ends at 1 s, before it begins; swap the two",
        ),
        (
            "jaw = [",
            "rounding = \"3 mm\"\njaw = [",
            "t.toml, line 19, column 1: tool `pliers`: a box needs sizes above zero, and edges rounded by half the \
             smallest at most",
        ),
    ] {
        assert_eq!(parse(&replaced(old, new)).map(|_| ()), Err(message.to_owned()));
    }
    // With a gap they may close further.
    let text = replaced("angle = \"40 deg\"", "angle = \"-10 deg\"");
    let text = text.replace("jaw = [", "jaw_gap = \"3 mm\"\njaw = [");
    assert!(parse(&text).is_ok());
}

#[test]
fn paths_that_cannot_be_followed_are_refused() {
    let text = replaced(
        "keys = [{ time = \"1 s\", translation = [0, 0, \"-5 mm\"] }]",
        "path = \"p.csv\"",
    );
    assert_eq!(parse(&text).expect("a scene").files(), ["p.csv"]);
    let rows = "time,x,y,z,rx,ry,rz\n0,0,0,0,0,0,0\n1,0.01,0,0,0,0,0.5\n";
    let assembly = assemble(&text, Some(rows)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(assembly.tools[0].pose(0.5).translation.x, 0.015);
    let place = "t.toml, line 12, column 1: tool `ball`";
    for (file, message) in [
        (None, "p.csv: there is no such file beside the scene; put it there".to_owned()),
        (
            Some(""),
            format!(
                "{place}: p.csv: the path is empty; write rows of time, x, y, z, rx, ry, rz in seconds, metres and \
                 radians"
            ),
        ),
        (
            Some("0,0,0,0,0,0,0\n1,0,NaN,0,0,0,0\n"),
            format!(
                "{place}: p.csv, line 2: `NaN` is no finite number; leave out rows in which the tool was not seen"
            ),
        ),
        (
            Some("1,0,0,0,0,0,0\n0,0,0,0,0,0,0\n"),
            format!(
                "{place}: p.csv, line 2: its time 0 s follows 1 s; times must ascend, so sort the rows and keep one of \
                 each time"
            ),
        ),
    ] {
        assert_eq!(assemble(&text, file).map(|_| ()), Err(message));
    }
}

#[test]
fn tools_that_tissue_cannot_meet_are_refused() {
    for (old, new, message) in [
        (
            "\"20 mm\"]\nkeys",
            "\"12 mm\"]\nkeys",
            "t.toml, line 12, column 1: tool `ball` begins 1.945 mm inside body `block`; move its position away from it",
        ),
        (
            "radius = \"4 mm\"",
            "radius = \"0.5 mm\"",
            "t.toml, line 12, column 1: tool `ball` has a radius of 0.500 mm at its thinnest, and `block` is touched at \
             points about 0.745 mm apart; take a finer mesh of `block` or a thicker tool",
        ),
        (
            "position = [0, 0, \"-5 mm\"]",
            "position = [0, 0, \"2 mm\"]",
            "t.toml, line 26, column 1: tool `tool 2` begins 1.583 mm inside body `block`; move its position away from it",
        ),
    ] {
        assert_eq!(assemble(&replaced(old, new), None).map(|_| ()), Err(message.to_owned()));
    }
    // An obstacle may reach into what is fixed, and touch what is not.
    let table =
        GOOD.replace("half_space = { point = [0, 0, 0]", "half_space = { point = [0, 0, \"5 mm\"]");
    for height in ["0", "\"4.9 mm\""] {
        let text = table.replace("[0, 0, \"-5 mm\"]\n", &format!("[0, 0, {height}]\n"));
        let assembled = assemble(&text, None).map(|_| ());
        assert_eq!(assembled, Ok(()), "{height}");
    }
}

#[test]
fn a_ball_without_tetrahedra_is_no_region() {
    let region =
        "material = { young = \"5 kPa\" }\n[[body.region]]\nlabel = 1\nyoung = \"50 kPa\"\n";
    let text =
        |ball: &str| replaced("material = { young = \"5 kPa\" }\n", &format!("{region}{ball}\n"));
    let ball = "sphere = { center = [\"10 mm\", \"10 mm\", \"5 mm\"], radius = \"4 mm\" }";
    let assembly = assemble(&text(ball), None).unwrap_or_else(|e| panic!("{e}"));
    let mesh = &assembly.bodies[0].mesh;
    let count = mesh.regions().iter().filter(|label| **label == 1).count();
    assert!(count > 5 && count < mesh.tets().len() / 2, "{count}");
    let error = assemble(&text(&ball.replace("\"5 mm\"]", "\"50 mm\"]")), None).map(|_| ());
    let error = error.expect_err("a ball in the air");
    assert!(
        error.starts_with("body `block`, region 1: no tetrahedron has its middle in the ball, the nearest one is 3"),
        "{error}"
    );
}
