//! What computes the steps of a simulation: the CPU, or a graphics processor with the CPU behind it.

use std::fmt::Debug;

use super::FrameError;
use crate::model::{Model, ModelError};
use crate::scalar::{Real, Vec3};
use crate::settings::DeviceRequest;
#[cfg(feature = "gpu")]
use crate::settings::Method;
#[cfg(feature = "gpu")]
use crate::solver::gpu::{GpuError, GpuSolver};
use crate::solver::{Inputs, Solver};
use crate::state::State;

/// Why a simulation cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// Its bodies make no model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A device was asked for that this build knows nothing of.
    #[error(
        "`device = \"{device}\"` needs the GPU backend, which was left out of this build; build with \
         `--features gpu`, or use `device = \"cpu\"`"
    )]
    NoGpuBackend {
        /// What was asked for.
        device: DeviceRequest,
    },
    /// The device cannot do it.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

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

    /// What the settings ask for, for steps of `dt` [s].
    #[cfg(feature = "gpu")]
    pub fn choose(model: &Model<S>, solver: &Solver<S>, dt: f64) -> Result<Self, SimulationError> {
        let settings = solver.settings();
        let sweeps = match settings.method {
            Method::Xpbd => settings.iterations,
            Method::Explicit => (dt / solver.stable_step()).ceil() as u32,
        };
        match settings.device {
            DeviceRequest::Cpu => Ok(Self::cpu("as asked for")),
            _ => super::gpu::choose(model, settings, sweeps),
        }
    }

    /// What the settings ask for.
    #[cfg(not(feature = "gpu"))]
    pub fn choose(_: &Model<S>, solver: &Solver<S>, _: f64) -> Result<Self, SimulationError> {
        match &solver.settings().device {
            DeviceRequest::Cpu => Ok(Self::cpu("as asked for")),
            DeviceRequest::Auto => Ok(Self::cpu("the GPU backend was left out of this build")),
            device => Err(SimulationError::NoGpuBackend { device: device.clone() }),
        }
    }

    /// For another model: on the device at hand, or, where the settings ask for another one, chosen anew.
    pub fn renew(
        &self,
        same_device: bool,
        model: &Model<S>,
        solver: &Solver<S>,
        dt: f64,
    ) -> Result<Self, SimulationError> {
        #[cfg(feature = "gpu")]
        if same_device && let Some(again) = super::gpu::again(self, model, solver.settings()) {
            return again;
        }
        let warning = self.warning.clone().filter(|_| same_device);
        match warning {
            // A device that was lost is not tried again before somebody asks for it.
            Some(warning) => {
                let cpu = Self::cpu(&warning);
                Ok(Self { warning: Some(warning), ..cpu })
            }
            None => Self::choose(model, solver, dt),
        }
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
