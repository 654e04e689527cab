//! `viscera devices`: what there is to compute on, and how fast it is.

use crate::bench::solvers::SOLVERS;
use crate::bench::subjects::{Size, Subject, hanging};
use crate::progress;
use anyhow::{Context, Result};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use viscera::model::{Model, ModelBuilder};
use viscera::settings::{Count, SolverSettings};
#[cfg(feature = "gpu")]
use viscera::solver::gpu::{Adapter, GpuError, GpuSolver};
use viscera::solver::{Inputs, Solver};
use viscera::state::State;
use viscera_report::Table;
use viscera_resources::{Memory, files, processor};

/// List what there is to compute on, and how fast it is
///
/// Graphics adapters with their drivers and limits, and the processor beside them. Each works for about
/// a second on a bar of 20,000 tetrahedra. `device = "..."` in a scene takes part of an adapter's name.
#[derive(Args)]
pub struct DevicesArguments {
    /// Print JSON, in bytes and SI units, instead of a table
    #[arg(long)]
    json: bool,
    /// Write the text of every kernel, as devices get it, to this folder instead: one WGSL file each
    #[arg(long, value_name = "DIR", conflicts_with = "json")]
    kernels: Option<PathBuf>,
}

/// What a device is measured on [tetrahedra], with one colour: the same few dispatches for any mesh.
const TETS: usize = 20_000;
/// Sweeps of a step: enough to outweigh what a step costs besides.
const SWEEPS: u32 = 10;
/// A step [s].
const DT: f64 = 1.0 / 600.0;
/// Steps are timed together, twice as many each time until they take this long [s]: with those before
/// them about a second.
const LONG: f64 = 0.5;
/// The most steps that are timed together: queues are finite.
const MOST_STEPS: u32 = 1 << 12;

/// What is known of one device.
#[derive(Serialize)]
struct Line {
    name: String,
    /// "processor", or of an adapter "discrete", "integrated", "virtual", "software" or "other".
    kind: &'static str,
    /// The graphics interface.
    backend: Option<String>,
    driver: Option<String>,
    limits: Option<Limits>,
    /// Whether it can do what every kernel needs.
    baseline: bool,
    /// Tetrahedra times sweeps [1/s].
    tet_sweeps_per_second: Option<f64>,
    /// About how many tetrahedra fit, solved as here [tetrahedra].
    largest_mesh: Option<u64>,
    /// Why it cannot be used.
    problem: Option<String>,
}

/// What decides how large a mesh may be, and what kernels may ask for.
#[derive(Serialize)]
struct Limits {
    storage_binding_bytes: u64,
    buffer_bytes: u64,
    workgroup_threads: u32,
    workgroup_bytes: u32,
}

#[derive(Serialize)]
struct Listing {
    cpu: Line,
    adapters: Vec<Line>,
    /// What to do where there is no adapter.
    hint: Option<String>,
}

/// Carries out `viscera devices`.
pub fn execute(arguments: &DevicesArguments) -> Result<()> {
    if let Some(folder) = &arguments.kernels {
        return write_kernels(folder);
    }
    let sample = SampleBar::new()?;
    let listing = list(&sample)?;
    if arguments.json {
        let text = serde_json::to_string_pretty(&listing).context("cannot write JSON")?;
        return files::print(&format!("{text}\n"));
    }
    files::print(&listing.to_text(&sample))
}

/// The texts of all kernels, each in a file of its name.
#[cfg(feature = "gpu")]
fn write_kernels(folder: &Path) -> Result<()> {
    let texts = viscera::solver::gpu::kernels::texts();
    for (name, text) in &texts {
        let file = folder.join(format!("{name}.wgsl"));
        files::prepare_file(&file, "--kernels")?;
        files::write_atomic(&file, text.as_bytes())?;
    }
    files::print(&format!("{} kernels are in {}\n", texts.len(), folder.display()))
}

#[cfg(not(feature = "gpu"))]
fn write_kernels(_: &Path) -> Result<()> {
    anyhow::bail!("the GPU backend was left out of this build; build with `--features gpu`")
}

#[cfg(feature = "gpu")]
fn list(sample: &SampleBar) -> Result<Listing> {
    let adapters = Adapter::all();
    let bar =
        progress::bar(adapters.len() as u64 + 1, "measuring", "{pos} of {len} devices, {msg}");
    let mut lines = Vec::new();
    for adapter in &adapters {
        bar.set_message(adapter.name());
        lines.push(of_adapter(sample, adapter));
        bar.inc(1);
    }
    bar.set_message("CPU");
    let cpu = of_cpu(sample)?;
    bar.finish_and_clear();
    let hint = lines.is_empty().then(|| GpuError::NoAdapter.to_string());
    Ok(Listing { cpu, adapters: lines, hint })
}

#[cfg(not(feature = "gpu"))]
fn list(sample: &SampleBar) -> Result<Listing> {
    let bar = progress::bar(1, "measuring", "{pos} of {len} devices");
    let cpu = of_cpu(sample)?;
    bar.finish_and_clear();
    let hint = "graphics adapters are not looked for: the GPU backend was left out of this build; \
                build with `--features gpu`";
    Ok(Listing { cpu, adapters: Vec::new(), hint: Some(hint.into()) })
}

/// A bar whose left end is held.
struct SampleBar {
    model: Model<f32>,
    settings: SolverSettings,
    inputs: Inputs<f32>,
}

