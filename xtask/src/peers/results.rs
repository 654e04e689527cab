//! Result lines of the benchmark, and what is told of them.

use serde_json::Value;
use std::fs;
use std::path::Path;

/// One line of JSON as Python writes it: it knows NaN and Infinity, which JSON does not.
pub fn read_line(line: &str) -> Option<Value> {
    let line = line.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null");
    serde_json::from_str(&line).ok()
}

/// All lines of a file.
pub fn read(path: &Path) -> Result<Vec<Value>, String> {
    let text = fs::read_to_string(path)
        .map_err(|error| format!("{}: {error}; run without --again first", path.display()))?;
    let row = |(number, line): (usize, &str)| {
        read_line(line)
            .ok_or_else(|| format!("{}, line {}: this is no result", path.display(), number + 1))
    };
    text.lines().enumerate().map(row).collect()
}

/// A number that is there and finite.
pub fn number(row: &Value, key: &str) -> Option<f64> {
    row.get(key)?.as_f64()
}

/// CPU time of a frame [ms]: of a program of its own measured from outside, of a Python module
/// around its step.
pub fn cost(row: &Value) -> Option<f64> {
    number(row, "cpu_outside_ms").or_else(|| number(row, "cpu_ms"))
}

/// The middle of what there is.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        count if count % 2 == 1 => Some(values[middle]),
        _ => Some(0.5 * (values[middle - 1] + values[middle])),
    }
}

/// A simulator with its settings, in one scene at one size: all rounds of it.
pub struct Entry<'a> {
    /// Its name.
    pub peer: &'a str,
    /// What it was told, over its defaults.
    pub asked: &'a Value,
    /// To the state of rest, one per round.
    pub settled: Vec<&'a Value>,
    /// From rest, undamped, one per round.
    pub motion: Vec<&'a Value>,
}

impl<'a> Entry<'a> {
    /// Everything that ran in a scene at a size, in the order of the benchmark.
    pub fn all(settled: &'a [Value], motion: &'a [Value], scene: &str, size: &str) -> Vec<Self> {
        let mut entries: Vec<Self> = Vec::new();
        let rows = settled.iter().map(|row| (row, true));
        for (row, is_settled) in rows.chain(motion.iter().map(|row| (row, false))) {
            if row["scene"] != scene || row["size"] != size {
                continue;
            }
            let (peer, asked) = (row["peer"].as_str().unwrap_or("?"), &row["cfg_asked"]);
            let known = entries.iter().position(|e| e.peer == peer && e.asked == asked);
            let at = known.unwrap_or_else(|| {
                entries.push(Self { peer, asked, settled: Vec::new(), motion: Vec::new() });
                entries.len() - 1
            });
            let list = &mut entries[at];
            if is_settled { list.settled.push(row) } else { list.motion.push(row) }
        }
        entries
    }

    /// CPU time of a frame [ms], the median over rounds.
    pub fn cost(&self) -> Option<f64> {
        median(self.settled.iter().filter_map(|row| cost(row)).collect())
    }

    /// Cost over another's in the same round, the median over rounds.
    pub fn cost_over(&self, other: &Self) -> Option<f64> {
        let ratio = |row: &&Value| {
            let same = other.settled.iter().find(|o| o["round"] == row["round"])?;
            Some(cost(row)? / cost(same)?)
        };
        median(self.settled.iter().filter_map(ratio).collect())
    }

    /// Error at rest against the energy `own` or `stvk`; where a peer's own energy has no state of
    /// rest, against `stvk`.
    pub fn rest_error(&self, energy: &str) -> Option<f64> {
        median_of(&self.settled, &format!("err_{energy}_rms"))
    }

    /// Error in motion, likewise.
    pub fn motion_error(&self, energy: &str) -> Option<f64> {
        median_of(&self.motion, &format!("dyn_{energy}"))
    }

    /// Against its own energy; where that has no state of rest, against StVK.
    pub fn judged_rest(&self) -> Option<f64> {
        self.rest_error("own").or_else(|| self.rest_error("stvk"))
    }

    /// Likewise.
    pub fn judged_motion(&self) -> Option<f64> {
        self.motion_error("own").or_else(|| self.motion_error("stvk"))
    }

