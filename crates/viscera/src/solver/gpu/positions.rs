//! Positions of a frame that stay on the device, for pictures.

use std::sync::Arc;

use super::device::Device;
use super::shown::{SHOWS_VALUES, TissueValue};
use super::solver::GpuSolver;
use crate::layout::Layout;

/// Positions at the end of a step, kept on the device that computed them, in the order of its solver: for a picture of that
/// moment while the solver goes on.
#[derive(Clone, Debug)]
pub struct DevicePositions {
    pub(super) device: Device,
    pub(super) buffer: wgpu::Buffer,
    pub(super) layout: Arc<Layout<f32>>,
    pub(super) value: Option<TissueValue>,
}

impl DevicePositions {
    /// The device that they are on.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// The values that came with them.
    pub fn value(&self) -> Option<TissueValue> {
        self.value
    }

    /// Whether both are of one solver, whose vertices lie in one order.
    pub(super) fn is_of(&self, layout: &Arc<Layout<f32>>) -> bool {
        Arc::ptr_eq(&self.layout, layout)
    }
}

impl GpuSolver {
    /// Copies positions at the end of the last step from the device to the device: one small submission, no waiting. `kept`:
    /// an earlier copy that is no longer needed, whose memory is used again where it fits. `value`: what a picture shows by
    /// colours, [`GpuSurface::show_values`](super::GpuSurface::show_values); left out where [`GpuSolver::shows`] is false.
    pub fn copy_positions(
        &self,
        kept: Option<DevicePositions>,
        value: Option<TissueValue>,
    ) -> DevicePositions {
        let value = value.filter(|&value| self.shows(value));
        let size = self.buffers.points_size;
        let fits = |old: &DevicePositions| old.is_of(&self.layout) && old.buffer.size() == size;
        let usage = wgpu::BufferUsages::COPY_SRC
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::STORAGE;
        let copy = kept.filter(fits).unwrap_or_else(|| DevicePositions {
            buffer: self.device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("positions of a frame"),
                size,
                usage,
                mapped_at_creation: false,
            }),
            device: self.device.clone(),
            layout: Arc::clone(&self.layout),
            value,
        });
        let mut encoder = self.encoder("positions of a frame");
        encoder.copy_buffer_to_buffer(self.positions(), 0, &copy.buffer, 0, size);
        if SHOWS_VALUES && let Some(value) = value {
            self.record_values(&mut encoder, value, &copy.buffer);
        }
        self.device.queue.submit([encoder.finish()]);
        DevicePositions { value, ..copy }
    }
}
