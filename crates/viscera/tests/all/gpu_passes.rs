//! Passes of the quasi-Newton method that it takes to come near the converged step, on a graphics processor and on the
//! processor.

use crate::common::device::device;
use crate::common::{SNH, block, material, single_body};
use viscera::mesh::{TetMesh, shapes};
use viscera::model::Model;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Count, Integrator, Method, Precision, SolverSettings};
use viscera::solver::gpu::GpuSolver;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const FRAME: f64 = 1.0 / 60.0;

/// Passes that are tried, one after the other.
const MOST: u32 = 30;

/// What is left of the error of inertia alone.
const LEFT: [f64; 2] = [1e-2, 1e-3];

/// How far [m] a free end is led in a step.
const LED: f64 = 5e-4;

/// Steps with as many passes before those that are judged: solves go on with the pairs of those before.
const BEFORE: u32 = 3;

/// Steps that are judged together: one alone is near by chance.
const JUDGED: u32 = 4;

/// A body on a wall that swings, or whose free end is led.
struct Handled {
    single: Model<f32>,
    double: Model<f64>,
    integrator: Integrator,
    /// [s].
    dt: f64,
    is_led: bool,
}

impl Handled {
    fn new(mesh: &TetMesh, poisson: f64, integrator: Integrator, is_led: bool) -> Self {
        let tissue = material(SNH, 1e4, poisson);
        let (single, double) = (single_body(mesh, &tissue), single_body(mesh, &tissue));
        let dt = if is_led { 1e-3 } else { FRAME };
        Self { single, double, integrator, dt, is_led }
    }

    fn settings(&self, passes: u32) -> SolverSettings {
        let settings = SolverSettings { integrator: self.integrator, ..SolverSettings::xpbd() };
        SolverSettings { method: Method::QuasiNewton, iterations: Count::Of(passes), ..settings }
    }

    /// Of a step, from 1 on.
    fn inputs<S: Real>(&self, step: u32) -> Inputs<S> {
        let places = || (0..).zip(&self.double.rest_positions);
        let far = places().map(|(_, x)| x.x).fold(0.0, f64::max);
        let led = vec3(0.0, 0.0, LED * f64::from(step));
        let wall = places().filter(|(_, x)| x.x < 1e-6).map(|(vertex, x)| (vertex, *x));
        let end = places().filter(|(_, x)| self.is_led && x.x > far - 1e-6);
        let pins = wall.chain(end.map(|(vertex, x)| (vertex, *x + led)));
        let pins = pins.map(|(vertex, x)| Pin { vertex, target: x.cast() }).collect();
        Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), pins, ..Inputs::default() }
    }

    /// Runs on the processor; returns what its steps leave.
    fn on_cpu(&self, passes: u32) -> f64 {
        let mut solver = Solver::new(&self.single, &self.settings(passes));
        self.left(|inputs, state| {
            solver.step(&self.single, state, inputs, self.dt).expect("a legal step");
        })
    }

    /// The same on a device.
    fn on_device(&self, passes: u32) -> f64 {
        let solver = GpuSolver::new(device(), &self.single, &self.settings(passes));
        let mut solver = solver.expect("a model that fits");
        self.left(|inputs, state| {
            solver.step(&self.single, inputs, self.dt).expect("a legal step");
            solver.read(&self.single, state).expect("a device");
        })
    }

    /// The error of steps, each against a step from where it began that is solved to the end in double precision, as a share
    /// of the error of inertia alone.
    fn left(&self, mut run: impl FnMut(&Inputs<f32>, &mut State<f32>)) -> f64 {
        let mut state = State::at_rest(&self.single);
        let settings = SolverSettings { precision: Precision::F64, ..self.settings(40) };
        let mut exact = Solver::new(&self.double, &settings);
        let (mut squared, mut of_inertia) = (0.0, 0.0);
        for step in 1..=BEFORE + JUDGED {
            let mut truth = State::at_rest(&self.double);
            truth.positions = state.positions.iter().map(|x| x.cast()).collect();
            truth.velocities = state.velocities.iter().map(|v| v.cast()).collect();
            run(&self.inputs(step), &mut state);
            if step <= BEFORE {
                continue;
            }
            let inputs = self.inputs::<f64>(step);
            let moved = truth.positions.iter().zip(&truth.velocities);
            let mut inertia: Vec<_> = moved.map(|(x, v)| *x + *v * self.dt).collect();
            inputs.pins.iter().for_each(|pin| inertia[pin.vertex as usize] = pin.target);
            exact.step(&self.double, &mut truth, &inputs, self.dt).expect("a legal step");
            squared += apart(&state.positions, &truth.positions).powi(2);
            of_inertia += apart(&inertia, &truth.positions).powi(2);
        }
        (squared / of_inertia).sqrt()
    }
}

