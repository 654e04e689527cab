//! The step guard: no step ends at a higher incremental potential than the best of its starts.
//!
//! ```text
//! Phi_limit = min(Phi(x_n), Phi(xt), Phi(start)), pins moved in all three,  x_s where it is lowest
//! Phi(x_K) <= Phi_limit: accept
//! else x_s + t (x_K - x_s), t = 0.5, 0.2, 0.08, 0.032: take the first that is not above
//! else three steps of descent from x_s: d_i = -grad_i Phi / (m_i + sum curvature), Armijo
//! ```
//!
//! Every connected part of the model is judged, and taken back, by itself: no other is even looked at again.
//!
//! A bound by `Phi(x_n)` bounds the stored energy (the kinetic energy is left to the energy limit,
//! `energy.rs`); a bound by `Phi(xt)` alone lets nearly everything pass. **The multipliers are kept** after a rejection: recomputing them from positions
//! looks safer and holds stiff tissue fast, because the next sweeps start from what has just failed.
//!
//! With `anderson_guard = "energy"` Anderson's mixtures are guarded one by one: the mixture if `Phi` is not above the best so far,
//! else the plain sweep if its is not, else go on from it once; at the second failure in a row one
//! step of descent from the best. `x_s` is then the best iterate.

use super::cpu::{Ground, Step, Workspace};
use super::iterates::scatter;
use super::potential::{Potential, load_forces};
use super::rebase::gather;
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

/// How a guarded step ended, for one connected part of the model or for all of them.
///
/// Of all parts together, potential, limit and noise are those of the part that ended highest above its limit,
/// or least below it; so that [`StepReport::keeps_limit`] speaks for every part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Incremental potential [J s^2] at the end of the step.
    pub potential: f64,
    /// The lowest incremental potential [J s^2] of the places the step could have started from.
    pub limit: f64,
    /// What round-off can pretend of `potential` [J s^2]; at most this much above `limit` passes.
    pub noise: f64,
    /// Whether the sweeps ended above the limit, so that the step was taken back: the part's, or any part's.
    pub rejected: bool,
    /// The share of its velocities that the energy limit left to the part, or to the part that it slowed
    /// most; 1 where it did not act.
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
    parts: Vec<PartGuard>,
    /// Steps so far that were taken back for at least one part.
    pub rejected: u64,
    /// How the last step ended for each part.
    reports: Vec<StepReport>,
    /// Whether there has been one.
    is_over: bool,
}

/// Of one part of the model.
#[derive(Clone, Copy, Debug, Default)]
struct PartGuard {
    /// [J s^2].
    limit: f64,
    /// `Phi` [J s^2] at `x_s`.
    best: f64,
    /// Plain sweeps in a row that have ended above it.
    failures: u32,
}

impl<S: Real> Guard<S> {
    /// For a model, or for none.
    pub fn new(model: Option<&Model<S>>) -> Self {
        let positions = vec![Point::default(); model.map_or(0, Model::vertex_count)];
        let parts = model.map_or(0, Model::part_count);
        let report =
            StepReport { potential: 0.0, limit: 0.0, noise: 0.0, rejected: false, kept_speed: 1.0 };
        Self {
            start: positions.clone(),
            trial: positions,
            parts: vec![PartGuard::default(); parts],
            rejected: 0,
            reports: vec![report; parts],
            is_over: false,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.start[..])
            + size_of_val(&self.trial[..])
            + size_of_val(&self.parts[..])
            + size_of_val(&self.reports[..])
    }

    /// How the last step ended for each part; nothing before the first.
    pub fn part_reports(&self) -> &[StepReport] {
        if self.is_over { &self.reports } else { &[] }
    }

    /// How the last step ended.
    pub fn report(&self) -> Option<StepReport> {
        StepReport::of_all(self.part_reports())
    }

    /// Enters the share of its velocities that the energy limit has left to a part.
    pub fn set_kept_speed(&mut self, part: usize, share: f64) {
        self.reports[part].kept_speed = share;
    }
}

