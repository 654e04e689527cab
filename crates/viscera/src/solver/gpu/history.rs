//! A new history on the device (solver/history.rs): two dispatches in a step, of which the second does
//! nothing while all multipliers are numbers.

use super::GpuSolver;
use super::kernels;
use super::record::{Dispatch, Job, Recorder};
use super::timing::Marks;
use crate::elements::TetForm;
use crate::model::Model;
use crate::scalar::lanes::LANES;
use crate::solver::{Inputs, StepError};

/// Workgroups of a repair: enough for a device to be busy when there is something to repair, few enough to
/// cost little in all other steps.
const REPAIR_GROUPS: u32 = 512;

impl Recorder<'_> {
    /// [`crate::solver::plan::Stage::RepairMultipliers`].
    pub(super) fn repair_multipliers(&self, into: &mut Vec<Dispatch>) {
        into.push(self.parts_of_long(&kernels::FIND_BROKEN, 0));
        into.push(self.constitutive_multipliers(0));
    }

    /// What [`GpuSolver::restart`] does.
    pub(super) fn restart(&self) -> Vec<Dispatch> {
        let mut dispatches = vec![self.vertices(&kernels::APPLY_UPDATES, 0)];
        if self.model.tet_sets().iter().any(|set| set.viscous) {
            self.each_set(&kernels::MEASURE_STRAIN, &mut dispatches);
        }
        dispatches.push(self.constitutive_multipliers(1));
        dispatches
    }

    /// Of all constraints in one dispatch; `mode` as in history.wgsl.
    fn constitutive_multipliers(&self, mode: u32) -> Dispatch {
        let [green, neo] = self.model.tet_sets();
        let tet_count = self.tet_threads();
        let spring_count = self.model.springs.vertices.len() as u32;
        let job = Job {
            first: self.multipliers_first,
            count: tet_count + spring_count + self.model.attachments.vertices.len() as u32,
            set_first: green.block_count() as u32,
            multiplier_offset: neo.multiplier_offset as u32,
            viscous_offset: neo.viscous_offset as u32,
            is_viscous: u32::from(green.viscous) | u32::from(neo.viscous) << 1,
            mode,
            tet_count,
            spring_count,
            ..Job::default()
        };
        let form = if neo.is_empty() { TetForm::GreenStrain } else { neo.form };
        let threads = self.threads(&kernels::REPAIR_MULTIPLIERS, job);
        let groups = threads.groups.min(REPAIR_GROUPS);
        Dispatch { groups, variant: self.variant(form), ..threads }
    }

    /// Threads for all tetrahedra, lanes that only fill blocks up included.
    pub(super) fn tet_threads(&self) -> u32 {
        let blocks = self.model.tet_sets().into_iter().map(|set| set.block_count()).sum::<usize>();
        (LANES * blocks) as u32
    }
}

impl GpuSolver {
    /// Starts a new history from where the vertices are on the device, as
    /// [`crate::solver::Solver::restart`] does: `inputs` and `dt` [s] are those of the next step, and of
    /// the inputs the anchors matter. Positions and velocities stay as they are.
    pub fn restart(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.check_model(model)?;
        crate::solver::check_step(dt, model, inputs)?;
        self.prepare_step(model, inputs, dt);
        self.submit("restart", &[&self.restart], Marks::default());
        self.multiplier_dt = dt;
        Ok(())
    }
}
