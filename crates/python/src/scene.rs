//! `viscera.Scene`.

use crate::fault::{Class, OrRaise, error, guarded};
use crate::made::{self, Given, Label, Length, Made};
use crate::values;
use pyo3::prelude::*;
use pyo3::types::{PyMapping, PyTuple};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use viscera::scene::Scene as Parsed;
use viscera::simulation::Assembly;
use viscera_resources::{BUILT_IN, BuiltInScene, MeshFiles, files};

/// Keys and values over those of a scene's text, in the order in which they were set.
pub type Overrides = Vec<(String, String)>;

/// Bytes of files by their names in the scene.
type Files = BTreeMap<String, Arc<Vec<u8>>>;

/// A scene: bodies, what they are made of, what holds, moves and touches them, and how it is computed.
///
/// Keys and values are those of a scene file: `scene["body.liver.material.young"] = "6.5 kPa"`; plain numbers are in SI
/// units. Everything is checked as it is set.
#[pyclass(frozen, module = "viscera")]
pub struct Scene {
    /// Stands in errors.
    name: String,
    text: String,
    /// Where its mesh files are looked for: beside its file, and in the data folder.
    place: PathBuf,
    data: Option<PathBuf>,
    /// What was assumed where it was made of a file.
    notes: Vec<String>,
    inside: Mutex<Inside>,
}

/// What can be set.
struct Inside {
    overrides: Overrides,
    parsed: Arc<Parsed>,
    /// Files that were read; those of a scene that came from another process came along.
    files: Files,
}

/// A scene at one moment: what a simulation is built from.
#[derive(Clone)]
pub struct Content {
    /// Stands in errors.
    pub name: String,
    /// The scene file.
    pub text: String,
    /// Over it.
    pub overrides: Overrides,
    meshes: MeshFiles,
    files: Files,
}

impl Content {
    /// The scene with more text behind it.
    pub fn parse(&self, behind: &str) -> PyResult<Parsed> {
        let text = format!("{}\n{behind}", self.text);
        parse(&self.name, if behind.is_empty() { &self.text } else { &text }, &self.overrides)
    }

    /// Its meshes.
    pub fn assemble(&self, scene: &Parsed) -> PyResult<Assembly> {
        Assembly::new(scene, &mut |name| match self.files.get(name) {
            Some(bytes) => Ok(bytes.to_vec()),
            None => self.meshes.load(name).map_err(for_python),
        })
        .or_raise()
    }
}

/// The message names an option of the program; here it is an argument.
fn for_python(message: String) -> String {
    message.replace("name its folder with --data", "name its folder with data=")
}

fn parse(name: &str, text: &str, overrides: &[(String, String)]) -> PyResult<Parsed> {
    let all: Vec<(&str, &str)> = overrides.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    guarded(|| Parsed::parse(name, text, &all))?.or_raise()
}

impl Scene {
    fn build(
        name: String,
        text: String,
        place: PathBuf,
        data: Option<PathBuf>,
        settings: Option<&Bound<'_, PyMapping>>,
    ) -> PyResult<Self> {
        let parsed = Arc::new(parse(&name, &text, &[])?);
        let data = data.or_else(|| std::env::var_os("VISCERA_DATA").map(PathBuf::from));
        let inside = Inside { overrides: Vec::new(), parsed, files: Files::new() };
        let notes = Vec::new();
        let scene = Self { name, text, place, data, notes, inside: Mutex::new(inside) };
        if let Some(settings) = settings {
            scene.update(settings)?;
        }
        Ok(scene)
    }

    fn inside(&self) -> std::sync::MutexGuard<'_, Inside> {
        // What panicked had not begun to change it.
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn meshes(&self) -> MeshFiles {
        MeshFiles::new(&self.place, self.data.as_deref())
    }

    /// What it says now.
    pub fn content(&self) -> Content {
        let (overrides, files) = {
            let inside = self.inside();
            (inside.overrides.clone(), inside.files.clone())
        };
        let (name, text) = (self.name.clone(), self.text.clone());
        Content { name, text, overrides, meshes: self.meshes(), files }
    }

    fn parsed(&self) -> Arc<Parsed> {
        Arc::clone(&self.inside().parsed)
    }

    fn put(&self, overrides: Overrides) -> PyResult<()> {
        let parsed = Arc::new(parse(&self.name, &self.text, &overrides)?);
        let mut inside = self.inside();
        (inside.overrides, inside.parsed) = (overrides, parsed);
        Ok(())
    }
}

/// Keys and values of a dictionary as overrides of a scene.
pub fn overrides_of(
    scene: &Parsed,
    settings: Option<&Bound<'_, PyMapping>>,
) -> PyResult<Overrides> {
    let entry = |item: Bound<'_, PyAny>| -> PyResult<_> {
        let (key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let key: String = key
            .extract()
            .map_err(|_| error(Class::UnknownKey, "a key is text such as \"solver.iterations\""))?;
        let text = value_text(scene, &key, &value)?;
        Ok((key, text))
    };
    match settings {
        Some(settings) => settings.items()?.iter().map(entry).collect(),
        None => Ok(Vec::new()),
    }
}

