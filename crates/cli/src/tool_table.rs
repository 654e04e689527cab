//! `tools.csv`: the forces on tools over time.

use crate::output::OutputFolder;
use anyhow::Result;
use std::fmt::Write;
use viscera::simulation::FrameReport;

const FILE: &str = "tools.csv";

/// Columns of each tool. Force and torque are those of the tissue on the tool, the torque about the tool's origin.
const COLUMNS: [&str; 12] = [
    "fx [N]",
    "fy [N]",
    "fz [N]",
    "tx [N m]",
    "ty [N m]",
    "tz [N m]",
    "touches",
    "pinned",
    "depth [m]",
    "force error [N]",
    "torque error [N m]",
    "jumped",
];

/// A row per frame, and a group of columns per tool. Tools that come later have no numbers before.
#[derive(Default)]
pub struct ToolTable {
    /// Those of the last frame.
    names: Vec<String>,
    /// Each with the number of its tools.
    rows: Vec<(usize, String)>,
}

impl ToolTable {
    /// The next frame.
    pub fn push(&mut self, report: &FrameReport) {
        let mut text = report.time.to_string();
        for tool in &report.tools {
            // Writing to text does not fail.
            for number in tool.force.iter().chain(&tool.torque) {
                let _ = write!(text, ",{number}");
            }
            let _ = write!(text, ",{},{},{}", tool.touches, tool.pinned, tool.depth);
            // Empty where nobody asked for it.
            for error in [tool.error, tool.torque_error] {
                let error = error.map_or(String::new(), |error| error.to_string());
                let _ = write!(text, ",{error}");
            }
            let _ = write!(text, ",{}", u8::from(tool.has_jumped));
        }
        self.rows.push((report.tools.len(), text));
        // Hands may put all away again, and begin anew.
        if report.tools.len() >= self.names.len() {
            self.names = report.tools.iter().map(|tool| tool.name.clone()).collect();
        }
    }

    /// The table; nothing where there are no tools.
    fn text(&self) -> Option<String> {
        let columns = |name: &String| COLUMNS.map(|column| format!(",{name} {column}")).concat();
        let columns: String = self.names.iter().map(columns).collect();
        let row = |(tools, row): &(usize, String)| {
            let missing = self.names.len().saturating_sub(*tools) * COLUMNS.len();
            format!("{row}{}\n", ",".repeat(missing))
        };
        let rows: String = self.rows.iter().map(row).collect();
        (!self.names.is_empty()).then(|| format!("time [s]{columns}\n{rows}"))
    }

    /// Writes the table; where there is none, removes the one of an earlier run.
    pub fn write(&self, out: &OutputFolder) -> Result<()> {
        match self.text() {
            Some(text) => out.write(FILE, text.as_bytes()),
            None => out.remove(FILE),
        }
    }
}
