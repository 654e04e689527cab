//! The step guard: no step ends at a higher incremental potential than the best of its starts.
//!
//! ```text
//! Phi_limit = min(Phi(x_n), Phi(xt), Phi(start)), pins moved in all three,  x_s where it is lowest
//! Phi(x_K) <= Phi_limit: accept
//! else x_s + t (x_K - x_s), t = 0.5, 0.2, 0.08, 0.032: take the first that is not above
//! else three steps of descent from x_s: d_i = -grad_i Phi / (m_i + sum curvature), Armijo
//! ```
//!
//! A bound by `Phi(x_n)` bounds the stored energy (the kinetic energy is left to the energy limit,
//! `energy.rs`); a bound by `Phi(xt)` alone lets nearly everything pass. **The multipliers are kept** after a rejection: recomputing them from positions
//! looks safer and holds stiff tissue fast, because the next sweeps start from what has just failed.
//!
//! With `anderson_guard = "energy"` Anderson's mixtures are guarded one by one: the mixture if `Phi` is not above the best so far,
//! else the plain sweep if its is not, else go on from it once; at the second failure in a row one
//! step of descent from the best. `x_s` is then the best iterate.

use super::cpu::{Ground, Step, Workspace, gather};
use super::potential::{Potential, load_forces};
use super::sweep::read_vec3;
use crate::model::Model;
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};

/// Shares of a rejected step that are tried in turn.
pub(super) const SHARES: [f64; 4] = [0.5, 0.2, 0.08, 0.032];

/// Steps of descent where no share will do.
pub(super) const DESCENTS: usize = 3;

/// Of the decrease that the slope promises, a descent must deliver this share (Armijo).
pub(super) const SUFFICIENT: f64 = 1e-4;

/// A descent that overshoots is shortened by this factor, at most [`SHORTENINGS`] times.
pub(super) const SHORTEN: f64 = 0.4;
pub(super) const SHORTENINGS: usize = 12;

/// How a guarded step ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Incremental potential [J s^2] at the end of the step.
    pub potential: f64,
    /// The lowest incremental potential [J s^2] of the places the step could have started from.
    pub limit: f64,
    /// What round-off can pretend of `potential` [J s^2]; at most this much above `limit` passes.
    pub noise: f64,
    /// Whether the sweeps ended above the limit, so that the step was taken back.
    pub rejected: bool,
    /// The share of its velocities that the energy limit left to the part of the model that it
    /// slowed most; 1 where it did not act.
    pub kept_speed: f64,
}

impl StepReport {
    /// Whether the step holds what the guard promises: it ends no higher than its limit.
    pub fn keeps_limit(&self) -> bool {
        self.potential <= self.limit + self.noise
    }

    /// Of parts together; nothing of no part.
    pub(super) fn of_all(parts: &[StepReport]) -> Option<StepReport> {
        let height = |report: &StepReport| {
            let above = report.potential - (report.limit + report.noise);
            // Infinite at an infinite limit is at the limit; what is no number stands above everything.
            let unknown = if report.keeps_limit() { 0.0 } else { f64::INFINITY };
            if above.is_nan() { unknown } else { above }
        };
        parts.iter().copied().reduce(|worst, next| {
            let report = if height(&next) > height(&worst) { next } else { worst };
            StepReport {
                rejected: worst.rejected || next.rejected,
                kept_speed: worst.kept_speed.min(next.kept_speed),
                ..report
            }
        })
    }
}

/// Of plain sweeps in a row that raise the potential this many lead to a step of descent.
pub(super) const TOLERATED: u32 = 2;

/// What a guarded step remembers.
#[derive(Clone, Debug)]
pub(super) struct Guard<S> {
    /// `x_s` [m]: the best start, or a better iterate; empty where steps are not guarded.
    start: Vec<Point<S>>,
    /// Positions under test [m].
    trial: Vec<Point<S>>,
    limit: f64,
    /// `Phi` [J s^2] at `x_s`.
    best: f64,
    /// Plain sweeps in a row that have ended above it.
    failures: u32,
    /// Steps taken back so far.
    pub rejected: u64,
    /// How the last step ended.
    pub report: Option<StepReport>,
}

impl<S: Real> Guard<S> {
    pub fn new(vertices: usize) -> Self {
        let positions = vec![Point::default(); vertices];
        Self {
            start: positions.clone(),
            trial: positions,
            limit: 0.0,
            best: 0.0,
            failures: 0,
            rejected: 0,
            report: None,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.start[..]) + size_of_val(&self.trial[..])
    }
}

impl<S: Real> Workspace<S> {
    fn potential_at(&mut self, step: &Step<'_, S>, x: &[Point<S>]) -> Potential {
        self.evaluator.evaluate(&self.ground, step, x)
    }

    /// As [`Self::potential_at`] the positions.
    fn potential_here(&mut self, step: &Step<'_, S>) -> Potential {
        self.evaluator.evaluate(&self.ground, step, &self.points)
    }

