//! `viscera bench-scene`: the protocol of the peers' benchmark, and the library's own motion.

use crate::common::{Bench, End, numbers};
use serde_json::{Value, json};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::{TetMesh, io, shapes};
use viscera::model::ModelBuilder;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Count, Elements, SolverSettings};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const LENGTH: f64 = 0.04;
const DT: f64 = 1.0 / 60.0;
const RAMP: f64 = 0.05;
const TRAVEL: Vec3<f64> = vec3(0.008, 0.0, 0.002);
const FACTOR: f64 = 0.9;
const FRAMES: u32 = 5;

fn mesh() -> TetMesh {
    shapes::beam(LENGTH, 0.02, 0.02, 1, 0.0).expect("a beam")
}

fn on_face(mesh: &TetMesh, x: f64) -> Vec<u32> {
    let near = |p: &Vec3<f64>| (p.x - x).abs() < 1e-9;
    (0u32..).zip(mesh.vertices()).filter(|(_, p)| near(p)).map(|(v, _)| v).collect()
}

/// The beam, clamped at both ends, one of which is pulled away.
fn scene() -> Value {
    let mesh = mesh();
    let moving = on_face(&mesh, LENGTH);
    let fixed = [on_face(&mesh, 0.0), moving.clone()].concat();
    json!({
        "name": "B", "mesh": "mesh.msh", "youngs_modulus": 5e3, "poisson_ratio": 0.3,
        "density": 1000.0, "gravity": [0.0, 0.0, -9.81], "dt": DT, "frames": FRAMES,
        "fixed": fixed, "moving": moving,
        "displacement": TRAVEL.to_array(), "ramp_seconds": RAMP,
        "velocity_factor_per_frame": FACTOR,
    })
}

fn bench_with(scene: &Value) -> Bench {
    let bench = Bench::new("");
    std::fs::create_dir(bench.path("scene")).expect("a folder for the scene");
    bench.write("scene/scene.json", scene.to_string().as_bytes());
    bench.write("scene/mesh.msh", io::gmsh::write(&mesh()).as_bytes());
    bench
}

fn run(bench: &Bench, arguments: &[&str]) -> End {
    bench.end_of(&[&["bench-scene", "--scene", "scene", "--out", "out"], arguments].concat())
}

fn positions(bench: &Bench) -> Vec<f64> {
    let text = String::from_utf8(bench.read("out/positions.txt")).expect("text");
    assert!(text.lines().all(|line| line.split(' ').count() == 3), "{text}");
    text.split_whitespace().map(|word| word.parse().expect("a number")).collect()
}

fn timing(bench: &Bench) -> Value {
    serde_json::from_slice(&bench.read("out/timing.json")).expect("timing.json is JSON")
}

/// Positions after each frame by the library, step by step.
fn library<S: Real>(model: MaterialModel, settings: &SolverSettings, factor: f64) -> Vec<Vec<f64>> {
    let mesh = mesh();
    let mut builder = ModelBuilder::new();
    let tissue = Material::new(model, 5e3, 0.3, 1000.0).expect("a material");
    builder.add_body(&mesh, &tissue).expect("a body");
    let model = builder.build::<S>().expect("a model");
    let (mut solver, mut state) = (Solver::new(&model, settings), State::at_rest(&model));
    let share = |frame: u32| {
        let s = (f64::from(frame) * DT / RAMP).min(1.0);
        s * s * (3.0 - 2.0 * s)
    };
    let (held, moving) = (on_face(&mesh, 0.0), on_face(&mesh, LENGTH));
    let mut frames = Vec::new();
    for frame in 0..FRAMES {
        for substep in 1..=settings.substeps() {
            let part = f64::from(substep) / f64::from(settings.substeps());
            let now = share(frame) + (share(frame + 1) - share(frame)) * part;
            let pin = |v: &u32, by: Vec3<f64>| {
                let target = mesh.vertices()[*v as usize] + by;
                Pin { vertex: *v, target: target.cast() }
            };
            let mut pins: Vec<_> = held.iter().map(|v| pin(v, Vec3::ZERO)).collect();
            pins.extend(moving.iter().map(|v| pin(v, TRAVEL * now)));
            let gravity = Vec3::from_f64([0.0, 0.0, -9.81]);
            let inputs = Inputs { gravity, pins, ..Inputs::default() };
            solver
                .step(&model, &mut state, &inputs, DT / f64::from(settings.substeps()))
                .expect("a step");
        }
        frames.push(state.positions.iter().flat_map(|x| x.cast::<f64>().to_array()).collect());
        for (velocity, x) in state.velocities.iter_mut().zip(mesh.vertices()) {
            let is_free = x.x > 1e-9 && x.x < LENGTH - 1e-9;
            *velocity = *velocity * S::from_f64(if is_free { factor } else { 1.0 });
        }
    }
    frames
}

