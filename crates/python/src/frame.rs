//! `viscera.Frame`.

use crate::arrays::row;
use crate::fault::{Class, error};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use viscera::scalar::Real;
use viscera::simulation::{FrameReport, PatchForce, Simulation, TieForce, ToolForce};

/// The numbers of one frame.
#[pyclass(frozen, module = "viscera")]
pub struct Frame {
    report: FrameReport,
}

impl Frame {
    /// Of a report.
    pub fn of(report: FrameReport) -> Self {
        Self { report }
    }
}

/// The force on the tissue [N] of a patch or a tool, or where it is tied, as a simulation has last measured it.
pub fn force_now<S: Real>(simulation: &Simulation<S>, name: &str) -> PyResult<[f64; 3]> {
    let patch = of_patch(&simulation.patch_forces(), name);
    let tool = || of_tool(&simulation.tool_forces(), name);
    let found = patch.or_else(tool).or_else(|| of_tie(&simulation.tie_forces(), name));
    // All names are in the report.
    found.map_or_else(|| force_on_tissue(&simulation.report(), name), Ok)
}

fn of_patch(patches: &[PatchForce], name: &str) -> Option<[f64; 3]> {
    patches.iter().find(|patch| patch.name == name).map(|patch| patch.force)
}

/// Minus the force of the tissue on the tool.
fn of_tool(tools: &[ToolForce], name: &str) -> Option<[f64; 3]> {
    tools.iter().find(|tool| tool.name == name).map(|tool| tool.force.map(|f| 0.0 - f))
}

fn of_tie(ties: &[TieForce], name: &str) -> Option<[f64; 3]> {
    ties.iter().find(|tie| tie.name == name).map(|tie| tie.force)
}

fn force_on_tissue(report: &FrameReport, name: &str) -> PyResult<[f64; 3]> {
    let FrameReport { patches, tools, ties, .. } = report;
    let found = of_patch(patches, name).or_else(|| of_tool(tools, name));
    found.or_else(|| of_tie(ties, name)).ok_or_else(|| {
        let known = names(report).join(", ");
        let known = if known.is_empty() { "none".to_owned() } else { known };
        let what = "fixing, motion, force, tool or tie";
        error(
            Class::UnknownKey,
            format!("the scene has no {what} named `{name}`; there are: {known}"),
        )
    })
}

fn names(report: &FrameReport) -> Vec<&str> {
    let patches = report.patches.iter().map(|patch| patch.name.as_str());
    let tools = report.tools.iter().map(|tool| tool.name.as_str());
    patches.chain(tools).chain(report.ties.iter().map(|tie| tie.name.as_str())).collect()
}

#[pymethods]
impl Frame {
    /// Frames computed so far.
    #[getter]
    fn number(&self) -> u64 {
        self.report.frame
    }

    /// Simulated time [s].
    #[getter]
    fn time(&self) -> f64 {
        self.report.time
    }

    /// Sum of unbalanced forces on free vertices over the sum of all loads.
    #[getter]
    fn residual(&self) -> f64 {
        self.report.relative_residual
    }

    /// Estimate of the error of the apparent stiffness.
    #[getter]
    fn stiffness_error(&self) -> f64 {
        self.report.stiffness_error
    }

    /// Energies [J]: elastic, kinetic, gravitational.
    #[getter]
    fn energy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let energies = PyDict::new(py);
        let energy = &self.report.energy;
        energies.set_item("elastic", energy.elastic)?;
        energies.set_item("kinetic", energy.kinetic)?;
        energies.set_item("gravitational", energy.gravitational)?;
        Ok(energies)
    }

    /// Tetrahedra that are turned inside out.
    #[getter]
    fn inverted(&self) -> usize {
        self.report.deformation.inverted
    }

    /// Present volume over rest volume.
    #[getter]
    fn volume_ratio(&self) -> f64 {
        self.report.deformation.volume_ratio
    }

    /// Largest and smallest principal stretch.
    #[getter]
    fn stretch(&self) -> (f64, f64) {
        (self.report.deformation.largest_stretch, self.report.deformation.smallest_stretch)
    }

    /// Substeps of this frame.
    #[getter]
    fn substeps(&self) -> u32 {
        self.report.divided
    }

    /// Substeps so far that were rejected.
    #[getter]
    fn rejected(&self) -> u64 {
        self.report.rejected_substeps
    }

    /// Forces on the tissue [N] by the name of what holds, moves, pulls, touches or ties it, each of shape (3,).
    #[getter]
    fn forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let forces = PyDict::new(py);
        for name in names(&self.report) {
            forces.set_item(name, self.force(py, name)?)?;
        }
        Ok(forces)
    }

    /// The force on the tissue [N], shape (3,), of what has this name.
    fn force<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(row(py, &force_on_tissue(&self.report, name)?))
    }

    fn __repr__(&self) -> String {
        let report = &self.report;
        let mut text = format!(
            "<viscera.Frame {} at {:.4} s: residual {:.1e}, {} inverted",
            report.frame, report.time, report.relative_residual, report.deformation.inverted
        );
        for name in names(report) {
            if let Ok([x, y, z]) = force_on_tissue(report, name) {
                text.push_str(&format!("; {name} {:.4} N", x.hypot(y).hypot(z)));
            }
        }
        text + ">"
    }
}
