//! Bars against the continuum: the coarsest bar on which the tip sinks as far as that of the body which the bar stands
//! for, and what a frame costs there. `cargo xtask peers --continuum`.
//!
//! Every simulator is judged by the continuum of its own law, and twice: its tip has to come near the continuum's, and
//! near that of linear tetrahedra of the same mesh that are solved exactly. Unfinished iterations are soft where coarse
//! tetrahedra are stiff, so that the two errors cancel on some bar, and on no finer one.

use super::environment::Environment;
use super::plan::{self, AUTOMATIC, Method, Program};
use super::results::{self, cost, number};
use super::runs::{self, Kind, Run, append};
use super::{Options, continuum_document, write_whole};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Poisson's ratio of the bars: that of [`Kind::Sunk`].
pub const POISSON: &str = "0.45";

/// Largest distance of a tip from where it belongs, of the continuum's sag.
pub const LIMIT: f64 = 0.05;

/// CPU time [s] that a run of 180 frames may take: half a second a frame, thirty times real time.
pub const LONGEST: f64 = 100.0;

/// Frames of a run.
const FRAMES: f64 = 180.0;

/// Bars that are tried one after the other, by cells across; those between are tried once one is fine enough.
const LADDER: [u32; 11] = [2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 20];

/// Costs grow with the cells to this power at least.
const GROWTH: f64 = 3.0;

/// How bars are filled.
pub struct Filling {
    /// In tables.
    pub name: &'static str,
    /// Of the names of sizes.
    letter: char,
    /// How many times dearer the best peer is asked to be.
    pub goal: f64,
    /// How many times as dear as the cheapest peer that is within the limit another may be: one that costs more on some
    /// bar cannot be the best on a finer one. What is unstructured needs bars on which that takes an hour.
    pub how_dear: f64,
}

/// Boxes of five tetrahedra as the benchmark makes them, and tetrahedra in no order.
pub const FILLINGS: [Filling; 2] = [
    Filling { name: "structured", letter: 'n', goal: 40.0, how_dear: 4.0 },
    Filling { name: "unstructured", letter: 'u', goal: 150.0, how_dear: 2.0 },
];

/// Ours; ratios are taken to the first.
pub const OURS: [&str; 3] = [
    "material=snh,accuracy=standard,elements=recovered",
    "material=snh,accuracy=draft,elements=recovered",
    "material=snh,accuracy=standard,elements=plain",
];

/// What solves linear tetrahedra of a law exactly: our default is off by less than a ten-thousandth at rest, and is cheap.
fn exact_settings(law: &str) -> String {
    format!("material={law},accuracy=standard,elements=plain")
}

/// What came of a bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Attempt {
    Within,
    Far,
    /// The solver leaves the truth on finer bars.
    Lost,
    /// Finer bars take too long.
    Dear,
}

/// The coarsest bar that is within the limit; one that is so stays so on finer ones.
fn coarsest(
    mut attempt: impl FnMut(u32) -> Result<Attempt, String>,
) -> Result<Option<u32>, String> {
    let mut far = LADDER[0] - 1;
    for cells in LADDER {
        match attempt(cells)? {
            Attempt::Far => far = cells,
            Attempt::Lost | Attempt::Dear => return Ok(None),
            Attempt::Within => {
                let mut within = cells;
                while within - far > 1 {
                    let middle = far.midpoint(within);
                    let is_within = attempt(middle)? == Attempt::Within;
                    *(if is_within { &mut within } else { &mut far }) = middle;
                }
                return Ok(Some(within));
            }
        }
    }
    Ok(None)
}

/// Whether a tip is where it belongs.
pub fn is_near(row: &Value) -> bool {
    row["status"] == "ok" && number(row, "error").is_some_and(|error| error.abs() <= LIMIT)
}

/// And not because a solver's error cancels that of the mesh.
pub fn is_within(row: &Value) -> bool {
    is_near(row) && number(row, "solver_error").is_none_or(|error| error.abs() <= LIMIT)
}

