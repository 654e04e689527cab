//! Step guard, guard of accelerated iterates and energy limit as dispatches.
//!
//! ```text
//! end of a step    evaluate all starts and the end;  judge, try all shares of the step;  pick one, or three
//!                  descents;  evaluate where a step that was rejected ends;  limit, velocities
//! each iterate     evaluate;  judge, take the plain sweep where it is bad;  evaluate that;  judge, a descent at the
//!                  second failure
//! ```
//!
//! Of a step that passes, the search is six dispatches that do nothing. Where no iterates are guarded the best
//! start is needed at the end only, and found there.

use super::guard::DESCENTS;
use super::modes::*;
use super::stage::StepStage;
use crate::settings::Start;
use crate::solver::gpu::kernels::{self, Kernel};
use crate::solver::gpu::record::{Dispatch, Recorder};
use crate::solver::gpu::uniforms::Job;
use crate::solver::xpbd::guards_mixtures;

impl Recorder<'_> {
    /// Writes a stage down.
    pub fn step_stage(&self, stage: StepStage, into: &mut Vec<Dispatch>) {
        match stage {
            // The state lives on the device.
            StepStage::ReadState | StepStage::WriteState => {}
            StepStage::MeasureStrain => self.each_set(&kernels::MEASURE_STRAIN, into),
            StepStage::Predict(start) => self.predict(start, into),
            StepStage::ChooseStart => self.choose_start(into),
            StepStage::GuardStep => self.guard_step(into),
            StepStage::UpdateVelocities => into.push(self.vertices(&kernels::UPDATE_VELOCITIES, 0)),
            StepStage::LimitEnergy => {
                let first = self.pieces.first_of_vertices;
                let count = self.pieces.count - first;
                let job = Job { first, count, ..Job::default() };
                into.push(self.each(&kernels::LIMIT_VELOCITIES, job));
            }
        }
    }

    fn predict(&self, start: Start, into: &mut Vec<Dispatch>) {
        let mut begin = self.vertices(&kernels::APPLY_UPDATES, 1);
        begin.job.parameter = self.settings.chebyshev_radius as f32;
        into.push(begin);
        let mode = match start {
            Start::Previous => 0,
            Start::Inertial => 1,
            Start::Predicted => 2,
            Start::Auto => 3,
        };
        let keeps_starts = if self.settings.guards_steps() { 4 } else { 0 };
        let mut predict = self.vertices(&kernels::PREDICT, mode | keeps_starts);
        predict.job.set_first = self.stride;
        into.push(predict);
    }

    pub fn choose_start(&self, into: &mut Vec<Dispatch>) {
        if guards_mixtures(self.settings) {
            into.push(self.all_pieces(&kernels::EVALUATE, WITH_STARTS));
            into.push(self.parts_of_long(&kernels::TAKE, CHOOSES));
        }
    }

    pub fn guard_iterate(&self, into: &mut Vec<Dispatch>) {
        into.push(self.all_pieces(&kernels::EVALUATE, 0));
        into.push(self.parts_of_long(&kernels::TAKE, JUDGES_MIXTURE));
        into.push(self.all_pieces(&kernels::EVALUATE, UNLESS_GOOD));
        into.push(self.all_pieces(&kernels::SEARCH, JUDGES_PLAIN | LOADS_FORCES));
        into.push(self.all_pieces(&kernels::SEARCH, TRIES_LENGTHS));
        into.push(self.parts_of_long(&kernels::TAKE, TAKES_DESCENT));
    }

    pub fn guard_step(&self, into: &mut Vec<Dispatch>) {
        let [asked, chooses] = match guards_mixtures(self.settings) {
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

    fn all_pieces(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        self.each(kernel, Job { count: self.pieces.count, mode, ..Job::default() })
    }
}
