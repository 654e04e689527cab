//! The program `viscera-lab`.

use anyhow::{Context, Result};
use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand};
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use viscera_lab::rest_command::{self, RestArguments};
use viscera_lab::validate::{self, Options, SECTIONS};

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
  viscera-lab rest scenes/cantilever.toml --compare";

#[derive(Subcommand)]
enum Command {
    /// Compare the library with closed forms and the reference; write a report
    Validate(ValidateArguments),
    /// Find the exact state of rest at the end of a scene with the Newton reference
    Rest(RestArguments),
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
    #[arg(long, value_name = "SECTION,...", value_delimiter = ',', value_parser = section_names())]
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

fn section_names() -> PossibleValuesParser {
    PossibleValuesParser::new(SECTIONS.iter().map(|section| section.name))
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Validate(arguments) => validate(arguments),
        Command::Rest(arguments) => rest_command::run(&arguments, &print),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn validate(ValidateArguments { quick, out, only, list }: ValidateArguments) -> Result<()> {
    if list {
        return print(&validate::list().to_text());
    }
    // A partial report must not take the place of the whole one.
    let partial = quick || !only.is_empty();
    let usual = if partial { "out/validation.md" } else { "docs/validation.md" };
    let options = Options { out: out.unwrap_or_else(|| usual.into()), quick, only };
    let outcome = validate::run(&options)?;
    let (met, all) = (outcome.met_count(), outcome.verdicts.len());
    let table = outcome.table().to_text();
    print(&format!("{table}{met} of {all} claims are met\nreport: {}\n", options.out.display()))
}

/// Prints text; a reader that has seen enough (`| head`) is no error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot print the result")
        }
        _ => Ok(()),
    }
}
