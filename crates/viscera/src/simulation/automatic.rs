//! What `method = "auto"` stands for in a scene, and the errors that the chosen settings lead one to expect.

use super::Assembly;
use super::holding::GraspOrigins;
use crate::model::Model;
use crate::scalar::Real;
use crate::scene::Scene;
use crate::settings::{Integrator, Method, SolverSettings};
use crate::solver::{Inputs, Solver, choose, expected_motion_error};

/// Cost of a pass of the quasi-Newton method over that of a small explicit step: 23 over 10.8 ns per tetrahedron, measured
/// with 1,000 to 100,000 of them by `viscera bench` (AVX2, one thread). Too large, and explicit steps are taken where they
/// cost more; too small, and the quasi-Newton method is.
const PASS_OVER_SMALL_STEP: f64 = 2.1;

/// Small steps that an explicit step costs besides: it finds the stiffness of the shape at its beginning, and energies there
/// and at its end.
const BESIDE_SMALL_STEPS: f64 = 2.6;

/// Passes that a step of the quasi-Newton method costs besides those of its solves.
const BESIDES: f64 = 3.0;

/// The errors that a run's settings lead one to expect, as shares of the displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedErrors {
    /// Of motion over half a second; nothing where the method tells none.
    pub motion: Option<f64>,
    /// Where the tissue comes to rest.
    pub at_rest: f64,
}

/// Inputs of a scene's fixings alone, which are always the same: what a hand holds comes and goes, and a run that is
/// resumed or repeated has to choose the same.
pub fn fixings<S: Real>(scene: &Scene, assembly: &Assembly) -> Inputs<S> {
    let mut fixed = scene.clone();
    fixed.motions.clear();
    let mut inputs = Inputs::default();
    GraspOrigins::default().act(&fixed, assembly, 0.0, &mut inputs);
    inputs
}

/// What a scene is computed by.
pub struct Chosen {
    /// The scene's settings, with a method in the place of "auto".
    pub settings: SolverSettings,
    /// The slowest period [s], where the choice had to know it.
    pub period: Option<f64>,
}

/// The method of a scene: the cheaper one of those that are as accurate as asked; `on_device` where the caller has chosen a
/// device.
pub fn choose_method<S: Real>(
    scene: &Scene,
    assembly: &Assembly,
    model: &Model<S>,
    on_device: bool,
) -> Chosen {
    if on_device {
        return Chosen { settings: scene.solver.chosen(Method::Xpbd), period: None };
    }
    choose_by_cost(&scene.solver, model, scene.time.frame, || fixings(scene, assembly))
}

/// These settings with the method in the place of "auto" that a scene's simulation would put there: for who steps a
/// [`Solver`] of a model by hand. `fixings` are the inputs by which the model is always held, asked for where the choice
/// depends on them; `frame` is the duration of a frame [s].
pub fn automatic_settings<S: Real>(
    asked: &SolverSettings,
    model: &Model<S>,
    frame: f64,
    fixings: impl FnOnce() -> Inputs<S>,
) -> SolverSettings {
    choose_by_cost(asked, model, frame, fixings).settings
}

/// See [`automatic_settings`].
fn choose_by_cost<S: Real>(
    asked: &SolverSettings,
    model: &Model<S>,
    frame: f64,
    fixings: impl FnOnce() -> Inputs<S>,
) -> Chosen {
    let asked = &asked.foreseen();
    let large = asked.chosen(Method::QuasiNewton);
    if asked.method != Method::Auto {
        return Chosen { settings: large, period: None };
    }
    let mut quasi_newton = Solver::new(model, &large);
    let period = quasi_newton.slowest_period(&fixings());
    let substeps = quasi_newton.substeps_for(period, frame);
    let of_large = cost(&large, model, frame, substeps, f64::INFINITY);
    let small = asked.chosen(Method::Explicit);
    let mut explicit = Solver::new(model, &small);
    let most = asked.accuracy.share().max(EXPLICIT_LEAST);
    let error = explicit_error(period, explicit.stable_step());
    if error > most {
        // Of the second order.
        let explicit_safety = small.explicit_safety * (most / error).sqrt();
        explicit = Solver::new(model, &SolverSettings { explicit_safety, ..small });
    }
    let small_steps = explicit.substeps_for(f64::INFINITY, frame);
    let of_explicit = cost(explicit.settings(), model, frame, small_steps, explicit.stable_step());
    let is_explicit = of_explicit < of_large;
    let settings = if is_explicit { explicit.settings().clone() } else { large };
    Chosen { settings, period: Some(period) }
}

