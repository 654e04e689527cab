//! Guards Anderson's accelerated iterates one by one; see [`crate::solver::step::guard`].

use super::iterates::scatter;
use super::memory::Memory;
use super::stage::IterateStage;
use super::sweep::read_vec3;
use crate::scalar::Real;
use crate::scalar::lanes::Point;
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::guard::{Guard, TOLERATED};

impl<S: Real> Memory<S> {
    /// [`super::stage::XpbdStage::GuardIterate`].
    pub fn guard_iterate(
        &mut self,
        stage: IterateStage,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        guard: &mut Guard<S>,
        multipliers: &mut [S],
    ) {
        match stage {
            IterateStage::Evaluate => {
                guard.evaluator.evaluate_all(&data.constants, step, &data.points);
            }
            IterateStage::Judge => self.judge(step, data, guard, multipliers),
            IterateStage::EvaluatePlain => {
                for part in (0..guard.parts.len()).filter(|&part| guard.parts[part].is_good == 0) {
                    guard.evaluator.evaluate(&data.constants, step, &data.points, part);
                }
            }
            IterateStage::JudgePlain => judge_plain(step, data, guard),
            IterateStage::TakeDescent => self.take_descent(step, data, guard),
        }
    }

    /// [`IterateStage::Judge`].
    fn judge(
        &self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        guard: &mut Guard<S>,
        multipliers: &mut [S],
    ) {
        for (number, part) in step.layout.parts.iter().enumerate() {
            let best = guard.parts[number].best_value;
            let (best, is_good) = compare(guard, step, &data.points, number, best);
            let decided = &mut guard.parts[number];
            decided.mixture_best = best;
            decided.mixture_failures = if is_good { 0 } else { decided.failures };
            decided.is_good = is_good.into();
            if is_good {
                continue;
            }
            let (positions, plain_multipliers, is_mixed) = self.mixings[number].plain(part);
            if !is_mixed {
                continue;
            }
            for (v, point) in data.points[part.vertices.clone()].iter_mut().enumerate() {
                point.set_vec3(read_vec3(positions, 3 * v));
            }
            scatter(part, plain_multipliers, multipliers);
        }
    }

    /// [`IterateStage::TakeDescent`].
    fn take_descent(&mut self, step: &Step<'_, S>, data: &StepData<S>, guard: &mut Guard<S>) {
        for part in 0..guard.parts.len() {
            if guard.parts[part].descends == 0 {
                continue;
            }
            // The last length that it tried may be one that it gave up.
            guard.evaluator.evaluate(&data.constants, step, &data.points, part);
            let best = guard.parts[part].best_value;
            let (best, _) = compare(guard, step, &data.points, part, best);
            let decided = &mut guard.parts[part];
            (decided.best_value, decided.failures) = (best, 0);
            // The older sweeps started elsewhere.
            self.mixings[part].anderson.start();
        }
    }
}

/// [`IterateStage::JudgePlain`].
fn judge_plain<S: Real>(step: &Step<'_, S>, data: &mut StepData<S>, guard: &mut Guard<S>) {
    for part in 0..guard.parts.len() {
        let (mut best, mut failures) = (guard.parts[part].mixture_best, 0);
        if guard.parts[part].is_good == 0 {
            let passes;
            (best, passes) = compare(guard, step, &data.points, part, best);
            failures = if passes { 0 } else { guard.parts[part].mixture_failures + 1 };
        }
        let decided = &mut guard.parts[part];
        (decided.best_value, decided.failures) = (best, failures);
        decided.descends = (failures >= TOLERATED).into();
        if failures >= TOLERATED {
            guard.start_descent(step, data, part);
        }
    }
}

/// The lowest `Phi` of a part now, `best` so far, and whether its iterate, whose potential was evaluated last, is at least
/// as good; the iterate becomes `x_s` where it is better.
fn compare<S: Real>(
    guard: &mut Guard<S>,
    step: &Step<'_, S>,
    points: &[Point<S>],
    part: usize,
    best: f64,
) -> (f64, bool) {
    let potential = guard.evaluator.potentials[part];
    // Any decrease moves `x_s`; `noise` only decides whether the iterate passes. If every iterate that passes
    // became `x_s`, its `Phi` could creep up by `noise` at every sweep.
    let is_better = potential.value < best;
    if is_better {
        let vertices = step.layout.parts[part].vertices.clone();
        guard.start[vertices.clone()].copy_from_slice(&points[vertices]);
    }
    let best = if is_better { potential.value } else { best };
    (best, potential.keeps(best))
}
