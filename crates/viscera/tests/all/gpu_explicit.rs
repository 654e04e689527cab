//! The explicit method on a graphics processor: the CPU's answers, and what it refuses.

use crate::common::device;
use crate::common::device::{everything, handled, largest};
use crate::common::{SNH, block, material, single_body};
use viscera::model::Model;
use viscera::scalar::{Real, vec3};
use viscera::settings::{Acceleration, Colors, Elements, Method, Precision, SolverSettings};
use viscera::solver::balance::ForceBalance;
use viscera::solver::gpu::{Device, GpuSolver};
use viscera::solver::{Inputs, Solver, StepError};
use viscera::state::{Learned, State};

/// Some 400 small steps of `everything`: more than one submission.
const DT: f64 = 1.0 / 100.0;

const STEPS: u32 = 6;

const BOTH: [Elements; 2] = [Elements::Plain, Elements::Recovered];

fn explicit(colors: Colors, elements: Elements) -> SolverSettings {
    // Accelerations are for sweeps: the explicit method leaves them alone.
    let acceleration = Acceleration::Anderson;
    // Small steps of the same length on both.
    SolverSettings {
        method: Method::Explicit,
        explicit_safety: 0.5,
        acceleration,
        colors,
        elements,
        ..SolverSettings::xpbd()
    }
}

/// So little that the small steps are those of the shape at rest, which is all that a device knows.
fn inputs_at<S: Real>(model: &Model<f64>, step: u32) -> Inputs<S> {
    handled(model, step, vec3(0.0, 2e-5, 3e-5))
}

fn run_on(device: &Device, settings: &SolverSettings, steps: u32) -> State<f32> {
    let model = everything();
    let gpu = GpuSolver::new(device, &model, settings).expect("a model that fits");
    run_solver(gpu, &model, steps)
}

fn run_solver(mut gpu: GpuSolver, model: &Model<f32>, steps: u32) -> State<f32> {
    let model64 = everything();
    for step in 0..steps {
        gpu.step(model, &inputs_at(&model64, step), DT).expect("a legal step");
    }
    let mut read = State::at_rest(model);
    gpu.read(model, &mut read).expect("a device");
    read
}

fn run<S: Real>(settings: &SolverSettings, steps: u32) -> State<S> {
    let (model, model64) = (everything::<S>(), everything());
    let mut solver = Solver::new(&model, settings);
    let mut state = State::at_rest(&model);
    for step in 0..steps {
        solver.step(&model, &mut state, &inputs_at(&model64, step), DT).expect("a legal step");
    }
    state
}

/// Both round, and neither is right: the device may be twice as far from double precision.
fn assert_agreement(colors: Colors, elements: Elements, steps: u32) {
    let settings = explicit(colors, elements);
    let double = SolverSettings { precision: Precision::F64, ..settings.clone() };
    let (cpu, oracle) = (run::<f32>(&settings, steps), run::<f64>(&double, steps));
    let gpu = run_on(device::device(), &settings, steps);
    for (what, cpu, gpu, oracle) in [
        ("positions", &cpu.positions, &gpu.positions, &oracle.positions),
        ("velocities", &cpu.velocities, &gpu.velocities, &oracle.velocities),
    ] {
        let [cpu, gpu] = [largest(cpu, oracle), largest(gpu, oracle)];
        println!("{what}, {colors:?}, {elements:?}: CPU {cpu:.1e}, GPU {gpu:.1e}");
        assert!(gpu <= 2.0 * cpu, "{what}, {colors:?}, {elements:?}: GPU {gpu:e}, CPU {cpu:e}");
    }
    assert_eq!(gpu.multiplier_dt, DT);
}

#[test]
fn device_is_as_close_to_double_precision_as_the_processor() {
    for colors in [Colors::Unlimited, Colors::Limited(1)] {
        for elements in BOTH {
            assert_agreement(colors, elements, STEPS);
        }
    }
}

/// What measures find of forces, those of viscosity among them.
#[test]
fn forces_are_measured_as_on_the_processor() {
    let (model, model64) = (everything::<f32>(), everything());
    for elements in BOTH {
        let settings = explicit(Colors::Unlimited, elements);
        let mut gpu = GpuSolver::new(device::device(), &model, &settings).expect("it fits");
        let mut cpu = Solver::new(&model, &settings);
        let (mut on_cpu, mut on_gpu) = (State::at_rest(&model), State::at_rest(&model));
        let [mut of_cpu, mut of_gpu] = [ForceBalance::default(), ForceBalance::default()];
        for step in 0..3 {
            let inputs = inputs_at(&model64, step);
            gpu.step(&model, &inputs, DT).expect("a legal step");
            cpu.step(&model, &mut on_cpu, &inputs, DT).expect("a legal step");
            gpu.read(&model, &mut on_gpu).expect("a device");
            gpu.force_balance(&model, &on_gpu, &inputs, &mut of_gpu).expect("a balance");
            cpu.force_balance(&model, &on_cpu, &inputs, &mut of_cpu).expect("a balance");
            let apart = largest(&of_gpu.residual, &of_cpu.residual);
            let most = of_cpu.residual.iter().map(|r| r.length()).fold(0.0, f64::max);
            println!("{elements:?}, step {step}: {apart:.1e} of {most:.1e} N");
            assert!(most > 0.01 && apart < 1e-2 * most, "{elements:?}: {apart:e} of {most:e} N");
        }
    }
}

/// A step alone, for a second, slower driver.
#[test]
fn portable_small_steps_agree_with_the_cpu() {
    for elements in BOTH {
        assert_agreement(Colors::Unlimited, elements, 1);
    }
}

