//! The solver's settings.

use super::accuracy::{Accuracies, Accuracy};
use super::device::{DeviceNames, DeviceRequest};
use super::elements::Elements;
use super::{
    Kind, Node, SettingError, Table, Value, ValueError, Whole, at_least, choices, number, one_of,
    settings_table, truth, value_error, whole,
};

choices! {
    /// Floating point format of the simulation state.
    pub enum Precision {
        /// Single precision: the product.
        F32 = "f32",
        /// Double precision: the oracle, for checks and studies.
        F64 = "f64",
    }
}

/// How many colours the constraints are separated into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colors {
    /// As many as it takes: no vertex is copied, coloured Gauss-Seidel.
    Unlimited,
    /// This many, at least 1: vertices are copied where more would be needed. One is Jacobi.
    Limited(u32),
}

/// Whether tetrahedra are swept cluster by cluster, with colours of two levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clusters {
    /// One level: colours of tetrahedra.
    None,
    /// Clusters of up to so many tetrahedra.
    OfTets(u32),
}

/// A count that a method can choose by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count {
    /// What suits the method and the scene.
    Auto,
    /// This many.
    Of(u32),
}

/// How many threads a solver works with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Threads {
    /// One per processor where the mesh is large enough to gain by it.
    Auto,
    /// This many, from 1 to [`MOST_THREADS`].
    Count(u32),
}

/// The most threads that can be asked for: more than any machine has processors that share memory.
pub const MOST_THREADS: u32 = 1024;

/// The most pairs that the quasi-Newton method keeps.
pub const MOST_HISTORY: usize = 10;

choices! {
    /// How positions and velocities are advanced.
    pub enum Method {
        /// What is cheapest at the accuracy that is asked for.
        Auto = "auto",
        /// Sweeps over constraints: large steps, stable.
        Xpbd = "xpbd",
        /// Forces and velocities in many small steps: no sweeps, no guards, true motion.
        Explicit = "explicit",
        /// Large steps, solved by a quasi-Newton method with a multilevel preconditioner: the exact step in a dozen
        /// passes, whatever the mesh.
        QuasiNewton = "quasi_newton",
    }
}

choices! {
    /// How "quasi_newton" integrates over time.
    pub enum Integrator {
        /// Singly diagonally implicit Runge-Kutta, two stages, second order: true motion.
        Sdirk2 = "sdirk2",
        /// Implicit Euler, first order: loses motion, for bodies that are to settle and for comparisons.
        ImplicitEuler = "implicit_euler",
    }
}

choices! {
    /// The unknowns that over-relaxation scales.
    pub enum RelaxationForm {
        /// Displacement and multiplier alike, so that they keep corresponding.
        Consistent = "consistent",
        /// The displacement only, as published: changes the stiffness it converges to.
        Published = "published",
    }
}

choices! {
    /// How the sequence of sweeps is accelerated.
    pub enum Acceleration {
        /// Nothing.
        None = "none",
        /// The Chebyshev semi-iterative method (Wang 2015).
        Chebyshev = "chebyshev",
        /// Anderson acceleration, type II (Peng et al. 2018).
        Anderson = "anderson",
    }
}

choices! {
    /// The unknowns that Anderson acceleration mixes.
    pub enum AndersonOn {
        /// Positions alone: the multipliers lag behind and the body becomes too stiff.
        Positions = "positions",
        /// Multipliers alone, positions recomputed from them: diverges under strong stress.
        Multipliers = "multipliers",
        /// Both with the same weights, which keeps them consistent.
        Both = "both",
    }
}

choices! {
    /// How Anderson's accelerated iterates are kept in bounds.
    pub enum AndersonGuard {
        /// Nothing.
        None = "none",
        /// A grown residual restarts the history. It does not bound the energy.
        Residual = "residual",
        /// An accelerated iterate that raises the incremental potential is rejected for the plain sweep, and
        /// at the second failure in a row for a step of descent; acts where steps are guarded, elsewhere as
        /// `residual`.
        Energy = "energy",
    }
}

choices! {
    /// The constraints of a stable neo-Hookean tetrahedron.
    pub enum NeoHookean {
        /// `stretch` with `rebase`, otherwise `pair`.
        Auto = "auto",
        /// Volume and norm of the deformation gradient, as published.
        Pair = "pair",
        /// Six components of the stretch: right at rest and in motion. Needs `rebase`.
        Stretch = "stretch",
    }
}

