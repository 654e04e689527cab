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
//! With `anderson_guard = "energy"` Anderson's accelerated iterates are guarded one by one. An iterate is taken if its
//! `Phi` is not above the best so far, else the plain sweep if its `Phi` is not; else the iteration goes on from the
//! plain sweep once, and at the second failure in a row makes one step of descent from the best. `x_s` is then the
//! best iterate.

use super::data::{Step, StepConstants, StepData, gather};
use super::energy::Energies;
use super::gradient::load_forces;
use super::potential::{Evaluator, Potential};
use crate::layout::Layout;
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};
use crate::solver::report::StepReport;

/// Shares of a rejected step that are tried in turn.
pub const SHARES: [f64; 4] = [0.5, 0.2, 0.08, 0.032];

/// Steps of descent where no share will do.
pub const DESCENTS: usize = 3;

/// Of the decrease that the slope promises, a descent must deliver this share (Armijo).
pub const SUFFICIENT: f64 = 1e-4;

/// A descent that overshoots is shortened by this factor, at most [`SHORTENINGS`] times.
pub const SHORTEN: f64 = 0.4;
pub const SHORTENINGS: usize = 12;

/// Of plain sweeps in a row that raise the potential this many lead to a step of descent.
pub const TOLERATED: u32 = 2;

/// Memory of guarded steps.
#[derive(Clone, Debug)]
pub struct Guard<S> {
    pub evaluator: Evaluator,
    /// `x_s` [m]: the best start, or a better iterate.
    pub start: Vec<Point<S>>,
    /// Positions under test [m].
    trial: Vec<Point<S>>,
    pub parts: Vec<PartGuard>,
    energies: Energies,
    /// Steps so far that were rejected for at least one part.
    pub rejected: u64,
    /// How the last step ended for each part.
    reports: Vec<StepReport>,
    /// Whether there has been one.
    is_over: bool,
}

/// Of one part of the model.
#[derive(Clone, Copy, Debug, Default)]
pub struct PartGuard {
    /// [J s^2].
    limit: f64,
    /// `Phi` [J s^2] at `x_s`.
    best: f64,
    /// Plain sweeps in a row that have ended above it.
    pub failures: u32,
}

impl<S: Real> Guard<S> {
    /// For the steps of a model.
    pub fn new(layout: &Layout<S>) -> Self {
        let positions = vec![Point::default(); layout.vertex_count()];
        let parts = layout.part_count();
        Self {
            evaluator: Evaluator::new(layout),
            start: positions.clone(),
            trial: positions,
            parts: vec![PartGuard::default(); parts],
            energies: Energies::new(parts),
            rejected: 0,
            reports: vec![StepReport::QUIET; parts],
            is_over: false,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.start[..])
            + size_of_val(&self.trial[..])
            + size_of_val(&self.parts[..])
            + size_of_val(&self.reports[..])
            + self.energies.bytes()
            + self.evaluator.bytes()
    }

    /// How the last step ended for each part; nothing before the first.
    pub fn part_reports(&self) -> &[StepReport] {
        if self.is_over { &self.reports } else { &[] }
    }

