//! The explicit integrator: momentum, energy, motion, rest, and what it refuses.

use crate::common::{SNH, STVK, block, material, single_body};
use viscera::measure::{measure_energies, measure_tissue};
use viscera::model::Model;
use viscera::scalar::{Vec3, vec3};
use viscera::settings::{Count, Method, SolverSettings};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver, StepError};
use viscera::state::State;

const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

fn explicit() -> SolverSettings {
    SolverSettings { method: Method::Explicit, ..SolverSettings::xpbd() }
}

/// At rest, and in a motion that stretches, bends and turns it.
fn wobbling(model: &Model<f64>) -> State<f64> {
    let mut state = State::at_rest(model);
    for (v, x) in state.velocities.iter_mut().zip(&model.rest_positions) {
        *v = vec3(3.0 * x.x, -20.0 * x.x * x.x, 4.0 * x.x);
    }
    state
}

/// Held where `x = 0`.
fn hanging(model: &Model<f64>) -> Inputs<f64> {
    let rest = (0u32..).zip(&model.rest_positions);
    let pins = rest.filter(|(_, x)| x.x < 1e-9).map(|(vertex, &target)| Pin { vertex, target });
    Inputs { gravity: GRAVITY, pins: pins.collect(), ..Inputs::default() }
}

/// Inner forces cancel: a body in free fall that wobbles keeps its momentum but for gravity's share,
/// and its angular momentum.
#[test]
fn a_wobbling_body_in_free_fall_keeps_its_momenta() {
    for law in [STVK, SNH] {
        let mesh = block([0.06, 0.04, 0.04], [3, 2, 2], 0.1);
        let model = single_body::<f64>(&mesh, &material(law, 5e3, 0.4));
        let mut state = State::at_rest(&model);
        for (v, x) in state.velocities.iter_mut().zip(&model.rest_positions) {
            *v = vec3(2.0 * x.y, -3.0 * x.z, 4.0 * x.x);
        }
        let momenta = |state: &State<f64>| {
            let (mut linear, mut angular) = (Vec3::ZERO, Vec3::ZERO);
            for (v, &mass) in model.masses.iter().enumerate() {
                linear += state.velocities[v] * mass;
                angular += state.positions[v].cross(state.velocities[v]) * mass;
            }
            (linear, angular)
        };
        let (linear, angular) = momenta(&state);
        let mut solver = Solver::new(&model, &explicit());
        let free = Inputs::default();
        for _ in 0..60 {
            solver.step(&model, &mut state, &free, 1.0 / 600.0).expect("a legal step");
        }
        let (linear_after, angular_after) = momenta(&state);
        // Positions round to 1e-17 m and forces cancel to 1e-16 of themselves, over some 1000 steps.
        assert!((linear_after - linear).length() < 1e-11 * linear.length(), "{law:?}");
        assert!((angular_after - angular).length() < 1e-11 * angular.length(), "{law:?}");
    }
}

/// Symplectic: over a second of swinging the energy stays in a band, at nine tenths of the step that is
/// stable at rest, and the band narrows with the square of the step or with the step itself.
#[test]
fn energy_stays_in_a_band_that_narrows_with_the_step() {
    let mesh = block([0.06, 0.02, 0.02], [4, 1, 1], 0.0);
    let mut bands = Vec::new();
    for explicit_safety in [0.9, 0.45] {
        let settings = SolverSettings { explicit_safety, ..explicit() };
        let model = single_body::<f64>(&mesh, &material(SNH, 2e4, 0.4));
        // Nothing holds it: no limit of energy, no forces ahead of places.
        let inputs = Inputs::default();
        let mut state = wobbling(&model);
        let mut solver = Solver::new(&model, &settings);
        let (mut low, mut high, mut kinetic) = (f64::INFINITY, 0.0f64, 0.0f64);
        for _ in 0..60 {
            solver.step(&model, &mut state, &inputs, 1.0 / 60.0).expect("a legal step");
            let tissue = measure_tissue(&model, &state.positions);
            let energy = measure_energies(&model, &state, &inputs, &tissue);
            let sum = energy.kinetic + energy.elastic + energy.gravitational;
            (low, high) = (low.min(sum), high.max(sum));
            kinetic = kinetic.max(energy.kinetic);
        }
        println!("safety {explicit_safety}: {:.1e} of the motion's energy", (high - low) / kinetic);
        bands.push((high - low) / kinetic);
    }
    // The step is a fraction h omega of the swing's period; 2 pi/100 of it makes a few percent.
    assert!(bands[0] < 0.05, "{bands:?}");
    // First order at least: half of the step, half of the band; a tenth more for its phase.
    assert!(bands[1] < 0.55 * bands[0], "{bands:?}");
}

