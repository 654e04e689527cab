//! Integration over time: SDIRK2, implicit Euler in its stead, and the energy clamp.
//!
//! ```text
//! c = 1 - 1/sqrt 2,  he = c h;   every solve:  xt = xs + he vs + he^2 M^-1 f_ext,  v = (x - xs)/he
//! first:   xs = x_n, vs = v_n                                             start  xs + he vs
//! second:  xs = x_n + d v_1, vs = v_n + d a_1, d = (1 - c) h, a_1 = (v_1 - v_n)/he   start  x_1 + d v_1 + d^2/2 a_1
//! ```
//!
//! Alexander, "Diagonally implicit Runge-Kutta methods for stiff ODE's", SIAM J. Numer. Anal. 14, 1977: two stages,
//! second order, L-stable; both stages have the same step, hence the same curvature and preconditioner. A truncated
//! solve may store more energy than there was: then the part takes the step again by implicit Euler from `x_n`, and
//! in the end no part keeps more kinetic energy than is left to it.

use super::parts::{Phase, Progress, Scheme};
use super::preconditioner::Curvature;
use super::sdirk2::SHARE;
use super::stage::Solve;
use super::{Memory, Pair, moments, passes_of};
use crate::scalar::{Real, Vec3};
use crate::settings::Integrator;
use crate::solver::report::StepReport;
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::groups::Groups;
use crate::solver::step::momentum::{keep_momentum, keep_spin};
use crate::solver::step::predict::Tethers;
use crate::solver::step::strain::{measure_strain, put_strains};
use crate::state::{Learned, State};

/// A vertex moves by less than so many units of the precision of the largest coordinate: round-off.
const RESOLUTION: f64 = 1.0;

/// Round-off of a tetrahedron's energy, in units of the precision; and of sums of all of them, which are in double
/// precision.
const ENERGY_ROUNDED: f64 = 8.0;
const SUM_ROUNDED: f64 = 1e-12;

impl<S: Real> Memory<S> {
    /// The step of a solve [s] in a step of `dt`.
    fn solve_dt(which: Solve, dt: f64) -> f64 {
        match which {
            Solve::First | Solve::Second => SHARE * dt,
            Solve::Euler => dt,
        }
    }

    /// [`super::stage::QuasiNewtonStage::Begin`].
    pub(super) fn begin(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        state: &mut State<S>,
    ) {
        let layout = step.layout;
        let first = match step.settings.integrator {
            Integrator::Sdirk2 => Solve::First,
            Integrator::ImplicitEuler => Solve::Euler,
        };
        let dt = Self::solve_dt(first, step.dt);
        let solve = Step { dt, ..*step };
        data.prepare(&solve, Tethers::AsInertia);
        self.start_velocities.copy_from_slice(&data.velocities);
        data.constants.previous.copy_from_slice(&data.points);
        for (pinned, inverse) in self.pinned.iter_mut().zip(&data.constants.inverse_masses) {
            *pinned = *inverse == S::ZERO;
        }
        let room = 2 * self.history() * layout.vertex_count();
        if state.learned.pairs.len() != room || state.learned.parts.len() != layout.part_count() {
            state.learned.clear(self.history(), layout.vertex_count(), layout.part_count());
        }
        for (number, part) in layout.parts.iter().enumerate() {
            let reach = part.vertices.clone().fold(S::ZERO, |reach, v| {
                let x = data.points[v];
                reach.max(x.x.abs()).max(x.y.abs()).max(x.z.abs())
            });
            let kept = &mut state.learned.parts[number];
            let group = data.constants.groups.name(number);
            if std::mem::replace(&mut kept.group, group) != group {
                // What was learned with others, or alone, is no pair of these together.
                (kept.count, kept.calm) = (0, false);
            }
            let progress = &mut self.parts[number];
            progress.phase = Phase::Done;
            progress.resolution = RESOLUTION * S::EPSILON * reach.to_f64();
            // A body that lies on tools alone flutters where it slides: the second stage of SDIRK2 goes on from the velocity of
            // the first, which friction has yet to answer. Implicit Euler slides as fast as it should.
            let slides = data.constants.lies_on_others(number, part);
            progress.scheme = match step.settings.integrator {
                Integrator::Sdirk2 if !slides => Scheme::Sdirk2,
                _ => Scheme::Euler,
            };
        }
        self.begin_groups(&data.constants.groups, &mut state.learned);
        self.begin_energy(step, data);
        self.reports.clear();
        self.reports.resize(layout.part_count(), StepReport::QUIET);
        // Where the tissue turns to in this step.
        let share = if first == Solve::Euler { 1.0 } else { 0.5 };
        let ahead = S::from_f64(share * step.dt);
        for (v, place) in self.base.iter_mut().enumerate() {
            place.set_vec3(data.points[v].vec3() + data.velocities[v] * ahead);
        }
        for number in 0..layout.part_count() {
            if self.parts[number].scheme == Scheme::Sdirk2 || first == Solve::Euler {
                self.fit_pairs(step, data, &mut state.learned, number, dt);
            }
        }
        self.preconditioner.fit(layout, &data.constants);
        self.refresh(&solve, data, &state.learned);
        state.multiplier_dt = dt;
    }

