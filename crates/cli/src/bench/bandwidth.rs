//! How fast memory is: the measure that sweeps are held against.

use super::computers::Computer;
use super::measurement::Measurement;
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
    /// Bytes read and bytes written; none where it could not be measured.
    pub bytes_per_second: Option<f64>,
}

impl Bandwidth {
    /// What goes wrong is noted: solvers can be measured without it.
    pub fn measure(computer: &dyn Computer, notes: &mut Vec<String>) -> Self {
        let device = computer.kind();
        let measured = computer.copy_bandwidth();
        if let Err(error) = &measured {
            notes.push(format!(
                "how fast the {device} copies memory could not be measured ({error:#}), so that \
                 the column `of bandwidth` is empty for it"
            ));
        }
        Self { device, threads: computer.threads(), bytes_per_second: measured.ok() }
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

#[cfg(test)]
mod tests {
    use super::super::computers::Stepper;
    use super::super::measurement::Bench;
    use super::*;
    use anyhow::{Result, bail};

    struct Broken;

    impl Computer for Broken {
        fn kind(&self) -> &'static str {
            "GPU"
        }

        fn threads(&self) -> Option<u32> {
            None
        }

        fn copy_bandwidth(&self) -> Result<f64> {
            bail!("its memory is too small")
        }

        fn stepper<'a>(&self, _: &'a Bench<'_>, _: Option<u32>) -> Result<Box<dyn Stepper + 'a>> {
            bail!("it does no steps")
        }
    }

    /// Told, and no end of the run.
    #[test]
    fn a_bandwidth_that_cannot_be_measured_is_noted() {
        let mut notes = Vec::new();
        let bandwidth = Bandwidth::measure(&Broken, &mut notes);
        assert_eq!(bandwidth.bytes_per_second, None);
        assert!(
            matches!(&notes[..], [note] if note.contains("its memory is too small")),
            "{notes:?}"
        );
    }
}
