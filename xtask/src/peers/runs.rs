//! What is run: rounds of every method, each run a process of its own.

use super::environment::Environment;
use super::plan::{self, Method, Point, Program};
use super::results::{cost, number, read_line};
use super::{Options, continuum, finish, largest, sweeps, write_whole};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;

/// CPU time [s] that a Python peer may take for one run. Less cuts the slow ones short on a loaded
/// machine; the slowest take a minute at size m.
pub const LONGEST: &str = "600";

/// What a run is for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Damped, to the state of rest; this one tells the cost.
    Settled,
    /// From rest, undamped.
    Motion,
    /// As the first, for the cost alone: its state of rest need not be known.
    Cost,
    /// As the first, of nearly incompressible tissue: how far the tip sinks is judged elsewhere.
    Sunk,
}

/// One run of one method.
pub struct Run<'a> {
    /// What is run.
    pub method: &'a Method,
    /// Over its defaults.
    pub settings: Value,
    /// A or B.
    pub scene: &'a str,
    /// Of the mesh.
    pub size: &'a str,
    /// What for.
    pub kind: Kind,
}

impl Run<'_> {
    /// The result line, whatever becomes of the run: what fails says so in it.
    pub fn result(&self, environment: &Environment) -> Result<Value, String> {
        let mut command = environment.pinned_python();
        command.arg(environment.runner());
        if self.kind == Kind::Sunk {
            command.arg("unjudged");
        }
        match self.method.program {
            Program::Module { file, class, .. } => {
                command.arg(format!("peers/{file}")).args(["--peer", class]);
            }
            Program::Rapier => {
                command.args(["peers/external_peer.py", "--peer", "Rapier", "--material", "snh"]);
                command.arg("--program").arg(environment.rapier());
            }
            Program::Ours => {
                command.args(["peers/external_peer.py", "--peer", "viscera", "--program"]);
                command.arg(format!("'{}' bench-scene", environment.program.display()));
            }
        }
        let longest = match self.kind {
            Kind::Sunk => continuum::LONGEST.to_string(),
            _ => LONGEST.to_owned(),
        };
        command.args(["--scene", self.scene, "--size", self.size, "--max-seconds", &longest]);
        command.args(["--cfg", &self.settings.to_string()]);
        match self.kind {
            Kind::Settled => {}
            Kind::Motion => {
                command.arg("--transient");
            }
            Kind::Cost => {
                command.arg("--timing-only");
            }
            Kind::Sunk => {
                command.args(["--nu", continuum::POISSON]);
            }
        }
        let output = command.stderr(Stdio::piped()).output();
        let output = output.map_err(|error| format!("Python could not be started: {error}"))?;
        let text = String::from_utf8_lossy(&output.stdout);
        let line = text.lines().find_map(|line| line.strip_prefix("RESULT "));
        let mut row = line.and_then(read_line).unwrap_or_else(|| {
            let errors = String::from_utf8_lossy(&output.stderr);
            let last = errors.lines().last().unwrap_or("nothing was said").to_owned();
            json!({ "status": format!("failed: {last}") })
        });
        row["peer"] = json!(self.method.label);
        row["cfg_asked"] = self.settings.clone();
        row["scene"] = json!(self.scene);
        row["size"] = json!(self.size);
        Ok(row)
    }
}

/// References and rounds, then bars in real time and sweeps, all into files of result lines.
pub fn run_all(environment: &Environment, options: &Options) -> Result<(), String> {
    let results = environment.results();
    if options.only_sweeps {
        return sweeps::run(environment, options);
    }
    let files = ["settled", "motion", "largest"].map(|name| results.join(format!("{name}.jsonl")));
    if !options.keep {
        files.iter().try_for_each(|file| write_whole(file, ""))?;
    }
    let about = results.join("about.json");
    let before = if options.keep { super::results::read(&about)?.into_iter().next() } else { None };
    let before = before.as_ref().and_then(|about| about["command"].as_str());
    let command = and_then(before, &options.command);
    let words = json!({ "command": command, "cpu": cpu_model(), "rounds": options.rounds,
                        "missing": environment.missing(options)? });
    write_whole(&about, &words.to_string())?;
    for (scene, size) in places(options) {
        references(environment, scene, &[size.to_owned()])?;
        rounds(environment, options, scene, size, &files)?;
    }
    if options.largest {
        largest::run(environment, options, &files[2])?;
    }
    if options.sweeps { sweeps::run(environment, options) } else { Ok(()) }
}

