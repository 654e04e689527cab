//! Iterates of a step on the CPU, and what accelerations make of them.

use super::acceleration::chebyshev_update;
use super::cpu::{Step, Workspace};
use super::forms::{Form, with_form};
use super::sweep::read_vec3;
use crate::model::Model;
use crate::scalar::Real;
use crate::scalar::lanes::{LANES, Point};
use crate::settings::{Acceleration, AndersonGuard, AndersonOn};
use crate::state::State;

#[derive(Clone, Debug, Default)]
pub(super) struct Iterate<S> {
    pub positions: Vec<Point<S>>,
    pub multipliers: Vec<S>,
}

impl<S: Real> Workspace<S> {
    pub(super) fn start_acceleration(&mut self, step: &Step<'_, S>, state: &mut State<S>) {
        state.multiplier_dt = step.dt;
        self.anderson.start();
        self.chebyshev.start(step.settings.chebyshev_radius);
        if !self.norm_weights.is_empty() {
            let (positions, multipliers) =
                self.norm_weights.split_at_mut(3 * step.model.vertex_count());
            for (weights, &mass) in
                positions.as_chunks_mut::<3>().0.iter_mut().zip(&self.ground.masses)
            {
                *weights = [mass; 3];
            }
            fill_multiplier_weights(step.model, step.dt, multipliers);
            if step.settings.acceleration == Acceleration::Anderson {
                match step.settings.anderson_on {
                    AndersonOn::Positions => multipliers.fill(S::ZERO),
                    AndersonOn::Multipliers => positions.fill(S::ZERO),
                    AndersonOn::Both => {}
                }
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
        let change = self.change_norm(multipliers).sqrt();
        let measured = settings.chebyshev_radius == 0.0;
        let omega = self.chebyshev.weight(change, settings.chebyshev_delay, measured);
        let gamma = S::from_f64(settings.chebyshev_damping);
        if omega == 1.0 && settings.chebyshev_damping == 1.0 {
            return;
        }
        let omega = S::from_f64(omega);
        let [now, older] = &self.iterate;
        for (v, point) in self.points.iter_mut().enumerate() {
            let mut x = point.vec3();
            let (q, o) = (now.positions[v].vec3(), older.positions[v].vec3());
            for axis in 0..3 {
                chebyshev_update(&mut x[axis], q[axis], o[axis], omega, gamma);
            }
            point.set_vec3(x);
        }
        for (i, l) in multipliers.iter_mut().enumerate() {
            chebyshev_update(l, now.multipliers[i], older.multipliers[i], omega, gamma);
        }
    }

    /// Squared norm of what the sweep changed: `sum m |dx|^2 + sum a~ dl^2`.
    fn change_norm(&self, multipliers: &[S]) -> f64 {
        let mut sum = 0.0;
        for (v, x) in self.points.iter().enumerate() {
            let change = x.vec3() - self.iterate[0].positions[v].vec3();
            sum += self.ground.masses[v].to_f64() * change.length_squared().to_f64();
        }
        let weights = &self.norm_weights[3 * self.points.len()..];
        for (i, l) in multipliers.iter().enumerate() {
            let change = (*l - self.iterate[0].multipliers[i]).to_f64();
            sum += weights[i].to_f64() * change * change;
        }
        sum
    }

    pub(super) fn anderson(&mut self, step: &Step<'_, S>, multipliers: &mut [S], on: AndersonOn) {
        let vertices = self.points.len();
        let before = &self.iterate[0];
        let (mapped, residual) = self.anderson.push();
        let (mapped_positions, mapped_multipliers) = mapped.split_at_mut(3 * vertices);
        let (moved, changed) = residual.split_at_mut(3 * vertices);
        for v in 0..vertices {
            let (x, before) = (self.points[v].vec3(), before.positions[v].vec3());
            mapped_positions[3 * v..3 * v + 3].copy_from_slice(&x.to_array());
            moved[3 * v..3 * v + 3].copy_from_slice(&(x - before).to_array());
        }
        mapped_multipliers.copy_from_slice(multipliers);
        for ((change, &l), &before) in
            changed.iter_mut().zip(&*multipliers).zip(&before.multipliers)
        {
            *change = l - before;
        }
        let guard = step.settings.guard_of_mixtures() == AndersonGuard::Residual;
        let workers = &self.ground.workers;
        let (weights, count) = self.anderson.weights_by(workers, &self.norm_weights, guard);
        let weights = &weights[..count];
        if on != AndersonOn::Multipliers {
            self.anderson.mix_by(workers, weights, 0, &mut self.mixed);
            for (v, point) in self.points.iter_mut().enumerate() {
                point.set_vec3(read_vec3(&self.mixed, 3 * v));
            }
        }
        if on != AndersonOn::Positions {
            self.anderson.mix_by(workers, weights, 3 * vertices, multipliers);
        }
    }
}

/// The diagonal of `a~` of every multiplier.
pub(super) fn fill_multiplier_weights<S: Real>(model: &Model<S>, dt: f64, weights: &mut [S]) {
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
