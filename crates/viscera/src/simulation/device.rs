//! What computes the steps of a simulation: the CPU, or a graphics processor.

use std::fmt::Debug;

use super::error::FrameError;
use crate::contact::Wrench;
use crate::layout::Layout;
use crate::model::Model;
use crate::scalar::lanes::Instructions;
use crate::scalar::{Real, Vec3};
use crate::settings::{Method, SolverSettings};
use crate::solver::balance::ForceBalance;
#[cfg(feature = "gpu")]
use crate::solver::gpu::{Device, GpuSolver};
use crate::solver::oscillations::Oscillations;
use crate::solver::{FrameReading, Inputs, Ledger, Solver, StepError, substeps_of_solves};
use crate::state::{ContactState, State};

/// A solver on a graphics processor, as a simulation of any precision sees it.
pub(super) trait DeviceSolver<S>: Debug + Send {
    fn layout(&self) -> &Layout<S>;

    fn stable_step(&self) -> f64;

    /// See [`Solver::steps`].
    fn steps(
        &mut self,
        model: &Model<S>,
        inputs: &mut Inputs<S>,
        dt: f64,
        count: u32,
        act: &mut dyn FnMut(u32, &mut Inputs<S>),
    ) -> Result<(), FrameError>;

    /// Positions and velocities after the last step; how many steps were rejected so far. On an error nothing
    /// is changed.
    fn read_frame(&mut self, model: &Model<S>, state: &mut State<S>) -> Result<u64, FrameError>;

    /// As [`DeviceSolver::read_frame`], multipliers as well, and nothing else is known then than before.
    fn read(&self, model: &Model<S>, state: &mut State<S>) -> Result<(), FrameError>;

    /// As [`DeviceSolver::read_frame`]; what moves stays there.
    fn read_forces(&mut self) -> Result<u64, FrameError>;

    /// Asks for what [`DeviceSolver::take_frame`] is to hand over of the state behind the last step. Does not wait.
    fn ask_for_frame(&mut self, reading: FrameReading) -> Result<(), FrameError>;

    /// As [`DeviceSolver::read_frame`] of what was asked for; nothing while it is under way.
    fn take_frame(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
    ) -> Result<Option<u64>, FrameError>;

    /// Multipliers after the last step.
    fn multipliers(&self, model: &Model<S>) -> Result<Vec<S>, FrameError>;

    /// Forces on tools after the last step that was read.
    fn wrenches(&self) -> &[Wrench];

    /// What is kept of contact after the last step.
    fn contact(&self, model: &Model<S>, state: &State<S>) -> Result<ContactState, FrameError>;

    /// The force balance of the last step.
    fn force_balance(
        &self,
        model: &Model<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        balance: &mut ForceBalance,
    ) -> Result<(), FrameError>;

    /// Puts a state that fits the model in the place of the device's.
    fn write(&mut self, model: &Model<S>, state: &State<S>);

    fn write_velocities(&mut self, velocities: &[Vec3<S>]);

    /// Multipliers from the places where vertices are.
    fn restart(&mut self, model: &Model<S>, inputs: &Inputs<S>, dt: f64) -> Result<(), StepError>;

    /// Another solver of the same model on the same device, in this state.
    fn second(
        &self,
        model: &Model<S>,
        state: &State<S>,
    ) -> Result<Box<dyn DeviceSolver<S>>, FrameError>;

    /// Goes on from where the other is of which it is the second, while tools touch nothing in either. Does not wait.
    fn follow(&mut self, other: &dyn DeviceSolver<S>);

    #[cfg(feature = "gpu")]
    fn solver(&self) -> &GpuSolver;
}

/// A device that the caller has at hand for settings that ask for one.
#[derive(Clone, Debug, Default)]
pub(super) struct Offered {
    #[cfg(feature = "gpu")]
    pub device: Option<Device>,
}

/// The solver: one of them.
#[derive(Debug)]
pub(super) enum Engine<S> {
    Cpu(Box<Solver<S>>),
    #[cfg_attr(not(feature = "gpu"), allow(dead_code))]
    Device(Box<dyn DeviceSolver<S>>),
}

