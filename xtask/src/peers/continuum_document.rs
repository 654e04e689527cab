//! docs/peers-continuum.md from result lines. The same results give the same bytes.

use super::continuum::{
    FILLINGS, Filling, LIMIT, OURS, POISSON, chosen, is_near, is_ours, is_within,
};
use super::document::{list, load};
use super::environment::Environment;
use super::figures::draw;
use super::plan::{METHODS, Program, settings};
use super::results::{cost, median, number};
use super::table::{Table, shown};
use serde_json::{Value, json};
use std::path::Path;

/// Errors below this [%] are drawn here: where a curve crosses the truth says nothing.
const LEAST: f64 = 0.1;

/// The text of the document; figures go to the folder `peers` beside it.
pub fn write(
    environment: &Environment,
    about: &Value,
    rows: &[Value],
    out: &Path,
) -> Result<String, String> {
    let folder = out.parent().unwrap_or(Path::new(".")).join("peers");
    std::fs::create_dir_all(&folder)
        .map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    let mut blocks = vec![opening(about, rows), summary(rows)];
    for filling in &FILLINGS {
        blocks.push(section(filling, rows));
        let data = curves(filling, rows);
        if data["series"].as_array().is_some_and(|curves| !curves.is_empty()) {
            let file = format!("continuum-{}.svg", filling.name);
            draw(environment, &data, &folder.join(&file))?;
            let title = data["title"].as_str().unwrap_or_default();
            blocks.push(format!("{FIGURE}\n\n![{title}](peers/{file})"));
        }
    }
    Ok(blocks.join("\n\n") + "\n")
}

const FIGURE: &str =
    "A point is a bar, a curve goes from coarse to fine. Cheaper is to the left, closer is below.";

fn opening(about: &Value, rows: &[Value]) -> String {
    let text = |key: &str| about[key].as_str().unwrap_or("unknown");
    let missing: Vec<&str> =
        about["missing"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let missing = match missing.as_slice() {
        [] => String::new(),
        names => format!(
            "\n- not run, for they were not installed or not asked for: {}",
            names.join(", ")
        ),
    };
    let truths = about["truths"].as_object().into_iter().flatten().map(|(law, values)| {
        let millimetres = |at: usize| 1e3 * values[at].as_f64().unwrap_or(f64::NAN);
        format!("{} {:.2} mm, known to {:.2} mm", law_name(law), millimetres(0), millimetres(1))
    });
    format!(
        "# Peers against the continuum\n\n\
         Written by `cargo xtask peers --continuum`; the program writes it again, so edit the program. What all have in \
         common is said in [Peers](peers.md).\n\n\
         What a user wants is the body, not the mesh. Here every simulator has to bring the tip of a bar (scene A at nu = \
         {POISSON}: 80 x 20 x 20 mm, clamped at one end, under its weight, E = 50 kPa) within {} % of where the tip of the \
         body itself comes to rest, and may take the coarsest bar of 2, 3, 4 ... cells across on which it does so.\n\n\
         - The body's sag is that of its own law, of quadratic tetrahedra with 8 cells across, extrapolated from those with \
         6; the error is the distance to what 4 and 6 tell: {}.\n\
         - *against the continuum*: the mean sag of the tip's vertices after 180 frames over that, less one. Negative is too \
         stiff.\n\
         - *against its mesh*: likewise over the sag of linear tetrahedra of the same mesh and law, solved exactly. A peer \
         counts as within the limit where this is at most {} % too: iterations that are broken off are soft where coarse \
         linear tetrahedra are stiff, so that on some bar the one error hides the other, and on finer bars, where users look \
         for the truth, it is gone. What is cheapest without that condition stands in the last column of the first table.\n\
         - Newton's XPBD has a law without a state of rest and is judged by Saint Venant-Kirchhoff's.\n\
         - *structured*: boxes of five tetrahedra, as the benchmark makes them. *unstructured*: boxes of six whose inner \
         vertices are pushed about and whose tetrahedra are exchanged at random, then relaxed, as from a mesh generator.\n\
         - A finer bar is not tried where a frame would take more than {} times as long as the best peer's, on unstructured \
         bars {} times, or more than half a second. Settings are tried from cheap to \
         dear, those of [Peers](peers.md), and none dearer than the first that is within.\n\
         - processor: {}\n- command: `{}`\n- rounds: {}; numbers are medians over rounds of processor time on one thread, \
         ratios are taken inside a round. Other programs ran on the machine meanwhile, so \
         that times are longer than on an idle one{missing}\n\
         - load: a fixed piece of arithmetic, timed before and after each run, took {}.",
        100.0 * LIMIT,
        truths.collect::<Vec<_>>().join("; "),
        100.0 * LIMIT,
        FILLINGS[0].how_dear,
        FILLINGS[1].how_dear,
        text("cpu"),
        text("command"),
        about["rounds"],
        load(rows),
    )
}

fn law_name(law: &str) -> &str {
    match law {
        "stvk" => "Saint Venant-Kirchhoff",
        "snh" => "stable neo-Hookean",
        other => other,
    }
}

/// A row of a search and the rounds that were run of it.
struct Bar<'a> {
    found: &'a Value,
    rounds: Vec<&'a Value>,
}

