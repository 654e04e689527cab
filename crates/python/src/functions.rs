//! Functions of the package.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use viscera_resources::BUILT_IN;

/// Names of the scenes that are part of the package.
#[pyfunction]
pub fn built_in_scenes() -> Vec<&'static str> {
    BUILT_IN.iter().map(|scene| scene.name).collect()
}

/// The version of the package, and of the program with the same results.
#[pyfunction]
pub fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// A fingerprint of a snapshot: 64 hexadecimal digits (SHA-256), the same for the same bits.
#[pyfunction]
pub fn digest<'py>(py: Python<'py>, snapshot: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    let hash = py.import("hashlib")?.call_method1("sha256", (snapshot,))?;
    hash.call_method0("hexdigest")
}

/// Every key that a scene can have, a dictionary each: its path, type with unit, range, default and what it does.
#[pyfunction]
pub fn describe(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let all = PyList::empty(py);
    for table in viscera::scene::describe() {
        for key in &table.keys {
            let path = match table.path.as_str() {
                "" => key.name.to_owned(),
                path => format!("{path}.{}", key.name),
            };
            let entry = PyDict::new(py);
            entry.set_item("key", path)?;
            entry.set_item("takes", &key.type_text)?;
            entry.set_item("unit", key.unit)?;
            entry.set_item("range", &key.range)?;
            entry.set_item("default", &key.default)?;
            entry.set_item("doc", &key.doc)?;
            all.append(entry)?;
        }
    }
    Ok(all)
}
