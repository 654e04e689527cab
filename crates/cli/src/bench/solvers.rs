//! The solvers that `viscera bench` measures.

use super::task::{Length, Task};
use viscera::material::{Material, MaterialError, MaterialModel};
use viscera::settings::{Acceleration, Clusters, Colors, Elements, Method, SolverSettings};

/// One of them.
#[derive(Clone)]
pub struct SolverEntry {
    /// As `--solvers` and the results call it.
    pub name: &'static str,
    /// For the legend of the report.
    pub what: &'static str,
    pub material: MaterialModel,
    /// Two numbers of sweeps, or of small steps, per step. A step is measured with the first, a sweep by the difference
    /// between both. `None` for a solver that does not sweep: its unit is the step.
    pub sweeps: Option<[u32; 2]>,
    pub task: Task,
    /// What it changes of the default settings.
    change: fn(&mut SolverSettings),
}

/// The default number of sweeps, and enough more for the difference to stand out.
const FEW: Option<[u32; 2]> = Some([2, 10]);
/// Beyond Chebyshev's delay of ten and with Anderson's window full: sweeps like all later ones.
const LATER: Option<[u32; 2]> = Some([12, 20]);

/// Of an explicit step, small steps: what is done once per step falls out of the difference.
const SMALL_STEPS: Option<[u32; 2]> = Some([10, 60]);

const GREEN: MaterialModel = MaterialModel::SaintVenantKirchhoff;
const NEO: MaterialModel = MaterialModel::StableNeoHookean;

/// All of them, in the order of the results.
pub const SOLVERS: [SolverEntry; 17] = [
    entry("green", "XPBD as published, Saint Venant-Kirchhoff", GREEN, FEW, publish),
    entry("pair", "XPBD as published, stable neo-Hookean pair", NEO, FEW, publish),
    entry("green-exact", "the default, Saint Venant-Kirchhoff", GREEN, FEW, |_| {}),
    entry("exact", "the default, stable neo-Hookean", NEO, FEW, |_| {}),
    entry("clusters", "the default with clusters of 512", NEO, FEW, |s| {
        s.clusters = Clusters::OfTets(512);
    }),
    entry("cliques", "the default with 4 colours", NEO, FEW, |s| s.colors = Colors::Limited(4)),
    entry("jacobi", "the default with 1 colour", NEO, FEW, |s| s.colors = Colors::Limited(1)),
    entry("jacobi-green", "`green` with 1 colour", GREEN, FEW, |s| {
        publish(s);
        s.colors = Colors::Limited(1);
    }),
    entry(
        "jacobi-anderson",
        "`green` with 1 colour and Anderson acceleration",
        GREEN,
        LATER,
        |s| {
            publish(s);
            s.colors = Colors::Limited(1);
            s.acceleration = Acceleration::Anderson;
        },
    ),
    entry("chebyshev", "the default with Chebyshev acceleration", NEO, LATER, |s| {
        s.acceleration = Acceleration::Chebyshev;
    }),
    entry("anderson", "the default with Anderson acceleration", NEO, LATER, |s| {
        s.acceleration = Acceleration::Anderson;
    }),
    entry("explicit-green", "explicit, Saint Venant-Kirchhoff", GREEN, SMALL_STEPS, explicit),
    entry("explicit", "explicit, stable neo-Hookean", NEO, SMALL_STEPS, explicit),
    entry("explicit-recovered", "the same, recovered-gradient tetrahedra", NEO, SMALL_STEPS, |s| {
        explicit(s);
        s.elements = Elements::Recovered;
    }),
    entry(
        "quasi-newton-green",
        "quasi-Newton with the passes that it chooses, Saint Venant-Kirchhoff",
        GREEN,
        None,
        |s| s.method = Method::QuasiNewton,
    ),
    entry("quasi-newton", "quasi-Newton, stable neo-Hookean", NEO, None, |s| {
        s.method = Method::QuasiNewton;
    }),
    entry(
        "quasi-newton-recovered",
        "quasi-Newton, recovered-gradient tetrahedra",
        NEO,
        None,
        |s| {
            s.method = Method::QuasiNewton;
            s.elements = Elements::Recovered;
        },
    ),
];

const fn entry(
    name: &'static str,
    what: &'static str,
    material: MaterialModel,
    sweeps: Option<[u32; 2]>,
    change: fn(&mut SolverSettings),
) -> SolverEntry {
    SolverEntry { name, what, material, sweeps, task: Task::USUAL, change }
}

/// Sweeps and nothing else.
fn publish(settings: &mut SolverSettings) {
    settings.rebase = false;
    settings.keep_multipliers = false;
    settings.step_guard = false;
}

impl SolverEntry {
    /// The default settings with its changes.
    pub fn settings(&self) -> SolverSettings {
        let mut settings = SolverSettings::xpbd();
        (self.change)(&mut settings);
        if settings.method == Method::Explicit && self.task.length == Length::Usual {
            // The cost of a small step does not depend on its size; small ones keep any mesh in one piece.
            settings.explicit_safety = 0.05;
        }
        settings
    }

    /// Soft tissue.
    pub fn tissue(&self) -> Result<Material, MaterialError> {
        Material::new(self.material, 10e3, self.task.poisson, 1060.0)
    }

    /// What its cost is counted per.
    pub fn unit(&self) -> &'static str {
        if self.sweeps.is_some() { "sweep" } else { "step" }
    }
}

fn explicit(settings: &mut SolverSettings) {
    settings.method = Method::Explicit;
}