    /// Parts of a group go on together.
    fn begin_groups(&mut self, groups: &Groups, learned: &mut Learned<S>) {
        groups.pool(&mut self.parts, |a, b| {
            let resolution = a.resolution.max(b.resolution);
            let scheme = if a.scheme == Scheme::Euler { a.scheme } else { b.scheme };
            Progress { scheme, resolution, ..a }
        });
        for number in 0..self.parts.len() {
            // Other settings may have kept more.
            let most = self.history_of(groups, number) as u32;
            let kept = &mut learned.parts[number];
            kept.count = kept.count.min(most);
        }
    }

    /// Makes the pairs of a part those of a solve of `dt` [s]: the change of a gradient is that of inertia and, times the
    /// squared step, of forces.
    fn fit_pairs(
        &self,
        step: &Step<'_, S>,
        data: &StepData<S>,
        learned: &mut Learned<S>,
        number: usize,
        dt: f64,
    ) {
        let before = std::mem::replace(&mut learned.parts[number].dt, dt);
        if before == 0.0 || before == dt {
            return;
        }
        let ratio = S::from_f64((dt / before) * (dt / before));
        let range = &step.layout.parts[number].vertices;
        for slot in 0..self.history() {
            let Pair { s, y, .. } = Pair::places(slot, step.layout.vertex_count(), range);
            for ((s, y), v) in s.zip(y).zip(range.clone()) {
                let inertia = learned.pairs[s] * data.constants.masses[v];
                learned.pairs[y] = inertia + (learned.pairs[y] - inertia) * ratio;
            }
        }
    }

    /// Turns the preconditioner to `base`, and the images of the pairs with it.
    fn refresh(&mut self, solve: &Step<'_, S>, data: &StepData<S>, learned: &Learned<S>) {
        let (layout, constants) = (solve.layout, &data.constants);
        let curvature =
            Curvature { dt: solve.dt, x: &self.base, moments: moments(solve, &constants.previous) };
        for number in 0..layout.part_count() {
            self.preconditioner.refresh(solve, constants, &curvature, number);
        }
        self.renew_pairs(layout, constants, learned);
    }

    /// [`super::stage::QuasiNewtonStage::StartSolve`].
    pub(super) fn start_solve(
        &mut self,
        which: Solve,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        learned: &mut Learned<S>,
    ) {
        let dt = Self::solve_dt(which, step.dt);
        self.solve_dt = dt;
        data.constants
            .contacts
            .place(&step.contact(), if which == Solve::First { SHARE } else { 1.0 });
        let solve = Step { dt, ..*step };
        let wanted = if which == Solve::Euler { Scheme::Euler } else { Scheme::Sdirk2 };
        if !self.parts.iter().any(|part| part.scheme == wanted) {
            return;
        }
        if which == Solve::Euler && step.settings.integrator == Integrator::Sdirk2 {
            // Another step, other curvature. Parts that are done keep their positions, but not what follows from their
            // inertia; `end_solve` gives it back.
            data.prepare(&solve, Tethers::AsInertia);
            for number in 0..step.layout.part_count() {
                if self.parts[number].scheme == Scheme::Euler {
                    self.fit_pairs(step, data, learned, number, dt);
                }
            }
            self.base.copy_from_slice(&data.constants.previous);
            // What slides is met where it goes: friction is far stiffer where it begins.
            let ahead = S::from_f64(dt);
            for (number, part) in step.layout.parts.iter().enumerate() {
                if self.parts[number].scheme == Scheme::Euler && !self.reports[number].rejected {
                    for v in part.vertices.clone() {
                        let moved = self.start_velocities[v] * ahead;
                        let place = self.base[v].vec3() + moved;
                        self.base[v].set_vec3(place);
                    }
                }
            }
            self.refresh(&solve, data, learned);
        }
        for number in 0..step.layout.part_count() {
            if self.parts[number].scheme == wanted {
                // A step that is taken again begins where nothing has moved.
                let is_again = self.reports[number].rejected;
                self.start_part(which, &solve, data, number, which != Solve::Second && !is_again);
            }
        }
        self.start_from_strains(step, data);
    }

