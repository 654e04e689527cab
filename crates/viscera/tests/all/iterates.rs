//! Steps under somebody's eyes, and with another number of iterations than they were planned with.

use crate::common::{STVK, block, exact, material, plain, single_body};
use viscera::model::Model;
use viscera::scalar::{Vec3, vec3};
use viscera::settings::{Acceleration, Count, Method, SolverSettings};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const FRAME: f64 = 1.0 / 60.0;

/// A bar that is held at one end and starts to fall.
fn bar() -> (Model<f64>, Inputs<f64>) {
    let mesh = block([0.2, 0.05, 0.05], [8, 2, 2], 0.2);
    let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
    for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
        inputs.pins.push(Pin { vertex: v as u32, target: *x });
    }
    (single_body(&mesh, &material(STVK, 1e5, 0.45)), inputs)
}

/// The state after one step of a frame from rest, its iterations set after the solver was built.
fn stepped(settings: &SolverSettings, iterations: u32) -> State<f64> {
    let (model, inputs) = bar();
    let (mut state, mut solver) = (State::at_rest(&model), Solver::new(&model, settings));
    solver.set_iterations(iterations);
    solver.step(&model, &mut state, &inputs, FRAME).expect("a legal step");
    state
}

/// Steps in a row are steps one by one, to the bit, whatever acts in each; where one fails the state is that of the step
/// before it.
#[test]
fn steps_in_a_row_are_steps() {
    let of = |method| SolverSettings { method, ..exact(3) };
    let anderson = SolverSettings { acceleration: Acceleration::Anderson, ..exact(3) };
    let (explicit, quasi_newton) = (of(Method::Explicit), of(Method::QuasiNewton));
    for settings in [plain(1, 3), exact(3), anderson, explicit, quasi_newton] {
        let (model, calm) = bar();
        let act = |number: u32, inputs: &mut Inputs<f64>| {
            for (pin, moved) in inputs.pins.iter_mut().zip(&calm.pins) {
                pin.target = moved.target + vec3(0.0, 0.0, 1e-4 * f64::from(number));
            }
            // A force that no step takes.
            let force = if number == 4 { f64::NAN } else { 0.1 };
            inputs.forces = vec![(0, vec3(force, 0.0, 0.0))];
        };
        let one_by_one = |count: u32| {
            let (mut state, mut solver) = (State::at_rest(&model), Solver::new(&model, &settings));
            let mut inputs = calm.clone();
            for number in 1..=count {
                act(number, &mut inputs);
                solver.step(&model, &mut state, &inputs, 0.1 * FRAME).expect("a legal step");
            }
            state
        };
        for count in [1, 3, 5] {
            let (mut state, mut solver) = (State::at_rest(&model), Solver::new(&model, &settings));
            let mut inputs = calm.clone();
            let done = solver.steps(&model, &mut state, &mut inputs, 0.1 * FRAME, count, act);
            assert_eq!(done.is_ok(), count < 4, "{count}: {done:?}");
            assert_eq!(state, one_by_one(count.min(3)), "{count} of {:?}", settings.method);
        }
    }
}

/// Who watches sees the start, every iterate, and at last what the step leaves; the step itself is the same
/// to the bit, and so is one whose number of iterations is set later.
#[test]
fn a_watched_step_is_a_step() {
    // With one that leaves its number to the method as well.
    let quasi_newton =
        |iterations| SolverSettings { method: Method::QuasiNewton, iterations, ..plain(1, 7) };
    for few in [Count::Of(3), Count::Auto] {
        let [few, many] = [few, Count::Of(12)].map(quasi_newton);
        assert_eq!(stepped(&few, 12), stepped(&many, 12));
        assert_ne!(stepped(&few, 12).positions, stepped(&few, 3).positions);
    }
    let mixed = SolverSettings { acceleration: Acceleration::Anderson, ..plain(1, 7) };
    for settings in [plain(1, 7), mixed, exact(7)] {
        let (model, inputs) = bar();
        let mut seen: Vec<Vec<Vec3<f64>>> = Vec::new();
        let (mut state, mut solver) = (State::at_rest(&model), Solver::new(&model, &settings));
        let watch = |iteration: u32, x: &[Vec3<f64>]| {
            assert_eq!(iteration as usize, seen.len());
            seen.push(x.to_vec());
        };
        solver.step_watched(&model, &mut state, &inputs, FRAME, watch).expect("a legal step");
        assert_eq!(state, stepped(&settings, 7));
        assert_eq!(seen.len(), 8);
        let fewer = SolverSettings { iterations: Count::Of(3), ..settings.clone() };
        assert_eq!(stepped(&settings, 3), stepped(&fewer, 3));
        assert_eq!(stepped(&fewer, 7), stepped(&settings, 7));
        if !settings.rebase {
            // Nothing comes after the last iteration; multipliers start from zero.
            assert_eq!(seen[7], state.positions);
            assert_eq!(seen[3], stepped(&settings, 3).positions);
        }
    }
}
