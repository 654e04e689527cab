//! `cargo xtask peers`: the project beside other simulators, written to docs/peers.md.
//!
//! The benchmark is a folder of Python programs that stays outside the project. This chore gives it
//! an environment, runs it, and writes the report from its result lines.

mod contact;
mod contact_document;
mod continuum;
mod continuum_document;
mod document;
mod environment;
mod figures;
mod goals;
mod largest;
mod plan;
mod results;
mod runs;
mod sweeps;
mod table;

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
  --sizes s,m       Sizes: xs, s, m, l of the meshes, nN for a bar of N cells across, and in scene A the
                    organs liver, kidney, bowel [default: s,m,liver,kidney,bowel]
  --large           Size l as well, about 100 000 tetrahedra
  --rounds N        Each round runs everything once; ratios are taken inside a round. Settings that stand
                    in plots only are run in the first [default: 3]
  --peers NAME,...  Only these: mujoco, pbatoolkit, newton, pypbd, rapier [default: all that are installed]
  --quick           Scene A, size s, one round, where nothing else is said; neither bars in real time nor sweeps
  --keep            Add to the last run's results: to run scenes and sizes one after the other
  --no-sweeps       Leave out the cost of a sweep
  --no-largest      Leave out the largest bar in real time
  --only-sweeps     Run only the cost of a sweep; the rest is from the last run
  --continuum       Run only bars against the continuum: the coarsest on which each simulator's tip sinks as far
                    as that of the body itself, and what a frame costs there; with --keep what ran before is not
                    run again [document: docs/peers-continuum.md]
  --contact         Run only contact: a ball that is pressed into a block, a block on an incline; of MuJoCo, Rapier and
                    viscera; with --keep what ran before is not run again [document: docs/peers-contact.md]
  --again           Run nothing; write the document from the last run's results
  --out FILE        The document; figures go to the folder of its name beside it [default: docs/peers.md]

On a machine without the network, Rust or the repository, where this program was carried to:
  --folder DIR      Everything that is made lies there [default: target/peers]
  --viscera FILE    The program `viscera`, instead of building it
  --python FILE     A Python with numpy, scipy and the peers that there are, instead of installing one

Otherwise it needs CPython 3.11 on Linux, and the network for the first run (about 1.5 GB). A round at
sizes s and m takes half an hour, the references of motion at size m ten minutes more, once.";

/// What was asked for.
#[derive(Default)]
pub struct Options {
    bench: Option<PathBuf>,
    folder: Option<PathBuf>,
    viscera: Option<PathBuf>,
    python: Option<PathBuf>,
    scenes: Vec<String>,
    sizes: Vec<String>,
    peers: Option<Vec<String>>,
    rounds: u32,
    out: Option<PathBuf>,
    again: bool,
    keep: bool,
    sweeps: bool,
    largest: bool,
    only_sweeps: bool,
    continuum: bool,
    contact: bool,
    /// As one would type it; without folders, which differ from machine to machine.
    command: String,
}

