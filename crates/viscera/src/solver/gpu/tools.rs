//! Tools of a device's steps, as the host knows them.

use super::buffers::Buffers;
use super::slots::Slot;
use crate::contact::Wrench;
use crate::layout::Layout;
use crate::solver::step::contacts::on_device::{DeviceTools, IS_THERE};
use crate::state::ContactState;

/// Tools on a device.
#[derive(Default)]
pub(super) struct OfTools {
    pub all: DeviceTools,
    /// At the end of the last step that was read.
    pub wrenches: Vec<Wrench>,
}

impl OfTools {
    /// Poses, and `into` a device that computes contact what a state has kept of samples.
    pub fn put(
        &mut self,
        into: Option<(&Buffers, &wgpu::Queue)>,
        layout: &Layout<f32>,
        contact: &ContactState,
    ) {
        let Some((buffers, queue)) = into.filter(|_| IS_THERE) else { return };
        self.all.put(contact);
        self.wrenches.clear();
        let rows = DeviceTools::rows(layout, &contact.touches);
        buffers.write(queue, Slot::Contact, bytemuck::cast_slice(&rows));
    }
}