/// A value for a key of a scene, as a scene file has it.
pub fn value_text(scene: &Parsed, key: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    let unit = |key: &str| match scene.described(key) {
        Ok(Some(described)) => described.unit,
        // An unknown key is an error where it is set, which comes next.
        _ => "",
    };
    values::to_text(key, value, &unit)
}

#[pymethods]
impl Scene {
    /// Reads a scene file. Mesh files are looked for beside it, then in the folder `data` (the environment variable
    /// `VISCERA_DATA` where it is not given). `settings` lie over those of the file.
    #[staticmethod]
    #[pyo3(signature = (path, *, settings = None, data = None))]
    fn load(
        path: PathBuf,
        settings: Option<&Bound<'_, PyMapping>>,
        data: Option<PathBuf>,
    ) -> PyResult<Self> {
        let bytes = files::read(&path).map_err(|problem| error(Class::File, problem))?;
        let name = path.display().to_string();
        let text = String::from_utf8(bytes).map_err(|_| {
            error(Class::Scene, format!("{name} is not a text file; a scene is TOML in UTF-8"))
        })?;
        Self::build(name, text, path, data, settings)
    }

    /// A scene that is part of the package; `viscera.built_in_scenes()` lists them.
    #[staticmethod]
    #[pyo3(signature = (name, *, settings = None))]
    fn builtin(name: &str, settings: Option<&Bound<'_, PyMapping>>) -> PyResult<Self> {
        let Some(scene) = BUILT_IN.iter().find(|scene: &&BuiltInScene| scene.name == name) else {
            let names: Vec<&str> = BUILT_IN.iter().map(|scene| scene.name).collect();
            let known = names.join(", ");
            return Err(error(
                Class::UnknownKey,
                format!("there is no built-in scene `{name}`; there are: {known}"),
            ));
        };
        let (name, text) = (scene.name.to_owned(), scene.text.to_owned());
        Self::build(name, text, PathBuf::new(), None, settings)
    }

    /// Reads the text of a scene file. Mesh files are looked for in `folder`, else in the current one. `name` stands in
    /// errors.
    #[staticmethod]
    #[pyo3(signature = (text, *, name = "scene", settings = None, folder = None))]
    fn parse(
        text: String,
        name: &str,
        settings: Option<&Bound<'_, PyMapping>>,
        folder: Option<PathBuf>,
    ) -> PyResult<Self> {
        let place = folder.unwrap_or_default().join(name);
        Self::build(name.to_owned(), text, place, None, settings)
    }

    /// Makes a scene of a mesh, a surface or a segmented scan (docs/meshes.md): bodies with their tissue by name, held and tied
    /// as anatomy suggests, balanced under gravity. `edge` and `count` say how finely; `unit` is the length of 1 in a mesh;
    /// `labels` of a scan, by name or number, `names` gives them others, `graded` lets tetrahedra grow inwards, `hollow` leaves
    /// organs a wall around a cavity. What was assumed stands in `notes`, doubts are warnings. Lengths are text with a unit or
    /// numbers in metres.
    #[staticmethod]
    #[pyo3(signature = (path, *, edge = None, count = None, unit = None, labels = None, names = None, graded = false, hollow = false, settings = None))]
    #[expect(clippy::too_many_arguments, reason = "Python's keywords")]
    fn from_file(
        py: Python<'_>,
        path: PathBuf,
        edge: Option<Length>,
        count: Option<usize>,
        unit: Option<Length>,
        labels: Option<Vec<Label>>,
        names: Option<BTreeMap<u16, String>>,
        graded: bool,
        hollow: bool,
        settings: Option<&Bound<'_, PyMapping>>,
    ) -> PyResult<Self> {
        let given = Given { edge, count, unit, labels, names, graded, hollow };
        let Made { text, files, notes } = made::make(py, &path, given)?;
        let name = path.display().to_string();
        let scene = Self::build(name, text, PathBuf::new(), None, settings)?;
        scene.inside().files = files;
        Ok(Self { notes, ..scene })
    }

    /// What was assumed where it was made of a file, a line each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// Writes it into a folder: its text as a scene file of this name, and the meshes that it has with it.
    fn write(&self, folder: PathBuf, name: &str) -> PyResult<PathBuf> {
        let wrong = |problem| error(Class::File, problem);
        files::prepare_folder(&folder, "folder").map_err(wrong)?;
        let scene = folder.join(format!("{name}.toml"));
        for (file, bytes) in &self.content().files {
            files::write_atomic(&folder.join(file), bytes).map_err(wrong)?;
        }
        files::write_atomic(&scene, self.text.as_bytes()).map_err(wrong)?;
        Ok(scene)
    }