choices! {
    /// Where the iteration of a substep starts.
    pub enum Start {
        /// `inertial` where multipliers are kept, otherwise `predicted`; where nothing holds the tissue, `inertial` with
        /// the acceleration of its centre of mass.
        Auto = "auto",
        /// x + h v + h^2 g.
        Predicted = "predicted",
        /// x + h v: kept multipliers already balance gravity.
        Inertial = "inertial",
        /// x of the last substep.
        Previous = "previous",
    }
}

settings_table! {
    #[default]
    /// How a step is solved.
    pub struct SolverSettings {
        /// Floating point format of the simulation state.
        precision: Precision = (Precision::F32), one_of::<Precision>();
        /// How positions and velocities are advanced. "auto" takes the cheaper one of
        /// "quasi_newton" and "explicit" that is as accurate as `accuracy` asks; on a `device` that is asked for by name,
        /// "quasi_newton". "xpbd" sweeps over constraints. "quasi_newton" solves
        /// every substep to its end in a dozen passes over the mesh, whatever its size; of the settings below it uses
        /// `accuracy`, `substeps`, `iterations`, `integrator`, `history`, `threads` and `device`. "explicit"
        /// divides every substep into as many small steps as it takes to be stable; it uses `explicit_safety`,
        /// `threads` and `device`. It loses no motion to damping, and it is the cheapest for small soft bodies;
        /// its cost grows with the square root of the stiffness, and with fineness once more.
        method: Method = (Method::Auto), one_of::<Method>();
        /// The error of motion that "auto" and "quasi_newton" choose substeps and passes for, as a share of the displacement of each
        /// body, over half a second: "draft" for 0.15, "standard" for 0.05, "fine" for 0.005, or a number. A body that moves by less
        /// than a twentieth of what the softest one does is measured by that twentieth. Rest does not depend on it.
        accuracy: Accuracy = (Accuracy::Standard), Accuracies;
        /// What tetrahedra of stable neo-Hookean tissue are. "recovered": on the same vertices, each also sees how its
        /// neighbours are deformed; coarse meshes bend as fine ones do. "quasi_newton" and "explicit" have them.
        /// "plain": linear ones, with which coarse meshes bend too little, four cells across by 16 % at a Poisson's ratio
        /// of 0.3, by half at 0.49; a step costs a third. "auto": "recovered" where method and device have it, otherwise "plain".
        elements: Elements = (Elements::Auto), one_of::<Elements>();
        /// The share of the largest stable step of the body at rest that "explicit" takes. On the CPU smaller ones are taken
        /// by themselves where tissue stiffens under strong deformation; a device, which keeps to it, takes half of the
        /// stable step at most: lower this where a run diverges there. "auto" takes smaller ones where `accuracy` asks for them.
        explicit_safety: f64 = 0.8, number(at_least(1e-3).up_to(1.0));
        /// Substeps per frame: "auto" for what suits the method, 10 for "xpbd", for "explicit" one for
        /// every 32 small steps and 10 at most, for "quasi_newton" as many as `accuracy` and the oscillations of what the scene's fixings hold ask for, with "standard" from
        /// 1 to 10. More lose less motion to numerical damping and follow it more closely; the cost grows alike. With `rebase`
        /// and `keep_multipliers` the shape at rest does not depend on them; plain XPBD needs about 50 for
        /// an error near 1 %.
        substeps: Count = (Count::Auto), SUBSTEPS;
        /// Sweeps per substep: "auto" for what suits the method, 2 for "xpbd". Of "quasi_newton" passes for each of
        /// its two solves per substep, "auto" by Poisson's ratio: 8 up to 0.38, 10 up to 0.46, above it 20, and up to twice
        /// as many where less error is asked for than with "standard".
        /// More solve a substep better.
        /// Without `rebase` they approach an answer that depends on the path, so more are not always closer
        /// to the truth.
        iterations: Count = (Count::Auto), ITERATIONS;
        /// How "quasi_newton" integrates over time: "sdirk2" follows the motion to the second order of the step,
        /// "implicit_euler" damps it. Both come to the same rest.
        integrator: Integrator = (Integrator::Sdirk2), one_of::<Integrator>();
        /// How many past steps "quasi_newton" learns the curvature from; 0 chooses by Poisson's ratio: 3 up to 0.38, then 10.
        history: u32 = 0, whole(0, MOST_HISTORY as u32);
        /// Colours of the constraint graph: "unlimited" for Gauss-Seidel, 1 for Jacobi, a few
        /// for clique separation. Fewer run more in parallel and need more sweeps.
        colors: Colors = (Colors::Unlimited), COLORS;
        /// "none", or how many tetrahedra a cluster has at most, for example 512. Clusters have colours, those that share a vertex
        /// different ones, and so have the tetrahedra in each: a workgroup of a device, or a thread, sweeps a whole cluster.
        /// A sweep is then about 4 dispatches instead of 38. Rest is the same; in motion the order of constraints differs.
        /// Needs `colors = "unlimited"`; a page has none.
        clusters: Clusters = (Clusters::None), CLUSTERS;
        /// Over-relaxation factor omega. Above 1 hurries, below 1 calms. Safe up to 1.8 for one
        /// colour, 1.5 for a few, about 1.2 for unlimited; beyond that sweeps overshoot and may
        /// diverge. With `rebase` and one colour only 1 is safe.
        relaxation: f64 = 1.0, number(at_least(1e-3).below(2.0));
        /// The unknowns that over-relaxation scales.
        relaxation_form: RelaxationForm = (RelaxationForm::Consistent), one_of::<RelaxationForm>();
        /// How the sequence of sweeps of a substep is accelerated. Pays with several iterations only.
        acceleration: Acceleration = (Acceleration::None), one_of::<Acceleration>();
        /// Chebyshev's estimate rho of how much of the error a sweep leaves; 0 measures it from the
        /// ratio of successive steps. Too small gains nothing, too large blows up: with unlimited
        /// colours from about 0.97.
        chebyshev_radius: f64 = 0.0, number(at_least(0.0).below(1.0));
        /// Plain sweeps before Chebyshev begins. Fewer let it amplify the rough errors of the first
        /// sweeps, more leave it less to gain.
        chebyshev_delay: u32 = 10, whole(1, 10_000);
        /// Chebyshev's under-relaxation gamma; 0.6 to 1 is usual. Smaller is calmer and slower.
        chebyshev_damping: f64 = 1.0, number(at_least(1e-3).up_to(1.0));
        /// How many past sweeps Anderson mixes. Longer windows converge faster until the
        /// small least-squares problem becomes ill-conditioned, in single precision sooner.
        anderson_window: u32 = 5, whole(1, 10);
        /// The unknowns that Anderson mixes.
        anderson_on: AndersonOn = (AndersonOn::Both), one_of::<AndersonOn>();
        /// How Anderson's accelerated iterates are kept in bounds. Without a guard a bad one can throw a
        /// strongly deformed body. "residual" restarts the history where the residual has grown, which bounds
        /// no energy (`step_guard` does that for the whole step); "energy" rejects every accelerated iterate
        /// that raises the incremental potential, for one to two evaluations of it per sweep: fewer steps are
        /// rejected, but with few colours stiff tissue may stay far from its rest. It acts with `step_guard`
        /// (without it as "residual").
        anderson_guard: AndersonGuard = (AndersonGuard::Residual), one_of::<AndersonGuard>();
        /// Stabilised rebase before each sweep: positions are pulled back onto the multipliers,
        /// so that the iteration converges to implicit Euler exactly. One more pass over the
        /// tetrahedra per sweep. Turn it off together with `keep_multipliers` for XPBD as
        /// published, whose stiffness depends on substeps and iterations.
        rebase: bool = true, truth();
        /// The share theta of the rebase that is applied; 0 chooses: 1 for unlimited colours, 1/4
        /// for one colour, 1/2 between. The fixed point is the same for all; the fewer the colours,
        /// the smaller the share at which the iteration is stable. A share below 1 leaves
        /// (1 - theta)^iterations of inertia undone in every substep, so that motion (not rest) is
        /// slower: give few colours more iterations.
        rebase_factor: f64 = 0.0, number(at_least(0.0).up_to(1.0));
        /// Keep the multipliers from step to step. With `rebase` this makes the stiffness
        /// independent of the number of iterations; without it the body freezes.
        keep_multipliers: bool = true, truth();
        /// Reject a step that ends at a higher incremental potential (inertia, tissue with its
        /// viscosity, springs) than the best of its possible starts, and slow down tissue that would end it
        /// with more mechanical energy than it had and was given. Acts with `rebase`; XPBD as published has
        /// no potential that it lowers. Without the guard stiff tissue with few iterations per frame may never
        /// settle.
        step_guard: bool = true, truth();
        /// The constraints of a stable neo-Hookean tetrahedron. With `rebase` the pair comes to the
        /// right rest as well, but slowly: it moves as if it were heavier.
        neo_hookean: NeoHookean = (NeoHookean::Auto), one_of::<NeoHookean>();
        /// Threads: "auto" for one per processor where the mesh is large enough to gain by it (16,000
        /// tetrahedra). The result is the same to the bit for any number.
        threads: Threads = (Threads::Auto), THREADS;
        /// The device that computes the steps: "auto" for a graphics processor where the mesh is large enough to
        /// gain by it and `precision` is "f32", otherwise and where that fails the CPU; "cpu"; "gpu"
        /// for the first graphics adapter; or part of an adapter's name, of those that `viscera
        /// devices` lists. Devices agree to round-off, not to the bit.
        device: DeviceRequest = (DeviceRequest::Auto), DeviceNames;
        /// Where the iteration of a substep starts.
        start: Start = (Start::Auto), one_of::<Start>();
    }
}

