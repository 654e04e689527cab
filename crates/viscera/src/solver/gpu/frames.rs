//! Results of the device: copies made behind a step, read when they have arrived.

use std::ops::Range;

use super::control::{PARTS_START, rejected_steps};
use super::error::GpuError;
use super::reading::{read, wait};
use super::slots::Slot;
use super::solver::GpuSolver;
use crate::contact::Wrench;
use crate::layout::Layout;
use crate::model::Model;
use crate::scalar::lanes::{Eight, Point};
use crate::scalar::{Vec3, vec3};
use crate::settings::Method;
use crate::solver::inputs::{Inputs, check_inputs, check_state};
use crate::solver::report::FrameReading;
use crate::solver::step::balance::ForceBalance;
use crate::solver::step::contacts::on_device::{DeviceTools, IS_THERE};
use crate::solver::step::contacts::{Contacts, Pairs, meetings};
use crate::solver::step::data::EndOfStep;
use crate::solver::step::predict::load_tethers;
use crate::solver::step::recovered::MeasuredTets;
use crate::state::State;

/// Slots of a balance before that of contact.
const BEFORE_CONTACT: usize = 3;

/// Positions at the end of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Which request it answers, from 1 on.
    pub number: u64,
    /// Positions [m], the user's order, shape [vertex_count].
    pub positions: Vec<Vec3<f32>>,
}

impl GpuSolver {
    /// Asks for the positions at the end of the last step; returns the request's number, or nothing
    /// while three others are under way. Does not wait.
    pub fn request(&mut self) -> Option<u64> {
        let buffer = self.frames.take(&self.device)?;
        let mut encoder = self.encoder("frame");
        let size = self.buffers.points_size;
        encoder.copy_buffer_to_buffer(self.positions(), 0, &buffer, 0, size);
        self.device.queue.submit([encoder.finish()]);
        Some(self.frames.send(buffer))
    }

    /// The newest positions that have arrived since the last call. Does not wait.
    pub fn newest(&mut self, model: &Model<f32>) -> Option<Frame> {
        let layout = self.layout_of(model).ok()?;
        self.frames.newest(&self.device, |number, bytes| {
            let places: &[[f32; 4]] = bytemuck::cast_slice(bytes);
            Frame { number, positions: in_user_order(&layout, places) }
        })
    }

    /// Waits for the device and reads its whole state. On an error the state is as it was.
    pub fn read(&self, model: &Model<f32>, state: &mut State<f32>) -> Result<(), GpuError> {
        let layout = self.layout_of(model)?;
        let model = &*layout;
        self.read_buffers(&[Slot::Unknowns, Slot::Velocities], |read| {
            self.take_state(model, state, read);
        })
    }

    /// Waits for the device and reads positions and velocities at the end of the last step, in place, and the forces on tools;
    /// returns how many steps were rejected so far. Multipliers stay on the device, and what tools have touched:
    /// [`GpuSolver::contact`] has that. On an error nothing is changed.
    pub fn read_frame(
        &mut self,
        model: &Model<f32>,
        state: &mut State<f32>,
    ) -> Result<u64, GpuError> {
        let layout = self.layout_of(model)?;
        let mut all = Default::default();
        read(&self.device, &self.frame_ranges(FrameReading::State), |read| {
            self.take_moves(&layout, state, read);
            all = self.take_forces(read);
        })?;
        let (rejected, wrenches) = all;
        self.tools.wrenches = wrenches;
        Ok(rejected)
    }

    /// As [`GpuSolver::read_frame`]; what moves stays on the device.
    pub fn read_forces(&mut self) -> Result<u64, GpuError> {
        let mut all = Default::default();
        read(&self.device, &self.frame_ranges(FrameReading::Forces), |read| {
            all = self.take_forces(read);
        })?;
        let (rejected, wrenches) = all;
        self.tools.wrenches = wrenches;
        Ok(rejected)
    }