/// Scenes and sizes, in the order of the report; organs hang, and nothing pulls them.
fn places(options: &Options) -> Vec<(&str, &str)> {
    let mut places = Vec::new();
    for size in &options.sizes {
        let scenes = options.scenes.iter().map(String::as_str);
        let fits = |scene: &&str| *scene == "A" || plan::cells(size).is_some();
        places.extend(scenes.filter(fits).map(|scene| (scene, size.as_str())));
    }
    places
}

/// States of rest and motions that errors are measured to; those that are known are kept.
pub fn references(environment: &Environment, scene: &str, sizes: &[String]) -> Result<(), String> {
    const BROKEN: &str = "look at the lines above; target/peers can be deleted and made again";
    let mut command = environment.python();
    command.arg(environment.runner()).args(["references", scene]).args(sizes);
    finish(&format!("references of scene {scene}, size {}", sizes.join(", ")), &mut command, BROKEN)
}

/// Rounds of everything at one place; every other round in reverse order.
fn rounds(
    environment: &Environment,
    options: &Options,
    scene: &str,
    size: &str,
    files: &[std::path::PathBuf],
) -> Result<(), String> {
    println!("\n== scene {scene}, size {size}, rounds: {}", options.rounds);
    let methods = environment.installed(options)?;
    let mut fewest = BTreeMap::new();
    let mut jobs: Vec<(&Method, &Point)> = Vec::new();
    for method in methods {
        let points = method.points.iter().filter(|point| plan::is_affordable(point, size));
        let mut points = points.peekable();
        if points.peek().is_some_and(|point| point.settings.contains("fewest")) {
            fewest
                .insert(method.label, largest::fewest_substeps(environment, method, scene, size)?);
        }
        jobs.extend(points.map(|point| (method, point)));
    }
    for round in 0..options.rounds {
        let mut order: Vec<_> = jobs.iter().filter(|(_, p)| p.is_main || round == 0).collect();
        if round % 2 == 1 {
            order.reverse();
        }
        for (method, point) in order {
            let stable = fewest.get(method.label).copied().unwrap_or(1);
            let settings = plan::settings(point.settings, stable);
            for (kind, file) in [(Kind::Settled, &files[0]), (Kind::Motion, &files[1])] {
                let run = Run { method, settings: settings.clone(), scene, size, kind };
                let mut row = run.result(environment)?;
                row["round"] = json!(round);
                row["is_main"] = json!(point.is_main);
                println!("{}", told(&row));
                append(file, &row)?;
            }
        }
    }
    Ok(())
}

/// A line of progress.
pub fn told(row: &Value) -> String {
    let shown = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".into(), |value| format!("{value:.digits$}"))
    };
    let percent = |key: &str| shown(number(row, key).map(|share| 100.0 * share), 3);
    format!(
        "{} {:5} {:32} {:60} {:8} ms  rest {:>8} %  motion {:>8} %  {}",
        row["scene"].as_str().unwrap_or("?"),
        row["size"].as_str().unwrap_or("?"),
        row["peer"].as_str().unwrap_or("?"),
        row["cfg_asked"].to_string().replace('"', ""),
        shown(cost(row), 3),
        percent("err_own_rms"),
        percent("dyn_own"),
        row["status"].as_str().unwrap_or("?"),
    )
}

/// Adds a line to a file of result lines.
pub fn append(path: &Path, row: &Value) -> Result<(), String> {
    let file = std::fs::File::options().append(true).create(true).open(path);
    let written = file.and_then(|mut file| writeln!(file, "{row}"));
    written.map_err(|error| format!("{}: {error}", path.display()))
}

/// The processor's name.
pub fn cpu_model() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let value = |key: &str| {
        let line = text.lines().find(|line| line.starts_with(key))?;
        line.split_once(':').map(|(_, value)| value.trim().to_owned())
    };
    let name = value("model name").unwrap_or_else(|| "unknown".into());
    // Virtual machines hide the name of the kind; family and model tell it.
    match (value("cpu family"), value("model\t")) {
        (Some(family), Some(model)) => format!("{name} (family {family}, model {model})"),
        _ => name,
    }
}

/// The commands of a document that several wrote, each once, the last at the end.
fn and_then(before: Option<&str>, command: &str) -> String {
    const AND: &str = "`, `";
    let earlier = before.into_iter().flat_map(|before| before.split(AND));
    let all: Vec<&str> = earlier.filter(|earlier| *earlier != command).chain([command]).collect();
    all.join(AND)
}

#[cfg(test)]
mod tests {
    use super::and_then;

    /// A command that is given again is named once.
    #[test]
    fn commands_are_named_once() {
        let first = and_then(None, "a --keep");
        let both = and_then(Some(&first), "b");
        assert_eq!(both, "a --keep`, `b");
        assert_eq!(and_then(Some(&both), "a --keep"), "b`, `a --keep");
    }
}