    /// Viscosity acts against the change of strain since the start of the solve.
    fn start_from_strains(&self, step: &Step<'_, S>, data: &mut StepData<S>) {
        for number in 0..step.layout.part_count() {
            put_strains(&mut data.constants, step.layout, number, &self.stage_start, S::ZERO);
        }
    }

    /// The start of a part's solve: `xs`, `vs`, `xt`, the reference and the first trial.
    fn start_part(
        &mut self,
        which: Solve,
        solve: &Step<'_, S>,
        data: &mut StepData<S>,
        number: usize,
        is_first_of_step: bool,
    ) {
        let part = &solve.layout.parts[number];
        let step_dt = solve.dt / if which == Solve::Euler { 1.0 } else { SHARE };
        let (he, d) = (S::from_f64(solve.dt), S::from_f64((1.0 - SHARE) * step_dt));
        let squared = he * he;
        let falls = !data.constants.rests(number, part);
        let acceleration =
            if falls { self.mean_acceleration(solve, data, number) } else { Vec3::ZERO };
        for v in part.vertices.clone() {
            let x = data.constants.previous[v].vec3();
            let (start, velocity, first) = match which {
                Solve::First | Solve::Euler => {
                    let velocity = self.start_velocities[v];
                    let first = x + velocity * he + acceleration * squared;
                    // A step that is taken again begins where nothing has moved: its start is the reference.
                    (x, velocity, if is_first_of_step { first } else { x })
                }
                Solve::Second => {
                    let (before, after) = (self.start_velocities[v], self.first_velocities[v]);
                    let change = (after - before) * (S::ONE / he);
                    let begun = self.base[v].vec3();
                    // Nothing inside changes the way of what nothing holds: there its middle goes all the way.
                    let fall = acceleration * (d * (he - S::HALF * d));
                    let first = begun + after * d + change * (S::HALF * d * d) + fall;
                    (x + after * d, before + change * d, first)
                }
            };
            self.stage_start[v].set_vec3(start);
            self.stage_velocities[v] = velocity;
            let constants = &mut data.constants;
            let load = constants.external[v] * (S::ONE / constants.inertias[v]);
            let inertial = start + velocity * he;
            let predicted = inertial + (solve.inputs.gravity + load) * squared;
            constants.predicted[v].set_vec3(predicted);
            if which != Solve::Second {
                self.base[v].set_vec3(x);
            }
            data.points[v].set_vec3(first);
        }
        let constants = &mut data.constants;
        let range = part.vertices.clone();
        let first = constants.tethers.partition_point(|tether| tether.vertex < range.start);
        for i in first..constants.tethers.len() {
            let tether = constants.tethers[i];
            let v = tether.vertex;
            if v >= range.end {
                break;
            }
            let inertial = self.stage_start[v].vec3() + self.stage_velocities[v] * he;
            let pull = tether.force(inertial + solve.inputs.gravity * squared);
            let moved = pull * (S::ONE / constants.inertias[v]) * squared;
            let predicted = constants.predicted[v].vec3() + moved;
            constants.predicted[v].set_vec3(predicted);
        }
        let share = S::from_f64(if which == Solve::First { SHARE } else { 1.0 });
        for pin in &solve.inputs.pins {
            let v = solve.layout.numbering.of(pin.vertex);
            if range.contains(&v) {
                let x = constants.previous[v].vec3();
                let target =
                    if which == Solve::First { x + (pin.target - x) * share } else { pin.target };
                data.points[v].set_vec3(target);
                self.base[v].set_vec3(target);
            }
        }
        let most = self.most_passes(&data.constants.groups, number);
        let progress = &mut self.parts[number];
        progress.phase = Phase::Starting;
        progress.passes_left = passes_of(which, solve.settings, most);
        (progress.failures, progress.rejections) = (0, 0);
        (progress.accepted, progress.ahead) = (false, false);
    }