/// The fewest passes among some that leave no more than a limit.
fn fewest(mut among: impl Iterator<Item = u32>, limit: f64, left: impl Fn(u32) -> f64) -> u32 {
    among.find(|&passes| left(passes) < limit).unwrap_or(MOST + 1)
}

/// Root of the mean squared distance of places [m].
fn apart<S: Real>(places: &[Vec3<S>], truth: &[Vec3<f64>]) -> f64 {
    let squared = places.iter().zip(truth).map(|(a, b)| (a.cast::<f64>() - *b).length_squared());
    (squared.sum::<f64>() / truth.len() as f64).sqrt()
}

/// Counts of both for each of [`LEFT`], told. The device is tried from where it would be too soon on.
fn counts(name: &str, handled: &Handled) -> [[u32; 2]; 2] {
    let (mut cpu, mut gpu) = ([0; 2], [0; 2]);
    for (i, limit) in LEFT.into_iter().enumerate() {
        let first = if i == 0 { 1 } else { cpu[0] };
        cpu[i] = fewest(first..=MOST, limit, |passes| handled.on_cpu(passes));
        let near = cpu[i].saturating_sub(3).max(1)..=(cpu[i] + 2).min(MOST);
        gpu[i] = fewest(near, limit, |passes| handled.on_device(passes));
    }
    let (tets, ms) = (handled.single.tet_count(), 1e3 * handled.dt);
    let integrator = handled.integrator;
    println!("{name}, {tets} tetrahedra, {integrator:?}, {ms:.1} ms: CPU {cpu:?}, GPU {gpu:?}");
    [cpu, gpu]
}

fn beam() -> TetMesh {
    shapes::beam(0.16, 0.04, 0.04, 4, 0.1).expect("a beam")
}

fn slab() -> TetMesh {
    block([0.08, 0.08, 0.02], [8, 8, 2], 0.2)
}

/// Within two, of what is thin as well: there the coarsest level does most of the work.
#[test]
fn a_device_takes_as_many_passes_as_the_processor() {
    for (name, mesh, poisson) in [
        ("beam", beam(), 0.3),
        ("beam, nu 0.45", beam(), 0.45),
        ("slab", slab(), 0.3),
        ("slab, nu 0.45", slab(), 0.45),
    ] {
        let handled = Handled::new(&mesh, poisson, Integrator::Sdirk2, false);
        let [cpu, gpu] = counts(name, &handled);
        for (cpu, gpu) in cpu.into_iter().zip(gpu) {
            assert!(cpu.abs_diff(gpu) <= 2, "{name}: {gpu} passes, CPU {cpu}");
        }
    }
}

#[test]
#[ignore = "slow: larger meshes"]
fn a_device_takes_as_many_passes_as_the_processor_at_length() {
    let beam = shapes::beam(0.16, 0.04, 0.04, 6, 0.1).expect("a beam");
    let slab = block([0.08, 0.08, 0.02], [12, 12, 3], 0.2);
    for (name, mesh, poisson, integrator, is_led) in [
        ("beam", &beam, 0.3, Integrator::Sdirk2, true),
        ("beam", &beam, 0.3, Integrator::ImplicitEuler, false),
        ("slab", &slab, 0.45, Integrator::Sdirk2, false),
    ] {
        let [cpu, gpu] = counts(name, &Handled::new(mesh, poisson, integrator, is_led));
        let near = cpu.iter().zip(&gpu).all(|(cpu, gpu)| cpu.abs_diff(*gpu) <= 2);
        assert!(near, "{name}: {gpu:?} passes, CPU {cpu:?}");
    }
}
