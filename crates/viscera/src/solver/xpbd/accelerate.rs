//! Accelerates the iterates of a step, each connected part by itself.

use super::acceleration::chebyshev_update;
use super::iterates::{Mixing, fill_multiplier_weights};
use super::memory::Memory;
use super::sweep::read_vec3;
use crate::layout::Part;
use crate::scalar::Real;
use crate::scalar::lanes::Point;
use crate::settings::{AndersonGuard, AndersonOn};
use crate::solver::step::data::{Step, StepData};

impl<S: Real> Memory<S> {
    /// Forgets the last step's iterates; `masses` are those of the solver's vertices [kg].
    pub fn start_acceleration(&mut self, step: &Step<'_, S>, masses: &[S]) {
        for chebyshev in &mut self.chebyshev {
            chebyshev.start(step.settings.chebyshev_radius);
        }
        fill_multiplier_weights(step.layout, step.dt, &mut self.multiplier_weights);
        if !self.mixings.is_empty() {
            // Nothing remembers an iterate before the first sweep.
            let weights = &mut self.iterate[0].multipliers;
            weights.fill(S::ZERO);
            fill_multiplier_weights(step.layout, step.dt, weights);
            for (mixing, part) in self.mixings.iter_mut().zip(step.layout.parts.iter()) {
                mixing.start(part, masses, weights, step.settings.anderson_on);
            }
        }
    }

    /// [`super::stage::XpbdStage::RememberIterate`], in the place of the iterate before the last sweep.
    pub fn remember_iterate(&mut self, points: &[Point<S>], multipliers: &[S]) {
        self.iterate[0].positions.copy_from_slice(points);
        self.iterate[0].multipliers.copy_from_slice(multipliers);
    }

    /// [`super::stage::XpbdStage::Chebyshev`].
    pub fn chebyshev(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, multipliers: &mut [S]) {
        let settings = step.settings;
        let measured = settings.chebyshev_radius == 0.0;
        let gamma = S::from_f64(settings.chebyshev_damping);
        for (number, part) in step.layout.parts.iter().enumerate() {
            let change = self.change_norm(part, data, multipliers).sqrt();
            let omega = self.chebyshev[number].weight(change, settings.chebyshev_delay, measured);
            if omega == 1.0 && settings.chebyshev_damping == 1.0 {
                continue;
            }
            let omega = S::from_f64(omega);
            let [now, older] = &self.iterate;
            for v in part.vertices.clone() {
                let mut x = data.points[v].vec3();
                let (q, o) = (now.positions[v].vec3(), older.positions[v].vec3());
                for axis in 0..3 {
                    chebyshev_update(&mut x[axis], q[axis], o[axis], omega, gamma);
                }
                data.points[v].set_vec3(x);
            }
            for i in part.multipliers.iter().cloned().flatten() {
                let (q, o) = (now.multipliers[i], older.multipliers[i]);
                chebyshev_update(&mut multipliers[i], q, o, omega, gamma);
            }
        }
    }

    /// Squared norm of what the sweep changed in a part: `sum m |dx|^2 + sum a~ dl^2`.
    fn change_norm(&self, part: &Part, data: &StepData<S>, multipliers: &[S]) -> f64 {
        let before = &self.iterate[0];
        let mut sum = 0.0;
        for v in part.vertices.clone() {
            let change = data.points[v].vec3() - before.positions[v].vec3();
            sum += data.constants.masses[v].to_f64() * change.length_squared().to_f64();
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

    /// [`super::stage::XpbdStage::Anderson`].
    pub fn anderson(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        multipliers: &mut [S],
        on: AndersonOn,
    ) {
        let guard = step.settings.guard_of_mixtures() == AndersonGuard::Residual;
        let workers = &data.constants.workers;
        for (mixing, part) in self.mixings.iter_mut().zip(step.layout.parts.iter()) {
            let points = &mut data.points[part.vertices.clone()];
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
