//! The quasi-Newton method on the device: seven dispatches for an iteration, ten with recovered-gradient tetrahedra.
//!
//! Every workgroup that needs a decision makes it for itself from the sums that the stages before it have left, so that no
//! dispatch only decides: `Judge` and the ends of solves are parts of what comes after them. A part that is done pays a look
//! at its record.

use super::on_device::{DeviceLevels, IS_THERE, share};
use super::preconditioner::tables::Header;
use super::stage::{QuasiNewtonStage, Solve};
use crate::solver::gpu::kernels::{self, Kernel};
use crate::solver::gpu::record::{Dispatch, Recorder};
use crate::solver::gpu::uniforms::Job;
use crate::solver::step::recovered::on_device::Extent;

/// Bits of a job's mode, as in `progress.wgsl`: which record is the newer one; solves whose last direction is judged.
const SECOND_RECORD: u32 = 1;
const UNCHECKED: u32 = 2;

impl Recorder<'_> {
    /// Writes a stage of a solve down.
    pub fn quasi_newton_stage(
        &self,
        stage: QuasiNewtonStage,
        solve: Solve,
        into: &mut Vec<Dispatch>,
    ) {
        let Some(levels) = self.levels.filter(|_| IS_THERE) else { return };
        let Header { groups, fine, ordinary, vertices, pairs, contact, .. } = levels.header;
        match stage {
            QuasiNewtonStage::Begin => {
                into.push(self.vertices(&kernels::APPLY_UPDATES, 1));
                // Behind the pins of the step, which tell how far tissue goes in it.
                self.find_meetings(into);
                let mut begin = self.of_vertices(&kernels::BEGIN_SOLVES, solve);
                // Two solves leave the record of the second.
                begin.job.set_first = u32::from(solve == Solve::First);
                into.push(begin);
                // Contact of the finest level's nodes comes behind, from a workgroup of its own on.
                let nodes = if contact > 0 { groups.next_multiple_of(8) + fine } else { 0 };
                let things = groups.max(nodes);
                into.extend(self.shared(&kernels::TURN_GROUPS, things, 8, self.job(solve)));
                let blocks = vertices + ordinary + pairs;
                into.extend(self.shared(&kernels::SUM_BLOCKS, blocks, 8, self.job(solve)));
                if pairs > 0 {
                    into.push(self.each_part(&kernels::INVERT_DENSE, Job::default()));
                }
            }
            QuasiNewtonStage::StartSolve(Solve::Second) => {
                into.push(self.of_vertices(&kernels::BEGIN_SECOND, solve));
            }
            QuasiNewtonStage::Evaluate => self.evaluate(solve, into),
            QuasiNewtonStage::Precondition => {
                let job = self.job(solve);
                into.extend(self.shared(&kernels::RESTRICT_GRADIENT, fine, 8, job));
                into.extend(self.correct_coarse(levels));
                into.extend(self.shared(&kernels::CORRECT_FINE, fine, 64, job));
            }
            QuasiNewtonStage::ChooseDirection => {
                into.push(self.of_vertices(&kernels::TAKE_TRIAL, solve));
            }
            QuasiNewtonStage::Advance => {
                into.push(self.of_vertices(&kernels::CHOOSE_DIRECTION, solve));
            }
            QuasiNewtonStage::LimitEnergy => self.limit_energy(solve, into),
            // Parts of the stages that follow.
            QuasiNewtonStage::StartSolve(Solve::First | Solve::Euler)
            | QuasiNewtonStage::Judge
            | QuasiNewtonStage::EndSolve(_)
            | QuasiNewtonStage::CheckEnergy => {}
        }
    }

    fn evaluate(&self, solve: Solve, into: &mut Vec<Dispatch>) {
        let Some(Extent { groups, averages }) = self.recovered else {
            into.extend(self.of_elements(&kernels::EVALUATE_ELEMENTS, solve));
            into.push(self.of_vertices(&kernels::EVALUATE_VERTICES, solve));
            return;
        };
        let of = |count: u32| Job { count, ..self.job(solve) };
        into.push(self.each(&kernels::RECOVER_GRADIENTS, of(groups)));
        into.extend(self.of_elements(&kernels::EVALUATE_RECOVERED, solve));
        into.push(self.each(&kernels::AVERAGE_VOLUMES, of(averages)));
        into.push(self.each(&kernels::GATHER_STRESSES, of(groups)));
        into.push(self.of_vertices(&kernels::EVALUATE_RECOVERED_VERTICES, solve));
    }

    fn limit_energy(&self, solve: Solve, into: &mut Vec<Dispatch>) {
        let Some(Extent { groups, averages }) = self.recovered else {
            let job = Job { count: self.pieces.count, ..self.job(solve) };
            into.push(self.each(&kernels::MEASURE_END, job));
            into.push(self.of_vertices(&kernels::END_STEP, solve));
            return;
        };
        let of = |count: u32| Job { count, ..self.job(solve) };
        // Vertices first: gradients ask whether the last trial is taken.
        into.push(self.of_vertices(&kernels::MEASURE_RECOVERED_END, solve));
        into.push(self.each(&kernels::RECOVER_ENDS, of(groups)));
        into.extend(self.of_elements(&kernels::MEASURE_RECOVERED_END, solve));
        into.push(self.each(&kernels::AVERAGE_ENDS, of(averages)));
        into.push(self.of_vertices(&kernels::END_RECOVERED_STEP, solve));
    }

    /// A workgroup for each piece of elements; nothing where there is none.
    fn of_elements(&self, kernel: &'static Kernel, solve: Solve) -> Option<Dispatch> {
        let count = self.pieces.first_of_vertices;
        (count > 0).then(|| self.each(kernel, Job { count, ..self.job(solve) }))
    }

    /// Coarser nodes, 32 a workgroup, and dense levels.
    fn correct_coarse(&self, levels: &DeviceLevels) -> Option<Dispatch> {
        let Header { fine, ordinary, pairs, .. } = levels.header;
        let coarse = (ordinary - fine).div_ceil(32);
        let dense = if pairs > 0 { self.layout.part_count() as u32 } else { 0 };
        let job = Job { first: fine, count: dense, set_first: coarse, ..Job::default() };
        let groups = coarse + dense;
        (groups > 0).then(|| Dispatch { groups, ..self.threads(&kernels::CORRECT_COARSE, job) })
    }

    fn job(&self, solve: Solve) -> Job {
        let second = if solve == Solve::Second { SECOND_RECORD } else { 0 };
        let unchecked = if solve == Solve::Euler { UNCHECKED } else { 0 };
        Job {
            mode: second | unchecked,
            parameter: share(self.settings) as f32,
            set_first: self.levels.map_or(1, |levels| levels.history),
            ..Job::default()
        }
    }

    /// A workgroup for each piece of vertices.
    fn of_vertices(&self, kernel: &'static Kernel, solve: Solve) -> Dispatch {
        let first = self.pieces.first_of_vertices;
        let count = self.pieces.count - first;
        self.each(kernel, Job { first, count, ..self.job(solve) })
    }

    /// So many things, some in a workgroup; nothing where there is none.
    fn shared(&self, kernel: &'static Kernel, count: u32, each: u32, job: Job) -> Option<Dispatch> {
        let dispatch = self.threads(kernel, Job { count, ..job });
        (count > 0).then(|| Dispatch { groups: count.div_ceil(each), ..dispatch })
    }
}
