//! Errors, as Python sees them: classes of `viscera._errors`.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use std::panic::{AssertUnwindSafe, catch_unwind};
use viscera::scene::SceneError;
use viscera::settings::SettingError;
use viscera::simulation::{AssembleError, FrameError, LiveError, ResumeError, SimulationError};

/// The class of an error.
#[derive(Clone, Copy, Debug)]
pub enum Class {
    /// A scene, or something given for one, that cannot be.
    Scene,
    /// A name that nothing has.
    UnknownKey,
    /// A simulation that cannot go on.
    Simulation,
    /// A snapshot of something else.
    Snapshot,
    /// Another thread is at work on it.
    Busy,
    /// It is of no use in this process.
    Forked,
    /// A file that cannot be read or written.
    File,
    /// A defect of this package.
    Internal,
}

impl Class {
    fn name(self) -> &'static str {
        match self {
            Self::Scene => "SceneError",
            Self::UnknownKey => "UnknownKeyError",
            Self::Simulation => "SimulationError",
            Self::Snapshot => "SnapshotError",
            Self::Busy => "BusyError",
            Self::Forked => "ForkedError",
            Self::File => "FileError",
            Self::Internal => "InternalError",
        }
    }
}

/// An error of a class.
pub fn error(class: Class, message: impl std::fmt::Display) -> PyErr {
    static MODULE: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    Python::attach(|py| {
        let module = MODULE.get_or_try_init(py, || py.import("viscera._errors").map(Bound::unbind));
        let class = module.and_then(|module| module.bind(py).getattr(class.name()));
        match class.and_then(|class| Ok(class.cast_into::<PyType>()?)) {
            Ok(class) => PyErr::from_type(class, message.to_string()),
            Err(error) => error,
        }
    })
}

/// Something that tells of what went wrong.
pub trait Fault {
    /// As Python sees it.
    fn into_python(self) -> PyErr;
}

impl Fault for SceneError {
    fn into_python(self) -> PyErr {
        let class = match &self {
            SceneError::Setting(
                SettingError::UnknownKey { .. }
                | SettingError::OverrideKey { .. }
                | SettingError::OverridePath { .. }
                | SettingError::OverrideItem { .. },
            )
            | SceneError::FixedKey { .. } => Class::UnknownKey,
            _ => Class::Scene,
        };
        error(class, self)
    }
}

impl Fault for AssembleError {
    fn into_python(self) -> PyErr {
        error(Class::Scene, self)
    }
}

impl Fault for SimulationError {
    fn into_python(self) -> PyErr {
        error(Class::Simulation, self)
    }
}

impl Fault for LiveError {
    fn into_python(self) -> PyErr {
        match self {
            Self::Scene(scene) => scene.into_python(),
            Self::Simulation(_) => error(Class::Simulation, self),
            _ => error(Class::Scene, self),
        }
    }
}

impl Fault for FrameError {
    fn into_python(self) -> PyErr {
        error(Class::Simulation, self)
    }
}

impl Fault for ResumeError {
    fn into_python(self) -> PyErr {
        error(Class::Snapshot, self)
    }
}

/// Gives errors their class in Python.
pub trait OrRaise<T> {
    /// The value, or an error of Python.
    fn or_raise(self) -> PyResult<T>;
}

impl<T, E: Fault> OrRaise<T> for Result<T, E> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(Fault::into_python)
    }
}

/// Calls a function; a panic, which would be a defect, becomes an `InternalError` with the panic's message.
pub fn guarded<T>(act: impl FnOnce() -> T) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(act)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
        error(
            Class::Internal,
            format!("a defect of viscera {}: {text}; please report it", env!("CARGO_PKG_VERSION")),
        )
    })
}
