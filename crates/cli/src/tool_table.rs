//! `tools.csv`: the forces on tools over time.

use crate::output::OutputFolder;
use anyhow::Result;
use std::fmt::Write;
use viscera::scene::Instrument;
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

/// A row per frame, and a group of columns per tool.
pub struct ToolTable {
    /// Nothing where the scene has no tools.
    text: Option<String>,
}

impl ToolTable {
    /// Of a scene's tools, before the first frame.
    pub fn new(tools: &[Instrument]) -> Self {
        let columns = tools
            .iter()
            .flat_map(|tool| COLUMNS.map(|column| format!(",{} {column}", tool.name)))
            .collect::<String>();
        Self { text: (!tools.is_empty()).then(|| format!("time [s]{columns}\n")) }
    }

    /// The next frame.
    pub fn push(&mut self, report: &FrameReport) {
        let Some(text) = &mut self.text else { return };
        // Writing to text does not fail.
        let _ = write!(text, "{}", report.time);
        for tool in &report.tools {
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
        text.push('\n');
    }

    /// Writes the table; where there is none, removes the one of an earlier run.
    pub fn write(&self, out: &OutputFolder) -> Result<()> {
        match &self.text {
            Some(text) => out.write(FILE, text.as_bytes()),
            None => out.remove(FILE),
        }
    }
}
