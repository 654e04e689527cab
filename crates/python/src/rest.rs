//! `viscera.rest`: exact states of rest, and their derivatives by the scene's numbers.

use crate::arrays::{numbers, row, vectors};
use crate::fault::{Class, OrRaise, error, guarded};
use crate::scene::{Content, Scene};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyKeyboardInterrupt, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use viscera::material::Material;
use viscera::scalar::Vec3;
use viscera::scene::Scene as Parsed;
use viscera::simulation::Simulation;
use viscera_reference::sensitivity::{Change, Dependence, Tangent};
use viscera_reference::{Course, ReferenceError, RestState, check_determined};
use viscera_resources::Memory;

/// States of rest of a scene, by Newton's method in double precision.
///
/// All arrays have a row for each time. `viscera.rest` makes it.
#[pyclass(frozen, module = "viscera")]
pub struct Rest {
    title: String,
    bodies: Vec<(String, Range<usize>)>,
    vertex_count: usize,
    keys: Vec<String>,
    times: Vec<Time>,
    solved: Mutex<Solved>,
}

/// What is known at one time.
struct Time {
    state: RestState,
    forces: Forces,
    /// By key.
    tangents: Vec<(Tangent, Forces)>,
}

/// Force on the tissue by name [N], or its derivative.
type Forces = Vec<(String, Vec3<f64>)>;

/// What adjoints need.
struct Solved {
    simulation: Simulation<f64>,
    changes: Vec<Change>,
    memory: u64,
}

impl Solved {
    fn new(content: &Content, keys: &[(String, Dependence)], memory: u64) -> PyResult<Self> {
        let scene = content.parse("")?;
        check_determined(&scene)
            .map_err(|why| error(Class::Scene, format!("{}: {why}", scene.name)))?;
        let simulation = Simulation::new(scene.clone(), content.assemble(&scene)?).or_raise()?;
        let change = |(key, dependence): &(String, Dependence)| -> PyResult<Change> {
            let value = number_at(&scene, key)?;
            let mut content = content.clone();
            content.overrides.push((key.clone(), text_of(&scene, key, dependence.other(value))?));
            let other = content.parse("")?;
            // Meshes stay where materials change; springs of fixings are part of what is assembled.
            let builder = match key.starts_with("body.") {
                true => simulation.assembly().with_materials(&other),
                false => Ok(content.assemble(&other)?.builder),
            };
            let model = builder.and_then(|builder| builder.build());
            let model = model.map_err(|why| error(Class::Scene, why))?;
            Ok(dependence.change(simulation.model(), &model, value))
        };
        let changes: PyResult<Vec<_>> = keys.iter().map(change).collect();
        Ok(Self { changes: changes?, simulation, memory })
    }

    /// An error of the reference, in terms of this package.
    fn refuse(&self, why: ReferenceError, time: f64) -> PyErr {
        let name = &self.simulation.scene().name;
        let message = match why {
            ReferenceError::Stopped => return PyKeyboardInterrupt::new_err(()),
            ReferenceError::TooLarge { unknowns, bytes, limit } => {
                // A little more than needed, so that the advice holds.
                let enough = Memory(bytes.saturating_add(bytes / 10));
                let (needed, limit) = (Memory(bytes), Memory(limit));
                format!(
                    "{unknowns} unknowns need {needed}, more than the {limit} allowed; take a coarser mesh, or allow more \
                     with memory=\"{enough}\""
                )
            }
            other => other.to_string(),
        };
        error(Class::Simulation, format!("{name}, at {time:.4} s: {message}"))
    }

