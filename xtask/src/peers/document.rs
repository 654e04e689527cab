//! The report: docs/peers.md from result lines. The same results give the same bytes.

use super::environment::Environment;
use super::figures::{Figure, LEAST};
use super::goals::{Goal, REAL_TIME};
use super::plan::{self, AUTOMATIC, STANDARD};
use super::results::{self, Entry, is_ours, median, number};
use super::sweeps::{SWEEPERS, SWEEPS_BETWEEN};
use super::table::{Table, digits, shown};
use serde_json::Value;
use std::collections::BTreeSet;

/// The text of the report.
pub fn write(environment: &Environment, figures: &[Figure]) -> Result<String, String> {
    let read = |name: &str| results::read(&environment.results().join(name));
    let about = read("about.json")?.into_iter().next().ok_or("about.json is empty")?;
    let (settled, motion) = (read("settled.jsonl")?, read("motion.jsonl")?);
    // Left out where the run was told so.
    let [largest, sweeps] =
        ["largest.jsonl", "sweeps.jsonl"].map(|name| read(name).unwrap_or_default());
    let mut settings = Table::new(&["simulator", "method", "energy", "numbers", "settings"]);
    let (mut known, mut places) = (BTreeSet::new(), Vec::new());
    let mut sections = Vec::new();
    for size in results::sizes(&settled) {
        for scene in ["A", "B"] {
            let entries = Entry::all(&settled, &motion, scene, &size);
            if entries.is_empty() {
                continue;
            }
            for entry in entries.iter().filter(|entry| entry.is_main()) {
                if known.insert(name_of(entry)) {
                    settings.row(settings_of(entry));
                }
            }
            sections.push(section(scene, &size, &entries, figures));
            places.push((scene, size.clone(), entries));
        }
    }
    let mut blocks = vec![opening(&about, &settled), COLUMNS.to_owned(), ratios(&places)];
    blocks.extend(largest_section(&largest));
    blocks.push(format!("## Settings\n\n{SETTINGS}\n\n{}", settings.to_markdown()));
    blocks.extend(sections);
    if !sweeps.is_empty() {
        blocks.push(sweep_section(&sweeps));
    }
    blocks.push(LIMITS.to_owned());
    Ok(blocks.join("\n\n") + "\n")
}

