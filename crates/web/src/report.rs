//! Reports for the page, as JSON.

use serde::Serialize;
use viscera::settings::{Acceleration, Elements, Method, SolverSettings};
use viscera::solver::Ledger;
use viscera_stage::{Run, RunSnapshot, ToolSnapshot};

/// What was loaded.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct LoadedReport {
    /// The scene's name.
    pub name: String,
    /// Its title.
    pub title: String,
    /// Tetrahedra of all bodies.
    pub tets: usize,
    /// Vertices of all bodies.
    pub vertices: usize,
    /// Duration of a frame [s].
    pub frame: f64,
    /// The bodies.
    pub bodies: Vec<BodyReport>,
    /// Factor of the element size.
    pub mesh: f64,
    /// Whether that can be changed.
    pub can_change_mesh: bool,
}

/// A body's tissue.
#[derive(Debug, Serialize)]
pub struct BodyReport {
    /// Its name.
    pub name: String,
    /// Young's modulus [Pa].
    pub young: f64,
    /// Poisson ratio.
    pub poisson: f64,
    /// [kg/m^3].
    pub density: f64,
    /// The preset with these numbers.
    pub preset: Option<&'static str>,
}

/// Numbers of now.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Simulated time [s].
    pub time: f64,
    /// Frames so far.
    pub frame: u64,
    /// Of each simulation.
    pub runs: Vec<RunReport>,
}

/// Numbers of one simulation.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct RunReport {
    /// What computes it, and why.
    pub device: String,
    /// Whether that is a graphics processor.
    pub on_gpu: bool,
    /// What a person should know of that.
    pub warning: Option<String>,
    /// The method in force.
    pub method: &'static str,
    /// XPBD's acceleration in force.
    pub acceleration: &'static str,
    /// The tetrahedra in force.
    pub elements: &'static str,
    /// Steps per frame.
    pub substeps: u32,
    /// Iterations per step, or per solve of it.
    pub iterations: u32,
    /// Unbalanced forces over loads; nothing before it was measured.
    pub residual: Option<f64>,
    /// Rejected steps.
    pub rejected: u64,
    /// Inverted tetrahedra.
    pub inverted: usize,
    /// What hands hold.
    pub held: Vec<HeldReport>,
    /// What the scene itself moves and pulls.
    pub patches: Vec<PatchReport>,
    /// Tools.
    pub tools: Vec<ToolReport>,
    /// What tools have put into the tissue; nothing where there are none.
    pub ledger: Option<LedgerReport>,
}

/// A hold.
#[derive(Debug, Serialize)]
pub struct HeldReport {
    /// The caller's number.
    pub id: u64,
    /// The middle of what is held [m].
    pub place: [f64; 3],
    /// Where it is led to [m].
    pub target: [f64; 3],
    /// Force on the tissue [N].
    pub force: [f64; 3],
}

/// A patch of the scene.
#[derive(Debug, Serialize)]
pub struct PatchReport {
    /// Its name.
    pub name: String,
    /// Force on the tissue [N].
    pub force: [f64; 3],
}

/// A tool, and what it meets.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct ToolReport {
    /// Its name.
    pub name: String,
    /// Its working end [m].
    pub place: [f64; 3],
    /// Force on the tissue [N].
    pub force: [f64; 3],
    /// What the force may be off by [N], where that is known.
    pub error: Option<f64>,
    /// The size of the torque about its working end [N m].
    pub torque: f64,
    /// Samples of tissue that it presses on.
    pub touches: u32,
    /// Opening angle of its jaws [rad], where it has some.
    pub jaw_angle: Option<f64>,
    /// Whether what it presses on is tied to it.
    pub is_locked: bool,
    /// Whether it was put elsewhere in the frame, further than a tool moves.
    pub has_jumped: bool,
}

impl ToolReport {
    fn new(tool: &ToolSnapshot) -> Self {
        Self {
            name: tool.met.name.clone(),
            place: tool.pose.translation.to_array(),
            force: tool.met.force.map(|component| -component),
            error: tool.met.error,
            torque: tool.torque(),
            touches: tool.met.touches,
            jaw_angle: tool.jaw_angle,
            is_locked: tool.is_locked(),
            has_jumped: tool.met.has_jumped,
        }
    }
}

/// Work and energy [J].
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct LedgerReport {
    /// Work of tools on tissue.
    pub work: f64,
    /// Energy that steps have made of nothing.
    pub surplus: f64,
    /// Stored now.
    pub stored: f64,
    /// The most that was ever stored.
    pub most_stored: f64,
}

impl LedgerReport {
    fn new(ledger: Ledger) -> Self {
        let Ledger { work, surplus, stored, most_stored } = ledger;
        Self { work, surplus, stored, most_stored }
    }
}

impl RunReport {
    /// Of a run and its newest snapshot; `measured` where its measures are of it.
    pub fn new(run: &dyn Run, snapshot: &RunSnapshot, measured: bool) -> Self {
        let (device, warning) = run.device();
        let SolverSettings { method, acceleration, elements, .. } = *run.solver();
        let measures = &snapshot.measures;
        let held = snapshot.held.iter().map(|hold| HeldReport {
            id: hold.id,
            place: hold.place.to_array(),
            target: hold.target.to_array(),
            force: hold.force.to_array(),
        });
        let patches = measures
            .scene_patches
            .iter()
            .map(|patch| PatchReport { name: patch.name.clone(), force: patch.force.to_array() });
        Self {
            device,
            on_gpu: run.is_on_device(),
            warning,
            method: method_name(method),
            acceleration: match (method, acceleration) {
                (Method::Xpbd, Acceleration::Chebyshev) => "chebyshev",
                (Method::Xpbd, Acceleration::Anderson) => "anderson",
                _ => "none",
            },
            elements: match elements {
                Elements::Recovered => "recovered",
                _ => "plain",
            },
            substeps: snapshot.counts[0],
            iterations: snapshot.counts[1],
            residual: Some(measures.residual).filter(|r| measured && r.is_finite()),
            rejected: measures.rejected,
            inverted: measures.inverted,
            held: held.collect(),
            patches: patches.collect(),
            tools: snapshot.tools.iter().map(ToolReport::new).collect(),
            ledger: snapshot.ledger.filter(|_| !snapshot.tools.is_empty()).map(LedgerReport::new),
        }
    }
}

fn method_name(method: Method) -> &'static str {
    match method {
        Method::Auto => "auto",
        Method::Xpbd => "xpbd",
        Method::Explicit => "explicit",
        Method::QuasiNewton => "quasi_newton",
    }
}
