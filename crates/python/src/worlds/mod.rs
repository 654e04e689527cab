//! `viscera.Worlds`.

mod inside;

use crate::arrays::{Frames, matrix, rigid};
use crate::fault::{Class, OrRaise, error, guarded};
use crate::frame::force_now;
use crate::scene::Scene;
use crate::simulation::newtons_per_metre;
pub use inside::Worlds;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyMapping};
use std::sync::Mutex;
use viscera::scalar::Vec3;
use viscera::scalar::rigid::RigidTransform;
use viscera::scene::{Patch, Selector, read_tray};
use viscera::settings::{Place, Precision};
use viscera::simulation::{Simulation, ToolForce};
use viscera::worlds::{Status, Worlds as All};
use viscera_resources::memory;

/// Frames that are computed between two looks at Ctrl-C.
const FRAMES_AT_ONCE: u32 = 32;

#[pymethods]
impl Worlds {
    /// `n` worlds of a scene as it is now, on `threads` threads (one for each processor where it is not given).
    /// `force_error=True` also estimates what forces on tools are off by, which costs half as much again.
    #[new]
    #[pyo3(signature = (scene, n, *, threads = None, force_error = false))]
    fn new(
        py: Python<'_>,
        scene: &Scene,
        n: usize,
        threads: Option<usize>,
        force_error: bool,
    ) -> PyResult<Self> {
        let mut content = scene.content();
        let force_error = ("output.force_error".to_owned(), force_error.to_string());
        content.overrides.push(force_error);
        let base = content.parse("")?;
        if base.solver.precision != Precision::F32 {
            let message = "worlds are computed in single precision; leave solver.precision out";
            return Err(error(Class::Scene, message));
        }
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.unwrap_or(processors);
        let build = || -> PyResult<All<f32>> {
            let assembly = content.assemble(&base)?;
            let tets = assembly.bodies.iter().map(|body| body.tets.len()).sum::<usize>();
            let needed = memory::of_run(tets.saturating_mul(n), &base.solver);
            let what = format!("{}: {n} worlds of {tets} tetrahedra", base.name);
            memory::check(&what, needed, None, "take fewer worlds")
                .map_err(|problem| error(Class::Simulation, problem))?;
            All::new(base.clone(), assembly, n, threads).or_raise()
        };
        let all = py.detach(|| guarded(build))??;
        let bodies = all.world(0).map_or(&[][..], |world| &world.assembly().bodies);
        let rooms = bodies.iter().map(|body| Frames::new(py, n, body.vertices.len()));
        let rooms: PyResult<Vec<Frames>> = rooms.collect();
        let worlds = Self {
            rooms: rooms?,
            count: n,
            base,
            process: std::process::id(),
            worlds: Mutex::new(all),
        };
        {
            let all = worlds.lock()?;
            worlds.refresh(py, &all)?;
        }
        Ok(worlds)
    }

    /// Advances all worlds that have not failed by so many frames and measures the last; Python's lock is released meanwhile.
    #[pyo3(signature = (frames = 1))]
    fn step(&self, py: Python<'_>, frames: u32) -> PyResult<()> {
        let mut worlds = self.lock()?;
        let mut left = frames;
        while left > 0 {
            let now = left.min(FRAMES_AT_ONCE);
            {
                let worlds: &mut All<f32> = &mut worlds;
                py.detach(move || guarded(|| worlds.step(now)))?;
            }
            left -= now;
            // Ctrl-C.
            let goes_on = py.check_signals();
            if left == 0 || goes_on.is_err() {
                self.refresh(py, &worlds)?;
            }
            goes_on?;
        }
        Ok(())
    }

    /// Sets worlds back to the beginning, at rest: all, or those where `mask` (n,) is true. Holds and tools that were taken are
    /// gone, settings stay.
    #[pyo3(signature = (mask = None))]
    fn reset(&self, py: Python<'_>, mask: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let mask = self.mask(mask)?;
        let mut worlds = self.lock()?;
        let worlds: &mut All<f32> = &mut worlds;
        {
            let worlds: &mut All<f32> = worlds;
            py.detach(move || guarded(|| worlds.reset(mask.as_deref())))?.or_raise()?;
        }
        self.refresh(py, worlds)
    }

