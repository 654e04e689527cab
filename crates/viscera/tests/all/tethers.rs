//! Springs to places outside: what they do is what attachments of the same stiffness do, which are constraints of
//! the model.

use crate::common::device::device;
use crate::common::{SNH, STVK, block, material};
use viscera::material::MaterialModel;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Acceleration, Colors, Count, Method, SolverSettings};
use viscera::solver::balance::ForceBalance;
use viscera::solver::gpu::GpuSolver;
use viscera::solver::{Inputs, Pin, Solver, StepError, Tether};
use viscera::state::State;

const DT: f64 = 1.0 / 600.0;
const STIFFNESS: f64 = 60.0;
const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

/// Its far end, which springs hold.
fn far_end(mesh: &TetMesh) -> Vec<u32> {
    let all = (0..).zip(mesh.vertices());
    all.filter(|(_, x)| x.x > 0.0599).map(|(v, _)| v).collect()
}

fn bar() -> TetMesh {
    block([0.06, 0.02, 0.02], [3, 1, 1], 0.0)
}

/// With or without attachments at the far end.
fn model<S: Real>(law: MaterialModel, attached: bool) -> Model<S> {
    let mesh = bar();
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &material(law, 5e3, 0.4)).expect("a body");
    for v in far_end(&mesh).into_iter().filter(|_| attached) {
        let anchor = mesh.vertices()[v as usize];
        builder.add_attachment(v, anchor, STIFFNESS).expect("an attachment");
    }
    builder.build().expect("a model")
}

/// The near end stands still; where the far end is pulled to goes up at first and then stays.
fn inputs<S: Real>(step: u32, attached: bool) -> Inputs<S> {
    let mesh = bar();
    let up = vec3(0.0, 0.0, 0.01 * f64::from(step.min(60)) / 60.0);
    let places = far_end(&mesh).into_iter().map(|v| (v, mesh.vertices()[v as usize] + up));
    let near = (0..).zip(mesh.vertices()).filter(|(_, x)| x.x < 1e-9);
    let mut inputs = Inputs {
        gravity: GRAVITY.cast(),
        pins: near.map(|(vertex, x)| Pin { vertex, target: x.cast() }).collect(),
        ..Inputs::default()
    };
    if attached {
        inputs.anchors = places.map(|(_, x)| x.cast()).collect();
    } else {
        let stiffness = S::from_f64(STIFFNESS);
        inputs.tethers =
            places.map(|(vertex, x)| Tether { vertex, target: x.cast(), stiffness }).collect();
    }
    inputs
}

fn largest(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}

/// Places after every step.
fn path(law: MaterialModel, settings: &SolverSettings, attached: bool) -> Vec<Vec<Vec3<f64>>> {
    let model: Model<f64> = model(law, attached);
    let mut solver = Solver::new(&model, settings);
    let mut state = State::at_rest(&model);
    let step = |step| {
        let inputs = inputs(step, attached);
        solver.step(&model, &mut state, &inputs, DT).expect("a legal step");
        state.positions.clone()
    };
    (1..=120).map(step).collect()
}

#[test]
fn tethers_move_tissue_as_attachments_do() {
    // Converged steps: both are implicit Euler, with the same energies. What is left is what 300 iterations
    // leave, far below the millimetres of the motion; the explicit method has no iterations at all.
    let many = SolverSettings { iterations: Count::Of(300), ..SolverSettings::xpbd() };
    let anderson = SolverSettings {
        acceleration: Acceleration::Anderson,
        colors: Colors::Limited(1),
        ..many.clone()
    };
    let explicit = SolverSettings { method: Method::Explicit, ..SolverSettings::xpbd() };
    for law in [SNH, STVK] {
        for (settings, allowed) in [(&many, 1e-8), (&anderson, 1e-6), (&explicit, 1e-9)] {
            let [tethers, attachments] = [false, true].map(|kind| path(law, settings, kind));
            let apart = tethers.iter().zip(&attachments).map(|(a, b)| largest(a, b));
            let apart = apart.fold(0.0, f64::max);
            let moved = largest(&tethers[119], &tethers[0]);
            assert!(moved > 2e-3 && apart < allowed * 1e-2, "{law:?} {settings:?}: {apart:e} m");
        }
    }
}

#[test]
fn a_tether_pulls_with_stiffness_times_distance_and_lets_go() {
    let settings = SolverSettings::xpbd();
    let model: Model<f64> = model(SNH, false);
    let mut solver = Solver::new(&model, &settings);
    let mut state = State::at_rest(&model);
    for _ in 0..3000 {
        solver.step(&model, &mut state, &inputs(60, false), DT).expect("a legal step");
        state.velocities.iter_mut().for_each(|v| *v = *v * 0.98);
    }
    // At rest all forces on free vertices, those of tethers among them, cancel.
    let mut balance = ForceBalance::default();
    solver.force_balance(&model, &state, &inputs(60, false), &mut balance).expect("a balance");
    let tethers = inputs::<f64>(60, false).tethers;
    let pull = |t: &Tether<f64>| (t.target - state.positions[t.vertex as usize]) * t.stiffness;
    let sum = tethers.iter().map(pull).fold(Vec3::ZERO, |a, b| a + b);
    assert!(sum.z > 0.05 && balance.unbalanced < 1e-6 * sum.z, "{sum:?} {}", balance.unbalanced);
    // Everything that loads the tissue: weights, tethers, and what holds the near end.
    let pinned = |v: usize| inputs::<f64>(60, false).pins.iter().any(|p| p.vertex as usize == v);
    let weights = (0..model.vertex_count()).map(|v| match pinned(v) {
        true => balance.residual[v].length(),
        false => model.masses[v] * GRAVITY.length(),
    });
    let pulls = tethers.iter().map(|tether| pull(tether).length());
    let load: f64 = weights.chain(pulls).sum();
    assert!((balance.load / load - 1.0).abs() < 1e-12, "{} N of {load} N", balance.load);
    // The near end holds what gravity and tethers leave: its force on the tissue closes the balance.
    let held: Vec3<f64> = inputs::<f64>(60, false)
        .pins
        .iter()
        .map(|pin| balance.residual[pin.vertex as usize])
        .fold(Vec3::ZERO, |a, b| a + b);
    let weight = GRAVITY * model.masses.iter().sum::<f64>();
    assert!((held + weight + sum).length() < 1e-5 * sum.length(), "{:?}", held + weight + sum);
    let before = state.positions.clone();
    let free = Inputs { tethers: Vec::new(), ..inputs(60, false) };
    solver.step(&model, &mut state, &free, DT).expect("a legal step");
    let fallen = before.iter().zip(&state.positions).map(|(a, b)| a.z - b.z).fold(0.0, f64::max);
    assert!(fallen > 0.0 && solver.last_step().is_some_and(|step| !step.rejected));
}

