//! Programs made of sections: each computes cases, adds to one report, and says what was asked and what
//! came out.

mod cases;
mod changes;
mod progress;

pub use changes::Changes;
pub use progress::{CaseInProgress, Progress};

use anyhow::{Context as _, Result};
use std::fmt::Display;
use std::path::PathBuf;
use viscera_picture::{Image, write_png};
use viscera_report::{Document, Plot, Table};

/// A part of a report with a heading of its own.
#[derive(Clone, Copy)]
pub struct Section {
    /// One word, for `--only`.
    pub name: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// How many cases it will count, quick or full, of scenes that may be changed.
    pub cases: fn(quick: bool, changes: &Changes) -> usize,
    /// Does the work; adds text, tables, plots and verdicts.
    pub run: fn(&mut Context) -> Result<()>,
}

/// Sections that make a report together.
#[derive(Clone, Copy)]
pub struct Program {
    /// The report's heading.
    pub title: &'static str,
    /// How it is called on the command line.
    pub command: &'static str,
    /// In the order of the report.
    pub sections: &'static [Section],
    /// Names of those that take too long for every run: with `--only` alone.
    pub extra: &'static [&'static str],
}

/// What a section works with.
pub struct Context<'a> {
    /// Whether to take fewer cases and smaller meshes, for a look that takes seconds.
    pub quick: bool,
    /// What the user wants otherwise than it is.
    pub changes: &'a Changes,
    /// The report.
    pub document: &'a mut Document,
    /// What was asked and what came out.
    pub verdicts: &'a mut Vec<Verdict>,
    /// The bar that all sections share.
    pub progress: &'a Progress,
    /// The command that makes this section.
    command: String,
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

    /// As [`Context::verdict`], of so many cases: a claim about none of them is not met.
    pub fn verdict_of(
        &mut self,
        count: usize,
        what: impl Into<String>,
        asked: impl Into<String>,
        measured: impl Into<String>,
        met: bool,
    ) {
        let measured = if count > 0 { measured.into() } else { "no cases".to_owned() };
        self.verdict(what, asked, measured, met && count > 0);
    }

    /// A plot, and below it what to see and the command that made it.
    pub fn plot(&mut self, name: &str, plot: &Plot, see: &str) -> Result<()> {
        self.document.figure(name, plot)?;
        self.caption(see);
        Ok(())
    }

    /// A picture, and below it what to see and the command that made it.
    pub fn picture(&mut self, name: &str, words: &str, image: &Image, see: &str) -> Result<()> {
        self.document.picture(name, words, write_png(image)?)?;
        self.caption(see);
        Ok(())
    }

    /// The text under a figure.
    fn caption(&mut self, see: &str) {
        self.document.paragraph(format!("*{see}* Made by `{}`.", self.command));
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

/// What to do, and where the report goes.
#[derive(Clone, Debug)]
pub struct Options {
    /// The report, a Markdown file.
    pub out: PathBuf,
    /// Fewer cases and smaller meshes.
    pub quick: bool,
    /// Names of the sections to run; none means all.
    pub only: Vec<String>,
    /// What the user wants otherwise than it is.
    pub changes: Changes,
}

impl Options {
    /// Whether the report is not the usual, whole one.
    pub fn is_partial(&self) -> bool {
        self.quick || !self.only.is_empty() || !self.changes.is_empty()
    }
}

/// What was found.
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

impl Program {
    /// Runs the chosen sections and writes the report. Fails before the work where the report cannot be
    /// written; a claim that is missed is a finding, no error.
    pub fn run(&self, options: &Options) -> Result<Outcome> {
        let mut document = Document::prepare(&options.out, self.title)?;
        let is_chosen = |section: &&Section| match options.only.is_empty() {
            true => !self.extra.contains(&section.name),
            false => options.only.iter().any(|name| name == section.name),
        };
        let chosen: Vec<&Section> = self.sections.iter().filter(is_chosen).collect();
        let cases_of = |section: &Section| (section.cases)(options.quick, &options.changes);
        let progress = Progress::new(chosen.iter().map(|section| cases_of(section)).sum());
        let mut verdicts = Vec::new();
        for section in &chosen {
            document.heading(section.title);
            let before = progress.done();
            let mut context = Context {
                quick: options.quick,
                changes: &options.changes,
                document: &mut document,
                verdicts: &mut verdicts,
                progress: &progress,
                command: self.command_of(section, options),
            };
            progress
                .section(section.name, || (section.run)(&mut context))
                .with_context(|| format!("section {}", section.name))?;
            let counted = progress.done() - before;
            debug_assert_eq!(counted, cases_of(section), "cases of {}", section.name);
        }
        progress.finish();
        let outcome = Outcome { verdicts };
        self.open(&mut document, options, &chosen, &outcome);
        document.write()?;
        Ok(outcome)
    }

    /// How one asks for a section alone.
    fn command_of(&self, section: &Section, options: &Options) -> String {
        let quick = if options.quick { " --quick" } else { "" };
        format!("{} --only {}{quick}{}", self.command, section.name, options.changes)
    }

    /// What a reader must know first: how this was made, what is missing, and the verdicts.
    fn open(
        &self,
        document: &mut Document,
        options: &Options,
        chosen: &[&Section],
        outcome: &Outcome,
    ) {
        document.open_with_paragraph(format!(
            "Written by `{}`; the program writes it again, so edit the program.",
            self.command
        ));
        if options.quick {
            document.open_with_paragraph(
                "This is the quick run (`--quick`), with fewer cases and smaller meshes.",
            );
        }
        if !options.changes.is_empty() {
            document.open_with_paragraph(format!(
                "The scenes are changed with `{}`; claims are about the usual ones.",
                options.changes.to_string().trim()
            ));
        }
        let names = self.sections.iter().map(|section| section.name);
        let left_out: Vec<&str> =
            names.filter(|name| chosen.iter().all(|section| section.name != *name)).collect();
        if !left_out.is_empty() {
            let why = if options.only.is_empty() { "but for" } else { "with" };
            let left_out = left_out.join(", ");
            document.open_with_paragraph(format!("Left out {why} `--only`: {left_out}."));
        }
        let (met, all) = (outcome.met_count(), outcome.verdicts.len());
        document.open_with_paragraph(format!("**{met} of {all} claims are met.**"));
        document.open_with_table(&outcome.table());
    }

    /// The names, titles and numbers of cases of all sections, of the usual scenes.
    pub fn list(&self) -> Table {
        let mut table = Table::new(["section", "what it shows", "cases", "quick"]);
        let usual = Changes::default();
        for section in self.sections {
            let counts = [false, true].map(|quick| (section.cases)(quick, &usual).to_string());
            let [full, quick] = counts;
            table.row([section.name.to_owned(), section.title.to_owned(), full, quick]);
        }
        table
    }
}