impl Options {
    fn read(arguments: &[&str]) -> Result<Self, String> {
        let (mut scenes, mut sizes, mut rounds) = (None, None, None);
        let (mut quick, mut large) = (false, false);
        let mut options = Self { sweeps: true, largest: true, ..Self::default() };
        let mut command = String::from("cargo xtask peers");
        let mut rest = arguments.iter();
        while let Some(&flag) = rest.next() {
            let mut value = || rest.next().copied().ok_or(format!("{flag} needs a value"));
            let mut path = || value().map(|text| Some(PathBuf::from(text)));
            match flag {
                "--bench" => options.bench = path()?,
                "--out" => options.out = path()?,
                "--folder" => options.folder = path()?,
                "--viscera" => options.viscera = path()?,
                "--python" => options.python = path()?,
                "--again" => options.again = true,
                "--keep" => options.keep = true,
                "--scenes" | "--sizes" | "--rounds" | "--peers" => {
                    let value = value()?;
                    match flag {
                        "--scenes" => {
                            scenes = Some(names(flag, value, |name| ["A", "B"].contains(&name))?)
                        }
                        "--sizes" => sizes = Some(names(flag, value, is_size)?),
                        "--peers" => options.peers = Some(names(flag, value, is_peer)?),
                        _ => rounds = Some(count(flag, value)?),
                    }
                    command += &format!(" {flag} {value}");
                }
                "--only-sweeps" | "--quick" | "--large" | "--no-sweeps" | "--no-largest"
                | "--continuum" | "--contact" => {
                    options.only_sweeps |= flag == "--only-sweeps";
                    options.continuum |= flag == "--continuum";
                    options.contact |= flag == "--contact";
                    quick |= flag == "--quick";
                    large |= flag == "--large";
                    options.sweeps &= !["--no-sweeps", "--quick"].contains(&flag);
                    options.largest &= !["--no-largest", "--quick"].contains(&flag);
                    command += &format!(" {flag}");
                }
                other => return Err(format!("unknown option `{other}`")),
            }
        }
        let texts = |texts: &[&str]| texts.iter().map(|t| (*t).to_owned()).collect::<Vec<_>>();
        let usual: &[&str] = if quick { &["s"] } else { &["s", "m", "liver", "kidney", "bowel"] };
        options.sizes = sizes.unwrap_or(texts(usual));
        if large && !options.sizes.iter().any(|size| size == "l") {
            options.sizes.push("l".into());
        }
        options.bench =
            options.bench.or_else(|| std::env::var_os("VISCERA_BENCH").map(PathBuf::from));
        options.scenes = scenes.unwrap_or(texts(if quick { &["A"] } else { &["A", "B"] }));
        options.rounds = rounds.unwrap_or(if quick { 1 } else { 3 });
        Ok(Self { command, ..options })
    }
}

fn is_size(name: &str) -> bool {
    ["liver", "kidney", "bowel"].contains(&name) || plan::cells(name).is_some_and(|cells| cells > 0)
}

fn is_peer(name: &str) -> bool {
    plan::METHODS.iter().any(|method| method.program.name() == name)
}

fn names(flag: &str, value: &str, is_known: impl Fn(&str) -> bool) -> Result<Vec<String>, String> {
    let names: Vec<String> = value.split(',').map(|name| name.trim().to_owned()).collect();
    match names.iter().find(|name| !is_known(name)) {
        Some(other) => Err(format!("{flag}: there is no `{other}`")),
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
    if options.continuum {
        return continuum::carry_out(options);
    }
    if options.contact {
        return contact::carry_out(options);
    }
    let environment = Environment::find(options)?;
    let out = options.out.clone().unwrap_or_else(|| environment.root.join("docs/peers.md"));
    if !options.again {
        environment.prepare()?;
        runs::run_all(&environment, options)?;
    }
    let figures = figures::write(&environment, &out)?;
    let text = document::write(&environment, &figures)?;
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
        assert!(error(&["--sizes", "s,q"]).contains("there is no `q`"));
        assert!(error(&["--sizes", "n0"]).contains("there is no `n0`"));
        assert!(error(&["--peers", "blender"]).contains("there is no `blender`"));
        assert!(error(&["--scenes"]).contains("needs a value"));
        assert!(error(&["--slow"]).contains("unknown option `--slow`"));
    }

    #[test]
    fn quick_gives_way_to_what_is_said() {
        let options = Options::read(&["--quick", "--sizes", "s,m", "--large", "--bench", "x"]);
        let options = options.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(options.sizes, ["s", "m", "l"]);
        assert!(!options.sweeps && !options.largest && !options.keep);
        assert_eq!((options.scenes, options.rounds), (vec!["A".to_owned()], 1));
        assert_eq!(options.command, "cargo xtask peers --quick --sizes s,m --large");
    }
}