    /// Says that tools that touch have friction, which these states leave out.
    fn warn_of_friction(&self, py: Python<'_>, times: &[Time]) -> PyResult<()> {
        let touches = times.iter().any(|time| time.state.wrenches.iter().any(|w| w.touches > 0));
        let rough = self.simulation.scene().tools.iter().find(|tool| tool.law.friction > 0.0);
        let Some(tool) = rough.filter(|_| touches) else { return Ok(()) };
        let message = format!(
            "tool `{0}` has friction {1}, and states of rest have none: forces may differ by a tenth; where it slides \
             set tool.{0}.friction = 0",
            tool.name, tool.law.friction
        );
        let message = std::ffi::CString::new(message).unwrap_or_default();
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)
    }

    /// One state after another; `near` are positions to begin at, time by time.
    fn follow(
        &self,
        times: &[f64],
        near: Option<Vec<&[Vec3<f64>]>>,
        keys: &[(String, Dependence)],
    ) -> PyResult<Vec<Time>> {
        let mut course = Course::new(&self.simulation, self.memory).stop_where(goes_on);
        let mut before = (0.0, course.rest().to_vec());
        let mut all = Vec::with_capacity(times.len());
        for (number, &time) in times.iter().enumerate() {
            let refuse = |why| self.refuse(why, time);
            let nearby = near.as_ref().map(|near| course.go((time, near[number]), time));
            let state = match nearby {
                Some(Ok(state)) => state,
                // From there Newton's method may find no way, and from the beginning it may.
                Some(Err(ReferenceError::NotConverged { .. })) | None => {
                    course.go((before.0, &before.1), time).map_err(refuse)?
                }
                Some(Err(why)) => return Err(refuse(why)),
            };
            let forces = course.forces(&state);
            let tangents = match self.changes.is_empty() {
                true => Vec::new(),
                false => course.tangents(&state, &self.changes).map_err(refuse)?,
            };
            let along = |(tangent, (key, _)): (Tangent, &(String, Dependence))| {
                let forces = course.forces_along(&state, &tangent, key);
                (tangent, forces)
            };
            let tangents = tangents.into_iter().zip(keys).map(along).collect();
            before = (time, state.positions.clone());
            all.push(Time { state, forces, tangents });
            // Ctrl-C.
            Python::attach(|py| py.check_signals())?;
        }
        Ok(all)
    }
}

/// False after Ctrl-C, which is taken note of here: who asked raises it.
fn goes_on() -> bool {
    Python::attach(|py| py.check_signals()).is_ok()
}

/// The number in force at a key [SI], also where a preset says it.
fn number_at(scene: &Parsed, key: &str) -> PyResult<f64> {
    // The table of settings reports an unknown key, and suggests the nearest.
    scene.setting(key).or_raise()?;
    let steps: Vec<&str> = key.split('.').collect();
    let body = |name: &str| find(&scene.bodies, name, |body| &body.name);
    let found = match steps[..] {
        ["body", name, "material", last] => body(name).and_then(|body| of(&body.material, last)),
        ["body", name, "region", number, last] => body(name).and_then(|body| {
            let region = body.regions.get(number.parse::<usize>().ok()?)?;
            of(&region.material, last)
        }),
        ["fixing", name, _] => {
            find(&scene.fixings, name, |fixing| &fixing.name).and_then(|fixing| fixing.stiffness)
        }
        _ => None,
    };
    found.ok_or_else(|| {
        let message =
            format!("{key}: there is no number; give it one, at which derivatives are taken");
        error(Class::Scene, message)
    })
}

/// One of a list, by its name or its number.
fn find<'a, T>(all: &'a [T], step: &str, name: impl Fn(&T) -> &str) -> Option<&'a T> {
    let named = all.iter().find(|item| name(item) == step);
    named.or_else(|| all.get(step.parse::<usize>().ok()?))
}

fn of(material: &Material, last: &str) -> Option<f64> {
    match last {
        "young" => Some(material.young()),
        "poisson" => Some(material.poisson()),
        "density" => Some(material.density()),
        _ => None,
    }
}

/// A number [SI] as a scene file has it at a key.
fn text_of(scene: &Parsed, key: &str, value: f64) -> PyResult<String> {
    let described = scene.described(key).or_raise()?;
    Ok(match described.map_or("", |described| described.unit) {
        "" => format!("{value:?}"),
        unit => format!("\"{value:?} {unit}\""),
    })
}

impl Rest {
    fn body(&self, name: &str) -> PyResult<Range<usize>> {
        let found = self.bodies.iter().find(|(known, _)| known == name);
        found.map(|(_, vertices)| vertices.clone()).ok_or_else(|| {
            let known = names(&self.bodies);
            error(Class::UnknownKey, format!("there is no body `{name}`; there are: {known}"))
        })
    }

    fn key(&self, key: &str) -> PyResult<usize> {
        self.keys.iter().position(|known| known == key).ok_or_else(|| {
            let known = self.keys.join(", ");
            let message = format!("no derivatives by `{key}` were asked for; there are: {known}");
            error(Class::UnknownKey, message)
        })
    }

    /// A row for each time.
    fn forces<'py, 'a>(
        &'a self,
        py: Python<'py>,
        name: &str,
        at: impl Fn(&'a Time) -> &'a Forces,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let row = |time: &'a Time| {
            let forces = at(time);
            let found = forces.iter().find(|(known, _)| known == name).map(|(_, force)| *force);
            found.ok_or_else(|| {
                let known = names(forces);
                let what = "fixing, motion, force or tool";
                error(Class::UnknownKey, format!("there is no {what} `{name}`; there are: {known}"))
            })
        };
        let rows: Vec<_> = self.times.iter().map(row).collect::<PyResult<_>>()?;
        vectors(py, &rows)
    }

