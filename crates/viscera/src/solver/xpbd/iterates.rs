//! Iterates of a step, and the norm in which they are compared: of each connected part by itself.

use super::acceleration::Anderson;
use crate::elements::forms::{Form, GreenStrain, with_form};
use crate::elements::kinds::{Energy, Kind};
use crate::layout::ElementSet;
use crate::layout::{Layout, Part};
use crate::model::for_each_kind;
use crate::scalar::Real;
use crate::scalar::lanes::{LANES, Point};
use crate::settings::AndersonOn;

#[derive(Clone, Debug, Default)]
pub struct Iterate<S> {
    pub positions: Vec<Point<S>>,
    pub multipliers: Vec<S>,
}

/// Anderson's iteration of one part, over the positions of its vertices and then its multipliers.
#[derive(Clone, Debug)]
pub struct Mixing<S> {
    pub anderson: Anderson<S>,
    /// Of the norm in which iterates are compared: three of each vertex (its mass, where positions count), then
    /// of the multipliers (the diagonal of `a~`, where they count).
    pub weights: Vec<S>,
}

impl<S: Real> Mixing<S> {
    pub fn new(part: &Part, window: usize) -> Self {
        let length = 3 * part.vertices.len() + part.multiplier_count();
        Self { anderson: Anderson::new(window, length), weights: vec![S::ZERO; length] }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.anderson.bytes() + size_of_val(&self.weights[..])
    }

    /// Forgets the last step. `masses` and `weights` are those of all vertices and multipliers.
    pub fn start(&mut self, part: &Part, masses: &[S], weights: &[S], on: AndersonOn) {
        self.anderson.start();
        let (positions, multipliers) = self.weights.split_at_mut(3 * part.vertices.len());
        let masses = &masses[part.vertices.clone()];
        for (three, &mass) in positions.as_chunks_mut::<3>().0.iter_mut().zip(masses) {
            *three = [mass; 3];
        }
        gather(part, weights, multipliers);
        match on {
            AndersonOn::Positions => multipliers.fill(S::ZERO),
            AndersonOn::Multipliers => positions.fill(S::ZERO),
            AndersonOn::Both => {}
        }
    }

    /// Enters what a sweep has made of the iterate before it; `points` are those of the part.
    pub fn enter(
        &mut self,
        part: &Part,
        points: &[Point<S>],
        multipliers: &[S],
        before: &Iterate<S>,
    ) {
        let (mapped, residual) = self.anderson.push();
        let (mapped_positions, mapped_multipliers) = mapped.split_at_mut(3 * points.len());
        let (moved, changed) = residual.split_at_mut(3 * points.len());
        let older = &before.positions[part.vertices.clone()];
        for (v, (point, older)) in points.iter().zip(older).enumerate() {
            let x = point.vec3();
            mapped_positions[3 * v..3 * v + 3].copy_from_slice(&x.to_array());
            moved[3 * v..3 * v + 3].copy_from_slice(&(x - older.vec3()).to_array());
        }
        gather(part, multipliers, mapped_multipliers);
        gather(part, &before.multipliers, changed);
        for (change, &l) in changed.iter_mut().zip(&*mapped_multipliers) {
            *change = l - *change;
        }
    }

    /// The sweep entered last, positions and multipliers, and whether it has been mixed with older ones.
    pub fn plain(&self, part: &Part) -> (&[S], &[S], bool) {
        let (newest, is_mixed) = self.anderson.newest();
        let (positions, multipliers) = newest.split_at(3 * part.vertices.len());
        (positions, multipliers, is_mixed)
    }
}

/// A part's of the multipliers, or of what belongs to them.
fn gather<S: Copy>(part: &Part, all: &[S], into: &mut [S]) {
    let mut first = 0;
    for range in &part.multipliers {
        into[first..first + range.len()].copy_from_slice(&all[range.clone()]);
        first += range.len();
    }
}