    /// What stands at a key: text with its unit, a number in SI units, a truth, a list; the default where nothing was
    /// written, None where there is none.
    fn __getitem__<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyAny>> {
        match self.parsed().setting(key).or_raise()? {
            Some(value) => values::to_python(py, &value),
            None => Ok(py.None().into_bound(py)),
        }
    }

    /// Sets a key. Text has its unit in it, plain numbers are in SI units. Nothing is changed where it cannot be.
    fn __setitem__(&self, key: String, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let text = value_text(&self.parsed(), &key, value)?;
        let mut overrides = self.inside().overrides.clone();
        // One that was set before below or above this key stays where it was in the order.
        overrides.retain(|(other, _)| *other != key);
        overrides.push((key, text));
        self.put(overrides)
    }

    /// Takes back what was set at a key.
    fn __delitem__(&self, key: &str) -> PyResult<()> {
        let mut overrides = self.inside().overrides.clone();
        let before = overrides.len();
        overrides.retain(|(other, _)| other != key);
        if overrides.len() == before {
            return Err(error(Class::UnknownKey, format!("nothing was set at `{key}`")));
        }
        self.put(overrides)
    }

    /// Sets several keys at once: all of them, or none where one cannot be.
    fn update(&self, settings: &Bound<'_, PyMapping>) -> PyResult<()> {
        let mut overrides = self.inside().overrides.clone();
        for (key, text) in overrides_of(&self.parsed(), Some(settings))? {
            overrides.retain(|(other, _)| *other != key);
            overrides.push((key, text));
        }
        self.put(overrides)
    }

    /// The scene once more, to be changed on its own.
    fn copy(&self) -> Self {
        let inside = self.inside();
        let copy = Inside {
            overrides: inside.overrides.clone(),
            parsed: Arc::clone(&inside.parsed),
            files: inside.files.clone(),
        };
        Self {
            name: self.name.clone(),
            text: self.text.clone(),
            place: self.place.clone(),
            data: self.data.clone(),
            notes: self.notes.clone(),
            inside: Mutex::new(copy),
        }
    }

    /// The name that stands in errors.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Its title.
    #[getter]
    fn title(&self) -> String {
        self.parsed().title.clone()
    }

    /// What it shows.
    #[getter]
    fn description(&self) -> String {
        self.parsed().description.clone()
    }

    /// The text of its file, without what was set.
    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    /// What was set over the text, as a scene file has it.
    #[getter]
    fn settings(&self) -> Overrides {
        self.inside().overrides.clone()
    }

    /// Names of its bodies.
    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.parsed().bodies.iter().map(|body| body.name.clone()).collect()
    }

    /// Names of its tools.
    #[getter]
    fn tools(&self) -> Vec<String> {
        self.parsed().tools.iter().map(|tool| tool.name.clone()).collect()
    }

    /// Frames that it lasts.
    #[getter]
    fn frame_count(&self) -> u64 {
        self.parsed().frame_count()
    }

    /// How long a frame is [s].
    #[getter]
    fn frame_time(&self) -> f64 {
        self.parsed().time.frame
    }

    fn __repr__(&self) -> String {
        let parsed = self.parsed();
        let names = |all: Vec<&str>| if all.is_empty() { "none".into() } else { all.join(", ") };
        let bodies = names(parsed.bodies.iter().map(|body| body.name.as_str()).collect());
        let tools = names(parsed.tools.iter().map(|tool| tool.name.as_str()).collect());
        format!(
            "<viscera.Scene {}: bodies {bodies}; tools {tools}; {} frames of {:.4} s>",
            parsed.title,
            parsed.frame_count(),
            parsed.time.frame
        )
    }

    fn __copy__(&self) -> Self {
        self.copy()
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.copy()
    }

    /// With its mesh files, so that it is the same in another process or on another machine.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, this) = (slf.py(), slf.get());
        let content = this.content();
        let mut bytes: Vec<(String, Vec<u8>)> = Vec::new();
        for name in this.parsed().files() {
            let read = match content.files.get(name) {
                Some(known) => known.to_vec(),
                None => content
                    .meshes
                    .load(name)
                    .map_err(|problem| error(Class::File, for_python(problem)))?,
            };
            bytes.push((name.to_owned(), read));
        }
        let state = (content.name, content.text, content.overrides, bytes);
        let rebuild = slf.get_type().getattr("_rebuild")?;
        (rebuild, state).into_pyobject(py)
    }

    #[staticmethod]
    fn _rebuild(
        name: String,
        text: String,
        overrides: Overrides,
        bytes: Vec<(String, Vec<u8>)>,
    ) -> PyResult<Self> {
        let scene = Self::build(name, text, PathBuf::new(), None, None)?;
        let files = bytes.into_iter().map(|(name, bytes)| (name, Arc::new(bytes)));
        scene.inside().files = files.collect();
        scene.put(overrides)?;
        Ok(scene)
    }
}
