//! What `method = "auto"` stands for in a scene, and the errors that the chosen settings lead one to expect.

use super::Assembly;
use super::holding::GraspOrigins;
use crate::elements::shape_gradients;
use crate::model::Model;
use crate::scalar::Real;
use crate::scene::Scene;
use crate::settings::{Elements, Integrator, Method, SolverSettings};
use crate::solver::oscillations::Oscillations;
use crate::solver::{Inputs, Solver, choose, expected_motion_error, explicit_growth};

/// Cost of a pass of the quasi-Newton method over that of a small explicit step: 23 over 10.8 ns per tetrahedron, measured
/// with 1,000 to 100,000 of them by `viscera bench` (AVX2, one thread). Too large, and explicit steps are taken where they
/// cost more; too small, and the quasi-Newton method is.
const PASS_OVER_SMALL_STEP: f64 = 2.1;

/// The same of recovered-gradient tetrahedra, whose forces cost more: 52 over 45 ns.
const PASS_OVER_SMALL_STEP_RECOVERED: f64 = 1.15;

/// The share of the shear stiffness that the shortest waves of recovered-gradient tetrahedra have at least: what counts per
/// tetrahedron, whose own gradient they leave as it is, without room for what a vertex's neighbours do to it.
const LEAST_SHEAR: f64 = 0.5;

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
pub struct Chosen<S> {
    /// The scene's settings, with a method in the place of "auto".
    pub settings: SolverSettings,
    /// How the bodies swing, where the choice had to know it.
    pub oscillations: Option<Oscillations>,
    /// The solver of these settings, where the choice has built it: of a large mesh a second one takes seconds.
    pub solver: Option<Solver<S>>,
}

impl<S: Real> Chosen<S> {
    fn without_solver(settings: SolverSettings) -> Self {
        Self { settings, oscillations: None, solver: None }
    }

    fn with_solver(solver: Solver<S>, oscillations: Oscillations) -> Self {
        let (settings, oscillations) = (solver.settings().clone(), Some(oscillations));
        Self { settings, oscillations, solver: Some(solver) }
    }
}

/// The method of a scene: the cheaper one of those that are as accurate as asked; `on_device` where the caller has chosen a
/// device.
pub fn choose_method<S: Real>(
    scene: &Scene,
    assembly: &Assembly,
    model: &Model<S>,
    on_device: bool,
) -> Chosen<S> {
    if on_device {
        return Chosen::without_solver(scene.solver.chosen_on_device());
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
) -> Chosen<S> {
    let asked = &asked.foreseen();
    let large = asked.chosen(Method::QuasiNewton);
    if asked.method != Method::Auto {
        return Chosen::without_solver(large);
    }
    let mut quasi_newton = Solver::new(model, &large);
    let oscillations = quasi_newton.oscillations(&fixings());
    let substeps = quasi_newton.substeps_for(&oscillations, frame);
    let of_large = cost(&large, model, frame, substeps, f64::INFINITY);
    // A large mesh would take memory and seconds for what is known without.
    if fewest_small_steps(model, large.elements, frame) > of_large {
        return Chosen::with_solver(quasi_newton, oscillations);
    }
    let explicit = explicit_solver(asked, model, &oscillations);
    let small_steps = explicit.substeps_for(&oscillations, frame);
    let of_explicit = cost(explicit.settings(), model, frame, small_steps, explicit.stable_step());
    let solver = if of_explicit < of_large { explicit } else { quasi_newton };
    Chosen::with_solver(solver, oscillations)
}

/// Small steps in a frame [s] at least, whatever the settings: the largest frequency is not below that of a vertex alone,
/// `w^2 >= tr K_vv/(3 m)`, `tr K_vv = sum_t V (lambda + 4 mu) |g|^2`, and steps of more than `2/w` are unstable. Of
/// recovered-gradient tetrahedra so much is known of the shear alone: short waves keep [`LEAST_SHEAR`] of it.
fn fewest_small_steps<S: Real>(model: &Model<S>, elements: Elements, frame: f64) -> f64 {
    let mut traces = vec![0.0; model.vertex_count()];
    for tet in model.tets() {
        let material = &model.materials[tet.material as usize];
        let (lambda, mu) = (material.lame_lambda.to_f64(), material.lame_mu.to_f64());
        let is_recovered = elements == Elements::Recovered;
        let stiffness = if is_recovered { LEAST_SHEAR * 4.0 * mu } else { lambda + 4.0 * mu };
        let gradients = shape_gradients(&tet.inverse_rest_shape.cast::<f64>());
        for (v, g) in tet.vertices.into_iter().zip(gradients) {
            traces[v as usize] += tet.rest_volume.to_f64() * stiffness * g.length_squared();
        }
    }
    let squares =
        traces.iter().zip(&model.masses).map(|(trace, mass)| trace / (3.0 * mass.to_f64()));
    0.5 * frame * squares.fold(0.0, f64::max).sqrt()
}

/// The explicit method with steps as short as the accuracy asks for.
fn explicit_solver<S: Real>(
    asked: &SolverSettings,
    model: &Model<S>,
    oscillations: &Oscillations,
) -> Solver<S> {
    let settings = asked.chosen(Method::Explicit);
    let solver = Solver::new(model, &settings);
    let most = asked.accuracy.share().max(EXPLICIT_LEAST);
    let error = explicit_error(oscillations, solver.stable_step());
    if error <= most {
        return solver;
    }
    drop(solver);
    // Of the second order.
    let explicit_safety = settings.explicit_safety * (most / error).sqrt();
    Solver::new(model, &SolverSettings { explicit_safety, ..settings })
}

/// As [`choose_method`] of a scene whose method is "auto", where the choice fell upon this one before.
pub fn keep_method<S: Real>(
    scene: &Scene,
    assembly: &Assembly,
    model: &Model<S>,
    method: Method,
) -> Chosen<S> {
    let asked = &scene.solver.foreseen();
    if method != Method::Explicit {
        return Chosen::without_solver(asked.chosen(method));
    }
    let oscillations = oscillations(scene, assembly, model);
    Chosen::with_solver(explicit_solver(asked, model, &oscillations), oscillations)
}

/// How that swings which the fixings of a scene hold.
pub fn oscillations<S: Real>(scene: &Scene, assembly: &Assembly, model: &Model<S>) -> Oscillations {
    let settings = SolverSettings { method: Method::QuasiNewton, ..scene.solver.clone() };
    Solver::new(model, &settings).oscillations(&fixings(scene, assembly))
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
            let is_recovered = settings.elements == Elements::Recovered;
            let pass =
                if is_recovered { PASS_OVER_SMALL_STEP_RECOVERED } else { PASS_OVER_SMALL_STEP };
            pass * (solves * passes + BESIDES)
        }
        Method::Xpbd => f64::NAN,
    };
    substeps * of_substep
}

