//! `viscera bench`: what the solvers cost on this machine.

mod bandwidth;
mod measurement;
mod results;
pub mod solvers;
pub mod subjects;

use crate::{files, memory, progress};
use anyhow::Result;
use bandwidth::Bandwidth;
use clap::Args;
use clap::builder::PossibleValuesParser;
use results::Results;
pub use results::processor;
use solvers::{SOLVERS, SolverEntry};
use std::path::PathBuf;
use subjects::{Size, Subject};
use viscera::settings::MOST_THREADS;
use viscera_report::{Document, Memory, prepare_file, write_whole};

/// Measure what the solvers cost on this machine
///
/// Bars of soft tissue, held at one end, are stepped with each solver. Writes to the output folder:
/// bench.md (everything that the terminal shows, and plots as SVG in bench/) and bench.json. Leave the
/// machine alone meanwhile.
#[derive(Args)]
#[command(after_help = EXAMPLES, after_long_help = format!("{COUNTING}\n\n{EXAMPLES}"))]
pub struct BenchArguments {
    /// About how many tetrahedra, separated by commas
    /// [default: 1k,3k,10k,30k,100k,300k,1M; with --quick 1k,10k]
    #[arg(long, value_name = "SIZE,...", value_delimiter = ',', conflicts_with = "mesh")]
    sizes: Vec<Size>,
    /// Measure on this tetrahedral mesh instead of bars
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Measure these solvers only, separated by commas
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = solver_names())]
    solvers: Vec<String>,
    /// Numbers of threads, separated by commas [default: 1 and the number of processors]
    #[arg(long, value_name = "N,...", value_delimiter = ',',
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_THREADS)))]
    threads: Vec<u32>,
    /// Time for each case [s], building not counted [default: 0.5; with --quick 0.05]
    #[arg(long, value_name = "S", value_parser = read_seconds)]
    seconds: Option<f64>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/bench")]
    out: PathBuf,
    /// Write the JSON to this file instead
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Memory that may be used [default: what is free]
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Take fewer sizes and less time
    #[arg(long)]
    quick: bool,
}

const EXAMPLES: &str = "\
Examples:
  viscera bench --quick
  viscera bench --sizes 10k,1M --solvers exact,green --threads 1,2,4
  viscera bench --mesh liver.msh --solvers exact --out out/liver";

/// How numbers are counted; help and report say it alike.
const COUNTING: &str = "\
A step is one substep with as many sweeps as the table shows. The time of a sweep is the difference of \
the fastest steps with two numbers of sweeps, divided by the difference of these numbers: the rebase \
and the acceleration that go with each sweep are in it, what a step costs besides is not.

B/tet are the bytes of model, state and solver over the tetrahedra.

Compulsory bytes are what no sweep in single precision can do without: of each tetrahedron 60 B of \
constants read (four vertex numbers, nine entries of the inverse rest shape, volume, material) and its \
multipliers of 4 B read and written; of each vertex 16 B (position, inverse mass) read and written. \
The explicit method's unit is a small step: no multipliers, but of each vertex its velocity and force as well. \
Each counts once, whatever the solver does in fact. The column `of bandwidth` is these bytes over the \
time of a sweep, divided by the memory bandwidth: the bytes read and written by a copy of 256 MiB \
with as many threads, over its time. Meshes that fit into the caches may be above 100 %.";

fn solver_names() -> PossibleValuesParser {
    PossibleValuesParser::new(SOLVERS.iter().map(|solver| solver.name))
}

fn read_seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.0..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("write seconds, from 0 to 3600".into()),
    }
}

/// Sizes by default.
const USUAL: [usize; 7] = [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000];
const QUICK: [usize; 2] = [1_000, 10_000];

/// Carries out `viscera bench`.
pub fn execute(arguments: &BenchArguments) -> Result<()> {
    let json = arguments.json.clone().unwrap_or_else(|| arguments.out.join("bench.json"));
    let own = arguments.mesh.as_deref().map(subjects::read).transpose()?;
    let subjects = match &own {
        Some((name, mesh)) => vec![Subject::Mesh(name, mesh)],
        None => arguments.sizes().into_iter().map(Subject::Bar).collect(),
    };
    let solvers = arguments.solvers();
    check_memory(&subjects, &solvers, arguments.memory)?;
    let mut document = Document::prepare(&arguments.out.join("bench.md"), "What solvers cost")?;
    prepare_file(&json, "--json")?;

    let threads = arguments.threads();
    let seconds = arguments.seconds.unwrap_or(if arguments.quick { 0.05 } else { 0.5 });
    let cases = (subjects.len() * solvers.len() + 1) * threads.len();
    let bar = progress::bar(cases as u64, "measuring", "{pos} of {len} cases, {msg}");
    bar.set_message("memory");
    let bandwidth = |&threads: &u32| {
        let measured = Bandwidth::measure(threads);
        bar.inc(1);
        measured
    };
    let bandwidths: Vec<Bandwidth> = threads.iter().map(bandwidth).collect();
    let mut cases = Vec::new();
    for subject in &subjects {
        for entry in &solvers {
            bar.set_message(format!("{} on {} tetrahedra", entry.name, subject.tet_count()));
            let done = || bar.inc(1);
            cases.extend(measurement::measure_all(entry, subject, &bandwidths, seconds, &done)?);
        }
    }
    bar.finish_and_clear();

    let results = Results::new(bandwidths, cases);
    results.fill(&mut document, &solvers)?;
    document.write()?;
    write_whole(&json, results.to_json()?.as_bytes())?;
    files::print(&format!(
        "{}\n{}report: {}\nnumbers: {}\n",
        results.heading(),
        results.table().to_text(),
        document.path().display(),
        json.display()
    ))
}

impl BenchArguments {
    fn sizes(&self) -> Vec<Size> {
        match (self.sizes.is_empty(), self.quick) {
            (false, _) => self.sizes.clone(),
            (true, true) => QUICK.map(Size).to_vec(),
            (true, false) => USUAL.map(Size).to_vec(),
        }
    }

    /// In the order of the table.
    fn solvers(&self) -> Vec<&'static SolverEntry> {
        let is_chosen = |solver: &&SolverEntry| {
            self.solvers.is_empty() || self.solvers.iter().any(|name| name == solver.name)
        };
        SOLVERS.iter().filter(is_chosen).collect()
    }

    /// Ascending, each once.
    fn threads(&self) -> Vec<u32> {
        let mut threads = self.threads.clone();
        if threads.is_empty() {
            let all = std::thread::available_parallelism().map_or(1, usize::from) as u32;
            threads = vec![1, all.min(MOST_THREADS)];
        }
        threads.sort_unstable();
        threads.dedup();
        threads
    }
}

/// Refuses before the work what does not fit: the largest case, or the arrays of the bandwidth.
fn check_memory(
    subjects: &[Subject<'_>],
    solvers: &[&SolverEntry],
    allowed: Option<Memory>,
) -> Result<()> {
    let copy = "the copy that measures the bandwidth";
    memory::check(copy, Memory(2 * bandwidth::COPIED as u64), allowed, "close other programs")?;
    for subject in subjects {
        let tets = subject.tet_count();
        for entry in solvers {
            let what = format!("`{}` on {tets} tetrahedra", entry.name);
            let needed = memory::of_bench(tets, &entry.settings());
            memory::check(&what, needed, allowed, "choose smaller --sizes or another mesh")?;
        }
    }
    Ok(())
}
