//! The stages that all methods share as dispatches.
//!
//! Every stage of the guards tries all that it may try at once: all shares of a step, all lengths of a descent. Every
//! workgroup that needs a decision makes it for itself from the sums that the stage before it has left, and the parts
//! that a stage has nothing to do for pay a look at their record. Of a step that passes, the search is six dispatches
//! that do nothing.

use super::contacts::meetings::Meetings;
use super::contacts::on_device::{MOST_TOOLS, Samples};
use super::modes::*;
use super::stage::{GuardStage, StepStage};
use crate::settings::Start;
use crate::solver::gpu::kernels::{self, Kernel};
use crate::solver::gpu::record::{Dispatch, Recorder};
use crate::solver::gpu::uniforms::Job;
use crate::solver::quasi_newton::on_device::ahead;

impl Recorder<'_> {
    /// Writes a stage down.
    pub fn step_stage(&self, stage: StepStage, into: &mut Vec<Dispatch>) {
        match stage {
            // The state lives on the device.
            StepStage::ReadState | StepStage::WriteState => {}
            StepStage::FindContacts => {
                let dispatch = |samples: Samples| {
                    // Where the preconditioner turns to.
                    let parameter = ahead(self.settings) as f32;
                    let job = Job { count: samples.count, parameter, ..Job::default() };
                    self.threads(&kernels::FIND_CONTACTS, job)
                };
                into.extend(Samples::known(self.samples).map(dispatch));
            }
            StepStage::EndContacts => {
                if let Some(Samples { count, groups }) = Samples::known(self.samples) {
                    let of = |count: u32| Job { count, ..Job::default() };
                    into.push(self.threads(&kernels::END_CONTACTS, of(count)));
                    let dispatch = self.threads(&kernels::REPORT_TOOLS, of(groups));
                    into.push(Dispatch { groups: MOST_TOOLS as u32, ..dispatch });
                }
                if let Some(meetings) = Meetings::known(self.meetings) {
                    let job = Job { count: meetings.count(), ..Job::default() };
                    into.push(self.threads(&kernels::END_MEETINGS, job));
                }
            }
            StepStage::MeasureStrain => self.each_set(&kernels::MEASURE_STRAIN, into),
            StepStage::Predict { start, is_kept } => self.predict(start, is_kept, into),
            StepStage::UpdateVelocities => into.push(self.vertices(&kernels::UPDATE_VELOCITIES, 0)),
            StepStage::LimitEnergy => {
                let first = self.pieces.first_of_vertices;
                let count = self.pieces.count - first;
                let job = Job { first, count, ..Job::default() };
                into.push(self.each(&kernels::LIMIT_VELOCITIES, job));
            }
        }
    }

    /// Finds where tissue meets tissue: six dispatches, once a step.
    pub fn find_meetings(&self, into: &mut Vec<Dispatch>) {
        let Some(meetings) = Meetings::known(self.meetings) else { return };
        let of = |count: u32| Job { count, ..Job::default() };
        into.push(self.threads(&kernels::PLACE_SKIN, of(meetings.points)));
        into.push(self.threads(&kernels::TURN_SKIN, of(meetings.triangles)));
        into.push(self.threads(&kernels::BOX_SKIN, of(meetings.leaves)));
        let alone =
            |kernel: &'static Kernel, job: Job| Dispatch { groups: 1, ..self.threads(kernel, job) };
        let vertices = self.layout.vertex_count() as u32;
        let job = Job { set_first: meetings.levels, ..of(vertices) };
        into.push(alone(&kernels::PREPARE_SKIN, job));
        let parameter = ahead(self.settings) as f32;
        let job = Job { parameter, ..of(meetings.count()) };
        into.push(self.threads(&kernels::FIND_MEETINGS, job));
        let job = Job { set_first: meetings.passes(), ..of(meetings.count()) };
        into.push(alone(&kernels::SORT_MEETINGS, job));
    }

    /// Writes a stage of the guard down.
    pub fn guard_stage(&self, stage: GuardStage, into: &mut Vec<Dispatch>) {
        match stage {
            GuardStage::ChooseStart => {
                into.push(self.all_pieces(&kernels::EVALUATE, WITH_STARTS));
                into.push(self.parts_of_long(&kernels::TAKE, CHOOSES));
            }
            GuardStage::EvaluateStep { with_starts } => {
                let starts = if with_starts { WITH_STARTS } else { 0 };
                into.push(self.all_pieces(&kernels::EVALUATE, WITH_MOTION | starts));
            }
            GuardStage::JudgeStep { chooses } => {
                let chooses = if chooses { CHOOSES } else { 0 };
                let mode = JUDGES_STEP | chooses | TRIES_SHARES | LOADS_FORCES;
                into.push(self.all_pieces(&kernels::SEARCH, mode));
            }
            GuardStage::TryLengths { after_shares } => {
                let shares = if after_shares { PICKS_SHARE } else { 0 };
                into.push(self.all_pieces(&kernels::SEARCH, shares | TRIES_LENGTHS));
            }
            GuardStage::TakeLength => {
                into.push(self.all_pieces(&kernels::SEARCH, PICKS_LENGTH | LOADS_FORCES));
            }
            GuardStage::MoveRejected => {
                into.push(self.all_pieces(&kernels::EVALUATE, WITH_MOTION | IF_REJECTED));
            }
        }
    }

    fn predict(&self, start: Start, is_kept: bool, into: &mut Vec<Dispatch>) {
        let mut begin = self.vertices(&kernels::APPLY_UPDATES, 1);
        begin.job.parameter = self.settings.chebyshev_radius as f32;
        into.push(begin);
        let mode = match start {
            Start::Previous => 0,
            Start::Inertial => 1,
            Start::Predicted => 2,
            Start::Auto => 3,
        };
        let keeps = if is_kept { 4 } else { 0 };
        into.push(self.vertices(&kernels::PREDICT, mode | keeps));
    }

    /// A workgroup for each piece of the sums.
    pub fn all_pieces(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        self.each(kernel, Job { count: self.pieces.count, mode, ..Job::default() })
    }
}