/// Where XPBD goes with ever smaller substeps, the explicit method is at once.
#[test]
fn xpbd_with_small_substeps_moves_alike() {
    let mesh = block([0.06, 0.02, 0.02], [4, 1, 1], 0.0);
    let model = single_body::<f64>(&mesh, &material(SNH, 2e4, 0.4));
    let inputs = hanging(&model);
    let path = |settings: &SolverSettings, substeps: u32| {
        let mut state = State::at_rest(&model);
        let mut solver = Solver::new(&model, settings);
        let mut path = Vec::new();
        for _ in 0..20 {
            for _ in 0..substeps {
                let dt = 1.0 / 60.0 / f64::from(substeps);
                solver.step(&model, &mut state, &inputs, dt).expect("a legal step");
            }
            path.extend(
                state.positions.iter().zip(&model.rest_positions).map(|(x, rest)| *x - *rest),
            );
        }
        path
    };
    let norm = |path: &[Vec3<f64>]| path.iter().map(|u| u.length_squared()).sum::<f64>().sqrt();
    let truth = path(&explicit(), 1);
    let error = |substeps: u32| {
        let settings = SolverSettings { iterations: Count::Of(8), ..SolverSettings::xpbd() };
        let path = path(&settings, substeps);
        let away: Vec<_> = path.iter().zip(&truth).map(|(a, b)| *a - *b).collect();
        norm(&away) / norm(&truth)
    };
    let (coarse, fine) = (error(20), error(80));
    println!("XPBD is {coarse:.3} away with 20 substeps, {fine:.4} with 80");
    // Implicit Euler is of first order: a quarter of the step, a quarter of the error, and some more
    // for what sweeps leave.
    assert!(fine < 0.35 * coarse && fine < 0.05, "{coarse} {fine}");
}

/// Viscous tissue comes to the rest that XPBD, exact at rest, finds; pins and forces take part.
#[test]
fn viscous_tissue_comes_to_the_right_rest() {
    let mesh = block([0.06, 0.02, 0.02], [4, 1, 1], 0.0);
    for law in [STVK, SNH] {
        let tissue = material(law, 2e4, 0.4).with_viscosity(0.05).expect("a legal viscosity");
        let model = single_body::<f64>(&mesh, &tissue);
        let mut inputs = hanging(&model);
        inputs.forces.push((model.vertex_count() as u32 - 1, vec3(0.0, 0.01, 0.0)));
        let rest = |settings: &SolverSettings, steps: u32, dt: f64| {
            let mut state = State::at_rest(&model);
            let mut solver = Solver::new(&model, settings);
            for _ in 0..steps {
                solver.step(&model, &mut state, &inputs, dt).expect("a legal step");
            }
            state.positions
        };
        let explicit_rest = rest(&explicit(), 100, 1.0 / 60.0);
        let exact = rest(
            &SolverSettings { iterations: Count::Of(20), ..SolverSettings::xpbd() },
            100,
            1.0 / 60.0,
        );
        let pairs = explicit_rest.iter().zip(&exact);
        let away = pairs.map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
        let moved = exact.iter().zip(&model.rest_positions);
        let moved = moved.map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
        println!("{law:?}: {away:.1e} m away after a move of {moved:.1e} m");
        assert!(away < 1e-3 * moved, "{law:?}: {away:e} of {moved:e}");
    }
}