impl<S: Real> Workspace<S> {
    /// `Phi` of one part at the positions.
    fn potential_here(&mut self, step: &Step<'_, S>, part: usize) -> Potential {
        self.evaluator.evaluate(&self.ground, step, &self.points, part)
    }

    /// [`super::plan::Stage::ChooseStart`].
    pub(super) fn choose_start(&mut self, step: &Step<'_, S>) {
        self.guard.start.copy_from_slice(&self.points);
        self.evaluator.evaluate_all(&self.ground, step, &self.points);
        for (part, potential) in self.guard.parts.iter_mut().zip(&self.evaluator.potentials) {
            part.limit = potential.value;
        }
        for from_rest in [true, false] {
            let Ground { previous, predicted, .. } = &self.ground;
            let trial = &mut self.guard.trial;
            trial.copy_from_slice(if from_rest { previous } else { predicted });
            for pin in &step.inputs.pins {
                trial[step.model.numbering.of(pin.vertex)].set_vec3(pin.target);
            }
            self.evaluator.evaluate_all(&self.ground, step, trial);
            if from_rest {
                self.begin_energy(step);
            }
            let Guard { start, trial, parts, .. } = &mut self.guard;
            for (number, of) in step.model.parts.iter().enumerate() {
                let (part, value) = (&mut parts[number], self.evaluator.potentials[number].value);
                // Written so that a limit that is no number gives way.
                if value < part.limit || !part.limit.is_finite() {
                    part.limit = value;
                    let vertices = of.vertices.clone();
                    start[vertices.clone()].copy_from_slice(&trial[vertices]);
                }
            }
        }
        for part in &mut self.guard.parts {
            part.best = part.limit;
            part.failures = 0;
        }
    }

    /// [`super::plan::Stage::GuardIterate`].
    pub(super) fn guard_iterate(&mut self, step: &Step<'_, S>, multipliers: &mut [S]) {
        self.evaluator.evaluate_all(&self.ground, step, &self.points);
        for part in 0..step.model.part_count() {
            if !self.is_best(step, part) {
                self.guard_mixture(step, multipliers, part);
            }
        }
    }

    /// What becomes of a part whose iterate is above the best so far.
    fn guard_mixture(&mut self, step: &Step<'_, S>, multipliers: &mut [S], part: usize) {
        let of = &step.model.parts[part];
        let (positions, plain_multipliers, is_mixed) = self.mixings[part].plain(of);
        if is_mixed {
            for (v, point) in self.points[of.vertices.clone()].iter_mut().enumerate() {
                point.set_vec3(read_vec3(positions, 3 * v));
            }
            scatter(of, plain_multipliers, multipliers);
            self.potential_here(step, part);
            if self.is_best(step, part) {
                return;
            }
        }
        self.guard.parts[part].failures += 1;
        if self.guard.parts[part].failures < TOLERATED {
            return;
        }
        let mut trial = std::mem::take(&mut self.guard.trial);
        let vertices = of.vertices.clone();
        trial[vertices.clone()].copy_from_slice(&self.guard.start[vertices]);
        self.descend(step, &mut trial, part);
        self.take(step, &trial, part);
        self.guard.trial = trial;
        self.potential_here(step, part);
        self.is_best(step, part);
        self.guard.parts[part].failures = 0;
        // The older sweeps started elsewhere.
        self.mixings[part].anderson.start();
    }

    /// Takes positions of a part over; weights stay.
    fn take(&mut self, step: &Step<'_, S>, x: &[Point<S>], part: usize) {
        for v in step.model.parts[part].vertices.clone() {
            self.points[v].set_vec3(x[v].vec3());
        }
    }

    /// Whether a part's iterate, whose potential was evaluated last, is at least as good as the best so far;
    /// becomes it where it is better.
    fn is_best(&mut self, step: &Step<'_, S>, part: usize) -> bool {
        let Potential { value, noise } = self.evaluator.potentials[part];
        let Guard { start, parts, .. } = &mut self.guard;
        let guard = &mut parts[part];
        if value < guard.best {
            guard.best = value;
            let vertices = step.model.parts[part].vertices.clone();
            start[vertices.clone()].copy_from_slice(&self.points[vertices]);
        }
        let good = value <= guard.best + noise;
        if good {
            guard.failures = 0;
        }
        good
    }