    /// Tetrahedra inside out at rest, of the positions that it returned: the most of all rounds.
    pub fn inverted(&self) -> Option<u64> {
        self.settled.iter().filter_map(|row| row["inverted"].as_u64()).max()
    }

    /// Whether it stands in tables, not only in plots.
    pub fn is_main(&self) -> bool {
        self.settled.iter().any(|row| row["is_main"] == true)
    }

    /// Of the first run that did not end well.
    pub fn trouble(&self) -> Option<&'a str> {
        let rows = self.settled.iter().chain(&self.motion);
        rows.filter_map(|row| row["status"].as_str()).find(|status| *status != "ok")
    }
}

/// The sizes that ran, from coarse to fine, organs last.
pub fn sizes(rows: &[Value]) -> Vec<String> {
    let mut sizes: Vec<String> =
        rows.iter().filter_map(|row| row["size"].as_str()).map(str::to_owned).collect();
    sizes.sort_by_key(|size| (super::plan::cells(size).unwrap_or(u32::MAX), size.clone()));
    sizes.dedup();
    sizes
}

/// Whether it is a method of this project.
pub fn is_ours(entry: &Entry<'_>) -> bool {
    entry.peer.starts_with("viscera")
}

fn median_of(rows: &[&Value], key: &str) -> Option<f64> {
    median(rows.iter().filter_map(|row| number(row, key)).collect())
}

/// Nanoseconds per tetrahedron and sweep of each round: the slope of CPU time over iterations.
pub fn sweep_costs(rows: &[Value], sweeper: &str, size: &str, sweeps: u32) -> Vec<(u64, f64)> {
    let of = |row: &&Value| row["sweeper"] == sweeper && row["size"] == size;
    let rows: Vec<&Value> = rows.iter().filter(of).filter(|row| row["status"] == "ok").collect();
    let mut costs = Vec::new();
    for few in &rows {
        let is_partner = |row: &&&Value| {
            row["round"] == few["round"] && number(row, "iterations") > number(few, "iterations")
        };
        let Some(many) = rows.iter().find(is_partner) else { continue };
        if let (Some(a), Some(b), Some(tets), Some(round)) =
            (cost(few), cost(many), number(few, "tets"), few["round"].as_u64())
        {
            costs.push((round, 1e6 * (b - a) / (f64::from(sweeps) * tets)));
        }
    }
    costs
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn lines_of_python_are_read() {
        let row = read_line(r#"{"cpu_ms": NaN, "wall_ms": -Infinity, "peer": "x"}"#);
        let row = row.unwrap_or_default();
        assert_eq!((cost(&row), row["peer"].as_str()), (None, Some("x")));
    }

    #[test]
    fn ratios_pair_what_ran_in_the_same_round() {
        let row = |peer: &str, round: u32, cost: f64| {
            json!({ "scene": "A", "size": "s", "peer": peer, "cfg_asked": {}, "round": round,
                    "cpu_ms": 0.0, "cpu_outside_ms": cost, "status": "ok" })
        };
        // The second round is loaded: both take three times as long.
        let rows = [row("a", 0, 2.0), row("b", 0, 1.0), row("b", 1, 3.0), row("a", 1, 6.0)];
        let entries = Entry::all(&rows, &[], "A", "s");
        assert_eq!(entries.len(), 2);
        assert_eq!(entries[0].cost_over(&entries[1]), Some(2.0));
        assert_eq!(entries[0].cost(), Some(4.0));
    }

    #[test]
    fn a_sweep_costs_the_slope_and_not_what_all_runs_share() {
        let row = |iterations: u32, cost: f64| {
            json!({ "sweeper": "a", "size": "m", "round": 0, "iterations": iterations,
                    "status": "ok", "tets": 1000, "cpu_ms": cost })
        };
        // 60 sweeps of 1000 tetrahedra in 6 ms, and 5 ms of other work.
        let costs = sweep_costs(&[row(2, 7.0), row(8, 13.0)], "a", "m", 60);
        assert_eq!(costs.len(), 1);
        assert!((costs[0].1 - 100.0).abs() < 1e-9, "{}", costs[0].1);
    }
}
