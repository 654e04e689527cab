//! One case: a solver on a mesh with so many threads.

use super::bandwidth::Bandwidth;
use super::solvers::SolverEntry;
use super::subjects::{Subject, hanging};
use anyhow::{Context, Result, ensure};
use serde::Serialize;
use std::time::Instant;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder, TetSet};
use viscera::settings::{Method, SolverSettings, Threads};
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

/// A step [s]: a sixtieth of a second in ten substeps.
const DT: f64 = 1.0 / 600.0;
/// Least time that is taken [s]: a clock's own cost and coarseness are then a thousandth of it.
const LEAST: f64 = 1e-4;
/// The fewest repetitions from which a median is taken.
const FEWEST: usize = 3;
/// The most: a longer case learns nothing more.
const MOST: usize = 2000;
/// Bytes of a number of the state, single precision.
const NUMBER: f64 = size_of::<f32>() as f64;

/// What was found. Times are of one step, in which there are `sweeps` sweeps.
#[derive(Clone, Debug, Serialize)]
pub struct Measurement {
    pub mesh: String,
    pub tets: usize,
    pub vertices: usize,
    pub solver: &'static str,
    pub threads: usize,
    pub colors: usize,
    pub instructions: String,
    /// None for a solver that does not sweep.
    pub sweeps: Option<u32>,
    pub repetitions: usize,
    pub step_seconds_median: f64,
    pub step_seconds_min: f64,
    pub step_ns_per_tet: f64,
    /// "sweep" or "step": what the next number is per.
    pub unit: &'static str,
    /// From the difference between two numbers of sweeps; none where noise hides it.
    pub unit_ns_per_tet: Option<f64>,
    /// Of model, state and solver.
    pub bytes_per_tet: f64,
    pub compulsory_bytes_per_tet: f64,
    /// Compulsory bytes over time, as a fraction of the memory bandwidth with as many threads.
    pub bandwidth_fraction: Option<f64>,
}

/// A model to measure a solver on.
pub struct Bench<'a> {
    entry: &'a SolverEntry,
    model: Model<f32>,
    inputs: Inputs<f32>,
}

impl<'a> Bench<'a> {
    pub fn new(entry: &'a SolverEntry, mesh: &TetMesh) -> Result<Self> {
        let mut builder = ModelBuilder::new();
        builder.add_body(mesh, &entry.tissue()?)?;
        Ok(Self { entry, model: builder.build(&entry.settings())?, inputs: hanging(mesh) })
    }

    /// Measures for about so long [s] with as many threads as the bandwidth was measured with.
    pub fn measure(&self, name: &str, bandwidth: Bandwidth, seconds: f64) -> Result<Measurement> {
        let counts = self.entry.sweeps.unwrap_or_else(|| [self.entry.settings().iterations; 2]);
        let mut few = Runner::new(self, bandwidth.threads, counts[0]);
        let bytes = self.model.bytes() + few.state.bytes() + few.solver.bytes();
        let (threads, instructions) = (few.solver.thread_count(), few.solver.instructions());
        let mut more = self.entry.sweeps.map(|s| Runner::new(self, bandwidth.threads, s[1]));
        few.warm_up(self)?;
        more.as_mut().map_or(Ok(()), |runner| runner.warm_up(self))?;
        // By turns, so that what else the machine does strikes both alike.
        let start = Instant::now();
        while few.times.len() < FEWEST
            || (start.elapsed().as_secs_f64() < seconds && few.times.len() < MOST)
        {
            few.time(self)?;
            more.as_mut().map_or(Ok(()), |runner| runner.time(self))?;
        }
        let tets = self.model.tet_count();
        let per_tet = 1e9 / tets as f64;
        let step = few.fastest();
        let unit_seconds = match &more {
            Some(more) => (more.fastest() - step) / f64::from(counts[1] - counts[0]),
            None => step,
        };
        // Noise above the signal is no cost below zero.
        let unit_seconds = (unit_seconds > 0.0).then_some(unit_seconds);
        let compulsory = self.compulsory_bytes() / tets as f64;
        let fraction = |s: f64| compulsory * tets as f64 / s / bandwidth.bytes_per_second;
        Ok(Measurement {
            mesh: name.to_owned(),
            tets,
            vertices: self.model.vertex_count(),
            solver: self.entry.name,
            threads,
            colors: self.model.color_count,
            instructions: format!("{instructions:?}").to_lowercase(),
            sweeps: self.entry.sweeps.map(|s| s[0]),
            repetitions: few.times.len(),
            step_seconds_median: few.median(),
            step_seconds_min: step,
            step_ns_per_tet: step * per_tet,
            unit: self.entry.unit(),
            unit_ns_per_tet: unit_seconds.map(|s| s * per_tet),
            bytes_per_tet: bytes as f64 / tets as f64,
            compulsory_bytes_per_tet: compulsory,
            bandwidth_fraction: unit_seconds.map(fraction),
        })
    }

