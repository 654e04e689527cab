//! Contact: a ball that is pressed into a block, and a block on an incline. `cargo xtask peers --contact`.
//!
//! Meshes and truths are of `viscera-lab contact-scenes`; every simulator is judged by the reference of its own law with
//! a nearly rigid contact, and on the incline by Coulomb's law.

use super::environment::Environment;
use super::results::{self, number};
use super::runs::{self, append};
use super::{Options, contact_document, write_whole};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Depths of the ball [mm].
pub const DEPTHS: [f64; 3] = [2.0, 4.0, 8.0];

/// At which all settings run.
pub const SWEPT: f64 = 4.0;

/// Of the incline [degrees]: those at which the block holds, and is watched for ten seconds, and those at which it slides.
pub const HOLDS: [f64; 2] = [20.0, 26.3];
pub const SLIDES: [f64; 3] = [26.9, 30.0, 40.0];

/// Frames after the block is let go.
const WATCHED: u32 = 600;
const SLIDING: u32 = 36;

/// Coefficient of friction, and gravity [m/s^2].
const FRICTION: f64 = 0.5;
const GRAVITY: f64 = 9.81;

/// What runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simulator {
    /// `viscera-lab contact-run`.
    Ours,
    /// `contact_peer.py`.
    Mujoco,
    /// `rapier_contact/main.rs`.
    Rapier,
}

impl Simulator {
    /// All, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Ours, Self::Mujoco, Self::Rapier];

    /// In tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ours => "viscera",
            Self::Mujoco => "MuJoCo",
            Self::Rapier => "Rapier",
        }
    }

    /// The truths' name of its law.
    pub fn law(self) -> &'static str {
        match self {
            Self::Mujoco => "stvk",
            _ => "snh",
        }
    }

    /// Settings that are tried; the first is what one gets without a thought.
    pub fn settings(self, presses: bool) -> &'static [&'static str] {
        match (self, presses) {
            (Self::Ours, true) => &[
                "method=quasi_newton",
                "method=quasi_newton,schedule=1x8",
                "method=quasi_newton,schedule=1x8,stiffness=1000,thickness=5e-5",
                "method=quasi_newton,stiffness=100,thickness=2e-4",
                "method=xpbd",
                "method=xpbd,stiffness=100,thickness=2e-4",
                "method=explicit",
                "method=explicit,stiffness=100,thickness=2e-4",
            ],
            (Self::Ours, false) => &[
                "method=quasi_newton",
                "method=xpbd",
                "method=xpbd,schedule=4x10,stiffness=2",
                "method=explicit",
            ],
            (Self::Mujoco, true) => &[
                r#""substeps":1"#,
                r#""substeps":1,"solref":[0.0334,1],"solimp":[0.99,0.999,0.001,0.5,2]"#,
                r#""substeps":4"#,
                r#""substeps":4,"solref":[0.0084,1]"#,
                r#""substeps":4,"solimp":[0.99,0.999,0.001,0.5,2]"#,
                r#""substeps":4,"solref":[0.0084,1],"solimp":[0.99,0.999,0.001,0.5,2]"#,
                r#""substeps":4,"solref":[0.0084,1],"solimp":[0.999,0.9999,0.001,0.5,2]"#,
                r#""substeps":4,"solref":[-1e6,-2e3]"#,
                r#""substeps":4,"solref":[0.0084,1],"solimp":[0.99,0.999,0.001,0.5,2],"flex_radius":0.001"#,
                r#""substeps":8,"solref":[0.0042,1],"solimp":[0.99,0.999,0.001,0.5,2]"#,
            ],
            (Self::Mujoco, false) => &[
                r#""substeps":1"#,
                r#""substeps":4,"solref":[0.0084,1],"solimp":[0.99,0.999,0.001,0.5,2]"#,
                r#""substeps":4,"cone":"elliptic""#,
                r#""substeps":4,"cone":"elliptic","impratio":100"#,
                r#""substeps":4,"cone":"elliptic","impratio":10,"solref":[0.0084,1],"solimp":[0.99,0.999,0.001,0.5,2]"#,
                r#""substeps":4,"cone":"elliptic","impratio":100,"solref":[0.0084,1],"solimp":[0.99,0.999,0.001,0.5,2]"#,
                r#""substeps":4,"cone":"elliptic","impratio":1000,"solref":[0.0084,1],"solimp":[0.99,0.999,0.001,0.5,2]"#,
                r#""substeps":1,"cone":"elliptic","impratio":100,"solref":[0.0334,1],"solimp":[0.99,0.999,0.001,0.5,2]"#,
            ],
            (Self::Rapier, true) => {
                &["iterations=4", "iterations=8", "iterations=8,skin=1e-3", "iterations=4,steps=4"]
            }
            (Self::Rapier, false) => &["iterations=4", "iterations=8", "iterations=4,steps=4"],
        }
    }
}