    /// The passes of the part of a group that has most.
    fn most_passes(&self, groups: &Groups, number: usize) -> u32 {
        groups.of(number).map(|part| self.choices[part].passes).max().unwrap_or(1)
    }

    /// How a part's center of mass is accelerated [m/s^2] by what acts on it from outside.
    fn mean_acceleration(&self, solve: &Step<'_, S>, data: &StepData<S>, number: usize) -> Vec3<S> {
        let constants = &data.constants;
        let (mut mass, mut force) = (0.0, Vec3::<f64>::ZERO);
        for v in solve.layout.parts[number].vertices.clone() {
            mass += constants.masses[v].to_f64();
            force += constants.external[v].cast();
        }
        solve.inputs.gravity + (force * (1.0 / mass)).cast()
    }

    /// [`super::stage::QuasiNewtonStage::EndSolve`].
    pub(super) fn end_solve(
        &mut self,
        which: Solve,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        state: &mut State<S>,
    ) {
        let wanted = if which == Solve::Euler { Scheme::Euler } else { Scheme::Sdirk2 };
        let rate = S::from_f64(1.0 / Self::solve_dt(which, step.dt));
        for (number, part) in step.layout.parts.iter().enumerate() {
            let progress = &mut self.parts[number];
            if progress.scheme != wanted {
                continue;
            }
            let kept = &mut state.learned.parts[number];
            let is_calm = progress.rejections == 0;
            // The last direction is taken unchecked where nothing was rejected, in this solve or the one before, where
            // the energy of the step is checked in the end, and where it is no round-off: that would add up.
            let is_checked = progress.scheme.is_checked() && progress.is_more_than_round_off();
            let is_trusted = is_calm && kept.calm && is_checked;
            let goes_on = progress.ahead && progress.accepted && is_trusted;
            kept.calm = is_calm;
            progress.phase = Phase::Done;
            let range = part.vertices.clone();
            let (from, to) = if goes_on {
                (&data.points, &mut self.base)
            } else {
                (&self.base, &mut data.points)
            };
            to[range.clone()].copy_from_slice(&from[range.clone()]);
        }
        let is_last = which != Solve::First;
        for number in 0..step.layout.part_count() {
            if self.parts[number].scheme == wanted {
                let solve = Step { dt: self.solve_dt, ..*step };
                keep_momentum(&solve, &data.constants, &mut data.points, number);
            }
        }
        for (number, part) in step.layout.parts.iter().enumerate() {
            if self.parts[number].scheme != wanted {
                continue;
            }
            let range = part.vertices.clone();
            self.base[range.clone()].copy_from_slice(&data.points[range.clone()]);
            for v in range {
                let moved = data.points[v].vec3() - self.stage_start[v].vec3();
                match which {
                    Solve::First => self.first_velocities[v] = moved * rate,
                    Solve::Second | Solve::Euler => data.velocities[v] = moved * rate,
                }
            }
        }
        if is_last && self.parts.iter().any(|part| part.scheme == wanted) {
            let StepData { constants, points, velocities, .. } = data;
            keep_spin(step, constants, points, &self.start_velocities, velocities);
        }
        let again = which == Solve::Euler && step.settings.integrator == Integrator::Sdirk2;
        if again && self.parts.iter().any(|part| part.scheme == Scheme::Euler) {
            self.end_again(step, data);
        }
    }

