//! What a run prints: what is computed and by what, and how it ended.

use anyhow::{Context, Result};
use viscera::scalar::Real;
use viscera::settings::{Elements, Method};
use viscera::simulation::{ExpectedErrors, Simulation};
use viscera_report::si;

use crate::output::OutputFolder;
use crate::summary::Summary;

/// What a run prints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Words {
    /// What is computed, some frames, and how it ended.
    Table,
    /// The same with every frame.
    EveryFrame,
    /// The summary as JSON.
    Json,
}

/// What is computed, and by what.
pub fn heading<S: Real>(simulation: &Simulation<S>, summary: &Summary, frames: u64) -> String {
    let model = &summary.model;
    let solver = simulation.solver();
    let work = match solver.method {
        Method::Xpbd => format!(" x {} iterations", solver.iterations()),
        Method::Auto | Method::QuasiNewton => {
            format!(" x {} passes per solve", simulation.iterations())
        }
        Method::Explicit => {
            let small = format!("{:.2e} s", simulation.stable_step());
            format!(", divided into small steps of at most {small}")
        }
    };
    // The others need no colours.
    let colors = match solver.method {
        Method::Auto | Method::QuasiNewton | Method::Explicit => String::new(),
        Method::Xpbd => format!(" colours: {},", model.colors),
    };
    let from = match simulation.frame() {
        0 => String::new(),
        frame => format!(" from {} on", frame + 1),
    };
    format!(
        "{}: {} tetrahedra, {} vertices, {},{colors} frames: {frames}{from} of {} substeps{work}\n\
         {}device: {}\n",
        summary.title,
        model.tets,
        model.vertices,
        si(1e3 * model.mass, "g"),
        simulation.substeps(),
        method_line(simulation),
        summary.device,
    )
}

/// The method, and the errors that it leads one to expect.
fn method_line<S: Real>(simulation: &Simulation<S>) -> String {
    let (solver, asked) = (simulation.solver(), &simulation.scene().solver);
    let how = match (asked.method, solver.method) {
        (Method::Auto, _) => format!(", chosen for accuracy {}", asked.accuracy),
        _ => String::new(),
    };
    let ExpectedErrors { motion, at_rest } = simulation.expected_errors();
    let motion = match motion {
        Some(share) => format!("motion within about {} %", rounded(100.0 * share)),
        None => "motion damped by an amount that is not foretold".to_owned(),
    };
    let at_rest = rounded(100.0 * at_rest);
    let tetrahedra = match solver.elements {
        Elements::Recovered => "recovered-gradient",
        Elements::Auto | Elements::Plain => "linear, which bend too little where a mesh is coarse",
    };
    format!(
        "method: {}{how}; expected errors of the solver: {motion}, at rest within {at_rest} %\n\
         tetrahedra: {tetrahedra}\n",
        solver.method
    )
}

/// Two digits at most.
fn rounded(percent: f64) -> String {
    if percent < 10.0 { format!("{percent:.1}") } else { format!("{percent:.0}") }
}

/// What is printed at the end.
pub fn last_words(summary: &Summary, words: Words, out: &OutputFolder) -> Result<String> {
    let mut text = match words {
        Words::Json => return Ok(json(summary)? + "\n"),
        Words::EveryFrame => summary.end(),
        Words::Table => summary.table(),
    };
    for warning in &summary.warnings {
        text.push_str(&format!("warning: {warning}\n"));
    }
    Ok(format!("{text}results: {}\n", out.path().display()))
}

/// What summary.json has.
pub fn json(summary: &Summary) -> Result<String> {
    serde_json::to_string_pretty(summary).context("cannot write summary.json")
}
