//! `viscera.Simulation`.

use crate::arrays::{Positions, row, vector};
use crate::body::Body;
use crate::engine::{Engine, either};
use crate::fault::{Class, OrRaise, error, guarded};
use crate::frame::{Frame, force_now};
use crate::functions::digest;
use crate::hold::Hold;
use crate::picture;
use crate::scene::{Content, Scene, overrides_of};
use crate::snapshot::{of, unpack};
use crate::tool::Tool;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyMapping};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, TryLockError};
use viscera::mesh::io::WriteError;
use viscera::scalar::Real;
use viscera::scene::{Patch, Scene as Parsed, Selector, read_tray};
use viscera::settings::Place;
use viscera::simulation::{Simulation as Running, TissueFiles};
use viscera::units::Dimension;
use viscera_resources::files;

/// A scene in motion.
///
/// One thread at a time works on it; others get `viscera.BusyError`. The same scene gives the same bits on every machine, at
/// any number of threads, here and in the program `viscera`.
#[pyclass(frozen, module = "viscera")]
pub struct Simulation {
    engine: Mutex<Engine>,
    content: Content,
    /// The scene without what was done by hand.
    base: Parsed,
    bodies: Vec<String>,
    rooms: Vec<Positions>,
    /// The process that made it: its threads are in no other.
    process: u32,
    /// How often it was set back.
    age: AtomicU64,
    /// Whether a defect left it in the middle of something.
    is_broken: AtomicBool,
}

impl Simulation {
    fn lock(&self) -> PyResult<MutexGuard<'_, Engine>> {
        if std::process::id() != self.process {
            let message = "this simulation was made before the process forked, and its threads did not come along; make it in \
                           the new process, or start processes with the method \"spawn\"";
            return Err(error(Class::Forked, message));
        }
        if self.is_broken.load(Ordering::Relaxed) {
            let message = "an earlier call met a defect; make a new simulation";
            return Err(error(Class::Internal, message));
        }
        match self.engine.try_lock() {
            Ok(engine) => Ok(engine),
            Err(TryLockError::WouldBlock) => {
                let message =
                    "another thread is at work on this simulation; give each thread its own";
                Err(error(Class::Busy, message))
            }
            Err(TryLockError::Poisoned(engine)) => Ok(engine.into_inner()),
        }
    }

    /// Looks at it.
    pub fn look<T>(&self, look: impl FnOnce(&Engine) -> T) -> PyResult<T> {
        let engine = self.lock()?;
        guarded(|| look(&engine))
    }

    /// Changes it.
    pub fn change_with<T>(&self, act: impl FnOnce(&mut Engine) -> T) -> PyResult<T> {
        let mut engine = self.lock()?;
        self.guard(|| act(&mut engine))
    }

    fn guard<T>(&self, act: impl FnOnce() -> T) -> PyResult<T> {
        guarded(act).inspect_err(|_| self.is_broken.store(true, Ordering::Relaxed))
    }

    /// Positions of a body.
    pub fn room(&self, body: usize) -> &Positions {
        &self.rooms[body]
    }

    /// How often it was set back.
    pub fn age(&self) -> u64 {
        self.age.load(Ordering::Relaxed)
    }

    fn body_number(&self, name: &str) -> PyResult<usize> {
        self.bodies.iter().position(|body| body == name).ok_or_else(|| {
            let known = self.bodies.join(", ");
            error(Class::UnknownKey, format!("there is no body `{name}`; there are: {known}"))
        })
    }

    /// Puts another in its place.
    fn replace(&self, py: Python<'_>, engine: &mut Engine, new: Engine) -> PyResult<()> {
        *engine = new;
        self.age.fetch_add(1, Ordering::Relaxed);
        engine.refresh(py, &self.rooms)
    }

    fn saved(engine: &Engine) -> Vec<u8> {
        either!(engine, s => of(s))
    }

    fn vtu<S: Real>(simulation: &Running<S>) -> Result<Vec<u8>, WriteError> {
        let (model, state) = (simulation.model(), simulation.state());
        let tissue = TissueFiles::new(simulation.assembly(), model)?;
        Ok(tissue.file(model, &state.positions, &state.velocities)?.concat())
    }
}

