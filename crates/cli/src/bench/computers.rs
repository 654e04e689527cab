//! Hardware to measure on: the processor with so many threads, or a graphics processor.

use super::bandwidth;
use super::measurement::Bench;
use super::task::{DT, Length};
use anyhow::{Result, ensure};
use serde::Serialize;
use std::time::Instant;
use viscera::settings::{Count, Method, SolverSettings, Threads};
use viscera::solver::Solver;
use viscera::state::{ContactState, State};

/// Hardware that solvers are measured on.
pub trait Computer {
    /// "CPU" or "GPU".
    fn kind(&self) -> &'static str;

    /// Threads, where it has them.
    fn threads(&self) -> Option<u32>;

    /// Bytes read and bytes written per second by a copy.
    fn copy_bandwidth(&self) -> Result<f64>;

    /// A solver on it, with so many sweeps or small steps per step; with as many as it chooses where none are given.
    fn stepper<'a>(
        &self,
        bench: &'a Bench<'_>,
        sweeps: Option<u32>,
    ) -> Result<Box<dyn Stepper + 'a>>;
}

/// How long steps took, all together.
#[derive(Clone, Copy, Debug)]
pub struct Elapsed {
    /// By the host's clock, waiting included [s].
    pub wall: f64,
    /// By the device's own clock [s].
    pub device: Option<f64>,
}

/// A solver at work.
pub trait Stepper {
    /// Goes back to the start, then so many steps.
    fn run(&mut self, count: u32) -> Result<Elapsed>;

    /// Whether all that moves is still a number.
    fn is_finite(&self) -> Result<bool>;

    /// Goes back to the start, then so many steps; where everything is then.
    fn state_after(&mut self, count: u32) -> Result<State<f32>>;

    /// Passes of the last solve that no part had a use for, because its steps were round-off; none where that is not known.
    fn unused_passes(&self) -> Result<Option<u32>>;

    /// What is known of it.
    fn facts(&self) -> SolverFacts;

    /// Stages of a step, one by one; none where they are not timed.
    fn stages(&mut self) -> Result<Vec<StageLine>>;
}

/// What is known of a solver.
#[derive(Clone, Debug)]
pub struct SolverFacts {
    pub threads: Option<usize>,
    pub instructions: Option<String>,
    /// Iterations of a solve, or small steps of a step.
    pub passes: u32,
    /// Of a step, and of a pass.
    pub dispatches: Option<usize>,
    pub pass_dispatches: Option<usize>,
    /// Of model, state and solver, where the work is done.
    pub bytes: u64,
    /// Steps are timed together until they take this long [s].
    pub least: f64,
    /// The most steps that are.
    pub most_steps: u32,
}

/// What one stage of a step took.
#[derive(Clone, Debug, Serialize)]
pub struct StageLine {
    /// "prologue", "iteration" (the first), "later iterations" (all others, as one stage) or "epilogue".
    pub part: &'static str,
    pub stage: String,
    pub dispatches: usize,
    pub seconds: f64,
}

/// The processor.
pub struct Processor {
    pub threads: u32,
}

impl Computer for Processor {
    fn kind(&self) -> &'static str {
        "CPU"
    }

    fn threads(&self) -> Option<u32> {
        Some(self.threads)
    }

    fn copy_bandwidth(&self) -> Result<f64> {
        Ok(bandwidth::of_memory(self.threads))
    }

    fn stepper<'a>(
        &self,
        bench: &'a Bench<'_>,
        sweeps: Option<u32>,
    ) -> Result<Box<dyn Stepper + 'a>> {
        Ok(Box::new(CpuStepper::new(bench, self.threads, sweeps)))
    }
}

/// A solver on the processor.
pub struct CpuStepper<'a> {
    bench: &'a Bench<'a>,
    solver: Solver<f32>,
    /// Where every batch begins.
    start: State<f32>,
    state: State<f32>,
    /// [s].
    dt: f64,
}

/// Speed [m/s] of the far end of a body that is set in motion.
const SWING: f32 = 0.5;

/// A wave along it of this length [m] and largest strain, where steps are short: in a thousandth of a second a swing alone
/// would move vertices by little more than round-off of what inertia does.
const WAVE_LENGTH: f32 = 0.05;
const WAVE_STRAIN: f32 = 0.1;

impl<'a> CpuStepper<'a> {
    pub fn new(bench: &'a Bench<'_>, threads: u32, sweeps: Option<u32>) -> Self {
        let settings =
            SolverSettings { threads: Threads::Count(threads), ..settings(bench, sweeps) };
        let solver = Solver::new(&bench.model, &settings);
        let dt = step_size(bench, sweeps, solver.stable_step());
        let mut start = solver.state_at_rest();
        swing(bench, &mut start);
        start.contact = ContactState::of(&bench.inputs.tools);
        Self { bench, solver, state: start.clone(), start, dt }
    }
}

/// The settings of a solver with so many sweeps.
pub fn settings(bench: &Bench<'_>, sweeps: Option<u32>) -> SolverSettings {
    let own = bench.entry.settings();
    SolverSettings { iterations: sweeps.map_or(own.iterations, Count::Of), ..own }
}

