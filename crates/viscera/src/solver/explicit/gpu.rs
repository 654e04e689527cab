//! The explicit method on the device: two dispatches for a small step, five with recovered-gradient tetrahedra.

use super::stage::ExplicitStage;
use crate::solver::gpu::kernels::{self, Kernel};
use crate::solver::gpu::record::{Dispatch, Recorder};
use crate::solver::gpu::uniforms::Job;
use crate::solver::step::recovered::on_device::Extent;

/// Places are where they were one small step before the first.
const BEFORE: u32 = 1;

impl Recorder<'_> {
    /// Writes a stage down.
    pub fn explicit_stage(&self, stage: ExplicitStage, into: &mut Vec<Dispatch>) {
        match stage {
            ExplicitStage::Begin => self.begin_explicit(into),
            ExplicitStage::LoadForces => self.load_forces(into),
            ExplicitStage::Advance => {
                into.push(self.vertices(
                    self.either(&kernels::ADVANCE_EXPLICIT, &kernels::ADVANCE_RECOVERED),
                    0,
                ));
            }
            ExplicitStage::End => {
                let end = self.either(&kernels::END_EXPLICIT, &kernels::END_EXPLICIT_RECOVERED);
                into.push(self.vertices(end, 0));
            }
        }
    }

    /// The kernel for plain tetrahedra, or that for recovered-gradient ones.
    fn either(&self, plain: &'static Kernel, recovered: &'static Kernel) -> &'static Kernel {
        if self.recovered.is_some() { recovered } else { plain }
    }

    fn begin_explicit(&self, into: &mut Vec<Dispatch>) {
        into.push(self.vertices(&kernels::APPLY_UPDATES, 0));
        into.push(self.vertices(&kernels::BEGIN_EXPLICIT, 0));
        if self.layout.is_viscous() {
            into.extend(self.recovered.map(|extent| self.recover_places(extent, BEFORE)));
            let job = Job { count: self.tet_threads(), ..Job::default() };
            let begin = self.either(&kernels::BEGIN_STRAIN, &kernels::BEGIN_STRAIN_RECOVERED);
            into.push(self.threads(begin, job));
        }
    }

    fn recover_places(&self, Extent { groups, .. }: Extent, mode: u32) -> Dispatch {
        self.each(&kernels::RECOVER_PLACES, Job { count: groups, mode, ..Job::default() })
    }

    fn load_forces(&self, into: &mut Vec<Dispatch>) {
        into.extend(self.recovered.map(|extent| self.recover_places(extent, 0)));
        let tet_count = self.tet_threads();
        let count = tet_count + self.element_count();
        let job = Job { count, tet_count, ..Job::default() };
        let load = self.either(&kernels::LOAD_FORCES, &kernels::LOAD_RECOVERED_FORCES);
        let threads = self.threads(load, job);
        // One thread counts the small steps, whatever there is to load.
        into.push(Dispatch { groups: threads.groups.max(1), ..threads });
        if let Some(Extent { groups, averages }) = self.recovered {
            let of = |count: u32| Job { count, ..Job::default() };
            into.push(self.each(&kernels::AVERAGE_PRESSURES, of(averages)));
            into.push(self.each(&kernels::GATHER_SMALL_STRESSES, of(groups)));
        }
    }
}