/// What computes the steps, and why.
#[derive(Debug)]
pub(super) struct Backend<S> {
    pub engine: Engine<S>,
    pub choice: String,
    pub warning: Option<String>,
    /// Whether the CPU goes on where the device is lost.
    pub gives_way: bool,
    /// Steps that the device has rejected, as of the last frame.
    pub rejected: u64,
    /// What was asked for of the frame that is under way.
    pub asked: FrameReading,
}

impl<S: Real> Backend<S> {
    /// The CPU, for a reason.
    pub fn cpu(solver: Solver<S>, reason: impl std::fmt::Display) -> Self {
        let choice = format!("CPU: {reason}");
        Self::new(Engine::Cpu(Box::new(solver)), choice)
    }

    /// A solver, for a reason.
    pub fn new(engine: Engine<S>, choice: String) -> Self {
        let asked = FrameReading::default();
        Self { engine, choice, warning: None, gives_way: false, rejected: 0, asked }
    }

    /// What each part of the last step's tools met; nothing before the first step.
    pub fn wrenches(&self) -> &[Wrench] {
        match &self.engine {
            Engine::Cpu(solver) => solver.wrenches(),
            Engine::Device(device) => device.wrenches(),
        }
    }

    /// See [`Solver::ledger`]; devices keep none.
    pub fn ledger(&self) -> Option<Ledger> {
        match &self.engine {
            Engine::Cpu(solver) => Some(solver.ledger()),
            Engine::Device(_) => None,
        }
    }

    /// The solver on a graphics processor, where that computes.
    pub fn device(&self) -> Option<&dyn DeviceSolver<S>> {
        match &self.engine {
            Engine::Cpu(_) => None,
            Engine::Device(device) => Some(&**device),
        }
    }

    /// As [`Backend::device`].
    pub fn device_mut(&mut self) -> Option<&mut (dyn DeviceSolver<S> + 'static)> {
        match &mut self.engine {
            Engine::Cpu(_) => None,
            Engine::Device(device) => Some(&mut **device),
        }
    }

    /// How many times as many substeps than `count` a frame [s] needs, of which these are the inputs at the end, so that
    /// tissue does not pass through tissue.
    pub fn times_for_contact(
        &mut self,
        state: &State<S>,
        inputs: &Inputs<S>,
        (frame, count): (f64, u32),
    ) -> u32 {
        match &mut self.engine {
            Engine::Cpu(solver) => solver.times_for_contact(state, inputs, frame, count),
            Engine::Device(_) => 1,
        }
    }

    pub fn layout(&self) -> &Layout<S> {
        match &self.engine {
            Engine::Cpu(solver) => solver.layout(),
            Engine::Device(device) => device.layout(),
        }
    }

    pub fn stable_step(&self) -> f64 {
        match &self.engine {
            Engine::Cpu(solver) => solver.stable_step(),
            Engine::Device(device) => device.stable_step(),
        }
    }

    /// The oscillations, where they had to be known, and the substeps of a frame [s]: see [`Solver::oscillations`] and
    /// [`Solver::substeps`]. `measured`: the same oscillations, found without this backend.
    pub fn substeps(
        &mut self,
        inputs: &Inputs<S>,
        settings: &SolverSettings,
        known: Option<Oscillations>,
        frame: f64,
        measured: impl FnOnce() -> Oscillations,
    ) -> (Option<Oscillations>, u32) {
        match &mut self.engine {
            Engine::Cpu(solver) if settings.method == Method::QuasiNewton => {
                let oscillations = known.unwrap_or_else(|| solver.oscillations(inputs));
                let substeps = solver.substeps_for(&oscillations, frame);
                (Some(oscillations), substeps)
            }
            Engine::Cpu(solver) => (known, solver.substeps_for(&Oscillations::default(), frame)),
            Engine::Device(_) if settings.method == Method::QuasiNewton => {
                let oscillations = known.unwrap_or_else(measured);
                let substeps = substeps_of_solves(settings, &oscillations, frame);
                (Some(oscillations), substeps)
            }
            Engine::Device(_) => (known, settings.substeps()),
        }
    }

