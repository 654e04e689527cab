//! `summary.json`, and the table and advice printed at the end of a run.

use crate::hold::HoldReport;
use serde::Serialize;
use std::collections::BTreeMap;
use viscera::scalar::Real;
use viscera::scene::Scene;
use viscera::simulation::{FrameReport, MeshReport, RestReport, Simulation, advice};
use viscera_report::si;

/// The numbers of one frame and what it took.
#[derive(Serialize)]
pub struct FrameLine {
    #[serde(flatten)]
    pub report: FrameReport,
    /// Time it took to compute [s].
    pub wall_seconds: f64,
}

/// What was simulated.
#[derive(Serialize)]
pub struct ModelSummary {
    pub bodies: usize,
    pub vertices: usize,
    pub tets: usize,
    /// Mass of all vertices [kg].
    pub mass: f64,
    pub colors: usize,
    /// The most constraints at one vertex.
    pub largest_clique: usize,
    /// Copies of vertices that a sweep works on; as many as vertices where nothing is split.
    pub copies: usize,
    pub springs: usize,
    pub attachments: usize,
}

/// The content of `summary.json`. Units are SI throughout.
#[derive(Serialize)]
pub struct Summary {
    pub viscera: &'static str,
    pub scene: String,
    pub title: String,
    /// False where the run was interrupted or failed.
    pub finished: bool,
    /// Why the run ended early.
    pub stopped: Option<String>,
    pub frame_seconds: f64,
    pub velocity_factor: f64,
    pub gravity: [f64; 3],
    /// What the command line put over the scene file.
    pub overrides: BTreeMap<String, String>,
    /// What computed the steps, and why.
    pub device: String,
    /// Solver settings, as a scene file would have them; automatic counts are the numbers they came to. `method` and
    /// `elements` are those in force, `asked_method` and `asked_elements` what the scene has: "auto" chose.
    pub solver: BTreeMap<&'static str, serde_json::Value>,
    /// Material of each body and region.
    pub materials: BTreeMap<String, String>,
    pub model: ModelSummary,
    /// What was repaired and what to know.
    pub notes: Vec<String>,
    /// Where the result falls short.
    pub warnings: Vec<String>,
    /// How far the end is from the state of rest; nothing where the loads still change.
    pub rest: Option<RestReport>,
    /// Whether tissue holds still on its tools; nothing where there are none, and where one moved in the last moments.
    pub hold: Option<HoldReport>,
    /// How far the mesh is from the body that it stands for; nothing of large meshes, and where nothing is held.
    pub mesh: Option<MeshReport>,
    #[serde(flatten)]
    pub frames: Frames,
}

/// Frames that are kept at most, 2.6 MB of `summary.json`: of longer runs every second, every fourth ... and the
/// last.
const MOST_FRAMES: usize = 2000;

/// The frames of a run, thinned as it grows.
#[derive(Serialize)]
pub struct Frames {
    /// Of so many frames one is kept.
    frame_interval: u64,
    #[serde(rename = "frames")]
    lines: Vec<FrameLine>,
    /// Time that all of them took [s].
    wall_seconds: f64,
    /// The most tetrahedra that were inverted in any of them.
    most_inverted: usize,
}

impl Default for Frames {
    fn default() -> Self {
        Self { frame_interval: 1, lines: Vec::new(), wall_seconds: 0.0, most_inverted: 0 }
    }
}

impl Frames {
    /// The next frame.
    pub fn push(&mut self, line: FrameLine) {
        self.wall_seconds += line.wall_seconds;
        self.most_inverted = self.most_inverted.max(line.report.deformation.inverted);
        let is_kept =
            |interval: u64| move |line: &FrameLine| line.report.frame.is_multiple_of(interval);
        if self.lines.last().is_some_and(|last| !is_kept(self.frame_interval)(last)) {
            self.lines.pop();
        }
        if self.lines.len() == MOST_FRAMES {
            self.frame_interval *= 2;
            self.lines.retain(is_kept(self.frame_interval));
        }
        self.lines.push(line);
    }

    /// How many frames were computed.
    pub fn computed(&self) -> u64 {
        self.lines.last().map_or(0, |last| last.report.frame)
    }
}

/// Heads of [`frame_row`].
pub const ROW_HEADS: &str =
    "    time     elastic     kinetic    volume   stretch  inverted  residual\n";

/// A frame as a line of a table.
pub fn frame_row(report: &FrameReport) -> String {
    format!(
        "{:>6.3} s {:>11} {:>11} {:>8.2}% {:>9.3} {:>9} {:>9.1e}\n",
        report.time,
        si(report.energy.elastic, "J"),
        si(report.energy.kinetic, "J"),
        100.0 * report.deformation.volume_ratio,
        report.deformation.largest_stretch,
        report.deformation.inverted,
        report.relative_residual,
    )
}

