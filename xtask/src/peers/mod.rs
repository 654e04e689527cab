//! `cargo xtask peers`: the project beside other simulators, written to docs/peers.md.
//!
//! The benchmark is a folder of Python programs that stays outside the project. This chore gives it
//! an environment, runs it, and writes the report from its result lines.

mod document;
mod environment;
mod results;
mod runs;

use environment::Environment;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

/// What `cargo xtask peers --help` prints.
pub const HELP: &str = "\
Compare viscera with other simulators, on the same scenes and in the same rounds, and write
docs/peers.md. Everything it installs and builds lies in target/peers; delete that to begin anew.

Usage: cargo xtask peers [OPTIONS]

Options:
  --bench DIR       Folder of the benchmark, the one that holds run_bench.py
                    [default: environment variable VISCERA_BENCH]
  --scenes A,B      Scenes [default: A,B]
  --sizes s,m       Sizes xs, s, m, l of the meshes [default: s,m]
  --large           Size l as well, about 100 000 tetrahedra: cost only
  --rounds N        Each round runs everything once; ratios are taken inside a round [default: 3]
  --quick           Scene A, size s, one round, where nothing else is said
  --out FILE        The document [default: docs/peers.md]
  --only-sweeps     Run only the cost of a sweep; the rest is from the last run
  --again           Run nothing; write the document from the last run's results

It needs CPython 3.11 on Linux, and the network for the first run (about 1.5 GB). A round at sizes s
and m takes some ten minutes.";

/// What was asked for.
pub struct Options {
    bench: Option<PathBuf>,
    scenes: Vec<String>,
    sizes: Vec<String>,
    rounds: u32,
    out: Option<PathBuf>,
    again: bool,
    only_sweeps: bool,
    /// As one would type it; without folders, which differ from machine to machine.
    command: String,
}

impl Options {
    fn read(arguments: &[&str]) -> Result<Self, String> {
        let (mut bench, mut out) = (None, None);
        let (mut scenes, mut sizes, mut rounds) = (None, None, None);
        let (mut quick, mut large, mut again, mut only_sweeps) = (false, false, false, false);
        let mut command = String::from("cargo xtask peers");
        let mut rest = arguments.iter();
        while let Some(&flag) = rest.next() {
            let mut value = || rest.next().ok_or(format!("{flag} needs a value"));
            match flag {
                "--bench" => bench = Some(PathBuf::from(value()?)),
                "--out" => out = Some(PathBuf::from(value()?)),
                "--again" => again = true,
                "--only-sweeps" => {
                    only_sweeps = true;
                    command += " --only-sweeps";
                }
                "--quick" | "--large" => {
                    quick |= flag == "--quick";
                    large |= flag == "--large";
                    command += &format!(" {flag}");
                }
                "--scenes" | "--sizes" | "--rounds" => {
                    let value = value()?;
                    match flag {
                        "--scenes" => scenes = Some(names(flag, value, &["A", "B"])?),
                        "--sizes" => sizes = Some(names(flag, value, &["xs", "s", "m", "l"])?),
                        _ => rounds = Some(count(flag, value)?),
                    }
                    command += &format!(" {flag} {value}");
                }
                other => return Err(format!("unknown option `{other}`")),
            }
        }
        let texts = |texts: &[&str]| texts.iter().map(|t| (*t).to_owned()).collect::<Vec<_>>();
        let mut sizes = sizes.unwrap_or(texts(if quick { &["s"] } else { &["s", "m"] }));
        if large && !sizes.iter().any(|size| size == "l") {
            sizes.push("l".into());
        }
        Ok(Self {
            bench: bench.or_else(|| std::env::var_os("VISCERA_BENCH").map(PathBuf::from)),
            scenes: scenes.unwrap_or(texts(if quick { &["A"] } else { &["A", "B"] })),
            sizes,
            rounds: rounds.unwrap_or(if quick { 1 } else { 3 }),
            out,
            again,
            only_sweeps,
            command,
        })
    }
}

fn names(flag: &str, value: &str, known: &[&str]) -> Result<Vec<String>, String> {
    let names: Vec<String> = value.split(',').map(|name| name.trim().to_owned()).collect();
    match names.iter().find(|name| !known.contains(&name.as_str())) {
        Some(other) => Err(format!("{flag}: `{other}` is none of {}", known.join(", "))),
        None => Ok(names),
    }
}

fn count(flag: &str, value: &str) -> Result<u32, String> {
    match value.parse() {
        Ok(count) if count > 0 => Ok(count),
        _ => Err(format!("{flag} {value}: write a whole number above zero")),
    }
}

/// Carries out `cargo xtask peers`.
pub fn peers(arguments: &[&str]) -> ExitCode {
    let options = match Options::read(arguments) {
        Ok(options) => options,
        Err(error) => {
            eprintln!("error: {error}; `cargo xtask peers --help` lists the options");
            return ExitCode::from(2);
        }
    };
    match carry_out(&options) {
        Ok(path) => {
            println!("\nwritten: {}", path.display());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn carry_out(options: &Options) -> Result<PathBuf, String> {
    let environment = Environment::find(options)?;
    let out = options.out.clone().unwrap_or_else(|| environment.root.join("docs/peers.md"));
    if !options.again {
        environment.prepare()?;
        runs::run_all(&environment, options)?;
    }
    let text = document::write(&environment)?;
    write_whole(&out, &text)?;
    Ok(out)
}

/// Writes aside and renames, so that no reader meets a part of a file.
fn write_whole(path: &std::path::Path, text: &str) -> Result<(), String> {
    let part = path.with_extension("part");
    let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, path));
    written.map_err(|error| {
        // Nothing half-written stays behind; the first error is the one to report.
        let _ = std::fs::remove_file(&part);
        format!("cannot write {}: {error}", path.display())
    })
}

/// Runs a command to its end; its output is the progress that one sees.
fn finish(title: &str, command: &mut Command, next_move: &str) -> Result<(), String> {
    println!("\n== {title}");
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{title} failed ({status}): {next_move}")),
        Err(error) => Err(format!("{title} could not be started: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_name_what_is_wrong() {
        let error = |arguments: &[&str]| Options::read(arguments).err().unwrap_or_default();
        assert!(error(&["--rounds", "0"]).contains("above zero"));
        assert!(error(&["--sizes", "s,q"]).contains("`q` is none of xs, s, m, l"));
        assert!(error(&["--scenes"]).contains("needs a value"));
        assert!(error(&["--slow"]).contains("unknown option `--slow`"));
    }

    #[test]
    fn quick_gives_way_to_what_is_said() {
        let options = Options::read(&["--quick", "--sizes", "s,m", "--large", "--bench", "x"]);
        let options = options.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(options.sizes, ["s", "m", "l"]);
        assert_eq!((options.scenes, options.rounds), (vec!["A".to_owned()], 1));
        assert_eq!(options.command, "cargo xtask peers --quick --sizes s,m --large");
    }
}
