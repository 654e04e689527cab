//! The choice of what computes the steps.

use super::device::Backend;
use super::error::SimulationError;
#[cfg(feature = "gpu")]
use super::gpu;
use crate::model::Model;
use crate::scalar::Real;
use crate::settings::DeviceRequest;
#[cfg(feature = "gpu")]
use crate::settings::Method;
use crate::solver::Solver;

impl<S: Real> Backend<S> {
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
            _ => gpu::choose(model, solver, sweeps),
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
        if same_device && let Some(again) = gpu::again(self, model, solver.settings()) {
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
}