#[test]
fn several_tethers_add_up_whatever_their_order_and_do_nothing_on_a_pinned_vertex() {
    let settings = SolverSettings::xpbd();
    let model: Model<f64> = model(SNH, false);
    let run = |order: &[usize], pinned: bool| {
        let mut inputs = inputs::<f64>(60, false);
        let Tether { vertex, target, stiffness } = inputs.tethers[0];
        let shifted = target + vec3(0.004, 0.0, 0.0);
        let three = [
            Tether { vertex, target, stiffness: 0.25 * stiffness },
            Tether { vertex, target: shifted, stiffness: 0.5 * stiffness },
            Tether { vertex, target, stiffness: 0.25 * stiffness },
        ];
        inputs.tethers = order.iter().map(|&i| three[i]).collect();
        if pinned {
            inputs.pins.push(Pin { vertex, target: model.rest_positions[vertex as usize] });
        }
        let mut solver = Solver::new(&model, &settings);
        let mut state = State::at_rest(&model);
        for _ in 0..20 {
            solver.step(&model, &mut state, &inputs, DT).expect("a legal step");
        }
        state
    };
    assert_eq!(run(&[0, 1, 2], false), run(&[2, 0, 1], false));
    assert_eq!(run(&[0, 1, 2], true), run(&[], true));
    assert_ne!(run(&[0, 1, 2], false), run(&[], false));
}

#[test]
fn a_tether_that_cannot_be_is_refused_and_nothing_moves() {
    let settings = SolverSettings::xpbd();
    let model: Model<f64> = model(SNH, false);
    let mut solver = Solver::new(&model, &settings);
    let mut state = State::at_rest(&model);
    let tether = Tether { vertex: 0, target: Vec3::ZERO, stiffness: 1.0 };
    let nan = vec3(f64::NAN, 0.0, 0.0);
    for bad in [
        Tether { vertex: 99, ..tether },
        Tether { target: nan, ..tether },
        Tether { stiffness: -1.0, ..tether },
        Tether { stiffness: f64::INFINITY, ..tether },
    ] {
        let inputs = Inputs { tethers: vec![bad], ..Inputs::default() };
        let error = solver.step(&model, &mut state, &inputs, DT).expect_err("not possible");
        let is_told = matches!(error, StepError::UnknownVertex { what: "tether", .. })
            || matches!(error, StepError::NotFinite { what: "tethers" });
        assert!(is_told, "{error}");
    }
    assert_eq!(state, State::at_rest(&model));
}

/// The distance of the device from double precision, of a mesh of 6 cm, is that of the CPU's own single
/// precision.
#[test]
fn portable_tethers_on_the_device_agree_with_the_cpu() {
    let device = device();
    let few = SolverSettings { iterations: Count::Of(4), ..SolverSettings::xpbd() };
    let published = SolverSettings {
        rebase: false,
        keep_multipliers: false,
        colors: Colors::Limited(2),
        ..few.clone()
    };
    for settings in [&few, &published] {
        let double: Model<f64> = model(SNH, false);
        let single: Model<f32> = model(SNH, false);
        let mut oracle = Solver::new(&double, settings);
        let mut cpu = Solver::new(&single, settings);
        let mut gpu = GpuSolver::new(device, &single, settings).expect("a model that fits");
        let mut exact = State::at_rest(&double);
        let [mut near, mut state] = [(); 2].map(|()| State::at_rest(&single));
        let mut errors = [0.0f64; 2];
        for step in 1..=40 {
            // Held, moved, let go.
            let tethers = step <= 30;
            let mut on_double: Inputs<f64> = inputs(4 * step, false);
            let mut on_single: Inputs<f32> = inputs(4 * step, false);
            if !tethers {
                on_double.tethers.clear();
                on_single.tethers.clear();
            }
            oracle.step(&double, &mut exact, &on_double, DT).expect("a legal step");
            cpu.step(&single, &mut near, &on_single, DT).expect("a legal step");
            gpu.step(&single, &on_single, DT).expect("a legal step");
            gpu.read(&single, &mut state).expect("a device");
            for (error, found) in errors.iter_mut().zip([&near, &state]) {
                let found: Vec<Vec3<f64>> = found.positions.iter().map(|x| x.cast()).collect();
                *error = error.max(largest(&found, &exact.positions));
            }
        }
        let [cpu, gpu] = errors;
        assert!(gpu < 4.0 * cpu + 1e-8, "{settings:?}: {gpu:e} m, the CPU {cpu:e} m");
    }
}