    /// [`super::stage::StepStage::ChooseStart`].
    pub fn choose_start(&mut self, step: &Step<'_, S>, data: &StepData<S>) {
        let StepData { constants, points, .. } = data;
        // First the place that the sweeps start from. The other two replace it only where they are strictly lower:
        // at rest `x_n` is the same place, and nothing is to be exchanged.
        self.start.copy_from_slice(points);
        self.evaluator.evaluate_all(constants, step, points);
        for (part, potential) in self.parts.iter_mut().zip(&self.evaluator.potentials) {
            part.limit = potential.value;
        }
        // Pins are at their new places whatever the step does. Judged with the old ones, the start of the step could
        // store less than every place the step may end at, and pulled tissue would never keep the limit.
        for from_rest in [true, false] {
            let StepConstants { previous, predicted, .. } = constants;
            let trial = &mut self.trial;
            trial.copy_from_slice(if from_rest { previous } else { predicted });
            for pin in &step.inputs.pins {
                trial[step.layout.numbering.of(pin.vertex)].set_vec3(pin.target);
            }
            self.evaluator.evaluate_all(constants, step, trial);
            // Here, because the next evaluation overwrites `stored`: the energy limit counts from the start of the
            // step with its pins moved.
            if from_rest {
                self.energies.begin(step, data, &self.evaluator.stored);
            }
            let Self { start, trial, parts, .. } = self;
            for (number, of) in step.layout.parts.iter().enumerate() {
                let (part, value) = (&mut parts[number], self.evaluator.potentials[number].value);
                // Written so that a limit that is NaN or infinite gives way.
                if value < part.limit || !part.limit.is_finite() {
                    part.limit = value;
                    let vertices = of.vertices.clone();
                    start[vertices.clone()].copy_from_slice(&trial[vertices]);
                }
            }
        }
        // Only the guard of accelerated iterates lowers `best` from here on; without it nothing reads it.
        for part in &mut self.parts {
            part.best = part.limit;
            part.failures = 0;
        }
    }

    /// [`super::stage::StepStage::GuardStep`].
    pub fn guard_step(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        // All parts in one pass, which threads share; after it only rejected parts are evaluated, one by one.
        // `limit_energy` takes each part's stored energy from its last evaluation, so that has to be the one of
        // the place where the part ends.
        self.evaluator.evaluate_all(&data.constants, step, &data.points);
        let mut rejected = false;
        for part in 0..step.layout.part_count() {
            let swept = self.report(part);
            self.reports[part] = if swept.keeps_limit() {
                swept
            } else {
                rejected = true;
                StepReport { rejected: true, ..self.take_back(step, data, part) }
            };
        }
        self.rejected += u64::from(rejected);
        self.is_over = true;
    }

    /// [`super::stage::StepStage::LimitEnergy`]. The last evaluation of each part's potential was that of its
    /// end.
    pub fn limit_energy(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let Self { energies, evaluator, reports, .. } = self;
        energies.end(step, data, &evaluator.stored);
        energies.limit(step, data, |part, share| {
            reports[part].kept_speed = share;
        });
    }

    /// Shortens the step of a part, or descends.
    fn take_back(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, part: usize) -> StepReport {
        let vertices = step.layout.parts[part].vertices.clone();
        // The array is taken out so that `self` can be borrowed beside it. Other parts' places in it are old, which
        // an evaluation of this part does not read. `data.points` stays at `x_K` until a share is accepted: every
        // share is one of the whole step, not of the share before it.
        let mut trial = std::mem::take(&mut self.trial);
        let shortened = SHARES.into_iter().find_map(|share| {
            let share = S::from_f64(share);
            for v in vertices.clone() {
                let start = self.start[v].vec3();
                trial[v].set_vec3(start + (data.points[v].vec3() - start) * share);
            }
            self.evaluator.evaluate(&data.constants, step, &trial, part);
            // Not the lowest but the first, which is the longest that keeps the limit: a shorter one throws away
            // more of what the sweeps have found.
            Some(self.report(part)).filter(StepReport::keeps_limit)
        });
        let report = shortened.unwrap_or_else(|| {
            trial[vertices.clone()].copy_from_slice(&self.start[vertices.clone()]);
            // No share is low enough, so the sweeps' direction itself is wrong. Descents need nothing of it: they
            // begin at `x_s`, where `Phi` is the limit, and none ends higher than it began.
            for _ in 0..DESCENTS {
                self.descend(step, data, &mut trial, part);
            }
            // The last length that a descent tried may be one that it gave up, so the end is evaluated once more.
            self.evaluator.evaluate(&data.constants, step, &trial, part);
            self.report(part)
        });
        take(step, data, &trial, part);
        self.trial = trial;
        report
    }

