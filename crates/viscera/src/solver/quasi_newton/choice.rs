//! What the method chooses by itself where the settings do not.

use super::sdirk2::growth;
use crate::layout::{Layout, Part};
use crate::material::MaterialConstants;
use crate::scalar::Real;
use crate::settings::{Count, MOST_HISTORY, SolverSettings};
use crate::solver::oscillations::Oscillations;

/// Passes and pairs up to a Poisson's ratio, for [`STANDARD`]: the fewest that follow a swinging bar of 1,280 and of 10,240 tetrahedra to
/// within about 4 %, with one step per frame (5 % at 0.49). What is nearly incompressible converges more slowly. With 3 pairs
/// instead of 5, eight passes leave 2.8 to 4.9 % of the same bars, as sums are rounded; 4, 5, 6 and 8 pairs leave at most 3.7 %.
const BY_POISSON: [(f64, u32, u32); 3] = [(0.38, 8, 5), (0.46, 10, 10), (0.5, 20, 10)];

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

/// Substeps of SDIRK2 that follow these oscillations to within a share of their path. Stiffer bodies swing less than one
/// sees; they take no more than [`MOST_SUBSTEPS`].
pub fn substeps_for(oscillations: &Oscillations, frame: f64, share: f64) -> u32 {
    let most = f64::from(MOST_SUBSTEPS) * (STANDARD / share).sqrt().max(1.0);
    let follows = |substeps: &u32| {
        let step = frame / f64::from(*substeps);
        error_of_phase(oscillations, step) <= share && error_of_large_motion(step) <= share
    };
    (1..=most as u32).find(follows).unwrap_or(most as u32)
}

/// The error of motion that a run with so many substeps may be expected to have, as a share of its path: of its phase,
/// of large motion, or of solves that are cut short, whichever is largest.
pub fn expected_motion_error(
    settings: &SolverSettings,
    oscillations: &Oscillations,
    frame: f64,
    substeps: u32,
) -> f64 {
    let step = frame / f64::from(substeps);
    let (_, left) = by_accuracy(settings);
    error_of_phase(oscillations, step).max(error_of_large_motion(step)).max(left).min(1.0)
}

fn error_of_phase(oscillations: &Oscillations, step: f64) -> f64 {
    MARGIN * oscillations.error(step, growth)
}

fn error_of_large_motion(step: f64) -> f64 {
    let of_step = step / LARGE_MOTION_STEP;
    LARGE_MOTION * of_step * of_step
}

/// Errors found over those of linear oscillations: 0.8 to 1.5 on bars and organs, whose motion is large and whose solves
/// are cut short.
const MARGIN: f64 = 1.7;

/// Error of the path of soft tissue that falls far, whatever its period, with steps of [`LARGE_MOTION_STEP`] [s]; of the second
/// order of the step.
const LARGE_MOTION: f64 = 0.045;
const LARGE_MOTION_STEP: f64 = 1.0 / 60.0;

/// Substeps that are chosen at most, for [`STANDARD`]; more where less error is asked for.
const MOST_SUBSTEPS: u32 = 10;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::shapes;
    use crate::model::ModelBuilder;
    use crate::solver::oscillations::Oscillation;

    /// Half the error asks for about 1.4 times as many substeps; a body that swings faster for more, up to a limit.
    #[test]
    fn substeps_follow_oscillations() {
        let bodies = |period| {
            let one = Oscillation { period, weight: 1.0 };
            Oscillations::new([vec![one]])
        };
        let frame = 1.0 / 60.0;
        let of = |period, share| substeps_for(&bodies(period), frame, share);
        assert_eq!(of(0.5, STANDARD), 1);
        assert_eq!(of(0.001, STANDARD), MOST_SUBSTEPS);
        let [coarse, fine] = [0.04, 0.01].map(|share| of(0.1, share));
        assert!(coarse > 1 && fine.abs_diff(2 * coarse) <= 1, "{coarse}, {fine}");
        let settings = SolverSettings::default();
        let told = |substeps| expected_motion_error(&settings, &bodies(0.1), frame, substeps);
        let enough = of(0.1, STANDARD);
        assert!(told(enough) <= STANDARD && told(enough - 1) > STANDARD);
        assert_eq!(substeps_for(&Oscillations::default(), frame, STANDARD), 1);
    }

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
        let few = Choice { passes: 8, history: 5 };
        let many = Choice { passes: 10, history: 10 };
        assert_eq!(choose(&automatic, &model.materials), many);
        let by_part = choose_by_part(&automatic, &Layout::new(&model, &automatic));
        assert_eq!(by_part, [few, many, few]);
        let set =
            SolverSettings { iterations: Count::Of(5), history: 2, ..SolverSettings::default() };
        assert_eq!(choose(&set, &model.materials), Choice { passes: 5, history: 2 });
    }
}
