//! Ways to solve that the sections compare.

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::{Colors, Count, Method, SolverSettings};

use crate::load_cases::LoadCase;
use crate::settling::{Settled, settle};
use viscera_report::{percent, scientific};

/// Both materials.
pub(super) const MODELS: [MaterialModel; 2] =
    [MaterialModel::StableNeoHookean, MaterialModel::SaintVenantKirchhoff];

/// How a scene is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LibrarySolver {
    /// The defaults, in double precision.
    Double,
    /// The defaults, in single precision.
    Single,
    /// Multipliers from zero and no rebase, in double precision.
    Published,
    /// The quasi-Newton method with its defaults, one substep, in double precision.
    QuasiNewton,
    /// The same in single precision.
    QuasiNewtonSingle,
}

/// Those of the XPBD family.
pub(super) const METHODS: [LibrarySolver; 3] =
    [LibrarySolver::Double, LibrarySolver::Single, LibrarySolver::Published];

/// Those that are right at rest.
pub(super) const RIGHT_AT_REST: [LibrarySolver; 4] = [
    LibrarySolver::Double,
    LibrarySolver::Single,
    LibrarySolver::QuasiNewton,
    LibrarySolver::QuasiNewtonSingle,
];

impl LibrarySolver {
    /// As tables and legends call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Double => "exact at rest, double precision",
            Self::Single => "exact at rest, single precision",
            Self::Published => "XPBD as published",
            Self::QuasiNewton => "quasi-Newton, double precision",
            Self::QuasiNewtonSingle => "quasi-Newton, single precision",
        }
    }

    /// Whether it works in single precision.
    pub fn is_single(self) -> bool {
        matches!(self, Self::Single | Self::QuasiNewtonSingle)
    }

    /// The defaults, but for what makes the method.
    pub fn settings(self) -> SolverSettings {
        let exact = self != Self::Published;
        let method = match self {
            Self::QuasiNewton | Self::QuasiNewtonSingle => Method::QuasiNewton,
            Self::Double | Self::Single | Self::Published => Method::Xpbd,
        };
        SolverSettings { method, rebase: exact, keep_multipliers: exact, ..SolverSettings::xpbd() }
    }

    /// Brings a scene to rest.
    pub fn settle(self, load_case: &LoadCase) -> Result<Settled> {
        self.settle_with(load_case, &self.settings())
    }

    /// The same with other settings, in the method's precision.
    pub fn settle_with(self, load_case: &LoadCase, settings: &SolverSettings) -> Result<Settled> {
        match self.is_single() {
            false => settle::<f64>(load_case, settings),
            true => settle::<f32>(load_case, settings),
        }
    }
}

/// A material's law in words.
pub(super) fn model_name(model: MaterialModel) -> &'static str {
    match model {
        MaterialModel::StableNeoHookean => "stable neo-Hookean",
        MaterialModel::SaintVenantKirchhoff => "Saint Venant-Kirchhoff",
    }
}

/// The larger of two errors; one that is no number is the worst.
pub(super) fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// An error in figures; one below `floor` is round-off, whose digits differ from machine to machine.
pub(super) fn floored(error: f64, floor: f64) -> String {
    if error < floor { format!("< {}", scientific(floor)) } else { scientific(error) }
}

/// The same in percent.
pub(super) fn floored_percent(error: f64, floor: f64) -> String {
    if error < floor { format!("< {}", percent(floor)) } else { percent(error) }
}

/// How constraints are separated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// As many colours as it takes.
    Colored,
    /// Four colours.
    Clique,
    /// One colour.
    Jacobi,
}

impl Form {
    /// As tables and legends call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Colored => "coloured",
            Self::Clique => "clique, 4 colours",
            Self::Jacobi => "Jacobi",
        }
    }

    /// The setting.
    pub fn colors(self) -> Colors {
        match self {
            Self::Colored => Colors::Unlimited,
            Self::Clique => Colors::Limited(4),
            Self::Jacobi => Colors::Limited(1),
        }
    }
}

/// The defaults with other colours, substeps and iterations.
pub(super) fn scheduled(form: Form, substeps: u32, iterations: u32) -> SolverSettings {
    SolverSettings {
        colors: form.colors(),
        substeps: Count::Of(substeps),
        iterations: Count::Of(iterations),
        ..SolverSettings::xpbd()
    }
}
