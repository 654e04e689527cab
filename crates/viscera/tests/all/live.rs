//! What is done to a running simulation by hand, and that a scene file repeats it.

use crate::common::device;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::scene::{Patch, Scene, Selector};
use viscera::settings::{Method, Place, SolverSettings};
use viscera::simulation::{Assembly, LiveError, PatchKind, Simulation, SimulationError};

const BAR: &str = r#"
[time]
velocity_factor = 0.98

[[body]]
name = "bar"
shape = "beam"
length = "60 mm"
width = "20 mm"
height = "20 mm"
cells_across = 2
material = { young = "4 kPa", poisson = 0.4 }

[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[change]]
time = "0.3 s"
set = ["world.gravity = 5 m/s^2"]
"#;

const FRAME: f64 = 1.0 / 60.0;

fn simulation<S: Real>(text: &str, overrides: &[(&str, &str)]) -> Simulation<S> {
    let scene = Scene::parse("bar.toml", text, overrides).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    Simulation::new(scene, assembly).unwrap_or_else(|e| panic!("{e}"))
}

/// An assembly of another scene, and patches of another assembly, are refused.
#[test]
fn patches_of_other_meshes_are_refused() {
    let scene = |text: &str| Scene::parse("bar.toml", text, &[]).unwrap_or_else(|e| panic!("{e}"));
    let assemble = |scene: &Scene| {
        Assembly::new(scene, &mut |file| Err(file.to_owned())).expect("an assembly")
    };
    let short = scene(BAR);
    let fixing = "[[fixing]]\nname = \"end\"\nbody = \"bar\"\n\
                  half_space = { point = [\"60 mm\", 0, 0], normal = [1, 0, 0] }\n";
    let held_twice = scene(&format!("{BAR}\n{fixing}"));
    let error = Simulation::<f32>::new(held_twice, assemble(&short)).expect_err("another scene");
    let (what, found, expected) = ("fixings", 1, 2);
    assert_eq!(error, SimulationError::OtherScene { what, found, expected });

    let long = scene(&BAR.replace("60 mm", "120 mm"));
    let mut of_long = Simulation::<f32>::new(long.clone(), assemble(&long)).expect("a bar");
    let far = Selector::Nearest { point: vec3(0.12, 0.01, 0.01), count: 1 };
    let hold = of_long.take_hold("hand", Patch { selector: far, ..tip() }, None).expect("a hold");
    let foreign = of_long.assembly().motions[hold].clone();
    let vertex = foreign.vertices[0];
    let mut mixed = assemble(&short);
    let vertex_count = mixed.builder.positions().len();
    mixed.fixings[0] = foreign;
    let error = Simulation::<f32>::new(short, mixed).expect_err("a patch of another assembly");
    assert_eq!(error, SimulationError::Patch { vertex, vertex_count });
}

fn tip() -> Patch {
    let place = Place::Override { key: "hand".into() };
    let selector = Selector::Nearest { point: vec3(0.06, 0.01, 0.01), count: 4 };
    Patch { body: 0, selector, purpose: "hand".into(), place }
}

fn pairs(settings: &[(&str, &str)]) -> Vec<(String, String)> {
    settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
}

fn frames<S: Real>(simulation: &mut Simulation<S>, count: u32) {
    for _ in 0..count {
        simulation.advance_frame().unwrap_or_else(|e| panic!("{e}"));
    }
}

/// Takes hold twice, drags, stiffens and softens, changes the method, lets one hold go.
fn handle<S: Real>(simulation: &mut Simulation<S>) {
    handle_for(simulation, [20, 50]);
}

/// The same, dragged near for so many frames and far for so many.
fn handle_for<S: Real>(simulation: &mut Simulation<S>, [near, far]: [u32; 2]) {
    frames(simulation, 5);
    let hold = simulation.take_hold("hand", tip(), Some(150.0)).expect("a hold");
    for frame in 0..near {
        let up = vec3(0.0, 0.1e-3, 0.7e-3) * f64::from(frame);
        simulation.lead(hold, up).expect("a place");
        frames(simulation, 1);
        if frame == near / 3 {
            let stiffer = [("body.bar.material.young", "20 kPa"), ("solver.substeps", "4")];
            simulation.change(&pairs(&stiffer)).expect("a change");
        }
    }
    frames(simulation, 3);
    // Far, for long: the ends of many frames are a rounding away from the sums of their substeps.
    for frame in 0..far {
        let way = vec3(0.02, 0.007, -0.003) * (0.37 * f64::from(frame)).sin();
        simulation.lead(hold, way).expect("a place");
        frames(simulation, 1);
    }
    frames(simulation, 3);
    // Having stood still, it goes on from there.
    simulation.lead(hold, vec3(0.01, 0.0, 0.01)).expect("a place");
    simulation
        .change(&pairs(&[("solver.colors", "1"), ("solver.iterations", "12")]))
        .expect("both");
    let second = simulation.take_hold("hand", tip(), None).expect("a rigid hold");
    frames(simulation, 2);
    simulation.lead(second, vec3(0.0, 0.002, 0.0)).expect("a place");
    frames(simulation, 2);
    simulation.let_go(second).expect("a hold");
    frames(simulation, 3);
    simulation.let_go(hold).expect("a hold");
    frames(simulation, 6);
}

