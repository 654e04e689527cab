//! Simulations on a device of the caller's.

use super::device::Backend;
use super::error::SimulationError;
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
}

impl Simulation<f32> {
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