/// Settings that only "xpbd" uses.
const OF_XPBD: [&str; 16] = [
    "colors",
    "clusters",
    "relaxation",
    "relaxation_form",
    "acceleration",
    "chebyshev_radius",
    "chebyshev_delay",
    "chebyshev_damping",
    "anderson_window",
    "anderson_on",
    "anderson_guard",
    "rebase",
    "rebase_factor",
    "keep_multipliers",
    "step_guard",
    "neo_hookean",
];

/// What "auto" stands for in `substeps` and `iterations`.
struct AutomaticCounts {
    substeps: u32,
    iterations: u32,
}

/// Those of XPBD; the explicit method takes the substeps. With fewer substeps numerical damping takes visibly more of a
/// motion; with a single sweep in each, multipliers trail behind it.
const SHORT_STEPS: AutomaticCounts = AutomaticCounts { substeps: 10, iterations: 2 };

/// Those of large steps that are solved well: a stiff body takes more, as its oscillations ask.
const LONG_STEPS: AutomaticCounts = AutomaticCounts { substeps: 1, iterations: 8 };

impl SolverSettings {
    /// The defaults of the published method and what became of it, on linear tetrahedra: another method put in its place has
    /// these as well, so that the two can be compared.
    pub fn xpbd() -> Self {
        Self { method: Method::Xpbd, elements: Elements::Plain, ..Self::default() }
    }