impl SampleBar {
    fn new() -> Result<Self> {
        let entry = SOLVERS.iter().find(|entry| entry.name == "jacobi");
        let entry = entry.context("`jacobi` is no longer among the solvers")?;
        // Sweeps alone: guards would be measured with them.
        let settings =
            SolverSettings { iterations: Count::Of(SWEEPS), step_guard: false, ..entry.settings() };
        let subject = Subject::Bar(Size(TETS));
        let mesh = subject.mesh()?;
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &entry.tissue()?)?;
        let inputs = hanging(&mesh);
        Ok(Self { model: builder.build()?, settings, inputs })
    }

    /// Tetrahedra times sweeps per second, of a device that can do so many steps.
    fn speed(&self, mut steps: impl FnMut(u32) -> Result<()>) -> Result<f64> {
        // The first step meets memory and kernels that nobody has touched yet.
        steps(1)?;
        let mut count = 1;
        loop {
            let start = Instant::now();
            steps(count)?;
            let seconds = start.elapsed().as_secs_f64();
            if seconds >= LONG || count >= MOST_STEPS {
                let sweeps = f64::from(count) * f64::from(SWEEPS);
                return Ok(self.model.tet_count() as f64 * sweeps / seconds);
            }
            count *= 2;
        }
    }
}

fn of_cpu(sample: &SampleBar) -> Result<Line> {
    let mut solver = Solver::new(&sample.model, &sample.settings);
    let mut state = State::at_rest(&sample.model);
    let speed = sample.speed(|count| {
        for _ in 0..count {
            solver.step(&sample.model, &mut state, &sample.inputs, DT)?;
        }
        Ok(())
    })?;
    Ok(Line {
        name: format!("{}, threads: {}", processor(), solver.thread_count()),
        kind: "processor",
        backend: None,
        driver: None,
        limits: None,
        baseline: true,
        tet_sweeps_per_second: Some(speed),
        largest_mesh: None,
        problem: None,
    })
}

#[cfg(feature = "gpu")]
fn of_adapter(sample: &SampleBar, adapter: &Adapter) -> Line {
    let (info, limits) = (adapter.info(), adapter.limits());
    let measure = || -> Result<(f64, u64)> {
        let device = adapter.open()?;
        let mut solver = GpuSolver::new(&device, &sample.model, &sample.settings)?;
        let largest = solver.largest_mesh(&sample.model, &device.limits());
        let speed = sample.speed(|count| {
            for _ in 0..count {
                solver.step(&sample.model, &sample.inputs, DT)?;
            }
            Ok(solver.wait()?)
        })?;
        Ok((speed, largest))
    };
    let measured = measure();
    Line {
        kind: adapter.kind(),
        backend: Some(info.backend.to_string()),
        driver: Some(format!("{} {}", info.driver, info.driver_info).trim().to_owned()),
        limits: Some(Limits {
            storage_binding_bytes: limits.max_storage_buffer_binding_size,
            buffer_bytes: limits.max_buffer_size,
            workgroup_threads: limits.max_compute_invocations_per_workgroup,
            workgroup_bytes: limits.max_compute_workgroup_storage_size,
        }),
        baseline: adapter.shortfall().is_none(),
        tet_sweeps_per_second: measured.as_ref().ok().map(|&(speed, _)| speed),
        largest_mesh: measured.as_ref().ok().map(|&(_, largest)| largest),
        problem: measured.err().map(|error| error.to_string()),
        name: info.name,
    }
}

impl Listing {
    fn to_text(&self, sample: &SampleBar) -> String {
        let mut table = Table::new([
            "device",
            "kind",
            "interface",
            "driver",
            "storage binding",
            "buffer",
            "workgroup",
            "baseline",
            "largest mesh",
            "speed",
        ]);
        for line in self.adapters.iter().chain([&self.cpu]) {
            let limit = |text: fn(&Limits) -> String| line.limits.as_ref().map_or("-".into(), text);
            let or_dash = |text: &Option<String>| text.clone().unwrap_or("-".into());
            table.row([
                line.name.clone(),
                line.kind.into(),
                or_dash(&line.backend),
                or_dash(&line.driver),
                limit(|l| Memory(l.storage_binding_bytes).to_string()),
                limit(|l| Memory(l.buffer_bytes).to_string()),
                limit(|l| {
                    format!("{} threads, {}", l.workgroup_threads, Memory(l.workgroup_bytes.into()))
                }),
                match (line.limits.is_some(), line.baseline) {
                    (false, _) => "-",
                    (true, true) => "yes",
                    (true, false) => "no",
                }
                .into(),
                line.largest_mesh.map_or("-".into(), |t| format!("{:.1} M", 1e-6 * t as f64)),
                line.tet_sweeps_per_second.map_or("-".into(), |s| format!("{:.1} M/s", 1e-6 * s)),
            ]);
        }
        let mut text = table.to_text();
        for line in &self.adapters {
            if let Some(problem) = &line.problem {
                text.push_str(&format!("{}: {problem}\n", line.name));
            }
        }
        if let Some(hint) = &self.hint {
            text.push_str(&format!("{hint}\n"));
        }
        let tets = sample.model.tet_count();
        text.push_str(&format!(
            "speed: million tetrahedra x sweeps per second, a bar of {tets} tetrahedra, one colour; \
             largest mesh: million tetrahedra that the limits take, solved in the same way\n"
        ));
        text
    }
}
