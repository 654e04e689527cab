//! What comes back from the device: copies made behind a step, read when they have arrived.

use std::ops::Range;
use std::sync::mpsc::channel;

use super::control::rejected_steps;
use super::device::Device;
use super::error::GpuError;
use super::slots::Slot;
use super::solver::GpuSolver;
use crate::model::Model;
use crate::scalar::lanes::{Eight, Point};
use crate::scalar::{Vec3, vec3};
use crate::settings::Method;
use crate::solver::Solver;
use crate::state::State;

/// Copies that may be under way at a time; more requests give way until one has arrived.
const RING: usize = 3;

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
        self.collect();
        let size = self.buffers.points_size;
        let buffer = match self.frames.free.pop() {
            Some(buffer) => buffer,
            None if self.frames.under_way.len() < RING => staging(&self.device, size),
            None => return None,
        };
        let mut encoder = self.encoder("frame");
        encoder.copy_buffer_to_buffer(self.positions(), 0, &buffer, 0, size);
        self.device.queue.submit([encoder.finish()]);
        self.frames.requested += 1;
        let (number, told) = (self.frames.requested, self.frames.arrivals.0.clone());
        buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // A solver that is gone does not listen.
            let _ = told.send((number, result.is_ok()));
        });
        self.frames.under_way.push((number, buffer));
        Some(number)
    }

    /// The newest positions that have arrived since the last call. Does not wait.
    pub fn newest(&mut self, model: &Model<f32>) -> Option<Frame> {
        self.collect();
        if self.check_model(model).is_err() {
            return None;
        }
        let (number, buffer) = self.frames.arrived.take()?;
        let frame = buffer.slice(..).get_mapped_range().ok().map(|bytes| {
            let places: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
            Frame { number, positions: in_user_order(model, places) }
        });
        buffer.unmap();
        self.frames.free.push(buffer);
        frame
    }

    /// Keeps the newest copy that has arrived; older ones are free again.
    fn collect(&mut self) {
        // Where polling fails the device is lost, and nothing arrives any more.
        let _ = self.device.device.poll(wgpu::PollType::Poll);
        let frames = &mut self.frames;
        while let Ok((number, is_there)) = frames.arrivals.1.try_recv() {
            let place = frames.under_way.iter().position(|(n, _)| *n == number);
            let Some(place) = place else { continue };
            let copy = frames.under_way.swap_remove(place);
            // Copies arrive in the order of their requests.
            let older = if is_there { frames.arrived.replace(copy) } else { Some(copy) };
            if let Some((_, buffer)) = older {
                buffer.unmap();
                frames.free.push(buffer);
            }
        }
    }

    /// Waits for the device and reads its whole state. On an error the state is as it was.
    pub fn read(&self, model: &Model<f32>, state: &mut State<f32>) -> Result<(), GpuError> {
        self.check_model(model)?;
        self.read_buffers(&[Slot::Unknowns, Slot::Velocities], |read| {
            self.take_state(model, state, read);
        })
    }

    /// Reads the whole state and, into a CPU solver of the same model, what its force balance of the
    /// last step needs and how many steps were taken back: with one wait. On an error nothing is changed.
    pub fn read_with_ground(
        &self,
        model: &Model<f32>,
        state: &mut State<f32>,
        solver: &mut Solver<f32>,
    ) -> Result<(), GpuError> {
        self.check_model(model)?;
        solver.memory.check(model)?;
        let mut slots =
            vec![Slot::Unknowns, Slot::Velocities, Slot::Predicted, Slot::Acting, Slot::Control];
        if model.tet_sets().iter().any(|set| set.viscous) {
            slots.push(Slot::StartStrain);
        }
        self.read_buffers(&slots, |read| {
            self.take_state(model, state, read);
            let [predicted, acting] = [read[2], read[3]].map(bytemuck::cast_slice::<u8, [f32; 4]>);
            let constants = &mut solver.memory.data.constants;
            for (v, point) in constants.predicted.iter_mut().enumerate() {
                let [x, y, z, inertia] = predicted[v];
                *point = Point::new(vec3(x, y, z), 0.0);
                constants.inertias[v] = inertia;
                constants.inverse_masses[v] = acting[v][3];
            }
            constants.tethers.clone_from(&self.tethers);
            if self.settings.method == Method::Explicit {
                let place = |v: usize| state.positions[model.numbering.order[v] as usize];
                constants.load_tethers(self.multiplier_dt, place);
            }
            if let Some(guard) = &mut solver.memory.guard {
                guard.rejected = rejected_steps(read[4]);
            }
            let Some(strains) = read.get(5) else { return };
            let mut strains: &[Eight<f32>] = bytemuck::cast_slice(strains);
            for (set, own) in model.tet_sets().into_iter().zip(&mut constants.start_strain) {
                // The device has room for all blocks, the CPU for those of viscous sets.
                let (of_set, rest) = strains.split_at(6 * set.block_count());
                let of_set = &of_set.as_chunks::<6>().0[..own.len()];
                own.copy_from_slice(of_set);
                strains = rest;
            }
        })
    }

    fn take_state(&self, model: &Model<f32>, state: &mut State<f32>, read: &[&[u8]]) {
        let [unknowns, velocities] = [read[0], read[1]];
        let points = |bytes: &[u8]| -> Vec<Vec3<f32>> {
            let points = &bytes[..self.buffers.points_size as usize];
            in_user_order(model, bytemuck::cast_slice(points))
        };
        state.positions = points(unknowns);
        state.velocities = points(velocities);
        let start = self.buffers.multipliers_start as usize;
        let multipliers = &unknowns[start..start + 4 * model.multiplier_count];
        state.multipliers = bytemuck::cast_slice(multipliers).to_vec();
        state.multiplier_dt = self.multiplier_dt;
    }

    /// Waits for the device and reads all that a slot holds.
    pub(super) fn read_buffer(&self, slot: Slot) -> Result<Vec<u8>, GpuError> {
        let mut bytes = Vec::new();
        self.read_buffers(&[slot], |read| bytes.extend_from_slice(read[0]))?;
        Ok(bytes)
    }

    /// Waits until everything that was asked of the device is done.
    pub fn wait(&self) -> Result<(), GpuError> {
        wait(&self.device)
    }

    /// Waits for the device, and lets the caller look at copies of what slots hold.
    fn read_buffers(&self, slots: &[Slot], take: impl FnOnce(&[&[u8]])) -> Result<(), GpuError> {
        let range = |&slot: &Slot| {
            let [start, size] = self.buffers.span(slot);
            (self.buffers.buffer(slot), start..start + size)
        };
        let ranges: Vec<_> = slots.iter().map(range).collect();
        read(&self.device, &ranges, take)
    }
}