    /// For a solver that has nothing but a model to choose by: "auto" is the quasi-Newton method.
    pub fn of_solver(&self) -> Self {
        self.chosen(Method::QuasiNewton)
    }

    /// With this method in the place of "auto", and the elements that it has.
    pub(crate) fn chosen(&self, method: Method) -> Self {
        let method = if self.method == Method::Auto { method } else { self.method };
        let is_on_device = matches!(self.device, DeviceRequest::Gpu | DeviceRequest::Named(_));
        Self { method, elements: self.elements_of(method, is_on_device), ..self.clone() }
    }

    /// The elements of a method.
    fn elements_of(&self, method: Method, is_on_device: bool) -> Elements {
        let has_recovered = match method {
            Method::QuasiNewton => true,
            Method::Explicit => !is_on_device || cfg!(feature = "gpu-solves"),
            Method::Xpbd | Method::Auto => false,
        };
        match self.elements {
            Elements::Auto if has_recovered => Elements::Recovered,
            Elements::Auto => Elements::Plain,
            asked => asked,
        }
    }

    /// As [`SolverSettings::chosen`], where a device computes, whatever its name: "auto" is the quasi-Newton method, which
    /// moves as far as the same scene does on the CPU and takes an eighth of XPBD's dispatches; XPBD in a build without it.
    pub(crate) fn chosen_on_device(&self) -> Self {
        let has_solves = cfg!(feature = "gpu-solves");
        let automatic = if has_solves { Method::QuasiNewton } else { Method::Xpbd };
        let method = if self.method == Method::Auto { automatic } else { self.method };
        Self { method, elements: self.elements_of(method, true), ..self.clone() }
    }

