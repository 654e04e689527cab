//! What a bench leaves behind: a table, a report with plots, JSON.

use super::bandwidth::Bandwidth;
use super::measurement::Measurement;
use super::questions::Answer;
use super::rooflines;
use super::solvers::SolverEntry;
use super::traffic::TrafficReport;
use anyhow::{Context, Result};
use serde::Serialize;
use viscera_report::{Axis, Document, Plot, Series, Style, Table, percent, si};
use viscera_resources::{Memory, processor};

/// All of it.
#[derive(Serialize)]
pub struct Results {
    pub version: &'static str,
    pub processor: String,
    pub processors: usize,
    /// Of the graphics processor, where one was measured.
    pub adapter: Option<AdapterFacts>,
    pub bandwidths: Vec<Bandwidth>,
    pub cases: Vec<Measurement>,
    pub answers: Vec<Answer>,
    /// Of steps of the GPU backend, without a device.
    pub traffic: Vec<TrafficReport>,
    /// What the graphics processor could not do.
    pub skipped: Vec<Skipped>,
    pub notes: Vec<String>,
}

/// A graphics processor.
#[derive(Clone, Debug, Serialize)]
pub struct AdapterFacts {
    pub name: String,
    /// "discrete", "integrated", "virtual", "software" or "other".
    pub kind: &'static str,
    /// The graphics interface.
    pub backend: String,
    pub driver: String,
    pub storage_binding_bytes: u64,
    pub buffer_bytes: u64,
    /// Whether it reports how long its work took.
    pub has_clock: bool,
}

/// A case that a graphics processor could not do.
#[derive(Clone, Debug, Serialize)]
pub struct Skipped {
    pub mesh: String,
    pub tets: usize,
    pub solver: &'static str,
    pub reason: String,
}

/// Solvers that the plot of both devices shows, the first four that were measured.
const COMPARED: [&str; 6] =
    ["exact", "green", "jacobi-green", "jacobi-anderson", "cliques", "green-exact"];

