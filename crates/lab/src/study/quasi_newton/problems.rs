//! The steps that the quasi-Newton method is counted on, and their exact ends.

use anyhow::Result;
use std::{fmt, slice};
use viscera::material::MaterialModel;
use viscera::scalar::Vec3;
use viscera::settings::{Count, SolverSettings};
use viscera::solver::Solver;
use viscera::state::State;

use super::super::methods::quasi_newton;
use super::super::step::MeasuredStep;
use crate::forms::Form;
use crate::load_cases::{FRAME_RATE, LoadCase, Size};
use crate::sections::Changes;
use viscera_reference::Reference;
use viscera_reference::contact::Contacts;
use viscera_reference::objective::{Load, Objective, creep_at};
use viscera_reference::problem::Problem;

/// Scenes and the frames before the measured step, which lies in the middle of the motion.
const MOMENTS: [(&str, u32); 3] = [("cantilever", 10), ("twist", 11), ("grab", 7)];
/// Young's moduli [Pa].
const YOUNGS: [f64; 3] = [1e3, 1e4, 1e5];
const POISSONS: [f64; 3] = [0.3, 0.45, 0.49];
/// Forms of the bar that are looked at beside the usual and the unstructured one, the first to compare others with.
pub(super) const OTHERS: [Form; 7] = [
    Form::Aligned,
    Form::Turned,
    Form::Jittered,
    Form::Slender,
    Form::Touching,
    Form::Cut,
    Form::Inclusion,
];

/// Passes of each frame that leads to the measured step: where that begins need not be exact, and a hundred
/// come close enough for it to lie in the middle of the motion.
const LEADING: u32 = 100;
/// Passes to an exact end: rounding ends them before.
const CONVERGED: u32 = 600;

/// A step of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StepProblem {
    pub scene: &'static str,
    pub form: Form,
    /// Frames before it.
    pub frames: u32,
    /// [Pa].
    pub young: f64,
    pub poisson: f64,
    pub size: Size,
    /// Whether the mesh is the finer one of two.
    pub is_fine: bool,
}

impl fmt::Display for StepProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, form, young, poisson, size, .. } = self;
        write!(f, "{scene}, {form}, {} kPa, nu {poisson}, {size:?} mesh", young / 1e3)
    }
}

/// The coarser and the finer mesh; a mesh of the user's has one size.
fn sizes(quick: bool, changes: &Changes) -> Vec<(Size, bool)> {
    let [coarse, fine] = if quick { [Size::Tiny, Size::Small] } else { [Size::Large, Size::Huge] };
    let mut sizes = vec![(coarse, false)];
    // First what takes longest, so that no core waits for it in the end.
    if changes.mesh.is_none() {
        sizes.insert(0, (fine, true));
    }
    sizes
}

/// Steps on half a million tetrahedra and the same on a tenth of that, which come second: all scenes as usual, and one
/// on an unstructured mesh.
pub(super) fn vast_problems() -> Vec<StepProblem> {
    let (young, poisson, is_fine) = (YOUNGS[1], POISSONS[1], true);
    let mut problems = Vec::new();
    for size in [Size::Vast, Size::Huge] {
        let of = |form, (scene, frames)| StepProblem {
            scene,
            form,
            frames,
            young,
            poisson,
            size,
            is_fine,
        };
        problems.extend(MOMENTS.map(|moment| of(Form::Usual, moment)));
        problems.push(of(Form::Unstructured, MOMENTS[1]));
    }
    problems
}

