//! A scene in motion by the library's solver, beside exact implicit Euler of the same step.

use anyhow::{Context as _, Result};
use viscera::scalar::{Real, Vec3};
use viscera::settings::SolverSettings;
use viscera::solver::Solver;
use viscera::state::State;

use crate::load_cases::{FRAME_RATE, LoadCase};
use viscera_reference::Reference;

/// Positions [m] at the end of every frame, shape [frame_count][vertex_count].
pub type Motion = Vec<Vec<Vec3<f64>>>;

/// What the library's solver does, from rest, without damping of its own.
pub fn simulate<S: Real>(
    load_case: &LoadCase,
    settings: &SolverSettings,
    frames: u32,
) -> Result<Motion> {
    let model = load_case.model::<S>()?;
    let mut solver = Solver::new(&model, settings);
    let mut state = State::at_rest(&model);
    let dt = 1.0 / FRAME_RATE / f64::from(settings.substeps());
    (0..frames)
        .map(|frame| {
            for time in times(frame, settings.substeps()) {
                solver.step(&model, &mut state, &load_case.inputs(time), dt)?;
            }
            Ok(state.positions.iter().map(|x| x.cast()).collect())
        })
        .collect()
}

/// What exact implicit Euler of the same substeps does.
pub fn exact(load_case: &LoadCase, substeps: u32, frames: u32) -> Result<Motion> {
    let model = load_case.model::<f64>()?;
    let mut reference = Reference::new(&model);
    let mut state = State::at_rest(&model);
    let dt = 1.0 / FRAME_RATE / f64::from(substeps);
    (0..frames)
        .map(|frame| {
            for time in times(frame, substeps) {
                reference
                    .step(&mut state, &load_case.inputs(time), dt)
                    .with_context(|| format!("the reference of {load_case}, frame {frame}"))?;
            }
            Ok(state.positions.clone())
        })
        .collect()
}

/// Ends of a frame's substeps, in frames.
fn times(frame: u32, substeps: u32) -> impl Iterator<Item = f64> {
    (1..=substeps).map(move |s| f64::from(frame) + f64::from(s) / f64::from(substeps))
}

/// Root mean square distance of every frame, over the largest root mean square displacement of the
/// exact motion.
pub fn errors(load_case: &LoadCase, ours: &Motion, exact: &Motion) -> Vec<f64> {
    let rest = load_case.mesh.vertices();
    let norm = |a: &[Vec3<f64>], b: &[Vec3<f64>]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (*a - *b).length_squared()).sum::<f64>().sqrt()
    };
    let largest = exact.iter().map(|x| norm(x, rest)).fold(0.0, f64::max);
    ours.iter().zip(exact).map(|(ours, exact)| norm(ours, exact) / largest).collect()
}
