//! What `viscera.Worlds` is made of.

use crate::arrays::Frames;
use crate::fault::{Class, Fault, OrRaise, error, guarded};
use crate::scene::value_text;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyList;
use std::sync::{Mutex, MutexGuard, TryLockError};
use viscera::scene::Scene as Parsed;
use viscera::simulation::{LiveError, Simulation};
use viscera::worlds::{Worlds as All, WorldsError};

impl Fault for WorldsError {
    fn into_python(self) -> PyErr {
        match self {
            Self::Live(live) => live.into_python(),
            Self::Simulation(_) => error(Class::Simulation, self),
            _ => error(Class::Scene, self),
        }
    }
}

/// Many simulations of one scene side by side, on threads: each with settings, holds and tools of its own.
///
/// A world has the bits that it has alone, whatever becomes of the others, and however many threads there are. They are computed
/// in single precision on the CPU, each by one thread at a time.
#[pyclass(frozen, module = "viscera")]
pub struct Worlds {
    pub(super) worlds: Mutex<All<f32>>,
    pub(super) count: usize,
    pub(super) base: Parsed,
    /// Positions of each body.
    pub(super) rooms: Vec<Frames>,
    pub(super) process: u32,
}

/// Exclusive access to the worlds.
pub type Guard<'a> = MutexGuard<'a, All<f32>>;

impl Worlds {
    /// All of them, where no other thread is at work.
    pub fn lock(&self) -> PyResult<Guard<'_>> {
        if std::process::id() != self.process {
            let message = "these worlds were made before the process forked, and their threads did not come along; make them in \
                           the new process, or start processes with the method \"spawn\"";
            return Err(error(Class::Forked, message));
        }
        match self.worlds.try_lock() {
            Ok(worlds) => Ok(worlds),
            Err(TryLockError::WouldBlock) => {
                Err(error(Class::Busy, "another thread is at work on these worlds"))
            }
            Err(TryLockError::Poisoned(_)) => {
                Err(error(Class::Internal, "an earlier call met a defect; make new worlds"))
            }
        }
    }

    /// Does something to each world that is chosen.
    pub fn each(
        &self,
        py: Python<'_>,
        mask: Option<&Bound<'_, PyAny>>,
        act: impl Fn(usize, &mut Simulation<f32>) -> Result<(), LiveError> + Sync + Send,
    ) -> PyResult<()> {
        let mask = self.mask(mask)?;
        let mut worlds = self.lock()?;
        let worlds: &mut All<f32> = &mut worlds;
        py.detach(move || guarded(|| worlds.for_each(mask.as_deref(), act)))?.or_raise()
    }

    /// Which worlds are chosen.
    pub fn mask(&self, mask: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<bool>>> {
        let Some(mask) = mask else { return Ok(None) };
        let array = mask.py().import("numpy")?.call_method1("asarray", (mask,))?;
        let refuse = || {
            let message =
                format!("mask: give an array of {} truths, one for each world", self.count);
            error(Class::Scene, message)
        };
        let array = array.cast_into::<PyArray1<bool>>().map_err(|_| refuse())?;
        let mask = array.readonly().as_array().to_vec();
        (mask.len() == self.count).then_some(Some(mask)).ok_or_else(refuse)
    }

    /// The value of a key in each world, as a scene file has it: one for all, or one for each.
    pub fn texts(&self, key: &str, values: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
        let numpy = values.py().import("numpy")?;
        let is_list =
            values.is_instance(&numpy.getattr("ndarray")?)? || values.is_instance_of::<PyList>();
        if !is_list || numpy.call_method1("ndim", (values,))?.extract::<usize>()? == 0 {
            return Ok(vec![value_text(&self.base, key, values)?; self.count]);
        }
        let texts: PyResult<Vec<String>> =
            values.try_iter()?.map(|value| value_text(&self.base, key, &value?)).collect();
        let texts = texts?;
        if texts.len() != self.count {
            let (found, count) = (texts.len(), self.count);
            let message = format!("{key}: there are {found} values for {count} worlds");
            return Err(error(Class::Scene, message));
        }
        Ok(texts)
    }

    /// Writes all positions where people look at them.
    pub fn refresh(&self, py: Python<'_>, worlds: &All<f32>) -> PyResult<()> {
        let simulations = (0..self.count).filter_map(|number| worlds.world(number));
        for (number, simulation) in simulations.enumerate() {
            let positions = &simulation.state().positions;
            for (body, room) in simulation.assembly().bodies.iter().zip(&self.rooms) {
                room.refresh(py, number, &positions[body.vertices.clone()])?;
            }
        }
        Ok(())
    }

    /// The number of a tool; it is the same in all worlds that have it.
    pub fn tool(simulation: &Simulation<f32>, name: &str) -> Option<usize> {
        simulation.tools().iter().position(|tool| tool.name == name)
    }

    /// Some numbers of each world, a row each.
    pub fn rows<const N: usize>(
        &self,
        py: Python<'_>,
        row: impl Fn(&Simulation<f32>) -> PyResult<[f64; N]>,
    ) -> PyResult<Py<PyArray2<f64>>> {
        let worlds = self.lock()?;
        let mut all = Vec::with_capacity(N * self.count);
        for number in 0..self.count {
            if let Some(simulation) = worlds.world(number) {
                all.extend(guarded(|| row(simulation))??);
            }
        }
        Ok(PyArray1::from_vec(py, all).reshape([self.count, N])?.unbind())
    }
}

impl Worlds {
    /// Whether there is a world of this number.
    pub fn check_number(&self, number: usize) -> PyResult<()> {
        if number < self.count {
            return Ok(());
        }
        let message = format!("there is no world {number}; there are {}, from 0 on", self.count);
        Err(error(Class::UnknownKey, message))
    }

    /// Whether any world has a tool of this name.
    pub fn check_tool(&self, name: &str) -> PyResult<()> {
        let worlds = self.lock()?;
        let has =
            |number: usize| worlds.world(number).is_some_and(|w| Self::tool(w, name).is_some());
        if (0..self.count).any(has) {
            return Ok(());
        }
        let known: Vec<String> =
            worlds.world(0).map_or(Vec::new(), |w| w.tools().into_iter().map(|t| t.name).collect());
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        Err(error(Class::UnknownKey, format!("there is no tool `{name}`; there are: {known}")))
    }
}