    /// Where everything stands that is read of a frame.
    pub(super) fn frame_ranges(&self, reading: FrameReading) -> Vec<(&wgpu::Buffer, Range<u64>)> {
        let part = |slot, size: u64| {
            let [start, _] = self.buffers.span(slot);
            (self.buffers.buffer(slot), start..start + size)
        };
        let of_tools = match self.of_tools() {
            // Nothing cannot be copied.
            0 => part(Slot::Control, 4),
            bytes => part(Slot::ToolSums, bytes),
        };
        let mut ranges = vec![part(Slot::Control, PARTS_START as u64), of_tools];
        if reading >= FrameReading::State {
            let points = self.buffers.points_size;
            ranges.extend([Slot::Unknowns, Slot::Velocities].map(|slot| part(slot, points)));
            ranges.extend(self.of_ties().map(|bytes| part(Slot::Torn, bytes)));
        }
        if reading == FrameReading::Balance {
            ranges.extend(self.balance_slots().into_iter().map(|slot| self.whole(slot)));
        }
        ranges
    }

    /// How many steps were rejected so far, and the forces on tools, of copies of those ranges.
    pub(super) fn take_forces(&self, read: &[&[u8]]) -> (u64, Vec<Wrench>) {
        let wrenches = match self.of_tools() {
            0 => Vec::new(),
            _ => self.tools.all.wrenches(bytemuck::cast_slice(read[1])),
        };
        (rejected_steps(read[0]), wrenches)
    }

    /// Takes over what moves, where it is among copies of those ranges.
    pub(super) fn take_moves(&self, layout: &Layout<f32>, state: &mut State<f32>, read: &[&[u8]]) {
        let [_, _, positions, velocities, more @ ..] = read else { return };
        let (torn, balance) = more.split_at(more.len().min(self.of_ties().iter().count()));
        put_in_user_order(layout, bytemuck::cast_slice(positions), &mut state.positions);
        put_in_user_order(layout, bytemuck::cast_slice(velocities), &mut state.velocities);
        state.multiplier_dt = self.multiplier_dt;
        if self.samples().is_some() {
            // Who goes on without the device has to know where tools were. What they touched comes with the balance.
            state.contact.poses.clear();
            state.contact.poses.extend_from_slice(self.tools.all.poses());
            state.contact.touches.clear();
            if IS_THERE && let Some(rows) = balance.get(BEFORE_CONTACT) {
                let user = |v: usize| layout.numbering.order[v] as usize;
                let place = |v: usize| state.positions[user(v)];
                let touches = DeviceTools::touches(layout, bytemuck::cast_slice(rows), place);
                state.contact.touches = touches;
            }
        }
        if let [torn] = torn {
            meetings::torn(layout, bytemuck::cast_slice(torn), &mut state.contact.torn);
        }
        if self.meetings().is_some() {
            state.contact.pairs.clear();
        }
    }

    /// How many bytes a frame of so much is.
    pub fn bytes_of_frame(&self, reading: FrameReading) -> u64 {
        self.frame_ranges(reading).iter().map(|(_, range)| range.end - range.start).sum()
    }

    /// How many bytes [`GpuSolver::read`] reads.
    pub fn bytes_of_state(&self) -> u64 {
        [Slot::Unknowns, Slot::Velocities].map(|slot| self.buffers.span(slot)[1]).iter().sum()
    }

    /// Waits for the device and reads the multipliers [J s^2] at the end of the last step.
    pub fn multipliers(&self, model: &Model<f32>) -> Result<Vec<f32>, GpuError> {
        let layout = self.layout_of(model)?;
        let model = &*layout;
        let [start, _] = self.buffers.span(Slot::Multipliers);
        let range = start..start + 4 * model.multiplier_count as u64;
        let mut multipliers = Vec::new();
        if !range.is_empty() {
            let ranges = [(self.buffers.buffer(Slot::Multipliers), range)];
            read(&self.device, &ranges, |read| {
                multipliers = bytemuck::pod_collect_to_vec(read[0]);
            })?;
        }
        Ok(multipliers)
    }