    /// [`super::plan::Stage::GuardStep`].
    pub(super) fn guard_step(&mut self, step: &Step<'_, S>) {
        self.evaluator.evaluate_all(&self.ground, step, &self.points);
        let mut rejected = false;
        for part in 0..step.model.part_count() {
            let swept = self.report(part);
            self.guard.reports[part] = if swept.keeps_limit() {
                swept
            } else {
                rejected = true;
                StepReport { rejected: true, ..self.take_back(step, part) }
            };
        }
        self.guard.rejected += u64::from(rejected);
        self.guard.is_over = true;
    }

    /// Shortens the step of a part, or descends.
    fn take_back(&mut self, step: &Step<'_, S>, part: usize) -> StepReport {
        let vertices = step.model.parts[part].vertices.clone();
        let mut trial = std::mem::take(&mut self.guard.trial);
        let shortened = SHARES.into_iter().find_map(|share| {
            let share = S::from_f64(share);
            for v in vertices.clone() {
                let start = self.guard.start[v].vec3();
                trial[v].set_vec3(start + (self.points[v].vec3() - start) * share);
            }
            self.evaluator.evaluate(&self.ground, step, &trial, part);
            Some(self.report(part)).filter(StepReport::keeps_limit)
        });
        let report = shortened.unwrap_or_else(|| {
            trial[vertices.clone()].copy_from_slice(&self.guard.start[vertices.clone()]);
            for _ in 0..DESCENTS {
                self.descend(step, &mut trial, part);
            }
            self.evaluator.evaluate(&self.ground, step, &trial, part);
            self.report(part)
        });
        self.take(step, &trial, part);
        self.guard.trial = trial;
        report
    }

    /// Of a part, whose potential was evaluated last.
    fn report(&self, part: usize) -> StepReport {
        let Potential { value, noise } = self.evaluator.potentials[part];
        StepReport {
            potential: value,
            limit: self.guard.parts[part].limit,
            noise,
            rejected: false,
            kept_speed: 1.0,
        }
    }

