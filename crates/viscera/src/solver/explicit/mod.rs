//! The explicit integrator: the cheap baseline, and the truth of motion where it is stable.
//!
//! ```text
//! v_(k+1/2) = v_(k-1/2) + h M^-1 (f_ext + f(x_k)),   x_(k+1) = x_k + h v_(k+1/2)      symplectic Euler
//! h <= (2/omega) (sqrt(1 + xi^2) - xi),   xi = eta omega/2       with viscosity eta
//! omega^2 <= max_i sum_(e at i) c rho(K_e)/m_i        with c from the largest frequency at rest, see `spectrum`
//! ```
//!
//! Energy stays within a band that narrows with `h`, for any number of steps, because the method is
//! symplectic (Hairer, Lubich, Wanner, "Geometric Numerical Integration", 2006, chapter I); the limit of
//! `h` with stiffness-proportional damping is that of Belytschko, Liu, Moran, "Nonlinear Finite
//! Elements for Continua and Structures", 2000, section 6.2. The bound of the highest frequency holds
//! because `K_e <= rho(K_e) I` on the vertices of every element `e`. Every connected part of the model takes
//! as many small steps as it needs itself.

mod forces;
#[cfg(feature = "gpu")]
mod gpu;
mod guard;
mod present;
mod spectrum;
mod stability;
pub mod stage;
#[cfg(feature = "gpu")]
pub mod texts;

use crate::layout::{Before, Layout, Moments, Part};
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};
use crate::settings::SolverSettings;
use crate::solver::error::StepError;
use crate::solver::inputs::Inputs;
use crate::solver::plan::{Flag, Node, Plan, Repeat, Times};
use crate::solver::step::data::{Step, StepConstants, StepData, copies_of};
use crate::solver::step::energy::{Energies, Ledger};
use crate::solver::step::groups::Groups;
use crate::solver::step::momentum::keep_spin;
use crate::solver::step::potential::Evaluator;
use crate::solver::step::predict::{Tethers, load_tethers};
use crate::solver::step::stage::StepStage;
use crate::solver::step::strain::put_strains;
use crate::solver::step::tethers::bundle;
use crate::state::State;
use forces::Pieces;
#[cfg(feature = "gpu")]
pub use present::calm_ahead;
use present::{AtRest, Move, SmallSteps};
pub use stability::{Stability, growth, small_steps, substeps_for};
use stage::ExplicitStage;

/// The stages of a step.
pub fn plan() -> Plan {
    let small_step = vec![ExplicitStage::LoadForces.into(), ExplicitStage::Advance.into()];
    Plan {
        nodes: vec![
            StepStage::ReadState.into(),
            StepStage::FindContacts.into(),
            ExplicitStage::Begin.into(),
            Node::Repeat(Repeat {
                most: Times::SmallSteps,
                until: Some(Flag::AllDone),
                is_watched: true,
                body: small_step,
            }),
            ExplicitStage::End.into(),
            StepStage::EndContacts.into(),
            StepStage::WriteState.into(),
        ],
    }
}

/// The memory of the explicit method beside the data of a step.
#[derive(Clone, Debug)]
pub struct Memory<S> {
    pub stability: Stability,
    pieces: Pieces,
    at_rest: AtRest<S>,
    /// Of each part.
    small_steps: Vec<SmallSteps>,
    /// The largest `(omega h)^2` of each part, and what it does in its next small step.
    stiffest: Vec<f64>,
    moves: Vec<Move>,
    /// The small step that the loads of each part are for [s].
    of_loads: Vec<f64>,
    /// Velocities at the start of the step [m/s].
    start_velocities: Vec<Vec3<S>>,
    /// Where vertices end [m], of viscous tissue.
    ends: Vec<Point<S>>,
    evaluator: Evaluator,
    energies: Energies,
}

impl<S: Real> Memory<S> {
    /// Memory for the steps of a model.
    pub fn new(layout: &Layout<S>, settings: &SolverSettings) -> Self {
        let stability = Stability::new(layout, settings);
        Self {
            pieces: Pieces::new(layout),
            at_rest: AtRest::new(layout, &stability),
            stability,
            small_steps: vec![SmallSteps::default(); layout.part_count()],
            stiffest: vec![0.0; layout.part_count()],
            moves: vec![Move::default(); layout.part_count()],
            of_loads: vec![0.0; layout.part_count()],
            start_velocities: vec![Vec3::ZERO; layout.vertex_count()],
            ends: vec![
                Point::default();
                if layout.is_viscous() { layout.vertex_count() } else { 0 }
            ],
            evaluator: Evaluator::new(layout),
            energies: Energies::new(layout.part_count()),
        }
    }

