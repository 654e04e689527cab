//! The numbers of a frame.

use super::force_text::wrench_text;
use super::instruments::ToolForce;
use super::ties::TieForce;
use crate::measure::{DeformationSummary, Energies};
use std::fmt;

/// What holds or pulls a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PatchKind {
    /// Held in place.
    Fixing,
    /// Moved along a path.
    Motion,
    /// Pulled with a force.
    Force,
}

/// The force on one patch.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PatchForce {
    /// The patch's name in the scene.
    pub name: String,
    /// What holds or pulls it.
    pub kind: PatchKind,
    /// Force [N] of the fixing, tool or load on the tissue: minus internal forces, plus inertia,
    /// minus gravity, summed over the patch. A vertex of several patches belongs to the one that it follows,
    /// the last, so that the forces of all patches of a body at rest sum to minus its weight.
    pub force: [f64; 3],
    /// Torque [N m] of the same about the middle of the patch.
    pub torque: [f64; 3],
}

impl fmt::Display for PatchForce {
    /// One line of a table, to four decimals unless a precision says otherwise.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(4);
        write!(f, "{}: {}", self.name, wrench_text(self.force, self.torque, [None; 2], digits))
    }
}

/// The numbers of one frame.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FrameReport {
    /// Frames computed so far.
    pub frame: u64,
    /// Simulated time [s].
    pub time: f64,
    /// Sum of unbalanced forces on free vertices over the sum of all loads, at the end of the
    /// last substep.
    pub relative_residual: f64,
    /// Estimate of the error of the apparent stiffness, see [`ForceBalance::stiffness_error`](crate::solver::balance::ForceBalance::stiffness_error).
    pub stiffness_error: f64,
    /// Substeps of this frame that the step guard took back.
    pub rejected_substeps: u64,
    /// Energies [J].
    pub energy: Energies,
    /// Extremes of the deformation.
    pub deformation: DeformationSummary,
    /// Forces on the scene's patches [N].
    pub patches: Vec<PatchForce>,
    /// Substeps of this frame: more than usual where a tool moves far in it.
    pub divided: u32,
    /// Forces on the scene's tools.
    pub tools: Vec<ToolForce>,
    /// What the scene's ties hold.
    pub ties: Vec<TieForce>,
}
