//! What is run: rounds of the benchmark, and the cost of a sweep.

use super::environment::Environment;
use super::{Options, finish, write_whole};
use serde_json::{Value, json};
use std::io::Write;
use std::process::Stdio;

/// One of our configurations, which runs in every round beside the peers.
pub struct Ours {
    /// Its name in tables; the first is what peers are compared with.
    pub label: &'static str,
    /// What `viscera bench-scene --cfg` is given.
    pub settings: &'static str,
    /// In words.
    pub words: &'static str,
}

/// Another configuration is another line here.
pub const OURS: [Ours; 5] = [
    Ours {
        label: "viscera",
        settings: "material=stvk,method=xpbd",
        words: "XPBD: 10 substeps x 2 iterations, coloured, rebase and guards; Green strain",
    },
    Ours {
        label: "viscera, neo-Hookean",
        settings: "material=snh,method=xpbd",
        words: "the same in the stretch form of stable neo-Hookean tissue",
    },
    Ours {
        label: "viscera, automatic",
        settings: "material=snh",
        words: "the default method, quasi-Newton; stable neo-Hookean tissue",
    },
    Ours {
        label: "viscera, 20 x 5",
        settings: "material=stvk,method=xpbd,substeps=20,iterations=5",
        words: "20 substeps x 5 iterations; Green strain",
    },
    Ours {
        label: "viscera, explicit",
        settings: "material=stvk,method=explicit,substeps=1",
        words: "explicit small steps at half of the stable step; Green strain",
    },
];

