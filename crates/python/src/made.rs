//! Scenes of meshes, surfaces and segmented scans.

use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use viscera::units::Dimension;
use viscera_import::{Fineness, Found, Options, load, open, title_of};
use viscera_resources::files;

use crate::fault::{Class, error, guarded};

/// A text with its unit, or a number in metres.
#[derive(FromPyObject)]
pub enum Length {
    /// "1 mm".
    Text(String),
    /// In metres.
    Number(f64),
}

impl Length {
    fn meters(&self, argument: &str) -> PyResult<f64> {
        let found = match self {
            Self::Number(meters) => Ok(*meters),
            Self::Text(text) => Dimension::Length.parse(text).map_err(|error| error.to_string()),
        };
        match found {
            Ok(meters) if meters.is_finite() && meters > 0.0 => Ok(meters),
            Ok(_) => Err("a length above zero is needed, for example \"1 mm\"".to_owned()),
            Err(problem) => Err(problem),
        }
        .map_err(|problem| error(Class::Scene, format!("{argument}: {problem}")))
    }
}

/// A label by its name or its number.
#[derive(FromPyObject)]
pub enum Label {
    /// Its number.
    Number(u16),
    /// Its name.
    Name(String),
}

/// What `Scene.from_file` is given beside the file.
pub struct Given {
    pub edge: Option<Length>,
    pub count: Option<usize>,
    pub unit: Option<Length>,
    pub labels: Option<Vec<Label>>,
    pub names: Option<BTreeMap<u16, String>>,
    pub graded: bool,
    pub hollow: bool,
}

impl Given {
    fn options(self) -> PyResult<Options> {
        let length = |given: &Option<Length>, argument| {
            given.as_ref().map(|length| length.meters(argument)).transpose()
        };
        let edge = length(&self.edge, "edge")?;
        if edge.is_some() && self.count.is_some() {
            return Err(error(Class::Scene, "edge and count say the same; give one of them"));
        }
        if self.count == Some(0) {
            return Err(error(Class::Scene, "count: at least one tetrahedron is needed"));
        }
        let text = |label: Label| match label {
            Label::Number(number) => number.to_string(),
            Label::Name(name) => name,
        };
        Ok(Options {
            fineness: edge.map(Fineness::Edge).or(self.count.map(Fineness::Count)),
            unit: length(&self.unit, "unit")?,
            labels: self.labels.unwrap_or_default().into_iter().map(text).collect(),
            names: self.names.unwrap_or_default().into_iter().collect(),
            graded: self.graded,
            hollow: self.hollow,
            shapes_only: false,
        })
    }
}

/// A scene file, the files that it names, and what was assumed.
pub struct Made {
    pub text: String,
    pub files: BTreeMap<String, Arc<Vec<u8>>>,
    pub notes: Vec<String>,
}

/// Makes a scene of a file, with warnings of Python for what is probably not as it was meant.
pub fn make(py: Python<'_>, path: &Path, given: Given) -> PyResult<Made> {
    let options = given.options()?;
    let import = py
        .detach(|| guarded(|| load(path, &options, &mut |_| ())))?
        .map_err(|problem| error(Class::File, for_python(&format!("{problem:#}"))))?;
    for warning in &import.warnings {
        let message = std::ffi::CString::new(for_python(warning)).unwrap_or_default();
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)?;
    }
    let mut written = import.scene(&title_of(path)).files.into_iter();
    let text = written.next().and_then(|(_, bytes)| String::from_utf8(bytes).ok());
    let of_parts = import
        .parts
        .iter()
        .flat_map(|part| part.notes.iter().map(|note| format!("{}: {note}", part.name)));
    let notes = import.notes.iter().map(|note| note.trim().to_owned()).chain(of_parts);
    Ok(Made {
        // A scene is text.
        text: text.unwrap_or_default(),
        files: written.map(|(name, bytes)| (name, Arc::new(bytes))).collect(),
        notes: notes.map(|note| for_python(&note)).collect(),
    })
}

/// Messages name options of the program; here they are arguments.
fn for_python(message: &str) -> String {
    let mut text = message.replace("--hollow", "hollow=True").replace("--graded", "graded=True");
    for argument in ["edge", "count", "unit", "labels", "names"] {
        text = text.replace(&format!("--{argument} "), &format!("{argument}="));
        text = text.replace(&format!("--{argument}"), argument);
    }
    text
}

/// The labels of a segmented scan, a dictionary each: `label`, `name` (None where it has none), `voxels`, `volume` [m^3] and
/// `pieces`.
#[pyfunction]
pub fn labels(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyList>> {
    let name = path.display().to_string();
    let read = |name: &str| files::read(Path::new(name)).map_err(|error| error.to_string());
    let found = py
        .detach(|| guarded(|| open(&name, read)))?
        .map_err(|problem| error(Class::File, for_python(&problem.to_string())))?;
    let Found::Labels(map, _) = found else {
        return Err(error(Class::File, format!("{name} is a mesh, which has no labels")));
    };
    let all = PyList::empty(py);
    for label in viscera_volume::summarize(&map) {
        let entry = PyDict::new(py);
        entry.set_item("label", label.label)?;
        entry.set_item("name", label.name)?;
        entry.set_item("voxels", label.voxels)?;
        entry.set_item("volume", 1e-6 * label.milliliters)?;
        entry.set_item("pieces", label.components)?;
        all.append(entry)?;
    }
    Ok(all)
}