    /// Sets a key in each world: one value for all, or an array or a list with one for each. Only keys that may change while a
    /// scene runs: of `solver`, of `world`, of materials.
    #[pyo3(signature = (key, values, *, mask = None))]
    fn set(
        &self,
        py: Python<'_>,
        key: &str,
        values: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let settings = PyDict::new(py);
        settings.set_item(key, values)?;
        self.update(py, settings.as_mapping(), mask)
    }

    /// Sets several keys at once, as `set` does one: in each world all of them, or none where one cannot be.
    #[pyo3(signature = (settings, *, mask = None))]
    fn update(
        &self,
        py: Python<'_>,
        settings: &Bound<'_, PyMapping>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mut changes = vec![Vec::new(); self.count];
        for item in settings.items()?.iter() {
            let (key, values): (String, Bound<'_, PyAny>) = item.extract()?;
            let texts = self.texts(&key, &values)?;
            for (change, text) in changes.iter_mut().zip(texts) {
                change.push((key.clone(), text));
            }
        }
        // All worlds or none: each change is tried on the scene first.
        let chosen = self.mask(mask)?;
        let is_chosen = |number: usize| chosen.as_ref().is_none_or(|chosen| chosen[number]);
        for (_, change) in changes.iter().enumerate().filter(|(number, _)| is_chosen(*number)) {
            guarded(|| self.base.clone().change(change))?.or_raise()?;
        }
        self.each(py, mask, |number, simulation| simulation.change(&changes[number]))
    }

    /// Where a tool is to be in each world at the end of the next frame: positions [m], shape (n, 3), at which it keeps its
    /// rotation, or poses, shape (n, 4, 4). It goes there steadily, and is in the hand from then on.
    #[pyo3(signature = (tool, targets, *, mask = None))]
    fn move_tool(
        &self,
        py: Python<'_>,
        tool: &str,
        targets: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        self.check_tool(tool)?;
        let (numbers, columns) = matrix("targets", targets, self.count, &[3, 16])?;
        let poses: PyResult<Vec<RigidTransform>> = match columns {
            16 => numbers.chunks_exact(16).map(|all| rigid("targets", all)).collect(),
            _ => Ok(Vec::new()),
        };
        let poses = poses?;
        self.each(py, mask, |number, simulation| {
            let Some(index) = Self::tool(simulation, tool) else { return Ok(()) };
            let row = &numbers[columns * number..columns * (number + 1)];
            let pose = match columns {
                3 => RigidTransform {
                    translation: Vec3::from_f64([row[0], row[1], row[2]]),
                    ..simulation.tools()[index].pose
                },
                _ => poses[number],
            };
            simulation.move_tool(index, pose)
        })
    }

    /// How far a tool's jaws are to be open in each world at the end of the next frame [rad], shape (n,).
    #[pyo3(signature = (tool, angles, *, mask = None))]
    fn open_jaws(
        &self,
        py: Python<'_>,
        tool: &str,
        angles: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        self.check_tool(tool)?;
        let (angles, _) = matrix("angles", angles, self.count, &[1])?;
        self.each(py, mask, |number, simulation| match Self::tool(simulation, tool) {
            Some(index) => simulation.open_jaws(index, angles[number]),
            None => Ok(()),
        })
    }

    /// Locks a tool's jaws in each world from the next frame on, or unlocks them: `locked` is a truth, or shape (n,).
    #[pyo3(signature = (tool, locked, *, mask = None))]
    fn lock_jaws(
        &self,
        py: Python<'_>,
        tool: &str,
        locked: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        self.check_tool(tool)?;
        let locked = match locked.extract::<bool>() {
            Ok(locked) => vec![locked; self.count],
            Err(_) => self.mask(Some(locked))?.unwrap_or_default(),
        };
        self.each(py, mask, |number, simulation| match Self::tool(simulation, tool) {
            Some(index) => simulation.lock_jaws(index, locked[number]),
            None => Ok(()),
        })
    }

    /// Takes a tool into each world from the next frame on, in the hand: `text` has one `[[tool]]` table as a scene file has it.
    /// Returns its name.
    #[pyo3(signature = (text, *, mask = None))]
    fn take_tool(
        &self,
        py: Python<'_>,
        text: &str,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        let mut tray = guarded(|| read_tray("tool", text))?.or_raise()?.into_iter();
        let (Some(tool), None) = (tray.next(), tray.next()) else {
            return Err(error(Class::Scene, "give one [[tool]] table"));
        };
        let name = tool.name.clone();
        self.each(py, mask, |_, simulation| simulation.take_tool(tool.clone()).map(|_| ()))?;
        Ok(name)
    }

    /// Takes hold, in each world, of the `count` vertices of a body that at rest are nearest to a point [m], shape (3,): by springs
    /// of a total `stiffness`, or rigidly. Returns the number by which `lead` and `hold_force` know it, the same in all these worlds.
    #[pyo3(signature = (body, *, point, count = 1, stiffness = None, mask = None))]
    fn take_hold(
        &self,
        py: Python<'_>,
        body: &str,
        point: &Bound<'_, PyAny>,
        count: u32,
        stiffness: Option<&Bound<'_, PyAny>>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<usize> {
        let names: Vec<&str> = self.base.bodies.iter().map(|body| body.name.as_str()).collect();
        let number = names.iter().position(|name| *name == body).ok_or_else(|| {
            let known = names.join(", ");
            error(Class::UnknownKey, format!("there is no body `{body}`; there are: {known}"))
        })?;
        let point = crate::arrays::vector("a point [m]", point)?;
        let stiffness = stiffness.map(newtons_per_metre).transpose()?;
        let place = Place::Override { key: "take_hold".into() };
        if count == 0 {
            return Err(error(Class::Scene, "a hold needs one vertex at least: count=1"));
        }
        let selector = Selector::Nearest { point, count };
        let patch = Patch { body: number, selector, purpose: "hold".to_owned(), place };
        let taken = {
            let worlds = self.lock()?;
            let motions = |n| {
                worlds.world(n).map_or(0, |world: &Simulation<f32>| world.scene().motions.len())
            };
            let chosen = self.mask(mask)?;
            let is_chosen = |n: &usize| chosen.as_ref().is_none_or(|chosen| chosen[*n]);
            let mut numbers = (0..self.count).filter(is_chosen).map(motions);
            let first = numbers.next().unwrap_or_default();
            if numbers.any(|number| number != first) {
                let message = "worlds have different numbers of holds; reset them first";
                return Err(error(Class::Simulation, message));
            }
            first
        };
        self.each(py, mask, |_, simulation| {
            simulation.take_hold("hold", patch.clone(), stiffness).map(|_| ())
        })?;
        Ok(taken)
    }

    /// Where a hold is to be in each world at the end of the next frame, from where it was taken [m], shape (n, 3).
    #[pyo3(signature = (hold, translations, *, mask = None))]
    fn lead(
        &self,
        py: Python<'_>,
        hold: usize,
        translations: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (numbers, _) = matrix("translations", translations, self.count, &[3])?;
        self.each(py, mask, |number, simulation| {
            let at = &numbers[3 * number..3 * number + 3];
            simulation.lead(hold, Vec3::from_f64([at[0], at[1], at[2]]))
        })
    }

    /// Force of a hold on the tissue in each world [N], shape (n, 3).
    fn hold_force(&self, py: Python<'_>, hold: usize) -> PyResult<Py<PyArray2<f64>>> {
        self.rows(py, |simulation| match simulation.hold(hold) {
            Some(held) => Ok(held.force.to_array()),
            None => Err(error(Class::Simulation, "this hold was let go, or its worlds were reset")),
        })
    }

    /// Positions of each body's vertices [m] by its name, shape (n, vertices, 3): views that are refreshed after each step and
    /// cannot be written to.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (body, room) in self.base.bodies.iter().zip(&self.rooms) {
            all.set_item(&body.name, room.view(py)?)?;
        }
        Ok(all)
    }

    /// The force on the tissue [N] in each world, shape (n, 3), of the fixing, motion, force, tool or tie of this name.
    fn force(&self, py: Python<'_>, name: &str) -> PyResult<Py<PyArray2<f64>>> {
        self.rows(py, |simulation| force_now(simulation, name))
    }

    /// Force [N] and torque [N m] about its origin of the tissue on a tool in each world, shape (n, 6); NaN in
    /// worlds that have no such tool.
    fn wrench(&self, py: Python<'_>, tool: &str) -> PyResult<Py<PyArray2<f64>>> {
        self.check_tool(tool)?;
        self.rows(py, |simulation| {
            let all = simulation.tool_forces();
            let found = all.into_iter().find(|force| force.name == tool);
            Ok(found.map_or([f64::NAN; 6], |ToolForce { force, torque, .. }| {
                let ([a, b, c], [d, e, f]) = (force, torque);
                [a, b, c, d, e, f]
            }))
        })
    }

    /// Where a tool is in each world [m], shape (n, 3).
    fn tool_position(&self, py: Python<'_>, tool: &str) -> PyResult<Py<PyArray2<f64>>> {
        self.check_tool(tool)?;
        self.rows(py, |simulation| {
            let found = Self::tool(simulation, tool).map(|index| simulation.tools()[index].pose);
            Ok(found.map_or([f64::NAN; 3], |pose| pose.translation.to_array()))
        })
    }

    /// How each world is, shape (n,): 0 fine, 1 its iterations ended before forces were balanced within 1 %, 2 tetrahedra are
    /// inverted, 3 failed: it is not stepped until it is reset.
    #[getter]
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let worlds = self.lock()?;
        let code = |number| match worlds.status(number) {
            Status::Fine => 0,
            Status::Unsolved => 1,
            Status::Inverted => 2,
            Status::Failed => 3,
        };
        Ok(PyArray1::from_vec(py, (0..self.count).map(code).collect()))
    }

    /// Why a world failed; None where it did not.
    fn failure(&self, number: usize) -> PyResult<Option<String>> {
        let worlds = self.lock()?;
        self.check_number(number)?;
        Ok(worlds.failure(number).map(ToString::to_string))
    }

    /// Frames computed so far in each world, shape (n,).
    #[getter]
    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let worlds = self.lock()?;
        let frame = |number| worlds.world(number).map_or(0, Simulation::frame);
        Ok(PyArray1::from_vec(py, (0..self.count).map(frame).collect()))
    }

    /// How long a frame is [s].
    #[getter]
    fn frame_time(&self) -> f64 {
        self.base.time.frame
    }

    /// A fingerprint of the state of one world: that which `Simulation.digest` of the same scene has where nothing was done by
    /// hand.
    fn digest<'py>(&self, py: Python<'py>, number: usize) -> PyResult<Bound<'py, PyAny>> {
        self.check_number(number)?;
        let bytes = {
            let worlds = self.lock()?;
            guarded(|| worlds.world(number).map(crate::snapshot::of).unwrap_or_default())?
        };
        crate::functions::digest(py, &bytes)
    }

    /// A picture of one world as it is now, as the bytes of a PNG file.
    #[pyo3(signature = (number, width = 640, height = 480))]
    fn picture<'py>(
        &self,
        py: Python<'py>,
        number: usize,
        width: u32,
        height: u32,
    ) -> PyResult<Bound<'py, PyBytes>> {
        self.check_number(number)?;
        let worlds = self.lock()?;
        let draw = || worlds.world(number).map(|s| crate::picture::draw(s, [width, height]));
        let bytes = guarded(draw)?.transpose()?.unwrap_or_default();
        Ok(PyBytes::new(py, &bytes))
    }

    /// The same as an array of sRGB values, shape (height, width, 3).
    #[pyo3(signature = (number, width = 640, height = 480))]
    fn image<'py>(
        &self,
        py: Python<'py>,
        number: usize,
        width: u32,
        height: u32,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        self.check_number(number)?;
        let worlds = self.lock()?;
        match worlds.world(number) {
            Some(simulation) => crate::picture::draw_array(py, simulation, [width, height]),
            None => Err(error(Class::Internal, "this world is gone")),
        }
    }

    fn __len__(&self) -> usize {
        self.count
    }

    fn __repr__(&self) -> String {
        format!("<viscera.Worlds: {} of {}>", self.count, self.base.title)
    }
}