/// A column, and whether it is of a GPU alone.
type Column = (&'static str, bool, fn(&Measurement) -> String);

const COLUMNS: [Column; 16] = [
    ("mesh", false, |case| case.mesh.clone()),
    ("tetrahedra", false, |case| case.tets.to_string()),
    ("solver", false, |case| case.solver.to_owned()),
    ("device", true, |case| case.device.to_owned()),
    ("threads", false, |case| or_dash(case.threads)),
    ("colours", false, |case| case.colors.to_string()),
    ("sweeps", false, |case| or_dash(case.sweeps)),
    ("dispatches", true, |case| or_dash(case.dispatches)),
    ("step, median", false, |case| si(case.step_seconds_median, "s")),
    ("step, min", false, |case| si(case.step_seconds_min, "s")),
    ("step, own clock", true, |case| case.step_device_seconds.map_or("-".into(), |s| si(s, "s"))),
    ("ns/tet/step", false, |case| digits(case.step_ns_per_tet)),
    ("ns/tet/sweep", false, |case| {
        let of_sweep = case.unit_ns_per_tet.filter(|_| case.sweeps.is_some());
        of_sweep.map_or("-".into(), digits)
    }),
    ("B/tet", false, |case| digits(case.bytes_per_tet)),
    ("of bandwidth", false, |case| case.bandwidth_fraction.map_or("-".into(), percent)),
    ("instructions", false, |case| or_dash(case.instructions.as_ref())),
];

pub fn or_dash(value: Option<impl ToString>) -> String {
    value.map_or("-".into(), |value| value.to_string())
}

impl Results {
    pub fn new(adapter: Option<AdapterFacts>) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            processor: processor(),
            processors: std::thread::available_parallelism().map_or(1, usize::from),
            adapter,
            bandwidths: Vec::new(),
            cases: Vec::new(),
            answers: Vec::new(),
            traffic: Vec::new(),
            skipped: Vec::new(),
            notes: Vec::new(),
        }
    }

    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self).context("cannot write JSON")
    }

    /// For a terminal.
    pub fn to_text(&self) -> String {
        let mut text = format!("{}\n{}", self.heading(), self.table().to_text());
        let answers = rooflines::answers(&self.answers);
        for table in [answers, self.skipped_table()].into_iter().flatten() {
            text.push_str(&format!("\n{}", table.to_text()));
        }
        for note in &self.notes {
            text.push_str(&format!("note: {note}\n"));
        }
        text
    }

    /// On what, and how fast its memory is.
    fn heading(&self) -> String {
        let bandwidth = |b: &Bandwidth| {
            let with = b.threads.map_or("on the GPU".into(), |n| format!("with {}", threads(n)));
            let speed = b.bytes_per_second.map_or("an unknown speed".into(), |s| si(s, "B/s"));
            format!("{speed} {with}")
        };
        let bandwidths: Vec<String> = self.bandwidths.iter().map(bandwidth).collect();
        let gpu = self.adapter.as_ref().map_or(String::new(), |adapter| {
            let binding = Memory(adapter.storage_binding_bytes);
            let AdapterFacts { name, kind, backend, driver, .. } = adapter;
            let clock = if adapter.has_clock { "" } else { ", without a clock of its own" };
            format!("; GPU: {name} ({kind}, {backend}, {driver}, binds {binding}{clock})")
        });
        format!(
            "{}, {} processors{gpu}; memory copies at {}",
            self.processor,
            self.processors,
            bandwidths.join(", ")
        )
    }

    fn table(&self) -> Table {
        let shown = || COLUMNS.iter().filter(|column| !column.1 || self.adapter.is_some());
        let mut table = Table::new(shown().map(|column| column.0));
        for case in &self.cases {
            table.row(shown().map(|column| column.2(case)));
        }
        table
    }

    fn skipped_table(&self) -> Option<Table> {
        let mut table = Table::new(["left out", "tetrahedra", "solver", "why"]);
        for case in &self.skipped {
            let (tets, solver) = (case.tets.to_string(), case.solver.to_owned());
            table.row([case.mesh.clone(), tets, solver, case.reason.clone()]);
        }
        (!table.is_empty()).then_some(table)
    }

    /// Stages of each solver on the largest mesh that it was measured on.
    fn stage_table(&self) -> Option<Table> {
        let heads = ["solver", "tetrahedra", "part", "stage", "dispatches", "time"];
        let mut table = Table::new(heads);
        for (i, case) in self.cases.iter().enumerate() {
            let is_smaller = |later: &Measurement| {
                later.solver == case.solver && later.tets > case.tets && !later.stages.is_empty()
            };
            if self.cases.iter().skip(i + 1).any(is_smaller) {
                continue;
            }
            for line in &case.stages {
                table.row([
                    case.solver.to_owned(),
                    case.tets.to_string(),
                    line.part.to_owned(),
                    line.stage.clone(),
                    line.dispatches.to_string(),
                    si(line.seconds, "s"),
                ]);
            }
        }
        (!table.is_empty()).then_some(table)
    }

    /// The same as a report; it has one plot for each number of threads and for the GPU.
    pub fn fill(&self, document: &mut Document, solvers: &[&SolverEntry]) -> Result<()> {
        document.paragraph(format!("{}.", self.heading()));
        for note in &self.notes {
            document.paragraph(format!("Note: {note}."));
        }
        if let Some(table) = rooflines::answers(&self.answers) {
            document.paragraph(super::ASKED);
            document.table(&table);
            document.figure("answers-and-aims", &rooflines::aim_plot(&self.answers))?;
        }
        document.paragraph(super::COUNTING);
        if self.adapter.is_some() {
            document.paragraph(super::COUNTING_GPU);
        }
        document.table(&self.table());
        if let Some(table) = self.skipped_table() {
            document.table(&table);
        }
        let mut names = Table::new(["solver", "what it is"]);
        for solver in solvers {
            names.row([solver.name, solver.what]);
        }
        document.table(&names);
        for bandwidth in &self.bandwidths {
            let name = bandwidth.threads.map_or("gpu".into(), |count| format!("threads-{count}"));
            document.figure(&format!("ns-per-tet-{name}"), &self.plot(bandwidth, solvers))?;
        }
        if self.adapter.is_some() {
            document.figure("cpu-and-gpu", &self.comparison())?;
        }
        if let Some(table) = self.stage_table() {
            document.heading("Stages on the GPU");
            document.table(&table);
        }
        self.fill_counted(document)
    }

    /// What follows from counting.
    fn fill_counted(&self, document: &mut Document) -> Result<()> {
        let [Some(steps), Some(kernels)] =
            [rooflines::steps(&self.traffic), rooflines::kernels(&self.traffic)]
        else {
            return Ok(());
        };
        document.heading("Bytes by counting");
        document.paragraph(rooflines::COUNTING);
        document.table(&steps);
        let gpu = self.bandwidths.iter().find(|bandwidth| bandwidth.threads.is_none());
        let plot = rooflines::roofline_plot(&self.traffic, &self.answers, gpu);
        document.figure("rooflines", &plot)?;
        document.table(&kernels);
        Ok(())
    }

    fn plot(&self, computer: &Bandwidth, solvers: &[&SolverEntry]) -> Plot {
        let name = computer.threads.map_or("GPU".into(), threads);
        let mut plot = Plot::new(
            format!("Cost of a sweep, {name}"),
            Axis::logarithmic("tetrahedra"),
            Axis::logarithmic("time per tetrahedron and sweep [ns]"),
        );
        for solver in solvers {
            let cases = self
                .cases
                .iter()
                .filter(|case| case.solver == solver.name && computer.measured(case));
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

    /// Steps on the CPU with the most threads and on the GPU.
    fn comparison(&self) -> Plot {
        let mut plot = Plot::new(
            "A step on the CPU and on the GPU",
            Axis::logarithmic("tetrahedra"),
            Axis::logarithmic("time of a step, the host's clock [ms]"),
        );
        let most = self.bandwidths.iter().rfind(|bandwidth| bandwidth.threads.is_some());
        let gpu = self.bandwidths.iter().find(|bandwidth| bandwidth.threads.is_none());
        let points = |solver: &str, computer: &Bandwidth| -> Vec<[f64; 2]> {
            let cases = self.cases.iter().filter(|c| c.solver == solver && computer.measured(c));
            cases.map(|c| [c.tets as f64, 1e3 * c.step_seconds_min]).collect()
        };
        let is_measured = |name: &&&str| self.cases.iter().any(|case| case.solver == **name);
        let mut names: Vec<&str> = COMPARED.iter().filter(is_measured).copied().collect();
        if names.is_empty() {
            names.extend(self.cases.first().map(|case| case.solver));
        }
        for name in names.into_iter().take(4) {
            for (computer, what, style) in
                [(most, "CPU", Style::Dashed), (gpu, "GPU", Style::MarkedLine)]
            {
                let Some(computer) = computer else { continue };
                let series = Series::new(format!("{name}, {what}"), points(name, computer));
                plot.series(series.with_style(style));
            }
        }
        plot
    }
}

pub fn threads(count: u32) -> String {
    if count == 1 { "1 thread".into() } else { format!("{count} threads") }
}

/// Three significant digits.
pub fn digits(number: f64) -> String {
    if number == 0.0 {
        return "0".into();
    }
    let decimals = (2 - number.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{number:.decimals$}")
}
