//! The choice of what computes the steps.

use super::device::{Backend, Offered};
use super::error::SimulationError;
#[cfg(feature = "gpu")]
use super::gpu;
use crate::model::Model;
use crate::scalar::Real;
#[cfg(feature = "gpu")]
use crate::settings::Elements;
use crate::settings::{DeviceRequest, Method, SolverSettings};
use crate::solver::Solver;
#[cfg(feature = "gpu")]
use crate::solver::gpu::HAS_SOLVES;

impl<S: Real> Backend<S> {
    /// What the settings ask for; `ready` is a solver of the CPU of these settings, where there is one already.
    pub fn choose(
        model: &Model<S>,
        settings: &SolverSettings,
        ready: Option<Solver<S>>,
        offered: &Offered,
    ) -> Result<Self, SimulationError> {
        let mut chosen = Self::chosen(model, settings, ready, offered)?;
        let takes_contact = match chosen.device() {
            None => settings.takes_contact(),
            Some(_) => settings.chosen_on_device().meets_on_device(),
        };
        if model.meets_itself() && !takes_contact {
            chosen.choice.push_str("; a body that folds passes through itself");
        }
        Ok(chosen)
    }

    fn chosen(
        model: &Model<S>,
        settings: &SolverSettings,
        ready: Option<Solver<S>>,
        offered: &Offered,
    ) -> Result<Self, SimulationError> {
        #[cfg(not(feature = "gpu"))]
        let _ = offered;
        let cpu =
            |reason| Ok(Self::cpu(ready.unwrap_or_else(|| Solver::new(model, settings)), reason));
        match (&settings.device, settings.method) {
            (DeviceRequest::Cpu, _) => cpu("as asked for"),
            // Only scenes with tools have samples of their surfaces.
            (DeviceRequest::Auto, _) if !model.samples.is_empty() => {
                cpu("contact with tools, which no GPU is known to compute faster")
            }
            (DeviceRequest::Auto, _) if model.ties_bodies() => {
                cpu("contact between bodies, which no GPU is known to compute faster")
            }
            (device, _)
                if model.ties_bodies() && !settings.chosen_on_device().meets_on_device() =>
            {
                Err(SimulationError::BodiesOnDevice { device: device.clone() })
            }
            (DeviceRequest::Auto, Method::Auto | Method::QuasiNewton) => {
                cpu("the quasi-Newton method, which no GPU is known to compute faster")
            }
            // A device knows no stiffness but that of the shape at rest.
            (DeviceRequest::Auto, Method::Explicit) => {
                cpu("explicit steps that suit the present shape")
            }
            #[cfg(feature = "gpu")]
            _ => gpu::choose(model, settings, offered.device.as_ref()),
            #[cfg(not(feature = "gpu"))]
            (DeviceRequest::Auto, Method::Xpbd) => {
                cpu("the GPU backend was left out of this build")
            }
            #[cfg(not(feature = "gpu"))]
            (device, _) => Err(SimulationError::NoGpuBackend { device: device.clone() }),
        }
    }

    /// For another model: on the device at hand, or, where the settings ask for another one, chosen anew.
    pub fn renew(
        &self,
        same_device: bool,
        model: &Model<S>,
        settings: &SolverSettings,
        ready: Option<Solver<S>>,
        offered: &Offered,
    ) -> Result<Self, SimulationError> {
        // In light builds a method, and elements, that only the CPU computes leave their device.
        #[cfg(feature = "gpu")]
        let solves = settings.method == Method::QuasiNewton;
        #[cfg(feature = "gpu")]
        if same_device
            && (HAS_SOLVES || (!solves && settings.elements != Elements::Recovered))
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
                let solver = ready.unwrap_or_else(|| Solver::new(model, settings));
                Self { warning: Some(warning.clone()), ..Self::cpu(solver, warning) }
            }
            None => Self::choose(model, settings, ready, offered)?,
        };
        if let Some(instructions) = self.instructions() {
            backend.use_instructions(instructions);
        }
        Ok(backend)
    }
}