#[test]
fn two_runs_have_the_same_bits_whatever_the_memory_held() {
    let (device, model) = (device::device(), everything());
    for elements in BOTH {
        let settings = explicit(Colors::Unlimited, elements);
        let gpu = GpuSolver::new(device, &model, &settings).expect("a model that fits");
        let used = GpuSolver::on_used_memory(device, &model, &settings, f32::NAN);
        let used = used.expect("a model that fits");
        assert_eq!(run_solver(gpu, &model, 2), run_solver(used, &model, 2), "{elements:?}");
    }
}

#[test]
fn a_small_step_is_two_dispatches_or_five() {
    for (elements, dispatches) in BOTH.into_iter().zip([2, 5]) {
        let colors = Colors::Unlimited;
        let settings = SolverSettings { explicit_safety: 0.25, ..explicit(colors, elements) };
        let model = everything();
        let gpu = GpuSolver::new(device::device(), &model, &settings).expect("a model that fits");
        assert_eq!(gpu.dispatches()[1], dispatches);
        let cpu = Solver::new(&model, &settings);
        assert_eq!(gpu.stable_step(), cpu.stable_step());
        println!("{} small steps", (DT / gpu.stable_step()).ceil());
        assert!(DT / gpu.stable_step() > 300.0, "more than one submission: {}", gpu.stable_step());
    }
}

/// Stiff tissue in small cells needs more steps than anybody waits for: told before anything moves.
#[test]
fn too_many_small_steps_are_refused() {
    let settings = explicit(Colors::Unlimited, Elements::Plain);
    let mesh = block([3e-5, 1e-5, 1e-5], [3, 1, 1], 0.0);
    let model = single_body::<f32>(&mesh, &material(SNH, 1e9, 0.4));
    let mut gpu = GpuSolver::new(device::device(), &model, &settings).expect("a model that fits");
    let mut before = Solver::new(&model, &settings).state_at_rest();
    before.learned = Learned::default();
    before.velocities.fill(vec3(1.0, 2.0, 3.0));
    gpu.write(&model, &before).expect("a state of this model");
    let error = gpu.step(&model, &Inputs::default(), 1.0 / 60.0);
    let Err(StepError::TooStiff { stable, .. }) = error else { panic!("{error:?}") };
    assert!(stable < 1e-7, "{stable}");
    let mut after = State::at_rest(&model);
    gpu.read(&model, &mut after).expect("a device");
    assert_eq!(after, before);
}

#[test]
fn recovered_gradient_tetrahedra_are_refused_where_sweeps_are_asked_for() {
    let settings = SolverSettings { elements: Elements::Recovered, ..SolverSettings::xpbd() };
    let model = single_body::<f32>(&block([0.02; 3], [1; 3], 0.0), &material(SNH, 1e4, 0.4));
    let error = GpuSolver::new(device::device(), &model, &settings).map(|_| ());
    let error = error.expect_err("kernels of linear ones only").to_string();
    assert!(error.contains("`elements = \"plain\"`"), "{error}");
}

/// A block that is fixed elastically, under a sudden force: in small steps of one length device and processor agree, and longer
/// ones are further off. By default a device takes half of
/// the stable step, the processor four fifths.
#[test]
fn small_steps_of_another_length_are_all_that_a_device_differs_by() {
    let mesh = block([0.03, 0.03, 0.015], [3, 3, 2], 0.0);
    let top: Vec<u32> =
        (0u32..).zip(mesh.vertices()).filter(|(_, x)| x.z > 0.0149).map(|(v, _)| v).collect();
    fn model_of<S: Real>(mesh: &viscera::mesh::TetMesh) -> Model<S> {
        let mut builder = viscera::model::ModelBuilder::new();
        builder.add_body(mesh, &material(SNH, 1e4, 0.4)).expect("a body");
        for (v, x) in (0u32..).zip(mesh.vertices()).filter(|(_, x)| x.z < 1e-6) {
            builder.add_attachment(v, *x, 125.0).expect("an attachment");
        }
        builder.build().expect("a model")
    }
    fn inputs<S: Real>(top: &[u32]) -> Inputs<S> {
        let force = (vec3(0.2, 0.0, 0.5) * (1.0 / top.len() as f64)).cast();
        Inputs { forces: top.iter().map(|&v| (v, force)).collect(), ..Inputs::default() }
    }
    let (model, model64) = (model_of::<f32>(&mesh), model_of::<f64>(&mesh));
    let of = |explicit_safety: f64| SolverSettings {
        explicit_safety,
        ..explicit(Colors::Unlimited, Elements::Plain)
    };
    let [truth, short, usual] = [0.03, 0.5, 0.8].map(|safety| {
        let (mut solver, mut state) =
            (Solver::new(&model64, &of(safety)), State::at_rest(&model64));
        for _ in 0..5 {
            solver.step(&model64, &mut state, &inputs(&top), 0.005).expect("a legal step");
        }
        state.positions
    });
    let mut gpu = GpuSolver::new(device::device(), &model, &of(0.8)).expect("a model that fits");
    for _ in 0..5 {
        gpu.step(&model, &inputs(&top), 0.005).expect("a legal step");
    }
    let mut read = State::at_rest(&model);
    gpu.read(&model, &mut read).expect("a device");
    let moved = largest(&model.rest_positions, &truth);
    let [of_device, of_short, of_usual] =
        [largest(&read.positions, &truth), largest(&short, &truth), largest(&usual, &truth)];
    let same = largest(&read.positions, &short);
    println!(
        "{same:.1e} m; of {moved:.1e} m off by {of_device:.1e}, {of_short:.1e}, {of_usual:.1e}"
    );
    assert!(moved > 1e-3 && same < 1e-6, "{same:e} of {moved:e} m");
    assert!(of_device < 0.02 * moved && of_usual > 1.2 * of_short, "{of_device:e}, {of_usual:e}");
}
