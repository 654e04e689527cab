//! What `method = "auto"` stands for in a scene, and the errors that the chosen settings lead one to expect.

use super::Assembly;
use super::holding::GraspOrigins;
use crate::model::Model;
use crate::scalar::Real;
use crate::scene::Scene;
use crate::settings::{Integrator, Method, SolverSettings};
use crate::solver::{Inputs, Solver, choose, expected_motion_error};

/// From this error of motion on, steps of the quasi-Newton method are the only choice: they are guarded, and the explicit
/// method's are no more than stable.
const GUARDED_FROM: f64 = 0.01;

/// Cost of a pass of the quasi-Newton method over that of a small explicit step: 23 over 9.6 ns per tetrahedron, measured with
/// 1,000 to 100,000 of them by `viscera bench` (AVX2, one thread).
const PASS_OVER_SMALL_STEP: f64 = 2.4;

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

/// The settings of a scene with a method in the place of "auto"; `on_device` where the caller has chosen a device.
pub fn settings_of<S: Real>(
    scene: &Scene,
    assembly: &Assembly,
    model: &Model<S>,
    on_device: bool,
) -> SolverSettings {
    if on_device {
        return scene.solver.chosen(Method::Xpbd);
    }
    automatic_settings(&scene.solver, model, scene.time.frame, || fixings(scene, assembly))
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
    let asked = &asked.foreseen();
    let large = asked.chosen(Method::QuasiNewton);
    if asked.method != Method::Auto || asked.accuracy.share() >= GUARDED_FROM {
        return large;
    }
    let small = asked.chosen(Method::Explicit);
    let substeps = Solver::new(model, &large).substeps(&fixings(), frame);
    let passes = f64::from(2 * choose(&large, &model.materials).passes) + BESIDES;
    let small_steps = (frame / Solver::new(model, &small).stable_step()).ceil();
    let cheaper = small_steps < PASS_OVER_SMALL_STEP * passes * f64::from(substeps);
    if cheaper { small } else { large }
}

/// What a run with `substeps` per frame may be expected to be off by, where its slowest oscillation has the period [s].
pub fn expected_errors(
    settings: &SolverSettings,
    period: f64,
    frame: f64,
    substeps: u32,
) -> ExpectedErrors {
    match settings.method {
        Method::Auto | Method::QuasiNewton => {
            let follows = settings.integrator == Integrator::Sdirk2;
            let motion = expected_motion_error(settings, period, frame, substeps);
            ExpectedErrors { motion: follows.then_some(motion), at_rest: 2e-3 }
        }
        Method::Explicit => ExpectedErrors { motion: Some(1.5e-3), at_rest: 2e-3 },
        // Sweeps that are cut short lose motion by an amount that depends on tissue and mesh.
        Method::Xpbd => ExpectedErrors { motion: None, at_rest: 1e-2 },
    }
}
