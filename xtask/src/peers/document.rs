//! The report: docs/peers.md from result lines. The same results give the same bytes.

use super::environment::Environment;
use super::results::{self, Entry, median, number};
use super::runs::{OURS, SWEEPERS, SWEEPS_BETWEEN};
use serde_json::Value;
use std::collections::BTreeSet;

/// The text of the report.
pub fn write(environment: &Environment) -> Result<String, String> {
    let read = |name: &str| results::read(&environment.results().join(name));
    let about = read("about.json")?.into_iter().next().ok_or("about.json is empty")?;
    let (settled, motion) = (read("settled.jsonl")?, read("motion.jsonl")?);
    let sweeps = read("sweeps.jsonl")?;
    let mut blocks = vec![opening(&about, &settled), COLUMNS.to_owned()];
    let mut settings = Table::new(&["simulator", "method", "energy", "numbers", "settings"]);
    let mut known = BTreeSet::new();
    for size in ["xs", "s", "m", "l"] {
        for scene in ["A", "B"] {
            let entries = Entry::all(&settled, &motion, scene, size);
            if entries.is_empty() {
                continue;
            }
            blocks.push(section(scene, size, &entries));
            for entry in &entries {
                if known.insert(name_of(entry)) {
                    settings.row(settings_of(entry));
                }
            }
        }
    }
    blocks.insert(2, format!("## Settings\n\n{SETTINGS}\n\n{}", settings.to_markdown()));
    blocks.push(sweep_section(&sweeps));
    blocks.push(LIMITS.to_owned());
    Ok(blocks.join("\n\n") + "\n")
}

fn opening(about: &Value, rows: &[Value]) -> String {
    let text = |key: &str| about[key].as_str().unwrap_or("unknown").to_owned();
    format!(
        "# Peers\n\n\
         Written by `cargo xtask peers`; the program writes it again, so edit the program.\n\n\
         Other simulators and viscera on the same meshes of linear tetrahedra, the same materials, \
         pins and frames of 1/60 s. One program runs at a time, on one thread of one core. Every \
         round runs everything once, the next in reverse order.\n\n\
         - processor: {}\n- command: `{}`\n- rounds: {}; numbers are medians over rounds\n\
         - load: a fixed piece of arithmetic, timed before and after each run, took {}; the \
         further apart, the busier the machine. Compare only what stands in one table.",
        text("cpu"),
        text("command"),
        about["rounds"],
        load(rows),
    )
}

/// The range of the yardstick's times.
fn load(rows: &[Value]) -> String {
    let times = rows.iter().filter_map(|row| row["yardstick_ms"].as_array()).flatten();
    let times: Vec<f64> = times.filter_map(Value::as_f64).collect();
    let (low, high) = times.iter().fold((f64::MAX, 0.0_f64), |(a, b), t| (a.min(*t), b.max(*t)));
    format!("{} to {} ms", digits(low), digits(high))
}

const COLUMNS: &str = "\
**Scene A**: a bar of 80 x 20 x 20 mm, fixed at one end, droops under gravity; E = 50 kPa, nu = 0.3. **Scene B**:
the same bar, held at both ends, one of which is pulled away by 30 % within one second, without gravity; E = 5 kPa,
nu = 0.3. Both have 180 frames, after each of which all velocities are multiplied by 0.9, so that every simulator's
body comes to rest. Sizes: s is 1280 tetrahedra, m 10 240, l 98 260.

- *CPU per frame*: processor time of a frame of 1/60 s. A program of its own (viscera, Rapier) is measured from
  outside, with all that it does in a frame; a Python module around its step. Below 16.7 ms is real time.
