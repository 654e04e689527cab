//! The step guard: no step ends at a higher incremental potential than the best of its starts.
//!
//! ```text
//! Phi_limit = min(Phi(x_n), Phi(xt), Phi(start)), pins moved in all three,  x_s where it is lowest
//! Phi(x_K) <= Phi_limit: accept
//! else x_s + t (x_K - x_s), t = 0.5, 0.2, 0.08, 0.032: take the first that is not above
//! else three steps of descent from x_s: d_i = -grad_i Phi / (m_i + sum curvature), Armijo
//! ```
//!
//! Every connected part of the model is judged, and rejected, by itself: parts that pass are not evaluated again.
//!
//! A bound by `Phi(x_n)` bounds the stored energy (the kinetic energy is left to the energy limit,
//! `energy.rs`); a bound by `Phi(xt)` alone lets nearly everything pass. **The multipliers are kept** after a
//! rejection: recomputing them from positions looks safer and holds stiff tissue fast, because the next sweeps
//! start from what has just failed.
//!
//! Stages of the plan judge, try and take; what they decide is in a record of each part (control.rs). The descents are in
//! descent.rs.
//!
//! With `anderson_guard = "energy"` Anderson's accelerated iterates are guarded one by one. An iterate is taken if its
//! `Phi` is not above the best so far, else the plain sweep if its `Phi` is not; else the iteration goes on from the
//! plain sweep once, and at the second failure in a row makes one step of descent from the best. `x_s` is then the
//! best iterate.

use std::ops::Range;

use super::control::PartGuard;
use super::data::{Step, StepConstants, StepData};
use super::energy::{Energies, Ledger};
use super::momentum::keep_momentum;
use super::potential::{Evaluator, Potential};
use super::stage::GuardStage;
use crate::layout::Layout;
use crate::scalar::Real;
use crate::scalar::lanes::Point;
use crate::solver::report::StepReport;

/// Shares of a rejected step that are tried in turn.
pub const SHARES: [f64; 4] = [0.5, 0.2, 0.08, 0.032];

/// Steps of descent where no share will do.
pub const DESCENTS: u32 = 3;

/// Of plain sweeps in a row that raise the potential this many lead to a step of descent.
pub const TOLERATED: u32 = 2;

/// Memory of guarded steps.
#[derive(Clone, Debug)]
pub struct Guard<S> {
    pub evaluator: Evaluator,
    /// Where the iteration starts [m]; `x_s` of a part once it was chosen: the best start, or a better iterate.
    pub start: Vec<Point<S>>,
    /// Positions under test [m]. In a descent those that it has reached; the places it tries are in the data of the step.
    pub trial: Vec<Point<S>>,
    pub parts: Vec<PartGuard<f64>>,
    /// `Phi` [J s^2] of each part at the starts, in the order of [`STARTS`].
    at_starts: Vec<[f64; 3]>,
    energies: Energies,
    /// Steps so far that were rejected for at least one part.
    pub rejected: u64,
    /// How the last step ended for each part.
    reports: Vec<StepReport>,
    /// Whether there has been one.
    is_over: bool,
}

/// Where a step could start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PossibleStart {
    /// Where the iteration starts.
    OfIteration,
    /// `x_n`, pins moved.
    Previous,
    /// `xt`, pins moved.
    Predicted,
}

/// The places a step could start from. The first counts unless another is strictly lower: at rest `x_n` is the same
/// place, and nothing is to be exchanged.
const STARTS: [PossibleStart; 3] =
    [PossibleStart::OfIteration, PossibleStart::Previous, PossibleStart::Predicted];

impl<S: Real> Guard<S> {
    /// For the steps of a model.
    pub fn new(layout: &Layout<S>) -> Self {
        let positions = vec![Point::default(); layout.vertex_count()];
        let parts = vec![PartGuard::default(); layout.part_count()];
        Self {
            evaluator: Evaluator::new(layout),
            start: positions.clone(),
            trial: positions,
            at_starts: vec![[0.0; 3]; parts.len()],
            energies: Energies::new(parts.len()),
            rejected: 0,
            reports: parts.iter().map(PartGuard::report).collect(),
            is_over: false,
            parts,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.start[..])
            + size_of_val(&self.trial[..])
            + size_of_val(&self.parts[..])
            + size_of_val(&self.at_starts[..])
            + size_of_val(&self.reports[..])
            + self.energies.bytes()
            + self.evaluator.bytes()
    }

