//! States of rest that scenes lead to.

use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};
use viscera_reference::{Course, DEFAULT_MEMORY, ReferenceError, Undetermined, check_determined};

fn simulation(text: &str) -> Simulation<f64> {
    let scene = Scene::parse("scene.toml", text, &[]).expect("a legal scene");
    let assembly = Assembly::new(&scene, &mut |_| Err("no files".to_owned())).expect("meshes");
    Simulation::new(scene, assembly).expect("a simulation")
}

/// A bar that is turned at its end by a whole turn.
const TWIST: &str = r#"
[world]
gravity = "0 m/s^2"

[[body]]
name = "bar"
shape = "beam"
length = "120 mm"
width = "40 mm"
height = "40 mm"
cells_across = 2
material = { young = "10 kPa", poisson = 0.45 }

[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[motion]]
name = "chuck"
body = "bar"
half_space = { point = ["120 mm", 0, 0], normal = [1, 0, 0] }
interpolation = "linear"
keys = [{ time = "1 s", rotation_axis = [1, 0, 0], rotation_angle = "360 deg" }]
"#;

/// Where pins are at the end is where they were at the beginning: only the way tells that the bar is twisted.
#[test]
fn motions_are_followed_on_their_way() {
    let simulation = simulation(TWIST);
    let mut course = Course::new(&simulation, DEFAULT_MEMORY);
    let rest = course.rest().to_vec();
    let at_once = course.go((0.0, &rest), 1.0).expect("a state of rest");
    let mut here = rest.clone();
    for step in 1..=24 {
        let [before, time] = [step - 1, step].map(|step| f64::from(step) / 24.0);
        here = course.go((before, &here), time).expect("a state of rest").positions;
    }
    let farthest = |a: &[Vec3<f64>], b: &[Vec3<f64>]| {
        a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
    };
    assert!(farthest(&here, &rest) > 0.03, "its middle has turned by half a turn");
    assert!(farthest(&here, &at_once.positions) < 1e-9);
}

/// What goes far in one frame is left to Newton's method.
#[test]
fn a_motion_of_one_frame_is_followed() {
    let text = TWIST
        .replace("keys = [{ time = \"1 s\"", "keys = [{ time = \"16 ms\"")
        .replace("360 deg", "150 deg");
    let simulation = simulation(&text);
    let mut course = Course::new(&simulation, DEFAULT_MEMORY);
    let rest = course.rest().to_vec();
    let state = course.go((0.0, &rest), 0.1).expect("a state of rest");
    assert!(state.convergence.minimum);
    let volume = |x: &[Vec3<f64>]| {
        let tet = simulation.model().tets().map(|tet| {
            let [a, b, c, d] = tet.vertices.map(|v| x[v as usize]);
            (b - a).cross(c - a).dot(d - a)
        });
        tet.fold(f64::INFINITY, f64::min)
    };
    assert!(volume(&state.positions) > 0.0, "nothing is inside out");
}

/// A bar that is folded onto itself.
#[test]
fn tissue_that_passes_through_itself_is_told() {
    let text = TWIST
        .replace("360 deg", "175 deg")
        .replace(
            "rotation_axis = [1, 0, 0]",
            "translation = [\"-110 mm\", 0, \"2 mm\"], rotation_axis = [0, 1, 0]",
        )
        .replace("40 mm", "15 mm")
        .replace("cells_across = 2", "cells_across = 1");
    let settled = |text: &str| {
        let simulation = simulation(text);
        let mut course = Course::new(&simulation, DEFAULT_MEMORY);
        let rest = course.rest().to_vec();
        course.go((0.0, &rest), 1.0).map(|_| ())
    };
    let told = settled(&text).expect_err("it meets itself");
    assert!(matches!(told, ReferenceError::Overlap { .. }), "{told}");
    assert!(told.to_string().contains("contact.self = false"));
    settled(&format!("{text}\n[contact]\nself = false\n"))
        .expect("a state of rest, as was asked for");
}

/// A pad that a probe is pressed into.
const PAD: &str = r#"
[[body]]
name = "pad"
shape = "block"
size = ["60 mm", "60 mm", "20 mm"]
cells = [6, 6, 2]
material = { young = "5 kPa", poisson = 0.45 }

[[fixing]]
body = "pad"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }

[[tool]]
name = "probe"
kind = "probe"
radius = "6 mm"
length = "60 mm"
position = ["30 mm", "30 mm", "27 mm"]
keys = [{ time = "TIME", translation = [0, 0, "-10 mm"] }]
"#;

/// At once a probe would push tissue out on its other side.
#[test]
fn a_tool_presses_on_its_way_however_fast_it_comes() {
    let force = |time: &str, stops: &[f64]| {
        let simulation = simulation(&PAD.replace("TIME", time));
        let mut course = Course::new(&simulation, DEFAULT_MEMORY);
        let (mut before, mut here) = (0.0, course.rest().to_vec());
        let mut last = Vec3::ZERO;
        for &stop in stops {
            let state = course.go((before, &here), stop).expect("a state of rest");
            last = state.wrenches[0].force;
            (before, here) = (stop, state.positions);
        }
        last.z
    };
    let slowly: Vec<f64> = (1..=40).map(|part| f64::from(part) / 40.0).collect();
    let slow = force("1 s", &slowly);
    assert!(slow.abs() > 0.5, "{slow} N");
    for (time, stops) in [("1 s", [1.0]), ("16 ms", [1.0])] {
        let fast = force(time, &stops);
        assert!((fast - slow).abs() < 1e-8, "{time}: {fast} N for {slow} N");
    }
}

#[test]
fn a_solve_ends_where_nobody_wants_it() {
    let simulation = simulation(TWIST);
    let mut course = Course::new(&simulation, DEFAULT_MEMORY).stop_where(|| false);
    let rest = course.rest().to_vec();
    let ended = course.go((0.0, &rest), 1.0).expect_err("nothing was computed");
    assert_eq!(ended, ReferenceError::Stopped);
}

#[test]
fn what_rest_does_not_determine_is_told() {
    let told = |more: &str| {
        let scene = Scene::parse("scene.toml", &format!("{TWIST}{more}"), &[]).expect("a scene");
        check_determined(&scene).expect_err("undetermined").to_string()
    };
    let late = TWIST.replace("interpolation", "start = \"0.1 s\"\ninterpolation");
    let scene = Scene::parse("scene.toml", &late, &[]).expect("a scene");
    let found = check_determined(&scene);
    assert_eq!(found, Err(Undetermined::LateHold { name: "chuck".to_owned(), start: 0.1 }));
    let second = "[[body]]\nname = \"ball\"\nshape = \"sphere\"\nradius = \"10 mm\"\n\
                  material = { young = \"1 kPa\", poisson = 0.4 }\n";
    assert!(told(second).contains("contact.bodies = false"));
    let probe = "[[tool]]\nname = \"probe\"\nkind = \"probe\"\nradius = \"4 mm\"\nlength = \"60 mm\"\n\
                 position = [0, 0, \"0.3 m\"]\nbegin = \"0.5 s\"\n";
    assert!(told(probe).contains("probe` comes at 0.5 s"));
    let held = |key: &str| probe.replace("begin = \"0.5 s\"", key);
    assert!(told(&held("end = \"0.5 s\"")).contains("probe` leaves at 0.5 s"));
    assert!(told(&held("spring = \"100 N/m\"")).contains("spring holds tool `probe`"));
    let change = "[[change]]\ntime = \"0.5 s\"\nset = [\"solver.substeps = 2\"]\n";
    assert!(told(change).contains("settings change at 0.5 s"));
}
