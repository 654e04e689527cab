//! What a bench leaves behind: a table, a report with plots, JSON.

use super::bandwidth::Bandwidth;
use super::measurement::Measurement;
use super::solvers::SolverEntry;
use anyhow::{Context, Result};
use serde::Serialize;
use sysinfo::{CpuRefreshKind, RefreshKind, System};
use viscera_report::{Axis, Document, Plot, Series, Table, percent, si};

/// All of it.
#[derive(Serialize)]
pub struct Results {
    pub version: &'static str,
    pub processor: String,
    pub processors: usize,
    pub bandwidths: Vec<Bandwidth>,
    pub cases: Vec<Measurement>,
}

impl Results {
    pub fn new(bandwidths: Vec<Bandwidth>, cases: Vec<Measurement>) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            processor: processor(),
            processors: std::thread::available_parallelism().map_or(1, usize::from),
            bandwidths,
            cases,
        }
    }

    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self).context("cannot write JSON")
    }

    /// On what, and how fast its memory is.
    pub fn heading(&self) -> String {
        let bandwidth = |b: &Bandwidth| {
            format!("{} with {}", si(b.bytes_per_second, "B/s"), threads(b.threads as usize))
        };
        let bandwidths: Vec<String> = self.bandwidths.iter().map(bandwidth).collect();
        format!(
            "{}, {} processors; memory copies at {}",
            self.processor,
            self.processors,
            bandwidths.join(", ")
        )
    }

    pub fn table(&self) -> Table {
        let mut table = Table::new([
            "mesh",
            "tetrahedra",
            "solver",
            "threads",
            "colours",
            "sweeps",
            "step, median",
            "step, min",
            "ns/tet/step",
            "ns/tet/sweep",
            "B/tet",
            "of bandwidth",
            "instructions",
        ]);
        for case in &self.cases {
            let of_sweep = case.unit_ns_per_tet.filter(|_| case.sweeps.is_some());
            table.row([
                case.mesh.clone(),
                case.tets.to_string(),
                case.solver.to_owned(),
                case.threads.to_string(),
                case.colors.to_string(),
                case.sweeps.map_or("-".into(), |sweeps| sweeps.to_string()),
                si(case.step_seconds_median, "s"),
                si(case.step_seconds_min, "s"),
                digits(case.step_ns_per_tet),
                of_sweep.map_or("-".into(), digits),
                digits(case.bytes_per_tet),
                case.bandwidth_fraction.map_or("-".into(), percent),
                case.instructions.clone(),
            ]);
        }
        table
    }

    /// The same as a report; it has one plot for each number of threads.
    pub fn fill(&self, document: &mut Document, solvers: &[&SolverEntry]) -> Result<()> {
        document.paragraph(format!("{}.", self.heading()));
        document.paragraph(super::COUNTING);
        document.table(&self.table());
        let mut names = Table::new(["solver", "what it is"]);
        for solver in solvers {
            names.row([solver.name, solver.what]);
        }
        document.table(&names);
        for bandwidth in &self.bandwidths {
            let count = bandwidth.threads;
            document.figure(&format!("ns-per-tet-threads-{count}"), &self.plot(count, solvers))?;
        }
        Ok(())
    }

    fn plot(&self, count: u32, solvers: &[&SolverEntry]) -> Plot {
        let mut plot = Plot::new(
            format!("Cost of a sweep, {}", threads(count as usize)),
            Axis::logarithmic("tetrahedra"),
            Axis::logarithmic("time per tetrahedron and sweep [ns]"),
        );
        for solver in solvers {
            let cases = self
                .cases
                .iter()
                .filter(|case| case.solver == solver.name && case.threads == count as usize);
            let points: Vec<[f64; 2]> =
                cases.filter_map(|case| Some([case.tets as f64, case.unit_ns_per_tet?])).collect();
            let name = match solver.sweeps {
                Some(_) => solver.name.to_owned(),
                None => format!("{} (per step)", solver.name),
            };
            plot.series(Series::new(name, points));
        }
        plot
    }
}

fn threads(count: usize) -> String {
    if count == 1 { "1 thread".into() } else { format!("{count} threads") }
}

/// Three significant digits.
fn digits(number: f64) -> String {
    let decimals = (2 - number.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{number:.decimals$}")
}

/// As the processor calls itself.
pub fn processor() -> String {
    let wanted = RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing());
    let system = System::new_with_specifics(wanted).ok();
    let brand = system.as_ref().and_then(|s| s.cpus().first()).map(|cpu| cpu.brand().trim());
    brand.filter(|name| !name.is_empty()).unwrap_or("a processor without a name").to_owned()
}