/// A tetrahedral solver whose cost of one sweep is measured.
pub struct Sweeper {
    /// Its name in tables.
    pub label: &'static str,
    /// What it sweeps over.
    pub words: &'static str,
    /// File and class of a peer; none for ours.
    peer: Option<[&'static str; 2]>,
    /// Besides substeps and iterations.
    settings: &'static [(&'static str, &'static str)],
}

/// XPBD as published: no rebase, no kept multipliers, no guard.
const PLAIN: [(&str, &str); 3] =
    [("rebase", "false"), ("keep_multipliers", "false"), ("step_guard", "false")];

/// The first is what the others are compared with.
pub const SWEEPERS: [Sweeper; 7] = [
    Sweeper {
        label: "PyPBD_XPBD",
        words: "XPBD, one energy constraint per tetrahedron, coloured Gauss-Seidel",
        peer: Some(["pypbd_peer.py", "PyPBD_XPBD"]),
        settings: &[],
    },
    Sweeper {
        label: "NewtonXPBD",
        words: "XPBD, two constraints per tetrahedron, Jacobi",
        peer: Some(["newton_peer.py", "NewtonXPBD"]),
        settings: &[],
    },
    Sweeper {
        label: "PbatXPBD",
        words: "XPBD, block of two neo-Hookean constraints, coloured Gauss-Seidel",
        peer: Some(["pbat_peer.py", "PbatXPBD"]),
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

/// Sweeps per frame between the two runs.
pub const SWEEPS_BETWEEN: u32 = SWEEP_SUBSTEPS * (SWEEP_ITERATIONS[1] - SWEEP_ITERATIONS[0]);

/// Frames of a run that only tells a cost.
const COST_FRAMES: &str = "20";

/// CPU time [s] that a Python peer may take for one run. Less cuts the slow ones short on a loaded
/// machine; the slowest take a minute at size m.
const LONGEST: &str = "600";

/// References and rounds, then sweeps, all into files of result lines.
pub fn run_all(environment: &Environment, options: &Options) -> Result<(), String> {
    let results = environment.results();
    if options.only_sweeps {
        return sweeps(environment, options);
    }
    for name in ["settled", "motion"] {
        write_whole(&results.join(format!("{name}.jsonl")), "")?;
    }
    let about = json!({ "command": options.command, "cpu": cpu_model(), "rounds": options.rounds });
    write_whole(&results.join("about.json"), &about.to_string())?;

    let small: Vec<&String> = options.sizes.iter().filter(|size| *size != "l").collect();
    if !small.is_empty() {
        let mut command = environment.python();
        command.args(["scenes.py", "--materials", "stvk", "snh", "--scenes"]).args(&options.scenes);
        finish("solve for the states of rest", command.arg("--sizes").args(&small), BROKEN)?;
    }
    for size in &options.sizes {
        rounds(environment, options, size, "settled")?;
        // The reference motion of size l would take hours.
        if size != "l" {
            rounds(environment, options, size, "motion")?;
        }
    }
    sweeps(environment, options)
}

const BROKEN: &str = "look at the lines above; target/peers can be deleted and made again";

/// Rounds of everything at one size.
fn rounds(
    environment: &Environment,
    options: &Options,
    size: &str,
    kind: &str,
) -> Result<(), String> {
    // The benchmark's dearer defaults are no longer affordable on fine meshes.
    let plan = if ["xs", "s"].contains(&size) { "default" } else { "medium" };
    let program = environment.program.display();
    let command_of =
        |ours: &Ours| format!("{}='{program}' bench-scene --cfg {}", ours.label, ours.settings);
    let ours: Vec<String> = OURS.iter().map(command_of).collect();
    let rounds = options.rounds.to_string();
    let mut command = environment.python();
    command.env("SOFTBENCH_EXTERNAL", ours.join(";"));
    command.args(["run_bench.py", "--plan", plan, "--sizes", size, "--rounds", &rounds]);
    command.args(["--max-seconds", LONGEST, "--scenes"]).args(&options.scenes);
    command.arg("--out").arg(environment.results().join(format!("{kind}.jsonl")));
    if kind == "motion" {
        command.arg("--transient");
    } else if size == "l" {
        command.args(["--timing-only", "--frames", COST_FRAMES]);
    }
    finish(&format!("{kind}, size {size}, rounds: {rounds}"), &mut command, BROKEN)
}

/// The cost of a sweep at every size above s, or at s where it is alone.
fn sweeps(environment: &Environment, options: &Options) -> Result<(), String> {
    let fine = |size: &&String| !["xs", "s"].contains(&size.as_str());
    let mut sizes: Vec<&String> = options.sizes.iter().filter(fine).collect();
    if sizes.is_empty() {
        sizes.extend(options.sizes.last());
    }
    let path = environment.results().join("sweeps.jsonl");
    write_whole(&path, "")?;
    let mut file = std::fs::File::options().append(true).open(&path);
    println!("\n== cost of a sweep, rounds: {}", options.rounds);
    for round in 0..options.rounds {
        for size in &sizes {
            for (sweeper, iterations) in
                SWEEPERS.iter().flat_map(|s| SWEEP_ITERATIONS.map(|i| (s, i)))
            {
                let mut row = sweep(environment, sweeper, size, iterations)?;
                let cost = super::results::cost(&row).unwrap_or(f64::NAN);
                let label = sweeper.label;
                println!("{size} {label:20} iterations {iterations}: {cost:8.1} ms per frame");
                row["round"] = json!(round);
                row["iterations"] = json!(iterations);
                row["sweeper"] = json!(sweeper.label);
                row["command"] = json!(options.command);
                let written = match &mut file {
                    Ok(file) => writeln!(file, "{row}"),
                    Err(error) => Err(std::io::Error::from(error.kind())),
                };
                written.map_err(|error| format!("{}: {error}", path.display()))?;
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
    for (key, value) in sweeper.settings {
        settings[*key] = json!(value);
    }
    let mut command = environment.pinned_python();
    match sweeper.peer {
        Some([file, class]) => command.arg(format!("peers/{file}")).args(["--peer", class]),
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

fn cpu_model() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split_once(':')).map(|(_, name)| name.trim().to_owned());
    name.unwrap_or_else(|| "unknown".into())
}
