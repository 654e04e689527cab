//! `viscera bench`: what the solvers cost on this machine.

mod accuracy;
mod bandwidth;
mod computers;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(not(feature = "gpu"))]
#[path = "no_gpu.rs"]
mod gpu;
mod measurement;
mod questions;
mod results;
mod rooflines;
pub mod solvers;
pub mod subjects;
mod task;
// Without the backend nothing is counted.
#[cfg_attr(not(feature = "gpu"), allow(dead_code))]
mod traffic;

use crate::progress;
use anyhow::{Context, Result};
use bandwidth::Bandwidth;
use clap::Args;
use clap::builder::PossibleValuesParser;
use computers::{Computer, Processor};
use gpu::Gpu;
use measurement::Bench;
use questions::{QUESTIONS, Question};
use results::{Results, Skipped};
use solvers::{SOLVERS, SolverEntry};
use std::path::PathBuf;
use subjects::{Size, Subject};
use traffic::TrafficReport;
use viscera::mesh::TetMesh;
use viscera::settings::{MOST_THREADS, Method, Precision, SolverSettings};
use viscera_report::Document;
use viscera_resources::{Memory, files, memory};

/// Measure what the solvers cost on this machine
///
/// Bars of soft tissue, held at one end, are stepped with each solver. Writes to the output folder:
/// bench.md (everything that the terminal shows, and plots as SVG in bench/) and bench.json. Leave the
/// machine alone meanwhile.
#[derive(Args)]
#[command(after_help = EXAMPLES, after_long_help = format!("{COUNTING}\n\n{EXAMPLES}"))]
pub struct BenchArguments {
    /// About how many tetrahedra, separated by commas
    /// [default: 1k,3k,10k,30k,100k,300k,1M; with --quick 1k,10k; up to 10k on a software --device]
    #[arg(long, value_name = "SIZE,...", value_delimiter = ',', conflicts_with = "mesh")]
    sizes: Vec<Size>,
    /// Measure on this tetrahedral mesh instead of bars
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Measure these solvers only, separated by commas
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = solver_names())]
    solvers: Vec<String>,
    /// Measure on a graphics processor as well: `gpu`, or part of an adapter's name
    #[arg(long, value_name = "gpu|NAME")]
    device: Option<String>,
    /// Answer what was asked of the GPU backend, and print each answer beside its aim
    ///
    /// Frames of 1/60 s and steps of 1/1000 s on 100k and 1M tetrahedra, with forces read back, passes against
    /// the memory bandwidth, dispatches; each on --sizes instead where these are given. With --device on the device
    /// alone, unless --threads asks for the processor as well. Meant to end within ten minutes on a card of a data centre.
    #[arg(long, conflicts_with_all = ["mesh", "solvers", "quick"])]
    questions: bool,
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
  viscera bench --mesh liver.msh --solvers exact --out out/liver
  viscera bench --device gpu --questions";

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

/// What the table of questions says.
const ASKED: &str = "\
Questions and their answers. Soft tissue of 10 kPa; Poisson's ratio is 0.3 in frames and in steps of 1/1000 s, 0.45 in \
the first three, which are as published. A bar held at one end hangs, and of the quasi-Newton method swings, in steps of 1/1000 s with a wave along it. Steps are \
those of a frame, in as many substeps as are chosen for an error of motion of 5 %; passes are iterations of each solve, sweeps of a step or its small \
steps; unused are those of the last solve whose steps were round-off. The tool of one question is a plate below the middle of the bar. \
Where something is read back the time is the host's, the median, from sending a step to having what was read. The error left is that of \
one step against the same step solved to the end in double precision on the processor, as a share of the error of \
inertia alone.";

/// The same for rows of a graphics processor.
const COUNTING_GPU: &str = "\
Steps on the GPU are sent one after the other, each a submission of its own, and waited for together: the \
columns `step, median` and `step, min` are the host's time over their number, `step, own clock` is the \
device's from the beginning of the first to the end of the last. Numbers per tetrahedron, per sweep and of \
bandwidth are by the device's clock where it has one. Its memory bandwidth is measured by a kernel that copies \
128 MiB. Stages are timed in passes of their own, which adds a few microseconds to each.";

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