    /// Goes on from one step of descent from `x_s`, which becomes the iterate of a part.
    pub fn restart_from_descent(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        part: usize,
    ) {
        let mut trial = std::mem::take(&mut self.trial);
        let vertices = step.layout.parts[part].vertices.clone();
        trial[vertices.clone()].copy_from_slice(&self.start[vertices]);
        self.descend(step, data, &mut trial, part);
        take(step, data, &trial, part);
        self.trial = trial;
    }

    /// Whether a part's iterate, whose potential was evaluated last, is at least as good as the best so far;
    /// becomes it where it is better.
    pub fn is_best(&mut self, step: &Step<'_, S>, points: &[Point<S>], part: usize) -> bool {
        let Potential { value, noise } = self.evaluator.potentials[part];
        let Self { start, parts, .. } = self;
        let guard = &mut parts[part];
        // Any decrease moves `x_s`; `noise` only decides whether the iterate passes. If every iterate that passes
        // became `x_s`, its `Phi` could creep up by `noise` at every sweep.
        if value < guard.best {
            guard.best = value;
            let vertices = step.layout.parts[part].vertices.clone();
            start[vertices.clone()].copy_from_slice(&points[vertices]);
        }
        let good = value <= guard.best + noise;
        if good {
            guard.failures = 0;
        }
        good
    }

    /// Of a part, whose potential was evaluated last.
    fn report(&self, part: usize) -> StepReport {
        let Potential { value, noise } = self.evaluator.potentials[part];
        StepReport {
            potential: value,
            limit: self.parts[part].limit,
            noise,
            rejected: false,
            kept_speed: 1.0,
        }
    }

    /// One step of descent of a part from `x`. Its positions, which are not needed any more, hold the places
    /// tried.
    fn descend(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        x: &mut [Point<S>],
        part: usize,
    ) {
        // The loads are made once, at the start of the line, and hold force and curvature per copy. Evaluations below
        // do not touch them, so `descent` gives the same direction at every length.
        let of = &step.layout.parts[part];
        let moments = data.constants.moments(step);
        load_forces::<S, true>(&data.constants, step, &moments, of, x, &mut data.loads);
        let before = self.evaluator.evaluate(&data.constants, step, x, part).value;
        // A whole step divides the gradient by inertia and a bound of each vertex's own curvature, as if neighbours
        // stood still. Where they move together it overshoots, as the swollen tetrahedron of the test below does.
        let mut length = 1.0;
        for _ in 0..SHORTENINGS {
            // One pass finds slope and places; the slope [J s^2] is negative unless the gradient vanishes. `x` has to
            // stay where the line starts, so places are tried in `data.points`: `x_K` is given up by now.
            let mut slope = 0.0;
            for v in of.vertices.clone() {
                let (gradient, direction) = descent(step.layout, data, x, v);
                slope += gradient.dot(direction).to_f64();
                data.points[v].set_vec3(x[v].vec3() + direction * S::from_f64(length));
            }
            let after = self.evaluator.evaluate(&data.constants, step, &data.points, part).value;
            // A potential that is NaN compares as false: the step is shortened, as after an overshoot. There is no
            // allowance for noise: where rounding hides the decrease, `x` stays, which is never above the limit.
            if after <= before + SUFFICIENT * length * slope {
                x[of.vertices.clone()].copy_from_slice(&data.points[of.vertices.clone()]);
                return;
            }
            length *= SHORTEN;
        }
    }
}

/// Takes positions of a part over; weights stay.
fn take<S: Real>(step: &Step<'_, S>, data: &mut StepData<S>, x: &[Point<S>], part: usize) {
    for v in step.layout.parts[part].vertices.clone() {
        data.points[v].set_vec3(x[v].vec3());
    }
}