impl<'a> Bar<'a> {
    fn new(found: &'a Value, rows: &'a [Value]) -> Self {
        let is_same = |row: &&Value| {
            !row["round"].is_null()
                && ["peer", "cfg_asked", "filling", "cells"]
                    .iter()
                    .all(|key| row[*key] == found[*key])
        };
        Self { found, rounds: rows.iter().filter(is_same).collect() }
    }

    /// CPU time of a frame [ms].
    fn cost(&self) -> Option<f64> {
        median(self.rounds.iter().filter_map(|row| cost(row)).collect())
    }

    /// In the same rounds.
    fn cost_over(&self, other: &Self) -> Option<f64> {
        let ratio = |row: &&Value| {
            let same = other.rounds.iter().find(|other| other["round"] == row["round"])?;
            Some(cost(row)? / cost(same)?)
        };
        median(self.rounds.iter().filter_map(ratio).collect())
    }

    fn is_ours(&self) -> bool {
        is_ours(self.found)
    }
}

/// All that was timed, and the first of ours where it is among them.
fn bars<'a>(filling: &Filling, rows: &'a [Value]) -> (Vec<Bar<'a>>, Option<Bar<'a>>) {
    let found = chosen(rows, filling.name);
    let first = settings(OURS[0], 1);
    let ours = found.iter().find(|row| is_ours(row) && row["cfg_asked"] == first);
    let ours = ours.map(|row| Bar::new(row, rows));
    (found.into_iter().map(|row| Bar::new(row, rows)).collect(), ours)
}

fn name(row: &Value) -> String {
    let mut asked = row["cfg_asked"].clone();
    if let (true, Some(settings)) = (is_ours(row), asked.as_object_mut()) {
        settings.remove("material");
    }
    let (peer, told) = (row["peer"].as_str().unwrap_or("?"), list(&asked));
    if told.is_empty() { peer.to_owned() } else { format!("{peer} ({told})") }
}

fn percent(row: &Value, key: &str) -> String {
    number(row, key).map_or_else(|| "-".into(), |share| format!("{:+.1}", 100.0 * share))
}

/// How many times dearer the best peer is, on each kind of mesh.
fn summary(rows: &[Value]) -> String {
    let mut table = Table::new(&[
        "bars",
        "viscera",
        "cells",
        "[ms]",
        "best peer",
        "cells",
        "[ms]",
        "times viscera",
        "asked",
        "best where errors may cancel",
        "times viscera",
    ]);
    for filling in &FILLINGS {
        let (bars, ours) = bars(filling, rows);
        let peers = |fits: fn(&Value) -> bool| {
            let peers =
                bars.iter().filter(|bar| !bar.is_ours() && fits(bar.found) && bar.cost().is_some());
            peers.min_by(|a, b| {
                a.cost().unwrap_or(f64::NAN).total_cmp(&b.cost().unwrap_or(f64::NAN))
            })
        };
        let (best, lucky) = (peers(is_within), peers(is_near));
        let of = |bar: Option<&Bar<'_>>, what: &dyn Fn(&Bar<'_>) -> String| {
            bar.map_or_else(|| "none".into(), what)
        };
        let cells = |bar: &Bar<'_>| bar.found["cells"].to_string();
        let milliseconds = |bar: &Bar<'_>| shown(bar.cost());
        let over = |bar: &Bar<'_>| shown(ours.as_ref().and_then(|ours| bar.cost_over(ours)));
        let those = if not_run(filling, rows).is_empty() { "" } else { ", of those that ran" };
        table.row(vec![
            filling.name.to_owned(),
            of(ours.as_ref(), &|bar| name(bar.found)),
            of(ours.as_ref(), &cells),
            of(ours.as_ref(), &milliseconds),
            of(best, &|bar| name(bar.found)) + those,
            of(best, &cells),
            of(best, &milliseconds),
            format!("**{}**", of(best, &over)),
            filling.goal.to_string(),
            of(lucky, &|bar| format!("{}, {} cells", name(bar.found), cells(bar))) + those,
            of(lucky, &over),
        ]);
    }
    format!("## Time to {} % of the continuum\n\n{}", 100.0 * LIMIT, table.to_markdown())
}

