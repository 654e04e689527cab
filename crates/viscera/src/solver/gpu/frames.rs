//! What comes back from the device: copies made behind a step, read when they have arrived.

use std::sync::mpsc::{Receiver, Sender, channel};

use super::buffers::{Buffers, Slot};
use super::device::Device;
use super::{GpuError, GpuSolver};
use crate::model::Model;
use crate::scalar::{Vec3, vec3};
use crate::state::State;

/// Copies that may be under way at a time; more requests give way until one has arrived.
const RING: usize = 3;

/// The number of a request, and whether its copy can be read.
type Arrival = (u64, bool);

/// Copies under way.
#[derive(Debug)]
pub(super) struct Frames {
    free: Vec<wgpu::Buffer>,
    under_way: Vec<(u64, wgpu::Buffer)>,
    arrivals: (Sender<Arrival>, Receiver<Arrival>),
    requested: u64,
    /// The newest copy that has arrived and was not asked for yet.
    arrived: Option<(u64, wgpu::Buffer)>,
    size: u64,
}

/// Positions at the end of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Which request it answers, from 1 on.
    pub number: u64,
    /// Positions [m], the user's order, shape [vertex_count].
    pub positions: Vec<Vec3<f32>>,
}

impl Frames {
    pub fn new(buffers: &Buffers) -> Self {
        Self {
            free: Vec::new(),
            under_way: Vec::new(),
            arrivals: channel(),
            requested: 0,
            arrived: None,
            size: buffers.points_size,
        }
    }

    pub fn bytes(&self) -> u64 {
        let arrived = usize::from(self.arrived.is_some());
        self.size * (self.free.len() + self.under_way.len() + arrived) as u64
    }
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

    /// Waits for the device and reads its whole state.
    pub fn read(&self, model: &Model<f32>, state: &mut State<f32>) -> Result<(), GpuError> {
        let unknowns = self.read_buffer(Slot::Unknowns)?;
        let velocities = self.read_buffer(Slot::Velocities)?;
        let places: &[[f32; 4]] =
            bytemuck::cast_slice(&unknowns[..self.buffers.points_size as usize]);
        state.positions = in_user_order(model, places);
        let moving: &[[f32; 4]] =
            bytemuck::cast_slice(&velocities[..self.buffers.points_size as usize]);
        state.velocities = in_user_order(model, moving);
        let start = self.buffers.multipliers_start as usize;
        let multipliers = &unknowns[start..start + 4 * model.multiplier_count];
        state.multipliers = bytemuck::cast_slice(multipliers).to_vec();
        state.multiplier_dt = self.multiplier_dt;
        Ok(())
    }

    /// Waits for the device and reads a buffer.
    pub(super) fn read_buffer(&self, slot: Slot) -> Result<Vec<u8>, GpuError> {
        read(&self.device, self.buffers.buffer(slot))
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

/// Waits for the device and reads a buffer.
pub(super) fn read(device: &Device, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
    let staging = staging(device, buffer.size());
    let descriptor = wgpu::CommandEncoderDescriptor { label: Some("read") };
    let mut encoder = device.device.create_command_encoder(&descriptor);
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    device.queue.submit([encoder.finish()]);
    let (told, heard) = channel();
    staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
        let _ = told.send(result.is_ok());
    });
    let lost = |reason: String| GpuError::Lost { name: device.name().to_owned(), reason };
    let polled = device.device.poll(wgpu::PollType::wait_indefinitely());
    polled.map_err(|error| lost(error.to_string()))?;
    device.check()?;
    if heard.recv() != Ok(true) {
        return Err(lost("its memory could not be read".into()));
    }
    let bytes = staging.slice(..).get_mapped_range();
    let bytes = bytes.map_err(|error| lost(error.to_string()))?;
    Ok(bytes.to_vec())
}

fn in_user_order(model: &Model<f32>, places: &[[f32; 4]]) -> Vec<Vec3<f32>> {
    let rank = model.numbering.rank.iter();
    rank.map(|&v| places[v as usize]).map(|[x, y, z, _]| vec3(x, y, z)).collect()
}