/// The largest size by default where a processor does a graphics processor's work [tetrahedra].
const MOST_ON_SOFTWARE: usize = 10_000;

/// The most tetrahedra of a mesh whose steps are counted where nothing is asked: counting lays the model out once more.
const MOST_COUNTED: usize = 120_000;

/// A solver on a mesh, and the question that it answers.
struct Case<'a> {
    subject: Subject<'a>,
    entry: SolverEntry,
    question: Option<&'static Question>,
}

/// Carries out `viscera bench`.
pub fn execute(arguments: &BenchArguments) -> Result<()> {
    let json = arguments.json.clone().unwrap_or_else(|| arguments.out.join("bench.json"));
    let own = arguments.mesh.as_deref().map(subjects::read).transpose()?;
    let gpu = arguments.gpu()?;
    let is_software = gpu.as_ref().is_some_and(Gpu::is_software);
    let cases = arguments.cases(own.as_ref(), is_software)?;
    check_memory(&cases, gpu.is_some(), arguments.memory)?;
    let mut document = Document::prepare(&arguments.out.join("bench.md"), "What solvers cost")?;
    files::prepare_file(&json, "--json")?;

    let mut results = Results::new(gpu.as_ref().map(Gpu::facts));
    if is_software && arguments.sizes.is_empty() && own.is_none() {
        results.notes.push(format!(
            "the processor does this GPU's work: no mesh has more than {MOST_ON_SOFTWARE} \
             tetrahedra unless --sizes asks for it"
        ));
    }
    let processors = arguments.threads().into_iter().map(|threads| Processor { threads });
    let mut computers: Vec<Box<dyn Computer>> =
        processors.map(|processor| Box::new(processor) as Box<dyn Computer>).collect();
    computers.extend(gpu.map(|gpu| Box::new(gpu) as Box<dyn Computer>));
    let seconds = arguments.seconds.unwrap_or(if arguments.quick { 0.05 } else { 0.5 });
    measure(&cases, &computers, seconds, &mut results)?;

    let mut solvers: Vec<&SolverEntry> = Vec::new();
    for Case { entry, .. } in &cases {
        if solvers.iter().all(|known| known.name != entry.name) {
            solvers.push(entry);
        }
    }
    results.fill(&mut document, &solvers)?;
    document.write()?;
    files::write_atomic(&json, results.to_json()?.as_bytes())?;
    files::print(&format!(
        "{}report: {}\nnumbers: {}\n",
        results.to_text(),
        document.path().display(),
        json.display()
    ))
}

