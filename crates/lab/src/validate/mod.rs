//! `viscera-lab validate`: sections that compare the library with what must come out, and the
//! report they write together.

mod cantilever;
mod cases;
mod frequency;
mod indentation;
mod independence;
mod methods;
mod motion;
mod organ;
mod patch;
mod progress;
mod rest;
mod stress;
mod twist;
mod uniaxial;

pub use progress::{CaseInProgress, Progress};

use anyhow::{Context as _, Result};
use std::fmt::Display;
use std::path::PathBuf;
use viscera_report::{Document, Table};

/// A part of the validation with a heading of its own in the report.
#[derive(Clone, Copy)]
pub struct Section {
    /// One word, for `--only`.
    pub name: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// How many cases it will count, quick or full.
    pub cases: fn(quick: bool) -> usize,
    /// Does the work; adds text, tables, plots and verdicts.
    pub run: fn(&mut Context) -> Result<()>,
}

/// All sections, in the order of the report.
pub const SECTIONS: &[Section] = &[
    patch::SECTION,
    uniaxial::SECTION,
    cantilever::SECTION,
    twist::SECTION,
    frequency::SECTION,
    indentation::SECTION,
    organ::SECTION,
    rest::SECTION,
    independence::SECTION,
    motion::SECTION,
    stress::SECTION,
];

/// What a section works with.
pub struct Context<'a> {
    /// Whether to take fewer cases and smaller meshes, for a look that takes seconds.
    pub quick: bool,
    /// The report.
    pub document: &'a mut Document,
    /// What was asked and what came out.
    pub verdicts: &'a mut Vec<Verdict>,
    /// The bar that all sections share.
    pub progress: &'a Progress,
}

impl Context<'_> {
    /// Computes independent cases on all cores, with a step of the progress bar for each. Results
    /// are in the order of the cases. An error and a panic name the case.
    pub fn run_cases<C: Display + Sync, T: Send>(
        &self,
        cases: &[C],
        run: impl Fn(&C) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        cases::run_cases(self.progress, cases, run)
    }

    /// Adds a line to the table at the head of the report.
    pub fn verdict(
        &mut self,
        what: impl Into<String>,
        asked: impl Into<String>,
        measured: impl Into<String>,
        met: bool,
    ) {
        let (what, asked, measured) = (what.into(), asked.into(), measured.into());
        self.verdicts.push(Verdict { what, asked, measured, met });
    }
}

/// A claim and its measurement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// What was measured.
    pub what: String,
    /// What it must be.
    pub asked: String,
    /// What it is.
    pub measured: String,
    /// Whether that is good enough.
    pub met: bool,
}

/// What to validate, and where the report goes.
#[derive(Clone, Debug)]
pub struct Options {
    /// The report, a Markdown file.
    pub out: PathBuf,
    /// Fewer cases and smaller meshes.
    pub quick: bool,
    /// Names of the sections to run; none means all.
    pub only: Vec<String>,
}

/// What a validation found.
pub struct Outcome {
    /// In the order of the report.
    pub verdicts: Vec<Verdict>,
}

impl Outcome {
    /// One line per verdict, for the report and the terminal.
    pub fn table(&self) -> Table {
        let mut table = Table::new(["what", "asked", "measured", "verdict"]);
        for Verdict { what, asked, measured, met } in &self.verdicts {
            table.row([what.as_str(), asked, measured, if *met { "met" } else { "missed" }]);
        }
        table
    }

    /// How many claims are met.
    pub fn met_count(&self) -> usize {
        self.verdicts.iter().filter(|verdict| verdict.met).count()
    }
}

/// Runs the chosen sections and writes the report. Fails before the work where the report cannot be
/// written; a claim that is missed is a finding, no error.
pub fn run(options: &Options) -> Result<Outcome> {
    let mut document = Document::prepare(&options.out, "Validation")?;
    let is_chosen = |section: &&Section| {
        options.only.is_empty() || options.only.iter().any(|name| name == section.name)
    };
    let chosen: Vec<&Section> = SECTIONS.iter().filter(is_chosen).collect();
    let progress = Progress::new(chosen.iter().map(|section| (section.cases)(options.quick)).sum());
    let mut verdicts = Vec::new();
    for section in &chosen {
        document.heading(section.title);
        let before = progress.done();
        let mut context = Context {
            quick: options.quick,
            document: &mut document,
            verdicts: &mut verdicts,
            progress: &progress,
        };
        progress
            .section(section.name, || (section.run)(&mut context))
            .with_context(|| format!("section {}", section.name))?;
        let counted = progress.done() - before;
        debug_assert_eq!(counted, (section.cases)(options.quick), "cases of {}", section.name);
    }
    progress.finish();
    let outcome = Outcome { verdicts };
    open(&mut document, options, &chosen, &outcome);
    document.write()?;
    Ok(outcome)
}

/// What a reader must know first: how this was made, what is missing, and the verdicts.
fn open(document: &mut Document, options: &Options, chosen: &[&Section], outcome: &Outcome) {
    document.open_with_paragraph(
        "Written by `viscera-lab validate`; the program writes it again, so edit the program.",
    );
    if options.quick {
        document.open_with_paragraph(
            "This is the quick run (`--quick`), with fewer cases and smaller meshes.",
        );
    }
    if chosen.len() < SECTIONS.len() {
        let names = SECTIONS.iter().map(|section| section.name);
        let left_out: Vec<&str> =
            names.filter(|name| chosen.iter().all(|section| section.name != *name)).collect();
        document.open_with_paragraph(format!("Left out with `--only`: {}.", left_out.join(", ")));
    }
    let (met, all) = (outcome.met_count(), outcome.verdicts.len());
    document.open_with_paragraph(format!("**{met} of {all} claims are met.**"));
    document.open_with_table(&outcome.table());
}

/// The names, titles and numbers of cases of all sections.
pub fn list() -> Table {
    let mut table = Table::new(["section", "what it shows", "cases", "quick"]);
    for section in SECTIONS {
        let counts = [false, true].map(|quick| (section.cases)(quick).to_string());
        let [full, quick] = counts;
        table.row([section.name.to_owned(), section.title.to_owned(), full, quick]);
    }
    table
}
