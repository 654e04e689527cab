//! What the device has decided: read when asked for, with a wait.

use bytemuck::{Pod, Zeroable};

use super::buffers::Slot;
use super::layout::PART_NUMBERS;
use super::{GpuError, GpuSolver};
use crate::solver::StepReport;

/// Where [`Verdict`] begins in `Control` of control.wgsl [bytes].
const VERDICT: usize = 476;

/// The step guard's part of `Control`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Verdict {
    limit: f32,
    best_value: f32,
    start: u32,
    is_good: u32,
    is_better: u32,
    taken: u32,
    failures: u32,
    pub rejected: u32,
    was_rejected: u32,
    potential: f32,
    noise: f32,
}

impl Verdict {
    /// Out of the bytes of `Control`.
    pub fn of(control: &[u8]) -> Self {
        bytemuck::pod_read_unaligned(&control[VERDICT..VERDICT + size_of::<Self>()])
    }
}

impl GpuSolver {
    fn verdict(&self) -> Result<Verdict, GpuError> {
        Ok(Verdict::of(&self.read_buffer(Slot::Control)?))
    }

    /// How often steps have been taken back since the solver was built. Waits for the device.
    pub fn rejected_steps(&self) -> Result<u64, GpuError> {
        Ok(self.verdict()?.rejected.into())
    }

    /// How the last step ended; nothing before the first, and where steps are not guarded. Potential and
    /// limit are what is above the start of the step with its pins moved. Waits for the device.
    pub fn last_step(&self) -> Result<Option<StepReport>, GpuError> {
        if !self.settings.guards_steps() || self.multiplier_dt == 0.0 {
            return Ok(None);
        }
        let verdict = self.verdict()?;
        let sums = self.read_buffer(Slot::PartialSums)?;
        let (first, count) = self.parts;
        let parts = &sums[first..first + 4 * PART_NUMBERS * count];
        let parts: &[[f32; PART_NUMBERS]] = bytemuck::cast_slice(parts);
        let kept = parts.iter().map(|part| part[PART_NUMBERS - 1]).fold(1.0, f32::min);
        Ok(Some(StepReport {
            potential: verdict.potential.into(),
            limit: verdict.limit.into(),
            noise: verdict.noise.into(),
            rejected: verdict.was_rejected != 0,
            kept_speed: kept.into(),
        }))
    }
}
