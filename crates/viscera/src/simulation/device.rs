//! What computes the steps of a simulation: the CPU, or a graphics processor with the CPU behind it.

use std::fmt::Debug;

use super::error::FrameError;
use crate::model::Model;
use crate::scalar::{Real, Vec3};
#[cfg(feature = "gpu")]
use crate::solver::gpu::GpuSolver;
use crate::solver::{Inputs, Solver};
use crate::state::State;

/// Steps elsewhere than on the CPU, told to a simulation of any precision.
pub(super) trait Elsewhere<S>: Debug + Send {
    fn step(&mut self, model: &Model<S>, inputs: &Inputs<S>, dt: f64) -> Result<(), FrameError>;

    /// The state, and what a force balance needs, after the last step. On an error nothing is changed.
    fn read(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        solver: &mut Solver<S>,
    ) -> Result<(), FrameError>;

    /// Puts a state that fits the model in the place of the device's.
    fn write(&mut self, model: &Model<S>, state: &State<S>);

    fn write_velocities(&mut self, model: &Model<S>, velocities: &[Vec3<S>]);

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
}

impl<S: Real> Backend<S> {
    /// The CPU, for a reason.
    pub fn cpu(reason: impl std::fmt::Display) -> Self {
        let choice = format!("CPU: {reason}");
        Self { elsewhere: None, choice, warning: None, gives_way: false }
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

    /// Goes on with the CPU.
    pub fn give_way(&mut self, time: f64, reason: &FrameError) {
        let warning = format!("after {time:.4} s {reason}; the CPU went on from there");
        *self = Self { warning: Some(warning.clone()), ..Self::cpu(warning) };
    }
}
