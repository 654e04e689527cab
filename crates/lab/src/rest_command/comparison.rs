//! The library's own solver brought to rest in the same scene, and how far that is from the truth.

use anyhow::{Result, anyhow, bail};
use viscera::scalar::{Real, Vec3};
use viscera::scene::Scene;
use viscera::settings::Precision;
use viscera::simulation::Simulation;
use viscera::solver::Solver;
use viscera::state::State;

use super::path::Rest;
use crate::sections::Progress;
use crate::settling::{Distance, KEPT_VELOCITY};
use viscera_reference::Reference;
use viscera_report::{percent, scientific};
use viscera_resources::Memory;

/// Time [s] given to the body to settle after the scene has ended.
const SETTLING: f64 = 3.0;

/// Farther than this share of the displacement is another place, no inaccuracy.
const ELSEWHERE: f64 = 0.01;

/// Rounding of positions in single precision, relative to their size, and of what adds up from it.
const ROUNDING: f64 = 1e-6;

/// How many frames the library computes for a scene.
pub fn frame_count(scene: &Scene) -> u64 {
    scene.frame_count() + (SETTLING / scene.time.frame).ceil() as u64
}

/// Positions [m] at which the library's solver settles with the scene's own settings, with a step of
/// the bar for each frame.
pub fn settle(simulation: &Simulation<f64>, progress: &Progress) -> Result<Vec<Vec3<f64>>> {
    match simulation.scene().solver.precision {
        Precision::F32 => settle_in::<f32>(simulation, progress),
        Precision::F64 => settle_in::<f64>(simulation, progress),
    }
}

fn settle_in<S: Real>(simulation: &Simulation<f64>, progress: &Progress) -> Result<Vec<Vec3<f64>>> {
    let (scene, assembly) = (simulation.scene().clone(), simulation.assembly().clone());
    let time = scene.time.clone();
    let (own, all) = (scene.frame_count(), frame_count(&scene));
    let end = own as f64 * time.frame;
    let simulation = Simulation::<S>::new(scene, assembly)?;
    let (settings, model) = (simulation.solver().clone(), simulation.model());
    let (mut solver, mut state) = (Solver::new(model, &settings), State::at_rest(model));
    let substeps = simulation.substeps();
    let dt = time.frame / f64::from(substeps);
    for frame in 0..all {
        let _case = progress.case(&format!("frame {} of {all}", frame + 1));
        let start = frame as f64 * time.frame;
        for substep in 1..=substeps {
            // The scene ends as the reference sees it: nothing is let go while it settles.
            let now = (start + f64::from(substep) * dt).min(end);
            solver.step(model, &mut state, &simulation.inputs_at(now), dt)?;
        }
        if !state.is_finite() {
            bail!(
                "{}: the library's solver diverged at {start:.3} s; raise solver.substeps or lower \
                 solver.relaxation with --set",
                simulation.scene().name
            );
        }
        let kept = if frame < own { 1.0 } else { KEPT_VELOCITY };
        let factor = S::from_f64(kept.min(time.velocity_factor));
        for velocity in &mut state.velocities {
            *velocity = *velocity * factor;
        }
    }
    Ok(state.positions.iter().map(|x| x.cast()).collect())
}

/// Compares settled positions [m] with the state of rest; rows of name and value.
pub fn compare(
    simulation: &Simulation<f64>,
    rest: &Rest,
    ours: &[Vec3<f64>],
    memory: Memory,
) -> Result<Vec<(&'static str, String)>> {
    let model = simulation.model();
    let elements = simulation.solver().elements;
    let mut reference = Reference::with_elements(model, elements).allow_memory(memory.0);
    let pinned = reference.check_held(ours, &rest.state.inputs)?;
    let free: Vec<u32> = (0u32..).zip(&pinned).filter(|(_, p)| !**p).map(|(v, _)| v).collect();
    let distance = |from: &[Vec3<f64>]| {
        Distance::new(&model.rest_positions, &rest.state.positions, from, &free)
    };
    let Distance { rms, largest, stiffness } = distance(ours);
    let standing = reference.standing(ours, &rest.state.inputs)?;
    // Where nothing moves, a share of the displacement says nothing: within the rounding of single
    // precision two places are one.
    let reach = rest.state.positions.iter().map(|x| x.length()).fold(0.0, f64::max);
    let is_near = |from: &[Vec3<f64>]| {
        let gap = from.iter().zip(&rest.state.positions).map(|(x, y)| (*x - *y).length());
        distance(from).rms <= ELSEWHERE || gap.fold(0.0, f64::max) <= ROUNDING * reach
    };
    let verdict = if is_near(ours) {
        "the reference's state of rest".to_owned()
    } else {
        // Newton's method from there tells a state of rest of its own from one not yet reached.
        match reference.settle(ours, &rest.state.inputs) {
            Ok(near) if !is_near(&near.positions) => {
                let near = reference.standing(&near.positions, &rest.state.inputs)?;
                let more = (near.potential - rest.standing.potential) * 1e3;
                let how = if more > 0.0 { "above" } else { "below" };
                format!("another minimum, {:.3e} mJ {how} the reference's", more.abs())
            }
            Ok(_) => "the same state of rest, not yet reached".to_owned(),
            Err(error) => format!("unknown: {}", anyhow!(error)),
        }
    };
    Ok(vec![
        ("rms error", moved(rms, percent)),
        ("largest error", moved(largest, percent)),
        ("apparent stiffness", moved(stiffness, |s| format!("{s:.5}"))),
        ("|grad| / load, library", scientific(standing.gradient / rest.load())),
        ("|grad| / load, reference", scientific(rest.relative_gradient())),
        ("the library is at", verdict),
    ])
}

/// A ratio to the displacement; where nothing is displaced there is none.
fn moved(ratio: f64, shown: impl Fn(f64) -> String) -> String {
    if ratio.is_finite() { shown(ratio) } else { "nothing moves".to_owned() }
}