    /// The force balance at the end of the last step, see [`ForceBalance`]. `state` is what was read after it, and
    /// `inputs` are its. Waits for the device.
    pub fn force_balance(
        &self,
        model: &Model<f32>,
        state: &State<f32>,
        inputs: &Inputs<f32>,
        balance: &mut ForceBalance,
    ) -> Result<(), GpuError> {
        let layout = self.layout_of(model)?;
        let model = &*layout;
        check_state(model, state)?;
        check_inputs(model, inputs)?;
        if let Some(kept) = &self.sent.balance {
            let read: Vec<&[u8]> = kept.iter().map(Vec::as_slice).collect();
            self.balance_from(model, state, inputs, &read, balance);
            return Ok(());
        }
        self.read_buffers(&self.balance_slots(), |read| {
            self.balance_from(model, state, inputs, read, balance);
        })
    }

    /// Where everything stands that a force balance needs.
    pub(super) fn balance_slots(&self) -> Vec<Slot> {
        let mut slots = vec![Slot::Predicted, Slot::ExternalForces, Slot::Previous];
        if self.samples().is_some() {
            slots.push(Slot::Contact);
        }
        if self.meetings().is_some() {
            slots.push(Slot::Meetings);
        }
        if self.layout.is_viscous() {
            slots.push(match self.settings.method {
                Method::QuasiNewton => Slot::StageStart,
                // What small steps ended with tells more.
                Method::Explicit => Slot::Previous,
                _ => Slot::StartStrain,
            });
        }
        slots
    }

    /// Strains that viscosity acts against: where the last solve started; or so that they change in all of the step as they
    /// do at its end; or those that a step of sweeps has kept.
    fn put_strains(
        &self,
        model: &Layout<f32>,
        state: &State<f32>,
        read: &[u8],
        measured: &mut MeasuredTets,
    ) {
        let user = |v: usize| model.numbering.order[v] as usize;
        let all = |of: &dyn Fn(usize) -> Vec3<f32>| -> Vec<Point<f32>> {
            (0..model.vertex_count()).map(|v| Point::new(of(v), 0.0)).collect()
        };
        match self.settings.method {
            Method::QuasiNewton => {
                let rows: &[[f32; 4]] = bytemuck::cast_slice(read);
                let start = all(&|v| vec3(rows[v][0], rows[v][1], rows[v][2]));
                for (number, part) in model.parts.iter().enumerate() {
                    measured.put_strains(model, number, &start, 0.0);
                    // Where one solve was for all of the step, strains change in less of it as they do in all of it.
                    let share = self.solve_share();
                    if share < 1.0 && rows[part.vertices.start][3] != 0.0 {
                        let ends = all(&|v| state.positions[user(v)]);
                        measured.put_strains(model, number, &ends, share as f32);
                    }
                }
            }
            Method::Explicit => {
                let ends = all(&|v| state.positions[user(v)]);
                for (number, small) in self.small_steps.iter().enumerate() {
                    let back = 0.5 * small.dt;
                    let before =
                        all(&|v| state.positions[user(v)] - state.velocities[user(v)] * back);
                    measured.put_strains(model, number, &before, 0.0);
                    let share = 2.0 * self.multiplier_dt as f32 / small.dt;
                    measured.put_strains(model, number, &ends, share);
                }
            }
            _ => {
                let mut strains: &[Eight<f32>] = bytemuck::cast_slice(read);
                for (set, into) in model.tet_sets.iter().zip(&mut measured.start_strain) {
                    // The device has room for all blocks, measures ask for those of viscous sets.
                    let (of_set, rest) = strains.split_at(6 * set.block_count());
                    strains = rest;
                    if set.viscous {
                        into.copy_from_slice(of_set.as_chunks::<6>().0);
                    }
                }
            }
        }
    }

