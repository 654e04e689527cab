//! `cargo xtask wheel`: the Python package, and its tests in a fresh environment.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use crate::{cargo, root};

/// What `cargo xtask wheel --help` prints.
pub const HELP: &str = "\
Build the Python package `viscera` as a wheel, in target/wheels.

Usage: cargo xtask wheel [OPTIONS]

  --test             install it into a fresh environment, with what its tests need, and run them
  --portable         build for every Linux since 2018 (manylinux_2_28), with Zig's linker; this is the wheel to publish
  --python PROGRAM   take this interpreter, 3.10 or later [default: python3]

It makes environments of its own in target/python and installs maturin into one of them; it says so first. Nothing
outside of target is written.";

/// Where wheels are put.
const WHEELS: &str = "target/wheels";

/// Where environments are made.
const FOLDER: &str = "target/python";

/// What builds wheels; the version that this has been tried with.
const BUILDER: &str = "maturin==1.16.0";

/// Zig's compiler as a linker, for the libraries of older systems.
const ZIG: &str = "ziglang==0.15.2";

/// What the tests need beside the package.
const FOR_TESTS: &str = "crates/python/requirements-test.txt";

/// `cargo xtask wheel`.
pub fn wheel(options: &[&str]) -> ExitCode {
    let (mut tests, mut portable, mut python) = (false, false, "python3");
    let mut rest = options.iter();
    while let Some(option) = rest.next() {
        match *option {
            "--test" => tests = true,
            "--portable" => portable = true,
            "--python" => match rest.next() {
                Some(program) => python = program,
                None => {
                    eprintln!("name an interpreter behind --python, such as python3.13");
                    return ExitCode::from(2);
                }
            },
            other => {
                eprintln!(
                    "unknown option `{other}` of `cargo xtask wheel`; there are --test, --portable and --python PROGRAM"
                );
                return ExitCode::from(2);
            }
        }
    }
    let made = build(python, portable).and_then(|wheel| {
        println!("Wheel: {}", wheel.display());
        if !tests {
            return Ok(());
        }
        build_program()?;
        try_out(python, &wheel)
            .map(|counts| println!("{} passed, {} skipped", counts.passed, counts.skipped))
    });
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(sentence) => {
            eprintln!("{sentence}");
            ExitCode::FAILURE
        }
    }
}

/// How many tests there were.
pub struct Counts {
    pub passed: usize,
    pub skipped: usize,
}

/// Whether there is an interpreter that wheels can be built with.
pub fn has_python() -> bool {
    version("python3").is_ok()
}

/// Builds a wheel; its file, or what to do.
pub fn build(python: &str, portable: bool) -> Result<PathBuf, String> {
    version(python)?;
    let needed: &[&str] = if portable { &[BUILDER, ZIG] } else { &[BUILDER] };
    let environment = environment(python, "build", needed)?;
    let wheels = root().join(WHEELS);
    // One of another version or system is not taken for this one.
    let _ = std::fs::remove_dir_all(&wheels);
    let mut command = Command::new(environment.join("bin/maturin"));
    command.args(["build", "--release", "--quiet", "--out"]).arg(&wheels);
    command.arg("--target-dir").arg(root().join("target"));
    command.arg("--interpreter").arg(environment.join("bin/python"));
    if portable {
        command.args(["--zig", "--compatibility", "manylinux_2_28"]);
    }
    command.current_dir(root().join("crates/python"));
    // Ours, where this is run by another.
    command.env("PATH", path_with(&environment));
    run(command, "The wheel was not built; follow the first message above.")?;
    let found = std::fs::read_dir(&wheels).map_err(|e| format!("{}: {e}", wheels.display()))?;
    let mut files = found.flatten().map(|entry| entry.path());
    let wheel = files.find(|file| file.extension().is_some_and(|end| end == "whl"));
    wheel.ok_or_else(|| format!("maturin left no wheel in {}", wheels.display()))
}

