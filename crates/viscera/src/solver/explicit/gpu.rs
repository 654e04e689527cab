//! The explicit method on the device: two dispatches for a small step.

use super::stage::ExplicitStage;
use crate::solver::gpu::kernels;
use crate::solver::gpu::record::{Dispatch, Recorder};
use crate::solver::gpu::uniforms::Job;

impl Recorder<'_> {
    /// Writes a stage down.
    pub fn explicit_stage(&self, stage: ExplicitStage, into: &mut Vec<Dispatch>) {
        match stage {
            ExplicitStage::Begin => self.begin_explicit(into),
            ExplicitStage::LoadForces => into.push(self.load_forces()),
            ExplicitStage::Advance => into.push(self.vertices(&kernels::ADVANCE_EXPLICIT, 0)),
            ExplicitStage::End => into.push(self.vertices(&kernels::END_EXPLICIT, 0)),
        }
    }

    fn begin_explicit(&self, into: &mut Vec<Dispatch>) {
        into.push(self.vertices(&kernels::APPLY_UPDATES, 0));
        into.push(self.vertices(&kernels::BEGIN_EXPLICIT, 0));
        if self.layout.is_viscous() {
            let job = Job { count: self.tet_threads(), ..Job::default() };
            into.push(self.threads(&kernels::BEGIN_STRAIN, job));
        }
    }

    fn load_forces(&self) -> Dispatch {
        let tet_count = self.tet_threads();
        let count = tet_count + self.element_count();
        let job = Job { count, tet_count, ..Job::default() };
        let threads = self.threads(&kernels::LOAD_FORCES, job);
        // One thread counts the small steps, whatever there is to load.
        Dispatch { groups: threads.groups.max(1), ..threads }
    }
}
