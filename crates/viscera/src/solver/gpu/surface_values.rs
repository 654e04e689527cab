//! Values on a surface that follows copies of positions.

use super::error::GpuError;
use super::positions::DevicePositions;
use super::shown::TissueValue;
use super::surface::GpuSurface;
use super::surface_kernels::{POINTS, VALUES, prepare};

impl GpuSurface {
    /// Writes the values that came with positions, at each vertex of the surface, into a buffer of the caller's: two floats each, the
    /// value and one where there is none. Behind [`GpuSurface::place_copy`] of the same positions and [`GpuSurface::update`]; one
    /// submission, no waiting. False where these have no values: nothing is written.
    pub fn show_values(
        &self,
        positions: &DevicePositions,
        into: &wgpu::Buffer,
    ) -> Result<bool, GpuError> {
        let (Some(value), Some([points, rest])) = (positions.value(), self.shown()) else {
            return Ok(false);
        };
        if !self.follows(positions) {
            return Err(GpuError::FollowsSolver);
        }
        let ready = match value {
            TissueValue::Displacement => prepare(
                &self.device,
                "measure_displacements",
                &[(1, &self.bounds), (4, &self.vertices), (5, rest), (VALUES, into)],
            ),
            _ => prepare(
                &self.device,
                "spread_values",
                &[(POINTS, points), (1, &self.bounds), (VALUES, into)],
            ),
        };
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("values of the surface") };
        let mut encoder = self.device.device.create_command_encoder(&descriptor);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("values of the surface"),
            timestamp_writes: None,
        });
        self.each_vertex(&mut pass, &[&ready]);
        drop(pass);
        self.device.queue.submit([encoder.finish()]);
        Ok(true)
    }
}