    /// What tools have put into tissue.
    pub fn ledger(&self) -> Ledger {
        self.energies.ledger()
    }

    /// How the last step ended for each part; nothing before the first.
    pub fn part_reports(&self) -> &[StepReport] {
        if self.is_over { &self.reports } else { &[] }
    }

    /// Carries a stage out.
    pub fn run(&mut self, stage: GuardStage, step: &Step<'_, S>, data: &mut StepData<S>) {
        match stage {
            GuardStage::ChooseStart => self.choose_start(step, data),
            GuardStage::EvaluateStep { with_starts } => {
                let StepData { constants, points, .. } = data;
                for part in 0..step.layout.part_count() {
                    keep_momentum(step, constants, points, part);
                }
                self.evaluate_step(with_starts, step, data);
            }
            GuardStage::JudgeStep { chooses } => self.judge_step(chooses, step, data),
            GuardStage::TryLengths { after_shares } => self.try_lengths(after_shares, step, data),
            GuardStage::TakeLength => self.take_length(step, data),
            GuardStage::MoveRejected => self.move_rejected(step, data),
        }
    }

    /// Whether no part descends.
    pub fn nothing_descends(&self) -> bool {
        self.parts.iter().all(|part| part.descends == 0)
    }

    /// Of [`super::stage::StepStage::Predict`].
    pub fn keep_start(&mut self, points: &[Point<S>]) {
        self.start.copy_from_slice(points);
    }

    /// [`GuardStage::ChooseStart`].
    fn choose_start(&mut self, step: &Step<'_, S>, data: &StepData<S>) {
        self.evaluate_starts(step, data);
        for part in 0..step.layout.part_count() {
            let chosen = self.choose(part);
            self.move_start(step, &data.constants, part, chosen);
            let guard = &mut self.parts[part];
            guard.best_value = guard.limit;
            guard.failures = 0;
        }
    }

    /// [`GuardStage::EvaluateStep`].
    fn evaluate_step(&mut self, with_starts: bool, step: &Step<'_, S>, data: &StepData<S>) {
        if with_starts {
            self.evaluate_starts(step, data);
        }
        // All parts in one pass, which threads share; from here on only rejected parts are evaluated, one by one.
        // `limit_energy` takes each part's stored energy from its last evaluation, so that has to be the one of
        // the place where the part ends.
        self.evaluator.evaluate_all(&data.constants, step, &data.points);
    }

    /// [`GuardStage::JudgeStep`].
    fn judge_step(&mut self, chooses: bool, step: &Step<'_, S>, data: &mut StepData<S>) {
        let mut is_rejected = false;
        for part in 0..step.layout.part_count() {
            let chosen = chooses.then(|| self.choose(part));
            let guard = &mut self.parts[part];
            let passes = self.evaluator.potentials[part].keeps(guard.limit);
            (guard.was_rejected, guard.descends) = (u32::from(!passes), 0);
            if passes {
                continue;
            }
            is_rejected = true;
            if let Some(chosen) = chosen {
                self.move_start(step, &data.constants, part, chosen);
            }
        }
        for part in 0..step.layout.part_count() {
            if self.parts[part].was_rejected != 0 && data.constants.groups.leads(part) {
                self.try_shares(step, data, part);
            }
        }
        self.rejected += u64::from(is_rejected);
    }

    /// [`GuardStage::MoveRejected`].
    fn move_rejected(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        for (number, part) in step.layout.parts.iter().enumerate() {
            let guard = &self.parts[number];
            if guard.was_rejected == 0 {
                continue;
            }
            // The parts of a group descend together.
            if guard.descends == 0 {
                // The share that passes was evaluated last.
                for v in part.vertices.clone() {
                    data.points[v].set_vec3(self.trial[v].vec3());
                }
            } else if data.constants.groups.leads(number) {
                // The last length that a descent tried may be one that it gave up.
                self.evaluator.evaluate(&data.constants, step, &data.points, number);
            }
        }
        for part in 0..step.layout.part_count() {
            if self.parts[part].was_rejected != 0 {
                keep_momentum(step, &data.constants, &mut data.points, part);
            }
        }
    }

