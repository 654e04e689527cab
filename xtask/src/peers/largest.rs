//! What has to be looked for: the fewest stable substeps, and the largest bar in real time.

use super::environment::Environment;
use super::goals::{Goal, REAL_TIME, cheapest};
use super::plan::{self, AUTOMATIC, Method, Program, STANDARD};
use super::results::{self, Entry, cost, number};
use super::runs::{Kind, Run, append, references, told};
use super::{Options, results as lines};
use serde_json::{Value, json};
use std::path::Path;

/// Above this error of motion a run at the fewest substeps has come apart: the explicit integrators of peers follow
/// the motion to less than a hundredth where they are stable.
const APART: f64 = 0.05;

/// No explicit method is tried with more.
const MOST_SUBSTEPS: u64 = 1000;

/// The fewest substeps, to a twentieth, with which an explicit method stays whole in motion and at rest.
pub fn fewest_substeps(
    environment: &Environment,
    method: &Method,
    scene: &str,
    size: &str,
) -> Result<u64, String> {
    let is_whole = |substeps: u64, kind: Kind, key: &str| -> Result<bool, String> {
        let settings = plan::settings(method.points[0].settings, substeps);
        let row = Run { method, settings, scene, size, kind }.result(environment)?;
        let error = number(&row, key).filter(|_| row["status"] == "ok");
        println!("{} with {substeps} substeps: {key} {error:?}", method.label);
        Ok(error.is_some_and(|error| error < APART))
    };
    let mut stable =
        least(16, MOST_SUBSTEPS, |substeps| is_whole(substeps, Kind::Motion, "dyn_own"))?;
    while stable < MOST_SUBSTEPS && !is_whole(stable, Kind::Settled, "err_own_rms")? {
        stable += stable.div_ceil(10);
    }
    Ok(stable)
}

/// The least number, to a twentieth and at most `most`, that is enough; what is enough once is so above it.
fn least(
    guess: u64,
    most: u64,
    mut is_enough: impl FnMut(u64) -> Result<bool, String>,
) -> Result<u64, String> {
    let (mut low, mut high) = (1, guess.max(2));
    while high < most && !is_enough(high)? {
        (low, high) = (high, 2 * high);
    }
    high = high.min(most);
    while high - low > high.div_ceil(20) {
        let middle = low.midpoint(high);
        if is_enough(middle)? { high = middle } else { low = middle }
    }
    Ok(high)
}

/// The finest bar, by cells across, that is looked for.
const MOST_CELLS: u32 = 30;

/// Ours and the best peer's largest bars in real time, as result lines.
pub fn run(environment: &Environment, options: &Options, file: &Path) -> Result<(), String> {
    super::write_whole(file, "")?;
    println!("\n== the largest bar in real time");
    let read = |name: &str| lines::read(&environment.results().join(name));
    let (settled, motion) = (read("settled.jsonl")?, read("motion.jsonl")?);
    let entries = Entry::all(&settled, &motion, "A", "s");
    let peers = entries.iter().filter(|entry| !results::is_ours(entry));
    let best = cheapest(peers, &Goal::FOLLOWED);
    let mut candidates = vec![(AUTOMATIC, plan::settings(STANDARD, 1))];
    candidates.extend(best.map(|entry| (entry.peer, entry.asked.clone())));
    for (label, settings) in candidates {
        let Some(method) = plan::method(label) else { continue };
        if method.program != Program::Ours
            && environment.missing(options)?.contains(&method.program.name().to_owned())
        {
            continue;
        }
        let row = largest(environment, method, &settings)?;
        append(file, &row)?;
    }
    Ok(())
}

/// What a method needs for a bar of so many cells: explicit ones that were stable with four cells take shorter steps on
/// smaller ones.
fn for_cells(method: &Method, settings: &Value, cells: u32) -> Value {
    let mut settings = settings.clone();
    let is_explicit = method.points.iter().any(|point| point.settings.contains("fewest"));
    if let (true, Some(substeps)) = (is_explicit, settings["substeps"].as_u64()) {
        settings["substeps"] = json!((substeps * u64::from(cells)).div_ceil(4));
    }
    settings
}

/// By bisection over cells for the cost, then downwards while the errors are too large.
fn largest(environment: &Environment, method: &Method, settings: &Value) -> Result<Value, String> {
    let run = |cells: u32, kind: Kind| -> Result<Value, String> {
        let size = format!("n{cells}");
        let settings = for_cells(method, settings, cells);
        let run = Run { method, settings, scene: "A", size: &size, kind };
        let row = run.result(environment)?;
        println!("{}", told(&row));
        Ok(row)
    };
    let (mut low, mut high) = (2, MOST_CELLS + 1);
    while high - low > 1 {
        let middle = low.midpoint(high);
        let is_fast = cost(&run(middle, Kind::Cost)?).is_some_and(|cost| cost <= REAL_TIME);
        if is_fast { low = middle } else { high = middle }
    }
    loop {
        references(environment, "A", &[format!("n{low}")])?;
        let mut row = run(low, Kind::Settled)?;
        row["dyn_own"] = run(low, Kind::Motion)?["dyn_own"].clone();
        let goal = Goal::FOLLOWED;
        let is_met = goal.is_met_by(number(&row, "err_own_rms"), number(&row, "dyn_own"));
        let is_fast = cost(&row).is_some_and(|cost| cost <= REAL_TIME);
        if (is_met && is_fast) || low <= 2 {
            row["cells"] = json!(low);
            row["is_met"] = json!(is_met && is_fast);
            return Ok(row);
        }
        low -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_number_is_found_to_a_twentieth() -> Result<(), String> {
        for truth in [3, 16, 17, 50, 333, 1000] {
            let mut asked = 0;
            let found = least(16, 1000, |number| {
                asked += 1;
                Ok(number >= truth)
            })?;
            assert!(found >= truth && found <= truth + truth.div_ceil(20), "{truth}: {found}");
            assert!(asked < 14, "{truth}: {asked} runs");
        }
        assert_eq!(least(16, 1000, |_| Ok(false))?, 1000);
        Ok(())
    }

    #[test]
    fn explicit_peers_take_shorter_steps_on_finer_bars() {
        let explicit = plan::method("MuJoCo, explicit").expect("a method");
        let implicit = plan::method("MuJoCo, implicit").expect("a method");
        let settings = json!({ "integrator": "Euler", "substeps": 50 });
        assert_eq!(for_cells(explicit, &settings, 9)["substeps"], 113);
        assert_eq!(for_cells(implicit, &settings, 9)["substeps"], 50);
    }
}
