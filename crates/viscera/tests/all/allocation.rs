//! A step takes no memory: a haptic loop cannot wait for an allocator. What is taken before is small
//! and known. For several threads see `allocation_threads.rs`.

use crate::common::counting::{bytes_of, requests_of};
use crate::common::{SNH, block, everything, material, single_body};
use viscera::contact::{Held, Shape, Spring, TissueContact, Tool};
use viscera::layout::Layout;
use viscera::material::Material;
use viscera::mesh::{TetMesh, shapes};
use viscera::model::ModelBuilder;
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::scene::Scene;
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Colors, Count, Elements, Method, SolverSettings,
};
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::ContactState;

#[test]
fn the_counter_counts() {
    let requests = requests_of(|| drop(std::hint::black_box(Box::new(1))));
    assert_eq!(requests, 2, "one allocation, one release");
    let (kept, bytes) = bytes_of(|| vec![0u8; 1000]);
    assert_eq!(bytes, kept.len());
}

fn accelerations() -> Vec<SolverSettings> {
    let plain = SolverSettings::xpbd();
    let chebyshev = SolverSettings {
        acceleration: Acceleration::Chebyshev,
        chebyshev_delay: 2,
        chebyshev_damping: 0.8,
        ..plain.clone()
    };
    let mut all = vec![plain.clone(), chebyshev];
    for anderson_on in [AndersonOn::Positions, AndersonOn::Multipliers, AndersonOn::Both] {
        let acceleration = Acceleration::Anderson;
        all.push(SolverSettings { acceleration, anderson_on, ..plain.clone() });
    }
    // Enough sweeps for mixtures that raise the potential.
    let (acceleration, anderson_guard) = (Acceleration::Anderson, AndersonGuard::Energy);
    all.push(SolverSettings { acceleration, anderson_guard, iterations: Count::Of(8), ..plain });
    all
}

fn steps_allocate_nothing<S: Real>() {
    for colors in [Colors::Limited(1), Colors::Limited(4), Colors::Unlimited] {
        let model = everything::<S>();
        let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), ..Inputs::default() };
        for (v, x) in model.rest_positions.iter().enumerate().take(6) {
            inputs.pins.push(Pin { vertex: v as u32, target: *x });
            inputs.forces.push((v as u32 + 10, vec3(0.01, 0.0, 0.0).cast()));
        }
        inputs.anchors = model.rest_anchors.clone();
        for settings in accelerations() {
            for (rebase, keep_multipliers) in [(true, true), (true, false), (false, false)] {
                let settings = SolverSettings {
                    colors,
                    rebase,
                    keep_multipliers,
                    iterations: Count::Of(6),
                    ..settings.clone()
                };
                let mut solver = Solver::new(&model, &settings);
                let mut state = solver.state_at_rest();
                // The first step included: all memory is taken when the solver is built.
                let requests = requests_of(|| {
                    for dt in [1e-3, 1e-3, 2e-3] {
                        solver.step(&model, &mut state, &inputs, dt).expect("a legal step");
                    }
                    solver.restart(&model, &mut state, &inputs, 1e-3).expect("a new history");
                });
                assert_eq!(requests, 0, "{} {settings:?}", S::NAME);

                let mut balance = ForceBalance::default();
                let mut measure = || {
                    let result = solver.force_balance(&model, &state, &inputs, &mut balance);
                    result.expect("a balance");
                };
                measure();
                let requests = requests_of(measure);
                assert_eq!(requests, 0, "force balance, {} {settings:?}", S::NAME);
            }
        }
    }
}

#[test]
fn a_step_in_single_precision_allocates_nothing() {
    steps_allocate_nothing::<f32>();
}

#[test]
fn a_step_in_double_precision_allocates_nothing() {
    steps_allocate_nothing::<f64>();
}

const SCENE: &str = r#"
title = "Everything at once"
description = "Two blocks, tied together, held, moved, pushed and let go."

[time]
duration = "0.2 s"

[[body]]
name = "upper"
shape = "block"
size = ["40 mm", "40 mm", "20 mm"]
cells = [3, 3, 2]
material = { young = "10 kPa", poisson = 0.45, viscosity = "10 ms" }

[[body]]
name = "lower"
shape = "block"
size = ["40 mm", "40 mm", "20 mm"]
cells = [3, 3, 2]
position = [0, 0, "-30 mm"]
material = { young = "10 kPa", poisson = 0.3, model = "saint_venant_kirchhoff" }

