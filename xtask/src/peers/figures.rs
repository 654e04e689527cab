//! Time to accuracy: cost of a frame against error, a curve of each method. `viscera bench-plot` draws.

use super::environment::Environment;
use super::plan::{METHODS, Method};
use super::results::{self, Entry};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

/// Errors above this [%] are left out: the settings do not fit the scene.
const MOST: f64 = 200.0;

/// Errors below this [%] are drawn here: nobody sees the difference.
pub const LEAST: f64 = 1e-4;

/// A figure, and where it belongs.
pub struct Figure {
    /// A or B.
    pub scene: &'static str,
    /// Of the mesh.
    pub size: String,
    /// For those who do not see it.
    pub words: String,
    /// From the document.
    pub link: String,
}

/// Writes all figures to the folder beside the document that has its name.
pub fn write(environment: &Environment, document: &Path) -> Result<Vec<Figure>, String> {
    let read = |name: &str| results::read(&environment.results().join(name));
    let (settled, motion) = (read("settled.jsonl")?, read("motion.jsonl")?);
    let folder = document.with_extension("");
    std::fs::create_dir_all(&folder)
        .map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    let mut figures = Vec::new();
    for size in results::sizes(&settled) {
        for scene in ["A", "B"] {
            let entries = Entry::all(&settled, &motion, scene, &size);
            for name in ["rest", "motion"] {
                let data = data(scene, &size, name, &entries);
                if data["series"].as_array().is_none_or(Vec::is_empty) {
                    continue;
                }
                let file = format!("{}-{size}-{name}.svg", scene.to_lowercase());
                draw(environment, &data, &folder.join(&file))?;
                let stem = folder.file_name().unwrap_or_default().to_string_lossy();
                figures.push(Figure {
                    scene,
                    size: size.clone(),
                    words: data["title"].as_str().unwrap_or_default().to_owned(),
                    link: format!("{stem}/{file}"),
                });
            }
        }
    }
    Ok(figures)
}

fn data(scene: &str, size: &str, name: &str, entries: &[Entry<'_>]) -> Value {
    let error = |entry: &Entry<'_>| match name {
        "rest" => entry.judged_rest(),
        _ => entry.judged_motion(),
    };
    let curve = |method: &Method| {
        let mut points: Vec<[f64; 2]> = entries
            .iter()
            .filter(|entry| entry.peer == method.label && entry.trouble().is_none())
            .filter_map(|entry| Some([entry.cost()?, (100.0 * error(entry)?).max(LEAST)]))
            .filter(|[_, error]| *error <= MOST)
            .collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        json!({ "name": method.label, "points": points })
    };
    let curves = METHODS.iter().map(curve);
    let curves: Vec<Value> =
        curves.filter(|curve| curve["points"].as_array().is_some_and(|p| !p.is_empty())).collect();
    let of = if name == "rest" { "at rest" } else { "in motion" };
    json!({
        "title": format!("Scene {scene}, size {size}: cost of a frame and error {of}"),
        "x": "CPU time per frame [ms]",
        "y": format!("error {of} [%]"),
        "series": curves,
    })
}

/// Draws curves to a file.
pub fn draw(environment: &Environment, data: &Value, file: &Path) -> Result<(), String> {
    let source = environment.results().join("figure.json");
    super::write_whole(&source, &data.to_string())?;
    let mut command = Command::new(&environment.program);
    command.args(["bench-plot", "--data"]).arg(source).arg("--out").arg(file);
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("viscera bench-plot failed ({status})")),
        Err(error) => Err(format!(
            "{}: {error}; build it: cargo build --release --package viscera-cli",
            environment.program.display()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_goes_from_cheap_to_dear_and_leaves_out_what_failed() {
        let row = |substeps: u32, cost: f64, error: f64, status: &str| {
            json!({ "scene": "A", "size": "s", "peer": "MuJoCo, implicit", "round": 0,
                    "cfg_asked": { "substeps": substeps }, "cpu_ms": cost, "err_own_rms": error,
                    "status": status })
        };
        let rows = [
            row(4, 8.0, 1e-3, "ok"),
            row(1, 2.0, 0.0, "ok"),
            row(2, 4.0, 9.0, "ok"),
            row(9, 9.0, 1e-3, "diverged"),
        ];
        let entries = Entry::all(&rows, &[], "A", "s");
        let data = data("A", "s", "rest", &entries);
        assert_eq!(
            data["series"],
            json!([{ "name": "MuJoCo, implicit", "points": [[2.0, LEAST], [8.0, 0.1]] }])
        );
    }
}
