//! What the device has decided: read when asked for, with a wait.

use bytemuck::{Pod, Zeroable};

use super::buffers::Slot;
use super::{GpuError, GpuSolver};
use crate::solver::StepReport;
use crate::solver::acceleration::LARGEST_WINDOW;

/// `Control` of control.wgsl, with as many parts as there are in place of one.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Control {
    pub small_step: u32,
    pub small_steps_done: u32,
    pub step: u32,
    pub rejected_step: u32,
    pub rejected: u32,
    pub parts: PartControl,
}

/// Where the parts' records begin [bytes].
const PARTS_START: usize = std::mem::offset_of!(Control, parts);

/// `PartControl` of control.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PartControl {
    pub sweeps: u32,
    pub next: u32,
    pub differences: u32,
    pub last_norm: f32,
    pub shares: [f32; LARGEST_WINDOW],
    pub gram: [[f32; LARGEST_WINDOW]; LARGEST_WINDOW],
    pub iteration: u32,
    pub omega: f32,
    pub radius: f32,
    pub last_change: f32,
    pub limit: f32,
    pub was_rejected: u32,
    pub share: f32,
    pub descends: u32,
    pub potential: f32,
    pub noise: f32,
    pub kept_speed: f32,
    pub best_value: f32,
    pub failures: u32,
    pub mixture_best: f32,
    pub mixture_failures: u32,
    pub is_good: u32,
    pub is_broken: u32,
}

/// Bytes of `Control` for so many parts.
pub(super) fn control_size(parts: usize) -> u64 {
    (PARTS_START + parts.max(1) * size_of::<PartControl>()) as u64
}

/// How many steps were taken back, out of the bytes of `Control`.
pub(super) fn rejected_steps(control: &[u8]) -> u64 {
    bytemuck::pod_read_unaligned::<Control>(&control[..size_of::<Control>()]).rejected.into()
}

impl PartControl {
    fn report(&self) -> StepReport {
        StepReport {
            potential: self.potential.into(),
            limit: self.limit.into(),
            noise: self.noise.into(),
            rejected: self.was_rejected != 0,
            kept_speed: self.kept_speed.into(),
        }
    }
}

impl GpuSolver {
    /// How many steps have been taken back for at least one connected part of the model since the solver was
    /// built. Waits for the device.
    pub fn rejected_steps(&self) -> Result<u64, GpuError> {
        Ok(rejected_steps(&self.read_buffer(Slot::Control)?))
    }

    /// How the last step ended, for all parts of the model together; nothing before the first, and where
    /// steps are not guarded. Potential and limit are what is above the start of the step with its pins moved.
    /// Waits for the device.
    pub fn last_step(&self) -> Result<Option<StepReport>, GpuError> {
        Ok(StepReport::of_all(&self.part_reports()?))
    }

    /// What the search of the last step came to for each connected part: the share of the step that passed, and
    /// whether descents took its place.
    #[doc(hidden)]
    pub fn last_searches(&self) -> Result<Vec<[f32; 2]>, GpuError> {
        let records = self.part_records()?;
        Ok(records.iter().map(|part| [part.share, part.descends as f32]).collect())
    }

    /// How the last step ended for each connected part of the model, see [`crate::model::Model::part_of`];
    /// empty before the first, and where steps are not guarded. Waits for the device.
    pub fn part_reports(&self) -> Result<Vec<StepReport>, GpuError> {
        if !self.settings.guards_steps() || self.multiplier_dt == 0.0 {
            return Ok(Vec::new());
        }
        Ok(self.part_records()?.iter().map(PartControl::report).collect())
    }

    fn part_records(&self) -> Result<Vec<PartControl>, GpuError> {
        let control = self.read_buffer(Slot::Control)?;
        let records = control[PARTS_START..].chunks_exact(size_of::<PartControl>());
        Ok(records.take(self.part_count).map(bytemuck::pod_read_unaligned).collect())
    }
}
