//! Contact with tools on the device: what the host sends of them, and takes back.

use std::mem::offset_of;

use super::error::GpuError;
use super::reading::read;
use super::slots::Slot;
use super::solver::GpuSolver;
use crate::contact::{Tool, Wrench, beyond_devices};
use crate::layout::Layout;
use crate::model::Model;
use crate::scalar::lanes::Point;
use crate::scalar::vec3;
use crate::solver::error::StepError;
use crate::solver::meetings::{FoundMeeting, told};
use crate::solver::step::contacts::meetings::{self, Meetings};
use crate::solver::step::contacts::on_device::{
    DeviceTools, GRID_ROW, IS_THERE, Samples, SentTools, ToolRecords,
};
use crate::state::{ContactState, State};

/// Of tools of closed surfaces that are too large for the cells of their grid.
const TOO_FINE: &str =
    "distances of the tools' surfaces do not fit; use a thicker contact, whose cells are larger";

/// Of bodies that meet each other, by other methods and in builds that leave it out.
const BODIES_ON_DEVICE: &str = "only the quasi-Newton method computes how bodies meet, and not in pages; use `method = \"quasi_newton\"`";

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

    /// Bodies meet each other where that is computed.
    pub(super) fn check_bodies(&self, model: &Model<f32>) -> Result<(), StepError> {
        match model.ties_bodies() && self.meetings().is_none() {
            true => Err(StepError::ContactOnDevice { why: BODIES_ON_DEVICE }),
            false => Ok(()),
        }
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

    /// What meets tissue, where that is computed: known to be none where no kernels are.
    #[inline]
    pub(super) fn meetings(&self) -> Option<Meetings> {
        Meetings::known(self.meetings)
    }

    /// Bytes that are read of ties, where there are any.
    pub(super) fn of_ties(&self) -> Option<u64> {
        self.meetings().map(|all| 16 * u64::from(all.ties)).filter(|bytes| *bytes > 0)
    }

    /// Puts what a state has kept of tissue that meets tissue onto the device.
    pub(super) fn put_meetings(&self, layout: &Layout<f32>, contact: &ContactState) {
        if self.meetings().is_none() {
            return;
        }
        let put = |slot, rows: Vec<[f32; 4]>| {
            self.buffers.write(&self.device.queue, slot, bytemuck::cast_slice(&rows));
        };
        put(Slot::Meetings, meetings::rows(layout, &contact.pairs));
        put(Slot::Torn, meetings::torn_rows(layout, &contact.torn));
    }

    /// Waits for the device and reads what samples of tissue have met in the last step, which has begun at a state.
    pub fn found(
        &self,
        model: &Model<f32>,
        start: &State<f32>,
    ) -> Result<Vec<FoundMeeting>, GpuError> {
        let layout = self.layout_of(model)?;
        let mut found = Vec::new();
        if self.meetings().is_some() {
            let order = layout.numbering.order.iter();
            let x: Vec<Point<f32>> =
                order.map(|&v| Point::new(start.positions[v as usize], 0.0)).collect();
            read(&self.device, &[self.whole(Slot::Meetings)], |read| {
                let all = meetings::pairs(&layout, bytemuck::cast_slice(read[0]));
                found = told(&layout, &all, &x);
            })?;
        }
        Ok(found)
    }

    /// Waits for the device and reads what is kept of contact from step to step.
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
        if self.meetings().is_some() {
            let ranges = [self.whole(Slot::Meetings), self.whole(Slot::Torn)];
            read(&self.device, &ranges, |read| {
                contact.pairs = meetings::kept(&layout, bytemuck::cast_slice(read[0]));
                meetings::torn(&layout, bytemuck::cast_slice(read[1]), &mut contact.torn);
            })?;
            // In the order of the model's parts, of which several may be one here.
            let part = |number: u32| {
                let sample = model.skin.samples.get(number as usize);
                sample.map(|sample| model.part_of(sample.vertices[0]))
            };
            contact.pairs.sort_by_key(|kept| (part(kept.sample), kept.sample));
        }
        Ok(contact)
    }
}