    /// What no sweep in single precision can do without [B]: of each tetrahedron the four vertex
    /// numbers, `Dm^-1`, volume and material (60 B), each multiplier read and written, and each
    /// vertex's position and inverse mass (16 B) read and written, once. A small step has no
    /// multipliers, but forces (16 B) and velocities (12 B).
    fn compulsory_bytes(&self) -> f64 {
        let count = |set: &TetSet<f32>| set.len() * set.form.multiplier_count();
        let multipliers: usize = self.model.tet_sets().into_iter().map(count).sum();
        let (multipliers, vertex) =
            if self.explicit() { (0.0, 22.0) } else { (2.0 * multipliers as f64, 8.0) };
        let tets = 15.0 * self.model.tet_count() as f64;
        NUMBER * (tets + multipliers + vertex * self.model.vertex_count() as f64)
    }

    fn explicit(&self) -> bool {
        self.entry.settings().method == Method::Explicit
    }
}

/// A solver at work, and how long its steps took.
struct Runner {
    solver: Solver<f32>,
    /// [s].
    dt: f64,
    state: State<f32>,
    /// Steps that are timed together.
    batch: u32,
    /// Of one step [s].
    times: Vec<f64>,
}

impl Runner {
    fn new(bench: &Bench<'_>, threads: u32, sweeps: u32) -> Self {
        let settings = SolverSettings {
            iterations: sweeps,
            threads: Threads::Count(threads),
            ..bench.entry.settings()
        };
        let solver = Solver::new(&bench.model, &settings);
        // A hair below, so that rounding makes no further small step.
        let small_steps = 0.999 * f64::from(sweeps) * solver.stable_step();
        Self {
            dt: if bench.explicit() { small_steps } else { DT },
            solver,
            state: State::at_rest(&bench.model),
            batch: 1,
            times: Vec::new(),
        }
    }

    /// Meets the memory for the first time, and finds how many steps are worth a look at the clock.
    fn warm_up(&mut self, bench: &Bench<'_>) -> Result<()> {
        // A step of a large mesh takes seconds; no more of them than it takes.
        while self.batch_seconds(bench)? < LEAST && self.batch < 1 << 16 {
            self.batch *= 2;
        }
        Ok(())
    }

    fn time(&mut self, bench: &Bench<'_>) -> Result<()> {
        let seconds = self.batch_seconds(bench)?;
        self.times.push(seconds / f64::from(self.batch));
        Ok(())
    }

    fn batch_seconds(&mut self, bench: &Bench<'_>) -> Result<f64> {
        self.state.clone_from(&State::at_rest(&bench.model));
        let start = Instant::now();
        for _ in 0..self.batch {
            self.solver.step(&bench.model, &mut self.state, &bench.inputs, self.dt)?;
        }
        let seconds = start.elapsed().as_secs_f64();
        ensure!(
            self.state.is_finite(),
            "the solver `{}` diverged, so that its time means nothing; leave it out with --solvers",
            bench.entry.name
        );
        Ok(seconds)
    }

    fn fastest(&self) -> f64 {
        self.times.iter().copied().fold(f64::INFINITY, f64::min)
    }

    fn median(&self) -> f64 {
        let mut times = self.times.clone();
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    }
}

/// Measures a solver on a subject, once for each bandwidth; `done` is told of each.
pub fn measure_all(
    entry: &SolverEntry,
    subject: &Subject<'_>,
    bandwidths: &[Bandwidth],
    seconds: f64,
    done: &dyn Fn(),
) -> Result<Vec<Measurement>> {
    let measure = || -> Result<Vec<Measurement>> {
        let bench = Bench::new(entry, &*subject.mesh()?)?;
        let mut found = Vec::new();
        for bandwidth in bandwidths {
            found.push(bench.measure(subject.name(), *bandwidth, seconds)?);
            done();
        }
        Ok(found)
    };
    measure().with_context(|| format!("{} on {} tetrahedra", entry.name, subject.tet_count()))
}

#[cfg(test)]
mod tests {
    use super::super::solvers::SOLVERS;
    use super::super::subjects::Size;
    use super::*;

    /// What decides whether a mesh fits into memory follows what is kept in fact.
    #[test]
    fn memory_is_foreseen_and_not_overstated() {
        let mesh = Subject::Bar(Size(30_000));
        let mesh = mesh.mesh().expect("a bar");
        for entry in &SOLVERS {
            let bench = Bench::new(entry, &mesh).expect("a model");
            let runner = Runner::new(&bench, 1, 1);
            let bytes = bench.model.bytes() + runner.state.bytes() + runner.solver.bytes();
            let each = bytes as f64 / bench.model.tet_count() as f64;
            let foreseen = crate::memory::kept(&entry.settings());
            let (name, close) = (entry.name, 0.5 * foreseen..=foreseen);
            assert!(
                close.contains(&each),
                "{name}: {each} B/tet, {foreseen} foreseen; see memory.rs"
            );
        }
    }
}