/// A method's way from coarse to fine bars.
#[derive(Default)]
struct Course {
    /// Cells and CPU time of a frame [ms] of the last bar.
    last: Option<(u32, f64)>,
    /// Of the last bar, where that was too large.
    solver_error: Option<f64>,
    /// Fewest that were stable, and on a bar of how many cells.
    substeps: Option<(u64, u32)>,
}

impl Course {
    /// CPU time [s] of a run on a bar, at least.
    fn foretold(&self, cells: u32) -> f64 {
        let growth = |last: u32| (f64::from(cells) / f64::from(last)).powf(GROWTH);
        self.last.map_or(0.0, |(last, cost)| 1e-3 * FRAMES * cost * growth(last))
    }

    /// What a row says, and whether the way goes on.
    fn judge(&mut self, row: &Value, cells: u32) -> Attempt {
        if let Some(cost) = cost(row) {
            self.last = Some((cells, cost));
        }
        let status = row["status"].as_str().unwrap_or("?");
        if status.starts_with("timeout") {
            return Attempt::Dear;
        }
        if is_within(row) {
            return Attempt::Within;
        }
        let error = match (status, number(row, "solver_error")) {
            ("ok", error) => error.unwrap_or(0.0).abs(),
            _ => f64::INFINITY,
        };
        let before = self.solver_error.replace(error);
        let grows = before.is_some_and(|before| before > LIMIT && error >= before);
        if error > LIMIT && grows { Attempt::Lost } else { Attempt::Far }
    }

    /// Substeps with which to begin the search for the fewest: no more than so fine a bar needs.
    fn begin(&self, cells: u32) -> u64 {
        self.substeps
            .map_or(8, |(fewest, of)| (fewest * u64::from(cells) * 9).div_ceil(u64::from(of) * 10))
    }
}

/// What runs, and what is known.
struct Bars<'a> {
    environment: &'a Environment,
    /// Of each law the sag of the continuum and its error [m].
    truths: BTreeMap<String, [f64; 2]>,
    file: PathBuf,
    rows: Vec<Value>,
}