    /// The instructions that the CPU works with, where it computes.
    pub fn instructions(&self) -> Option<Instructions> {
        match &self.engine {
            Engine::Cpu(solver) => Some(solver.instructions()),
            Engine::Device(_) => None,
        }
    }

    /// See [`Solver::use_instructions`].
    pub fn use_instructions(&mut self, instructions: Instructions) {
        if let Engine::Cpu(solver) = &mut self.engine {
            solver.use_instructions(instructions);
        }
    }

    /// See [`Solver::steps`].
    pub fn steps(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &mut Inputs<S>,
        dt: f64,
        count: u32,
        mut act: impl FnMut(u32, &mut Inputs<S>),
    ) -> Result<(), FrameError> {
        match &mut self.engine {
            Engine::Cpu(solver) => Ok(solver.steps(model, state, inputs, dt, count, act)?),
            Engine::Device(device) => device.steps(model, inputs, dt, count, &mut act),
        }
    }

    /// What is asked for of the state after the last step, where it is not there yet.
    pub fn read_frame(
        &mut self,
        reading: FrameReading,
        model: &Model<S>,
        state: &mut State<S>,
    ) -> Result<(), FrameError> {
        if let Engine::Device(device) = &mut self.engine {
            self.rejected = match reading {
                FrameReading::Forces => device.read_forces()?,
                FrameReading::State | FrameReading::Balance => device.read_frame(model, state)?,
            };
        }
        Ok(())
    }

    /// Asks for the results of the last step, without waiting; where the CPU computes they are there.
    pub fn ask_for_frame(&mut self, reading: FrameReading) -> Result<(), FrameError> {
        self.asked = reading;
        self.device_mut().map_or(Ok(()), |device| device.ask_for_frame(reading))
    }

    /// Takes over what was asked for; false while it is under way.
    pub fn take_frame(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
    ) -> Result<bool, FrameError> {
        let Engine::Device(device) = &mut self.engine else { return Ok(true) };
        let taken = device.take_frame(model, state)?;
        self.rejected = taken.unwrap_or(self.rejected);
        Ok(taken.is_some())
    }

    /// The force balance of the last step.
    pub fn force_balance(
        &mut self,
        model: &Model<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        balance: &mut ForceBalance,
    ) -> Result<(), FrameError> {
        match &mut self.engine {
            Engine::Cpu(solver) => Ok(solver.force_balance(model, state, inputs, balance)?),
            Engine::Device(device) => device.force_balance(model, state, inputs, balance),
        }
    }

    /// Goes on from a state with the tissue's answer to where it is.
    pub fn restart(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        match &mut self.engine {
            Engine::Cpu(solver) => solver.restart(model, state, inputs, dt),
            Engine::Device(device) => {
                device.write(model, state);
                device.restart(model, inputs, dt)
            }
        }
    }

    /// Steps that have been rejected so far.
    pub fn rejected_steps(&self) -> u64 {
        match &self.engine {
            Engine::Cpu(solver) => solver.rejected_steps(),
            Engine::Device(_) => self.rejected,
        }
    }

    /// Whether the last step met energies that are not finite; of a device only positions tell that.
    pub fn is_beyond_numbers(&self) -> bool {
        match &self.engine {
            Engine::Cpu(solver) => {
                solver.part_reports().iter().any(|report| !report.potential.is_finite())
            }
            Engine::Device(_) => false,
        }
    }

    /// Whether the CPU goes on after an error: what a step refuses it would refuse as well.
    pub fn gives_way_after(&self, error: &FrameError) -> bool {
        self.gives_way && !matches!(error, FrameError::Step(_) | FrameError::Diverged { .. })
    }

    /// Goes on with the CPU.
    pub fn give_way(
        &mut self,
        model: &Model<S>,
        settings: &SolverSettings,
        time: f64,
        reason: &FrameError,
    ) {
        let warning = format!("after {time:.4} s {reason}; the CPU went on from there");
        let solver = Solver::new(model, settings);
        *self = Self { warning: Some(warning.clone()), ..Self::cpu(solver, warning) };
    }
}