/// All simulators on one kind of mesh.
fn section(filling: &Filling, rows: &[Value]) -> String {
    let (mut bars, ours) = bars(filling, rows);
    bars.sort_by(|a, b| {
        let cost = |bar: &Bar<'_>| bar.cost().unwrap_or(f64::INFINITY);
        cost(a).total_cmp(&cost(b))
    });
    let mut table = Table::new(&[
        "simulator",
        "law",
        "cells",
        "tetrahedra",
        "against the continuum [%]",
        "against its mesh [%]",
        "CPU per frame [ms]",
        "times viscera",
    ]);
    let line = |row: &Value, name: String, cost: String, ratio: String| {
        let law = law_name(row["law"].as_str().unwrap_or("?")).to_owned();
        let [error, solver] = ["error", "solver_error"].map(|key| percent(row, key));
        vec![
            name,
            law,
            row["cells"].to_string(),
            row["tets"].to_string(),
            error,
            solver,
            cost,
            ratio,
        ]
    };
    for bar in &bars {
        let mut name = name(bar.found);
        if bar.is_ours() {
            name = format!("**{name}**");
        }
        if !is_within(bar.found) {
            name += ", errors cancel";
        }
        let ratio = shown(ours.as_ref().and_then(|ours| bar.cost_over(ours)));
        table.row(line(bar.found, name, shown(bar.cost()), ratio));
    }
    for row in best_of_others(filling, rows) {
        // What is near by luck stands above.
        if bars.iter().any(|bar| std::ptr::eq(bar.found, row)) {
            continue;
        }
        table.row(line(row, format!("{}, not within", name(row)), shown(cost(row)), "-".into()));
    }
    let rounds = bars.iter().map(|bar| bar.rounds.len()).min().unwrap_or(0);
    format!(
        "## {} bars\n\nEach simulator on its coarsest bar within the limit; rounds: {rounds}. *not within*: on no bar that \
         was tried; this is the best of them, which ran once, its own error counted where the mesh's does not hide \
         it.{}\n\n{}",
        filling.name[..1].to_uppercase() + &filling.name[1..],
        not_run(filling, rows),
        table.to_markdown()
    )
}

/// Peers of which there is no row: a search that was broken off has not come to them.
fn not_run(filling: &Filling, rows: &[Value]) -> String {
    let has_run =
        |label: &str| rows.iter().any(|row| row["filling"] == filling.name && row["peer"] == label);
    let peers = METHODS.iter().filter(|method| method.program != Program::Ours);
    let names: Vec<&str> =
        peers.map(|method| method.label).filter(|label| !has_run(label)).collect();
    match names.as_slice() {
        [] => String::new(),
        names => format!(" Not run on these bars: {}.", names.join("; ")),
    }
}

/// Of each peer that is nowhere within the limit, the bar on which the larger of its two errors is least.
fn best_of_others<'a>(filling: &Filling, rows: &'a [Value]) -> Vec<&'a Value> {
    let worst = |row: &Value| {
        let size = |key: &str| number(row, key).map(f64::abs);
        Some(size("error")?.max(size("solver_error")?))
    };
    let here = |row: &&Value| {
        row["filling"] == filling.name && row["round"].is_null() && row["status"] == "ok"
    };
    let mut best = Vec::new();
    for method in METHODS.iter().filter(|method| method.program != Program::Ours) {
        let its: Vec<&Value> =
            rows.iter().filter(here).filter(|row| row["peer"] == method.label).collect();
        if its.iter().any(|row| is_within(row)) {
            continue;
        }
        let known = its.into_iter().filter_map(|row| Some((row, worst(row)?)));
        best.extend(known.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(row, _)| row));
    }
    best
}

