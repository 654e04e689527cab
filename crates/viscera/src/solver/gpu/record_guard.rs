//! Step guard, guard of mixtures and energy limit as dispatches.
//!
//! ```text
//! end of a step    evaluate all starts and the end;  judge, try all shares of the step;  pick one, or three
//!                  descents;  evaluate where a step that was taken back ends;  limit, velocities
//! each mixture     evaluate;  judge, take the plain sweep where it is bad;  evaluate that;  judge, a descent at the
//!                  second failure
//! ```
//!
//! Of a step that passes, the search is six dispatches that do nothing. Where no mixtures are guarded the best
//! start is needed at the end only, and found there.

use super::kernels::{self, Kernel};
use super::record::{Dispatch, Job, Recorder};
use crate::settings::{Acceleration, AndersonGuard};
use crate::solver::guard::DESCENTS;

macro_rules! modes {
    ($($name:ident = $value:literal;)*) => {
        $(const $name: u32 = $value;)*

        /// Bits of `Job::mode` in the kernels of the guard.
        pub(super) const MODES: &[(&str, u32)] = &[$((stringify!($name), $name)),*];
    };
}

modes! {
    // Of `evaluate`.
    WITH_STARTS = 1;
    WITH_MOTION = 2;
    UNLESS_GOOD = 4;
    IF_REJECTED = 8;
    // Of `search` and `take`: what is decided,
    CHOOSES = 1;
    JUDGES_STEP = 2;
    JUDGES_MIXTURE = 4;
    JUDGES_PLAIN = 8;
    PICKS_SHARE = 16;
    PICKS_LENGTH = 32;
    TAKES_DESCENT = 64;
    // and what is done: descents start from one range of the ground and the other in turn.
    TRIES_SHARES = 128;
    LOADS_FORCES = 256;
    TRIES_LENGTHS = 512;
    FROM_AHEAD = 1024;
}

impl Recorder<'_> {
    fn guards_mixtures(&self) -> bool {
        self.settings.acceleration == Acceleration::Anderson
            && self.settings.guard_of_mixtures() == AndersonGuard::Energy
    }

    pub(super) fn choose_start(&self, into: &mut Vec<Dispatch>) {
        if self.guards_mixtures() {
            into.push(self.all_pieces(&kernels::EVALUATE, WITH_STARTS));
            into.push(self.parts_of_long(&kernels::TAKE, CHOOSES));
        }
    }

    pub(super) fn guard_iterate(&self, into: &mut Vec<Dispatch>) {
        into.push(self.all_pieces(&kernels::EVALUATE, 0));
        into.push(self.parts_of_long(&kernels::TAKE, JUDGES_MIXTURE));
        into.push(self.all_pieces(&kernels::EVALUATE, UNLESS_GOOD));
        into.push(self.all_pieces(&kernels::SEARCH, JUDGES_PLAIN | LOADS_FORCES));
        into.push(self.all_pieces(&kernels::SEARCH, TRIES_LENGTHS));
        into.push(self.parts_of_long(&kernels::TAKE, TAKES_DESCENT));
    }

    pub(super) fn guard_step(&self, into: &mut Vec<Dispatch>) {
        let [asked, chooses] = match self.guards_mixtures() {
            true => [WITH_MOTION, 0],
            false => [WITH_MOTION | WITH_STARTS, CHOOSES],
        };
        into.push(self.all_pieces(&kernels::EVALUATE, asked));
        let judges = JUDGES_STEP | chooses | TRIES_SHARES | LOADS_FORCES;
        into.push(self.all_pieces(&kernels::SEARCH, judges));
        let mut from = 0;
        into.push(self.all_pieces(&kernels::SEARCH, PICKS_SHARE | TRIES_LENGTHS));
        for _ in 1..DESCENTS {
            into.push(self.all_pieces(&kernels::SEARCH, PICKS_LENGTH | LOADS_FORCES | from));
            from ^= FROM_AHEAD;
            into.push(self.all_pieces(&kernels::SEARCH, TRIES_LENGTHS | from));
        }
        // The last length is picked along `TRIAL`.
        const { assert!(DESCENTS % 2 == 1) };
        into.push(self.all_pieces(&kernels::EVALUATE, WITH_MOTION | IF_REJECTED));
    }

    pub(super) fn limit_energy(&self, into: &mut Vec<Dispatch>) {
        let first = self.pieces.first_of_vertices;
        let count = self.pieces.count - first;
        into.push(self.each(&kernels::LIMIT_VELOCITIES, Job { first, count, ..Job::default() }));
    }

    fn all_pieces(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        self.each(kernel, Job { count: self.pieces.count, mode, ..Job::default() })
    }

    /// A workgroup for each that the job counts.
    fn each(&self, kernel: &'static Kernel, job: Job) -> Dispatch {
        Dispatch { groups: job.count, ..self.threads(kernel, job) }
    }
}