/// As [`gather`], the other way round.
pub fn scatter<S: Copy>(part: &Part, from: &[S], all: &mut [S]) {
    let mut first = 0;
    for range in &part.multipliers {
        all[range.clone()].copy_from_slice(&from[first..first + range.len()]);
        first += range.len();
    }
}

/// The diagonal of `a~` of every multiplier; nothing where there is no room for it.
pub fn fill_multiplier_weights<S: Real>(layout: &Layout<S>, dt: f64, weights: &mut [S]) {
    if weights.is_empty() {
        return;
    }
    let dt = S::from_f64(dt);
    for set in &layout.tet_sets {
        for (block, lane) in set.places() {
            let material = &layout.materials[set.blocks[block].material[lane] as usize];
            let volume = set.blocks[block].rest_volume[lane];
            let step_volume = volume * dt * dt;
            let mut store = |offset: usize, values: &[S]| {
                for (p, &value) in values.iter().enumerate() {
                    weights[offset + LANES * (values.len() * block + p) + lane] = value;
                }
            };
            with_form!(set.form, F => {
                store(set.multiplier_offset, &F::compliances(material, step_volume));
            });
            if set.viscous && material.viscosity > S::ZERO {
                let step_volume = volume * material.viscosity * dt;
                let values = GreenStrain::compliances(material, step_volume);
                store(set.viscous_offset, &values);
            }
        }
    }
    for_each_kind!(layout, set => fill_weights(set, layout, dt, weights));
}

/// Of the elements of one kind: constraints whose energy has the curvature `k` have `a~ = 1/(k dt^2)`.
fn fill_weights<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    layout: &Layout<S>,
    dt: S,
    weights: &mut [S],
) {
    for i in 0..set.len() {
        let stiffness = set.list.element::<S>(i, &layout.rest_anchors).curvature();
        weights[set.multipliers(i)].fill(S::ONE / (stiffness * dt * dt));
    }
}

#[cfg(test)]
mod tests {
    use super::super::history::repair_multipliers;
    use super::*;
    use crate::material::MaterialModel::SaintVenantKirchhoff;
    use crate::settings::SolverSettings;
    use crate::solver::Inputs;
    use crate::solver::probe::{begun, everything, quiet, shake};

    /// `1/2 sum a~ l^2 = dt^2 Psi` with the multipliers of the elements' forces: the norm has the measure of
    /// the potential. Without a Poisson's ratio `a~` is its diagonal.
    #[test]
    fn the_norm_of_multipliers_is_the_energy_of_their_elements() {
        let settings = SolverSettings::xpbd();
        let model = everything(&settings, [SaintVenantKirchhoff; 2], 0.0);
        let inputs = Inputs::default();
        let step = quiet(&model, &inputs, &settings, 1e-2);
        let mut memory = begun(&step, &model.rest_positions);
        let data = &mut memory.data;
        shake(&mut data.points);
        let mut multipliers = vec![f64::NAN; model.multiplier_count];
        repair_multipliers(&step, data, &mut multipliers);
        let mut weights = vec![0.0; model.multiplier_count];
        fill_multiplier_weights(&model, step.dt, &mut weights);
        let half_norm = |range: std::ops::Range<usize>| {
            let pairs = multipliers[range.clone()].iter().zip(&weights[range]);
            0.5 * pairs.map(|(l, weight)| weight * l * l).sum::<f64>()
        };
        let evaluator = &mut memory.guard.as_mut().expect("guarded steps").evaluator;
        evaluator.evaluate_all(&data.constants, &step, &data.points);
        let expected = step.dt * step.dt * evaluator.stored[0];
        let norm = half_norm(0..model.multiplier_count);
        assert!((norm / expected - 1.0).abs() < 1e-12, "{norm:e} and {expected:e}");
        // Neither kind is too small to be seen in the sum.
        let (springs, held) = (
            model.elements.springs.multiplier_offset,
            model.elements.attachments.multiplier_offset,
        );
        for range in [0..springs, springs..held, held..model.multiplier_count] {
            assert!(half_norm(range.clone()) > 1e-6 * norm, "{range:?}");
        }
    }
}
