//! Iterates of a step on the CPU, and what accelerations make of them: of each connected part by itself.

use super::acceleration::{Anderson, chebyshev_update};
use super::cpu::{Step, Workspace};
use super::forms::{Form, with_form};
use super::sweep::read_vec3;
use crate::model::{Model, Part};
use crate::scalar::Real;
use crate::scalar::lanes::{LANES, Point};
use crate::settings::{AndersonGuard, AndersonOn};
use crate::state::State;

#[derive(Clone, Debug, Default)]
pub(super) struct Iterate<S> {
    pub positions: Vec<Point<S>>,
    pub multipliers: Vec<S>,
}

impl<S: Real> Workspace<S> {
    pub(super) fn start_acceleration(&mut self, step: &Step<'_, S>, state: &mut State<S>) {
        state.multiplier_dt = step.dt;
        for chebyshev in &mut self.chebyshev {
            chebyshev.start(step.settings.chebyshev_radius);
        }
        fill_multiplier_weights(step.model, step.dt, &mut self.multiplier_weights);
        if !self.mixings.is_empty() {
            // Nothing remembers an iterate before the first sweep.
            let weights = &mut self.iterate[0].multipliers;
            weights.fill(S::ZERO);
            fill_multiplier_weights(step.model, step.dt, weights);
            for (mixing, part) in self.mixings.iter_mut().zip(step.model.parts.iter()) {
                mixing.start(part, &self.ground.masses, weights, step.settings.anderson_on);
            }
        }
    }

    pub(super) fn remember_iterate(&mut self, multipliers: &[S]) {
        self.iterate.swap(0, 1);
        if self.iterate[0].positions.is_empty() {
            self.iterate.swap(0, 1);
        }
        self.iterate[0].positions.copy_from_slice(&self.points);
        self.iterate[0].multipliers.copy_from_slice(multipliers);
    }

    pub(super) fn chebyshev(&mut self, step: &Step<'_, S>, multipliers: &mut [S]) {
        let settings = step.settings;
        let measured = settings.chebyshev_radius == 0.0;
        let gamma = S::from_f64(settings.chebyshev_damping);
        for (number, part) in step.model.parts.iter().enumerate() {
            let change = self.change_norm(part, multipliers).sqrt();
            let omega = self.chebyshev[number].weight(change, settings.chebyshev_delay, measured);
            if omega == 1.0 && settings.chebyshev_damping == 1.0 {
                continue;
            }
            let omega = S::from_f64(omega);
            let [now, older] = &self.iterate;
            for v in part.vertices.clone() {
                let mut x = self.points[v].vec3();
                let (q, o) = (now.positions[v].vec3(), older.positions[v].vec3());
                for axis in 0..3 {
                    chebyshev_update(&mut x[axis], q[axis], o[axis], omega, gamma);
                }
                self.points[v].set_vec3(x);
            }
            for i in part.multipliers.iter().cloned().flatten() {
                let (q, o) = (now.multipliers[i], older.multipliers[i]);
                chebyshev_update(&mut multipliers[i], q, o, omega, gamma);
            }
        }
    }

    /// Squared norm of what the sweep changed in a part: `sum m |dx|^2 + sum a~ dl^2`.
    fn change_norm(&self, part: &Part, multipliers: &[S]) -> f64 {
        let before = &self.iterate[0];
        let mut sum = 0.0;
        for v in part.vertices.clone() {
            let change = self.points[v].vec3() - before.positions[v].vec3();
            sum += self.ground.masses[v].to_f64() * change.length_squared().to_f64();
        }
        for range in &part.multipliers {
            let now = multipliers[range.clone()].iter().zip(&before.multipliers[range.clone()]);
            for ((l, before), weight) in now.zip(&self.multiplier_weights[range.clone()]) {
                let change = (*l - *before).to_f64();
                sum += weight.to_f64() * change * change;
            }
        }
        sum
    }

    pub(super) fn anderson(&mut self, step: &Step<'_, S>, multipliers: &mut [S], on: AndersonOn) {
        let guard = step.settings.guard_of_mixtures() == AndersonGuard::Residual;
        let workers = &self.ground.workers;
        for (mixing, part) in self.mixings.iter_mut().zip(step.model.parts.iter()) {
            let points = &mut self.points[part.vertices.clone()];
            mixing.enter(part, points, multipliers, &self.iterate[0]);
            let Mixing { anderson, weights } = mixing;
            let (weights, count) = anderson.weights_by(workers, weights, guard);
            let weights = &weights[..count];
            let first_multiplier = 3 * points.len();
            if on != AndersonOn::Multipliers {
                let mixed = &mut self.mixed[..first_multiplier];
                anderson.mix_by(workers, weights, 0, mixed);
                for (v, point) in points.iter_mut().enumerate() {
                    point.set_vec3(read_vec3(mixed, 3 * v));
                }
            }
            if on != AndersonOn::Positions {
                let mut first = first_multiplier;
                for range in &part.multipliers {
                    anderson.mix_by(workers, weights, first, &mut multipliers[range.clone()]);
                    first += range.len();
                }
            }
        }
    }
}