- *times viscera*: that, over the cost of viscera's defaults in the same round. Below 1 is cheaper.
- *error at rest*: distance of all free vertices from the exact state of rest of the same mesh (a finite element
  solution by Newton's method), over their displacement, both as root mean square. *own*: against the energy that the
  simulator minimises, its own error. *StVK*: against Saint Venant-Kirchhoff; a perfect neo-Hookean solver has
  about 2 % there, because it is another material.
- *error in motion*: 30 frames from rest without the factor; distance of the probe (tip, or middle of the top) from
  an explicit finite element solution with small steps, over its displacement, along the whole path.";

const SETTINGS: &str = "\
At size s each peer has the setting that the benchmark recommends for it; above, where that would take too long, one
that is affordable and need not be its best: an error of 100 % or more says that the setting does not fit the scene,
not that the peer cannot do it. *numbers* is the precision.
Settings left out are the peer's defaults.";

const LIMITS: &str = "\
## What this does not say

Two scenes of one bar with one Poisson ratio are not surgery: there is no contact, no cutting, no nearly
incompressible tissue here. Several peers are made for many threads or for a GPU, and rigid bodies, robots or cloth
beside tissue; one thread shows none of that. The mesh is the same for all, so that its own error, large for coarse
linear tetrahedra, is in no column.";

/// What a peer's name does not tell.
const METHODS: [(&str, &str); 9] = [
    ("MujocoFlex", "MuJoCo flex: implicit finite elements beside rigid bodies"),
    ("PbatVBD", "Physics-Based Animation Toolkit: vertex block descent"),
    ("PbatXPBD", "Physics-Based Animation Toolkit: XPBD, coloured"),
    ("NewtonVBD", "Newton (Warp): vertex block descent, coloured"),
    ("NewtonXPBD", "Newton (Warp): XPBD, Jacobi"),
    ("PyPBD_XPBD", "PositionBasedDynamics: XPBD, coloured"),
    ("RapierFem", "Rapier: finite elements"),
    ("RapierConstraints", "Rapier: soft constraints"),
    ("NewtonSemiImplicit", "Newton (Warp): explicit"),
];

fn ours(entry: &Entry<'_>) -> Option<&'static super::runs::Ours> {
    OURS.iter().find(|ours| ours.label == entry.peer)
}

/// Name and, where a peer runs with several settings, what it was told.
fn name_of(entry: &Entry<'_>) -> String {
    let told = list(entry.asked);
    if told.is_empty() { entry.peer.to_owned() } else { format!("{} ({told})", entry.peer) }
}

/// `key=value, ...`
fn list(settings: &Value) -> String {
    let Some(entries) = settings.as_object() else { return String::new() };
    let shown = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let texts: Vec<String> = entries.iter().map(|(k, v)| format!("{k}={}", shown(v))).collect();
    texts.join(", ")
}

fn settings_of(entry: &Entry<'_>) -> Vec<String> {
    let text = |key: &str| {
        let mut values = entry.settled.iter().filter_map(|row| row[key].as_str());
        values.next().unwrap_or("-").to_owned()
    };
    let (method, settings) = match ours(entry) {
        Some(ours) => (ours.words.to_owned(), ours.settings.replace(',', ", ")),
        None => {
            let method = METHODS.iter().find(|(peer, _)| *peer == entry.peer);
            let all = entry.settled.first().map_or_else(String::new, |row| list(&row["cfg"]));
            (method.map_or("", |(_, method)| method).to_owned(), all)
        }
    };
    let energy = match text("mat_own").as_str() {
        "stvk" => "StVK".to_owned(),
        "snh" => "neo-Hookean".to_owned(),
        other => other.to_owned(),
    };
    vec![name_of(entry), method, energy, text("precision"), settings]
}

/// Error against the simulator's own energy; where that has no state of rest, against StVK.
fn judged(own: Option<f64>, stvk: Option<f64>) -> Option<f64> {
    own.or(stvk)
}

fn section(scene: &str, size: &str, entries: &[Entry<'_>]) -> String {
    let Some(reference) = entries.iter().find(|entry| entry.peer == OURS[0].label) else {
        return format!("## Scene {scene}, size {size}\n\nviscera did not run.");
    };
    let mut sorted: Vec<&Entry<'_>> = entries.iter().collect();
    let cost = |entry: &Entry<'_>| entry.cost().unwrap_or(f64::INFINITY);
    sorted.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    let mut table = Table::new(&[
        "simulator",
        "CPU per frame [ms]",
        "times viscera",
        "error at rest, own [%]",
        "StVK [%]",
        "error in motion, own [%]",
        "StVK [%]",
        "note",
    ]);
    for entry in sorted {
        let percent = |value: Option<f64>| shown(value.map(|v| 100.0 * v));
        let name = name_of(entry);
        table.row(vec![
            if ours(entry).is_some() { format!("**{name}**") } else { name },
            shown(entry.cost()),
            shown(entry.cost_over(reference)),
            percent(entry.rest_error("own")),
            percent(entry.rest_error("stvk")),
            percent(entry.motion_error("own")),
            percent(entry.motion_error("stvk")),
            // A table's cell is one line without bars.
            entry.trouble().unwrap_or("").replace(['|', '\n'], " "),
        ]);
    }
    let better = better_peers(reference, entries);
    format!("## Scene {scene}, size {size}\n\n{}\n\n{better}", table.to_markdown())
}

/// Where peers are better than viscera's defaults, in words.
fn better_peers(reference: &Entry<'_>, entries: &[Entry<'_>]) -> String {
    let rest = |e: &Entry<'_>| judged(e.rest_error("own"), e.rest_error("stvk"));
    let motion = |e: &Entry<'_>| judged(e.motion_error("own"), e.motion_error("stvk"));
    let less = |a: Option<f64>, b: Option<f64>| matches!((a, b), (Some(a), Some(b)) if a < b);
    let cheaper = |e: &Entry<'_>| less(e.cost_over(reference), Some(1.0));
    let at_rest = |e: &Entry<'_>| less(rest(e), rest(reference));
    let in_motion = |e: &Entry<'_>| less(motion(e), motion(reference));
    let mut text = String::from("Peers that are better than viscera's defaults:\n");
    let mut add = |what: &str, is_better: &dyn Fn(&Entry<'_>) -> bool| {
        let peers = entries.iter().filter(|e| ours(e).is_none() && is_better(e));
        let names: Vec<String> = peers.map(name_of).collect();
        let names = if names.is_empty() { "none".into() } else { names.join("; ") };
        text += &format!("\n- {what}: {names}");
    };
    add("cheaper", &cheaper);
    add("closer at rest", &at_rest);
    add("closer in motion", &in_motion);
    add("all three", &|e| cheaper(e) && at_rest(e) && in_motion(e));
    text
}

fn sweep_section(rows: &[Value]) -> String {
    let mut table =
        Table::new(&["solver", "a sweep over", "numbers", "size", "ns per tet and sweep", "ratio"]);
    for size in ["xs", "s", "m", "l"] {
        let first = results::sweep_costs(rows, SWEEPERS[0].label, size, SWEEPS_BETWEEN);
        for sweeper in &SWEEPERS {
            let is_its = |row: &&Value| row["sweeper"] == sweeper.label && row["size"] == size;
            let Some(row) = rows.iter().find(is_its) else { continue };
            let costs = results::sweep_costs(rows, sweeper.label, size, SWEEPS_BETWEEN);
            let ratios = costs.iter().filter_map(|(round, cost)| {
                let same = first.iter().find(|(other, _)| other == round)?;
                Some(cost / same.1)
            });
            let ratio = median(ratios.collect());
            let cost = median(costs.iter().map(|(_, cost)| *cost).collect());
            table.row(vec![
                sweeper.label.to_owned(),
                sweeper.words.to_owned(),
                row["precision"].as_str().unwrap_or("-").to_owned(),
                format!("{size} ({} tets)", number(row, "tets").unwrap_or(f64::NAN)),
                shown(cost),
                shown(ratio),
            ]);
        }
    }
    let rounds = rows.iter().filter_map(|row| row["round"].as_u64()).max().map_or(0, |r| r + 1);
    format!(
        "## Cost of a sweep\n\n\
         Scene B, 20 frames of 10 substeps, with 2 and with 8 iterations: the difference in CPU time, \
         over the tetrahedra and the sweeps between. What a substep costs besides is not in it. \
         *ratio*: to {} in the same round; below 1 is cheaper. A sweep is not a measure of progress: \
         one over six constraints per tetrahedron does more than one over a single energy.\n\n\
         Command: `{}`; rounds: {rounds}; the yardstick of load took {}.\n\n{}",
        SWEEPERS[0].label,
        rows.first().and_then(|row| row["command"].as_str()).unwrap_or("unknown"),
        load(rows),
        table.to_markdown()
    )
}

fn shown(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), digits)
}

