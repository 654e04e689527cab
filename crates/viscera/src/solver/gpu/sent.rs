//! A frame whose results are on their way: nobody waits for the device, which browsers forbid.

use super::error::GpuError;
use super::reading::{Reading, Sent};
use super::solver::GpuSolver;
use crate::model::Model;
use crate::solver::report::FrameReading;
use crate::state::State;

impl GpuSolver {
    /// Asks for what [`GpuSolver::read_frame`] reads of the state behind the last step, and for what
    /// [`GpuSolver::force_balance`] needs where `reading` says so. Does not wait.
    pub fn ask_for_frame(&mut self, reading: FrameReading) -> Result<(), GpuError> {
        let awaited = Reading::start(&self.device, &self.frame_ranges(reading))?;
        self.sent = Sent { awaited: Some(awaited), balance: None };
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
            let of_state = self.frame_ranges(FrameReading::State).len();
            let balance = read.get(of_state..).unwrap_or_default();
            let balance: Vec<Vec<u8>> = balance.iter().map(|bytes| bytes.to_vec()).collect();
            self.take_moves(&layout, state, read);
            (self.take_forces(read), balance)
        })?;
        self.tools.wrenches = wrenches;
        self.sent = Sent { awaited: None, balance: Some(balance).filter(|all| !all.is_empty()) };
        Ok(Some(rejected))
    }
}
