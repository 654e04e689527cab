//! The graphics processor: solvers on it, and its memory.

use super::computers::{
    Computer, Elapsed, SolverFacts, StageLine, Stepper, settings, step_size, swing,
};
use super::measurement::Bench;
use super::results::AdapterFacts;
use super::task::ReadBack;
use anyhow::{Result, ensure};
use std::cell::RefCell;
use std::time::Instant;
use viscera::solver::FrameReading;
use viscera::solver::balance::ForceBalance;
use viscera::solver::gpu::{Adapter, Device, GpuSolver, MemoryCopy, StepTimes};
use viscera::state::{ContactState, State};

/// Copies that are timed together, and how often, of which the fastest counts.
const COPIES: u32 = 8;
const REPETITIONS: usize = 5;
/// Steps are timed together until they take this long [s]: sending them and waiting takes up to a third of
/// a millisecond.
const LEAST: f64 = 0.02;
/// The most steps that are: queues are finite.
const MOST_STEPS: u32 = 1 << 12;
/// How often stages are timed, of which the fastest count.
const STAGE_REPETITIONS: usize = 5;

/// A graphics processor.
pub struct Gpu {
    adapter: Adapter,
    device: RefCell<Device>,
}

impl Gpu {
    /// The first one, or the first whose name contains the text.
    pub fn open(name: Option<&str>) -> Result<Self> {
        let adapter = Adapter::find(name)?;
        let device = RefCell::new(adapter.open()?);
        Ok(Self { adapter, device })
    }

    /// Whether the processor does its work.
    pub fn is_software(&self) -> bool {
        self.adapter.is_software()
    }

    /// What it is, for the results.
    pub fn facts(&self) -> AdapterFacts {
        let (info, limits) = (self.adapter.info(), self.device.borrow().limits());
        AdapterFacts {
            name: info.name,
            kind: self.adapter.kind(),
            backend: info.backend.to_string(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            storage_binding_bytes: limits.max_storage_buffer_binding_size,
            buffer_bytes: limits.max_buffer_size,
            has_clock: self.device.borrow().has_clock(),
        }
    }

    /// The device, and a fresh one where a case has ended the last.
    fn device(&self) -> Result<Device> {
        if self.device.borrow().check().is_err() {
            *self.device.borrow_mut() = self.adapter.open()?;
        }
        Ok(self.device.borrow().clone())
    }
}

impl Computer for Gpu {
    fn kind(&self) -> &'static str {
        "GPU"
    }

    fn threads(&self) -> Option<u32> {
        None
    }

    fn copy_bandwidth(&self) -> Result<f64> {
        let copy = MemoryCopy::new(&self.device()?)?;
        let mut fastest = f64::INFINITY;
        // The first ones meet memory that the driver has not handed out yet.
        copy.time(COPIES)?;
        for _ in 0..REPETITIONS {
            let start = Instant::now();
            let device = copy.time(COPIES)?;
            fastest = fastest.min(device.unwrap_or_else(|| start.elapsed().as_secs_f64()));
        }
        Ok(copy.bytes() as f64 * f64::from(COPIES) / fastest)
    }

    fn stepper<'a>(
        &self,
        bench: &'a Bench<'_>,
        sweeps: Option<u32>,
    ) -> Result<Box<dyn Stepper + 'a>> {
        let settings = settings(bench, sweeps);
        let solver = GpuSolver::new(&self.device()?, &bench.model, &settings)?;
        let dt = step_size(bench, sweeps, solver.stable_step());
        let mut start = State::at_rest(&bench.model);
        swing(bench, &mut start);
        start.contact = ContactState::of(&bench.inputs.tools);
        Ok(Box::new(GpuStepper { bench, solver, start, dt }))
    }
}

struct GpuStepper<'a> {
    bench: &'a Bench<'a>,
    solver: GpuSolver,
    /// Where every batch begins.
    start: State<f32>,
    /// [s].
    dt: f64,
}

