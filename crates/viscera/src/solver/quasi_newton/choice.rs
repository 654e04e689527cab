//! What the method chooses by itself where the settings do not.

use crate::layout::{Layout, Part};
use crate::material::MaterialConstants;
use crate::scalar::Real;
use crate::settings::{Count, MOST_HISTORY, SolverSettings};

/// Passes and pairs up to a Poisson's ratio: the fewest that follow a swinging bar of 1,280 and of 10,240 tetrahedra to
/// within about 4 %, with one step per frame (5 % at 0.49). What is nearly incompressible converges more slowly.
const BY_POISSON: [(f64, u32, u32); 3] = [(0.41, 8, 3), (0.46, 10, 10), (0.5, 16, 10)];

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
        Count::Auto => passes,
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

/// Substeps of SDIRK2 that follow an oscillation of a period [s] to within about 4 % over half a second: its phase is
/// off by a share of the squared step that was measured on bars and organs, and the more so the more periods there are. Stiffer
/// bodies swing less than one sees; they take no more than [`MOST_SUBSTEPS`].
pub fn substeps_for(period: f64, frame: f64) -> u32 {
    let periods = 0.5 / period;
    let steps_per_period = (PHASE_ERROR * periods / 0.04).sqrt().max(FEWEST_STEPS);
    let substeps = (frame * steps_per_period / period).ceil();
    // Also of a period that is infinite.
    if substeps.is_finite() { (substeps as u32).clamp(1, MOST_SUBSTEPS) } else { 1 }
}

/// Error of a path after one period, times the square of the number of steps in it: 5.6 on bars, up to 12 on organs, whose
/// faster oscillations take part.
const PHASE_ERROR: f64 = 12.0;

/// Steps in a period at least.
const FEWEST_STEPS: f64 = 13.0;

/// Substeps that are chosen at most.
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
