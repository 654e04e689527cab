//! Times of steps by the device's own clock: timestamps where compute passes begin and end.
//!
//! ```text
//! time_steps   ordinary steps, one pass each:  |begin step|step| ... |step end|
//! time_step    one step, a pass for each stage:  |prologue|...|first iteration|...|all later ones|epilogue|...|
//! ```
//!
//! The library reads no clock of the host's: a caller that wants wall time as well takes it around these calls,
//! which return when the device is done.

use super::device::Device;
use super::error::GpuError;
use super::reading;
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

/// Where in a step its clock is read; nowhere where there is none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Marks<'a> {
    clock: Option<&'a Clock>,
    begin: Option<u32>,
    end: Option<u32>,
}

impl Marks<'_> {
    /// Of all passes but the last.
    pub fn before_the_end(self) -> Self {
        Self { end: None, ..self }
    }

    /// Of all passes but the first.
    pub fn after_the_beginning(self) -> Self {
        Self { begin: None, ..self }
    }

    /// For the pass that is made.
    pub fn writes(&self) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let clock = self.clock.filter(|_| self.begin.is_some() || self.end.is_some())?;
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &clock.queries,
            beginning_of_pass_write_index: self.begin,
            end_of_pass_write_index: self.end,
        })
    }
}

/// The device's clock.
#[derive(Debug)]
pub(super) struct Clock {
    device: Device,
    queries: wgpu::QuerySet,
    /// Of a tick [s].
    tick: f64,
}

impl Clock {
    /// For so many readings. Nothing where the device has no clock, or more is asked than a set of queries holds.
    pub fn new(device: &Device, count: u32) -> Option<Self> {
        let tick = 1e-9 * f64::from(device.queue.get_timestamp_period());
        let has_one = device.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        if !has_one || tick <= 0.0 || count > wgpu::QUERY_SET_MAX_QUERIES {
            return None;
        }
        let queries = device.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("clock"),
            ty: wgpu::QueryType::Timestamp,
            count,
        });
        Some(Self { device: device.clone(), queries, tick })
    }

    /// Two readings around a pass, the first of them numbered so.
    pub fn around(&self, first: u32) -> Marks<'_> {
        Marks { clock: Some(self), begin: Some(first), end: Some(first + 1) }
    }

    /// Waits for the device; the first so many readings, since the very first of them [s]. Drivers wait
    /// for readings that were never asked for.
    pub fn read(&self, count: u32) -> Result<Vec<f64>, GpuError> {
        let size = u64::from(count) * u64::from(wgpu::QUERY_SIZE);
        let resolved = self.device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readings"),
            size,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("readings") };
        let mut encoder = self.device.device.create_command_encoder(&descriptor);
        encoder.resolve_query_set(&self.queries, 0..count, &resolved, 0);
        self.device.queue.submit([encoder.finish()]);
        let mut readings = Vec::new();
        reading::read(&self.device, &[(&resolved, 0..size)], |read| {
            let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(read[0]);
            let since = |t: &u64| t.wrapping_sub(ticks[0]) as i64 as f64 * self.tick;
            readings = ticks.iter().map(since).collect();
        })?;
        Ok(readings)
    }
}

impl Device {
    /// Whether it can measure the time of its work.
    pub fn has_clock(&self) -> bool {
        Clock::new(self, 2).is_some()
    }
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
