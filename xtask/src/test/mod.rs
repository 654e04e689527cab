//! `cargo xtask test`: format, lints and tests, in two tiers.

mod changed;
mod programs;
mod summary;

use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use crate::{cargo, setup, web, wheel};
use programs::{Outcome, Program, Selection};

/// What `cargo xtask test --help` prints.
pub const HELP: &str = "\
Run what must pass, in this order, stopping at the first failure:

  format          cargo fmt --all --check
  lints           cargo clippy --all-targets -- -D warnings
  tests           the tests that are not marked as slow; the window's and the page's where they were changed
  page            a short look at it in a browser, where `cargo xtask web` has built it

and with --all, which is what decides whether a change is merged, everything:

  tests           the slow ones as well, the window's, and those with real anatomy
  documentation   cargo doc, warnings are errors; the examples in it
  second driver   the portable tests of the GPU backend once more, on a stricter software driver
  main job        the release build of `viscera` runs a scene for two frames and draws it
  Python          the package is built as a wheel, installed into a fresh environment and tried
  page            it is built and tried in a browser

Usage: cargo xtask test [OPTIONS]

  --all         Everything. Needs real data, in the folder that VISCERA_DATA names, and two graphics
                drivers; leaves nothing out
  --no-setup    Install nothing. What cannot be tested then is left out, and said at the end

A graphics driver, rustfmt and clippy are installed where they are missing and that is possible; it says so
first, and in a terminal it asks. `cargo xtask setup` does that alone.

At the end stand the time of every test program and the ten slowest tests. docs/testing.md says how to add a
slow test and how to see whether a test can fail.";

/// The scene of the main job's step.
const MAIN_JOB_SCENE: &str = "scenes/liver_retraction.toml";

/// The package whose tests need a window's libraries.
const WINDOW: &str = "viscera-view";

/// The package that makes the page's files, and its test program that needs a browser.
const BUNDLE: &str = "viscera-bundle";
const IN_BROWSER: &str = "page";

/// Part of the name of the one test of the page that the fast tier runs.
const SHORT: &str = "short";

/// Parts of names of the tests that also run on the second driver: few steps, nothing beyond the baseline.
const SECOND_DRIVER_TESTS: [&str; 3] = ["device_errs", "nasty", "portable"];

/// What is tested that nobody builds who does not ask for it. The window's controllers are left out: they take headers of the
/// system.
pub const SWITCHED_ON: [&str; 2] = ["--features", "viscera-cli/haply"];