[[fixing]]
name = "table"
body = "lower"
half_space = { point = [0, 0, "-30 mm"], normal = [0, 0, -1] }

[[fixing]]
name = "bed"
body = "upper"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
stiffness = "200 N/m"

[[motion]]
name = "forceps"
body = "upper"
nearest = { point = ["20 mm", "20 mm", "20 mm"] }
keys = [{ time = "0.05 s", translation = [0, 0, "10 mm"] }]
release = "0.1 s"

[[force]]
name = "push"
body = "upper"
half_space = { point = ["40 mm", 0, 0], normal = [1, 0, 0] }
force = ["0.1 N", 0, 0]

[[spring]]
name = "tie"
stiffness = "50 N/m"
from = { body = "upper", half_space = { point = [0, 0, 0], normal = [0, 0, -1] } }
to = { body = "lower", half_space = { point = [0, 0, "-10 mm"], normal = [0, 0, 1] } }
"#;

/// Frames after `first` ones. The motion ends with the sixth, and with it the set of pinned vertices changes.
fn frames_allocate_nothing<S: Real>(first: u64, overrides: &[(&str, &str)]) {
    let overrides = [&[("solver.device", "cpu")], overrides].concat();
    let scene = Scene::parse("everything.toml", SCENE, &overrides);
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    let assembly = Assembly::new(&scene, &mut |name| Err(format!("no file {name}")));
    let assembly = assembly.unwrap_or_else(|error| panic!("{error}"));
    let mut simulation = Simulation::<S>::new(scene, assembly).expect("a model");
    for _ in 0..first {
        simulation.advance_frame().expect("a frame");
    }
    let requests = requests_of(|| {
        for _ in first..12 {
            simulation.advance_frame().expect("a frame");
        }
    });
    assert_eq!(requests, 0, "{overrides:?}");
}

#[test]
fn a_frame_of_a_scene_allocates_nothing_after_the_first() {
    for acceleration in ["none", "chebyshev", "anderson"] {
        for colors in ["1", "4", "unlimited"] {
            let settings = [
                ("solver.acceleration", acceleration),
                ("solver.colors", colors),
                ("solver.method", "xpbd"),
            ];
            frames_allocate_nothing::<f32>(1, &settings);
        }
        let clusters = [("solver.method", "xpbd"), ("solver.clusters", "32")];
        let settings = [&clusters[..], &[("solver.acceleration", acceleration)]].concat();
        frames_allocate_nothing::<f32>(1, &settings);
    }
}

/// Where other vertices are held than before, the preconditioner is built anew.
#[test]
fn a_frame_of_the_quasi_newton_method_allocates_nothing_while_the_same_is_held() {
    frames_allocate_nothing::<f32>(7, &[]);
    for integrator in ["sdirk2", "implicit_euler"] {
        for history in ["0", "2", "10"] {
            let settings = [
                ("solver.method", "quasi_newton"),
                ("solver.integrator", integrator),
                ("solver.history", history),
                ("solver.substeps", "3"),
            ];
            frames_allocate_nothing::<f32>(7, &settings);
        }
    }
    frames_allocate_nothing::<f64>(7, &[("solver.method", "quasi_newton")]);
}

#[test]
fn a_frame_of_the_explicit_method_allocates_nothing_after_the_first() {
    frames_allocate_nothing::<f32>(1, &[("solver.method", "explicit")]);
    frames_allocate_nothing::<f64>(1, &[("solver.method", "explicit"), ("solver.substeps", "1")]);
}

/// A bar of 30 000 tetrahedra at the defaults, single precision. A tetrahedron has 20 bytes in the model, 64 in the
/// solver's layout and 24 of multipliers; a viscous one 24 of multipliers and 24 of strain besides; a vertex, of which
/// there is one for five tetrahedra, less than 240: about 155 and 205 bytes per tetrahedron, and 400 in any case.
#[test]
fn memory_is_small_and_as_large_as_is_said() {
    let mesh = block([0.2, 0.05, 0.05], [50, 10, 10], 0.2);
    let settings = SolverSettings::xpbd();
    for (viscosity, most) in [(0.0, 170), (0.01, 230)] {
        let tissue = material(SNH, 1e4, 0.45).with_viscosity(viscosity).expect("legal");
        let (model, of_model) = bytes_of(|| single_body::<f32>(&mesh, &tissue));
        let (solver, of_solver) = bytes_of(|| Solver::new(&model, &settings));
        let (state, of_state) = bytes_of(|| solver.state_at_rest());
        for (what, said, taken) in [
            ("model", model.bytes(), of_model),
            ("state", state.bytes(), of_state),
            ("solver", solver.bytes(), of_solver),
        ] {
            println!("{what}: {said} bytes, {taken} taken");
            assert!(said <= taken, "{what}: {said} bytes are said, {taken} are taken");
            assert!(taken * 100 <= said * 103, "{what}: {said} bytes are said, {taken} are taken");
        }
        let per_tet = (of_model + of_state + of_solver) / model.tet_count();
        println!("{per_tet} bytes per tetrahedron, viscosity {viscosity} s");
        assert!(per_tet <= most && most < 400, "{per_tet} bytes, viscosity {viscosity} s");
    }
}

