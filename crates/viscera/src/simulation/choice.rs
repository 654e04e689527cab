//! The choice of what computes the steps.

use super::device::Backend;
use super::error::SimulationError;
#[cfg(feature = "gpu")]
use super::gpu;
use crate::model::Model;
use crate::scalar::Real;
use crate::settings::{DeviceRequest, SolverSettings};
#[cfg(feature = "gpu")]
use crate::settings::{Elements, Method};
use crate::solver::Solver;

impl<S: Real> Backend<S> {
    /// What the settings ask for.
    pub fn choose(model: &Model<S>, settings: &SolverSettings) -> Result<Self, SimulationError> {
        if settings.device == DeviceRequest::Cpu {
            return Ok(Self::cpu(Solver::new(model, settings), "as asked for"));
        }
        #[cfg(feature = "gpu")]
        return gpu::choose(model, settings);
        #[cfg(not(feature = "gpu"))]
        match &settings.device {
            DeviceRequest::Auto => {
                let reason = "the GPU backend was left out of this build";
                Ok(Self::cpu(Solver::new(model, settings), reason))
            }
            device => Err(SimulationError::NoGpuBackend { device: device.clone() }),
        }
    }

    /// For another model: on the device at hand, or, where the settings ask for another one, chosen anew.
    pub fn renew(
        &self,
        same_device: bool,
        model: &Model<S>,
        settings: &SolverSettings,
    ) -> Result<Self, SimulationError> {
        // A method that only the CPU computes leaves its device.
        #[cfg(feature = "gpu")]
        if same_device
            && settings.method != Method::QuasiNewton
            && settings.elements == Elements::Plain
            && let Some(again) = gpu::again(self, model, settings)
        {
            return match again {
                Err(lost) if self.gives_way => {
                    let warning = format!("{lost}; the CPU went on from there");
                    let cpu = Self::cpu(Solver::new(model, settings), &warning);
                    Ok(Self { warning: Some(warning), ..cpu })
                }
                again => again,
            };
        }
        let warning = self.warning.clone().filter(|_| same_device);
        let mut backend = match warning {
            // A device that was lost is not tried again before somebody asks for it.
            Some(warning) => {
                let cpu = Self::cpu(Solver::new(model, settings), &warning);
                Self { warning: Some(warning), ..cpu }
            }
            None => Self::choose(model, settings)?,
        };
        if let Some(instructions) = self.instructions() {
            backend.use_instructions(instructions);
        }
        Ok(backend)
    }
}
