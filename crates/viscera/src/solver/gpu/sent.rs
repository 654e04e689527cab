//! A frame whose results are on their way: nobody waits for the device, which browsers forbid.

use super::error::GpuError;
use super::reading::{Reading, Sent};
use super::solver::GpuSolver;
use crate::model::Model;
use crate::state::State;

impl GpuSolver {
    /// Asks for what [`GpuSolver::read_frame`] reads of the state behind the last step and, where `with_balance`, for
    /// what [`GpuSolver::force_balance`] needs. Does not wait.
    pub fn ask_for_frame(&mut self, with_balance: bool) -> Result<(), GpuError> {
        let slots = if with_balance { self.balance_slots() } else { Vec::new() };
        let mut ranges = self.frame_ranges().to_vec();
        ranges.extend(slots.into_iter().map(|slot| self.whole(slot)));
        self.sent = Sent { awaited: Some(Reading::start(&self.device, &ranges)?), balance: None };
        Ok(())
    }

    /// Takes over what was asked for, as [`GpuSolver::read_frame`] does; nothing while it is under way. A force balance is
    /// measured without waiting then. Does not wait.
    pub fn take_frame(
        &mut self,
        model: &Model<f32>,
        state: &mut State<f32>,
    ) -> Result<Option<u64>, GpuError> {
        let layout = self.layout_of(model)?;
        let Some(reading) = &self.sent.awaited else { return Ok(None) };
        let Some(arrived) = reading.has_arrived(&self.device)? else { return Ok(None) };
        let ((rejected, wrenches), balance) = arrived.look(&self.device, |read| {
            let (frame, balance) = read.split_at(self.frame_ranges().len());
            let balance: Vec<Vec<u8>> = balance.iter().map(|bytes| bytes.to_vec()).collect();
            (self.take_frame_parts(&layout, state, frame), balance)
        })?;
        self.tools.wrenches = wrenches;
        self.sent = Sent { awaited: None, balance: Some(balance).filter(|all| !all.is_empty()) };
        Ok(Some(rejected))
    }
}