impl Bars<'_> {
    /// One run, of the search or of a round. What is known is not run again.
    fn run(
        &mut self,
        method: &Method,
        settings: &Value,
        filling: &Filling,
        cells: u32,
        round: Option<u32>,
    ) -> Result<Value, String> {
        let size = format!("{}{cells}", filling.letter);
        let is_same = |row: &&Value| {
            row["peer"] == method.label
                && row["cfg_asked"] == *settings
                && row["filling"] == filling.name
                && row["cells"] == cells
                && row["round"] == json!(round)
        };
        if let Some(known) = self.rows.iter().find(is_same) {
            return Ok(known.clone());
        }
        let run =
            Run { method, settings: settings.clone(), scene: "A", size: &size, kind: Kind::Sunk };
        let mut row = run.result(self.environment)?;
        row["filling"] = json!(filling.name);
        row["cells"] = json!(cells);
        row["round"] = json!(round);
        let law = row["mat_own"].as_str().unwrap_or("stvk").to_owned();
        let sag = row["probe_mm"][2].as_f64().map(|z| -1e-3 * z);
        let [truth, _] = self.truths.get(&law).ok_or(format!("no continuum of {law} is known"))?;
        row["law"] = json!(law);
        row["error"] = json!(sag.map(|sag| sag / truth - 1.0));
        if method.program != Program::Ours {
            let exact = self.exact(&law, filling, cells)?;
            row["solver_error"] = json!(sag.zip(exact).map(|(sag, exact)| sag / exact - 1.0));
        }
        println!("{}", told(&row));
        append(&self.file, &row)?;
        self.rows.push(row.clone());
        Ok(row)
    }

    /// Sag [m] of linear tetrahedra, solved exactly.
    fn exact(&mut self, law: &str, filling: &Filling, cells: u32) -> Result<Option<f64>, String> {
        let Some(ours) = plan::method(AUTOMATIC) else { return Ok(None) };
        let settings = plan::settings(&exact_settings(law), 1);
        let row = self.run(ours, &settings, filling, cells, None)?;
        let truth = self.truths.get(law).map_or(f64::NAN, |[truth, _]| *truth);
        Ok(number(&row, "error").map(|error| (1.0 + error) * truth))
    }

    /// One bar of a method; explicit ones with the fewest substeps, to a tenth, that keep it whole.
    fn attempt(
        &mut self,
        method: &Method,
        text: &str,
        filling: &Filling,
        cells: u32,
        course: &mut Course,
    ) -> Result<Attempt, String> {
        let needed = cells.max(least_cells(&self.rows, filling));
        if course.foretold(needed) > longest(&self.rows, filling) {
            return Ok(Attempt::Dear);
        }
        let is_explicit = text.contains("fewest");
        let mut substeps = course.begin(cells);
        loop {
            let settings = plan::settings(text, substeps);
            let row = self.run(method, &settings, filling, cells, None)?;
            let is_solved = number(&row, "solver_error").is_some_and(|error| error.abs() <= LIMIT);
            let is_dear = row["status"].as_str().is_some_and(|s| s.starts_with("timeout"));
            if !is_explicit || is_dear || is_solved || substeps > 2000 {
                course.substeps = Some((substeps, cells));
                return Ok(course.judge(&row, cells));
            }
            substeps += substeps.div_ceil(10);
        }
    }

    /// Bars of all methods, from coarse to fine.
    fn search(&mut self, options: &Options, filling: &Filling) -> Result<(), String> {
        for method in self.environment.installed(options)? {
            let texts: Vec<&str> = match method.program {
                Program::Ours if method.label == AUTOMATIC => OURS.to_vec(),
                Program::Ours => Vec::new(),
                _ => method
                    .points
                    .iter()
                    .map(|p| p.settings)
                    .filter(|s| !s.contains("twice"))
                    .collect(),
            };
            for text in texts {
                let mut course = Course::default();
                let found =
                    coarsest(|cells| self.attempt(method, text, filling, cells, &mut course))?;
                println!("{}, {}, {text}: {found:?} cells", filling.name, method.label);
                // Settings go from cheap to dear: dearer ones cost more on the same bar.
                if found.is_some() && method.program != Program::Ours {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Rounds of what was found; every other one in reverse order.
    fn rounds(&mut self, options: &Options, filling: &Filling) -> Result<(), String> {
        let jobs: Vec<(&str, Value, u32)> = chosen(&self.rows, filling.name)
            .into_iter()
            .filter_map(|row| {
                let method = plan::method(row["peer"].as_str()?)?;
                Some((method.label, row["cfg_asked"].clone(), row["cells"].as_u64()? as u32))
            })
            .collect();
        for round in 0..options.rounds {
            let mut order: Vec<_> = jobs.iter().collect();
            if round % 2 == 1 {
                order.reverse();
            }
            for (label, settings, cells) in order {
                let Some(method) = plan::method(label) else { continue };
                self.run(method, settings, filling, *cells, Some(round))?;
            }
        }
        Ok(())
    }
}

/// What is timed, of the rows of a search: of each peer the cheapest that is within, of ours each setting's; and the
/// cheapest peer whose errors cancel.
pub fn chosen<'a>(rows: &'a [Value], filling: &str) -> Vec<&'a Value> {
    let here: Vec<&Value> =
        rows.iter().filter(|row| row["filling"] == filling && row["round"].is_null()).collect();
    let cheapest = |fits: &dyn Fn(&Value) -> bool| {
        let fitting = here.iter().copied().filter(|row| fits(row) && cost(row).is_some());
        fitting.min_by(|a, b| cost(a).unwrap_or(f64::NAN).total_cmp(&cost(b).unwrap_or(f64::NAN)))
    };
    let mut chosen: Vec<&Value> = Vec::new();
    for text in OURS {
        let settings = plan::settings(text, 1);
        chosen.extend(cheapest(&|row| {
            is_ours(row) && row["cfg_asked"] == settings && is_within(row)
        }));
    }
    for method in plan::METHODS.iter().filter(|method| method.program != Program::Ours) {
        chosen.extend(cheapest(&|row| row["peer"] == method.label && is_within(row)));
    }
    let lucky = cheapest(&|row| !is_ours(row) && is_near(row));
    chosen.extend(lucky.filter(|row| !is_within(row)));
    chosen
}

/// CPU time [s] that a peer's run may take, by the best that is known.
fn longest(rows: &[Value], filling: &Filling) -> f64 {
    let fits = |row: &&Value| row["filling"] == filling.name && !is_ours(row) && is_within(row);
    let costs = rows.iter().filter(fits).filter_map(cost);
    costs.fold(LONGEST, |least, cost| least.min(1e-3 * FRAMES * filling.how_dear * cost))
}

/// Cells across, below which no peer can be within, as far as is known: where
/// exact answers are off by more than twice the limit, a solver would have to be off by more than the limit to hide it.
fn least_cells(rows: &[Value], filling: &Filling) -> u32 {
    let exact = plan::settings(OURS[2], 1);
    let fits = |row: &&Value| {
        let is_exact = row["filling"] == filling.name && row["cfg_asked"] == exact;
        is_exact && number(row, "error").is_some_and(|error| error.abs() <= 2.0 * LIMIT)
    };
    let cells = rows.iter().filter(fits).filter_map(|row| row["cells"].as_u64());
    cells.min().map_or(LADDER[0], |cells| cells as u32)
}

/// Whether a row is of this project.
pub fn is_ours(row: &Value) -> bool {
    row["peer"].as_str().is_some_and(|peer| peer.starts_with("viscera"))
}

/// A line of progress.
fn told(row: &Value) -> String {
    let shown = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".into(), |value| format!("{value:.digits$}"))
    };
    let percent = |key: &str| shown(number(row, key).map(|share| 100.0 * share), 2);
    format!(
        "{:12} {:>2} cells {:24} {:70} {:>9} ms  continuum {:>7} %  solver {:>7} %  {}",
        row["filling"].as_str().unwrap_or("?"),
        row["cells"],
        row["peer"].as_str().unwrap_or("?"),
        row["cfg_asked"].to_string().replace('"', ""),
        shown(cost(row), 3),
        percent("error"),
        percent("solver_error"),
        row["status"].as_str().unwrap_or("?"),
    )
}

