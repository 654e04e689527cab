//! Copies of results that are under way from the device.

use std::sync::mpsc::{Receiver, Sender, channel};

use super::device::Device;
use super::reading::staging;

/// The number of a request, and whether its copy can be read.
pub type Arrival = (u64, bool);

/// Copies that may be under way at a time; more requests give way until one has arrived.
const RING: usize = 3;

/// Copies under way.
pub struct Frames {
    pub free: Vec<wgpu::Buffer>,
    pub under_way: Vec<(u64, wgpu::Buffer)>,
    pub arrivals: (Sender<Arrival>, Receiver<Arrival>),
    pub requested: u64,
    /// The newest copy that has arrived and was not asked for yet.
    pub arrived: Option<(u64, wgpu::Buffer)>,
    size: u64,
}

impl Frames {
    /// Of so many bytes.
    pub fn new(size: u64) -> Self {
        Self {
            free: Vec::new(),
            under_way: Vec::new(),
            arrivals: channel(),
            requested: 0,
            arrived: None,
            size,
        }
    }

    pub fn bytes(&self) -> u64 {
        let arrived = usize::from(self.arrived.is_some());
        self.size * (self.free.len() + self.under_way.len() + arrived) as u64
    }

    /// A copy's memory; nothing while too many are under way.
    pub fn take(&mut self, device: &Device) -> Option<wgpu::Buffer> {
        self.collect(device);
        match self.free.pop() {
            Some(buffer) => Some(buffer),
            None if self.under_way.len() < RING => Some(staging(device, self.size)),
            None => None,
        }
    }

    /// A copy that was asked for is under way; returns its number, from 1 on.
    pub fn send(&mut self, copy: wgpu::Buffer) -> u64 {
        self.requested += 1;
        let (number, told) = (self.requested, self.arrivals.0.clone());
        copy.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // A solver that is gone does not listen.
            let _ = told.send((number, result.is_ok()));
        });
        self.under_way.push((number, copy));
        number
    }

    /// The newest copy that has arrived since the last call, and its number.
    pub fn newest<T>(&mut self, device: &Device, look: impl FnOnce(u64, &[u8]) -> T) -> Option<T> {
        self.collect(device);
        let (number, buffer) = self.arrived.take()?;
        let found = buffer.slice(..).get_mapped_range().ok().map(|bytes| look(number, &bytes));
        buffer.unmap();
        self.free.push(buffer);
        found
    }

    /// Keeps the newest copy that has arrived; older ones are free again.
    fn collect(&mut self, device: &Device) {
        // Where polling fails the device is lost, and nothing arrives any more.
        let _ = device.device.poll(wgpu::PollType::Poll);
        while let Ok((number, is_there)) = self.arrivals.1.try_recv() {
            let place = self.under_way.iter().position(|(n, _)| *n == number);
            let Some(place) = place else { continue };
            let copy = self.under_way.swap_remove(place);
            // Copies arrive in the order of their requests.
            let older = if is_there { self.arrived.replace(copy) } else { Some(copy) };
            if let Some((_, buffer)) = older {
                buffer.unmap();
                self.free.push(buffer);
            }
        }
    }
}