/// Stiff tissue in small cells needs more steps than anybody waits for: told before anything moves.
#[test]
fn too_many_small_steps_are_refused() {
    let mesh = block([3e-5, 1e-5, 1e-5], [3, 1, 1], 0.0);
    let model = single_body::<f64>(&mesh, &material(SNH, 1e9, 0.4));
    let mut state = State::at_rest(&model);
    let before = state.clone();
    let mut solver = Solver::new(&model, &explicit());
    let error = solver.step(&model, &mut state, &Inputs::default(), 1.0 / 60.0);
    let Err(StepError::TooStiff { stable, .. }) = error else { panic!("{error:?}") };
    assert!(stable < 1e-7, "{stable}");
    assert_eq!(state, before);
}

/// Places and velocities at the ends of steps of changing length are of the second order: half of the small steps, a
/// quarter of the error, at the first step as at the last.
#[test]
fn places_and_velocities_are_of_the_second_order() {
    let mesh = block([0.06, 0.02, 0.02], [4, 1, 1], 0.0);
    let model = single_body::<f64>(&mesh, &material(SNH, 2e4, 0.4));
    // Held bodies lose a little of the first order, so that fast oscillations end.
    let inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
    let ends = |explicit_safety: f64| {
        let settings = SolverSettings { explicit_safety, ..explicit() };
        let (mut solver, mut state) = (Solver::new(&model, &settings), wobbling(&model));
        let mut ends = Vec::new();
        for dt in [1.0 / 60.0, 1.0 / 150.0, 1.0 / 100.0] {
            solver.step(&model, &mut state, &inputs, dt).expect("a legal step");
            ends.extend([state.positions.clone(), state.velocities.clone()]);
        }
        ends
    };
    let exact = ends(0.01);
    let [coarse, fine] = [0.2, 0.1].map(|safety| {
        let away = |(ours, exact): (&Vec<Vec3<f64>>, &Vec<Vec3<f64>>)| {
            let pairs = ours.iter().zip(exact);
            pairs.map(|(a, b)| (*a - *b).length_squared()).sum::<f64>().sqrt()
        };
        ends(safety).iter().zip(&exact).map(away).collect::<Vec<_>>()
    });
    let orders: Vec<f64> = coarse.iter().zip(&fine).map(|(a, b)| a / b).collect();
    println!("errors {coarse:?} shrink by {orders:?}");
    // Small steps are rounded to whole numbers of them, by a fiftieth at most; the exact one is a twentieth of the coarse.
    assert!(orders.iter().all(|order| (3.7..4.3).contains(order)), "{orders:?}");
}

/// Neighbours that move against each other stand still after a few frames where something holds the body, while it swings on as
/// a whole; nothing else takes energy.
#[test]
fn fast_oscillations_of_a_held_body_end() {
    let mesh = block([0.06, 0.02, 0.02], [6, 2, 2], 0.0);
    let model = single_body::<f64>(&mesh, &material(SNH, 2e4, 0.4));
    let inputs = Inputs { gravity: Vec3::ZERO, ..hanging(&model) };
    let left = |velocity: &dyn Fn(usize, Vec3<f64>) -> Vec3<f64>, frames: u32| {
        let (mut solver, mut state) = (Solver::new(&model, &explicit()), State::at_rest(&model));
        for (v, x) in model.rest_positions.iter().enumerate().filter(|(_, x)| x.x > 1e-9) {
            state.velocities[v] = velocity(v, *x);
        }
        let energy = |state: &State<f64>| {
            let tissue = measure_tissue(&model, &state.positions);
            let energy = measure_energies(&model, state, &inputs, &tissue);
            energy.kinetic + energy.elastic
        };
        let start = energy(&state);
        for _ in 0..frames {
            solver.step(&model, &mut state, &inputs, 1.0 / 60.0).expect("a legal step");
        }
        energy(&state) / start
    };
    let against = |v: usize, _| vec3(0.0, if v.is_multiple_of(2) { 0.02 } else { -0.02 }, 0.0);
    let along = |_, x: Vec3<f64>| vec3(0.0, 10.0 * x.x * x.x, 0.0);
    let (fast, slow) = (left(&against, 12), left(&along, 12));
    println!("{fast:.3} of fast oscillations is left, {slow:.4} of a slow one");
    assert!(fast < 0.1 && slow > 0.95, "{fast} {slow}");
}

