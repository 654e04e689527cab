//! The solver: advances a [`State`] by one step of a [`Model`].
//!
//! ```text
//! minimise  1/2 |x - xt|_M^2 + dt^2 V(x),   xt = x_n + dt v_n + dt^2 M^-1 f_ext      implicit Euler
//! XPBD: sweep over constraints, [J M^-1 J^T + a~] dl = -C - a~ l,  x += M^-1 J^T dl,  l += dl
//! ```
//!
//! What one step does is a tree of stages ([`plan`]): those that all methods share are in `step`, those of one
//! method in a folder of its name. `cpu` and `gpu` are the two backends: threads and passes, buffers and
//! dispatches.

mod cpu;
mod error;
mod explicit;
#[cfg(feature = "gpu")]
pub mod gpu;
mod held;
mod inputs;
mod meetings;
mod methods;
pub mod oscillations;
pub mod plan;
#[cfg(test)]
mod probe;
mod quasi_newton;
mod report;
mod shadow;
mod step;
#[cfg(test)]
mod trial;
mod xpbd;

use std::sync::Arc;

use crate::contact::Wrench;
use crate::layout::Layout;
use crate::model::Model;
use crate::scalar::lanes::Instructions;
use crate::scalar::{Real, Vec3};
use crate::settings::{Count, Method, SolverSettings};
use crate::state::{ContactState, State};
use cpu::precision::{Task, Within, carry_out};
pub use error::StepError;
pub(crate) use explicit::growth as explicit_growth;
pub(crate) use inputs::check_settings;
pub use inputs::{Inputs, Pin, Tether};
use inputs::{check_inputs, check_model, check_state, check_step};
#[doc(hidden)]
pub use meetings::{FoundMeeting, Meetings};
use oscillations::Oscillations;
use plan::Plan;
pub(crate) use quasi_newton::{choose, expected_motion_error};
pub use report::{FrameReading, StepReport};
pub use shadow::Shadow;
use step::contacts::ContactStep;
use step::data::{Step, StepConstants};
pub use step::energy::Ledger;
#[cfg(feature = "gpu")]
#[doc(hidden)]
pub use step::tissue::TISSUE_WGSL;
#[doc(hidden)]
pub use step::tissue::Tissue;
pub use step::{balance, recovered};
pub use xpbd::acceleration;

/// Surfaces come closer by so many thicknesses of contact at most in a step of a frame that is divided for it,
const MOST_APPROACHED: f64 = 2.0;

/// which has so many times as many steps at most.
const MOST_DIVIDED: f64 = 16.0;

/// A solver for one model. All memory is taken when it is built; a step allocates nothing, but for
/// every 63rd step of several threads, which exchanges a block of the queue that leads to them, for steps of the
/// quasi-Newton method in which other vertices are pinned or, where tissue is viscous, the step is another, and for the
/// first of a state from [`State::at_rest`], which makes room for its multipliers.
#[derive(Clone, Debug)]
pub struct Solver<S> {
    settings: SolverSettings,
    plan: Plan,
    layout: Arc<Layout<S>>,
    memory: cpu::Memory<S>,
}

/// Substeps of a frame [s] of the quasi-Newton method, whatever computes them.
pub(crate) fn substeps_of_solves(
    settings: &SolverSettings,
    oscillations: &Oscillations,
    frame: f64,
) -> u32 {
    match settings.substeps {
        Count::Auto => quasi_newton::substeps_for(oscillations, frame, settings.accuracy.share()),
        Count::Of(count) => count,
    }
}

impl<S: Real> Solver<S> {
    /// Plans the steps and takes the memory for them. `method = "auto"` is the quasi-Newton method here: a solver alone
    /// knows neither frame nor fixings.
    pub fn new(model: &Model<S>, settings: &SolverSettings) -> Self {
        let settings = settings.of_solver();
        let layout = Layout::new(model, &settings);
        Self {
            plan: Plan::new(&layout, &settings),
            memory: cpu::Memory::new(&layout, &settings),
            layout: Arc::new(layout),
            settings,
        }
    }

    /// The settings in force.
    pub fn settings(&self) -> &SolverSettings {
        &self.settings
    }

    /// The model as this solver works on it.
    pub fn layout(&self) -> &Layout<S> {
        &self.layout
    }

    /// The model at rest, with all the memory that a state needs: [`State::at_rest`] leaves room for multipliers to the
    /// first step.
    pub fn state_at_rest(&self) -> State<S> {
        State {
            positions: self.layout.rest_positions.clone(),
            velocities: vec![Vec3::ZERO; self.layout.vertex_count()],
            multipliers: vec![S::ZERO; self.layout.multiplier_count],
            multiplier_dt: 0.0,
            learned: self.memory.nothing_learned(&self.layout),
            contact: ContactState::default(),
        }
    }