/// All steps, those on finer meshes first.
pub(super) fn problems(quick: bool, changes: &Changes) -> Vec<StepProblem> {
    let mut problems = Vec::new();
    for (size, is_fine) in sizes(quick, changes) {
        let grid = |form: Form, scenes: usize, youngs: &[f64], poissons: &[f64]| {
            let mut grid = Vec::new();
            for (scene, frames) in MOMENTS.into_iter().take(scenes) {
                for &poisson in changes.poisson.as_ref().map_or(poissons, slice::from_ref) {
                    let youngs = changes.young.as_ref().map_or(youngs, slice::from_ref);
                    let of =
                        |&young| StepProblem { scene, form, frames, young, poisson, size, is_fine };
                    grid.extend(youngs.iter().map(of));
                }
            }
            grid
        };
        let middle = &YOUNGS[1..2];
        problems.extend(grid(Form::Usual, 3, if quick { middle } else { &YOUNGS }, &POISSONS));
        // A mesh of the user's has one form.
        if changes.mesh.is_some() {
            continue;
        }
        let youngs = if quick || is_fine { middle } else { &YOUNGS };
        problems.extend(grid(Form::Unstructured, 3, youngs, &POISSONS));
        let poissons = if quick { &POISSONS[1..2] } else { &POISSONS[..2] };
        for form in OTHERS {
            // The first two scenes are those of the bar.
            problems.extend(grid(form, 2, middle, poissons));
        }
    }
    problems
}

/// Where the same step on the coarser or the finer mesh is in a list.
pub(super) fn on_mesh(problems: &[StepProblem], of: &StepProblem, is_fine: bool) -> Option<usize> {
    let is_same = |other: &StepProblem| StepProblem { is_fine, size: other.size, ..*of } == *other;
    problems.iter().position(is_same)
}

impl StepProblem {
    /// The step with its exact end: by Newton's method on the coarser mesh, on the finer one by the method
    /// itself.
    pub fn step(&self, changes: &Changes) -> Result<MeasuredStep> {
        let tissue = changes.tissue(MaterialModel::StableNeoHookean, self.young, self.poisson)?;
        let load_case = match self.form {
            Form::Usual => changes.load_case(self.scene, self.size, tissue)?,
            form => LoadCase::of_form(self.scene, form, self.size, tissue)?,
        };
        let model = load_case.model::<f64>()?;
        let dt = 1.0 / FRAME_RATE;
        let start = lead(&load_case, self.frames)?;
        let inputs = load_case.inputs(f64::from(self.frames) + 1.0);
        let mut end = State { learned: Default::default(), ..start.clone() };
        if self.is_fine {
            Solver::new(&model, &converging(CONVERGED)).step(&model, &mut end, &inputs, dt)?;
        } else {
            Reference::new(&model).step(&mut end, &inputs, dt)?;
        }
        MeasuredStep::between(load_case, self.frames, dt, start, end.positions)
    }
}

fn converging(iterations: u32) -> SolverSettings {
    SolverSettings { iterations: Count::Of(iterations), history: 10, ..quasi_newton() }
}

/// The state after so many frames of a scene.
fn lead(load_case: &LoadCase, frames: u32) -> Result<State<f64>> {
    let model = load_case.model::<f64>()?;
    let mut solver = Solver::new(&model, &converging(LEADING));
    let mut state = State::at_rest(&model);
    for frame in 1..=frames {
        solver.step(&model, &mut state, &load_case.inputs(f64::from(frame)), 1.0 / FRAME_RATE)?;
    }
    Ok(state)
}

/// What is left of the gradient at the step's exact end, over that at the inertial prediction.
pub(super) fn gradient_left(step: &MeasuredStep) -> Result<f64> {
    let model = step.load_case.model::<f64>()?;
    let problem = Problem::linear(&model);
    let inputs = step.inputs::<f64>();
    let (dt, state) = (step.dt, &step.state);
    let mut inertial = state.positions.clone();
    for (x, v) in inertial.iter_mut().zip(&state.velocities) {
        *x += *v * dt + inputs.gravity * (dt * dt);
    }
    let creep = creep_at(&problem, &state.positions, dt);
    let start = problem.recovered.start(&state.positions, dt);
    let load = Load::Inertia { dt, predicted: inertial, creep, start };
    let (anchors, tethers) = (&inputs.anchors, &inputs.tethers);
    let objective =
        Objective { problem: &problem, anchors, tethers, contacts: Contacts::NONE, load };
    let free = step.load_case.free();
    let norm = |x: &[Vec3<f64>]| -> f64 {
        let gradient = objective.gradient(x);
        free.iter().map(|&v| gradient[v as usize].length_squared()).sum::<f64>().sqrt()
    };
    Ok(norm(&step.exact) / norm(&step.predicted()))
}