/// Frames that a hold is led for, twice: a visit of a few seconds.
const A_VISIT: [u32; 2] = [20, 50];

fn repeat_for<S: Real>(overrides: &[(&str, &str)], frames_led: [u32; 2]) {
    let mut by_hand: Simulation<S> = simulation(BAR, overrides);
    handle_for(&mut by_hand, frames_led);
    let live = by_hand.live();
    assert_eq!((live.motions.len(), live.changes.len()), (2, 2));
    let saved = format!("{BAR}{}", by_hand.scene().write(&live.motions, &live.changes));
    let mut repeated: Simulation<S> = simulation(&saved, overrides);
    frames(&mut repeated, by_hand.frame() as u32);
    assert_eq!(by_hand.state().positions, repeated.state().positions);
    assert_eq!(by_hand.state().velocities, repeated.state().velocities);
    assert_eq!(by_hand.state().multipliers, repeated.state().multipliers);
    for (done, read) in by_hand.scene().motions.iter().zip(&repeated.scene().motions) {
        assert_eq!((&done.keys, &done.name, done.release), (&read.keys, &read.name, read.release));
    }
    assert_eq!(by_hand.scene().solver, repeated.scene().solver);
}

#[test]
fn a_saved_scene_repeats_what_was_done_by_hand_to_the_bit() {
    repeat_for::<f32>(&[], A_VISIT);
    repeat_for::<f64>(&[("solver.precision", "f64")], A_VISIT);
    repeat_for::<f32>(&[("solver.method", "explicit")], A_VISIT);
}

#[test]
fn on_a_device_as_well() {
    device::device();
    let few = [("solver.device", "gpu"), ("solver.iterations", "2"), ("solver.substeps", "2")];
    repeat_for::<f32>(&few, [3, 2]);
}

#[test]
#[ignore = "slow: some fifty frames, twice"]
fn on_a_device_as_well_at_length() {
    repeat_for::<f32>(&[("solver.device", "gpu")], [10, 20]);
}

#[test]
fn a_hold_pulls_and_its_force_is_reported() {
    let mut simulation: Simulation<f64> = simulation(BAR, &[("solver.precision", "f64")]);
    let hold = simulation.take_hold("hand", tip(), Some(150.0)).expect("a hold");
    simulation.lead(hold, vec3(0.0, 0.0, 0.02)).expect("a place");
    frames(&mut simulation, 12);
    let report = simulation.report();
    let force = report.patches.iter().find(|p| p.kind == PatchKind::Motion).expect("the hold");
    // Stiffness times the mean distance from where it is pulled to.
    let patch = &simulation.assembly().motions[hold].vertices;
    let rest = &simulation.model().rest_positions;
    let mean = patch.iter().fold(Vec3::ZERO, |sum, &v| {
        let target = rest[v as usize] + vec3(0.0, 0.0, 0.02);
        sum + (target - simulation.state().positions[v as usize]) * (1.0 / patch.len() as f64)
    });
    let expected = mean * 150.0;
    let off = (Vec3::from_f64(force.force) - expected).length();
    assert!(off < 1e-12 && expected.length() > 0.05, "{off} N, {expected:?}");
    let shown = simulation.hold(hold).expect("it holds");
    assert!((shown.force - expected).length() < 1e-12);
    assert!((shown.target - shown.place - mean).length() < 1e-15);
    simulation.let_go(hold).expect("a hold");
    frames(&mut simulation, 1);
    let report = simulation.report();
    let force = report.patches.iter().find(|p| p.kind == PatchKind::Motion).expect("the hold");
    assert_eq!(force.force, [0.0; 3]);
    assert_eq!(simulation.hold(hold), None);
}

#[test]
fn a_hold_that_stands_still_needs_no_keys() {
    let mut simulation: Simulation<f32> = simulation(BAR, &[]);
    let hold = simulation.take_hold("hand", tip(), Some(50.0)).expect("a hold");
    for _ in 0..50 {
        simulation.lead(hold, vec3(0.0, 0.0, 0.01)).expect("a place");
        frames(&mut simulation, 1);
    }
    let keys = &simulation.scene().motions[hold].keys;
    assert_eq!(keys.len(), 3, "{keys:?}");
    assert!((keys[1].time - FRAME).abs() < 1e-12 && (keys[2].time - 50.0 * FRAME).abs() < 1e-9);
}