/// Gradient of `Phi` by one vertex and the direction of descent; zero for a pinned one.
fn descent<S: Real>(
    layout: &Layout<S>,
    data: &StepData<S>,
    x: &[Point<S>],
    v: usize,
) -> (Vec3<S>, Vec3<S>) {
    let StepData { constants, loads, .. } = data;
    if constants.inverse_masses[v] == S::ZERO {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let load = gather(layout, loads, v);
    let mass = constants.inertias[v];
    let gradient = (x[v].vec3() - constants.predicted[v].vec3()) * mass - load.vec3();
    (gradient, gradient * (-S::ONE / (mass + load.w)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::TetMesh;
    use crate::model::ModelBuilder;
    use crate::settings::SolverSettings;
    use crate::solver::Inputs;
    use crate::solver::cpu::Memory;
    use crate::solver::probe::{begun, quiet};

    /// A tetrahedron that has swollen. Its corners go back together, which the bounds, one vertex at a time,
    /// know nothing of: in long steps, where inertia is small, a whole step of descent overshoots.
    fn swollen(settings: &SolverSettings) -> (Layout<f64>, Vec<Vec3<f64>>) {
        let corners = [[1.0; 3], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
        let rest = corners.map(|x| Vec3::from_f64(x) * 0.01).to_vec();
        let mesh = TetMesh::new(rest, vec![[0, 1, 2, 3]], vec![0]).expect("a tetrahedron").0;
        let law = MaterialModel::StableNeoHookean;
        let tissue = Material::new(law, 1e4, 0.45, 1000.0).expect("legal");
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &tissue).expect("a body");
        let places = mesh.vertices().iter().map(|x| *x * 1.02).collect();
        (Layout::new(&builder.build().expect("a model"), settings), places)
    }

    /// Before a descent: places, the places of a whole step of it, `Phi` at both, and the slope.
    struct Descent {
        before: Vec<Point<f64>>,
        whole: Vec<Point<f64>>,
        values: [f64; 2],
        slope: f64,
    }

    fn whole_descent(memory: &mut Memory<f64>, step: &Step<'_, f64>) -> Descent {
        let data = &mut memory.data;
        let before = data.points.clone();
        let part = &step.layout.parts[0];
        let moments = data.constants.moments(step);
        load_forces::<_, true>(&data.constants, step, &moments, part, &before, &mut data.loads);
        let (mut whole, mut slope) = (before.clone(), 0.0);
        for v in 0..before.len() {
            let (gradient, direction) = descent(step.layout, data, &before, v);
            slope += gradient.dot(direction);
            whole[v].set_vec3(before[v].vec3() + direction);
        }
        let evaluator = &mut memory.guard.as_mut().expect("guarded steps").evaluator;
        let values =
            [&before, &whole].map(|x| evaluator.evaluate(&data.constants, step, x, 0).value);
        Descent { before, whole, values, slope }
    }

    /// Armijo's condition decides where `Phi` changes by less than 1e-4 of what the slope promises.
    #[test]
    fn a_descent_delivers_its_share_of_what_the_slope_promises() {
        let (settings, inputs) = (SolverSettings::xpbd(), Inputs::default());
        let (model, places) = swollen(&settings);
        // What a whole step changes, of what its slope promises: -1/2 in short steps.
        let change = |dt: f64| {
            let step = quiet(&model, &inputs, &settings, dt);
            let Descent { values, slope, .. } = whole_descent(&mut begun(&step, &places), &step);
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
            let mut memory = begun(&step, &places);
            let Descent { before, whole, values, slope } = whole_descent(&mut memory, &step);
            let mut x = before.clone();
            let Memory { data, guard, .. } = &mut memory;
            let guard = guard.as_mut().expect("guarded steps");
            guard.descend(&step, data, &mut x, 0);
            let is_whole = x.iter().zip(&whole).all(|(a, b)| a.vec3() == b.vec3());
            assert_eq!(is_whole, is_enough, "{wanted}");
            // How far it went, and what that delivers.
            let [gone, far] = [&x, &whole].map(|x| (x[0].vec3() - before[0].vec3()).length());
            let after = guard.evaluator.evaluate(&data.constants, &step, &x, 0).value;
            assert!(gone > 0.0 && after - values[0] <= 1e-4 * (gone / far) * slope, "{wanted}");
        }
    }
}
