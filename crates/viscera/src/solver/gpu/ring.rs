//! Copies of positions that are under way from the device.

use std::sync::mpsc::{Receiver, Sender, channel};

use super::buffers::Buffers;

/// The number of a request, and whether its copy can be read.
pub type Arrival = (u64, bool);

/// Copies under way.
#[derive(Debug)]
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