    /// Keys with a value of their own that only "xpbd" uses, where the method is another one.
    pub fn unused(&self) -> Vec<&'static str> {
        if self.method == Method::Xpbd {
            return Vec::new();
        }
        let (own, usual) = (self.values().into_iter(), Self::default().values());
        let is_own = |(key, value): &(&str, String)| {
            usual.iter().any(|(name, usual)| name == key && usual != value)
        };
        own.filter(is_own).map(|(key, _)| key).filter(|key| OF_XPBD.contains(key)).collect()
    }

    /// Substeps per frame; what "auto" stands for where it is chosen.
    pub fn substeps(&self) -> u32 {
        match self.substeps {
            Count::Auto => self.automatic_counts().substeps,
            Count::Of(count) => count,
        }
    }

    /// Iterations per substep; what "auto" stands for where it is chosen. The explicit method has none.
    pub fn iterations(&self) -> u32 {
        match self.iterations {
            Count::Auto => self.automatic_counts().iterations,
            Count::Of(count) => count,
        }
    }

    /// What "auto" stands for with this method.
    fn automatic_counts(&self) -> AutomaticCounts {
        match self.method {
            Method::Xpbd | Method::Explicit => SHORT_STEPS,
            Method::Auto | Method::QuasiNewton => LONG_STEPS,
        }
    }

    /// Whether steps are guarded: published XPBD is shown as it is.
    pub(crate) fn guards_steps(&self) -> bool {
        self.step_guard && self.rebase && self.method == Method::Xpbd
    }

    /// Whether the method knows contact: in XPBD it is part of the rebase.
    pub(crate) fn takes_contact(&self) -> bool {
        self.rebase || self.method != Method::Xpbd
    }

    /// The guard of Anderson's accelerated iterates that is in force.
    pub(crate) fn guard_of_mixtures(&self) -> AndersonGuard {
        match self.anderson_guard {
            AndersonGuard::Energy if !self.guards_steps() => AndersonGuard::Residual,
            chosen => chosen,
        }
    }

    /// Every key and its value as one would write it, for the record of a run.
    pub fn values(&self) -> Vec<(&'static str, String)> {
        let mut values = Vec::new();
        Table::values(self, &mut values);
        values
    }
}

/// Reads a count, or the word that stands for none.
struct CountOr<T> {
    word: &'static str,
    limits: Whole,
    make: fn(Option<u32>) -> T,
    count: fn(&T) -> Option<u32>,
}

const COLORS: CountOr<Colors> = CountOr {
    word: "unlimited",
    limits: whole(1, u32::MAX),
    make: |count| count.map_or(Colors::Unlimited, Colors::Limited),
    count: |colors| match colors {
        Colors::Unlimited => None,
        Colors::Limited(count) => Some(*count),
    },
};

const CLUSTERS: CountOr<Clusters> = CountOr {
    word: "none",
    limits: whole(16, 4096),
    make: |count| count.map_or(Clusters::None, Clusters::OfTets),
    count: |clusters| match clusters {
        Clusters::None => None,
        Clusters::OfTets(count) => Some(*count),
    },
};

/// "auto" or a whole number within limits.
const fn count(limits: Whole) -> CountOr<Count> {
    CountOr {
        word: "auto",
        limits,
        make: |count| count.map_or(Count::Auto, Count::Of),
        count: |count| match count {
            Count::Auto => None,
            Count::Of(count) => Some(*count),
        },
    }
}

const SUBSTEPS: CountOr<Count> = count(whole(1, 1000));

const ITERATIONS: CountOr<Count> = count(whole(1, 10_000));

const THREADS: CountOr<Threads> = CountOr {
    word: "auto",
    limits: whole(1, MOST_THREADS),
    make: |count| count.map_or(Threads::Auto, Threads::Count),
    count: |threads| match threads {
        Threads::Auto => None,
        Threads::Count(count) => Some(*count),
    },
};

impl<T> Kind for CountOr<T> {
    type Value = T;

    fn read(&self, key: &str, node: &Node) -> Result<T, SettingError> {
        match &node.value {
            Value::Text(text) if text == self.word => Ok((self.make)(None)),
            Value::Text(_) => {
                let hint = format!("did you mean \"{}\"? Or write a whole number", self.word);
                Err(value_error(key, node, ValueError::Choice { hint }))
            }
            _ => self.limits.read(key, node).map(|count| (self.make)(Some(count))),
        }
    }

    fn type_text(&self) -> String {
        format!("\"{}\" or a whole number", self.word)
    }

    fn value_text(&self, value: &T) -> String {
        (self.count)(value).map_or(format!("\"{}\"", self.word), |count| count.to_string())
    }

    fn range_text(&self) -> String {
        self.limits.range_text()
    }
}