/// What grows with springs, attachments and bodies counts as well.
#[test]
fn memory_of_springs_and_attachments_is_said() {
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let settings = crate::common::colored(Colors::Limited(4));
    // The builder goes within: what the model shares with it is the model's alone then.
    let (model, taken) = bytes_of(|| {
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &material(SNH, 1e4, 0.4)).expect("a body");
        for (v, &x) in mesh.vertices().iter().enumerate().cycle().take(5000) {
            builder.add_attachment(v as u32, x, 10.0).expect("an attachment");
            let other = (v + 1) % mesh.vertices().len();
            builder.add_spring([v as u32, other as u32], 10.0, None).expect("a spring");
        }
        builder.build::<f32>().expect("a model")
    });
    let (layout, laid) = bytes_of(|| Layout::new(&model, &settings));
    for (said, taken) in [(model.bytes(), taken), (layout.bytes(), laid)] {
        assert!(said <= taken && taken * 100 <= said * 103, "{said} bytes said, {taken} taken");
    }
}

/// With a ball that is moved, one that a spring holds, a floor, and a block that lies on another.
#[test]
fn a_step_with_contact_allocates_nothing_once_all_has_touched() {
    for method in [Method::Xpbd, Method::QuasiNewton, Method::Explicit] {
        let tissue = Material::new(SNH, 1e4, 0.4, 1060.0);
        let tissue = tissue.expect("legal").with_viscosity(5e-3).expect("legal");
        let mut builder = ModelBuilder::new();
        for height in [0.0, 0.0209] {
            let made = shapes::block(vec3(0.04, 0.04, 0.02), [4, 4, 2]).expect("a block");
            let at = |x: &Vec3<f64>| *x + vec3(0.0, 0.0, height);
            let vertices = made.vertices().iter().map(at).collect();
            let (mesh, _) = TetMesh::new(vertices, made.tets().to_vec(), made.regions().to_vec())
                .expect("legal");
            builder.add_body(&mesh, &tissue).expect("a body");
        }
        builder.sample_surface(2);
        builder.touch_tissue(&TissueContact::default()).expect("legal");
        let model = builder.build::<f32>().expect("a model");
        let settings =
            SolverSettings { method, elements: Elements::Plain, ..SolverSettings::default() };
        let mut solver = Solver::new(&model, &settings);
        let mut state = solver.state_at_rest();
        let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
        let ball = |x: f64| Tool {
            pose: RigidTransform { translation: vec3(x, 0.02, 0.0485), ..RigidTransform::IDENTITY },
            ..Tool::new(Shape::Sphere { radius: 8e-3 })
        };
        let mut held = ball(0.028);
        held.held = Some(Held { spring: Spring::default(), hand: held.pose, body: 1 });
        inputs.tools = vec![Tool::new(Shape::HalfSpace), ball(0.012), held];
        inputs.tools[0].pose.translation = vec3(0.0, 0.0, -9e-4);
        state.contact = ContactState::of(&inputs.tools);
        let hand = inputs.tools[2].pose;
        let mut go = |count: u32| {
            for step in 0..count {
                let down = 1e-3 * libm::sin(0.1 * f64::from(step));
                inputs.tools[1].pose.translation.z = 0.0475 - down;
                // The hand's place: where the tool is follows.
                inputs.tools[2].pose = hand;
                solver.lead(&model, &mut state, &mut inputs, 4e-3).expect("held tools");
                solver.step(&model, &mut state, &inputs, 4e-3).expect("a step");
            }
            (state.contact.touches.len(), state.contact.pairs.len())
        };
        let (touches, pairs) = go(126);
        assert!(touches > 20 && pairs > 20, "{method}: {touches} {pairs}");
        let requests = requests_of(|| {
            go(126);
        });
        assert_eq!(requests, 0, "{method}");
    }
}
