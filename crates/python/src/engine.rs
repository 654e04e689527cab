//! A simulation in either precision.

use crate::arrays::{Positions, Precise, refresh};
use crate::fault::{Class, OrRaise, error};
use crate::scene::Content;
use pyo3::prelude::*;
use viscera::scene::Scene;
use viscera::settings::Precision;
use viscera::simulation::{Assembly, Simulation};
use viscera_resources::memory;

/// A simulation in either precision.
pub enum Engine {
    /// In single precision.
    Single(Box<Simulation<f32>>),
    /// In double precision.
    Double(Box<Simulation<f64>>),
}

/// The same with a simulation of either precision.
macro_rules! either {
    ($engine:expr, $simulation:ident => $body:expr) => {
        match $engine {
            $crate::engine::Engine::Single($simulation) => $body,
            $crate::engine::Engine::Double($simulation) => $body,
        }
    };
}
pub(crate) use either;

impl Engine {
    /// Of a scene, with its meshes; refused where there is no room for it.
    pub fn new(scene: Scene, assembly: Assembly) -> PyResult<Self> {
        let tets = assembly.bodies.iter().map(|body| body.tets.len()).sum();
        let what = format!("{}: a simulation of {tets} tetrahedra", scene.name);
        let needed = memory::of_run(tets, &scene.solver);
        memory::check(&what, needed, None, "take a coarser mesh")
            .map_err(|problem| error(Class::Simulation, problem))?;
        Ok(match scene.solver.precision {
            Precision::F32 => Self::Single(Box::new(Simulation::new(scene, assembly).or_raise()?)),
            Precision::F64 => Self::Double(Box::new(Simulation::new(scene, assembly).or_raise()?)),
        })
    }

    /// One that goes on from where another was saved, with what hands had done to that. `base` is the scene without that.
    pub fn resume(content: &Content, base: &Scene, hands: &str, saved: &[u8]) -> PyResult<Self> {
        // Of another scene: hands held bodies or tools that this one has not.
        let other = |problem: PyErr| {
            let what = "the snapshot is of another scene";
            Python::attach(|py| error(Class::Snapshot, format!("{what}: {}", problem.value(py))))
        };
        let scene = content.parse(hands).map_err(other)?;
        let assembly = content.assemble(&scene).map_err(other)?;
        Ok(match Self::new(scene, assembly)? {
            Self::Single(simulation) => Self::Single(Box::new(go_on(*simulation, base, saved)?)),
            Self::Double(simulation) => Self::Double(Box::new(go_on(*simulation, base, saved)?)),
        })
    }

    /// Arrays for the positions of all bodies.
    pub fn rooms(&self, py: Python<'_>) -> Vec<Positions> {
        let bodies = either!(self, simulation => &simulation.assembly().bodies);
        let counts = bodies.iter().map(|body| body.vertices.len());
        match self {
            Self::Single(_) => counts.map(|count| f32::room(py, count)).collect(),
            Self::Double(_) => counts.map(|count| f64::room(py, count)).collect(),
        }
    }

    /// Writes positions into these arrays.
    pub fn refresh(&self, py: Python<'_>, rooms: &[Positions]) -> PyResult<()> {
        either!(self, simulation => {
            let positions = &simulation.state().positions;
            let bodies = &simulation.assembly().bodies;
            let mut each = bodies.iter().zip(rooms);
            each.try_for_each(|(body, room)| {
                refresh(py, room, &positions[body.vertices.clone()])
            })
        })
    }
}

fn go_on<S: viscera::scalar::Real>(
    simulation: Simulation<S>,
    base: &Scene,
    saved: &[u8],
) -> PyResult<Simulation<S>> {
    simulation.resume(saved).or_raise()?.with_hands_since(base.clone()).or_raise()
}