#[test]
fn reset_is_a_new_run_with_the_settings_of_the_hand() {
    let mut by_hand: Simulation<f32> = simulation(BAR, &[]);
    handle(&mut by_hand);
    by_hand.reset().expect("a reset");
    let settings = [
        ("body.bar.material.young", "20 kPa"),
        ("solver.substeps", "4"),
        ("solver.colors", "1"),
        ("solver.iterations", "12"),
    ];
    let mut fresh: Simulation<f32> = simulation(BAR, &settings);
    assert_eq!((by_hand.frame(), by_hand.live()), (0, Default::default()));
    assert_eq!(by_hand.state(), fresh.state());
    assert_eq!((by_hand.tets(), by_hand.report()), (fresh.tets(), fresh.report()));
    // Past the file's own change.
    frames(&mut by_hand, 25);
    frames(&mut fresh, 25);
    assert_eq!(by_hand.state().positions, fresh.state().positions);
}

/// As undo in a window has it: they are the numbers that they stand for.
#[test]
fn counts_go_back_to_automatic_ones() {
    let there_and_back = |iterations: &str, substeps: &str| {
        let mut changed: Simulation<f32> = simulation(BAR, &[("solver.method", "xpbd")]);
        for counts in [["7", "3"], [iterations, substeps]] {
            let [iterations, substeps] = counts;
            let counts = [("solver.iterations", iterations), ("solver.substeps", substeps)];
            changed.change(&pairs(&counts)).expect("other counts");
            frames(&mut changed, 2);
        }
        changed
    };
    let automatic = there_and_back("\"auto\"", "auto");
    let method = Method::Xpbd;
    assert_eq!(automatic.scene().solver, SolverSettings { method, ..SolverSettings::default() });
    let numbers = there_and_back("2", "10");
    assert_eq!(automatic.state().positions, numbers.state().positions);
}

#[test]
fn what_cannot_be_done_changes_nothing() {
    let mut touched: Simulation<f32> = simulation(BAR, &[]);
    let mut untouched: Simulation<f32> = simulation(BAR, &[]);
    frames(&mut touched, 2);
    for (key, value) in [
        ("solver.precision", "f64"),
        ("solver.iterations", "0"),
        ("solver.iteration", "3"),
        ("body.bar.material.young", "-1 kPa"),
        ("body.bar.material.poisson", "nan"),
        ("body.liver.material.young", "1 kPa"),
        ("body.bar.length", "1 m"),
        ("time.frame", "1 s"),
        ("solver.device", "no such device"),
        ("solver", "1"),
        ("", ""),
    ] {
        let error = touched.change(&pairs(&[("solver.substeps", "7"), (key, value)]));
        let text = error.expect_err(key).to_string();
        assert!(text.len() > 20, "{key}: {text}");
    }
    let away = Patch { body: 3, ..tip() };
    assert!(matches!(touched.take_hold("hand", away, None), Err(LiveError::NoBody { .. })));
    let nowhere = Selector::Sphere { center: vec3(1.0, 0.0, 0.0), radius: 0.01 };
    let nowhere = Patch { selector: nowhere, ..tip() };
    assert!(matches!(touched.take_hold("hand", nowhere, None), Err(LiveError::Patch(_))));
    for stiffness in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(touched.take_hold("hand", tip(), Some(stiffness)).is_err());
    }
    assert!(touched.lead(0, Vec3::ZERO).is_err() && touched.let_go(5).is_err());
    assert_eq!(touched.live(), Default::default());
    frames(&mut touched, 3);
    frames(&mut untouched, 5);
    assert_eq!(touched.state(), untouched.state());
    let hold = touched.take_hold("hand", tip(), None).expect("a hold");
    assert!(matches!(touched.lead(hold, vec3(f64::NAN, 0.0, 0.0)), Err(LiveError::NotFinite)));
    touched.let_go(hold).expect("a hold");
    assert!(matches!(touched.let_go(hold), Err(LiveError::NoHold { .. })));
}

#[test]
fn changes_and_starts_that_cannot_be_are_told_before_the_run() {
    let change = |set: &str| format!("{BAR}\n[[change]]\ntime = \"1 s\"\nset = [{set}]\n");
    let motion =
        "[[motion]]\nbody = \"bar\"\nregion = 0\nstart = \"2 s\"\nkeys = [{ time = \"1 s\" }]";
    for (text, expected) in [
        (change("\"solver.iterations\""), "write KEY = VALUE"),
        (change("\"solver.iterations = 0\""), "1 to 10000"),
        (change("\"solver.precision = f64\""), "cannot change while the scene runs"),
        (change("\"body.bar.shape = liver\""), "cannot change while the scene runs"),
        (change("7"), "text in quotes"),
        (format!("{BAR}\n{motion}"), "before its start"),
    ] {
        let error = Scene::parse("bar.toml", &text, &[]).expect_err(expected).to_string();
        assert!(error.contains("bar.toml, line") && error.contains(expected), "{error}");
    }
}

