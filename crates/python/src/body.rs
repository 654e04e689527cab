//! `viscera.Body`.

use crate::arrays::{indices, vectors, view};
use crate::engine::either;
use crate::simulation::Simulation;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

type Vertices<'py> = Bound<'py, PyArray2<f64>>;
type Triangles<'py> = Bound<'py, PyArray2<u32>>;

/// A body of a simulation, from `simulation["its name"]`.
#[pyclass(frozen, module = "viscera")]
pub struct Body {
    simulation: Py<Simulation>,
    number: usize,
    name: String,
}

impl Body {
    /// Of the number of a body in the simulation.
    pub fn of(simulation: Py<Simulation>, number: usize, name: String) -> Self {
        Self { simulation, number, name }
    }
}

#[pymethods]
impl Body {
    /// Its name in the scene.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Where its vertices are [m], shape (n, 3), in the order of its mesh: a view that is refreshed after each frame and
    /// cannot be written to. Copy it to keep it.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        view(py, self.simulation.get().room(self.number))
    }

    /// Their velocities [m/s], shape (n, 3), as they are now.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.simulation.get().look(|engine| {
            either!(engine, s => {
                let range = s.assembly().bodies[self.number].vertices.clone();
                vectors(py, &s.state().velocities[range]).map(Bound::into_any)
            })
        })?
    }

    /// Where they are at rest without loads [m], shape (n, 3).
    #[getter]
    fn rest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.simulation.get().look(|engine| {
            either!(engine, s => vectors(py, s.assembly().bodies[self.number].mesh.vertices()))
        })?
    }

    /// Vertices of each tetrahedron, shape (m, 4).
    #[getter]
    fn tets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        self.simulation.get().look(|engine| {
            either!(engine, s => indices(py, s.assembly().bodies[self.number].mesh.tets()))
        })?
    }

    /// Its surface as it is now: vertices [m], shape (k, 3), and triangles, shape (l, 3). It is the fine one of its scene
    /// file where it has one.
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<(Vertices<'py>, Triangles<'py>)> {
        self.simulation.get().look(|engine| {
            either!(engine, s => {
                let body = &s.assembly().bodies[self.number];
                let vertices = body.deformed_surface(&s.state().positions);
                Ok((vectors(py, &vertices)?, indices(py, &body.surface.triangles)?))
            })
        })?
    }

    /// What it is made of: "young" [Pa], "poisson", "density" [kg/m^3].
    #[getter]
    fn material<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let material = self
            .simulation
            .get()
            .look(|engine| either!(engine, s => s.scene().bodies[self.number].material))?;
        let numbers = PyDict::new(py);
        numbers.set_item("young", material.young())?;
        numbers.set_item("poisson", material.poisson())?;
        numbers.set_item("density", material.density())?;
        Ok(numbers)
    }

    fn __len__(&self) -> PyResult<usize> {
        self.simulation
            .get()
            .look(|engine| either!(engine, s => s.assembly().bodies[self.number].vertices.len()))
    }

    fn __repr__(&self) -> PyResult<String> {
        let [vertices, tets] = self.simulation.get().look(|engine| {
            either!(engine, s => {
                let body = &s.assembly().bodies[self.number];
                [body.vertices.len(), body.tets.len()]
            })
        })?;
        Ok(format!("<viscera.Body {}: {vertices} vertices, {tets} tetrahedra>", self.name))
    }
}