    /// The force balance from copies of the slots that it needs.
    fn balance_from(
        &self,
        model: &Layout<f32>,
        state: &State<f32>,
        inputs: &Inputs<f32>,
        read: &[&[u8]],
        balance: &mut ForceBalance,
    ) {
        let [predicted, acting, before] =
            [read[0], read[1], read[2]].map(bytemuck::cast_slice::<u8, [f32; 4]>);
        let count = model.vertex_count();
        let point = |&[x, y, z, _]: &[f32; 4]| Point::new(vec3(x, y, z), 0.0);
        let before: Vec<Point<f32>> = before[..count].iter().map(point).collect();
        let mut places: Vec<Point<f32>> = predicted[..count].iter().map(point).collect();
        let fourth =
            |rows: &[[f32; 4]]| -> Vec<f32> { rows[..count].iter().map(|row| row[3]).collect() };
        if self.settings.method == Method::Explicit {
            let user = |v: usize| model.numbering.order[v] as usize;
            let mass = |v: usize| model.masses[user(v)];
            let place = |v: usize| state.positions[user(v)];
            load_tethers(&self.tethers, &mut places, self.multiplier_dt, mass, place);
        }
        let mut measured = MeasuredTets::new(model);
        let mut more = read[BEFORE_CONTACT..].iter();
        let contacts = match self.samples() {
            Some(_) => more.next().map(|rows| bytemuck::cast_slice(rows)),
            None => None,
        };
        let mut contacts =
            contacts.map_or_else(Contacts::default, |rows| self.tools.all.contacts(model, rows));
        if let Some(rows) = self.meetings().and_then(|_| more.next()) {
            contacts.pairs =
                Pairs::found(model, meetings::pairs(model, bytemuck::cast_slice(rows)));
        }
        if let Some(rows) = more.next() {
            self.put_strains(model, state, rows, &mut measured);
        }
        let (recovered, start_strain) = measured.of_step();
        let mut end = EndOfStep {
            previous: &before,
            predicted: &places,
            inertias: &fourth(predicted),
            inverse_masses: &fourth(acting),
            tethers: &self.tethers,
            start_strain,
            recovered,
            contacts: &contacts,
        };
        balance.measure(model, state, inputs, &mut end);
    }

    fn take_state(&self, layout: &Layout<f32>, state: &mut State<f32>, read: &[&[u8]]) {
        let [unknowns, velocities] = [read[0], read[1]];
        let points = |bytes: &[u8]| -> Vec<Vec3<f32>> {
            let points = &bytes[..self.buffers.points_size as usize];
            in_user_order(layout, bytemuck::cast_slice(points))
        };
        state.positions = points(unknowns);
        state.velocities = points(velocities);
        let start = self.buffers.multipliers_start as usize;
        let multipliers = &unknowns[start..start + 4 * layout.multiplier_count];
        state.multipliers = bytemuck::cast_slice(multipliers).to_vec();
        state.multiplier_dt = self.multiplier_dt;
    }

    /// Waits for the device and reads all that a slot holds.
    pub(in crate::solver) fn read_buffer(&self, slot: Slot) -> Result<Vec<u8>, GpuError> {
        let mut bytes = Vec::new();
        self.read_buffers(&[slot], |read| bytes.extend_from_slice(read[0]))?;
        Ok(bytes)
    }

    /// Waits until everything that was asked of the device is done.
    pub fn wait(&self) -> Result<(), GpuError> {
        wait(&self.device)
    }

    /// Waits for the device, and lets the caller look at copies of slots.
    fn read_buffers(&self, slots: &[Slot], take: impl FnOnce(&[&[u8]])) -> Result<(), GpuError> {
        let ranges: Vec<_> = slots.iter().map(|slot| self.whole(*slot)).collect();
        read(&self.device, &ranges, take)
    }

    /// All that a slot holds.
    pub(super) fn whole(&self, slot: Slot) -> (&wgpu::Buffer, Range<u64>) {
        let [start, size] = self.buffers.span(slot);
        (self.buffers.buffer(slot), start..start + size)
    }
}

fn put_in_user_order(layout: &Layout<f32>, places: &[[f32; 4]], into: &mut [Vec3<f32>]) {
    for (value, &v) in into.iter_mut().zip(&layout.numbering.rank) {
        let [x, y, z, _] = places[v as usize];
        *value = vec3(x, y, z);
    }
}

fn in_user_order(layout: &Layout<f32>, places: &[[f32; 4]]) -> Vec<Vec3<f32>> {
    let rank = layout.numbering.rank.iter();
    rank.map(|&v| places[v as usize]).map(|[x, y, z, _]| vec3(x, y, z)).collect()
}
