//! Step guard, guard of mixtures and energy limit as dispatches.
//!
//! ```text
//! end of a step    evaluate all starts and the end, settle (which goes on alone where the step is taken
//!                  back), evaluate where it did, limit of each part, velocities
//! each mixture     evaluate, settle, take the plain sweep where it is bad;  evaluate that, settle, take
//! ```
//!
//! Where no mixtures are guarded the best start is needed at the end only, and found there.

use super::kernels::{self, Kernel};
use super::record::{Dispatch, Job, Recorder};
use crate::settings::{Acceleration, AndersonGuard};

/// Modes of potential.wgsl and guard.wgsl.
const WITH_STARTS: u32 = 1;
const WITH_MOTION: u32 = 2;
const UNLESS_GOOD: u32 = 4;
const IF_REJECTED: u32 = 8;
const CHOOSES: u32 = 1;
const JUDGES: u32 = 2;
const JUDGES_MIXTURE: u32 = 4;
const JUDGES_PLAIN: u32 = 8;

impl Recorder<'_> {
    fn guards_mixtures(&self) -> bool {
        self.settings.acceleration == Acceleration::Anderson
            && self.settings.guard_of_mixtures() == AndersonGuard::Energy
    }

    pub(super) fn choose_start(&self, into: &mut Vec<Dispatch>) {
        if self.guards_mixtures() {
            into.push(self.each(&kernels::EVALUATE, 0, self.pieces.count, WITH_STARTS));
            into.push(self.each(&kernels::SETTLE, 0, 1, CHOOSES));
            into.push(self.long(&kernels::TAKE, 0));
        }
    }

    pub(super) fn guard_iterate(&self, into: &mut Vec<Dispatch>) {
        for (evaluation, verdict) in [(0, JUDGES_MIXTURE), (UNLESS_GOOD, JUDGES_PLAIN)] {
            into.push(self.each(&kernels::EVALUATE, 0, self.pieces.count, evaluation));
            into.push(self.each(&kernels::SETTLE, 0, 1, verdict));
            into.push(self.long(&kernels::TAKE, 1));
        }
    }

    pub(super) fn guard_step(&self, into: &mut Vec<Dispatch>) {
        let [asked, verdict] = match self.guards_mixtures() {
            true => [WITH_MOTION, JUDGES],
            false => [WITH_MOTION | WITH_STARTS, JUDGES | CHOOSES],
        };
        into.push(self.each(&kernels::EVALUATE, 0, self.pieces.count, asked));
        into.push(self.each(&kernels::SETTLE, 0, 1, verdict));
        // The energy limit takes over what pieces leave.
        let again = WITH_MOTION | IF_REJECTED;
        into.push(self.each(&kernels::EVALUATE, 0, self.pieces.count, again));
    }

    pub(super) fn limit_energy(&self, into: &mut Vec<Dispatch>) {
        let parts = self.model.part_count() as u32;
        into.push(self.each(&kernels::LIMIT_PARTS, 0, parts, 0));
        let first = self.pieces.first_of_vertices;
        let count = self.pieces.count - first;
        into.push(self.each(&kernels::LIMIT_VELOCITIES, first, count, 0));
    }

    /// A workgroup for each of so many.
    fn each(&self, kernel: &'static Kernel, first: u32, count: u32, mode: u32) -> Dispatch {
        let job = Job { first, count, mode, ..Job::default() };
        Dispatch { groups: count, ..self.threads(kernel, job) }
    }
}
