//! Guards Anderson's accelerated iterates one by one; see [`crate::solver::step::guard`].

use super::iterates::scatter;
use super::memory::Memory;
use super::sweep::read_vec3;
use crate::scalar::Real;
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::guard::{Guard, TOLERATED};

impl<S: Real> Memory<S> {
    /// [`super::stage::XpbdStage::GuardIterate`].
    pub fn guard_iterate(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        guard: &mut Guard<S>,
        multipliers: &mut [S],
    ) {
        guard.evaluator.evaluate_all(&data.constants, step, &data.points);
        for part in 0..step.layout.part_count() {
            if !guard.is_best(step, &data.points, part) {
                self.guard_mixture(step, data, guard, multipliers, part);
            }
        }
    }

    /// Replaces the iterate of a part that is above the best so far.
    fn guard_mixture(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        guard: &mut Guard<S>,
        multipliers: &mut [S],
        part: usize,
    ) {
        let of = &step.layout.parts[part];
        let (positions, plain_multipliers, is_mixed) = self.mixings[part].plain(of);
        if is_mixed {
            for (v, point) in data.points[of.vertices.clone()].iter_mut().enumerate() {
                point.set_vec3(read_vec3(positions, 3 * v));
            }
            scatter(of, plain_multipliers, multipliers);
            guard.evaluator.evaluate(&data.constants, step, &data.points, part);
            if guard.is_best(step, &data.points, part) {
                return;
            }
        }
        guard.parts[part].failures += 1;
        if guard.parts[part].failures < TOLERATED {
            return;
        }
        guard.restart_from_descent(step, data, part);
        guard.evaluator.evaluate(&data.constants, step, &data.points, part);
        guard.is_best(step, &data.points, part);
        guard.parts[part].failures = 0;
        // The older sweeps started elsewhere.
        self.mixings[part].anderson.start();
    }
}
