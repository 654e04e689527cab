//! `viscera.Tool`.

use crate::arrays::{pose, pose_array, row};
use crate::engine::{Engine, either};
use crate::fault::{Class, OrRaise, error};
use crate::simulation::Simulation;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use viscera::simulation::{LiveError, ToolForce, ToolState};

/// An instrument or a fixed obstacle of a simulation, from `Simulation.tool` or `Simulation.take_tool`. Setting its pose, its
/// opening or its lock takes it into the hand: the rest of the scene's keys for it no longer counts.
#[pyclass(frozen, module = "viscera")]
pub struct Tool {
    simulation: Py<Simulation>,
    number: usize,
    name: String,
}

impl Tool {
    /// Of the number of a tool in the simulation.
    pub fn of(simulation: Py<Simulation>, number: usize, name: String) -> Self {
        Self { simulation, number, name }
    }

    fn state(&self) -> PyResult<ToolState> {
        let tools = self.simulation.get().look(|engine| either!(engine, s => s.tools()))?;
        let state = tools.into_iter().nth(self.number).filter(|tool| tool.name == self.name);
        state.ok_or_else(|| {
            error(
                Class::Simulation,
                format!("tool `{}` is gone: the simulation was set back", self.name),
            )
        })
    }

    fn reported(&self) -> PyResult<ToolForce> {
        let forces = self.simulation.get().look(|engine| either!(engine, s => s.tool_forces()))?;
        let force = forces.into_iter().find(|tool| tool.name == self.name);
        force.ok_or_else(|| error(Class::Simulation, format!("tool `{}` is not there", self.name)))
    }

    fn act(&self, act: impl FnOnce(&mut Engine) -> Result<(), LiveError>) -> PyResult<()> {
        self.state()?;
        self.simulation.get().change_with(act)?.or_raise()
    }
}

#[pymethods]
impl Tool {
    /// Its name in the scene.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is in the scene in the frame to come.
    #[getter]
    fn is_there(&self) -> PyResult<bool> {
        Ok(self.state()?.is_there)
    }

    /// From its frame to the world, shape (4, 4). Set, it is where the tool is to be at the end of the next frame; it goes
    /// there steadily.
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pose_array(py, &self.state()?.pose)
    }

    #[setter]
    fn set_pose(&self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let pose = pose("a pose", value)?;
        self.act(|engine| either!(engine, s => s.move_tool(self.number, pose)))
    }

    /// The opening angle of its jaws [rad], None where it has none. Set, it is the angle at the end of the next frame.
    #[getter]
    fn opening(&self) -> PyResult<Option<f64>> {
        Ok(self.state()?.jaw_angle)
    }

    #[setter]
    fn set_opening(&self, angle: f64) -> PyResult<()> {
        self.act(|engine| either!(engine, s => s.open_jaws(self.number, angle)))
    }

    /// Whether what its jaws press on is tied to them in the frame to come.
    #[getter]
    fn locked(&self) -> PyResult<bool> {
        Ok(self.state()?.is_locked)
    }

    #[setter]
    fn set_locked(&self, locked: bool) -> PyResult<()> {
        self.act(|engine| either!(engine, s => s.lock_jaws(self.number, locked)))
    }

    /// Force [N] and torque [N m] about its origin of the tissue on the tool, shape (6,).
    #[getter]
    fn wrench<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let ToolForce { force, torque, .. } = self.reported()?;
        Ok(row(py, [force, torque].as_flattened()))
    }

    /// What force [N] and torque [N m] may be off by because substeps have a length and sweeps an end; None where the scene
    /// does not ask for it (`output.force_error`), as on a graphics processor where that is unset.
    #[getter]
    fn wrench_error(&self) -> PyResult<Option<(f64, f64)>> {
        let ToolForce { error, torque_error, .. } = self.reported()?;
        Ok(error.zip(torque_error))
    }

    /// Samples of tissue that it presses on.
    #[getter]
    fn touches(&self) -> PyResult<u32> {
        Ok(self.reported()?.touches)
    }

    /// Takes it out of the scene from the next frame on: what it held is free.
    fn put_away(&self) -> PyResult<()> {
        self.act(|engine| either!(engine, s => s.put_away(self.number)))
    }

    fn __repr__(&self) -> String {
        match (self.state(), self.reported()) {
            (Ok(state), Ok(force)) if state.is_there => {
                let [x, y, z] = force.force;
                format!("<viscera.Tool {}: {:.4} N>", self.name, x.hypot(y).hypot(z))
            }
            _ => format!("<viscera.Tool {}: not there>", self.name),
        }
    }
}