/// A step [s] with so many sweeps or small steps.
pub fn step_size(bench: &Bench<'_>, sweeps: Option<u32>, stable_step: f64) -> f64 {
    match (bench.dt, sweeps) {
        (Some(dt), _) => dt,
        // A hair below, so that rounding makes no further small step.
        (None, Some(sweeps)) if bench.is_explicit() => 0.999 * f64::from(sweeps) * stable_step,
        _ => DT,
    }
}

/// Sets a body at rest in motion whose solver ends a solve early where little moves.
pub fn swing(bench: &Bench<'_>, start: &mut State<f32>) {
    if bench.entry.settings().method != Method::QuasiNewton {
        return;
    }
    let ends = start.positions.iter().map(|x| x.x);
    let (low, high) = ends.fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
    let has_wave = matches!(bench.entry.task.length, Length::Step(_));
    for (velocity, x) in start.velocities.iter_mut().zip(&mut start.positions) {
        let share = (x.x - low) / (high - low);
        velocity.z = SWING * share * share;
        if has_wave {
            let number = std::f32::consts::TAU / WAVE_LENGTH;
            x.x += WAVE_STRAIN / number * (number * (x.x - low)).sin();
        }
    }
}

impl Stepper for CpuStepper<'_> {
    fn run(&mut self, count: u32) -> Result<Elapsed> {
        self.state.clone_from(&self.start);
        let start = Instant::now();
        for _ in 0..count {
            let (model, inputs) = (&self.bench.model, &self.bench.inputs);
            self.solver.step(model, &mut self.state, inputs, self.dt)?;
        }
        Ok(Elapsed { wall: start.elapsed().as_secs_f64(), device: None })
    }

    fn is_finite(&self) -> Result<bool> {
        Ok(self.state.is_finite())
    }

    fn state_after(&mut self, count: u32) -> Result<State<f32>> {
        self.run(count)?;
        Ok(self.state.clone())
    }

    fn unused_passes(&self) -> Result<Option<u32>> {
        Ok(None)
    }

    fn facts(&self) -> SolverFacts {
        // As the step counts its small steps.
        let small_steps = (self.dt / self.solver.stable_step()).ceil().max(1.0) as u32;
        let bytes = self.bench.model.bytes() + self.state.bytes() + self.solver.bytes();
        SolverFacts {
            threads: Some(self.solver.thread_count()),
            instructions: Some(format!("{:?}", self.solver.instructions()).to_lowercase()),
            passes: self.solver.plan().passes(small_steps),
            dispatches: None,
            pass_dispatches: None,
            bytes: bytes as u64,
            // A clock's own cost and coarseness are then a thousandth of it.
            least: 1e-4,
            most_steps: 1 << 16,
        }
    }

    fn stages(&mut self) -> Result<Vec<StageLine>> {
        Ok(Vec::new())
    }
}

/// A solver at work, and how long its steps took.
pub struct Runner<'a> {
    pub stepper: Box<dyn Stepper + 'a>,
    pub facts: SolverFacts,
    /// Steps that are timed together.
    batch: u32,
    /// Of one step.
    times: Vec<Elapsed>,
}

impl<'a> Runner<'a> {
    pub fn new(stepper: Box<dyn Stepper + 'a>) -> Self {
        Self { facts: stepper.facts(), stepper, batch: 1, times: Vec::new() }
    }

    /// Meets memory and kernels for the first time, and finds how many steps are worth a look at the clock.
    pub fn warm_up(&mut self) -> Result<()> {
        self.stepper.run(1)?;
        // The first step takes memory as well.
        self.facts = self.stepper.facts();
        // A step of a large mesh takes seconds; no more of them than it takes.
        while self.stepper.run(self.batch)?.wall < self.facts.least
            && self.batch < self.facts.most_steps
        {
            self.batch *= 2;
        }
        // Every batch starts from rest and goes the same way.
        ensure!(
            self.stepper.is_finite()?,
            "the solver diverged, so that its time means nothing; leave it out with --solvers"
        );
        Ok(())
    }

    pub fn time(&mut self) -> Result<()> {
        let Elapsed { wall, device } = self.stepper.run(self.batch)?;
        let steps = f64::from(self.batch);
        self.times.push(Elapsed { wall: wall / steps, device: device.map(|s| s / steps) });
        Ok(())
    }

    pub fn repetitions(&self) -> usize {
        self.times.len()
    }

    /// The fastest step by the host's clock [s].
    pub fn fastest(&self) -> f64 {
        self.times.iter().map(|elapsed| elapsed.wall).fold(f64::INFINITY, f64::min)
    }

    /// The fastest step by the device's clock [s].
    pub fn fastest_on_device(&self) -> Option<f64> {
        self.times.iter().filter_map(|elapsed| elapsed.device).min_by(f64::total_cmp)
    }

    pub fn median(&self) -> f64 {
        let mut times: Vec<f64> = self.times.iter().map(|elapsed| elapsed.wall).collect();
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    }
}
