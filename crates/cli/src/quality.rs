//! What to do about bad meshes.

use serde::Serialize;
use std::path::Path;
use viscera::mesh::verdict::Problem;
use viscera_resources::files::word;

/// What is to be thought of a mesh, and what to do next.
#[derive(Debug, Serialize)]
pub struct Verdict {
    /// Whether it can be simulated as it is, without anything that is wrong.
    pub good: bool,
    /// What is wrong.
    pub problems: Vec<String>,
    /// Commands.
    pub next: Vec<String>,
}

impl Verdict {
    /// Of a file that is read with a unit [m], where one was given.
    pub fn new(file: &Path, unit: Option<&str>, is_surface: bool, problems: &[Problem]) -> Self {
        let name = word(&file.display().to_string());
        let unit = unit.map_or_else(String::new, |unit| format!(" --unit \"{unit}\""));
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let ending = if is_surface { "obj" } else { "vtu" };
        let to = |what: &str| word(&format!("{stem}_{what}.{ending}"));
        let mut next = Vec::new();
        let is_shape = |problem: &Problem| {
            matches!(
                problem,
                Problem::Folded { .. } | Problem::Slivers { .. } | Problem::Open { .. }
            )
        };
        if problems.iter().any(is_shape) {
            next.push(format!("viscera mesh repair {name} {}{unit}", to("repaired")));
        }
        if problems.iter().any(|problem| matches!(problem, Problem::Parts { .. })) {
            let part = word(&format!("{stem}_0.vtu"));
            next.push(format!("viscera mesh convert {name} {part} --component 0{unit}"));
        }
        // Meshes with slivers can be simulated all the same, and holes are closed on the way.
        let is_usable = !problems.iter().any(|problem| matches!(problem, Problem::Folded { .. }));
        if is_usable {
            next.push(match unit.is_empty() {
                true => format!("viscera run {name}"),
                false => format!("viscera scene new {name}{unit}"),
            });
        }
        let texts = problems.iter().map(ToString::to_string).collect();
        Self { good: problems.is_empty(), problems: texts, next }
    }

    /// Without the command that was just carried out.
    pub fn without_repair(mut self) -> Self {
        self.next.retain(|command| !command.starts_with("viscera mesh repair"));
        self
    }

    /// Rows of a table.
    pub fn text(&self, is_surface: bool) -> String {
        let ready = match is_surface {
            true => "can be filled and simulated as it is",
            false => "can be simulated as it is",
        };
        let problems: Vec<&str> = match self.good {
            true => vec![ready],
            false => self.problems.iter().map(String::as_str).collect(),
        };
        let rows = |what: &str, lines: &[&str]| -> String {
            let heads = std::iter::once(what).chain(std::iter::repeat(""));
            lines.iter().zip(heads).map(|(line, head)| format!("{head:<18} {line}\n")).collect()
        };
        let next: Vec<&str> = self.next.iter().map(String::as_str).collect();
        rows("verdict", &problems) + &rows("next", &next)
    }
}