/// The program that tests compare the package with.
pub fn build_program() -> Result<(), String> {
    let command = cargo(&["build", "--quiet", "--release"]);
    run(command, "The program was not built; follow the first message above.")
}

/// Installs a wheel into a fresh environment and runs the tests.
pub fn try_out(python: &str, wheel: &Path) -> Result<Counts, String> {
    let name = format!("test-{}", version(python)?);
    // Fresh, so that nothing of another wheel is left.
    let _ = std::fs::remove_dir_all(root().join(FOLDER).join(&name));
    let wheel = wheel.display().to_string();
    let environment = environment(python, &name, &[&wheel, "-r", FOR_TESTS])?;
    let report = root().join(FOLDER).join(format!("{name}.xml"));
    let mut command = Command::new(environment.join("bin/python"));
    command.args([
        "-W",
        "error",
        "-m",
        "pytest",
        "-q",
        "-rs",
        "--durations=5",
        "crates/python/tests",
    ]);
    command.args(["-c", "crates/python/pyproject.toml", "-p", "no:cacheprovider"]);
    command.arg(format!("--junitxml={}", report.display()));
    command.current_dir(root()).env("PYTHONDONTWRITEBYTECODE", "1");
    command.env("VISCERA_PROGRAM", root().join("target/release/viscera"));
    println!("== tests of the package: {}", shown(&command));
    run(command, "Run the first failed test alone: the command above with `-k` and its name.")?;
    counts(&report)
}

/// How many tests a report tells of.
fn counts(report: &Path) -> Result<Counts, String> {
    let text = std::fs::read_to_string(report).map_err(|e| format!("{}: {e}", report.display()))?;
    let number = |name: &str| -> Option<usize> {
        let (_, rest) = text.split_once(&format!(" {name}=\""))?;
        rest.split_once('"')?.0.parse().ok()
    };
    let counts = number("tests").zip(number("skipped"));
    let (all, skipped) = counts.ok_or_else(|| format!("{}: no counts", report.display()))?;
    Ok(Counts { passed: all - skipped, skipped })
}

/// The interpreter's version, such as "3.11"; from 3.10 on.
fn version(python: &str) -> Result<String, String> {
    let advice = "install Python 3.10 or later, with venv (on Debian and Ubuntu: apt-get install python3-venv), or name \
                  one with --python";
    let code = "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2]); sys.exit(sys.version_info < (3, 10))";
    let output = Command::new(python).args(["-c", code]).output();
    match output {
        Ok(output) if output.status.success() => {
            Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
        }
        Ok(_) => Err(format!("{python} is too old or has no venv; {advice}")),
        Err(e) => Err(format!("{python} could not be started ({e}); {advice}")),
    }
}

/// An environment with packages in it; its folder.
fn environment(python: &str, name: &str, packages: &[&str]) -> Result<PathBuf, String> {
    let folder = root().join(FOLDER).join(name);
    let has_begun = folder.join("bin/python").exists();
    if !has_begun {
        let mut command = Command::new(python);
        command.args(["-m", "venv"]).arg(&folder);
        run(command, "The environment was not made; see above.")?;
    }
    let mut command = Command::new(folder.join("bin/python"));
    command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(packages);
    command.current_dir(root());
    println!("Installing into {FOLDER}/{name}: {}", packages.join(" "));
    run(command, "A package was not installed; see above.")?;
    Ok(folder)
}

/// The search path with an environment's programs in front: maturin looks there for Zig.
fn path_with(environment: &Path) -> std::ffi::OsString {
    let mut path = environment.join("bin").into_os_string();
    if let Some(rest) = std::env::var_os("PATH") {
        path.push(":");
        path.push(rest);
    }
    path
}

fn run(mut command: Command, next_move: &str) -> Result<(), String> {
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err(next_move.into()),
        Err(e) => Err(format!("{} could not be started: {e}", command.get_program().display())),
    }
}

/// A command as one would type it.
fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| word.to_string_lossy().into_owned()).collect::<Vec<_>>().join(" ")
}