/// Acceleration [m/s^2] of a block that slides as Coulomb's law says; below zero where it holds.
pub fn coulomb(degrees: f64) -> f64 {
    let angle = degrees.to_radians();
    GRAVITY * (angle.sin() - FRICTION * angle.cos())
}

/// One run.
struct Job {
    simulator: Simulator,
    settings: &'static str,
    /// Of the block; of the incline there is one.
    size: &'static str,
    /// Whether the ball presses.
    presses: bool,
    /// Depth [mm] or angle [degrees].
    amount: f64,
}

impl Job {
    fn is(&self, row: &Value) -> bool {
        row["simulator"] == self.simulator.name()
            && row["settings"] == self.settings
            && row["size"] == self.size
            && row["presses"] == self.presses
            && row["amount"] == self.amount
    }

    fn frames(&self) -> u32 {
        if HOLDS.contains(&self.amount) { WATCHED } else { SLIDING }
    }

    /// The result line without what it was asked.
    fn run(&self, tools: &Tools<'_>) -> Result<Value, String> {
        let Self { settings, size, amount, .. } = self;
        let verb = if self.presses { "press" } else { "slide" };
        let place = |quote: &str, mark: &str| match self.presses {
            true => format!("{quote}depth{quote}{mark}{amount}"),
            false => format!(
                "{quote}angle{quote}{mark}{amount},{quote}frames{quote}{mark}{}",
                self.frames()
            ),
        };
        let mesh = |text: String| if self.presses { text } else { String::new() };
        match self.simulator {
            Simulator::Ours => {
                let size = mesh(format!("size={size},"));
                let request = format!("{verb},{size}{},{settings}", place("", "="));
                told(Command::new(&tools.lab).args(["contact-run", &request]), "")
            }
            Simulator::Mujoco => {
                let size = mesh(format!("\"size\":\"{size}\","));
                let asked = format!("{{{size}{},{settings}}}", place("\"", ":"));
                told(
                    tools.environment.pinned_python().arg(&tools.script).args([verb, &asked]),
                    "RESULT ",
                )
            }
            Simulator::Rapier => {
                self.run_rapier(tools, verb, &mesh(format!("size={size},")), &place("", "="))
            }
        }
    }

    /// What the deformed block itself leads to its base is found from its places.
    fn run_rapier(
        &self,
        tools: &Tools<'_>,
        verb: &str,
        size: &str,
        place: &str,
    ) -> Result<Value, String> {
        let file = tools.environment.results().join("contact-positions.txt");
        let positions =
            if self.presses { format!(",positions={}", file.display()) } else { String::new() };
        let asked = format!("{size}{place},{}{positions}", self.settings);
        let mut rapier = Command::new(&tools.rapier);
        rapier.args([verb, &asked]).env("SOFTBENCH_CACHE", tools.environment.cache());
        let mut row = told(&mut rapier, "")?;
        if self.presses {
            let about =
                json!({ "size": self.size, "law": self.simulator.law(), "positions": file });
            let mut base = tools.environment.pinned_python();
            base.arg(&tools.script).args(["base", &about.to_string()]);
            row["base_force"] = told(&mut base, "RESULT ")?["base_force"].clone();
        }
        Ok(row)
    }
}