/// Forces that are reported balance what moves: viscous ones and inertia are those of the moment.
#[test]
fn a_viscous_body_in_motion_is_in_balance() {
    let mesh = block([0.06, 0.02, 0.02], [6, 2, 2], 0.0);
    for viscosity in [0.0, 0.02] {
        let tissue = material(SNH, 2e4, 0.4).with_viscosity(viscosity).expect("legal");
        let model = single_body::<f64>(&mesh, &tissue);
        let inputs = hanging(&model);
        let (mut solver, mut state) = (Solver::new(&model, &explicit()), State::at_rest(&model));
        for frame in 0..4 {
            solver.step(&model, &mut state, &inputs, 1.0 / 60.0).expect("a legal step");
            let mut balance = ForceBalance::default();
            solver.force_balance(&model, &state, &inputs, &mut balance).expect("a step");
            let left = balance.relative_residual();
            println!("viscosity {viscosity} s, frame {frame}: {left:.1e} of the loads");
            assert!(left < 0.02, "viscosity {viscosity} s, frame {frame}: {left:e}");
        }
    }
}

/// The energy of small steps swings about its mean: what has gone is remembered, up to a tenth of all, and may come back
/// until a hand moves the body. The sum never grows.
#[test]
fn energy_that_has_gone_may_come_back_until_a_hand_moves_the_body() {
    let mesh = block([0.04, 0.02, 0.02], [2, 1, 1], 0.0);
    let model = single_body::<f64>(&mesh, &material(SNH, 2e4, 0.3));
    let mut inputs = Inputs { gravity: Vec3::ZERO, ..hanging(&model) };
    let settings = SolverSettings { explicit_safety: 0.5, ..explicit() };
    let (mut solver, mut state) = (Solver::new(&model, &settings), State::at_rest(&model));
    for (v, x) in state.velocities.iter_mut().zip(&model.rest_positions) {
        *v = vec3(2.0 * x.x, 0.0, 0.0);
    }
    let energy = |state: &State<f64>, inputs: &Inputs<f64>| {
        let tissue = measure_tissue(&model, &state.positions);
        let energy = measure_energies(&model, state, inputs, &tissue);
        energy.kinetic + energy.elastic
    };
    let dt = 2.0 * solver.stable_step();
    let (mut had, mut owed, mut came_back) = (energy(&state, &inputs), 0.0, 0);
    for _ in 0..100 {
        solver.step(&model, &mut state, &inputs, dt).expect("a legal step");
        let (has, before) = (energy(&state, &inputs), owed);
        owed = state.learned.parts[0].owed;
        let expected = (had + before - has).clamp(0.0, 0.1 * has);
        assert!((owed - expected).abs() < 1e-9 * has, "{owed:e} J, {expected:e} J expected");
        came_back += u32::from(has > had);
        had = has;
    }
    assert!(owed > 0.0 && came_back > 5, "{owed:e} J, {came_back} times");
    inputs.pins.iter_mut().for_each(|pin| pin.target += vec3(1e-5, 0.0, 0.0));
    solver.step(&model, &mut state, &inputs, dt).expect("a legal step");
    assert_eq!(state.learned.parts[0].owed, 0.0);
}