impl Summary {
    /// Before the first frame.
    pub fn new<S: Real>(simulation: &Simulation<S>, overrides: Vec<(String, String)>) -> Self {
        let layout = simulation.layout();
        let (scene, model) = (simulation.scene(), simulation.model());
        Self {
            viscera: env!("CARGO_PKG_VERSION"),
            scene: scene.name.clone(),
            title: scene.title.clone(),
            finished: false,
            stopped: None,
            frame_seconds: scene.time.frame,
            velocity_factor: scene.time.velocity_factor,
            gravity: scene.world.gravity.to_array(),
            overrides: overrides.into_iter().collect(),
            device: simulation.device_choice().to_owned(),
            solver: solver_record(simulation),
            materials: materials(scene),
            model: ModelSummary {
                bodies: model.bodies.len(),
                vertices: model.vertex_count(),
                tets: model.tet_count(),
                mass: model.masses.iter().map(|m| m.to_f64()).sum(),
                colors: layout.color_count,
                largest_clique: layout.largest_clique,
                copies: layout.copy_count(),
                springs: model.elements.springs.len(),
                attachments: model.elements.attachments.len(),
            },
            notes: simulation.assembly().notes.clone(),
            warnings: Vec::new(),
            rest: None,
            hold: None,
            mesh: None,
            frames: Frames::default(),
        }
    }

    /// Looks for what a person must know before believing the result.
    pub fn judge<S: Real>(
        &mut self,
        simulation: &Simulation<S>,
        rest: Option<RestReport>,
        mesh: Option<MeshReport>,
    ) {
        (self.rest, self.mesh) = (rest, mesh);
        self.warnings = warnings(&self.frames, &simulation.scene_in_force(), rest);
        self.warnings.extend(advice::plain_elements(simulation.scene()));
    }

    /// Wall time of all frames [s].
    pub fn wall_seconds(&self) -> f64 {
        self.frames.wall_seconds
    }

    /// A short table of the run: some frames, and how it ended.
    pub fn table(&self) -> String {
        let mut text = String::from(ROW_HEADS);
        let lines = &self.frames.lines;
        let count = lines.len();
        let rows = 6.min(count);
        let mut shown = usize::MAX;
        for row in 1..=rows {
            let index = (row * count).div_ceil(rows) - 1;
            if index == shown {
                continue;
            }
            shown = index;
            text.push_str(&frame_row(&lines[index].report));
        }
        text + &self.end()
    }

    /// How the run ended.
    pub fn end(&self) -> String {
        let mut text = String::new();
        let lines = &self.frames.lines;
        if let Some(last) = lines.last() {
            for patch in &last.report.patches {
                text.push_str(&format!("{patch:.4}\n"));
            }
            for tool in &last.report.tools {
                text.push_str(&format!("{tool:.4}\n"));
            }
            for tie in &last.report.ties {
                text.push_str(&format!("{tie:.4}\n"));
            }
            if let Some(hold) = &self.hold {
                text.push_str(&format!("{hold}\n"));
            }
            let (time, wall) = (last.report.time, self.wall_seconds());
            text.push_str(&format!(
                "{time:.2} s simulated in {wall:.2} s: {:.2} x real time, {:.2} ms per frame\n",
                time / wall,
                1e3 * wall / last.report.frame as f64
            ));
        }
        if let Some(mesh) = &self.mesh {
            text.push_str(&format!("{mesh}\n"));
        }
        text
    }
}

fn materials(scene: &Scene) -> BTreeMap<String, String> {
    let mut materials = BTreeMap::new();
    for body in &scene.bodies {
        materials.insert(body.name.clone(), body.material.to_string());
        for region in &body.regions {
            let name = format!("{}, region {}", body.name, region.label);
            materials.insert(name, region.material.to_string());
        }
    }
    materials
}

/// A setting as a scene file writes it is JSON as well: a number, a truth value or a quoted word.
/// Counts are those that are in force.
fn solver_record<S: Real>(simulation: &Simulation<S>) -> BTreeMap<&'static str, serde_json::Value> {
    let values = simulation.scene().solver.values().into_iter();
    let mut record: BTreeMap<_, _> = values.map(|(key, text)| (key, json(text))).collect();
    record.insert("asked_method", simulation.scene().solver.method.to_string().into());
    record.insert("method", simulation.solver().method.to_string().into());
    record.insert("asked_elements", simulation.scene().solver.elements.to_string().into());
    record.insert("elements", simulation.solver().elements.to_string().into());
    record.insert("substeps", simulation.substeps().into());
    record.insert("iterations", simulation.iterations().into());
    record
}