/// The line of JSON that a program prints after a mark.
fn told(command: &mut Command, mark: &str) -> Result<Value, String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().find_map(|line| results::read_line(line.strip_prefix(mark)?));
    match line {
        Some(row) if output.status.success() => Ok(row),
        _ => Ok(json!({ "status": last_words(&output.stderr) })),
    }
}

fn last_words(stderr: &[u8]) -> String {
    let text = String::from_utf8_lossy(stderr);
    text.lines().last().unwrap_or("it said nothing").to_owned()
}

/// Programs that run.
struct Tools<'a> {
    environment: &'a Environment,
    lab: PathBuf,
    rapier: PathBuf,
    script: PathBuf,
}

/// Runs what is not known yet.
fn run_all(tools: &Tools<'_>, simulators: &[Simulator], file: &Path) -> Result<(), String> {
    let mut rows = results::read(file)?;
    let mut run = |job: Job| -> Result<(), String> {
        if rows.iter().any(|row| job.is(row)) {
            return Ok(());
        }
        let mut row = job.run(tools)?;
        row["simulator"] = json!(job.simulator.name());
        row["settings"] = json!(job.settings);
        row["size"] = json!(job.size);
        row["presses"] = json!(job.presses);
        row["amount"] = json!(job.amount);
        println!("{row}");
        append(file, &row)?;
        rows.push(row);
        Ok(())
    };
    for &simulator in simulators {
        for &settings in simulator.settings(false) {
            for amount in SLIDES.into_iter().chain(HOLDS) {
                run(Job { simulator, settings, size: "s", presses: false, amount })?;
            }
        }
        for &settings in simulator.settings(true) {
            run(Job { simulator, settings, size: "s", presses: true, amount: SWEPT })?;
        }
    }
    let truths = read_truths(tools.environment)?;
    for (size, amounts) in [("s", &DEPTHS[..]), ("m", &[SWEPT][..])] {
        for &simulator in simulators {
            for settings in chosen(simulator, &results::read(file)?, &truths) {
                for &amount in amounts {
                    run(Job { simulator, settings, size, presses: true, amount })?;
                }
            }
        }
    }
    Ok(())
}

/// Settings that run at every depth and size: ours all, of a peer the first and the one with the least error of force.
fn chosen(simulator: Simulator, rows: &[Value], truths: &[Value]) -> Vec<&'static str> {
    let all = simulator.settings(true);
    if simulator == Simulator::Ours {
        return all.to_vec();
    }
    let error = |settings: &&&'static str| {
        let job = Job { simulator, settings, size: "s", presses: true, amount: SWEPT };
        let row = rows.iter().find(|row| job.is(row));
        row.and_then(|row| force_error(row, truths)).map_or(f64::INFINITY, f64::abs)
    };
    let best = all.iter().min_by(|a, b| error(a).total_cmp(&error(b)));
    let mut chosen = vec![all[0]];
    chosen.extend(best.filter(|best| **best != all[0]));
    chosen
}

/// Forces of the truths of a row's law at its size and depth [N]: `rigid`, `more_samples`, `four` or `usual`.
pub fn truth(row: &Value, truths: &[Value], key: &str) -> Option<f64> {
    let simulator = Simulator::ALL.into_iter().find(|one| row["simulator"] == one.name())?;
    let fits = |truth: &&Value| {
        truth["size"] == row["size"]
            && truth["law"] == simulator.law()
            && truth["depth_mm"].as_f64() == row["amount"].as_f64()
    };
    number(truths.iter().find(fits)?, key)
}

/// Of the force on the ball, over the truth.
pub fn force_error(row: &Value, truths: &[Value]) -> Option<f64> {
    Some(force(row)? / truth(row, truths, "rigid")? - 1.0)
}

/// On the ball, mean of the last frames [N].
pub fn force(row: &Value) -> Option<f64> {
    let forces: Vec<f64> = row["forces"].as_array()?.iter().filter_map(Value::as_f64).collect();
    (!forces.is_empty()).then(|| forces.iter().sum::<f64>() / forces.len() as f64)
}

