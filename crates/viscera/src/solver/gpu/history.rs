//! The warm-start reset on the device.

use super::clock::Marks;
use super::solver::GpuSolver;
use crate::model::Model;
use crate::solver::error::StepError;
use crate::solver::inputs::Inputs;

impl GpuSolver {
    /// Resets the warm start from where the vertices are on the device, as
    /// [`crate::solver::Solver::restart`] does: `inputs` and `dt` [s] are those of the next step, and of
    /// the inputs the anchors matter. Positions and velocities stay as they are.
    pub fn restart(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
    ) -> Result<(), StepError> {
        let layout = self.layout_of(model)?;
        let model = &*layout;
        crate::solver::inputs::check_step(dt, model, inputs)?;
        self.prepare_step(model, inputs, dt);
        self.outgoing.pass("restart", &self.uniforms.all, &[&self.restart], Marks::default());
        self.outgoing.submit();
        // Not every method takes over here what acts on vertices: the next step sends all of it.
        self.updates.clear();
        self.forget_pairs();
        self.multiplier_dt = dt * self.solve_share();
        Ok(())
    }
}