#[test]
fn a_fork_goes_on_from_the_same_state_with_settings_of_its_own() {
    let mut first: Simulation<f32> = simulation(BAR, &[("solver.method", "quasi_newton")]);
    frames(&mut first, 5);
    let hold = first.take_hold("hand", tip(), Some(150.0)).expect("a hold");
    first.lead(hold, vec3(0.0, 0.0, 0.01)).expect("a place");
    frames(&mut first, 3);
    let mut same: Simulation<f32> = first.fork(&[]).expect("a fork");
    let mut exact: Simulation<f64> =
        first.fork(&pairs(&[("solver.iterations", "20")])).expect("a fork in double precision");
    assert_eq!(same.state().positions, first.state().positions);
    assert_eq!((exact.time(), exact.live()), (first.time(), first.live()));
    for _ in 0..10 {
        first.advance().expect("a frame");
        same.advance().expect("a frame");
        exact.advance().expect("a frame");
    }
    // With the same settings it is the same to the bit; otherwise near, and held as well.
    let apart = |a: &[Vec3<f32>], b: Vec<Vec3<f64>>| {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| (a.cast::<f64>() - b).length()).fold(0.0, f64::max)
    };
    let double = |all: &[Vec3<f32>]| all.iter().map(|x| x.cast()).collect::<Vec<Vec3<f64>>>();
    let rest = first.model().rest_positions.clone();
    let moved = apart(&rest, double(&first.state().positions));
    assert_eq!(first.state(), same.state());
    assert!(apart(&first.state().positions, exact.state().positions.clone()) < 0.1 * moved);
    assert!(exact.hold(hold).is_some_and(|hold| hold.force.length() > 0.01));
}

/// 222 frames of a sixtieth of a second end a rounding before 3.7 s: a change of the file's is made there, and one
/// by hand comes behind it.
#[test]
fn a_change_by_hand_stays_behind_the_files_of_the_same_frame() {
    let text = BAR.replace("time = \"0.3 s\"", "time = \"3.7 s\"");
    let mut by_hand: Simulation<f32> = simulation(&text, &[]);
    for _ in 0..222 {
        by_hand.advance().expect("a frame");
    }
    assert!(by_hand.time() < 3.7);
    by_hand.change(&pairs(&[("world.gravity", "3 m/s^2")])).expect("a change");
    let live = by_hand.live();
    let saved = format!("{text}{}", by_hand.scene().write(&live.motions, &live.changes));
    let mut repeated: Simulation<f32> = simulation(&saved, &[]);
    for _ in 0..222 {
        repeated.advance().expect("a frame");
    }
    by_hand.advance().expect("a frame");
    repeated.advance().expect("a frame");
    assert_eq!(by_hand.scene().world, repeated.scene().world);
    assert_eq!(by_hand.state(), repeated.state());
}

#[test]
fn what_is_measured_after_a_change_is_still_of_the_last_step() {
    let mut simulation: Simulation<f64> = simulation(BAR, &[("solver.precision", "f64")]);
    frames(&mut simulation, 10);
    let before = simulation.report();
    simulation.change(&pairs(&[("solver.iterations", "7")])).expect("a change");
    simulation.measure().expect("measures");
    assert_eq!(simulation.report().patches, before.patches);
    assert!(before.relative_residual > 0.0);
    assert_eq!(simulation.report().relative_residual, before.relative_residual);
    let fork: Simulation<f32> = simulation.fork(&[]).expect("a fork");
    assert_eq!(fork.report().relative_residual, before.relative_residual);
}

/// Another language's view of positions stays good: frames, holds, changes of settings and a reset leave them where
/// they are.
#[test]
fn positions_stay_where_they_are_in_memory() {
    let mut simulation = simulation::<f32>(BAR, &[("solver.device", "cpu")]);
    let place = simulation.state().positions.as_ptr();
    let hold = simulation.take_hold("hand", tip(), Some(50.0)).expect("a hold");
    simulation.lead(hold, vec3(0.0, 0.0, 0.01)).expect("a hold");
    frames(&mut simulation, 25);
    simulation.change(&pairs(&[("solver.colors", "1")])).expect("a setting");
    frames(&mut simulation, 2);
    assert_ne!(simulation.state().positions, simulation.model().rest_positions);
    simulation.reset().expect("a model");
    assert_eq!(simulation.state().positions, simulation.model().rest_positions);
    frames(&mut simulation, 2);
    assert_eq!(simulation.state().positions.as_ptr(), place);
}