fn read_truths(environment: &Environment) -> Result<Vec<Value>, String> {
    let file = environment.cache().join("truths.json");
    let text = std::fs::read_to_string(&file)
        .map_err(|error| format!("{}: {error}; run without --again first", file.display()))?;
    serde_json::from_str(&text).map_err(|error| format!("{}: {error}", file.display()))
}

/// Runs, then the document.
pub fn carry_out(options: &Options) -> Result<PathBuf, String> {
    let environment = Environment::find(options)?;
    let results = environment.results();
    let file = results.join("contact.jsonl");
    let out = options.out.clone();
    let out = out.unwrap_or_else(|| environment.root.join("docs/peers-contact.md"));
    if !options.again {
        environment.prepare()?;
        let [script, rapier] = environment.prepare_contact()?;
        let tools = Tools { lab: environment.lab(), rapier, script, environment: &environment };
        let missing = environment.missing(options)?;
        let is_asked = |one: &Simulator| {
            let peers = options.peers.as_deref().unwrap_or_default();
            peers.is_empty() || peers.iter().any(|name| one.name().eq_ignore_ascii_case(name))
        };
        let is_there = |one: &Simulator| match one {
            Simulator::Ours => true,
            Simulator::Mujoco => missing.iter().all(|name| name != "mujoco"),
            Simulator::Rapier => is_asked(one) && tools.rapier.is_file(),
        };
        let (simulators, missing): (Vec<Simulator>, Vec<Simulator>) =
            Simulator::ALL.into_iter().partition(is_there);
        let missing: Vec<&str> = missing.into_iter().map(Simulator::name).collect();
        if !options.keep {
            write_whole(&file, "")?;
        }
        let about =
            json!({ "command": options.command, "cpu": runs::cpu_model(), "missing": missing });
        write_whole(&results.join("contact-about.json"), &about.to_string())?;
        run_all(&tools, &simulators, &file)?;
    }
    let about = results::read(&results.join("contact-about.json"))?;
    let about = about.first().ok_or("contact-about.json is empty")?;
    let truths = read_truths(&environment)?;
    let text = contact_document::write(&environment, about, &truths, &results::read(&file)?, &out)?;
    write_whole(&out, &text)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where friction holds everything, where it holds nothing, and at its angle.
    #[test]
    fn a_block_slides_as_coulomb_says() {
        assert!((coulomb(0.0) + 0.5 * 9.81).abs() < 1e-12);
        assert!((coulomb(90.0) - 9.81).abs() < 1e-12);
        assert!(coulomb(0.5_f64.atan().to_degrees()).abs() < 1e-12);
        assert!(HOLDS.iter().all(|angle| coulomb(*angle) < 0.0));
        assert!(SLIDES.iter().all(|angle| coulomb(*angle) > 0.0));
    }

    #[test]
    fn a_peer_is_chosen_by_its_error_of_its_own_law() {
        let truths = [
            json!({ "size": "s", "law": "snh", "depth_mm": 4, "rigid": 2.0 }),
            json!({ "size": "s", "law": "stvk", "depth_mm": 4, "rigid": 1.0 }),
        ];
        let row = |settings: &str, force: f64| {
            json!({ "simulator": "MuJoCo", "settings": settings, "size": "s", "presses": true, "amount": 4.0,
                    "forces": [force, force + 0.2] })
        };
        let all = Simulator::Mujoco.settings(true);
        let rows = [row(all[0], 1.9), row(all[3], 0.8), row(all[5], 1.1)];
        assert!((force_error(&rows[1], &truths).unwrap_or(f64::NAN) + 0.1).abs() < 1e-12);
        assert_eq!(chosen(Simulator::Mujoco, &rows, &truths), [all[0], all[3]]);
        assert_eq!(chosen(Simulator::Ours, &rows, &truths), Simulator::Ours.settings(true));
    }
}
