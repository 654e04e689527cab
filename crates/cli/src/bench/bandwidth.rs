//! How fast memory is: the measure that sweeps are held against.

use super::computers::Computer;
use super::measurement::Measurement;
use anyhow::Result;
use serde::Serialize;
use std::time::Instant;

/// Source and target of the copy [B each]: several times the caches of a large processor.
pub const COPIED: usize = 256 << 20;
/// Copies after the first, of which the fastest counts.
const REPETITIONS: usize = 5;

/// The bandwidth of a computer's memory.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Bandwidth {
    /// "CPU" or "GPU".
    pub device: &'static str,
    /// None of a GPU.
    pub threads: Option<u32>,
    /// Bytes read and bytes written.
    pub bytes_per_second: f64,
}

impl Bandwidth {
    pub fn measure(computer: &dyn Computer) -> Result<Self> {
        let bytes_per_second = computer.copy_bandwidth()?;
        Ok(Self { device: computer.kind(), threads: computer.threads(), bytes_per_second })
    }

    /// Whether the case was measured on the same computer.
    pub fn measured(&self, case: &Measurement) -> bool {
        case.threads == self.threads.map(|count| count as usize)
    }
}

/// Copies one array to another, each thread a part of its own [B/s].
pub fn of_memory(threads: u32) -> f64 {
    let source = vec![1u8; COPIED];
    let mut target = vec![0u8; COPIED];
    let part = COPIED.div_ceil(threads as usize);
    let mut copy = || {
        let start = Instant::now();
        std::thread::scope(|scope| {
            for (to, from) in target.chunks_mut(part).zip(source.chunks(part)) {
                scope.spawn(|| to.copy_from_slice(from));
            }
        });
        start.elapsed().as_secs_f64()
    };
    // The first one meets pages that the system has not handed out yet.
    copy();
    let fastest = (0..REPETITIONS).map(|_| copy()).fold(f64::INFINITY, f64::min);
    // Nobody reads the target; the copies must happen all the same.
    std::hint::black_box(&target);
    2.0 * COPIED as f64 / fastest
}
