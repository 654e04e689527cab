//! Kinds of elements with any number of vertices, and without multipliers, go through every stage: those of
//! [`crate::elements::trial`], which only tests have.

use super::balance::ForceBalance;
use super::probe::{begun, quiet, shake};
use super::step::gradient::load_forces;
use super::{Inputs, Pin, Solver};
use crate::elements::trial::{Hinges, Struts};
use crate::layout::Layout;
use crate::material::{Material, MaterialModel};
use crate::mesh::shapes::Block;
use crate::model::{Model, ModelBuilder};
use crate::scalar::{Real, Vec3, vec3};
use crate::settings::{Count, Integrator, Method, SolverSettings};
use crate::state::State;

/// [N/m]: as stiff as the tissue is.
const STIFFNESS: f64 = 60.0;

/// A bar with elements across it, of which nothing has its rest shape; without elements, the bar.
fn bar<S: Real>(has_elements: bool) -> Model<S> {
    let mesh = Block::new(vec3(0.04, 0.02, 0.02), [3, 1, 1]).mesh().expect("a bar");
    let law = MaterialModel::StableNeoHookean;
    let tissue = Material::new(law, 1e4, 0.3, 1000.0).expect("legal");
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue).expect("a body");
    let count = mesh.vertices().len() as u32;
    for v in (0..count - 6).step_by(3).filter(|_| has_elements) {
        builder
            .add_element::<Hinges, 3, 0>([v, v + 2, v + 5], &[STIFFNESS], None)
            .expect("a hinge");
        let ends = [v, v + 1, v + 4, v + 6];
        builder.add_element::<Struts, 4, 1>(ends, &[0.01, STIFFNESS], None).expect("a strut");
    }
    builder.build().expect("a model")
}

/// The left end, held.
fn wall<S: Real>(model: &Model<S>) -> Inputs<S> {
    let held = (0u32..).zip(&model.rest_positions).filter(|(_, x)| x.x < S::from_f64(1e-9));
    Inputs {
        gravity: vec3(0.0, 0.0, -9.81).cast(),
        pins: held.map(|(vertex, &target)| Pin { vertex, target }).collect(),
        ..Inputs::default()
    }
}

/// Stored energy [J] at places moved by `d` [m] from shaken ones, forces [N] there, and bounds of the curvature [N/m]:
/// by the solver's stages, vertices in its order.
fn measured(has_elements: bool, d: impl Fn(usize) -> Vec3<f64>) -> (f64, Vec<(Vec3<f64>, f64)>) {
    let (settings, inputs) = (SolverSettings::xpbd(), Inputs::default());
    let layout = Layout::new(&bar::<f64>(has_elements), &settings);
    let step = quiet(&layout, &inputs, &settings, 0.5);
    let mut memory = begun(&step, &layout.rest_positions);
    let data = &mut memory.data;
    shake(&mut data.points);
    for (v, &user) in layout.numbering.order.iter().enumerate() {
        let x = data.points[v].vec3() + d(user as usize);
        data.points[v].set_vec3(x);
    }
    let evaluator = &mut memory.guard.as_mut().expect("guarded steps").evaluator;
    evaluator.evaluate_all(&data.constants, &step, &data.points);
    let moments = data.constants.moments(&step);
    load_forces::<_, true>(&data.constants, &step, &moments, 0, &data.points, &mut data.loads);
    let mut loads = vec![(Vec3::ZERO, 0.0); layout.vertex_count()];
    for (v, &user) in layout.numbering.order.iter().enumerate() {
        let load = super::step::data::gather(&layout, &data.loads, v);
        loads[user as usize] = (load.vec3() * 4.0, load.w * 4.0);
    }
    (evaluator.stored.iter().sum(), loads)
}