/// How a run of everything went so far.
#[derive(Default)]
struct Run {
    times: Vec<(&'static str, Duration)>,
    outcome: Outcome,
    left_out: Vec<String>,
}

/// Why a run ends: the step's name, and what to do.
struct Failure(&'static str, String);

/// `cargo xtask test`.
pub fn test(options: &[&str]) -> ExitCode {
    let (mut all, mut no_setup) = (false, false);
    for option in options {
        match *option {
            "--all" => all = true,
            "--no-setup" => no_setup = true,
            other => {
                eprintln!(
                    "unknown option `{other}` of `cargo xtask test`; there are --all and --no-setup"
                );
                return ExitCode::from(2);
            }
        }
    }
    let started = Instant::now();
    let lacking = if no_setup { setup::lacking(all) } else { setup::provide(all) };
    if all && !lacking.is_empty() {
        eprintln!("\n`cargo xtask test --all` leaves nothing out. {}", lacking.join("\n"));
        return ExitCode::FAILURE;
    }
    let mut run = Run { left_out: lacking, ..Run::default() };
    let result = if all { everything(&mut run) } else { fast(&mut run) };
    println!("\n{}", summary::tables(&run.outcome, &run.times));
    if run.outcome.slow > 0 && !all {
        let slow = run.outcome.slow;
        run.left_out.push(format!("{slow} slow tests: `cargo xtask test --all` runs them."));
    }
    for sentence in &run.left_out {
        println!("Left out: {sentence}");
    }
    println!("Time: {:.0} s", started.elapsed().as_secs_f64());
    let code = match result {
        Ok(()) => {
            println!("All steps passed.");
            ExitCode::SUCCESS
        }
        Err(Failure(step, next_move)) => {
            eprintln!("\n{step} failed. {next_move}");
            ExitCode::FAILURE
        }
    };
    let Outcome { passed, failures, slow, .. } = &run.outcome;
    let skipped = slow + run.outcome.without_device;
    println!("\n{passed} passed, {} failed, {skipped} skipped", failures.len());
    code
}

fn fast(run: &mut Run) -> Result<(), Failure> {
    let can_look = web::is_built() && setup::has_browser();
    let with_window = changed::concerns(&changed::WINDOW);
    let with_page = can_look || changed::concerns(&changed::PAGE);
    let mut packages = vec!["--workspace"];
    for (package, name, is_in) in [(WINDOW, "window", with_window), (BUNDLE, "page", with_page)] {
        if !is_in {
            let sentence =
                format!("{package}, lints and tests: nothing of the {name} has changed.");
            run.left_out.push(sentence);
            packages.extend(["--exclude", package]);
        }
    }
    if !can_look {
        let sentence = "the page in a browser: it takes Debian's chromium, and `cargo xtask web`.";
        run.left_out.push(sentence.into());
    }
    format(run)?;
    lints(run, &packages)?;
    let selection = Selection { packages: &packages, slow: false, required: false };
    let in_browser = tests(run, &selection)?;
    if !can_look {
        return Ok(());
    }
    look(run, &in_browser, &Selection { required: true, ..selection }, &[SHORT])
}

fn everything(run: &mut Run) -> Result<(), Failure> {
    let packages = &["--workspace"];
    format(run)?;
    lints(run, packages)?;
    let selection = Selection { packages, slow: true, required: true };
    let in_browser = tests(run, &selection)?;
    documentation(run)?;
    second_driver(run)?;
    main_job(run)?;
    python(run)?;
    println!("\n== page: cargo xtask web");
    let started = Instant::now();
    let built = web::build();
    run.times.push(("building the page", started.elapsed()));
    built.map_err(|next_move| Failure("page", next_move))?;
    look(run, &in_browser, &selection, &[])
}

/// Tries the page in a browser.
fn look(
    run: &mut Run,
    programs: &[Program],
    selection: &Selection,
    names: &[&str],
) -> Result<(), Failure> {
    println!("\n== page, in a browser");
    let started = Instant::now();
    let outcome = programs::run(programs, selection, names);
    run.times.push(("page", started.elapsed()));
    run.end_of_tests(outcome)
}

fn format(run: &mut Run) -> Result<(), Failure> {
    if leaves_out(run, "rustfmt") {
        return Ok(());
    }
    run.step("format", cargo(&["fmt", "--all", "--check"]), "Run `cargo fmt --all`.")
}

fn lints(run: &mut Run, packages: &[&str]) -> Result<(), Failure> {
    if leaves_out(run, "clippy") {
        return Ok(());
    }
    let targets = &["--all-targets", "--", "-D", "warnings"][..];
    let arguments = [&["clippy"], packages, &SWITCHED_ON, targets].concat();
    let next_move = "Follow the first hint above; `cargo clippy --fix` can apply most of them.";
    run.step("lints", cargo(&arguments), next_move)
}

/// Whether something is lacking and its step has been told as left out.
fn leaves_out(run: &Run, name: &str) -> bool {
    run.left_out.iter().any(|sentence| sentence.contains(&format!("no {name}.")))
}

/// All tests but those that need a browser: their programs are left for later.
fn tests(run: &mut Run, selection: &Selection) -> Result<Vec<Program>, Failure> {
    println!("\n== tests");
    let started = Instant::now();
    let programs = programs::build(selection);
    run.times.push(("building tests", started.elapsed()));
    let programs = programs.map_err(|next_move| Failure("tests", next_move))?;
    let (in_browser, programs): (Vec<_>, Vec<_>) =
        programs.into_iter().partition(|program| program.is_target(BUNDLE, IN_BROWSER));
    let started = Instant::now();
    let outcome = programs::run(&programs, selection, &[]);
    run.times.push(("tests", started.elapsed()));
    run.end_of_tests(outcome)?;
    Ok(in_browser)
}

fn documentation(run: &mut Run) -> Result<(), Failure> {
    let mut pages = cargo(&["doc", "--workspace", "--no-deps"]);
    pages.env("RUSTDOCFLAGS", "-Dwarnings");
    let next_move = "Mend the comments named above; links in them must lead somewhere.";
    run.step("documentation", pages, next_move)?;
    let next_move = "Mend the example named above: `cargo test -p <package> --doc`.";
    run.step("examples in it", cargo(&["test", "--workspace", "--doc"]), next_move)
}

fn second_driver(run: &mut Run) -> Result<(), Failure> {
    let Some(driver) = setup::second_driver() else {
        return Err(Failure("second driver", "Its file has vanished; run this again.".into()));
    };
    println!("\n== second driver: {}", driver.display());
    let started = Instant::now();
    let selection = Selection { packages: &["--workspace"], slow: false, required: true };
    let programs = programs::build(&selection);
    let programs = programs.map_err(|next_move| Failure("second driver", next_move))?;
    let library = programs.into_iter().filter(|p| p.is_integration_of("viscera"));
    let library: Vec<_> = library.map(|program| program.on_driver(&driver)).collect();
    let outcome = programs::run(&library, &selection, &SECOND_DRIVER_TESTS);
    run.times.push(("second driver", started.elapsed()));
    run.end_of_tests(outcome)
}

fn main_job(run: &mut Run) -> Result<(), Failure> {
    let output = std::env::temp_dir().join(format!("viscera-main-job-{}", std::process::id()));
    let mut command = cargo(&["run", "--release", "--", "run", MAIN_JOB_SCENE, "--frames", "2"]);
    command.arg("--out").arg(&output);
    let next_move = "Run the command above with an --out folder of your own and look at it.";
    let result = run.step("main job", command, next_move).and_then(|()| is_drawn(&output));
    // Nothing may be there; then there is nothing to tidy up.
    let _ = std::fs::remove_dir_all(&output);
    result
}

/// The Python package, in a fresh environment. The main job has built the program that it is compared with.
fn python(run: &mut Run) -> Result<(), Failure> {
    println!("\n== Python package: cargo xtask wheel --test");
    let started = Instant::now();
    let built = wheel::build("python3", false);
    run.times.push(("building the wheel", started.elapsed()));
    let started = Instant::now();
    let tried = built.and_then(|file| wheel::try_out("python3", &file));
    run.times.push(("tests of the wheel", started.elapsed()));
    let counts = tried.map_err(|next_move| Failure("Python package", next_move))?;
    run.outcome.passed += counts.passed;
    run.outcome.slow += counts.skipped;
    Ok(())
}

/// The main job has left its picture.
fn is_drawn(output: &Path) -> Result<(), Failure> {
    let picture = output.join("picture.png");
    match std::fs::metadata(&picture) {
        Ok(file) if file.len() > 1000 => Ok(()),
        _ => Err(Failure("main job", format!("{} is missing or empty.", picture.display()))),
    }
}

impl Run {
    fn step(
        &mut self,
        title: &'static str,
        mut command: Command,
        next_move: &str,
    ) -> Result<(), Failure> {
        println!("\n== {title}: {}", shown(&command));
        let started = Instant::now();
        let status = command.status();
        self.times.push((title, started.elapsed()));
        match status {
            Ok(status) if status.success() => Ok(()),
            Ok(_) => Err(Failure(title, next_move.into())),
            Err(e) => Err(Failure(title, format!("cargo could not be started: {e}"))),
        }
    }

    fn end_of_tests(&mut self, outcome: Outcome) -> Result<(), Failure> {
        if outcome.without_device > 0 {
            let count = outcome.without_device;
            self.left_out.push(format!("{count} tests that need a graphics device."));
        }
        let failed = outcome.failures.first().map(|failure| {
            let next_move = format!("Run the first failed test alone: {}", failure.command);
            Failure("tests", next_move)
        });
        self.outcome.add(outcome);
        failed.map_or(Ok(()), Err)
    }
}

/// A command as one would type it.
fn shown(command: &Command) -> String {
    let arguments = command.get_args().map(|a| a.to_string_lossy().into_owned());
    std::iter::once("cargo".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}
