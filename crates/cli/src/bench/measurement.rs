//! One case: a solver on a mesh with so many threads.

use super::accuracy;
use super::bandwidth::Bandwidth;
use super::computers::{Computer, Runner, StageLine};
use super::solvers::SolverEntry;
use super::subjects::{hanging, supporting};
use super::task::{DT, ReadBack};
use super::traffic::TrafficReport;
use anyhow::Result;
use serde::Serialize;
use std::time::Instant;
use viscera::layout::{Layout, TetSet};
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::settings::Method;
use viscera::solver::Inputs;

/// The fewest repetitions from which a median is taken.
const FEWEST: usize = 3;
/// Where noise hides a sweep, so many times the time is spent before it is given up.
const PATIENCE: f64 = 4.0;
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
    /// "CPU" or "GPU".
    pub device: &'static str,
    /// None of a GPU.
    pub threads: Option<usize>,
    pub colors: usize,
    /// None of a GPU.
    pub instructions: Option<String>,
    /// None for a solver that does not sweep.
    pub sweeps: Option<u32>,
    /// Iterations of a solve, or small steps, that a step has in fact.
    pub passes: u32,
    /// Passes of its last solve that nothing had a use for, where that is known.
    pub unused_passes: Option<u32>,
    /// Poisson's ratio of the tissue, and the step [s] where it is not the usual one.
    pub poisson: f64,
    pub dt: Option<f64>,
    /// Of a step on a GPU, and of a pass.
    pub dispatches: Option<usize>,
    pub pass_dispatches: Option<usize>,
    pub repetitions: usize,
    /// By the host's clock, waiting included.
    pub step_seconds_median: f64,
    pub step_seconds_min: f64,
    /// By the device's clock, where it has one.
    pub step_device_seconds: Option<f64>,
    pub step_ns_per_tet: f64,
    /// "sweep" or "step": what the next number is per.
    pub unit: &'static str,
    /// From the difference between two numbers of sweeps, by the device's clock where it has one; none where
    /// noise hides it.
    pub unit_ns_per_tet: Option<f64>,
    /// Of steps of the quasi-Newton method that a question asks for: their error, as a share of that of inertia alone.
    pub left: Option<f64>,
    /// Of model, state and solver.
    pub bytes_per_tet: f64,
    pub compulsory_bytes_per_tet: f64,
    /// Compulsory bytes over time, as a fraction of the memory bandwidth with as many threads.
    pub bandwidth_fraction: Option<f64>,
    /// Stages of a step on a GPU with a clock.
    pub stages: Vec<StageLine>,
}

impl Measurement {
    /// A step [s] by the best clock there is.
    pub fn step_seconds(&self) -> f64 {
        self.step_device_seconds.unwrap_or(self.step_seconds_min)
    }
}

/// What one sweep costs [s], from steps [s] with few and with more of them; nothing where noise hides it: a sweep
/// costs something, and as many as a step has cost no more than the step. The fastest of few repetitions can be one
/// that something else of the machine has struck.
fn unit_cost([few, more]: [f64; 2], counts: [u32; 2]) -> Option<f64> {
    let unit = (more - few) / f64::from(counts[1] - counts[0]);
    (unit > 0.0 && unit * f64::from(counts[0]) <= few).then_some(unit)
}

/// A model to measure a solver on.
pub struct Bench<'a> {
    pub entry: &'a SolverEntry,
    pub model: Model<f32>,
    pub inputs: Inputs<f32>,
    /// The step [s], where it is fixed, and how many of them what is asked for has.
    pub dt: Option<f64>,
    pub steps: u32,
    /// What a step moves by counting, where the build can count.
    pub traffic: Option<TrafficReport>,
}

impl<'a> Bench<'a> {
    pub fn new(entry: &'a SolverEntry, mesh: &TetMesh) -> Result<Self> {
        let mut builder = ModelBuilder::new();
        builder.add_body(mesh, &entry.tissue()?)?;
        let (steps, dt) = entry.task.steps(entry)?;
        let mut inputs = hanging(mesh);
        if entry.task.read_back == ReadBack::Tool {
            builder.sample_surface(0);
            inputs.tools.push(supporting(mesh));
        }
        let model = builder.build()?;
        Ok(Self { entry, model, inputs, dt, steps, traffic: None })
    }