fn json(text: String) -> serde_json::Value {
    serde_json::from_str(&text).unwrap_or(serde_json::Value::String(text))
}

/// Of a run whose loads change to its end, which has no state of rest to be compared with: apparent stiffness
/// further off than this is not what was asked for.
const STIFFNESS_ERROR: f64 = 0.02;

/// Unbalanced forces beyond this share of the loads: forces and shapes are then a few percent off
/// even where the estimate of the stiffness, which sees smooth errors only, looks well.
const RESIDUAL: f64 = 0.1;

/// Fewer frames than these are the first jerk of a run, in which multipliers are still building up.
const FEWEST_FRAMES: usize = 5;

fn warnings(frames: &Frames, scene: &Scene, rest: Option<RestReport>) -> Vec<String> {
    let mut warnings = Vec::new();
    let inverted = frames.most_inverted;
    let frames = &frames.lines[..];
    let time = frames.last().map_or(0.0, |frame| frame.report.time);
    match rest {
        Some(rest) => warnings.extend(rest.warning(scene, time)),
        None => warnings.extend(warning_in_motion(frames, scene)),
    }
    let left = frames.last().map_or(0, |frame| frame.report.deformation.inverted);
    if inverted > 0 {
        let what = if inverted == 1 { "tetrahedron was" } else { "tetrahedra were" };
        warnings.push(format!(
            "up to {inverted} {what} inverted during the run, {left} at its end; {}",
            advice::inverted(scene)
        ));
    }
    warnings
}

/// Whether steps were solved too coarsely.
fn warning_in_motion(frames: &[FrameLine], scene: &Scene) -> Option<String> {
    // The last quarter: a single frame of a moving body says little.
    let tail = &frames[frames.len() - frames.len().div_ceil(4)..];
    let mean = |value: fn(&FrameReport) -> f64| {
        tail.iter().map(|frame| value(&frame.report)).sum::<f64>() / tail.len().max(1) as f64
    };
    let stiffness = mean(|report| report.stiffness_error);
    let residual = mean(|report| report.relative_residual);
    let is_off = stiffness.abs() > STIFFNESS_ERROR || residual > RESIDUAL;
    (tail.len() >= FEWEST_FRAMES && is_off).then(|| {
        let how = if stiffness > 0.0 { "softer" } else { "stiffer" };
        let percent = 100.0 * stiffness.abs();
        // Unstrained tissue has none.
        let answer = match stiffness {
            0.0 => String::new(),
            _ => format!("the tissue answers as if it were about {percent:.1} % {how} than asked for, and "),
        };
        format!(
            "the solver falls short: over the last {} frames, in motion, {answer}unbalanced forces are {:.0} % of \
             the loads; {}",
            tail.len(),
            100.0 * residual,
            advice::budget(scene),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::measure::{Energies, summarize_deformation};

    fn line(frame: u64, inverted: usize) -> FrameLine {
        let mut deformation = summarize_deformation(&[]);
        deformation.inverted = inverted;
        let report = FrameReport {
            frame,
            time: frame as f64 / 60.0,
            relative_residual: 0.0,
            stiffness_error: 0.0,
            rejected_substeps: 0,
            energy: Energies::default(),
            deformation,
            patches: Vec::new(),
            divided: 1,
            tools: Vec::new(),
            ties: Vec::new(),
        };
        FrameLine { report, wall_seconds: 0.5 }
    }

    /// Ten minutes: even, from the beginning to the last frame, within bounds, and nothing is lost of sums and
    /// extremes.
    #[test]
    fn long_runs_keep_frames_at_an_interval_that_doubles() {
        let mut frames = Frames::default();
        for frame in 1..=36_007 {
            frames.push(line(frame, usize::from(frame == 17) * 3));
            assert!(frames.lines.len() <= MOST_FRAMES && frames.computed() == frame);
            assert!(frame > MOST_FRAMES as u64 || frames.lines.len() as u64 == frame);
        }
        assert_eq!((frames.frame_interval, frames.most_inverted), (32, 3));
        assert_eq!(frames.wall_seconds, 0.5 * 36_007.0);
        let kept: Vec<u64> = frames.lines.iter().map(|line| line.report.frame).collect();
        let (last, even) = kept.split_last().expect("frames");
        assert_eq!(*last, 36_007);
        assert!(even.iter().zip(1..).all(|(&frame, nth)| frame == 32 * nth), "{even:?}");
    }
}
