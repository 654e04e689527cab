//! What the method chooses by itself where the settings do not.

use crate::layout::{Layout, Part};
use crate::material::MaterialConstants;
use crate::scalar::Real;
use crate::settings::{Count, MOST_HISTORY, SolverSettings};

/// Passes and pairs up to a Poisson's ratio, for [`STANDARD`]: the fewest that follow a swinging bar of 1,280 and of 10,240 tetrahedra to
/// within about 4 %, with one step per frame (5 % at 0.49). What is nearly incompressible converges more slowly.
const BY_POISSON: [(f64, u32, u32); 3] = [(0.38, 8, 3), (0.46, 10, 10), (0.5, 20, 10)];

/// The error of motion that [`BY_POISSON`] is for.
const STANDARD: f64 = 0.05;

/// From an error of motion on: the passes, as a share of those of [`BY_POISSON`], and what solves that are cut short so leave
/// of motion's error. A draft saves substeps only: with fewer passes soft organs went astray by a third of their way. Measured on bars and organs, as the rest here.
const BY_ACCURACY: [(f64, f64, f64); 3] =
    [(0.03, 1.0, 0.045), (0.01, 1.25, 0.01), (0.0, 2.0, 0.005)];

/// Passes per solve, and pairs that are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    pub passes: u32,
    pub history: usize,
}

/// For the tissue of these materials: the least compressible decides.
pub fn choose<'a, S: Real>(
    settings: &SolverSettings,
    materials: impl IntoIterator<Item = &'a MaterialConstants<S>>,
) -> Choice {
    let (passes, pairs) = by_poisson(materials);
    let passes = match settings.iterations {
        Count::Of(count) => count,
        Count::Auto => (f64::from(passes) * by_accuracy(settings).0).ceil() as u32,
    };
    let history = if settings.history == 0 { pairs } else { settings.history };
    Choice { passes, history: (history as usize).min(MOST_HISTORY) }
}

/// For each connected part, passes where the settings leave them to the method.
pub fn choose_by_part<S: Real>(settings: &SolverSettings, layout: &Layout<S>) -> Vec<Choice> {
    let settings = &SolverSettings { iterations: Count::Auto, ..settings.clone() };
    let of_part = |part: &Part| {
        let mut has = vec![false; layout.materials.len()];
        for (law, set) in layout.tet_sets.iter().enumerate() {
            for block in part.blocks(law).flatten() {
                for &material in &set.blocks[block].material[..usize::from(set.filled[block])] {
                    has[material as usize] = true;
                }
            }
        }
        let own = layout.materials.iter().zip(has).filter(|(_, has)| *has);
        choose(settings, own.map(|(material, _)| material))
    };
    layout.parts.iter().map(of_part).collect()
}

fn by_poisson<'a, S: Real>(
    materials: impl IntoIterator<Item = &'a MaterialConstants<S>>,
) -> (u32, u32) {
    let ratio = |material: &MaterialConstants<S>| {
        let [lambda, mu] = [material.lame_lambda, material.lame_mu].map(S::to_f64);
        0.5 * lambda / (lambda + mu)
    };
    let largest = materials.into_iter().map(ratio).fold(0.0, f64::max);
    // Of rounded numbers: in single precision 0.41 may come back a little larger.
    let fits = |&&(limit, ..): &&(f64, u32, u32)| largest <= limit + 1e-6;
    let last = BY_POISSON[BY_POISSON.len() - 1];
    let (_, passes, pairs) = *BY_POISSON.iter().find(fits).unwrap_or(&last);
    (passes, pairs)
}

/// The share of the passes, and what they leave of motion's error.
fn by_accuracy(settings: &SolverSettings) -> (f64, f64) {
    let share = settings.accuracy.share();
    let last = BY_ACCURACY[BY_ACCURACY.len() - 1];
    let (_, passes, left) = *BY_ACCURACY.iter().find(|(from, ..)| share >= *from).unwrap_or(&last);
    (passes, left)
}