/// Error against cost of what was timed, over all bars.
fn curves(filling: &Filling, rows: &[Value]) -> Value {
    let mut shown = chosen(rows, filling.name);
    shown.retain(|row| is_within(row));
    shown.extend(best_of_others(filling, rows));
    let curve = |of: &&Value| {
        let is_its = |row: &&Value| {
            let same = ["peer", "filling", "round"].iter().all(|key| row[*key] == of[*key]);
            // Explicit peers have as many substeps as the bar needs.
            let is_fewest = of["cfg_asked"]["integrator"] == "Euler"
                && number(row, "solver_error").is_some_and(|e| e.abs() < LIMIT);
            same && row["status"] == "ok" && (row["cfg_asked"] == of["cfg_asked"] || is_fewest)
        };
        let mut bars: Vec<&Value> = rows.iter().filter(is_its).collect();
        bars.sort_by_key(|row| row["cells"].as_u64());
        let point =
            |row: &&Value| Some([cost(row)?, (100.0 * number(row, "error")?.abs()).max(LEAST)]);
        json!({ "name": name_of_curve(of), "points": bars.iter().filter_map(point).collect::<Vec<_>>() })
    };
    json!({
        "title": format!("{} bars: cost of a frame and error against the continuum", filling.name),
        "x": "CPU time per frame [ms]",
        "y": "error of the tip's sag [%]",
        "series": shown.iter().map(curve).collect::<Vec<_>>(),
    })
}

/// Ours have several, peers one.
fn name_of_curve(row: &Value) -> String {
    let peer = row["peer"].as_str().unwrap_or("?");
    let text = |key: &str| row["cfg_asked"][key].as_str().unwrap_or("?");
    match is_ours(row) {
        true => format!("viscera, {} ({})", text("elements"), text("accuracy")),
        false => peer.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(
        peer: &str,
        text: &str,
        round: Option<u32>,
        cells: u32,
        cost: f64,
        errors: [f64; 2],
    ) -> Value {
        let solver = Some(errors[1]).filter(|_| !peer.starts_with("viscera"));
        json!({ "peer": peer, "cfg_asked": settings(text, 1), "filling": "structured", "cells": cells, "tets": 5,
                "round": round, "cpu_ms": cost, "error": errors[0], "solver_error": solver, "law": "snh",
                "status": "ok" })
    }

    /// A search and one round of three simulators, and a peer that gets nowhere.
    fn rows() -> Vec<Value> {
        let mut rows = Vec::new();
        for round in [None, Some(0)] {
            rows.push(row("viscera, automatic", OURS[0], round, 2, 0.5, [0.02, 0.0]));
            rows.push(row("MuJoCo, implicit", "", round, 9, 30.0, [-0.049, 0.0]));
            rows.push(row("Pbat, XPBD", "substeps=20", round, 4, 5.0, [0.01, 0.2]));
        }
        rows.push(row("MuJoCo, implicit", "", None, 8, 20.0, [-0.06, 0.0]));
        rows.push(row("Newton, VBD", "", None, 3, 7.0, [0.5, 0.9]));
        rows.push(row("Newton, VBD", "", None, 2, 3.0, [-0.2, 0.4]));
        rows
    }

    #[test]
    fn the_best_peer_is_told_apart_from_the_luckiest() {
        let text = summary(&rows());
        let line = "| 0.500 | MuJoCo, implicit, of those that ran | 9 | 30.0 | **60.0** | 40 | Pbat, XPBD (substeps=20), 4 cells, of those that ran | 10.0 |";
        assert!(text.contains(line), "{text}");
        assert!(text.contains("| unstructured | none | none |"), "{text}");
    }

    #[test]
    fn sections_are_by_cost_and_name_what_gets_nowhere() {
        let text = section(&FILLINGS[0], &rows());
        let names = [
            "**viscera, automatic",
            "| Pbat, XPBD (substeps=20), errors cancel |",
            "| MuJoCo, implicit |",
            "| Newton, VBD, not within |",
        ];
        let places = names.map(|name| text.find(name));
        assert!(places.is_sorted() && places[0].is_some(), "{text}");
        assert!(
            text.contains("Not run on these bars: MuJoCo, explicit; Pbat, VBD; Newton, XPBD;"),
            "{text}"
        );
        assert!(text.contains("| 2 | 5 | -20.0 | +40.0 | 3.00 | - |"), "{text}");
        assert_eq!(text.matches("Pbat, XPBD").count(), 1, "{text}");
        assert!(text.contains("| 9 | 5 | -4.9 | +0.0 | 30.0 | 60.0 |"), "{text}");
    }

    #[test]
    fn curves_go_over_the_bars_of_what_is_within() {
        let data = curves(&FILLINGS[0], &rows());
        let names: Vec<&str> = data["series"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(|c| c["name"].as_str())
            .collect();
        let ours = "viscera, recovered (standard)";
        assert_eq!(names, [ours, "MuJoCo, implicit", "Pbat, XPBD", "Newton, VBD"]);
        let points = &data["series"][1]["points"];
        let costs: Vec<f64> =
            points.as_array().into_iter().flatten().filter_map(|p| p[0].as_f64()).collect();
        assert_eq!(costs, [20.0, 30.0]);
    }
}
