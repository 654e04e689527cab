//! Vertices between sweeps: the rebase, and copies that are split and joined.

use super::memory::Memory;
use crate::layout::{Layout, Part};
use crate::scalar::lanes::Point;
use crate::scalar::{Mat3, Real, Vec3};
use crate::settings::SolverSettings;
use crate::solver::step::data::{Step, StepData, copies_of, copy_count, gather};

/// The rebase multiplies an error of curvature `k` by `1 - k/mh`: stable from `mh >= k/2` on, so little
/// more than half of the bound will do, and inertia is regained nearly twice as fast. With less, stiff
/// and nearly incompressible tissue no longer settles in 5 sweeps; with all of it a bar that is dropped
/// lags two to three times as far behind. Where vertices have copies, their sweeps need the whole bound.
pub fn bound_share(is_split: bool) -> f64 {
    if is_split { 1.0 } else { 0.6 }
}

/// The more copies a vertex has, the further a sweep's primal part runs ahead of its multipliers;
/// slowing the rebase alone restores the balance and leaves the fixed point where it is. 1, 1/2
/// and 1/4 are the largest powers of two that settled in every scene tried.
pub fn rebase_factor(is_split: bool, colors: usize, settings: &SolverSettings) -> f64 {
    match (settings.rebase_factor > 0.0, is_split, colors) {
        (true, ..) => settings.rebase_factor,
        (_, false, _) => 1.0,
        (_, true, 1) => 0.25,
        (_, true, _) => 0.5,
    }
}

/// Stabilised rebase: pulls positions back onto `M (x - xt) = J(x)^T l`, from which path
/// dependence drives them, by one damped step in the metric `mh`, a share of the bound of the
/// geometric stiffness above the mass.
pub fn rebase<S: Real>(step: &Step<'_, S>, data: &mut StepData<S>) {
    let model = step.layout;
    let StepData { constants, points, loads, .. } = data;
    for part in model.parts.iter() {
        let factor = rebase_factor(part.is_split(), part.colors.len(), step.settings);
        let factor = S::from_f64(factor);
        let share = S::from_f64(bound_share(part.is_split()));
        constants.each_vertex(part, points, |v, point| {
            if constants.inverse_masses[v] == S::ZERO {
                return;
            }
            let load = gather(model, loads, v);
            let mass = constants.inertias[v];
            let residual = (point.vec3() - constants.predicted[v].vec3()) * mass - load.vec3();
            let inverse = S::ONE / (mass + load.w * share);
            let moved = match constants.contacts.of_vertices.block(v) {
                None => residual * (factor * inverse),
                Some(contact) => {
                    // In double precision: contact may be a thousand times stiffer than the vertex is heavy.
                    let bound = (mass + load.w * share).to_f64();
                    let metric = Mat3::IDENTITY * bound + *contact;
                    (metric.inverse() * residual.cast::<f64>()).cast() * factor
                }
            };
            let x = point.vec3() - moved;
            *point = Point::new(x, inverse * copy_count(model, v));
        });
    }
}

/// [`super::stage::XpbdStage::RecomputePositions`].
pub fn recompute_positions<S: Real>(layout: &Layout<S>, data: &mut StepData<S>) {
    let StepData { constants, points, loads, .. } = data;
    for part in layout.parts.iter() {
        constants.each_vertex(part, points, |v, point| {
            let inverse_mass = constants.inverse_masses[v];
            if inverse_mass != S::ZERO {
                let impulse = gather(layout, loads, v).vec3();
                point.set_vec3(constants.predicted[v].vec3() + impulse * inverse_mass);
            }
        });
    }
}

impl<S: Real> Memory<S> {
    /// [`super::stage::XpbdStage::SplitCopies`].
    pub fn split_copies(&mut self, layout: &Layout<S>, data: &StepData<S>) {
        for (v, point) in data.points.iter().enumerate() {
            self.copies[copies_of(layout, v)].fill(*point);
        }
    }

    /// Averages the changes of the copies, not the copies: the mean of equal numbers is then that
    /// number, and a vertex that no constraint moved stays where it is to the bit.
    pub fn join_copies(&mut self, layout: &Layout<S>, data: &mut StepData<S>) {
        for part in layout.parts.iter() {
            if part.is_split() {
                self.average_copies(layout, part, data);
            } else {
                // As in a model in which nothing is split: the copy is the vertex.
                let copies = &self.copies[part.copies.clone()];
                for (point, copy) in data.points[part.vertices.clone()].iter_mut().zip(copies) {
                    point.set_vec3(copy.vec3());
                }
            }
        }
    }

    fn average_copies(&self, layout: &Layout<S>, part: &Part, data: &mut StepData<S>) {
        let copies = &self.copies;
        data.constants.each_vertex(part, &mut data.points, |v, point| {
            let range = copies_of(layout, v);
            let share = S::ONE / S::from_f64(range.len() as f64);
            let x = point.vec3();
            let mut sum = Vec3::ZERO;
            for copy in &copies[range] {
                sum += copy.vec3() - x;
            }
            point.set_vec3(x + sum * share);
        });
    }
}