    /// One step of descent of a part from `x`. Its positions, which are not needed any more, hold the places
    /// tried.
    fn descend(&mut self, step: &Step<'_, S>, x: &mut [Point<S>], part: usize) {
        let of = &step.model.parts[part];
        load_forces::<S, true>(&self.ground, step, of, x, &mut self.loads);
        let before = self.evaluator.evaluate(&self.ground, step, x, part).value;
        let mut length = 1.0;
        for _ in 0..SHORTENINGS {
            let mut slope = 0.0;
            for v in of.vertices.clone() {
                let (gradient, direction) = self.descent(step.model, x, v);
                slope += gradient.dot(direction).to_f64();
                self.points[v].set_vec3(x[v].vec3() + direction * S::from_f64(length));
            }
            let after = self.potential_here(step, part).value;
            if after <= before + SUFFICIENT * length * slope {
                x[of.vertices.clone()].copy_from_slice(&self.points[of.vertices.clone()]);
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

#[cfg(test)]
mod tests {
    use super::super::Inputs;
    use super::super::probe::{begun, quiet};
    use super::*;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::TetMesh;
    use crate::model::ModelBuilder;
    use crate::settings::SolverSettings;

    /// A tetrahedron that has swollen. Its corners go back together, which the bounds, one vertex at a time,
    /// know nothing of: in long steps, where inertia is small, a whole step of descent overshoots.
    fn swollen(settings: &SolverSettings) -> (Model<f64>, Vec<Vec3<f64>>) {
        let corners = [[1.0; 3], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
        let rest = corners.map(|x| Vec3::from_f64(x) * 0.01).to_vec();
        let mesh = TetMesh::new(rest, vec![[0, 1, 2, 3]], vec![0]).expect("a tetrahedron").0;
        let law = MaterialModel::StableNeoHookean;
        let tissue = Material::new(law, 1e4, 0.45, 1000.0).expect("legal");
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &tissue).expect("a body");
        let places = mesh.vertices().iter().map(|x| *x * 1.02).collect();
        (builder.build(settings).expect("a model"), places)
    }

    /// Before a descent: places, the places of a whole step of it, `Phi` at both, and the slope.
    struct Descent {
        before: Vec<Point<f64>>,
        whole: Vec<Point<f64>>,
        values: [f64; 2],
        slope: f64,
    }

    fn descent(work: &mut Workspace<f64>, step: &Step<'_, f64>) -> Descent {
        let before = work.points.clone();
        load_forces::<_, true>(&work.ground, step, &step.model.parts[0], &before, &mut work.loads);
        let (mut whole, mut slope) = (before.clone(), 0.0);
        for v in 0..before.len() {
            let (gradient, direction) = work.descent(step.model, &before, v);
            slope += gradient.dot(direction);
            whole[v].set_vec3(before[v].vec3() + direction);
        }
        let values =
            [&before, &whole].map(|x| work.evaluator.evaluate(&work.ground, step, x, 0).value);
        Descent { before, whole, values, slope }
    }

    /// Armijo's condition decides where `Phi` changes by less than 1e-4 of what the slope promises.
    #[test]
    fn a_descent_delivers_its_share_of_what_the_slope_promises() {
        let (settings, inputs) = (SolverSettings::default(), Inputs::default());
        let (model, places) = swollen(&settings);
        // What a whole step changes, of what its slope promises: -1/2 in short steps.
        let change = |dt: f64| {
            let step = quiet(&model, &inputs, &settings, dt);
            let Descent { values, slope, .. } = descent(&mut begun(&step, &places), &step);
            (values[1] - values[0]) / slope.abs()
        };
        for (wanted, is_enough) in [(-2e-4, true), (-0.5e-4, false), (0.5e-4, false)] {
            let (mut short, mut long) = (1e-5, 1.0);
            assert!(change(short) < wanted && wanted < change(long));
            for _ in 0..60 {
                let middle = 0.5 * (short + long);
                if change(middle) < wanted { short = middle } else { long = middle }
            }
            assert!((change(short) - wanted).abs() < 1e-6);
            let step = quiet(&model, &inputs, &settings, short);
            let mut work = begun(&step, &places);
            let Descent { before, whole, values, slope } = descent(&mut work, &step);
            let mut x = before.clone();
            work.descend(&step, &mut x, 0);
            let is_whole = x.iter().zip(&whole).all(|(a, b)| a.vec3() == b.vec3());
            assert_eq!(is_whole, is_enough, "{wanted}");
            // How far it went, and what that delivers.
            let [gone, far] = [&x, &whole].map(|x| (x[0].vec3() - before[0].vec3()).length());
            let after = work.evaluator.evaluate(&work.ground, &step, &x, 0).value;
            assert!(gone > 0.0 && after - values[0] <= 1e-4 * (gone / far) * slope, "{wanted}");
        }
    }

    /// What is no number, or as infinite as its limit, is not hidden by other parts.
    #[test]
    fn the_worst_part_speaks_for_all() {
        let of = |potential, limit| StepReport {
            potential,
            limit,
            noise: 0.0,
            rejected: false,
            kept_speed: 1.0,
        };
        let (good, over) = (of(1.0, 2.0), of(3.0, 2.0));
        let (infinite, unknown) = (of(f64::INFINITY, f64::INFINITY), of(f64::NAN, 1.0));
        for (parts, keeps) in [
            (&[good, infinite][..], true),
            (&[infinite, over, good], false),
            (&[good, unknown, over], false),
            (&[over, unknown], false),
            (&[unknown, good], false),
        ] {
            let all = StepReport::of_all(parts).expect("parts");
            assert_eq!(all.keeps_limit(), keeps, "{parts:?}");
        }
        assert_eq!(StepReport::of_all(&[]), None);
        let rejected = StepReport { rejected: true, kept_speed: 0.5, ..good };
        let all = StepReport::of_all(&[rejected, over]).expect("parts");
        assert_eq!(all, StepReport { rejected: true, kept_speed: 0.5, ..over });
    }
}