impl GpuStepper<'_> {
    fn go_to_start(&mut self) -> Result<()> {
        self.solver.write(&self.bench.model, &self.start)?;
        Ok(self.solver.wait()?)
    }

    /// Steps after each of which the host waits for what it reads.
    fn run_and_read(&mut self, count: u32) -> Result<()> {
        let (model, inputs) = (&self.bench.model, &self.bench.inputs);
        let reading = match self.bench.entry.task.read_back {
            ReadBack::Forces => FrameReading::Balance,
            ReadBack::Tool => FrameReading::Forces,
            ReadBack::Positions | ReadBack::Nothing => FrameReading::State,
        };
        let mut state = self.start.clone();
        let mut balance = ForceBalance::default();
        let mut touches = inputs.tools.is_empty();
        for _ in 0..count {
            self.solver.step(model, inputs, self.dt)?;
            self.solver.ask_for_frame(reading)?;
            while self.solver.take_frame(model, &mut state)?.is_none() {
                self.solver.wait()?;
            }
            if reading == FrameReading::Balance {
                self.solver.force_balance(model, &state, inputs, &mut balance)?;
            }
            touches |= self.solver.wrenches().iter().any(|wrench| wrench.touches > 0);
        }
        ensure!(touches, "the tool has touched nothing");
        Ok(())
    }
}

impl Stepper for GpuStepper<'_> {
    fn run(&mut self, count: u32) -> Result<Elapsed> {
        self.go_to_start()?;
        let (model, inputs) = (&self.bench.model, &self.bench.inputs);
        let start = Instant::now();
        if self.bench.entry.task.read_back != ReadBack::Nothing {
            self.run_and_read(count)?;
            return Ok(Elapsed { wall: start.elapsed().as_secs_f64(), device: None });
        }
        let device = self.solver.time_steps(model, inputs, self.dt, count)?;
        Ok(Elapsed { wall: start.elapsed().as_secs_f64(), device })
    }

    fn is_finite(&self) -> Result<bool> {
        let mut state = State::at_rest(&self.bench.model);
        self.solver.read(&self.bench.model, &mut state)?;
        Ok(state.is_finite())
    }

    fn state_after(&mut self, count: u32) -> Result<State<f32>> {
        self.go_to_start()?;
        let model = &self.bench.model;
        for _ in 0..count {
            self.solver.step(model, &self.bench.inputs, self.dt)?;
        }
        let mut state = State::at_rest(model);
        self.solver.read(model, &mut state)?;
        Ok(state)
    }

    fn unused_passes(&self) -> Result<Option<u32>> {
        Ok(self.solver.unused_passes()?.into_iter().min())
    }

    fn facts(&self) -> SolverFacts {
        let [prologue, iteration, epilogue] = self.solver.dispatches();
        let passes = self.solver.passes();
        SolverFacts {
            threads: None,
            instructions: None,
            passes,
            dispatches: Some(prologue + iteration * passes as usize + epilogue),
            pass_dispatches: Some(iteration),
            bytes: self.solver.bytes(),
            least: LEAST,
            most_steps: MOST_STEPS,
        }
    }

    fn stages(&mut self) -> Result<Vec<StageLine>> {
        let mut fastest: Vec<StageLine> = Vec::new();
        for _ in 0..STAGE_REPETITIONS {
            self.go_to_start()?;
            let (model, inputs) = (&self.bench.model, &self.bench.inputs);
            let Some(times) = self.solver.time_step(model, inputs, self.dt)? else { break };
            let now = lines(&times, self.solver.dispatches()[1]);
            if fastest.is_empty() {
                fastest = now;
                continue;
            }
            for (line, now) in fastest.iter_mut().zip(now) {
                line.seconds = line.seconds.min(now.seconds);
            }
        }
        Ok(fastest)
    }
}

/// Stages in order; all iterations after the first are one.
fn lines(times: &StepTimes, of_iteration: usize) -> Vec<StageLine> {
    let line = |stage: &viscera::solver::gpu::StageTime| StageLine {
        part: stage.part.name(),
        stage: stage.name(),
        dispatches: stage.dispatches,
        seconds: stage.seconds,
    };
    let mut lines: Vec<StageLine> = times.stages.iter().map(line).collect();
    let count = times.later_iterations as usize;
    if count > 0 {
        let after = lines.iter().take_while(|line| line.part != "epilogue").count();
        let later = StageLine {
            part: "later iterations",
            stage: format!("{count} x all"),
            dispatches: count * of_iteration,
            seconds: times.later_seconds,
        };
        lines.insert(after, later);
    }
    lines
}
