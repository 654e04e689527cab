//! The program `viscera-lab`.

use anyhow::Result;
use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viscera_lab::converge::{self, ConvergeArguments};
use viscera_lab::rest_command::{self, RestArguments};
use viscera_lab::sections::{Changes, Options, Program};
use viscera_lab::{bars, contact_bench, contact_costs, study, validate};
use viscera_resources::files::{prepare_folder, print};

/// The truth beside the solver: studies that hold its claims against references.
#[derive(Parser)]
#[command(name = "viscera-lab", version, arg_required_else_help = true, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  viscera-lab validate
  viscera-lab validate --quick
  viscera-lab validate --list
  viscera-lab study
  viscera-lab rest scenes/cantilever.toml --compare
  viscera-lab converge scenes/cantilever.toml";

#[derive(Subcommand)]
enum Command {
    /// Compare the library with closed forms and the reference; write a report
    Validate(ValidateArguments),
    /// Show what the published method does and what became of its open problems; write a report
    Study(StudyArguments),
    /// Find the exact state of rest at the end of a scene with the Newton reference
    Rest(RestArguments),
    /// Show how a scene's state of rest depends on its mesh, and what the body itself would do
    Converge(ConvergeArguments),
    /// Measure what contact costs on this machine: distances of instruments' grids, pairs of tissue and tissue
    ContactCosts,
    // For `cargo xtask peers`, not for a person.
    #[command(hide = true)]
    Organs {
        /// Folder for liver.txt, kidney.txt and bowel.txt
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    // Likewise.
    #[command(hide = true)]
    Bars {
        /// Folder for u2.txt and so on, and continuum.json
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    // Likewise: meshes and truths of contact.
    #[command(hide = true)]
    ContactScenes {
        /// Folder for block-s.txt and so on, incline.txt and truths.json
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    // Likewise: one run of ours.
    #[command(hide = true)]
    ContactRun {
        /// press or slide, then KEY=VALUE, separated by commas
        request: String,
    },
}

/// Compare the library with closed forms and the reference; write a report
///
/// Writes one Markdown file with tables, and its figures as SVG to a folder beside it that has the
/// file's name. The report opens with every claim and whether it is met. A claim that is missed is
/// a finding: the program still ends with code 0. On two cores the quick run takes less than a
/// minute, the full run less than twenty; build with --release.
#[derive(Args)]
#[command(after_help = VALIDATE_EXAMPLES)]
struct ValidateArguments {
    /// Take fewer cases and smaller meshes
    #[arg(long)]
    quick: bool,
    /// The report [default: docs/validation.md; with --quick or --only out/validation.md]; figures go
    /// to the folder of the same name without `.md`
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Run these sections only, separated by commas; the report then has no others
    #[arg(long, value_name = "SECTION,...", value_delimiter = ',', value_parser = names(&validate::PROGRAM))]
    only: Vec<String>,
    /// Print the sections and end
    #[arg(long)]
    list: bool,
}

const VALIDATE_EXAMPLES: &str = "\
Examples:
  viscera-lab validate                                    everything, to docs/validation.md
  viscera-lab validate --quick                            a first look, to out/validation.md
  viscera-lab validate --only patch --out out/patch.md    one section, to out/patch.md and out/patch/
  viscera-lab validate --list                             the names of all sections";

/// Show what the published method does and what became of its open problems; write a report
///
/// Writes one Markdown file, and plots (SVG), pictures (PNG) and all numbers (CSV) to a folder beside
/// it that has the file's name. The CSV files are the same in every run on one machine; milliseconds
/// stand in the text only. On two cores the quick run takes less than a minute, the full run less than
/// twenty; build with --release.
#[derive(Args)]
#[command(after_help = STUDY_EXAMPLES)]
struct StudyArguments {
    /// Take fewer cases and smaller meshes
    #[arg(long)]
    quick: bool,
    /// The report [default: docs/study.md; with --quick, --only or --set out/study.md]; figures go to
    /// the folder of the same name without `.md`
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Run these sections only, separated by commas; the report then has no others
    #[arg(long, value_name = "SECTION,...", value_delimiter = ',', value_parser = names(&study::PROGRAM))]
    only: Vec<String>,
    /// Change the scenes: young="20 kPa", poisson=0.4, or mesh=FILE (metres) for a body in the place of
    /// the bar, held at its low end along x
    #[arg(long = "set", value_name = "KEY=VALUE")]
    changes: Vec<String>,
    /// Print the sections and end
    #[arg(long)]
    list: bool,
}

const STUDY_EXAMPLES: &str = "\
Examples:
  viscera-lab study                                       everything, to docs/study.md
  viscera-lab study --quick                               a first look, to out/study.md
  viscera-lab study --only vast                           left out otherwise: it takes minutes
  viscera-lab study --only coloring --set young=\"20 kPa\"  one section, of softer tissue
  viscera-lab study --list                                the names of all sections";

fn names(program: &Program) -> PossibleValuesParser {
    PossibleValuesParser::new(program.sections.iter().map(|section| section.name))
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Validate(arguments) => validate(arguments),
        Command::Study(arguments) => study(arguments),
        Command::Rest(arguments) => rest_command::run(&arguments, &print),
        Command::Converge(arguments) => converge::run(&arguments, &print),
        Command::ContactCosts => contact_costs::measure().and_then(|text| print(&text)),
        Command::Organs { out } => write(&out, validate::write_organs),
        Command::Bars { out } => write(&out, bars::write_bars),
        Command::ContactScenes { out } => write(&out, contact_bench::write_scenes),
        Command::ContactRun { request } => {
            contact_bench::run(&request).and_then(|line| print(&line))
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Writes files to a folder and prints their names.
fn write(out: &Path, files: fn(&Path) -> Result<Vec<PathBuf>>) -> Result<()> {
    prepare_folder(out, "--out")?;
    print(&files(out)?.iter().map(|file| format!("{}\n", file.display())).collect::<String>())
}

fn validate(ValidateArguments { quick, out, only, list }: ValidateArguments) -> Result<()> {
    let options = |out| Options { out, quick, only, changes: Changes::default() };
    report(&validate::PROGRAM, "validation", out, list, options)
}

fn study(StudyArguments { quick, out, only, changes, list }: StudyArguments) -> Result<()> {
    let changes = Changes::parse(&changes)?;
    report(&study::PROGRAM, "study", out, list, |out| Options { out, quick, only, changes })
}

/// Runs a program of sections, or lists them.
fn report(
    program: &Program,
    name: &str,
    out: Option<PathBuf>,
    list: bool,
    options: impl FnOnce(PathBuf) -> Options,
) -> Result<()> {
    if list {
        return print(&program.list().to_text());
    }
    let mut options = options(PathBuf::new());
    // A partial report must not take the place of the whole one.
    let folder = if options.is_partial() { "out" } else { "docs" };
    options.out = out.unwrap_or_else(|| PathBuf::from(format!("{folder}/{name}.md")));
    let outcome = program.run(&options)?;
    let (met, all) = (outcome.met_count(), outcome.verdicts.len());
    let table = outcome.table().to_text();
    print(&format!("{table}{met} of {all} claims are met\nreport: {}\n", options.out.display()))
}
