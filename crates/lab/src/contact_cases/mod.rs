//! What studies of contact share: scenes, the library's ways to solve them, and what came out.

mod moving;
mod pressed;
mod pressing;
mod sliding;

use std::fmt;

use viscera::mesh::TetMesh;
use viscera::scalar::Vec3;
use viscera::settings::{Count, Method, SolverSettings};

pub use moving::{Course, DEEDS, Deed, Moving};
pub use pressed::{Held, Pressed, Together};
pub use pressing::{Pressing, Rest, Sampling};
pub use sliding::{Slide, Sliding};

/// A way to solve a scene of contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    /// The method.
    pub method: Method,
    /// Substeps and iterations where they are not the method's own choice.
    pub schedule: Option<(u32, u32)>,
    /// In single precision.
    pub single: bool,
}

impl Way {
    /// By a method with its own choice of substeps and iterations, in double precision.
    pub const fn of(method: Method) -> Self {
        Self { method, schedule: None, single: false }
    }

    /// In single precision.
    pub const fn in_single(self) -> Self {
        Self { single: true, ..self }
    }

    /// On linear tetrahedra, as the reference.
    pub fn settings(&self) -> SolverSettings {
        let usual = SolverSettings { method: self.method, ..SolverSettings::xpbd() };
        match self.schedule {
            None => usual,
            Some((substeps, iterations)) => SolverSettings {
                substeps: Count::Of(substeps),
                iterations: Count::Of(iterations),
                ..usual
            },
        }
    }
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.method {
            Method::Xpbd => "XPBD",
            Method::Explicit => "explicit",
            _ => "quasi-Newton",
        })?;
        if let Some((substeps, iterations)) = self.schedule {
            write!(f, " {substeps} x {iterations}")?;
        }
        f.write_str(if self.single { ", single precision" } else { ", double precision" })
    }
}

/// Vertices by where they are at rest [m].
pub fn select(mesh: &TetMesh, inside: impl Fn(Vec3<f64>) -> bool) -> Vec<u32> {
    (0u32..).zip(mesh.vertices()).filter(|(_, x)| inside(**x)).map(|(v, _)| v).collect()
}