#[pymethods]
impl Simulation {
    /// Builds a simulation of a scene as it is now; later changes of the scene do not reach it.
    ///
    /// `device` is "cpu", "gpu", "auto" or a part of an adapter's name; `threads` a number or "auto"; `precision` "f32" or
    /// "f64". They stand for `solver.device` and so on; where they are not given the scene decides.
    #[new]
    #[pyo3(signature = (scene, *, device = None, threads = None, precision = None))]
    fn new(
        py: Python<'_>,
        scene: &Scene,
        device: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
        precision: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let mut content = scene.content();
        let given = PyDict::new(py);
        for (key, value) in [("device", device), ("threads", threads), ("precision", precision)] {
            if let Some(value) = value {
                given.set_item(format!("solver.{key}"), value)?;
            }
        }
        let written = content.parse("")?;
        content.overrides.extend(overrides_of(&written, Some(given.as_mapping()))?);
        let base = content.parse("")?;
        let build = || -> PyResult<Engine> { Engine::new(base.clone(), content.assemble(&base)?) };
        let engine = py.detach(|| guarded(build))??;
        let rooms = engine.rooms(py);
        engine.refresh(py, &rooms)?;
        Ok(Self {
            engine: Mutex::new(engine),
            bodies: base.bodies.iter().map(|body| body.name.clone()).collect(),
            content,
            base,
            rooms,
            process: std::process::id(),
            age: AtomicU64::new(0),
            is_broken: AtomicBool::new(false),
        })
    }

    /// Computes frames and returns the numbers of the last one; Python's lock is released meanwhile, and Ctrl-C ends it after
    /// the frame that is under way. With `measure=False` forces and energies are those of an earlier frame, and the call is
    /// faster: for who needs positions only.
    #[pyo3(signature = (frames = 1, *, measure = true))]
    fn advance(&self, py: Python<'_>, frames: u64, measure: bool) -> PyResult<Frame> {
        let mut engine = self.lock()?;
        for number in 1..=frames {
            let measured = measure && number == frames;
            let engine: &mut Engine = &mut engine;
            let step =
                || either!(engine, s => if measured { s.advance_frame() } else { s.advance() });
            let stepped = py.detach(|| self.guard(step));
            engine.refresh(py, &self.rooms)?;
            stepped?.or_raise()?;
            // Ctrl-C.
            py.check_signals()?;
        }
        let report = self.guard(|| either!(&*engine, s => s.report()))?;
        Ok(Frame::of(report))
    }

    /// The numbers of the last frame.
    #[getter]
    fn report(&self) -> PyResult<Frame> {
        self.look(|engine| Frame::of(either!(engine, s => s.report())))
    }

    /// The body of this name.
    fn __getitem__(slf: &Bound<'_, Self>, name: &str) -> PyResult<Body> {
        let number = slf.get().body_number(name)?;
        Ok(Body::of(slf.clone().unbind(), number, name.to_owned()))
    }