/// The error of motion of small explicit steps [s]: of oscillations, and never less than [`EXPLICIT_LEAST`].
fn explicit_error(oscillations: &Oscillations, small_step: f64) -> f64 {
    (EXPLICIT_MARGIN * oscillations.error(small_step, explicit_growth)).max(EXPLICIT_LEAST)
}

/// Errors found over those of linear oscillations, with room: those of bodies that explicit steps lead further astray than by
/// [`EXPLICIT_LEAST`] have not been seen.
const EXPLICIT_MARGIN: f64 = 1.5;

/// The smallest error that is foretold. Soft tissue that falls far turns inside out at the wall, and is damped until it has
/// turned back: on bars of 1 and 5 kPa that makes up to 0.34 %. Other bodies are off by less than half of it.
const EXPLICIT_LEAST: f64 = 4e-3;

/// What a run with `substeps` per frame may be expected to be off by, where bodies swing so; the
/// explicit method's steps at rest are as long as is stable, `stable_step` [s].
pub fn expected_errors(
    settings: &SolverSettings,
    oscillations: &Oscillations,
    frame: f64,
    substeps: u32,
    stable_step: f64,
) -> ExpectedErrors {
    match settings.method {
        Method::Auto | Method::QuasiNewton => {
            let follows = settings.integrator == Integrator::Sdirk2;
            let motion = expected_motion_error(settings, oscillations, frame, substeps);
            ExpectedErrors { motion: follows.then_some(motion), at_rest: 2e-3 }
        }
        Method::Explicit => {
            let substep = frame / f64::from(substeps);
            let small_step = substep / (substep / stable_step).ceil();
            let motion = explicit_error(oscillations, small_step).min(1.0);
            ExpectedErrors { motion: Some(motion), at_rest: 2e-3 }
        }
        // Sweeps that are cut short lose motion by an amount that depends on tissue and mesh.
        Method::Xpbd => ExpectedErrors { motion: None, at_rest: 1e-2 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::shapes;
    use crate::model::ModelBuilder;

    /// Of any tissue, on meshes of any shape: no more than the largest stable steps make, and no less than a third of these; of recovered-gradient
    /// tetrahedra at nearly constant volume the small steps themselves are short, by a bound.
    #[test]
    fn the_fewest_small_steps_are_a_bound() {
        for (poisson, jitter) in [(0.0, 0.0), (0.3, 0.2), (0.45, 0.0), (0.499, 0.2)] {
            let law = MaterialModel::StableNeoHookean;
            let tissue = Material::new(law, 2e4, poisson, 1000.0).expect("legal");
            let mesh = shapes::beam(0.08, 0.02, 0.02, 4, jitter).expect("a beam");
            let mut builder = ModelBuilder::new();
            builder.add_body(&mesh, &tissue).expect("a body");
            let model = builder.build::<f32>().expect("a model");
            for (elements, least) in [(Elements::Plain, 0.33), (Elements::Recovered, 0.02)] {
                let settings =
                    SolverSettings { explicit_safety: 1.0, elements, ..SolverSettings::default() };
                let stable = Solver::new(&model, &settings.chosen(Method::Explicit)).stable_step();
                let share = fewest_small_steps(&model, elements, 1.0) * stable;
                println!("{elements:?} {poisson}: {share}");
                assert!((least..1.0).contains(&share), "{elements:?}, {poisson}: {share}");
            }
        }
    }
}