    /// The stages of a step.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Advances the state by one step of `dt` [s].
    ///
    /// On an error nothing has moved. A frame of a scene is `substeps` such steps.
    pub fn step(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.step_first(usize::MAX, model, state, inputs, dt)
    }

    /// Moves the tools of the inputs that springs hold for a step of `dt` [s]: before [`Solver::step`], once a step;
    /// [`Solver::steps`] does so by itself. See [`crate::contact::held`].
    pub fn lead(
        &self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &mut Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.check(model, state, inputs, dt)?;
        held::lead(&self.layout, &mut state.contact, &mut inputs.tools, dt);
        Ok(())
    }

    /// As `count` calls of [`Solver::lead`] and [`Solver::step`], to the bit; `act` gets the number of each step, from 1 on, and puts what acts
    /// in it into the inputs. The state is brought into the solver's order and back once. Where a step fails the state is
    /// that of the step before it.
    pub fn steps(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &mut Inputs<S>,
        dt: f64,
        count: u32,
        mut act: impl FnMut(u32, &mut Inputs<S>),
    ) -> Result<(), StepError> {
        for number in 1..=count {
            act(number, inputs);
            let checked = self.lead(model, state, inputs, dt);
            let Self { settings, plan, layout, memory } = self;
            let small_steps = checked.and_then(|()| memory.repeats(layout, inputs, dt));
            let step = Step { layout, inputs, dt, settings };
            let small_steps = match small_steps {
                Ok(small_steps) => small_steps,
                Err(error) => {
                    // Before the first there is nothing to give back.
                    if number > 1 {
                        carry_out(Task::Write, memory, &step, state);
                    }
                    return Err(error);
                }
            };
            state.multipliers.resize(layout.multiplier_count, S::ZERO);
            let within = Within { is_first: number == 1, is_last: number == count };
            carry_out(Task::Within(plan, small_steps, within), memory, &step, state);
        }
        Ok(())
    }

    /// As [`Solver::step`]; shows the positions [m] of all vertices, the user's order, where the iteration
    /// starts (0) and after each iteration: for plots of convergence. What ends the step, such as its
    /// guard, comes after the last. Takes memory for the positions. An explicit method, which has no
    /// iterations, is watched after each of its small steps.
    pub fn step_watched(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
        mut watch: impl FnMut(u32, &[Vec3<f64>]) + Send,
    ) -> Result<(), StepError> {
        self.check(model, state, inputs, dt)?;
        let Self { settings, plan, layout, memory } = self;
        let small_steps = memory.repeats(layout, inputs, dt)?;
        state.multipliers.resize(layout.multiplier_count, S::ZERO);
        let step = Step { layout, inputs, dt, settings };
        carry_out(Task::Watched(plan, small_steps, &mut watch), memory, &step, state);
        Ok(())
    }

    /// Iterations of the steps to come, at least one; neither stages nor memory depend on them.
    pub fn set_iterations(&mut self, count: u32) {
        self.settings.iterations = Count::Of(count.max(1));
        self.plan.set_iterations(&self.layout, &self.settings);
    }

    /// As [`Solver::step`], the first so many stages of it.
    fn step_first(
        &mut self,
        count: usize,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.check(model, state, inputs, dt)?;
        let Self { settings, plan, layout, memory } = self;
        let small_steps = memory.repeats(layout, inputs, dt)?;
        state.multipliers.resize(layout.multiplier_count, S::ZERO);
        let step = Step { layout, inputs, dt, settings };
        carry_out(Task::Step(plan, small_steps, count), memory, &step, state);
        Ok(())
    }

    /// Starts a new history, for a caller who has put vertices elsewhere in `state.positions`: the
    /// multipliers no longer tell where the body comes from, but what its elements answer to the
    /// places the vertices are at now. Positions and velocities stay as they are.
    ///
    /// `inputs` and `dt` are those of the next step; of the inputs the anchors matter.
    pub fn restart(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.check(model, state, inputs, dt)?;
        state.multipliers.resize(self.layout.multiplier_count, S::ZERO);
        let step = Step { layout: &self.layout, inputs, dt, settings: &self.settings };
        carry_out(Task::Restart, &mut self.memory, &step, state);
        Ok(())
    }

    fn check(
        &self,
        model: &Model<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        check_settings(&self.settings)?;
        let meets = !inputs.tools.is_empty() || model.ties_bodies();
        if meets && !self.settings.takes_contact() {
            return Err(StepError::ContactNeedsRebase);
        }
        check_model(&self.layout, model)?;
        check_step(dt, &self.layout, inputs)?;
        check_state(&self.layout, state)?;
        Ok(())
    }

    /// Works with these instructions from now on, or with what the processor has of them. The bits of
    /// all results are the same; this is for tests of that, and for measurements.
    pub fn use_instructions(&mut self, instructions: Instructions) {
        self.memory.data.constants.workers.instructions = instructions.or_detect();
    }