    /// Names of its bodies.
    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.bodies.clone()
    }

    /// Names of its tools, those that come later and those that were put away among them.
    #[getter]
    fn tools(&self) -> PyResult<Vec<String>> {
        let tools = self.look(|engine| either!(engine, s => s.tools()))?;
        Ok(tools.into_iter().map(|tool| tool.name).collect())
    }

    /// The tool of this name.
    fn tool(slf: &Bound<'_, Self>, name: &str) -> PyResult<Tool> {
        let names = slf.get().tools()?;
        match names.iter().position(|tool| tool == name) {
            Some(number) => Ok(Tool::of(slf.clone().unbind(), number, name.to_owned())),
            None => {
                let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                let message = format!("there is no tool `{name}`; there are: {known}");
                Err(error(Class::UnknownKey, message))
            }
        }
    }

    /// Takes a tool into the scene from the next frame on, in the hand. `text` has one `[[tool]]` table as a scene file
    /// has it, with its `position`.
    fn take_tool(slf: &Bound<'_, Self>, text: &str) -> PyResult<Tool> {
        let this = slf.get();
        let mut tray = guarded(|| read_tray("tool", text))?.or_raise()?.into_iter();
        let (Some(tool), None) = (tray.next(), tray.next()) else {
            return Err(error(Class::Scene, "give one [[tool]] table"));
        };
        let number =
            this.change_with(|engine| either!(engine, s => s.take_tool(tool)))?.or_raise()?;
        let name = this.tools()?.swap_remove(number);
        Ok(Tool::of(slf.clone().unbind(), number, name))
    }

    /// The force on the tissue [N], shape (3,), of the fixing, motion, force, tool or tie of this name, as last measured.
    fn force<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let force = self.look(|engine| either!(engine, s => force_now(s, name)))??;
        Ok(row(py, &force))
    }

    /// Takes hold of the `count` vertices of a body that at rest are nearest to one of its vertices, or to a `point` [m]:
    /// by springs of a total `stiffness` ("200 N/m" or a number in N/m), or rigidly where none is given.
    #[pyo3(signature = (body, *, vertex = None, point = None, count = 1, stiffness = None))]
    fn take_hold(
        slf: &Bound<'_, Self>,
        body: &str,
        vertex: Option<usize>,
        point: Option<&Bound<'_, PyAny>>,
        count: u32,
        stiffness: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Hold> {
        let this = slf.get();
        let number = this.body_number(body)?;
        let point = match (vertex, point) {
            (None, Some(point)) => vector("a point [m]", point)?,
            (Some(vertex), None) => this
                .look(|engine| {
                    either!(engine, s => {
                        let vertices = s.assembly().bodies[number].mesh.vertices();
                        vertices.get(vertex).copied().ok_or(vertices.len())
                    })
                })?
                .map_err(|count| {
                    let message =
                        format!("there is no vertex {vertex}; {body} has {count}, from 0 on");
                    error(Class::UnknownKey, message)
                })?,
            _ => return Err(error(Class::Scene, "give either vertex= or point=")),
        };
        if count == 0 {
            return Err(error(Class::Scene, "a hold needs one vertex at least: count=1"));
        }
        let stiffness = stiffness.map(newtons_per_metre).transpose()?;
        let place = Place::Override { key: "take_hold".into() };
        let selector = Selector::Nearest { point, count };
        let patch = Patch { body: number, selector, purpose: "hold".to_owned(), place };
        let take = |engine: &mut _| either!(engine, s => s.take_hold("hold", patch, stiffness));
        let motion = this.change_with(take)?.or_raise()?;
        Ok(Hold::of(slf.clone().unbind(), motion, this.age()))
    }

    /// Changes settings of the solver, of the world or of materials from the next frame on: all of them, or none where one
    /// cannot be. Positions and velocities stay.
    fn change(&self, settings: &Bound<'_, PyMapping>) -> PyResult<()> {
        let settings = overrides_of(&self.base, Some(settings))?;
        self.change_with(|engine| either!(engine, s => s.change(&settings)))?.or_raise()
    }

    /// Back to the beginning, at rest; what was held is let go, and tools are those of the scene. Settings stay as they were
    /// changed.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        let mut engine = self.lock()?;
        {
            let engine: &mut Engine = &mut engine;
            let reset = || either!(engine, s => s.reset());
            py.detach(|| self.guard(reset))?.or_raise()?;
        }
        self.age.fetch_add(1, Ordering::Relaxed);
        engine.refresh(py, &self.rooms)
    }

    /// All of its state as bytes, what was done by hand included. `load` of a simulation of the same scene goes on from it
    /// to the bit, here or elsewhere.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.look(Self::saved)?))
    }

    /// Goes on from a snapshot of the same scene; where it cannot, nothing is changed. Holds that were taken are of no use
    /// afterwards. Forces are known again after the next frame.
    fn load(&self, py: Python<'_>, snapshot: &[u8]) -> PyResult<()> {
        let (hands, saved) = unpack(snapshot)?;
        let mut engine = self.lock()?;
        let resume = || Engine::resume(&self.content, &self.base, hands, saved);
        let new = py.detach(|| guarded(resume))??;
        self.replace(py, &mut engine, new)
    }

    /// A fingerprint of its state: that of its snapshot.
    fn digest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        digest(py, &self.look(Self::saved)?)
    }

    /// Frames computed so far.
    #[getter]
    fn frame(&self) -> PyResult<u64> {
        self.look(|engine| either!(engine, s => s.frame()))
    }

    /// Simulated time [s].
    #[getter]
    fn time(&self) -> PyResult<f64> {
        self.look(|engine| either!(engine, s => s.time()))
    }

    /// How long a frame is [s].
    #[getter]
    fn frame_time(&self) -> f64 {
        self.base.time.frame
    }

    /// What computes it, and why.
    #[getter]
    fn device(&self) -> PyResult<String> {
        self.look(|engine| either!(engine, s => s.device_choice().to_owned()))
    }

    /// The solver's settings in force, as a scene file has them.
    #[getter]
    fn solver<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = self.look(|engine| either!(engine, s => s.solver().values()))?;
        let settings = PyDict::new(py);
        for (key, value) in values {
            settings.set_item(key, value)?;
        }
        Ok(settings)
    }

    /// How far it is from its state of rest: the largest distance of a vertex [m], the same over the largest displacement,
    /// and the largest difference of a force over the largest force. None where that cannot be told.
    fn distance_from_rest(&self, py: Python<'_>) -> PyResult<Option<(f64, f64, f64)>> {
        let mut engine = self.lock()?;
        let engine: &mut Engine = &mut engine;
        let rest = py.detach(move || guarded(move || either!(&*engine, s => s.rest())))?;
        Ok(rest.map(|rest| (rest.distance, rest.error, rest.force_error)))
    }

    /// Writes all bodies' tetrahedra as they are now, with displacement, velocity, J, stretches, stress and energy density;
    /// ParaView opens it.
    fn write_vtu(&self, path: PathBuf) -> PyResult<()> {
        files::prepare_file(&path, "path").map_err(|problem| error(Class::File, problem))?;
        let bytes = self.look(|engine| either!(engine, s => Self::vtu(s)))?;
        let bytes = bytes.map_err(|problem| error(Class::Simulation, problem))?;
        files::write_atomic(&path, &bytes).map_err(|problem| error(Class::File, problem))
    }

    /// A picture as it is now, as the bytes of a PNG file.
    #[pyo3(signature = (width = None, height = None))]
    fn picture<'py>(
        &self,
        py: Python<'py>,
        width: Option<u32>,
        height: Option<u32>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let [usual_width, usual_height] = self.base.output.picture_size;
        let size = [width.unwrap_or(usual_width), height.unwrap_or(usual_height)];
        let mut engine = self.lock()?;
        let engine: &mut Engine = &mut engine;
        let draw = move || either!(&*engine, s => picture::draw(s, size));
        let bytes = py.detach(move || guarded(draw))??;
        Ok(PyBytes::new(py, &bytes))
    }

    /// What a notebook shows.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.picture(py, None, None)
    }

    fn __repr__(&self) -> PyResult<String> {
        self.look(|engine| either!(engine, s => format!(
            "<viscera.Simulation {}: {} tetrahedra, {} vertices, {} in {} substeps; frame {}, {:.4} s>",
            s.scene().title,
            s.model().tet_count(),
            s.model().vertex_count(),
            s.solver().method,
            s.substeps(),
            s.frame(),
            s.time(),
        )))
    }

    fn __reduce__(&self) -> PyResult<()> {
        let message = "a simulation cannot be pickled; pickle its scene and its save(), and load() that into a new one";
        Err(pyo3::exceptions::PyTypeError::new_err(message))
    }
}

/// A stiffness [N/m], from a number or a quantity with its unit.
pub fn newtons_per_metre(value: &Bound<'_, PyAny>) -> PyResult<f64> {
    match value.extract::<f64>() {
        Ok(number) => Ok(number),
        Err(_) => {
            let text: String = value.extract().map_err(|_| {
                error(Class::Scene, "stiffness: give text such as \"200 N/m\", or a number in N/m")
            })?;
            Dimension::Stiffness
                .parse(&text)
                .map_err(|problem| error(Class::Scene, format!("stiffness: {problem}")))
        }
    }
}