/// Searches and rounds, then the document.
pub fn carry_out(options: &Options) -> Result<PathBuf, String> {
    let environment = Environment::find(options)?;
    let results = environment.results();
    let file = results.join("continuum.jsonl");
    let out = options.out.clone();
    let out = out.unwrap_or_else(|| environment.root.join("docs/peers-continuum.md"));
    if !options.again {
        environment.prepare()?;
        let truths = environment.bars()?;
        let rows = if options.keep { results::read(&file)? } else { Vec::new() };
        let text: String = rows.iter().map(|row| format!("{row}\n")).collect();
        write_whole(&file, &text)?;
        let about = json!({ "command": options.command, "cpu": runs::cpu_model(), "rounds": options.rounds,
                            "truths": truths, "missing": environment.missing(options)? });
        write_whole(&results.join("continuum-about.json"), &about.to_string())?;
        let mut bars = Bars { environment: &environment, truths, file: file.clone(), rows };
        for filling in &FILLINGS {
            println!("\n== {} bars against the continuum", filling.name);
            bars.search(options, filling)?;
            bars.rounds(options, filling)?;
        }
    }
    let about = results::read(&results.join("continuum-about.json"))?;
    let about = about.first().ok_or("continuum-about.json is empty")?;
    let text = continuum_document::write(&environment, about, &results::read(&file)?, &out)?;
    write_whole(&out, &text)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coarsest_bar_is_found_between_those_that_are_tried() -> Result<(), String> {
        for truth in [2, 3, 7, 13, 16, 20] {
            let mut tried = Vec::new();
            let found = coarsest(|cells| {
                tried.push(cells);
                Ok(if cells >= truth { Attempt::Within } else { Attempt::Far })
            })?;
            assert_eq!(found, Some(truth), "{tried:?}");
        }
        assert_eq!(coarsest(|_| Ok(Attempt::Far))?, None);
        let mut tried = 0;
        let lost = |cells| {
            tried += 1;
            Ok(if cells < 4 { Attempt::Far } else { Attempt::Lost })
        };
        assert_eq!((coarsest(lost)?, tried), (None, 3));
        Ok(())
    }

    fn row(peer: &str, cells: u32, cost: f64, error: f64, solver: Option<f64>) -> Value {
        json!({ "peer": peer, "cfg_asked": plan::settings(OURS[0], 1), "cells": cells, "filling": "structured",
                "cpu_ms": cost, "error": error, "solver_error": solver, "status": "ok" })
    }

    #[test]
    fn errors_that_cancel_are_near_and_not_within() {
        let cancels = row("Pbat, XPBD", 4, 1.0, 0.01, Some(0.2));
        assert!(is_near(&cancels) && !is_within(&cancels));
        assert!(is_within(&row("Pbat, XPBD", 4, 1.0, -0.05, Some(0.05))));
        assert!(!is_near(&row("Pbat, XPBD", 4, 1.0, -0.051, Some(0.0))));
        // Of ours no linear tetrahedra are the truth.
        assert!(is_within(&row(AUTOMATIC, 2, 1.0, 0.02, None)));
    }

    #[test]
    fn a_solver_is_lost_once_its_error_grows() {
        let mut course = Course::default();
        let mut judge = |cells, error, solver| {
            course.judge(&row("Pbat, VBD", cells, 1.0, error, Some(solver)), cells)
        };
        assert_eq!(judge(2, -0.4, 0.0), Attempt::Far);
        assert_eq!(judge(3, -0.3, 0.06), Attempt::Far, "once is no course");
        assert_eq!(judge(4, -0.2, 0.04), Attempt::Far);
        assert_eq!(judge(5, -0.1, -0.1), Attempt::Far);
        assert_eq!(judge(6, -0.1, -0.2), Attempt::Lost);
        assert_eq!(judge(8, 0.04, 0.01), Attempt::Within);
    }

    #[test]
    fn what_takes_too_long_is_foretold() {
        let course = Course { last: Some((4, 10.0)), ..Course::default() };
        assert!((course.foretold(8) - 14.4).abs() < 1e-9, "{}", course.foretold(8));
        assert!(Course::default().foretold(20).abs() < 1e-9);
        let course = Course { substeps: Some((50, 4)), ..Course::default() };
        assert_eq!((course.begin(8), Course::default().begin(8)), (90, 8));
        let best = row("MuJoCo, implicit", 9, 50.0, -0.04, Some(0.0));
        let rows =
            [row(AUTOMATIC, 2, 0.1, 0.0, None), row("Pbat, XPBD", 4, 1.0, 0.0, Some(0.2)), best];
        assert!((longest(&rows, &FILLINGS[0]) - 36.0).abs() < 1e-9);
        assert!((longest(&rows, &FILLINGS[1]) - LONGEST).abs() < 1e-9);
        let exact = |cells: u32, error: f64| {
            let mut row = row(AUTOMATIC, cells, 1.0, error, None);
            row["cfg_asked"] = plan::settings(OURS[2], 1);
            row
        };
        let rows =
            [exact(6, -0.08), exact(8, -0.05), exact(5, -0.11), row(AUTOMATIC, 2, 0.1, 0.0, None)];
        assert_eq!(FILLINGS.map(|filling| least_cells(&rows, &filling)), [6, 2]);
        let slow = json!({ "status": "timeout", "cpu_ms": 900.0 });
        assert_eq!(Course::default().judge(&slow, 8), Attempt::Dear);
    }

    #[test]
    fn the_cheapest_of_each_is_timed_and_the_luckiest_peer() {
        let rows = [
            row(AUTOMATIC, 2, 0.3, 0.02, None),
            row(AUTOMATIC, 3, 0.2, 0.2, None),
            row("MuJoCo, implicit", 8, 20.0, -0.04, Some(0.0)),
            row("MuJoCo, implicit", 9, 30.0, -0.03, Some(0.0)),
            row("Pbat, XPBD", 4, 5.0, 0.0, Some(0.2)),
            row("Pbat, XPBD", 5, 4.0, 0.3, Some(0.4)),
        ];
        let costs: Vec<Option<f64>> = chosen(&rows, "structured").into_iter().map(cost).collect();
        assert_eq!(costs, [Some(0.3), Some(20.0), Some(5.0)]);
        assert!(chosen(&rows, "unstructured").is_empty());
    }
}
