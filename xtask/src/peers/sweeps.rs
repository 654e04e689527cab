//! The cost of a sweep over the constraints: a slope over iterations.

use super::environment::Environment;
use super::runs::{LONGEST, append};
use super::{Options, write_whole};
use serde_json::{Value, json};
use std::process::Stdio;

/// A tetrahedral solver whose cost of one sweep is measured.
pub struct Sweeper {
    /// Its name in tables.
    pub label: &'static str,
    /// What it sweeps over.
    pub words: &'static str,
    /// Module, file and class of a peer; none for ours.
    peer: Option<[&'static str; 3]>,
    /// Besides substeps and iterations.
    settings: &'static [(&'static str, &'static str)],
}

/// XPBD as published: no rebase, no kept multipliers, no guard.
const PLAIN: [(&str, &str); 3] =
    [("rebase", "false"), ("keep_multipliers", "false"), ("step_guard", "false")];

/// The first that ran is what the others are compared with.
pub const SWEEPERS: [Sweeper; 7] = [
    Sweeper {
        label: "PyPBD_XPBD",
        words: "XPBD, one energy constraint per tetrahedron, coloured Gauss-Seidel",
        peer: Some(["pypbd", "pypbd_peer.py", "PyPBD_XPBD"]),
        settings: &[],
    },
    Sweeper {
        label: "NewtonXPBD",
        words: "XPBD, two constraints per tetrahedron, Jacobi",
        peer: Some(["newton", "newton_peer.py", "NewtonXPBD"]),
        settings: &[],
    },
    Sweeper {
        label: "PbatXPBD",
        words: "XPBD, block of two neo-Hookean constraints, coloured Gauss-Seidel",
        peer: Some(["pbatoolkit", "pbat_peer.py", "PbatXPBD"]),
        settings: &[],
    },
    Sweeper {
        label: "viscera, plain",
        words: "XPBD, block of six Green strains, coloured; no rebase, no guards",
        peer: None,
        settings: &[PLAIN[0], PLAIN[1], PLAIN[2]],
    },
    Sweeper {
        label: "viscera, plain, f64",
        words: "the same in double precision",
        peer: None,
        settings: &[PLAIN[0], PLAIN[1], PLAIN[2], ("precision", "f64")],
    },
    Sweeper {
        label: "viscera, plain pair",
        words: "XPBD, published pair of neo-Hookean constraints, coloured; no rebase, no guards",
        peer: None,
        settings: &[PLAIN[0], PLAIN[1], PLAIN[2], ("material", "snh")],
    },
    Sweeper {
        label: "viscera",
        words: "defaults: block of six Green strains with rebase and guards",
        peer: None,
        settings: &[],
    },
];

/// The gentle scene. In A, under as few sweeps, a sweep of PyPBD took up to four times as long as in
/// B: its cost depends on how the body is thrown about.
const SWEEP_SCENE: &str = "B";

/// Substeps per frame while sweeps are counted: few sweeps of one long step throw a body about.
const SWEEP_SUBSTEPS: u32 = 10;

/// Iterations per substep of the two runs whose difference is the cost of sweeps.
const SWEEP_ITERATIONS: [u32; 2] = [2, 8];

/// Frames of a run.
const COST_FRAMES: &str = "20";

/// Sweeps per frame between the two runs.
pub const SWEEPS_BETWEEN: u32 = SWEEP_SUBSTEPS * (SWEEP_ITERATIONS[1] - SWEEP_ITERATIONS[0]);

/// At every size above s, or at s where it is alone; of the solvers that are there.
pub fn run(environment: &Environment, options: &Options) -> Result<(), String> {
    let fine = |size: &&String| ["m", "l"].contains(&size.as_str());
    let mut sizes: Vec<&String> = options.sizes.iter().filter(fine).collect();
    if sizes.is_empty() {
        sizes.extend(options.sizes.last());
    }
    let path = environment.results().join("sweeps.jsonl");
    write_whole(&path, "")?;
    let missing = environment.missing(options)?;
    let is_there = |sweeper: &&Sweeper| {
        sweeper.peer.is_none_or(|[module, ..]| !missing.iter().any(|name| name == module))
    };
    println!("\n== cost of a sweep, rounds: {}", options.rounds);
    for round in 0..options.rounds {
        for size in &sizes {
            let runs = SWEEPERS.iter().filter(is_there);
            for (sweeper, iterations) in runs.flat_map(|s| SWEEP_ITERATIONS.map(|i| (s, i))) {
                let mut row = sweep(environment, sweeper, size, iterations)?;
                let cost = super::results::cost(&row).unwrap_or(f64::NAN);
                let label = sweeper.label;
                println!("{size} {label:20} iterations {iterations}: {cost:8.1} ms per frame");
                row["round"] = json!(round);
                row["iterations"] = json!(iterations);
                row["sweeper"] = json!(sweeper.label);
                row["command"] = json!(options.command);
                append(&path, &row)?;
            }
        }
    }
    Ok(())
}

/// One run of one solver; its result line.
fn sweep(
    environment: &Environment,
    sweeper: &Sweeper,
    size: &str,
    iterations: u32,
) -> Result<Value, String> {
    let mut settings = json!({ "substeps": SWEEP_SUBSTEPS, "iterations": iterations });
    if sweeper.peer.is_none() {
        settings["method"] = json!("xpbd");
    }
    for (key, value) in sweeper.settings {
        settings[*key] = json!(value);
    }
    let mut command = environment.pinned_python();
    match sweeper.peer {
        Some([_, file, class]) => command.arg(format!("peers/{file}")).args(["--peer", class]),
        None => command
            .args(["peers/external_peer.py", "--peer", sweeper.label, "--program"])
            .arg(format!("'{}' bench-scene", environment.program.display())),
    };
    command.args([
        "--scene",
        SWEEP_SCENE,
        "--size",
        size,
        "--timing-only",
        "--frames",
        COST_FRAMES,
    ]);
    command.args(["--max-seconds", LONGEST, "--cfg", &settings.to_string()]);
    let output = command.stderr(Stdio::piped()).output();
    let output = output.map_err(|error| format!("Python could not be started: {error}"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().find_map(|line| line.strip_prefix("RESULT "));
    let row = line.and_then(super::results::read_line);
    row.map_or_else(
        || {
            let errors = String::from_utf8_lossy(&output.stderr);
            let last = errors.lines().last().unwrap_or("nothing was said").to_owned();
            Err(format!("{} at size {size}: {last}", sweeper.label))
        },
        Ok,
    )
}