#[test]
fn a_scene_moves_as_the_library_moves_it_to_the_last_bit() {
    let bench = bench_with(&scene());
    let end = run(&bench, &["--cfg", "method=xpbd"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let stvk = MaterialModel::SaintVenantKirchhoff;
    let expected = library::<f32>(stvk, &SolverSettings::xpbd(), FACTOR);
    assert_eq!(positions(&bench), expected[FRAMES as usize - 1]);
    let timing = timing(&bench);
    assert_eq!(numbers(&timing["wall_ms"]).len(), FRAMES as usize);
    assert_eq!(timing["precision"], "f32");
    assert_eq!(timing["material"], "stvk");
    assert_eq!(timing["threads"], "1");
    assert!(timing["setup_s"].as_f64().is_some_and(|time| time >= 0.0));
    assert!(!bench.files("out").contains("frames.f64"));
}

#[test]
fn settings_are_those_of_the_library_and_the_last_of_a_key_counts() {
    let bench = bench_with(&scene());
    let lists = [
        "method=quasi_newton,substeps=3,iterations=9,material=snh",
        "iterations=4, precision=f64",
        "",
    ];
    let end = run(&bench, &["--cfg", lists[0], "--cfg", lists[1], "--cfg", lists[2]]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let settings = SolverSettings {
        substeps: Count::Of(3),
        iterations: Count::Of(4),
        elements: Elements::Plain,
        ..SolverSettings::default()
    };
    // The benchmark's mesh as it is, unless other elements are asked for.
    let expected = library::<f64>(MaterialModel::StableNeoHookean, &settings, FACTOR);
    assert_eq!(positions(&bench), expected[FRAMES as usize - 1]);
    assert_eq!(timing(&bench)["material"], "snh");
    assert_eq!(timing(&bench)["precision"], "f64");
}

#[test]
fn automatic_is_the_method_that_a_scene_would_take_at_the_asked_accuracy() {
    let mut stiff = scene();
    stiff["youngs_modulus"] = json!(5e7);
    stiff["poisson_ratio"] = json!(0.49);
    let bench = bench_with(&stiff);
    let methods = ["draft", "fine"].map(|accuracy| {
        let end = run(&bench, &["--cfg", &format!("material=snh,accuracy={accuracy}")]);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        timing(&bench)["method"].clone()
    });
    assert_eq!(methods, ["quasi_newton", "quasi_newton"]);
    let bench = bench_with(&scene());
    let end = run(&bench, &["--cfg", "material=snh,accuracy=fine"]);
    assert_eq!((end.code, &timing(&bench)["method"]), (Some(0), &json!("explicit")));
    // It is the explicit method's own motion, but for smaller steps.
    let settings =
        SolverSettings { method: viscera::settings::Method::Explicit, ..SolverSettings::default() };
    let expected = library::<f32>(MaterialModel::StableNeoHookean, &settings, FACTOR);
    let pairs = positions(&bench).into_iter().zip(&expected[FRAMES as usize - 1]);
    let away = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(away < 0.02 * LENGTH && away > 0.0, "{away}");
}

#[test]
fn a_transient_run_keeps_its_speed_and_writes_every_frame() {
    let bench = bench_with(&scene());
    let end = run(&bench, &["--transient", "--frames", "4", "--cfg", "precision=f64,method=xpbd"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let bytes = bench.read("out/frames.f64");
    let number = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().expect("eight bytes"));
    let written: Vec<f64> = bytes.chunks(8).map(number).collect();
    let stvk = MaterialModel::SaintVenantKirchhoff;
    let expected = library::<f64>(stvk, &SolverSettings::xpbd(), 1.0);
    assert_eq!(written, expected[..4].concat());
    assert_eq!(positions(&bench), expected[3]);
}

#[test]
fn bad_input_gets_one_error_and_no_results() {
    let changed = |key: &str, value: Value| {
        let mut scene = scene();
        scene[key] = value;
        scene
    };
    let cases: [(Value, &[&str], &str); 9] = [
        (scene(), &["--cfg", "iteratons=3"], "did you mean `iterations`?"),
        (scene(), &["--cfg", "iterations=0"], "it must be 1 to 10000"),
        (scene(), &["--cfg", "iterations"], "write KEY=VALUE"),
        (scene(), &["--cfg", "material=steel"], "the materials are stvk and snh"),
        (changed("mesh", json!("organ.msh")), &[], "there is no such file"),
        (changed("dt", json!("soon")), &[], "no scene of the benchmark"),
        (changed("dt", json!(0.0)), &[], "the step must be above zero"),
        (changed("fixed", json!([999])), &[], "pins vertex 999"),
        (changed("frames", json!(0)), &[], "it has no frames"),
    ];
    for (scene, arguments, expected) in cases {
        let bench = bench_with(&scene);
        let end = run(&bench, arguments);
        assert!(end.error().contains(expected), "{} lacks {expected}", end.error());
        assert_eq!(bench.files("out").len(), 0, "results of a refused run");
    }
}