/// The slowest period [s] of what the fixings of a scene hold.
pub fn slowest_period<S: Real>(scene: &Scene, assembly: &Assembly, model: &Model<S>) -> f64 {
    let settings = SolverSettings { method: Method::QuasiNewton, ..scene.solver.clone() };
    Solver::new(model, &settings).slowest_period(&fixings(scene, assembly))
}

/// What a frame [s] costs, in passes that add up the forces of all tetrahedra once; `stable_step` [s] is that of the
/// explicit method.
pub fn cost<S: Real>(
    settings: &SolverSettings,
    model: &Model<S>,
    frame: f64,
    substeps: u32,
    stable_step: f64,
) -> f64 {
    let substeps = f64::from(substeps);
    let of_substep = match settings.method {
        Method::Explicit => (frame / substeps / stable_step).ceil() + BESIDE_SMALL_STEPS,
        Method::Auto | Method::QuasiNewton => {
            let solves = if settings.integrator == Integrator::Sdirk2 { 2.0 } else { 1.0 };
            let passes = f64::from(choose(settings, &model.materials).passes);
            PASS_OVER_SMALL_STEP * (solves * passes + BESIDES)
        }
        Method::Xpbd => f64::NAN,
    };
    substeps * of_substep
}

/// The error of motion over half a second of small explicit steps [s], where the slowest oscillation has the period [s]: the
/// error of its phase, and never less than [`EXPLICIT_LEAST`].
fn explicit_error(period: f64, small_step: f64) -> f64 {
    let steps_per_period = period / small_step;
    let phase = EXPLICIT_PHASE * (0.5 / period) / (steps_per_period * steps_per_period);
    phase.max(EXPLICIT_LEAST)
}

/// Error of a path after one period, times the square of the number of small steps in it: 42 to 66 on bars, 100 on a liver,
/// a tenth of that on a bowel, which hangs from more than one side.
const EXPLICIT_PHASE: f64 = 110.0;

/// The smallest error that is foretold. Soft tissue that falls far turns inside out at the wall, and is damped until it has
/// turned back: on bars of 1 and 5 kPa that makes up to 0.34 %. Other bodies are off by less than half of it.
const EXPLICIT_LEAST: f64 = 4e-3;

/// What a run with `substeps` per frame may be expected to be off by, where its slowest oscillation has the period [s]; the
/// explicit method's steps at rest are as long as is stable, `stable_step` [s].
pub fn expected_errors(
    settings: &SolverSettings,
    period: f64,
    frame: f64,
    substeps: u32,
    stable_step: f64,
) -> ExpectedErrors {
    match settings.method {
        Method::Auto | Method::QuasiNewton => {
            let follows = settings.integrator == Integrator::Sdirk2;
            let motion = expected_motion_error(settings, period, frame, substeps);
            ExpectedErrors { motion: follows.then_some(motion), at_rest: 2e-3 }
        }
        Method::Explicit => {
            let substep = frame / f64::from(substeps);
            let small_step = substep / (substep / stable_step).ceil();
            let motion = explicit_error(period, small_step).min(1.0);
            ExpectedErrors { motion: Some(motion), at_rest: 2e-3 }
        }
        // Sweeps that are cut short lose motion by an amount that depends on tissue and mesh.
        Method::Xpbd => ExpectedErrors { motion: None, at_rest: 1e-2 },
    }
}
