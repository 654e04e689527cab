//! `viscera.Hold`.

use crate::arrays::{row, vector};
use crate::engine::either;
use crate::fault::{Class, OrRaise, error};
use crate::simulation::Simulation;
use numpy::PyArray1;
use pyo3::prelude::*;
use viscera::simulation::Hold as Held;

/// A patch of tissue in a hand, from `Simulation.take_hold`. In a `with` block it is let go at the end.
#[pyclass(frozen, module = "viscera")]
pub struct Hold {
    simulation: Py<Simulation>,
    motion: usize,
    /// How often the simulation had been set back when it was taken.
    age: u64,
}

impl Hold {
    /// Of a motion of a simulation.
    pub fn of(simulation: Py<Simulation>, motion: usize, age: u64) -> Self {
        Self { simulation, motion, age }
    }

    fn simulation(&self) -> PyResult<&Simulation> {
        let simulation = self.simulation.get();
        if simulation.age() != self.age {
            let message =
                "the simulation was set back after this hold was taken; take hold once more";
            return Err(error(Class::Simulation, message));
        }
        Ok(simulation)
    }

    fn held(&self) -> PyResult<Held> {
        let held = self.simulation()?.look(|engine| either!(engine, s => s.hold(self.motion)))?;
        held.ok_or_else(|| error(Class::Simulation, "this hold was let go"))
    }
}

#[pymethods]
impl Hold {
    /// Where it is to be at the end of the next frame, from where it was taken [m], shape (3,); it goes there steadily.
    fn lead(&self, translation: &Bound<'_, PyAny>) -> PyResult<()> {
        let translation = vector("a translation [m]", translation)?;
        let lead = |engine: &mut _| either!(engine, s => s.lead(self.motion, translation));
        self.simulation()?.change_with(lead)?.or_raise()
    }

    /// Its force on the tissue [N], shape (3,): of a rigid hold as last measured.
    #[getter]
    fn force<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(row(py, &self.held()?.force.to_array()))
    }

    /// The middle of the patch [m], shape (3,).
    #[getter]
    fn place<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(row(py, &self.held()?.place.to_array()))
    }

    /// Where that is to be [m], shape (3,).
    #[getter]
    fn target<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(row(py, &self.held()?.target.to_array()))
    }

    /// Lets go, from the next frame on.
    fn let_go(&self) -> PyResult<()> {
        let let_go = |engine: &mut _| either!(engine, s => s.let_go(self.motion));
        self.simulation()?.change_with(let_go)?.or_raise()
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __exit__(
        &self,
        _kind: &Bound<'_, PyAny>,
        _error: &Bound<'_, PyAny>,
        _trace: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        // It may have been let go in the block.
        let _ = self.let_go();
        Ok(())
    }

    fn __repr__(&self) -> String {
        match self.held() {
            Ok(held) => format!("<viscera.Hold: {:.4} N>", held.force.length()),
            Err(_) => "<viscera.Hold: let go>".to_owned(),
        }
    }
}