    /// Vectors of a body, shape (times, vertices, 3).
    fn of_body<'py, 'a>(
        &'a self,
        py: Python<'py>,
        body: &str,
        at: impl Fn(&'a Time) -> &'a [Vec3<f64>],
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let vertices = self.body(body)?;
        let flat = self.times.iter().flat_map(|time| &at(time)[vertices.clone()]);
        let flat: Vec<f64> = flat.flat_map(|x| x.to_array()).collect();
        PyArray1::from_vec(py, flat).reshape([self.times.len(), vertices.len(), 3])
    }
}

fn names<T>(all: &[(String, T)]) -> String {
    all.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
}

#[pymethods]
impl Rest {
    /// Times [s], shape (times,).
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        row(py, &self.times.iter().map(|time| time.state.time).collect::<Vec<_>>())
    }

    /// Whether each state is a minimum of the potential; where one is none, a push leads elsewhere.
    #[getter]
    fn minimum(&self) -> Vec<bool> {
        self.times.iter().map(|time| time.state.convergence.minimum).collect()
    }

    /// Keys by which there are derivatives.
    #[getter]
    fn unknown(&self) -> Vec<String> {
        self.keys.clone()
    }

    /// Positions of a body [m], shape (times, vertices, 3).
    fn positions<'py>(&self, py: Python<'py>, body: &str) -> PyResult<Bound<'py, PyArray3<f64>>> {
        self.of_body(py, body, |time| &time.state.positions)
    }

    /// The force on the tissue [N] of a fixing, motion, force or tool, shape (times, 3).
    fn force<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.forces(py, name, |time| &time.forces)
    }

    /// How positions change with the number at a key, per its SI unit, shape (times, vertices, 3).
    fn positions_along<'py>(
        &self,
        py: Python<'py>,
        key: &str,
        body: &str,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let number = self.key(key)?;
        self.of_body(py, body, move |time| &time.tangents[number].0.positions)
    }

    /// How a force changes with the number at a key, per its SI unit, shape (times, 3).
    fn force_along<'py>(
        &self,
        py: Python<'py>,
        key: &str,
        name: &str,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let number = self.key(key)?;
        self.forces(py, name, move |time| &time.tangents[number].1)
    }

    /// Derivatives of a function of positions by every key, from its gradient: of each body it depends on, shape (times,
    /// vertices, 3). One solve a time, however many keys there are (the adjoint).
    fn pull_back<'py>(
        &self,
        py: Python<'py>,
        by_positions: &Bound<'py, PyMapping>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut all = vec![vec![Vec3::<f64>::ZERO; self.vertex_count]; self.times.len()];
        for item in by_positions.items()? {
            let (name, given): (String, Bound<'_, PyAny>) = item.extract()?;
            let vertices = self.body(&name)?;
            let shape = [self.times.len(), vertices.len(), 3];
            let flat = numbers(&format!("the gradient of `{name}`"), &given, &shape)?;
            for (at, of_time) in all.iter_mut().zip(flat.chunks_exact(3 * vertices.len())) {
                for (at, x) in at[vertices.clone()].iter_mut().zip(of_time.chunks_exact(3)) {
                    *at = Vec3::from_f64([x[0], x[1], x[2]]);
                }
            }
        }
        let pull = || -> PyResult<Vec<f64>> {
            let solved = self.solved.lock().unwrap_or_else(PoisonError::into_inner);
            let course = Course::new(&solved.simulation, solved.memory);
            let mut sums = vec![0.0; self.keys.len()];
            for (time, by_positions) in self.times.iter().zip(&all) {
                let pulled = course.pull_back(&time.state, by_positions, &solved.changes);
                let pulled = pulled.map_err(|why| solved.refuse(why, time.state.time))?;
                sums.iter_mut().zip(pulled).for_each(|(sum, pulled)| *sum += pulled);
            }
            Ok(sums)
        };
        let sums = py.detach(|| guarded(pull))??;
        let gradient = PyDict::new(py);
        for (key, sum) in self.keys.iter().zip(sums) {
            gradient.set_item(key, sum)?;
        }
        Ok(gradient)
    }

    fn __repr__(&self) -> String {
        let at = |time: Option<&Time>| time.map_or(0.0, |time| time.state.time);
        let (first, last) = (at(self.times.first()), at(self.times.last()));
        let keys = if self.keys.is_empty() { "nothing".to_owned() } else { self.keys.join(", ") };
        let (title, count) = (&self.title, self.times.len());
        format!(
            "<viscera.Rest {title}: {count} times from {first:.4} s to {last:.4} s; derivatives by {keys}>"
        )
    }
}

