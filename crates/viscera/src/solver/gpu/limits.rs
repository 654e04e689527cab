//! Numbers that bound what is sent to a device, and what of the settings counts there.

use crate::settings::{Acceleration, Method, SolverSettings};
use crate::solver::cpu::products::LARGEST_WINDOW;

/// Jobs lie this far apart [bytes]: the alignment that devices may ask of an offset.
pub const JOB_STRIDE: u64 = 256;

/// The most workgroups along one axis in the baseline.
pub const MOST_GROUPS: u32 = 65_535;

/// Threads of a workgroup that sums products of long vectors.
pub const SUM_THREADS: u32 = 128;

/// Whether there is anything to accelerate, and it is asked for.
pub fn accelerates(settings: &SolverSettings) -> bool {
    settings.method == Method::Xpbd && settings.acceleration != Acceleration::None
}

/// Anderson's window, within what kernels have room for.
pub fn window(settings: &SolverSettings) -> u32 {
    settings.anderson_window.clamp(1, LARGEST_WINDOW as u32)
}
