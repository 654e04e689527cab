//! Positions of a frame that stay on the device, for pictures.

use std::sync::Arc;

use super::device::Device;
use super::solver::GpuSolver;
use crate::layout::Layout;

/// Positions at the end of a step, kept on the device that computed them, in the order of its solver: for a picture of that
/// moment while the solver goes on.
#[derive(Clone, Debug)]
pub struct DevicePositions {
    pub(super) device: Device,
    pub(super) buffer: wgpu::Buffer,
    pub(super) layout: Arc<Layout<f32>>,
}

impl DevicePositions {
    /// The device that they are on.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Whether both are of one solver, whose vertices lie in one order.
    pub(super) fn is_of(&self, layout: &Arc<Layout<f32>>) -> bool {
        Arc::ptr_eq(&self.layout, layout)
    }
}

impl GpuSolver {
    /// Copies positions at the end of the last step from the device to the device: one small submission, no waiting. `kept`:
    /// an earlier copy that is no longer needed, whose memory is used again where it fits.
    pub fn copy_positions(&self, kept: Option<DevicePositions>) -> DevicePositions {
        let size = self.buffers.points_size;
        let fits = |old: &DevicePositions| old.is_of(&self.layout) && old.buffer.size() == size;
        let copy = kept.filter(fits).unwrap_or_else(|| DevicePositions {
            buffer: self.device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("positions of a frame"),
                size,
                usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            device: self.device.clone(),
            layout: Arc::clone(&self.layout),
        });
        let mut encoder = self.encoder("positions of a frame");
        encoder.copy_buffer_to_buffer(self.positions(), 0, &copy.buffer, 0, size);
        self.device.queue.submit([encoder.finish()]);
        copy
    }
}
