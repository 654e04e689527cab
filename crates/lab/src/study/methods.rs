//! The methods that the study compares, by their settings.

use viscera::material::MaterialModel;
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Colors, Count, Integrator, Method, RelaxationForm,
    SolverSettings, Threads,
};

/// Settings with the name that tables and legends give them.
#[derive(Clone, Debug)]
pub struct NamedSettings {
    /// A few words.
    pub name: String,
    /// One step per frame, one thread.
    pub settings: SolverSettings,
}

impl NamedSettings {
    /// Named settings.
    pub fn new(name: impl Into<String>, settings: SolverSettings) -> Self {
        Self { name: name.into(), settings }
    }

    /// With so many iterations.
    pub fn with_iterations(mut self, iterations: u32) -> Self {
        self.settings.iterations = Count::Of(iterations);
        self
    }
}

impl std::fmt::Display for NamedSettings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.name)
    }
}

/// XPBD as published: multipliers from zero in every step, no rebase, no safeguards.
pub fn published(colors: Colors) -> SolverSettings {
    SolverSettings {
        substeps: Count::Of(1),
        colors,
        threads: Threads::Count(1),
        rebase: false,
        keep_multipliers: false,
        step_guard: false,
        anderson_guard: AndersonGuard::None,
        ..SolverSettings::xpbd()
    }
}

/// XPBD, exact at rest: rebase, kept multipliers, safeguards.
pub fn exact(colors: Colors) -> SolverSettings {
    SolverSettings {
        substeps: Count::Of(1),
        colors,
        threads: Threads::Count(1),
        ..SolverSettings::xpbd()
    }
}

/// The quasi-Newton method, a step of implicit Euler: what the others solve, too.
pub fn quasi_newton() -> SolverSettings {
    SolverSettings {
        method: Method::QuasiNewton,
        integrator: Integrator::ImplicitEuler,
        substeps: Count::Of(1),
        threads: Threads::Count(1),
        ..SolverSettings::xpbd()
    }
}

/// With over-relaxation by `omega`.
pub fn relaxed(settings: SolverSettings, omega: f64, form: RelaxationForm) -> SolverSettings {
    SolverSettings { relaxation: omega, relaxation_form: form, ..settings }
}

/// With Chebyshev's method; `radius` 0 measures it.
pub fn chebyshev(settings: SolverSettings, radius: f64) -> SolverSettings {
    SolverSettings { acceleration: Acceleration::Chebyshev, chebyshev_radius: radius, ..settings }
}

/// With Anderson's method, window 5, on these unknowns; the settings' guard stays.
pub fn anderson(settings: SolverSettings, on: AndersonOn) -> SolverSettings {
    SolverSettings { acceleration: Acceleration::Anderson, anderson_on: on, ..settings }
}

/// A material's law in words.
pub fn law(model: MaterialModel) -> &'static str {
    match model {
        MaterialModel::StableNeoHookean => "stable neo-Hookean",
        MaterialModel::SaintVenantKirchhoff => "Green strain",
    }
}

/// One colour: every tetrahedron has vertices of its own.
pub const JACOBI: Colors = Colors::Limited(1);

/// As many colours as it takes.
pub const COLORED: Colors = Colors::Unlimited;