/// Three significant digits without an exponent where a person can read that.
fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    match value.abs().log10().floor() {
        exponent if (-3.0..5.0).contains(&exponent) => {
            format!("{value:.*}", (2.0 - exponent).max(0.0) as usize)
        }
        _ => format!("{value:.1e}"),
    }
}

/// A table in Markdown.
struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    fn new(heads: &[&str]) -> Self {
        Self { rows: vec![heads.iter().map(|head| (*head).to_owned()).collect()] }
    }

    fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    fn to_markdown(&self) -> String {
        let line = |row: &Vec<String>| format!("| {} |", row.join(" | "));
        let mut lines: Vec<String> = self.rows.iter().map(line).collect();
        lines.insert(1, format!("|{}", "---|".repeat(self.rows[0].len())));
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_have_three_digits() {
        let cases = [(0.0123, "0.0123"), (1.0, "1.00"), (68.43, "68.4"), (12345.6, "12346")];
        for (value, text) in cases {
            assert_eq!(digits(value), text);
        }
        assert_eq!((digits(2.04e-6), digits(0.0)), ("2.0e-6".into(), "0".into()));
    }

    #[test]
    fn peers_that_are_better_are_named() {
        let row = |peer: &str, cost: f64, error: f64| {
            json!({ "scene": "A", "size": "s", "peer": peer, "cfg_asked": {}, "round": 0,
                    "cpu_ms": cost, "err_own_rms": error, "status": "ok" })
        };
        let rows = [row("Slow", 9.0, 1e-6), row("Fast", 1.0, 1e-2), row("viscera", 2.0, 1e-4)];
        let text = section("A", "s", &Entry::all(&rows, &[], "A", "s"));
        assert!(text.contains("- cheaper: Fast\n- closer at rest: Slow\n"), "{text}");
        assert!(text.ends_with("- closer in motion: none\n- all three: none"), "{text}");
        let places = ["Fast", "**viscera**", "Slow"].map(|name| text.find(&format!("| {name} |")));
        assert!(places.is_sorted() && places[0].is_some(), "dearer ones come later: {text}");
    }
}
