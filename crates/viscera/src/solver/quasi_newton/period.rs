//! The period of the slowest oscillation about the rest shape, which tells how many steps follow the motion.
//!
//! ```text
//! (M + h^2 K) d = M e  for each axis e, h long;   omega^2 = d.K d/d.M d
//! ```
//!
//! The shape in which a body gives way to its own weight is close to that of its slowest oscillation, and Rayleigh's
//! quotient forgives what is missing: it is off by the square. Conjugate gradients with the preconditioner at hand;
//! products with `K` are differences of the gradient.

use super::preconditioner::Curvature;
use super::{Memory, Way, moments, vectors};
use crate::scalar::{Real, Vec3, vec3};
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::predict::Tethers;
use crate::solver::step::strain::measure_strain;

/// Iterations at most; a residual this much smaller than the load is small enough.
const ITERATIONS: usize = 15;
const RESIDUAL: f64 = 0.03;

/// A step [s] that is far longer than any period, so that stiffness decides and viscosity does not.
const LONG: f64 = 100.0;

/// Displacement of a difference, as a share of the body's extent.
const DIFFERENCE: f64 = 1e-4;

impl<S: Real> Memory<S> {
    /// The longest period [s] of each part, and of all those that something holds the shortest of these; infinite
    /// where nothing is held. Positions and velocities of `data` are lost.
    pub fn slowest_period(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) -> f64 {
        let layout = step.layout;
        let step = Step { dt: LONG, ..*step };
        data.read_positions(layout, &layout.rest_positions);
        data.prepare(&step, Tethers::AsInertia);
        data.constants.previous.copy_from_slice(&data.points);
        data.constants.predicted.copy_from_slice(&data.points);
        self.base.copy_from_slice(&data.points);
        self.stage_start.copy_from_slice(&data.points);
        let constants = &mut data.constants;
        let (workers, strains) = (&constants.workers, &mut constants.start_strain);
        measure_strain(workers, layout, None, &data.points, strains);
        self.preconditioner.fit(layout, &data.constants);
        let curvature =
            Curvature { dt: step.dt, x: &self.base, moments: moments(&step, &self.stage_start) };
        for number in 0..layout.part_count() {
            self.preconditioner.refresh(layout, &data.constants, &curvature, number);
        }
        self.gradient_at(&step, data, |_| true);
        self.start_velocities.copy_from_slice(&self.trial_gradient);
        let mut slowest = vec![0.0f64; layout.part_count()];
        for axis in [vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0)] {
            for (number, longest) in slowest.iter_mut().enumerate() {
                if data.constants.holds(&layout.parts[number]) {
                    *longest = longest.max(self.period_along(axis, &step, data, number));
                }
            }
        }
        slowest.into_iter().filter(|period| *period > 0.0).fold(f64::INFINITY, f64::min)
    }

    /// The gradient at the trial, of some parts.
    fn gradient_at(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        acts: impl Fn(usize) -> bool + Sync,
    ) {
        let Self { evaluation, base, stage_start, trial_gradient, .. } = self;
        let StepData { constants, points, loads, .. } = data;
        let way = Way { from: base, to: points, moments: moments(step, stage_start) };
        evaluation.gradient(constants, step, &way, acts, loads, trial_gradient);
    }

    /// Of a part, in the shape in which it gives way to a load along an axis; zero where that tells nothing.
    fn period_along(
        &mut self,
        axis: Vec3<f64>,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        number: usize,
    ) -> f64 {
        let range = step.layout.parts[number].vertices.clone();
        // `gradient` is the residual, `trial_z` the solution, `direction` that of conjugate gradients.
        for v in range.clone() {
            let is_free = data.constants.inverse_masses[v] != S::ZERO;
            let load = axis.cast::<S>() * data.constants.masses[v];
            self.gradient[v] = if is_free { load } else { Vec3::ZERO };
            self.first_velocities[v] = self.gradient[v];
            self.trial_z[v] = Vec3::ZERO;
            self.direction[v] = Vec3::ZERO;
        }
        let enough = RESIDUAL * RESIDUAL * self.along(data, number, |m| [&m.gradient, &m.gradient]);
        let mut rz = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let Self { preconditioner, gradient, z, .. } = self;
            let (r, into) = (&gradient[range.clone()], &mut z[range.clone()]);
            preconditioner.apply(&data.constants.workers, number, r, into);
            let before = rz;
            rz = self.along(data, number, |m| [&m.gradient, &m.z]);
            let share = S::from_f64(rz / before);
            for v in range.clone() {
                self.direction[v] = self.z[v] + self.direction[v] * share;
            }
            if !self.stiffen(step, data, number) {
                break;
            }
            let length = rz / self.along(data, number, |m| [&m.direction, &m.trial_gradient]);
            if !(length > 0.0 && length.is_finite()) {
                break;
            }
            let length = S::from_f64(length);
            for v in range.clone() {
                self.trial_z[v] += self.direction[v] * length;
                self.gradient[v] = self.gradient[v] - self.trial_gradient[v] * length;
            }
            if self.along(data, number, |m| [&m.gradient, &m.gradient]) < enough {
                break;
            }
        }
        let mass = |v: usize| data.constants.masses[v].to_f64();
        let term = |v: usize| mass(v) * self.trial_z[v].length_squared().to_f64();
        let inertia: f64 = range.map(term).sum();
        let work = self.along(data, number, |m| [&m.trial_z, &m.first_velocities])
            - self.along(data, number, |m| [&m.trial_z, &m.gradient]);
        let squared = (work / inertia - 1.0) / (LONG * LONG);
        let is_oscillation = squared > 0.0 && squared.is_finite();
        if is_oscillation { 2.0 * std::f64::consts::PI / squared.sqrt() } else { 0.0 }
    }

    /// The product of two vectors of a part.
    fn along<'a>(
        &'a self,
        data: &StepData<S>,
        number: usize,
        vectors: impl FnOnce(&'a Self) -> [&'a Vec<Vec3<S>>; 2],
    ) -> f64 {
        let [a, b] = vectors(self);
        let range = self.preconditioner.vertices(number);
        vectors::dot(&data.constants.workers, &a[range.clone()], &b[range])
    }

    /// `(M + h^2 K) d` of a part into `trial_gradient`, by a difference; false of a direction that is none.
    fn stiffen(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, number: usize) -> bool {
        let range = step.layout.parts[number].vertices.clone();
        let first = self.base[range.start].vec3();
        let (low, high) = range.clone().fold((first, first), |(low, high), v| {
            (low.min(self.base[v].vec3()), high.max(self.base[v].vec3()))
        });
        let extent = (high - low).length().to_f64();
        let largest =
            range.clone().fold(0.0, |most: f64, v| most.max(self.direction[v].length().to_f64()));
        if !(largest > 0.0 && largest.is_finite() && extent > 0.0) {
            return false;
        }
        let small = S::from_f64(DIFFERENCE * extent / largest);
        for v in range.clone() {
            data.points[v].set_vec3(self.base[v].vec3() + self.direction[v] * small);
        }
        self.gradient_at(step, data, |part| part == number);
        data.points[range.clone()].copy_from_slice(&self.base[range.clone()]);
        let inverse = S::ONE / small;
        for v in range {
            let change = self.trial_gradient[v] - self.start_velocities[v];
            self.trial_gradient[v] = change * inverse;
        }
        true
    }
}
