//! A second solver of a model beside another, on the same device.

use super::error::GpuError;
use super::slots::Slot;
use super::solver::GpuSolver;
use crate::model::Model;
use crate::state::State;

impl GpuSolver {
    /// Another solver with the same settings, in a state of its own; both share kernels.
    pub(crate) fn second(&self, model: &Model<f32>, state: &State<f32>) -> Result<Self, GpuError> {
        let mut second = Self::new(&self.device, model, &self.settings)?;
        second.write(model, state)?;
        Ok(second)
    }

    /// Goes on from where the other is, while tools touch nothing in either: what friction keeps is not taken over. Does not
    /// wait.
    pub(crate) fn follow(&mut self, other: &Self) {
        let mut encoder = self.encoder("follow");
        for slot in [Slot::Unknowns, Slot::Velocities] {
            let ([from, size], [to, _]) = (other.buffers.span(slot), self.buffers.span(slot));
            let [source, target] = [other, &*self].map(|solver| solver.buffers.buffer(slot));
            encoder.copy_buffer_to_buffer(source, from, target, to, size);
        }
        self.device.queue.submit([encoder.finish()]);
        self.multiplier_dt = other.multiplier_dt;
        self.forget_pairs();
    }
}
