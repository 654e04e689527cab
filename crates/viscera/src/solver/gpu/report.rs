//! Decisions of the device: read when asked for, with a wait.

use super::control::{PARTS_START, PartControl, rejected_steps};
use super::error::GpuError;
use super::slots::Slot;
use super::solver::GpuSolver;
use crate::solver::plan::Solve;
use crate::solver::quasi_newton::on_device::first_solve;
use crate::solver::quasi_newton::progress::PartProgress;
use crate::solver::report::StepReport;

impl GpuSolver {
    /// How many steps have been rejected for at least one connected part of the model since the solver was
    /// built. Waits for the device.
    pub fn rejected_steps(&self) -> Result<u64, GpuError> {
        Ok(rejected_steps(&self.read_buffer(Slot::Control)?))
    }

    /// How the last step ended, for all parts of the model together; nothing before the first, and where
    /// steps are not guarded. Potential and limit are differences to the start of the step with its pins moved.
    /// Waits for the device.
    pub fn last_step(&self) -> Result<Option<StepReport>, GpuError> {
        Ok(StepReport::of_all(&self.part_reports()?))
    }

    /// The result of the last step's search for each connected part: the share of the step that passed, and
    /// whether descents took its place.
    #[doc(hidden)]
    pub fn last_searches(&self) -> Result<Vec<[f32; 2]>, GpuError> {
        let records = self.part_records()?;
        Ok(records.iter().map(|part| [part.guard.share, part.guard.descends as f32]).collect())
    }

    /// How the last step ended for each connected part of the model, see [`crate::model::Model::part_of`];
    /// empty before the first, and where steps are not guarded. Waits for the device.
    pub fn part_reports(&self) -> Result<Vec<StepReport>, GpuError> {
        let reports = self.settings.guards_steps() || self.levels.is_some();
        if !reports || self.multiplier_dt == 0.0 {
            return Ok(Vec::new());
        }
        let of_layout = self.part_records()?;
        let of_layout: Vec<_> = of_layout.iter().map(|part| part.guard.report()).collect();
        // Parts that may touch are judged as one.
        Ok(match self.layout.joined() {
            Some(joined) => joined.of_parts.iter().map(|&part| of_layout[part as usize]).collect(),
            None => of_layout,
        })
    }

    /// Passes of the last solve of the quasi-Newton method that each connected part had no use for, because its next step was
    /// round-off; empty for other methods. Waits for the device.
    pub fn unused_passes(&self) -> Result<Vec<u32>, GpuError> {
        if self.levels.is_none() {
            return Ok(Vec::new());
        }
        let record = usize::from(first_solve(&self.settings) == Solve::First);
        let bytes = self.read_buffer(Slot::Progress)?;
        let all = bytes.chunks_exact(size_of::<PartProgress>()).take(self.part_count);
        let left = |part: PartProgress| part.states[record].passes_left;
        Ok(all.map(|bytes| left(bytemuck::pod_read_unaligned(bytes))).collect())
    }

    fn part_records(&self) -> Result<Vec<PartControl>, GpuError> {
        let control = self.read_buffer(Slot::Control)?;
        let records = control[PARTS_START..].chunks_exact(size_of::<PartControl>());
        Ok(records.take(self.part_count).map(bytemuck::pod_read_unaligned).collect())
    }
}