    /// The instructions that kernels are run with.
    pub fn instructions(&self) -> Instructions {
        self.memory.data.constants.workers.instructions
    }

    /// The largest small step [s] of the explicit method in the stiffest part of the model, its margin
    /// included; infinite for others.
    pub fn stable_step(&self) -> f64 {
        self.memory.stable_step()
    }

    /// The oscillations about the rest shape of what these inputs hold, as far as a load in proportion to mass excites
    /// them; none for methods that need not know them. Forgets the last step.
    pub fn oscillations(&mut self, inputs: &Inputs<S>) -> Oscillations {
        let Self { settings, layout, memory, .. } = self;
        let step = Step { layout, inputs, dt: 1.0, settings };
        cpu::precision::oscillations(memory, &step)
    }

    /// Substeps of a frame [s] in which these inputs hold the model: as many as the settings ask for; where they leave it
    /// to the quasi-Newton method, as oscillations ask for. Forgets the last step.
    pub fn substeps(&mut self, inputs: &Inputs<S>, frame: f64) -> u32 {
        let oscillations = self.oscillations(inputs);
        self.substeps_for(&oscillations, frame)
    }

    /// As [`Solver::substeps`], of oscillations that are known.
    pub fn substeps_for(&self, oscillations: &Oscillations, frame: f64) -> u32 {
        match (self.settings.substeps, self.settings.method) {
            (_, Method::QuasiNewton) => substeps_of_solves(&self.settings, oscillations, frame),
            (Count::Auto, Method::Explicit) => explicit::substeps_for(self.stable_step(), frame),
            _ => self.settings.substeps(),
        }
    }

    /// How many times as many steps a frame [s] needs that would have `count` of them, so that tissue does not come closer to
    /// tissue by more than two thicknesses of contact in one. `inputs` are those of the frame's end.
    pub(crate) fn times_for_contact(
        &mut self,
        state: &State<S>,
        inputs: &Inputs<S>,
        frame: f64,
        count: u32,
    ) -> u32 {
        let Self { layout, memory, .. } = self;
        let Some(skin) = &layout.skin else { return 1 };
        let free = MOST_APPROACHED * skin.contact.law.thickness * f64::from(count);
        let data = &mut memory.data;
        data.read_positions(layout, &state.positions);
        for (velocity, &user) in data.velocities.iter_mut().zip(&layout.numbering.order) {
            *velocity = state.velocities[user as usize];
        }
        let of_frame = ContactStep { layout, tools: &[], pins: &inputs.pins, dt: frame };
        let places = (of_frame.places(&data.points), &data.velocities[..]);
        let StepConstants { contacts, workers, .. } = &mut data.constants;
        let entrance = workers.entrance();
        let way = entrance.enter(|| contacts.pairs.approach(&of_frame, places, free, workers));
        (way / free).min(MOST_DIVIDED).ceil().max(1.0) as u32
    }

    /// Force and torque between each tool of the last step and what it touches, at the end of that step; in the order of
    /// [`Inputs::tools`]. Empty before the first step.
    pub fn wrenches(&self) -> &[Wrench] {
        &self.memory.data.constants.contacts.wrenches
    }

    /// What tools have put into tissue since the solver was built; nothing where steps are not guarded.
    pub fn ledger(&self) -> Ledger {
        self.memory.ledger()
    }

    /// Bytes of the memory taken, model and state not included.
    pub fn bytes(&self) -> usize {
        self.layout.bytes() + self.memory.bytes()
    }

    /// How many threads a step is done by.
    pub fn thread_count(&self) -> usize {
        self.memory.data.constants.workers.count()
    }

    /// How many steps have been rejected for at least one connected part of the model since the solver was
    /// built.
    pub fn rejected_steps(&self) -> u64 {
        self.memory.rejected_steps()
    }

    /// How the last step ended, for all parts of the model together; nothing before the first, and where
    /// steps are not guarded.
    pub fn last_step(&self) -> Option<StepReport> {
        StepReport::of_all(self.part_reports())
    }

    /// How the last step ended for each connected part of the model, see [`Model::part_of`]; empty before the
    /// first, and where steps are not guarded.
    pub fn part_reports(&self) -> &[StepReport] {
        self.memory.part_reports()
    }

    /// The force balance at the end of the last step, see [`balance::ForceBalance`]. `inputs` are
    /// those of that step.
    pub fn force_balance(
        &mut self,
        model: &Model<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        balance: &mut balance::ForceBalance,
    ) -> Result<(), StepError> {
        check_model(&self.layout, model)?;
        check_state(&self.layout, state)?;
        check_inputs(&self.layout, inputs)?;
        balance.measure(&self.layout, state, inputs, &mut self.memory.data.end_of_step());
        Ok(())
    }
}