    /// After steps of implicit Euler beside SDIRK2: what measures of forces read is in terms of SDIRK2's `he`.
    fn end_again(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let he = SHARE * step.dt;
        for (place, &inertia) in self.base.iter_mut().zip(&data.constants.inertias) {
            place.w = inertia;
        }
        data.prepare(&Step { dt: he, ..*step }, Tethers::AsInertia);
        let shrink = S::from_f64(SHARE * SHARE);
        for (number, part) in step.layout.parts.iter().enumerate() {
            if self.parts[number].scheme == Scheme::Euler {
                for v in part.vertices.clone() {
                    let x = data.points[v].vec3();
                    let away = x - data.constants.predicted[v].vec3();
                    data.constants.predicted[v].set_vec3(x - away * shrink);
                    data.constants.inertias[v] = self.base[v].w;
                }
            }
        }
        self.solve_dt = he;
    }

    /// Energies before the step, pins moved.
    fn begin_energy(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        self.base.copy_from_slice(&data.points);
        for pin in &step.inputs.pins {
            self.base[step.layout.numbering.of(pin.vertex)].set_vec3(pin.target);
        }
        self.measure_start_strain(step, data);
        self.evaluator.evaluate_all(&data.constants, step, &self.base);
        self.evaluator.add_recovered_of_all(&mut data.constants, step.layout, &self.base);
        self.energies.begin(step, data, &self.evaluator.stored);
    }

    /// Green strain at the start of the step, which the energies are counted from.
    fn measure_start_strain(&self, step: &Step<'_, S>, data: &mut StepData<S>) {
        if step.layout.is_viscous() {
            let constants = &mut data.constants;
            let (workers, strains) = (&constants.workers, &mut constants.start_strain);
            measure_strain(workers, step.layout, None, &constants.previous, strains);
        }
    }

    /// [`super::stage::QuasiNewtonStage::CheckEnergy`].
    pub(super) fn check_energy(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        learned: &mut Learned<S>,
    ) {
        self.measure_start_strain(step, data);
        self.evaluator.evaluate_all(&data.constants, step, &data.points);
        self.evaluator.add_recovered_of_all(&mut data.constants, step.layout, &data.points);
        let Self { energies, evaluator, parts, reports, .. } = self;
        let mut any = false;
        let round_off = (ENERGY_ROUNDED * S::EPSILON).max(SUM_ROUNDED);
        energies.end(step, data, &evaluator.stored);
        for (number, progress) in parts.iter_mut().enumerate() {
            reports[number].rejected =
                progress.scheme == Scheme::Sdirk2 && energies.stores_too_much(number, round_off);
            if reports[number].rejected {
                progress.scheme = Scheme::Euler;
                learned.parts[number].count = 0;
                learned.parts[number].calm = false;
                any = true;
            }
        }
        self.rejected += u64::from(any);
    }

    /// [`super::stage::QuasiNewtonStage::LimitEnergy`].
    pub(super) fn limit_energy(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        // Where no part took its step again, all stand where their energies were found.
        let stand = step.settings.integrator == Integrator::Sdirk2
            && self.parts.iter().all(|part| part.scheme == Scheme::Sdirk2);
        if !stand {
            self.measure_start_strain(step, data);
            self.evaluator.evaluate_all(&data.constants, step, &data.points);
            self.evaluator.add_recovered_of_all(&mut data.constants, step.layout, &data.points);
            self.energies.end(step, data, &self.evaluator.stored);
        }
        self.energies.limit(step, data, |_, _| true, |_, _| {});
        let round_off = (ENERGY_ROUNDED * S::EPSILON).max(SUM_ROUNDED);
        for (number, report) in self.reports.iter_mut().enumerate() {
            let energies = self.energies.report(number, step.dt, round_off);
            *report = StepReport { rejected: report.rejected, ..energies };
        }
        self.start_from_strains(step, data);
        // Beside SDIRK2, measures of forces take steps of implicit Euler for solves of `he` (`end_again`): the change of
        // strain over `he` has to be that over the whole step.
        if step.settings.integrator == Integrator::Sdirk2 {
            for (number, progress) in self.parts.iter().enumerate() {
                if progress.scheme == Scheme::Euler {
                    let share = S::from_f64(SHARE);
                    put_strains(&mut data.constants, step.layout, number, &data.points, share);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