    /// [`super::plan::Stage::ChooseStart`].
    pub(super) fn choose_start(&mut self, step: &Step<'_, S>) {
        self.guard.start.copy_from_slice(&self.points);
        self.guard.limit = self.potential_here(step).value;
        for from_rest in [true, false] {
            let mut trial = std::mem::take(&mut self.guard.trial);
            let Ground { previous, predicted, .. } = &self.ground;
            trial.copy_from_slice(if from_rest { previous } else { predicted });
            for pin in &step.inputs.pins {
                trial[step.model.numbering.of(pin.vertex)].set_vec3(pin.target);
            }
            let value = self.potential_at(step, &trial).value;
            if from_rest {
                self.begin_energy(step);
            }
            // Written so that a limit that is no number gives way.
            if value < self.guard.limit || !self.guard.limit.is_finite() {
                self.guard.limit = value;
                self.guard.start.copy_from_slice(&trial);
            }
            self.guard.trial = trial;
        }
        self.guard.best = self.guard.limit;
        self.guard.failures = 0;
    }

    /// [`super::plan::Stage::GuardIterate`].
    pub(super) fn guard_iterate(&mut self, step: &Step<'_, S>, multipliers: &mut [S]) {
        if self.is_best(step) {
            return;
        }
        let (plain, is_mixed) = self.anderson.newest();
        if is_mixed {
            let (plain_positions, plain_multipliers) = plain.split_at(3 * self.points.len());
            for (v, point) in self.points.iter_mut().enumerate() {
                point.set_vec3(read_vec3(plain_positions, 3 * v));
            }
            multipliers.copy_from_slice(plain_multipliers);
            if self.is_best(step) {
                return;
            }
        }
        self.guard.failures += 1;
        if self.guard.failures < TOLERATED {
            return;
        }
        let mut trial = std::mem::take(&mut self.guard.trial);
        trial.copy_from_slice(&self.guard.start);
        self.descend(step, &mut trial);
        self.take(&trial);
        self.guard.trial = trial;
        self.is_best(step);
        self.guard.failures = 0;
        // The older sweeps started elsewhere.
        self.anderson.start();
    }

    /// Takes positions over; weights stay.
    fn take(&mut self, x: &[Point<S>]) {
        for (point, x) in self.points.iter_mut().zip(x) {
            point.set_vec3(x.vec3());
        }
    }

    /// Whether the iterate is at least as good as the best so far; becomes it where it is better.
    fn is_best(&mut self, step: &Step<'_, S>) -> bool {
        let Potential { value, noise } = self.potential_here(step);
        if value < self.guard.best {
            self.guard.best = value;
            self.guard.start.copy_from_slice(&self.points);
        }
        let good = value <= self.guard.best + noise;
        if good {
            self.guard.failures = 0;
        }
        good
    }

    /// [`super::plan::Stage::GuardStep`].
    pub(super) fn guard_step(&mut self, step: &Step<'_, S>) {
        let swept = self.potential_here(step);
        let swept = self.report(swept);
        if swept.keeps_limit() {
            self.guard.report = Some(swept);
            return;
        }
        self.guard.rejected += 1;
        let mut trial = std::mem::take(&mut self.guard.trial);
        let shortened = SHARES.into_iter().find_map(|share| {
            let share = S::from_f64(share);
            for v in 0..trial.len() {
                let start = self.guard.start[v].vec3();
                trial[v].set_vec3(start + (self.points[v].vec3() - start) * share);
            }
            let potential = self.potential_at(step, &trial);
            Some(self.report(potential)).filter(StepReport::keeps_limit)
        });
        let report = shortened.unwrap_or_else(|| {
            trial.copy_from_slice(&self.guard.start);
            for _ in 0..DESCENTS {
                self.descend(step, &mut trial);
            }
            let potential = self.potential_at(step, &trial);
            self.report(potential)
        });
        self.guard.report = Some(StepReport { rejected: true, ..report });
        self.take(&trial);
        self.guard.trial = trial;
    }

    fn report(&self, Potential { value, noise }: Potential) -> StepReport {
        StepReport {
            potential: value,
            limit: self.guard.limit,
            noise,
            rejected: false,
            kept_speed: 1.0,
        }
    }

    /// One step of descent from `x`. The positions, which are not needed any more, hold the places
    /// tried.
    fn descend(&mut self, step: &Step<'_, S>, x: &mut [Point<S>]) {
        load_forces::<S, true>(&self.ground, step, x, &mut self.loads);
        let before = self.potential_at(step, x).value;
        let mut length = 1.0;
        for _ in 0..SHORTENINGS {
            let mut slope = 0.0;
            for v in 0..x.len() {
                let (gradient, direction) = self.descent(step.model, x, v);
                slope += gradient.dot(direction).to_f64();
                self.points[v].set_vec3(x[v].vec3() + direction * S::from_f64(length));
            }
            let after = self.potential_here(step).value;
            if after <= before + SUFFICIENT * length * slope {
                x.copy_from_slice(&self.points);
                return;
            }
            length *= SHORTEN;
        }
    }

    /// Gradient of `Phi` by one vertex and the direction of descent; zero for a pinned one.
    fn descent(&self, model: &Model<S>, x: &[Point<S>], v: usize) -> (Vec3<S>, Vec3<S>) {
        if self.ground.inverse_masses[v] == S::ZERO {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        let load = gather(model, &self.loads, v);
        let mass = self.ground.inertias[v];
        let gradient = (x[v].vec3() - self.ground.predicted[v].vec3()) * mass - load.vec3();
        (gradient, gradient * (-S::ONE / (mass + load.w)))
    }
}
