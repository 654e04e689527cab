//! How fast memory is: the measure that sweeps are held against.

use serde::Serialize;
use std::time::Instant;

/// Source and target of the copy [B each]: several times the caches of a large processor.
pub const COPIED: usize = 256 << 20;
/// Copies after the first, of which the fastest counts.
const REPETITIONS: usize = 5;

/// The memory bandwidth with so many threads.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Bandwidth {
    pub threads: u32,
    /// Bytes read and bytes written.
    pub bytes_per_second: f64,
}

impl Bandwidth {
    /// Copies one array to another, each thread a part of its own.
    pub fn measure(threads: u32) -> Self {
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
        Self { threads, bytes_per_second: 2.0 * COPIED as f64 / fastest }
    }
}
