//! Contact with tools on the device: what the host sends of them, and takes back.

use std::mem::offset_of;

use super::error::GpuError;
use super::reading::read;
use super::slots::Slot;
use super::solver::GpuSolver;
use crate::contact::{Tool, Wrench, beyond_devices};
use crate::model::Model;
use crate::scalar::vec3;
use crate::solver::error::StepError;
use crate::solver::step::contacts::on_device::{
    DeviceTools, GRID_ROW, IS_THERE, Samples, SentTools, ToolRecords,
};
use crate::state::{ContactState, State};

/// Of tools of closed surfaces that are too large for the cells of their grid.
const TOO_FINE: &str =
    "distances of the tools' surfaces do not fit; use a thicker contact, whose cells are larger";

/// Why a device cannot compute contact with these tools.
fn refuses(tools: &[Tool]) -> Option<&'static str> {
    if !IS_THERE {
        return Some("contact with tools was left out of this build; use `device = \"auto\"`");
    }
    beyond_devices(tools.iter().map(|tool| tool.held.is_some()))
}

impl GpuSolver {
    /// Samples of the surface, where contact is computed: known to be none where no kernels are.
    #[inline]
    pub(super) fn samples(&self) -> Option<Samples> {
        Samples::known(self.samples)
    }

    /// Forces on the tools at the end of the last step that was read by [`GpuSolver::read_frame`] or what is like it; empty
    /// before.
    pub fn wrenches(&self) -> &[Wrench] {
        &self.tools.wrenches
    }

    /// Bytes that are read of the tools of the last step.
    pub(super) fn of_tools(&self) -> u64 {
        self.samples().map_or(0, |_| self.tools.all.bytes_of_sums())
    }

    /// Asks for the forces on the tools at the end of the last step, and for nothing else: 64 bytes of each. Returns the
    /// request's number, or nothing while three others are under way, and where there are none. Does not wait.
    pub fn request_forces(&mut self) -> Option<u64> {
        let size = Some(self.of_tools()).filter(|size| *size > 0)?;
        let copy = self.forces.take(&self.device)?;
        let [start, _] = self.buffers.span(Slot::ToolSums);
        let mut encoder = self.encoder("forces");
        let sums = self.buffers.buffer(Slot::ToolSums);
        encoder.copy_buffer_to_buffer(sums, start, &copy, 0, size);
        self.device.queue.submit([encoder.finish()]);
        Some(self.forces.send(copy))
    }

    /// The newest forces on the tools that have arrived since the last call, and the request that they answer. Does not wait.
    pub fn newest_forces(&mut self) -> Option<(u64, Vec<Wrench>)> {
        self.samples()?;
        let Self { forces, device, tools, .. } = self;
        forces.newest(device, |number, bytes| {
            (number, tools.all.wrenches(bytemuck::cast_slice(bytes)))
        })
    }

    /// Sends the tools of a step of `dt` [s].
    pub(super) fn send_tools(&mut self, tools: &[Tool], dt: f64) -> Result<(), StepError> {
        if self.samples().is_none() {
            return match tools {
                [] => Ok(()),
                _ => Err(StepError::ContactOnDevice {
                    why: refuses(tools).unwrap_or("there are no samples"),
                }),
            };
        }
        if let Some(why) = refuses(tools) {
            return Err(StepError::ContactOnDevice { why });
        }
        if !tools.is_empty() && !self.settings.takes_contact() {
            return Err(StepError::ContactNeedsRebase);
        }
        // Small steps take place between the poses of a step.
        let share = self.stability.is_none().then(|| self.solve_share());
        if let Some(words) = self.tools.all.new_distances(tools) {
            let rows = words.len() as u64 / u64::from(GRID_ROW);
            if rows > u64::from(self.device.limits().max_texture_dimension_2d) {
                self.tools.all.forget_distances();
                return Err(StepError::ContactOnDevice { why: TOO_FINE });
            }
            self.uniforms.put_distances(&self.device, &words);
        }
        let SentTools { count, motions, kinds } = self.tools.all.begin(tools, dt, share);
        let places = [offset_of!(ToolRecords, all), offset_of!(ToolRecords, kinds)];
        let [motions_at, kinds_at] = places.map(|place| place as u64);
        let into = &self.uniforms.tools;
        self.outgoing.write(into, motions_at, bytemuck::cast_slice(&motions));
        if let Some(kinds) = kinds {
            self.outgoing.write(into, 0, bytemuck::bytes_of(&count));
            self.outgoing.write(into, kinds_at, bytemuck::cast_slice(&kinds));
        }
        Ok(())
    }

    /// Waits for the device and reads what is kept of contact with tools from step to step.
    pub fn contact(
        &self,
        model: &Model<f32>,
        state: &State<f32>,
    ) -> Result<ContactState, GpuError> {
        if !IS_THERE {
            return Ok(ContactState::default());
        }
        let layout = self.layout_of(model)?;
        let poses = self.tools.all.poses().to_vec();
        let mut contact = ContactState { poses, ..ContactState::default() };
        if self.samples().is_some() {
            let user = |v: usize| layout.numbering.order[v] as usize;
            let place =
                |v: usize| state.positions.get(user(v)).copied().unwrap_or(vec3(0.0, 0.0, 0.0));
            read(&self.device, &[self.whole(Slot::Contact)], |read| {
                contact.touches =
                    DeviceTools::touches(&layout, bytemuck::cast_slice(read[0]), place);
            })?;
        }
        Ok(contact)
    }
}