    /// [`super::stage::StepStage::LimitEnergy`]. The last evaluation of each part's potential was that of its
    /// end.
    pub fn limit_energy(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let Self { energies, evaluator, parts, reports, .. } = self;
        for (part, &Potential { value, noise }) in parts.iter_mut().zip(&evaluator.potentials) {
            (part.potential, part.noise, part.kept_speed) = (value, noise, 1.0);
        }
        energies.end(step, data, &evaluator.stored);
        energies.limit(
            step,
            data,
            |_, _| true,
            |part, share| {
                parts[part].kept_speed = share;
            },
        );
        for (report, part) in reports.iter_mut().zip(parts) {
            *report = part.report();
        }
        self.is_over = true;
    }

    /// `Phi` of every part at all starts, and the mechanical energy at the start of the step.
    fn evaluate_starts(&mut self, step: &Step<'_, S>, data: &StepData<S>) {
        let all = 0..step.layout.vertex_count();
        for (k, which) in STARTS.into_iter().enumerate() {
            self.place_start(which, step, &data.constants, all.clone());
            self.evaluator.evaluate_all(&data.constants, step, &self.trial);
            for (values, potential) in self.at_starts.iter_mut().zip(&self.evaluator.potentials) {
                values[k] = potential.value;
            }
            // Here, because the next evaluation overwrites `stored`: the energy limit counts from the start of the
            // step with its pins moved.
            if which == PossibleStart::Previous {
                self.energies.begin(step, data, &self.evaluator.stored);
            }
        }
    }

    /// Chooses the best start of a part: its potential is the limit.
    fn choose(&mut self, part: usize) -> PossibleStart {
        let values = self.at_starts[part];
        let (mut limit, mut chosen) = (values[0], STARTS[0]);
        for (value, which) in values.into_iter().zip(STARTS).skip(1) {
            // Written so that a limit that is NaN or infinite gives way.
            if value < limit || !limit.is_finite() {
                (limit, chosen) = (value, which);
            }
        }
        self.parts[part].limit = limit;
        chosen
    }

    /// Moves `x_s` of a part to the start that was chosen.
    fn move_start(
        &mut self,
        step: &Step<'_, S>,
        constants: &StepConstants<S>,
        part: usize,
        chosen: PossibleStart,
    ) {
        if chosen != PossibleStart::OfIteration {
            let vertices = step.layout.parts[part].vertices.clone();
            self.place_start(chosen, step, constants, vertices.clone());
            self.start[vertices.clone()].copy_from_slice(&self.trial[vertices]);
        }
    }

    /// Puts some vertices under test where the step could start.
    fn place_start(
        &mut self,
        which: PossibleStart,
        step: &Step<'_, S>,
        constants: &StepConstants<S>,
        vertices: Range<usize>,
    ) {
        let from = match which {
            PossibleStart::OfIteration => &self.start,
            PossibleStart::Previous => &constants.previous,
            PossibleStart::Predicted => &constants.predicted,
        };
        self.trial[vertices.clone()].copy_from_slice(&from[vertices.clone()]);
        // Pins are at their new places whatever the step does. Judged with the old ones, the start of the step could
        // store less than every place the step may end at, and pulled tissue would never keep the limit.
        for pin in &step.inputs.pins {
            let v = step.layout.numbering.of(pin.vertex);
            if vertices.contains(&v) {
                self.trial[v].set_vec3(pin.target);
            }
        }
    }

    /// Shortens the step of a part's group to the first share that passes, or begins its descent at `x_s`.
    fn try_shares(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, part: usize) {
        let Self { evaluator, start, trial, parts, .. } = self;
        let groups = &data.constants.groups;
        // `data.points` stays at `x_K` until a share is accepted: every share is one of the whole step, not of the
        // share before it. Not the lowest but the first, which is the longest that keeps the limit: a shorter one throws
        // away more of what the sweeps have found.
        let share = SHARES.into_iter().find(|&share| {
            let share = S::from_f64(share);
            for v in groups.of(part).flat_map(|part| step.layout.parts[part].vertices.clone()) {
                let start = start[v].vec3();
                trial[v].set_vec3(start + (data.points[v].vec3() - start) * share);
            }
            // Other groups' places are old, which an evaluation of this one does not read.
            evaluator.evaluate(&data.constants, step, trial, part).keeps(parts[part].limit)
        });
        for part in groups.of(part) {
            parts[part].share = share.unwrap_or(0.0);
        }
        if share.is_none() {
            // No share is low enough, so the sweeps' direction itself is wrong. Descents need nothing of it: they
            // begin at `x_s`, where `Phi` is the limit, and none ends higher than it began.
            self.start_descent(step, data, part);
        }
    }
}