fn staging(device: &Device, size: u64) -> wgpu::Buffer {
    device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("frame"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

pub(super) fn wait(device: &Device) -> Result<(), GpuError> {
    let polled = device.device.poll(wgpu::PollType::wait_indefinitely());
    polled.map_err(|error| device.lost(error.to_string()))?;
    device.check()
}

/// Waits for the device, and lets the caller look at copies of ranges [bytes] of buffers.
pub(super) fn read(
    device: &Device,
    ranges: &[(&wgpu::Buffer, Range<u64>)],
    take: impl FnOnce(&[&[u8]]),
) -> Result<(), GpuError> {
    device.check()?;
    let size = |range: &Range<u64>| range.end - range.start;
    let staging = staging(device, ranges.iter().map(|(_, range)| size(range)).sum());
    let descriptor = wgpu::CommandEncoderDescriptor { label: Some("read") };
    let mut encoder = device.device.create_command_encoder(&descriptor);
    let mut place = 0;
    for (buffer, range) in ranges {
        encoder.copy_buffer_to_buffer(buffer, range.start, &staging, place, size(range));
        place += size(range);
    }
    device.queue.submit([encoder.finish()]);
    let (told, heard) = channel();
    staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
        let _ = told.send(result.is_ok());
    });
    wait(device)?;
    if heard.recv() != Ok(true) {
        return Err(device.lost("its memory could not be read".into()));
    }
    let bytes = staging.slice(..).get_mapped_range();
    let bytes = bytes.map_err(|error| device.lost(error.to_string()))?;
    let mut rest: &[u8] = &bytes;
    let mut copies = Vec::with_capacity(ranges.len());
    for (_, range) in ranges {
        let (copy, after) = rest.split_at(size(range) as usize);
        copies.push(copy);
        rest = after;
    }
    take(&copies);
    Ok(())
}

fn in_user_order(model: &Model<f32>, places: &[[f32; 4]]) -> Vec<Vec3<f32>> {
    let rank = model.numbering.rank.iter();
    rank.map(|&v| places[v as usize]).map(|[x, y, z, _]| vec3(x, y, z)).collect()
}
