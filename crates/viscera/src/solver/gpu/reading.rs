//! Copies of buffers on their way to the host: sent behind what the device has been told to do, read when they are there.

use std::ops::Range;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use super::device::Device;
use super::error::GpuError;

/// One copy of several ranges, on its way.
pub(super) struct Reading {
    staging: wgpu::Buffer,
    /// Bytes of each range.
    sizes: Vec<u64>,
    heard: Receiver<bool>,
}

impl Reading {
    /// Copies ranges [bytes] of buffers as they are behind the last submission. Does not wait.
    pub fn start(
        device: &Device,
        ranges: &[(&wgpu::Buffer, Range<u64>)],
    ) -> Result<Self, GpuError> {
        device.check()?;
        let sizes: Vec<u64> = ranges.iter().map(|(_, range)| range.end - range.start).collect();
        let staging = staging(device, sizes.iter().sum());
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("read") };
        let mut encoder = device.device.create_command_encoder(&descriptor);
        let mut place = 0;
        for ((buffer, range), size) in ranges.iter().zip(&sizes) {
            encoder.copy_buffer_to_buffer(buffer, range.start, &staging, place, *size);
            place += size;
        }
        device.queue.submit([encoder.finish()]);
        let (told, heard) = channel();
        staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // Nobody listens where the reading was given up.
            let _ = told.send(result.is_ok());
        });
        Ok(Self { staging, sizes, heard })
    }

    /// Whether it is there: `None` while it is under way.
    pub fn has_arrived(&self, device: &Device) -> Result<Option<Arrived<'_>>, GpuError> {
        device.check()?;
        match self.heard.try_recv() {
            Ok(true) => Ok(Some(Arrived(self))),
            Err(TryRecvError::Empty) => Ok(None),
            _ => Err(unreadable(device)),
        }
    }

    /// Waits for it. Browsers forbid that: there it is an error.
    pub fn wait(&self, device: &Device) -> Result<Arrived<'_>, GpuError> {
        wait(device)?;
        if cfg!(target_arch = "wasm32") {
            let late = || device.lost("its memory cannot be waited for".into());
            return self.has_arrived(device)?.ok_or_else(late);
        }
        // Word of it may come through another thread that polls, a moment later.
        match self.heard.recv() {
            Ok(true) => Ok(Arrived(self)),
            _ => Err(unreadable(device)),
        }
    }
}

/// What was asked for behind the last step of a solver.
#[derive(Default)]
pub(super) struct Sent {
    pub awaited: Option<Reading>,
    /// What the force balance of the last step is made of, once it is there.
    pub balance: Option<Vec<Vec<u8>>>,
}

/// A copy that is there.
pub(super) struct Arrived<'a>(&'a Reading);

impl Arrived<'_> {
    /// Lets the caller look at the ranges.
    pub fn look<T>(self, device: &Device, take: impl FnOnce(&[&[u8]]) -> T) -> Result<T, GpuError> {
        let bytes = self.0.staging.slice(..).get_mapped_range();
        let bytes = bytes.map_err(|error| device.lost(error.to_string()))?;
        let mut rest: &[u8] = &bytes;
        let mut copies = Vec::with_capacity(self.0.sizes.len());
        for size in &self.0.sizes {
            let (copy, after) = rest.split_at(*size as usize);
            copies.push(copy);
            rest = after;
        }
        Ok(take(&copies))
    }
}

fn unreadable(device: &Device) -> GpuError {
    device.give_up("its memory could not be read".into())
}

pub(super) fn staging(device: &Device, size: u64) -> wgpu::Buffer {
    device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("frame"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Waits until everything that was asked of the device is done.
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
    Reading::start(device, ranges)?.wait(device)?.look(device, take)
}