/// Measures all cases on all computers. What a graphics processor cannot do is reported and left out.
fn measure(
    cases: &[Case<'_>],
    computers: &[Box<dyn Computer>],
    seconds: f64,
    results: &mut Results,
) -> Result<()> {
    let length = (cases.len() + 1) * computers.len();
    let bar = progress::bar(length as u64, "measuring", "{pos} of {len} cases, {msg}");
    bar.set_message("memory");
    for computer in computers {
        results.bandwidths.push(Bandwidth::measure(&**computer, &mut results.notes));
        bar.inc(1);
    }
    for Case { subject, entry, question } in cases {
        let what = format!("{} on {} tetrahedra", entry.name, subject.tet_count());
        bar.set_message(what.clone());
        let mesh = subject.mesh()?;
        let mut bench = Bench::new(entry, &mesh).with_context(|| what.clone())?;
        let method = entry.settings().method;
        // Of the explicit method the small steps are known when it has been measured.
        let is_counted = question.is_some() || subject.tet_count() <= MOST_COUNTED;
        if method == Method::QuasiNewton || (is_counted && method != Method::Explicit) {
            bench.traffic = traffic::report(subject, &bench, 1);
        }
        let judged = question.filter(|question| question.asks_for_error(entry)).map(|_| &*mesh);
        let mut passes = None;
        for (computer, bandwidth) in computers.iter().zip(results.bandwidths.clone()) {
            match bench.measure(subject.name(), &**computer, bandwidth, seconds, judged) {
                Ok(measurement) => {
                    results.answers.extend(question.map(|q| q.answer(&measurement, bench.steps)));
                    passes = Some(measurement.passes);
                    results.cases.push(measurement);
                }
                Err(error) if computer.kind() == "GPU" => results.skipped.push(Skipped {
                    mesh: subject.name().to_owned(),
                    tets: subject.tet_count(),
                    solver: entry.name,
                    reason: format!("{error:#}"),
                }),
                Err(error) => return Err(error.context(what)),
            }
            bar.inc(1);
        }
        if let Some(passes) = passes.filter(|_| is_counted && method == Method::Explicit) {
            bench.traffic = traffic::report(subject, &bench, passes);
        }
        let is_known = |new: &TrafficReport| results.traffic.iter().any(|of| of.is_alike(new));
        let new = bench.traffic.filter(|new| is_counted && !is_known(new));
        results.traffic.extend(new);
    }
    bar.finish_and_clear();
    Ok(())
}

impl BenchArguments {
    /// None unless asked for.
    fn gpu(&self) -> Result<Option<Gpu>> {
        match self.device.as_deref() {
            None | Some("cpu") => Ok(None),
            Some("gpu") => Gpu::open(None).map(Some),
            Some(name) => Gpu::open(Some(name)).map(Some),
        }
    }

    fn cases<'a>(
        &self,
        own: Option<&'a (String, TetMesh)>,
        is_software: bool,
    ) -> Result<Vec<Case<'a>>> {
        let most = if is_software { MOST_ON_SOFTWARE } else { usize::MAX };
        if self.questions {
            return self.question_cases(most);
        }
        let subjects: Vec<Subject<'a>> = match own {
            Some((name, mesh)) => vec![Subject::Mesh(name, mesh)],
            None => self.sizes(most).into_iter().map(Subject::Bar).collect(),
        };
        let solvers = self.solvers();
        let of_subject = |&subject: &Subject<'a>| {
            let case = move |entry: &&SolverEntry| Case {
                subject,
                entry: (*entry).clone(),
                question: None,
            };
            solvers.iter().map(case).collect::<Vec<_>>()
        };
        Ok(subjects.iter().flat_map(of_subject).collect())
    }

    /// Each question on its own mesh, or on each of those asked for.
    fn question_cases<'a>(&self, most: usize) -> Result<Vec<Case<'a>>> {
        let mut cases = Vec::new();
        for question in &QUESTIONS {
            let mut sizes = self.sizes.clone();
            if sizes.is_empty() {
                sizes.push(Size(question.tets.min(most)));
            }
            for size in sizes {
                let subject = Subject::Bar(size);
                cases.push(Case { subject, entry: question.entry()?, question: Some(question) });
            }
        }
        Ok(cases)
    }

    fn sizes(&self, most: usize) -> Vec<Size> {
        let usual = match (self.sizes.is_empty(), self.quick) {
            (false, _) => return self.sizes.clone(),
            (true, true) => QUICK.to_vec(),
            (true, false) => USUAL.to_vec(),
        };
        usual.into_iter().filter(|&size| size <= most).map(Size).collect()
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
        // Questions are asked of the device, on which they are answered in minutes.
        if threads.is_empty() && !(self.questions && self.device.is_some()) {
            let all = std::thread::available_parallelism().map_or(1, usize::from) as u32;
            threads = vec![1, all.min(MOST_THREADS)];
        }
        threads.sort_unstable();
        threads.dedup();
        threads
    }
}

/// Refuses before the work what does not fit: the largest case, or the arrays of the bandwidth.
fn check_memory(cases: &[Case<'_>], has_gpu: bool, allowed: Option<Memory>) -> Result<()> {
    let copy = "the copy that measures the bandwidth";
    memory::check(copy, Memory(2 * bandwidth::COPIED as u64), allowed, "close other programs")?;
    for Case { subject, entry, question } in cases {
        let tets = subject.tet_count();
        let what = format!("`{}` on {tets} tetrahedra", entry.name);
        let Memory(needed) = memory::of_bench(tets, &entry.settings());
        // What a device holds goes through the host's memory, and stays there where it is software.
        let mut needed = Memory(if has_gpu { 2 * needed } else { needed });
        if question.is_some_and(|question| question.asks_for_error(entry)) {
            let precision = Precision::F64;
            needed.0 += memory::of_bench(tets, &SolverSettings { precision, ..entry.settings() }).0;
        }
        memory::check(&what, needed, allowed, "choose smaller --sizes or another mesh")?;
    }
    Ok(())
}