    /// What tools have put into tissue.
    pub fn ledger(&self) -> Ledger {
        self.energies.ledger()
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.start_velocities[..])
            + size_of_val(&self.small_steps[..])
            + self.stability.bytes()
            + self.pieces.bytes()
            + self.at_rest.bytes()
            + size_of_val(&self.stiffest[..])
            + size_of_val(&self.moves[..])
            + size_of_val(&self.of_loads[..])
            + size_of_val(&self.ends[..])
            + self.evaluator.bytes()
            + self.energies.bytes()
    }

    /// Carries a stage out.
    pub fn run(
        &mut self,
        stage: ExplicitStage,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        state: &mut State<S>,
    ) {
        match stage {
            ExplicitStage::Begin => {
                state.multiplier_dt = step.dt;
                self.begin(step, data, state);
            }
            ExplicitStage::LoadForces => self.load_forces(step, data),
            ExplicitStage::Advance => self.advance(step, data),
            ExplicitStage::End => {
                let StepData { constants, points, velocities, .. } = data;
                keep_spin(step, constants, points, &self.start_velocities, velocities);
                self.limit_energy(step, data, state);
                self.end(step, data);
            }
        }
    }

    /// Decides how many small steps each part takes in a step of `dt` [s] at rest; returns the most that they may become.
    pub fn count_small_steps(
        &mut self,
        layout: &Layout<S>,
        inputs: &Inputs<S>,
        data: &mut StepData<S>,
        dt: f64,
    ) -> Result<u32, StepError> {
        let tethers = &mut data.constants.tethers;
        bundle(layout, inputs, tethers);
        let most = small_steps(dt, self.stability.step(layout, tethers))?;
        let stable = self.stability.steps(layout, tethers);
        for (part, (small, stable)) in self.small_steps.iter_mut().zip(stable).enumerate() {
            *small = SmallSteps::new(part, small_steps(dt, stable)?, dt);
        }
        Ok(SmallSteps::most(most))
    }

    /// Whether the last small step of every part is done.
    pub fn is_all_done(&self) -> bool {
        self.small_steps.iter().all(|small| small.left == 0)
    }

    /// [`ExplicitStage::Begin`].
    fn begin(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, state: &mut State<S>) {
        let model = step.layout;
        data.prepare(step, Tethers::AsForces);
        data.constants.previous.copy_from_slice(&data.points);
        self.start_velocities.copy_from_slice(&data.velocities);
        if state.learned.parts.len() != model.part_count() {
            state.learned.clear(0, model.vertex_count(), model.part_count());
        }
        SmallSteps::pool(&mut self.small_steps, &data.constants.groups);
        self.begin_energy(step, data, &state.learned);
        self.start(step, data);
    }

    /// Finds the stiffness of the parts whose small steps are to come, and moves them to the middle of the first.
    fn start(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let model = step.layout;
        // Of the forces only the bounds count: of viscous tissue no strain is known yet.
        self.load_forces(step, data);
        let Self { stability, at_rest, small_steps, .. } = self;
        let StepData { constants, points, velocities, loads } = data;
        for (number, small) in small_steps.iter_mut().enumerate() {
            if small.left == 0 {
                continue;
            }
            let part = &model.parts[number];
            constants.contacts.begin_again(number);
            let stiffest = at_rest.gather(constants, model, part, small.dt, loads);
            small.begin(stability, stiffest, constants.rests(number, part));
        }
        SmallSteps::pool(small_steps, &constants.groups);
        for (number, small) in small_steps.iter().enumerate().filter(|(_, small)| small.left > 0) {
            let part = &model.parts[number];
            if model.is_viscous() {
                drift(constants, part, points, velocities, -0.5 * small.dt, true);
                put_strains(constants, model, number, points, S::ZERO);
                let range = part.vertices.clone();
                points[range.clone()].copy_from_slice(&constants.previous[range]);
            }
            let time = 0.5 * small.dt + small.ahead;
            drift(constants, part, points, velocities, time, false);
        }
        for pin in &step.inputs.pins {
            let v = model.numbering.of(pin.vertex);
            let small = &self.small_steps[model.part_at(v)];
            if small.left > 0 {
                let way = Way::new(0.5 * small.dt, step.dt);
                way.lead(v, pin.target, &constants.previous, points, velocities);
            }
        }
    }

    /// [`ExplicitStage::End`]: `xt = x - dt^2 a + dt^2 (g + M^-1 f_ext)`, tethers among the loads, so that `M (x - xt)/dt^2`
    /// is mass times acceleration, that in the middle of the last small step, less the loads. Of a pinned vertex it is the
    /// mean of the step. Viscous strain goes on for all of the step as it does at its end.
    fn end(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let (model, dt) = (step.layout, S::from_f64(step.dt));
        let StepData { constants, points, velocities, loads, .. } = data;
        for (part, h) in model.parts.iter().zip(&self.of_loads) {
            let times = S::from_f64((step.dt / h) * (step.dt / h));
            for v in part.vertices.clone() {
                let inverse_mass = constants.inverse_masses[v];
                let back = if inverse_mass == S::ZERO {
                    let change: Vec3<S> = velocities[v] - self.start_velocities[v];
                    let load = constants.external[v] * (S::ONE / constants.masses[v]);
                    change * dt - (step.inputs.gravity + load) * (dt * dt)
                } else {
                    loads[copies_of(model, v).start].vec3() * (inverse_mass * times)
                };
                constants.predicted[v].set_vec3(points[v].vec3() - back);
            }
        }
        let StepConstants { tethers, predicted, masses, .. } = constants;
        load_tethers(tethers, predicted, step.dt, |v| masses[v], |v| points[v].vec3());
        if model.is_viscous() {
            self.strain_at_the_end(step, data);
        }
    }

    /// The strain at the start of a step in which it changes all the time as it does at its end.
    fn strain_at_the_end(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let model = step.layout;
        let StepData { constants, points, velocities, .. } = data;
        self.ends.copy_from_slice(points);
        for (number, (part, small)) in model.parts.iter().zip(&self.small_steps).enumerate() {
            drift(constants, part, points, velocities, -0.5 * small.dt, true);
            put_strains(constants, model, number, points, S::ZERO);
            let range = part.vertices.clone();
            points[range.clone()].copy_from_slice(&self.ends[range]);
            let share = S::from_f64(2.0 * step.dt / small.dt);
            put_strains(constants, model, number, points, share);
        }
    }

    /// [`ExplicitStage::LoadForces`].
    fn load_forces(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let StepData { constants, points, velocities, loads } = data;
        for (number, small_steps) in self.small_steps.iter_mut().enumerate() {
            let small = *small_steps;
            if small.left == 0 {
                continue;
            }
            let looks = small.looks();
            let small = Step { dt: small.dt, ..*step };
            let moments = Moments {
                anchors: step.inputs.anchors_of(&step.layout.rest_anchors),
                start: Before::Moving(points, velocities),
                dt: small.dt,
            };
            let places = (&points[..], &self.at_rest);
            small_steps.is_inverted =
                self.pieces.load(constants, &small, &moments, (number, looks), places, loads);
            let squared = S::from_f64(small.dt * small.dt);
            for tether in constants.tethers_of(&step.layout.parts[number]) {
                let force = tether.force(points[tether.vertex].vec3());
                let copy = step.layout.copy_offsets[tether.vertex] as usize;
                loads[copy].add(Point::new(force * squared, tether.stiffness * squared));
            }
        }
        // Contact with other tissue bears on parts whose own forces are there by now.
        for (number, small) in self.small_steps.iter().enumerate().filter(|(_, s)| s.left > 0) {
            // In the middle of the small step.
            let left = small.dt * (f64::from(small.left) - 0.5);
            constants.contacts.place(&step.contact(), (1.0 - left / step.dt).clamp(0.0, 1.0));
            // Contact is not viscous: of `h^2 (w_t^2 + w_c^2)/4 + h eta w_t^2/2 <= 1` its part is less than a tissue's.
            let share = small.dt / (small.dt + 2.0 * self.stability.viscosity(number));
            let of_step = (&step.contact(), small.dt);
            constants.contacts.add_forces_in_motion(of_step, number, points, share, loads);
        }
    }

    /// [`ExplicitStage::Advance`].
    fn advance(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let model = step.layout;
        let StepData { constants, points, velocities, loads } = data;
        let Self { stability, at_rest, small_steps, stiffest, moves, of_loads, .. } = self;
        for (number, part) in model.parts.iter().enumerate() {
            let h = small_steps[number].dt;
            if small_steps[number].left > 0 {
                of_loads[number] = h;
                stiffest[number] = at_rest.gather(constants, model, part, h, loads);
            }
        }
        SmallSteps::pool(small_steps, &constants.groups);
        advance_groups(stability, &constants.groups, stiffest, small_steps, moves);
        for (number, part) in model.parts.iter().enumerate() {
            if moves[number].kick == 0.0 {
                continue;
            }
            let (h, now) = (of_loads[number], moves[number]);
            let (kick, rate) = (S::from_f64(now.kick), S::from_f64(now.kick / (h * h)));
            let [back, ahead] = now.ahead;
            let (back, drift) = (S::from_f64(back), S::from_f64(now.drift + ahead));
            let stiffest = S::from_f64(now.stiffest);
            // `f/k` of what is kicked by `f kick/m`, with `k h^2/m` at hand; viscosity makes `k` stiffer.
            let viscous = 1.0 + 2.0 * stability.viscosity(number) / h;
            let relaxes = S::from_f64(h * h / (now.kick * viscous));
            constants.each_vertex_with(part, points, velocities, |v, point, velocity| {
                let inverse_mass = constants.inverse_masses[v];
                if inverse_mass == S::ZERO {
                    return;
                }
                let load = loads[copies_of(model, v).start];
                let impulse = load.vec3() * rate + constants.external[v] * kick;
                let change = impulse * inverse_mass + step.inputs.gravity * kick;
                let place = point.vec3() - *velocity * back;
                if load.w <= stiffest {
                    *velocity += change;
                    point.set_vec3(place + *velocity * drift);
                } else {
                    *velocity = Vec3::ZERO;
                    point.set_vec3(place + change * (relaxes / load.w));
                }
            });
        }
        for pin in &step.inputs.pins {
            let v = model.numbering.of(pin.vertex);
            let way = Way::new(step.dt - moves[model.part_at(v)].remains, step.dt);
            way.lead(v, pin.target, &constants.previous, points, velocities);
        }
    }
}