/// Anderson's iteration of one part, over the positions of its vertices and then its multipliers.
#[derive(Clone, Debug)]
pub(super) struct Mixing<S> {
    pub anderson: Anderson<S>,
    /// Of the norm in which iterates are compared: three of each vertex (its mass, where positions count), then
    /// of the multipliers (the diagonal of `a~`, where they count).
    weights: Vec<S>,
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
    fn start(&mut self, part: &Part, masses: &[S], weights: &[S], on: AndersonOn) {
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
    fn enter(&mut self, part: &Part, points: &[Point<S>], multipliers: &[S], before: &Iterate<S>) {
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
pub(super) fn scatter<S: Copy>(part: &Part, from: &[S], all: &mut [S]) {
    let mut first = 0;
    for range in &part.multipliers {
        all[range.clone()].copy_from_slice(&from[first..first + range.len()]);
        first += range.len();
    }
}

/// The diagonal of `a~` of every multiplier; nothing where there is no room for it.
pub(super) fn fill_multiplier_weights<S: Real>(model: &Model<S>, dt: f64, weights: &mut [S]) {
    if weights.is_empty() {
        return;
    }
    let dt = S::from_f64(dt);
    for set in model.tet_sets() {
        for (block, lane) in set.places() {
            let material = &model.materials[set.blocks[block].material[lane] as usize];
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
                let values = super::forms::GreenStrain::compliances(material, step_volume);
                store(set.viscous_offset, &values);
            }
        }
    }
    for (i, stiffness) in model.springs.stiffness.iter().enumerate() {
        weights[model.springs.multiplier_offset + i] = S::ONE / (*stiffness * dt * dt);
    }
    for (i, stiffness) in model.attachments.stiffness.iter().enumerate() {
        let at = model.attachments.multiplier_offset + 3 * i;
        weights[at..at + 3].fill(S::ONE / (*stiffness * dt * dt));
    }
}

#[cfg(test)]
mod tests {
    use super::super::Inputs;
    use super::super::probe::{begun, everything, quiet, shake};
    use super::*;
    use crate::material::MaterialModel::SaintVenantKirchhoff;
    use crate::settings::SolverSettings;

    /// `1/2 sum a~ l^2 = dt^2 Psi` with the multipliers of the elements' forces: the norm has the measure of
    /// the potential. Without a Poisson's ratio `a~` is its diagonal.
    #[test]
    fn the_norm_of_multipliers_is_the_energy_of_their_elements() {
        let settings = SolverSettings::default();
        let model = everything(&settings, [SaintVenantKirchhoff; 2], 0.0);
        let inputs = Inputs::default();
        let step = quiet(&model, &inputs, &settings, 1e-2);
        let mut work = begun(&step, &model.rest_positions);
        shake(&mut work.points);
        let mut multipliers = vec![f64::NAN; model.multiplier_count];
        work.repair_multipliers(&step, &mut multipliers);
        let mut weights = vec![0.0; model.multiplier_count];
        fill_multiplier_weights(&model, step.dt, &mut weights);
        let half_norm = |range: std::ops::Range<usize>| {
            let pairs = multipliers[range.clone()].iter().zip(&weights[range]);
            0.5 * pairs.map(|(l, weight)| weight * l * l).sum::<f64>()
        };
        work.evaluator.evaluate_all(&work.ground, &step, &work.points);
        let expected = step.dt * step.dt * work.evaluator.stored[0];
        let norm = half_norm(0..model.multiplier_count);
        assert!((norm / expected - 1.0).abs() < 1e-12, "{norm:e} and {expected:e}");
        // Neither kind is too small to be seen in the sum.
        let (springs, held) =
            (model.springs.multiplier_offset, model.attachments.multiplier_offset);
        for range in [0..springs, springs..held, held..model.multiplier_count] {
            assert!(half_norm(range.clone()) > 1e-6 * norm, "{range:?}");
        }
    }
}
