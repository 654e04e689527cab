//! The explicit method on the device: two dispatches for a small step, five with recovered-gradient tetrahedra. Tools add none to
//! small steps, and three or five to the end of a step, which limit its energy.

use super::stage::ExplicitStage;
use crate::solver::gpu::kernels::{self, Kernel};
use crate::solver::gpu::record::{Dispatch, Recorder};
use crate::solver::gpu::uniforms::Job;
use crate::solver::step::contacts::on_device::Samples;
use crate::solver::step::recovered::on_device::Extent;

/// Places are where they were one small step before the first; for energies, at the start of the step, with their changes.
const BEFORE: u32 = 1;
const OF_ENERGY: u32 = 2;

impl Recorder<'_> {
    /// Writes a stage down.
    pub fn explicit_stage(&self, stage: ExplicitStage, into: &mut Vec<Dispatch>) {
        match stage {
            ExplicitStage::Begin => self.begin_explicit(into),
            ExplicitStage::LoadForces => self.load_forces(into),
            ExplicitStage::Advance => {
                let advance = self.with_contact([
                    self.either(&kernels::ADVANCE_EXPLICIT, &kernels::ADVANCE_RECOVERED),
                    self.either(&kernels::ADVANCE_TOUCHED, &kernels::ADVANCE_TOUCHED_RECOVERED),
                ]);
                into.push(self.vertices(advance, 0));
            }
            ExplicitStage::End => {
                let end = self.with_contact([
                    self.either(&kernels::END_EXPLICIT, &kernels::END_EXPLICIT_RECOVERED),
                    self.either(&kernels::END_TOUCHED, &kernels::END_TOUCHED_RECOVERED),
                ]);
                // Where the step ends replaces the velocities that it began with.
                self.measure_energy(into);
                into.push(self.vertices(end, 0));
                if Samples::known(self.samples).is_some() {
                    let limit =
                        self.either(&kernels::LIMIT_ENERGY, &kernels::LIMIT_RECOVERED_ENERGY);
                    let first = self.pieces.first_of_vertices;
                    let count = self.pieces.count - first;
                    into.push(self.each(limit, Job { first, count, ..Job::default() }));
                }
            }
        }
    }

    /// The second kernel where tissue may meet tools.
    fn with_contact(&self, [without, with]: [&'static Kernel; 2]) -> &'static Kernel {
        if Samples::known(self.samples).is_some() { with } else { without }
    }

    /// How the energy of parts changes in a step, where tissue may meet tools.
    fn measure_energy(&self, into: &mut Vec<Dispatch>) {
        let Some(Samples { count, .. }) = Samples::known(self.samples) else { return };
        let job = Job { count, ..Job::default() };
        into.push(self.threads(&kernels::SLIP_CONTACTS, job));
        let Some(extent) = self.recovered else {
            into.push(self.all_pieces(&kernels::MEASURE_ENERGY, 0));
            return;
        };
        into.push(self.recover_places(extent, OF_ENERGY));
        into.push(self.all_pieces(&kernels::MEASURE_RECOVERED_ENERGY, 0));
        let job = Job { count: extent.averages, ..Job::default() };
        into.push(self.each(&kernels::AVERAGE_ENERGIES, job));
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
        let first = tet_count + self.element_count();
        let count = first + Samples::known(self.samples).map_or(0, |samples| samples.count);
        let job = Job { first, count, tet_count, ..Job::default() };
        let load = self.with_contact([
            self.either(&kernels::LOAD_FORCES, &kernels::LOAD_RECOVERED_FORCES),
            self.either(&kernels::LOAD_TOUCHED, &kernels::LOAD_TOUCHED_RECOVERED),
        ]);
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