/// The next small step of all parts that have one, the same for those of a group; others do not move.
fn advance_groups(
    stability: &Stability,
    groups: &Groups,
    stiffest: &[f64],
    small_steps: &mut [SmallSteps],
    moves: &mut [Move],
) {
    for lead in (0..moves.len()).filter(|&part| groups.leads(part)) {
        if small_steps[lead].left == 0 {
            groups.of(lead).for_each(|part| moves[part].kick = 0.0);
            continue;
        }
        let advanced = groups.of(lead).map(|part| {
            let mut small = small_steps[part];
            let now = small.advance(stability, stiffest[part]);
            (small, now)
        });
        let shorter = |a: (SmallSteps, Move), b: (SmallSteps, Move)| {
            let now = if b.0.left > a.0.left { b.1 } else { a.1 };
            (a.0.together(b.0), now)
        };
        if let Some((small, now)) = advanced.reduce(shorter) {
            for part in groups.of(lead) {
                (small_steps[part], moves[part]) = (small.of(part), now);
            }
        }
    }
}

/// Moves the vertices of a part for a time [s], pinned ones if `all`.
fn drift<S: Real>(
    constants: &StepConstants<S>,
    part: &Part,
    points: &mut [Point<S>],
    velocities: &[Vec3<S>],
    time: f64,
    all: bool,
) {
    let time = S::from_f64(time);
    constants.each_vertex(part, points, |v, point| {
        if all || constants.inverse_masses[v] != S::ZERO {
            point.set_vec3(point.vec3() + velocities[v] * time);
        }
    });
}

/// How far pinned vertices have come at a time of a step: on straight lines.
#[derive(Clone, Copy)]
struct Way<S> {
    /// Of the way.
    share: S,
    /// Over the step's duration [1/s].
    rate: S,
    is_done: bool,
}

impl<S: Real> Way<S> {
    /// At a time [s] of a step of `dt` [s].
    fn new(time: f64, dt: f64) -> Self {
        let (share, rate) = (S::from_f64(time / dt), S::from_f64(1.0 / dt));
        Self { share, rate, is_done: time == dt }
    }

    /// Leads a vertex there. Its number comes apart from its target: together in memory they have padding between them, which
    /// compilers multiply along, and where that looks like a number next to zero it takes a processor a hundred cycles.
    fn lead(
        self,
        v: usize,
        target: Vec3<S>,
        previous: &[Point<S>],
        points: &mut [Point<S>],
        velocities: &mut [Vec3<S>],
    ) {
        let start = previous[v].vec3();
        let moved = start + (target - start) * self.share;
        points[v].set_vec3(if self.is_done { target } else { moved });
        velocities[v] = (target - start) * self.rate;
    }
}