/// Finds the states of rest of a scene at some times [s], its end where none are given: exact, without inertia and viscosity.
///
/// Motions are followed from the beginning, so that each state is the one they lead to. `unknown` names keys by which
/// derivatives are wanted: `body.NAME.material.young`, `.poisson`, `.density`, those of regions, and
/// `fixing.NAME.stiffness`. `near`, a `Rest` of the same bodies and times, is where the search begins. Tools touch
/// without friction.
#[pyfunction]
#[pyo3(signature = (scene, times = None, *, unknown = None, near = None, memory = "8 GB"))]
pub fn rest(
    py: Python<'_>,
    scene: &Scene,
    times: Option<&Bound<'_, PyAny>>,
    unknown: Option<Vec<String>>,
    near: Option<&Rest>,
    memory: &str,
) -> PyResult<Rest> {
    let memory: Memory =
        memory.parse().map_err(|why| error(Class::Scene, format!("memory: {why}")))?;
    let content = scene.content();
    let times = match times {
        Some(times) => times_of(times)?,
        None => {
            let scene = content.parse("")?;
            vec![scene.frame_count() as f64 * scene.time.frame]
        }
    };
    let dependence = |key: String| match Dependence::of_key(&key) {
        Some(dependence) => Ok((key, dependence)),
        None => Err(error(
            Class::UnknownKey,
            format!(
                "states of rest have no derivative by `{key}`; they have by young, poisson and density of a material and by \
                 the stiffness of a fixing"
            ),
        )),
    };
    check_end(&content.parse("")?, &times)?;
    let keys: Vec<_> =
        unknown.unwrap_or_default().into_iter().map(dependence).collect::<PyResult<_>>()?;
    let (solved, all) = py.detach(|| {
        guarded(|| {
            let solved = Solved::new(&content, &keys, memory.0)?;
            let count = solved.simulation.model().vertex_count();
            let fits = |near: &Rest| {
                let known = near.times.iter().map(|time| time.state.time);
                near.vertex_count == count && known.eq(times.iter().copied())
            };
            if near.is_some_and(|near| !fits(near)) {
                let message = "near has other bodies or other times than are asked for";
                return Err(error(Class::Scene, message));
            }
            let near =
                near.map(|near| near.times.iter().map(|time| &time.state.positions[..]).collect());
            let all = solved.follow(&times, near, &keys)?;
            Ok::<_, PyErr>((solved, all))
        })
    })??;
    solved.warn_of_friction(py, &all)?;
    let bodies = &solved.simulation.assembly().bodies;
    Ok(Rest {
        title: solved.simulation.scene().title.clone(),
        bodies: bodies.iter().map(|body| (body.name.clone(), body.vertices.clone())).collect(),
        vertex_count: solved.simulation.model().vertex_count(),
        keys: keys.into_iter().map(|(key, _)| key).collect(),
        times: all,
        solved: Mutex::new(solved),
    })
}

/// Times [s] in order.
fn times_of(value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let count = match value.len() {
        Ok(count) => count,
        Err(_) => return Err(error(Class::Scene, "times are a list of numbers in seconds")),
    };
    let times = numbers("times", value, &[count])?;
    let in_order = times.windows(2).all(|pair| pair[0] < pair[1]);
    match times.first() {
        Some(first) if *first >= 0.0 && in_order => Ok(times),
        Some(_) => Err(error(
            Class::Scene,
            "times begin at 0 s or later, and each is after the one before",
        )),
        None => Err(error(Class::Scene, "give one time at least")),
    }
}

/// Motions are followed frame by frame, and a scene has so many.
fn check_end(scene: &Parsed, times: &[f64]) -> PyResult<()> {
    let end = scene.frame_count() as f64 * scene.time.frame;
    // The last frame may be cut short by rounding.
    match times.last().filter(|last| **last > end + scene.time.frame) {
        Some(last) => {
            let name = &scene.name;
            let message =
                format!("{name} ends at {end:.4} s, before the time {last} s; set time.duration");
            Err(error(Class::Scene, message))
        }
        None => Ok(()),
    }
}
