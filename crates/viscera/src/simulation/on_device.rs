//! Simulations on a device of the caller's.

use super::device::{Backend, Offered};
use super::error::{LiveError, SimulationError};
use super::gpu::on;
use super::{Assembly, Simulation};
use crate::scalar::Real;
use crate::scene::Scene;
use crate::settings::DeviceRequest;
use crate::solver::gpu::{Device, GpuSolver};

impl<S: Real> Simulation<S> {
    /// The solver on a graphics processor, where one computes the steps.
    pub fn gpu(&self) -> Option<&GpuSolver> {
        self.backend.device().map(|device| device.solver())
    }

    /// Another device for settings that ask for one, or none: the old one may be lost. It goes on from the last frame.
    pub fn offer_device(&mut self, device: Option<Device>) -> Result<(), LiveError> {
        self.offered = Offered { device };
        // What the CPU computes by choice goes on undisturbed.
        if self.is_on_device() || self.device_warning().is_some() {
            self.rebuild_on_device(self.scene().clone(), false)?;
        }
        Ok(())
    }
}

impl Simulation<f32> {
    /// As [`Simulation::new`]; where the settings ask for a graphics processor, or leave the choice and it pays, it is this
    /// one: a page's, which no library can open by itself.
    pub fn with_device(
        scene: Scene,
        assembly: Assembly,
        device: Device,
    ) -> Result<Self, SimulationError> {
        Self::offered(scene, assembly, Offered { device: Some(device) })
    }

    /// A simulation on a device of the caller's, a window's for example, however small the mesh. The
    /// settings say what to do where the device is lost: with `device = "auto"` the CPU goes on.
    pub fn on_device(
        scene: Scene,
        assembly: Assembly,
        device: &Device,
    ) -> Result<Self, SimulationError> {
        Self::on(scene, assembly, true, |model, settings, _| {
            let backend = on(device, model, settings, "the caller's choice")?;
            Ok(Backend { gives_way: settings.device == DeviceRequest::Auto, ..backend })
        })
    }
}
