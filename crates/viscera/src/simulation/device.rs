//! What computes the steps of a simulation: the CPU, or a graphics processor with the CPU behind it.

use std::fmt::Debug;

use super::error::FrameError;
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use crate::solver::balance::ForceBalance;
#[cfg(feature = "gpu")]
use crate::solver::gpu::GpuSolver;
use crate::solver::{Inputs, Solver};
use crate::state::State;

/// Steps elsewhere than on the CPU, told to a simulation of any precision.
pub(super) trait Elsewhere<S>: Debug + Send {
    fn step(&mut self, model: &Model<S>, inputs: &Inputs<S>, dt: f64) -> Result<(), FrameError>;

    /// Positions and velocities after the last step; how many steps were rejected so far. On an error nothing
    /// is changed.
    fn read_frame(&mut self, model: &Model<S>, state: &mut State<S>) -> Result<u64, FrameError>;

    /// Multipliers after the last step.
    fn multipliers(&self, model: &Model<S>) -> Result<Vec<S>, FrameError>;

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

    #[cfg(feature = "gpu")]
    fn solver(&self) -> &GpuSolver;
}

/// What computes the steps, and why.
#[derive(Debug)]
pub(super) struct Backend<S> {
    pub elsewhere: Option<Box<dyn Elsewhere<S>>>,
    pub choice: String,
    pub warning: Option<String>,
    /// Whether the CPU goes on where the device is lost.
    pub gives_way: bool,
    /// Steps that the device has rejected, as of the last frame.
    pub rejected: u64,
}

impl<S: Real> Backend<S> {
    /// The CPU, for a reason.
    pub fn cpu(reason: impl std::fmt::Display) -> Self {
        let choice = format!("CPU: {reason}");
        Self { elsewhere: None, choice, warning: None, gives_way: false, rejected: 0 }
    }

    /// Advances by one step of `dt` [s].
    pub fn step(
        &mut self,
        solver: &mut Solver<S>,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), FrameError> {
        match &mut self.elsewhere {
            Some(elsewhere) => elsewhere.step(model, inputs, dt),
            None => Ok(solver.step(model, state, inputs, dt)?),
        }
    }

    /// Steps that have been rejected so far.
    pub fn rejected_steps(&self, solver: &Solver<S>) -> u64 {
        if self.elsewhere.is_some() { self.rejected } else { solver.rejected_steps() }
    }

    /// Goes on with the CPU.
    pub fn give_way(&mut self, time: f64, reason: &FrameError) {
        let warning = format!("after {time:.4} s {reason}; the CPU went on from there");
        *self = Self { warning: Some(warning.clone()), ..Self::cpu(warning) };
    }
}
