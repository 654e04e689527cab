//! Times of steps by the device's own clock: timestamps where compute passes begin and end.
//!
//! ```text
//! time_steps   ordinary steps, one pass each:  |begin step|step| ... |step end|
//! time_step    one step, a pass for each stage:  |prologue|...|first iteration|...|all later ones|epilogue|...|
//! ```
//!
//! The library reads no clock of the host's: a caller that wants wall time as well takes it around these calls,
//! which return when the device is done.

use super::clock::{Clock, Marks};
use super::error::GpuError;
use super::solver::GpuSolver;
use crate::model::Model;
use crate::solver::inputs::Inputs;
use crate::solver::plan::Stage;

/// Parts of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepPart {
    /// Once, before the iterations.
    Prologue,
    /// The first iteration, or the first small step of an explicit method.
    Iteration,
    /// Once, after the iterations.
    Epilogue,
}

impl StepPart {
    const ALL: [Self; 3] = [Self::Prologue, Self::Iteration, Self::Epilogue];

    /// As a report calls it.
    pub fn name(self) -> &'static str {
        ["prologue", "iteration", "epilogue"][self as usize]
    }
}

/// The time of a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StageTime {
    /// When it ran.
    pub part: StepPart,
    /// The stage; of all colours of a sweep, the first.
    pub stage: Stage,
    /// How many dispatches it is.
    pub dispatches: usize,
    /// From the beginning of its pass to the end [s].
    pub seconds: f64,
}

impl StageTime {
    /// The stage's name, without what it is given.
    pub fn name(&self) -> String {
        self.stage.name()
    }
}

/// The time of a step, stage by stage. Passes of their own cost time: the sum is more than a step takes.
#[derive(Clone, Debug, PartialEq)]
pub struct StepTimes {
    /// From the beginning of the first pass to the end of the last [s].
    pub seconds: f64,
    /// Stages that have dispatches, in order: prologue, first iteration, epilogue.
    pub stages: Vec<StageTime>,
    /// Iterations after the first.
    pub later_iterations: u32,
    /// Their time together [s].
    pub later_seconds: f64,
}

impl GpuSolver {
    /// So many ordinary steps with the same inputs, and waits for them. Returns what they took by the
    /// device's clock [s]; nothing where it has none.
    pub fn time_steps(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
        count: u32,
    ) -> Result<Option<f64>, GpuError> {
        let clock = Clock::new(&self.device, 2);
        let around = clock.as_ref().map(|clock| clock.around(0)).unwrap_or_default();
        for step in 1..=count {
            let marks = if step == 1 { around } else { around.after_the_beginning() };
            let marks = if step == count { marks } else { marks.before_the_end() };
            self.step_marked(model, inputs, dt, marks)?;
        }
        match clock.filter(|_| count > 0) {
            Some(clock) => Ok(Some(clock.read(2)?[1])),
            None => self.wait().map(|()| None),
        }
    }

    /// One step whose stages are passes of their own, and waits for it: the first iteration stage by
    /// stage, all later ones as a whole. Nothing is returned where the device has no clock; the step is
    /// made all the same.
    pub fn time_step(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
    ) -> Result<Option<StepTimes>, GpuError> {
        let stage_count = self.stages.iter().map(Vec::len).sum::<usize>() as u32;
        let Some(clock) = Clock::new(&self.device, 2 * (stage_count + 1)) else {
            self.step(model, inputs, dt)?;
            return self.wait().map(|()| None);
        };
        let repeats = self.begin_step(model, inputs, dt)?;
        let later_iterations = repeats.saturating_sub(1);
        let mut stages = Vec::new();
        for (list, part) in StepPart::ALL.into_iter().enumerate() {
            if part == StepPart::Epilogue {
                // Its readings are the last, whether or not there are any.
                self.submit_repeats(later_iterations, clock.around(2 * stage_count));
            }
            let is_left_out = part == StepPart::Iteration && repeats == 0;
            for range in self.stages[list].iter().filter(|_| !is_left_out) {
                let marks = clock.around(2 * stages.len() as u32);
                let dispatches = &self.ready[list][range.dispatches.clone()];
                self.outgoing.pass("stage", &self.uniforms.all, &[dispatches], marks);
                self.outgoing.submit();
                let (stage, dispatches) = (range.stage, range.dispatches.len());
                stages.push(StageTime { part, stage, dispatches, seconds: 0.0 });
            }
        }
        self.multiplier_dt = dt * self.solve_share();
        let later = stages.len();
        let pairs = later + usize::from(later_iterations > 0);
        let readings = clock.read(2 * pairs as u32)?;
        let between = |i: usize| readings[2 * i + 1] - readings[2 * i];
        for (i, stage) in stages.iter_mut().enumerate() {
            stage.seconds = between(i);
        }
        let later_seconds = if pairs > later { between(later) } else { 0.0 };
        let seconds = readings.iter().copied().fold(0.0, f64::max);
        Ok(Some(StepTimes { seconds, stages, later_iterations, later_seconds }))
    }

    /// So many iterations, in submissions that no driver takes for a hang.
    pub(super) fn submit_repeats(&mut self, mut left: u32, marks: Marks<'_>) {
        let mut now = marks;
        while left > 0 {
            let count = left.min(self.most_repeats());
            left -= count;
            let lists = vec![&self.ready[1][..]; count as usize];
            let marks_of_pass = if left > 0 { now.before_the_end() } else { now };
            self.outgoing.pass("iterations", &self.uniforms.all, &lists, marks_of_pass);
            self.outgoing.submit();
            now = marks.after_the_beginning();
        }
    }
}