fn opening(about: &Value, rows: &[Value]) -> String {
    let text = |key: &str| about[key].as_str().unwrap_or("unknown").to_owned();
    let names: Vec<&str> =
        about["missing"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let missing = match names.as_slice() {
        [] => String::new(),
        names => format!(
            "\n- not run, for they were not installed or not asked for: {}",
            names.join(", ")
        ),
    };
    format!(
        "# Peers\n\n\
         Written by `cargo xtask peers`; the program writes it again, so edit the program.\n\n\
         Other simulators and viscera on the same meshes of linear tetrahedra, the same materials, \
         pins and frames of 1/60 s. One program runs at a time, on one thread of one core. Every \
         round runs everything once, the next in reverse order.\n\n\
         - processor: {}\n- command: `{}`\n- rounds: {}; numbers are medians over rounds{missing}\n\
         - load: a fixed piece of arithmetic, timed before and after each run, took {}; the \
         further apart, the busier the machine. Compare only what stands in one table.",
        text("cpu"),
        text("command"),
        about["rounds"],
        load(rows),
    )
}

/// The range of the yardstick's times.
pub fn load(rows: &[Value]) -> String {
    let times = rows.iter().filter_map(|row| row["yardstick_ms"].as_array()).flatten();
    let times: Vec<f64> = times.filter_map(Value::as_f64).collect();
    let (low, high) = times.iter().fold((f64::MAX, 0.0_f64), |(a, b), t| (a.min(*t), b.max(*t)));
    format!("{} to {} ms", digits(low), digits(high))
}

const COLUMNS: &str = "\
**Scene A**: a bar of 80 x 20 x 20 mm, fixed at one end, droops under gravity; E = 50 kPa, nu = 0.3. **Scene B**:
the same bar, held at both ends, one of which is pulled away by 30 % within one second, without gravity; E = 5 kPa,
nu = 0.3. Both have 180 frames, after each of which all velocities are multiplied by 0.9, so that every simulator's
body comes to rest. Sizes: s is 1280 tetrahedra, m 10 240, l 98 260. **liver, kidney, bowel**: in the place of the bar
of scene A the organs of the [validation](validation.md), E = 20 kPa, nu = 0.45; the probe is the twentieth of the
vertices that lies lowest.

viscera's rows are of stable neo-Hookean tissue, what its scenes have, where they say nothing else.

- *CPU per frame*: processor time of a frame of 1/60 s. A program of its own (viscera, Rapier) is measured from
  outside, with all that it does in a frame; a Python module around its step. Below 16.7 ms is real time.
- *times viscera*: that, over the cost of viscera's automatic method at standard accuracy in the same round. Below 1 is
  cheaper.
- *error at rest*: distance of all free vertices from the exact state of rest of the same mesh (a finite element
  solution by Newton's method), over their displacement, both as root mean square. *own*: against the energy that the
  simulator minimises, its own error. *StVK*: against Saint Venant-Kirchhoff; a perfect neo-Hookean solver has
  about 2 % there, because it is another material.
- *error in motion*: 30 frames from rest without the factor; distance of the probe (tip, or middle of the top) from
  an explicit finite element solution with small steps, over its displacement, along the whole path. On meshes where that
  solution would take hours, at size l and in the bars in real time, it is of viscera's own explicit method in double
  precision at a quarter of the stable step.
- *inverted*: tetrahedra inside out at rest, of the positions that the simulator returned.";

const SETTINGS: &str = "\
Settings left out are the peer's defaults; *numbers* is the precision. The fewest substeps of MuJoCo's explicit
integrator are looked for, to a twentieth: fewer end more than 5 % off. Finer meshes have fewer settings of the dear
peers: an error of 100 % or more says that a setting does not fit the scene, not that the peer cannot do it. Figures
have more settings than tables, each of which ran once.";

const LIMITS: &str = "\
## What this does not say

Two scenes of one bar with one Poisson ratio are not surgery: there is no contact, no cutting, no nearly
incompressible tissue here. Several peers are made for many threads or for a GPU, and rigid bodies, robots or cloth
beside tissue; one thread shows none of that. The mesh is the same for all, so that its own error, large for coarse
linear tetrahedra, is in no column: [Peers against the continuum](peers-continuum.md) has it. Contact is in [Peers in
contact](peers-contact.md).";

/// What the names of our methods say already.
const SAID: [&str; 5] = ["material", "method", "rebase", "keep_multipliers", "step_guard"];

/// Name and, where a method runs with several settings, what it was told.
fn name_of(entry: &Entry<'_>) -> String {
    let mut asked = entry.asked.clone();
    if let (true, Some(settings)) = (is_ours(entry), asked.as_object_mut()) {
        settings.retain(|key, _| !SAID.contains(&key.as_str()));
    }
    let told = list(&asked);
    if told.is_empty() { entry.peer.to_owned() } else { format!("{} ({told})", entry.peer) }
}

/// `key=value, ...`
pub fn list(settings: &Value) -> String {
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
    let method = plan::method(entry.peer).map_or("", |method| method.words);
    let all = entry.settled.first().map_or_else(String::new, |row| list(&row["cfg"]));
    let energy = match text("mat_own").as_str() {
        "stvk" => "StVK".to_owned(),
        "snh" => "neo-Hookean".to_owned(),
        other => other.to_owned(),
    };
    vec![name_of(entry), method.to_owned(), energy, text("precision"), all]
}

/// The row that others are compared with.
fn standard<'a, 'b>(entries: &'b [Entry<'a>]) -> Option<&'b Entry<'a>> {
    let settings = plan::settings(STANDARD, 1);
    entries.iter().find(|entry| entry.peer == AUTOMATIC && *entry.asked == settings)
}

/// How many times dearer the best peer is, by what is asked.
fn ratios(places: &[(&str, String, Vec<Entry<'_>>)]) -> String {
    let mut table = Table::new(&[
        "what is asked",
        "scene",
        "size",
        "viscera",
        "[ms]",
        "cheapest peer",
        "[ms]",
        "times viscera",
    ]);
    for goal in &Goal::ALL {
        for (scene, size, entries) in places {
            let (ours, peer) = (goal.ours(entries), goal.peer(entries));
            let name = |entry: Option<&Entry<'_>>| entry.map_or_else(|| "none".into(), name_of);
            let cost = |entry: Option<&Entry<'_>>| shown(entry.and_then(Entry::cost));
            let ratio = ours.zip(peer).and_then(|(ours, peer)| peer.cost_over(ours));
            table.row(vec![
                goal.words.to_owned(),
                (*scene).to_owned(),
                size.clone(),
                name(ours),
                cost(ours),
                name(peer),
                cost(peer),
                ratio.map_or_else(|| "-".into(), |ratio| format!("**{}**", digits(ratio))),
            ]);
        }
    }
    format!("## The same accuracy\n\n{RATIOS}\n\n{}", table.to_markdown())
}

const RATIOS: &str = "\
The cheapest peer that does what is asked, with any of its settings below, over viscera in the same round. Errors are
*own*. For the first two it is viscera's automatic method at standard accuracy, the default of every scene, or
*none* where that falls short; for the last the cheapest of all of viscera's settings.";

/// Bars in real time.
fn largest_section(rows: &[Value]) -> Option<String> {
    let ours = rows.first()?;
    let tets = |row: &Value| number(row, "tets").unwrap_or(f64::NAN);
    let mut table = Table::new(&[
        "simulator",
        "cells across",
        "tetrahedra",
        "CPU per frame [ms]",
        "error at rest [%]",
        "error in motion [%]",
        "viscera's over it",
    ]);
    for row in rows {
        let percent = |key: &str| shown(number(row, key).map(|share| 100.0 * share));
        let met = if row["is_met"] == true { "" } else { ", falls short" };
        let entry = Entry {
            peer: row["peer"].as_str().unwrap_or("?"),
            asked: &row["cfg_asked"],
            settled: Vec::new(),
            motion: Vec::new(),
        };
        table.row(vec![
            name_of(&entry) + met,
            row["cells"].to_string(),
            digits(tets(row)),
            shown(results::cost(row)),
            percent("err_own_rms"),
            percent("dyn_own"),
            digits(tets(ours) / tets(row)),
        ]);
    }
    Some(format!(
        "## The largest bar in real time\n\nScene A, {}, in at most {} ms per frame: by bisection over the cells across \
         the bar, for viscera's default and for the peer that is cheapest at that at size s.\n\n{}",
        Goal::FOLLOWED.words,
        digits(REAL_TIME),
        table.to_markdown()
    ))
}

fn section(scene: &str, size: &str, entries: &[Entry<'_>], figures: &[Figure]) -> String {
    let reference = standard(entries);
    let mut sorted: Vec<&Entry<'_>> = entries.iter().filter(|entry| entry.is_main()).collect();
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
        "inverted",
        "note",
    ]);
    for entry in sorted {
        let percent = |value: Option<f64>| shown(value.map(|v| 100.0 * v));
        let name = name_of(entry);
        table.row(vec![
            if is_ours(entry) { format!("**{name}**") } else { name },
            shown(entry.cost()),
            shown(reference.and_then(|reference| entry.cost_over(reference))),
            percent(entry.rest_error("own")),
            percent(entry.rest_error("stvk")),
            percent(entry.motion_error("own")),
            percent(entry.motion_error("stvk")),
            entry.inverted().map_or_else(|| "-".into(), |count| count.to_string()),
            // A table's cell is one line without bars.
            entry.trouble().unwrap_or("").replace(['|', '\n'], " "),
        ]);
    }
    let mut blocks = vec![format!("## Scene {scene}, size {size}"), table.to_markdown()];
    blocks.extend(reference.map(|reference| better_peers(reference, entries)));
    let here = figures.iter().filter(|figure| figure.scene == scene && figure.size == size);
    let pictures: Vec<String> = here.map(|f| format!("![{}]({})", f.words, f.link)).collect();
    if !pictures.is_empty() {
        blocks.push(format!(
            "Cheaper is to the left, closer is below. A curve goes over substeps, iterations or the accuracy asked \
             for; errors below {} % are drawn there.",
            digits(LEAST)
        ));
        blocks.extend(pictures);
    }
    blocks.join("\n\n")
}

/// Where peers are better than viscera's defaults, in words.
fn better_peers(reference: &Entry<'_>, entries: &[Entry<'_>]) -> String {
    let rest = |e: &Entry<'_>| e.judged_rest();
    let motion = |e: &Entry<'_>| e.judged_motion();
    let less = |a: Option<f64>, b: Option<f64>| matches!((a, b), (Some(a), Some(b)) if a < b);
    let cheaper = |e: &Entry<'_>| less(e.cost_over(reference), Some(1.0));
    let at_rest = |e: &Entry<'_>| less(rest(e), rest(reference));
    let in_motion = |e: &Entry<'_>| less(motion(e), motion(reference));
    let mut text = String::from("Peers that are better than viscera's defaults:\n");
    let mut add = |what: &str, is_better: &dyn Fn(&Entry<'_>) -> bool| {
        let peers = entries.iter().filter(|e| !is_ours(e) && e.is_main() && is_better(e));
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
    // The first that ran: not every peer is installed everywhere.
    let has_run = |label: &str| rows.iter().any(|row| row["sweeper"] == label);
    let first_label = SWEEPERS.iter().map(|s| s.label).find(|label| has_run(label)).unwrap_or("?");
    for size in results::sizes(rows) {
        let size = size.as_str();
        let first = results::sweep_costs(rows, first_label, size, SWEEPS_BETWEEN);
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
        first_label,
        rows.first().and_then(|row| row["command"].as_str()).unwrap_or("unknown"),
        load(rows),
        table.to_markdown()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn row(peer: &str, asked: &Value, cost: f64, error: f64) -> Value {
        json!({ "scene": "A", "size": "s", "peer": peer, "cfg_asked": asked, "round": 0, "is_main": true,
                "cpu_ms": cost, "err_own_rms": error, "dyn_own": error, "inverted": 3, "status": "ok" })
    }

    #[test]
    fn peers_that_are_better_are_named() {
        let (none, standard) = (json!({}), plan::settings(STANDARD, 1));
        let rows = [
            row("Slow", &none, 9.0, 1e-6),
            row("Fast", &none, 1.0, 1e-2),
            row(AUTOMATIC, &standard, 2.0, 1e-4),
        ];
        let text = section("A", "s", &Entry::all(&rows, &[], "A", "s"), &[]);
        assert!(text.contains("- cheaper: Fast\n- closer at rest: Slow\n"), "{text}");
        assert!(text.ends_with("- closer in motion: none\n- all three: none"), "{text}");
        let ours = format!("**{AUTOMATIC} (accuracy=standard)**");
        let places = ["Fast", &ours, "Slow"].map(|name| text.find(&format!("| {name} |")));
        assert!(places.is_sorted() && places[0].is_some(), "dearer ones come later: {text}");
        assert!(text.contains("| 4.50 | 1.0e-4 | - | - | - | 3 |  |"), "{text}");
    }

    #[test]
    fn ratios_are_of_the_cheapest_that_is_as_close() {
        let (none, standard) = (json!({}), plan::settings(STANDARD, 1));
        let rows = [
            row("Far", &none, 1.0, 0.5),
            row("MuJoCo, implicit", &none, 8.0, 1e-3),
            row("Dear", &none, 9.0, 1e-3),
            row(AUTOMATIC, &standard, 2.0, 1e-3),
        ];
        let entries = Entry::all(&rows, &rows, "A", "s");
        let text = ratios(&[("A", "s".to_owned(), entries)]);
        let line = "| A | s | viscera, automatic (accuracy=standard) | 2.00 | MuJoCo, implicit | 8.00 | **4.00** |";
        assert_eq!(text.matches(line).count(), 3, "{text}");
    }

    #[test]
    fn bars_in_real_time_are_compared_by_tetrahedra() {
        let bar = |peer: &str, tets: u32, is_met: bool| json!({ "peer": peer, "cfg_asked": {}, "tets": tets, "cells": 4, "is_met": is_met });
        let text = largest_section(&[bar(AUTOMATIC, 80_000, true), bar("Other", 10_000, false)]);
        let text = text.unwrap_or_default();
        assert!(text.contains("| 8.00 |"), "{text}");
        assert!(text.contains("| Other, falls short |"), "{text}");
        assert!(largest_section(&[]).is_none());
    }
}