/// Substeps of SDIRK2 that follow an oscillation of a period [s] to within a share of its path over half a second. Stiffer
/// bodies swing less than one sees; they take no more than [`MOST_SUBSTEPS`].
pub fn substeps_for(period: f64, frame: f64, share: f64) -> u32 {
    let periods = SECONDS / period;
    let fewest = FEWEST_STEPS * (STANDARD / share).sqrt();
    let steps_per_period = (PHASE_ERROR * periods / (PART_OF_PHASE * share)).sqrt().max(fewest);
    let of_large_motion = frame / LARGE_MOTION_STEP * (LARGE_MOTION / share).sqrt();
    let substeps = (frame * steps_per_period / period).max(of_large_motion).ceil();
    let most = f64::from(MOST_SUBSTEPS) * (STANDARD / share).sqrt().max(1.0);
    // Also of a period that is infinite.
    if substeps.is_finite() { (substeps.min(most) as u32).max(1) } else { 1 }
}

/// The error of motion over half a second that a run with so many substeps may be expected to have, as a share of its path,
/// where its slowest oscillation has the period [s]: of its phase, or of solves that are cut short, whichever is larger.
pub fn expected_motion_error(
    settings: &SolverSettings,
    period: f64,
    frame: f64,
    substeps: u32,
) -> f64 {
    let steps_per_period = period * f64::from(substeps) / frame;
    let phase = PHASE_ERROR * (SECONDS / period) / (steps_per_period * steps_per_period);
    let step = frame / f64::from(substeps) / LARGE_MOTION_STEP;
    let (_, left) = by_accuracy(settings);
    phase.max(LARGE_MOTION * step * step).max(left).min(1.0)
}

/// Duration [s] of the motion whose error is asked for.
const SECONDS: f64 = 0.5;

/// Error of a path after one period, times the square of the number of steps in it: 5.6 on bars, up to 12 on organs, whose
/// faster oscillations take part.
const PHASE_ERROR: f64 = 12.0;

/// The part of the error that is the phase's; the rest is left to solves.
const PART_OF_PHASE: f64 = 0.8;

/// Error of the path of soft tissue that falls far, whatever its period, with steps of [`LARGE_MOTION_STEP`] [s]; of the second
/// order of the step.
const LARGE_MOTION: f64 = 0.045;
const LARGE_MOTION_STEP: f64 = 1.0 / 60.0;

/// Steps in a period at least, for [`STANDARD`].
const FEWEST_STEPS: f64 = 13.0;

/// Substeps that are chosen at most, for [`STANDARD`]; more where less error is asked for.
const MOST_SUBSTEPS: u32 = 10;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::shapes;
    use crate::model::ModelBuilder;

    /// The least compressible of several materials decides, of each part for itself; what is set is taken as it is.
    #[test]
    fn the_least_compressible_material_decides() {
        let mut builder = ModelBuilder::new();
        for poisson in [0.3, 0.45, 0.2] {
            let law = MaterialModel::StableNeoHookean;
            let tissue = Material::new(law, 1e4, poisson, 1000.0).expect("legal");
            let mesh = shapes::beam(0.04, 0.02, 0.02, 1, 0.0).expect("a beam");
            builder.add_body(&mesh, &tissue).expect("a body");
        }
        let model = builder.build::<f32>().expect("a model");
        let automatic = SolverSettings::default();
        let few = Choice { passes: 8, history: 3 };
        let many = Choice { passes: 10, history: 10 };
        assert_eq!(choose(&automatic, &model.materials), many);
        let by_part = choose_by_part(&automatic, &Layout::new(&model, &automatic));
        assert_eq!(by_part, [few, many, few]);
        let set =
            SolverSettings { iterations: Count::Of(5), history: 2, ..SolverSettings::default() };
        assert_eq!(choose(&set, &model.materials), Choice { passes: 5, history: 2 });
    }
}