/// Forces are what the energy loses, and no vertex sees more curvature than the bound: by central differences, of what
/// the elements add to the bar.
#[test]
fn forces_and_bounds_are_those_of_the_potential() {
    let still = |_: usize| Vec3::ZERO;
    let [(energy, with), (without, alone)] = [true, false].map(|is| measured(is, still));
    assert!(energy > without);
    let mut concerned = 0;
    for v in 0..with.len() {
        let force = with[v].0 - alone[v].0;
        let bound = with[v].1 - alone[v].1;
        concerned += usize::from(force.length() > 0.0);
        for axis in 0..3 {
            let mut step = Vec3::ZERO;
            // Round-off of the energy over this is 1e-11 N, third derivatives times its square less.
            step[axis] = 1e-5;
            let moved = |sign: f64| {
                let d = |user: usize| if user == v { step * sign } else { Vec3::ZERO };
                measured(true, d).0 - measured(false, d).0
            };
            let [after, before] = [1.0, -1.0].map(moved);
            let slope = (after - before) / 2e-5;
            assert!((slope + force[axis]).abs() < 1e-6 * (1.0 + force.length()), "{v}: {slope}");
            let curvature = (after + before - 2.0 * (energy - without)) / 1e-10;
            assert!(curvature <= bound * (1.0 + 1e-4) + 1e-3, "{v}: {curvature} above {bound}");
        }
    }
    assert!(concerned > with.len() / 2, "{concerned}");
}

/// XPBD with sweeps enough and the quasi-Newton method end a step where all forces balance, with such elements as well,
/// and at one place.
#[test]
fn every_method_finds_the_balance_of_all_elements() {
    let model = bar::<f64>(true);
    let inputs = wall(&model);
    let end = |method: Method, iterations: u32| {
        let settings = SolverSettings {
            method,
            iterations: Count::Of(iterations),
            integrator: Integrator::ImplicitEuler,
            ..SolverSettings::xpbd()
        };
        let mut solver = Solver::new(&model, &settings);
        let mut state = State::at_rest(&model);
        solver.step(&model, &mut state, &inputs, 0.01).expect("a legal step");
        let mut balance = ForceBalance::default();
        solver.force_balance(&model, &state, &inputs, &mut balance).expect("a step");
        assert!(balance.relative_residual() < 1e-7, "{method:?}: {}", balance.relative_residual());
        state.positions
    };
    let swept = end(Method::Xpbd, 1000);
    let minimised = end(Method::QuasiNewton, 60);
    let moved = |x: &[Vec3<f64>], y: &[Vec3<f64>]| {
        x.iter().zip(y).map(|(x, y)| (*x - *y).length()).fold(0.0, f64::max)
    };
    let (apart, way) = (moved(&swept, &minimised), moved(&swept, &model.rest_positions));
    assert!(apart < 1e-6 * way, "{apart:e} m apart after {way:e} m");
    // The elements matter.
    let plain = bar::<f64>(false);
    let (mut solver, mut state) =
        (Solver::new(&plain, &SolverSettings::xpbd()), State::at_rest(&plain));
    solver.step(&plain, &mut state, &inputs, 0.01).expect("a legal step");
    assert!(moved(&state.positions, &swept) > 0.05 * way);
}

/// On a device they do the same: at most twice as far from double precision as the processor.
#[cfg(feature = "gpu")]
#[test]
fn a_device_has_them_as_well() {
    use super::gpu::{Adapter, GpuSolver};
    let (model, double) = (bar::<f32>(true), bar::<f64>(true));
    let (inputs, inputs64) = (wall(&model), wall(&double));
    let device = Adapter::find(None).and_then(|adapter| adapter.open());
    let device = device.unwrap_or_else(|error| panic!("{error}"));
    let settings = SolverSettings { iterations: Count::Of(10), ..SolverSettings::xpbd() };
    let mut gpu = GpuSolver::new(&device, &model, &settings).expect("a model that fits");
    let (mut cpu, mut oracle) = (Solver::new(&model, &settings), Solver::new(&double, &settings));
    let (mut x32, mut x64) = (State::at_rest(&model), State::at_rest(&double));
    for _ in 0..3 {
        gpu.step(&model, &inputs, 0.002).expect("a legal step");
        cpu.step(&model, &mut x32, &inputs, 0.002).expect("a legal step");
        oracle.step(&double, &mut x64, &inputs64, 0.002).expect("a legal step");
    }
    let mut read = State::at_rest(&model);
    gpu.read(&model, &mut read).expect("a device");
    let [cpu, gpu] = [&x32, &read].map(|state| {
        let away = state.positions.iter().zip(&x64.positions);
        away.map(|(x, exact)| (x.cast::<f64>() - *exact).length()).fold(0.0, f64::max)
    });
    // Below a unit in the last place of the bar's length there is nothing to compare.
    let least = 0.04 * f64::from(f32::EPSILON);
    assert!(gpu <= 2.0 * cpu.max(least), "CPU {cpu:e} m, GPU {gpu:e} m");
}