    /// Measures for about so long [s] on what the bandwidth belongs to; the error of a step as well, where the mesh is given.
    pub fn measure(
        &self,
        name: &str,
        computer: &dyn Computer,
        bandwidth: Bandwidth,
        seconds: f64,
        judged: Option<&TetMesh>,
    ) -> Result<Measurement> {
        let counts = self.entry.sweeps;
        let runner = |sweeps| computer.stepper(self, sweeps).map(Runner::new);
        let mut few = runner(counts.map(|counts| counts[0]))?;
        let mut more = counts.map(|counts| runner(Some(counts[1]))).transpose()?;
        few.warm_up()?;
        more.as_mut().map_or(Ok(()), Runner::warm_up)?;
        // By turns, so that what else the machine does strikes both alike.
        let start = Instant::now();
        let best = |runner: &Runner<'_>| runner.fastest_on_device().unwrap_or(runner.fastest());
        let unit = |few: &Runner<'_>, more: &Option<Runner<'_>>| match (more, counts) {
            (Some(more), Some(counts)) => unit_cost([best(few), best(more)], counts),
            _ => Some(best(few)),
        };
        loop {
            let (spent, count) = (start.elapsed().as_secs_f64(), few.repetitions());
            let is_due = spent >= seconds || count >= MOST;
            let is_clear = count >= FEWEST && unit(&few, &more).is_some();
            if count >= FEWEST && is_due && (is_clear || spent >= PATIENCE * seconds) {
                break;
            }
            few.time()?;
            more.as_mut().map_or(Ok(()), Runner::time)?;
        }
        let unused_passes = few.stepper.unused_passes()?;
        let stages = few.stepper.stages()?;
        let dt = self.dt.unwrap_or(DT);
        let left =
            judged.map(|mesh| accuracy::left(self, mesh, &mut *few.stepper, dt)).transpose()?;
        let tets = self.model.tet_count();
        let per_tet = 1e9 / tets as f64;
        let unit_seconds = unit(&few, &more);
        let layout = Layout::new(&self.model, &self.entry.settings());
        let compulsory = self.compulsory_bytes(&layout) / tets as f64;
        let fraction = |s: f64| Some(compulsory * tets as f64 / s / bandwidth.bytes_per_second?);
        let facts = few.facts.clone();
        Ok(Measurement {
            mesh: name.to_owned(),
            tets,
            vertices: self.model.vertex_count(),
            solver: self.entry.name,
            device: computer.kind(),
            threads: facts.threads,
            colors: layout.color_count,
            instructions: facts.instructions,
            sweeps: self.entry.sweeps.map(|s| s[0]),
            passes: facts.passes,
            unused_passes,
            poisson: self.entry.task.poisson,
            dt: self.dt,
            dispatches: facts.dispatches,
            pass_dispatches: facts.pass_dispatches,
            left,
            repetitions: few.repetitions(),
            step_seconds_median: few.median(),
            step_seconds_min: few.fastest(),
            step_device_seconds: few.fastest_on_device(),
            step_ns_per_tet: best(&few) * per_tet,
            unit: self.entry.unit(),
            unit_ns_per_tet: unit_seconds.map(|s| s * per_tet),
            bytes_per_tet: facts.bytes as f64 / tets as f64,
            compulsory_bytes_per_tet: compulsory,
            bandwidth_fraction: unit_seconds.and_then(fraction),
            stages,
        })
    }

    /// What no sweep in single precision can do without [B]: of each tetrahedron the four vertex
    /// numbers, `Dm^-1`, volume and material (60 B), each multiplier read and written, and each
    /// vertex's position and inverse mass (16 B) read and written, once. A small step has no
    /// multipliers, but forces (16 B) and velocities (12 B). Of the quasi-Newton method what its dispatches count.
    fn compulsory_bytes(&self, layout: &Layout<f32>) -> f64 {
        if let Some(counted) = self.traffic.as_ref().and_then(|t| t.of_unit(self.entry)) {
            return counted;
        }
        let count = |set: &TetSet<f32>| set.len() * set.form.multiplier_count();
        let multipliers: usize = layout.tet_sets.iter().map(count).sum();
        let (multipliers, vertex) =
            if self.is_explicit() { (0.0, 22.0) } else { (2.0 * multipliers as f64, 8.0) };
        let tets = 15.0 * self.model.tet_count() as f64;
        NUMBER * (tets + multipliers + vertex * self.model.vertex_count() as f64)
    }

    pub fn is_explicit(&self) -> bool {
        self.entry.settings().method == Method::Explicit
    }
}

#[cfg(test)]
mod tests {
    use super::super::computers::{CpuStepper, Stepper};
    use super::super::solvers::SOLVERS;
    use super::super::subjects::{Size, Subject};
    use super::*;

    /// Steps of two sweeps that take 163 ns per tetrahedron have no sweeps of 743 ns.
    #[test]
    fn a_sweep_costs_no_more_than_its_share_of_the_step() {
        assert_eq!(unit_cost([10.0, 34.0], [2, 10]), Some(3.0));
        assert_eq!(unit_cost([163.0, 163.0 + 8.0 * 743.0], [2, 10]), None);
        assert_eq!(unit_cost([10.0, 50.1], [2, 10]), None);
        assert_eq!(unit_cost([10.0, 9.0], [2, 10]), None);
    }

    /// What decides whether a mesh fits into memory follows what is kept in fact.
    #[test]
    fn memory_is_foreseen_and_not_overstated() {
        let mesh = Subject::Bar(Size(30_000));
        let mesh = mesh.mesh().expect("a bar");
        for entry in &SOLVERS {
            let bench = Bench::new(entry, &mesh).expect("a model");
            let mut stepper = CpuStepper::new(&bench, 1, Some(1));
            stepper.run(1).expect("a step");
            let bytes = stepper.facts().bytes;
            let each = bytes as f64 / bench.model.tet_count() as f64;
            let foreseen = viscera_resources::memory::kept(&entry.settings());
            let (name, close) = (entry.name, 0.5 * foreseen..=foreseen);
            assert!(
                close.contains(&each),
                "{name}: {each} B/tet, {foreseen} foreseen; see memory.rs"
            );
        }
    }
}
