//! The step that comes next, by several solvers: how its residual falls with the iterations. On a thread of
//! its own, so that neither the window nor the simulation waits for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use viscera::scalar::Vec3;
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Colors, Count, Elements, Integrator, Method,
    NeoHookean, Precision, SolverSettings, Start, Threads,
};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Solver, StepError};
use viscera::state::State;
use viscera_stage::NextStep;

/// A solver whose convergence can be shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum SolverVariant {
    /// What the panel says, iterations apart.
    AsSet,
    /// One of the family: as published, or exact at rest; in one colour or in as many as it takes; with
    /// Anderson acceleration of positions and multipliers or without.
    Xpbd {
        /// Rebase, kept multipliers and safeguards.
        exact: bool,
        /// One colour.
        jacobi: bool,
        /// Whether it is accelerated.
        anderson: bool,
    },
    /// The quasi-Newton method.
    QuasiNewton,
}

const fn xpbd(exact: bool, jacobi: bool, anderson: bool) -> SolverVariant {
    SolverVariant::Xpbd { exact, jacobi, anderson }
}

/// All that can be ticked, with their names.
pub const VARIANTS: [(SolverVariant, &str); 9] = [
    (SolverVariant::AsSet, "as set"),
    (SolverVariant::QuasiNewton, "quasi-Newton"),
    (xpbd(false, true, false), "published, Jacobi"),
    (xpbd(false, true, true), "published, Jacobi + Anderson"),
    (xpbd(false, false, false), "published, coloured"),
    (xpbd(true, true, false), "exact, Jacobi"),
    (xpbd(true, true, true), "exact, Jacobi + Anderson"),
    (xpbd(true, false, false), "exact, coloured"),
    (xpbd(true, false, true), "exact, coloured + Anderson"),
];

/// Iterations that are watched.
pub const ITERATIONS: u32 = 64;

/// The largest mesh whose steps are repeated like this [tetrahedra]: there it takes a second or two.
pub const MOST_TETS: usize = 20_000;

/// After which iterations the residual is measured: a measurement costs as much as several iterations.
fn is_measured(iteration: u32) -> bool {
    iteration <= 4 || iteration.is_multiple_of(4) || iteration == ITERATIONS
}

impl SolverVariant {
    /// Its settings: those in force with the variant's laid over them, in double precision on one thread.
    fn settings(self, set: &SolverSettings) -> SolverSettings {
        let base = SolverSettings {
            precision: Precision::F64,
            threads: Threads::Count(1),
            iterations: Count::Of(ITERATIONS),
            // One solve: all methods approach the same place.
            integrator: Integrator::ImplicitEuler,
            ..set.clone()
        };
        // Those that all methods have: with others they would approach another place.
        let elements = Elements::Plain;
        let (exact, jacobi, anderson) = match self {
            Self::AsSet => return base,
            Self::QuasiNewton => {
                return SolverSettings { method: Method::QuasiNewton, elements, ..base };
            }
            Self::Xpbd { exact, jacobi, anderson } => (exact, jacobi, anderson),
        };
        SolverSettings {
            method: Method::Xpbd,
            elements,
            relaxation: 1.0,
            colors: if jacobi { Colors::Limited(1) } else { Colors::Unlimited },
            acceleration: if anderson { Acceleration::Anderson } else { Acceleration::None },
            anderson_on: AndersonOn::Both,
            anderson_guard: if exact { AndersonGuard::Residual } else { AndersonGuard::None },
            rebase: exact,
            rebase_factor: 0.0,
            keep_multipliers: exact,
            step_guard: exact,
            neo_hookean: NeoHookean::Auto,
            start: Start::Auto,
            ..base
        }
    }
}

/// The curve of one solver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// The solver, in words.
    pub name: String,
    /// Iteration, and unbalanced forces over loads after it; 0 is where the iteration starts.
    pub residuals: Vec<(u32, f64)>,
    /// Why there is none.
    pub problem: Option<String>,
}

/// The step by one solver. Multipliers are those of tissue at its places.
pub fn curve(next_step: &NextStep, variant: SolverVariant, name: &str) -> Curve {
    let settings = variant.settings(&next_step.solver);
    if settings.method == Method::Explicit {
        // Its small steps approach nothing.
        let problem = Some("the explicit method has no iterations".to_owned());
        return Curve { name: name.to_owned(), residuals: Vec::new(), problem };
    }
    let (residuals, problem) = match next_step.builder.build::<f64>() {
        Ok(model) => match residuals(next_step, &model, &settings) {
            Ok(residuals) => (residuals, None),
            Err(error) => (Vec::new(), Some(error.to_string())),
        },
        Err(error) => (Vec::new(), Some(error.to_string())),
    };
    Curve { name: name.to_owned(), residuals, problem }
}

fn residuals(
    next_step: &NextStep,
    model: &viscera::model::Model<f64>,
    settings: &SolverSettings,
) -> Result<Vec<(u32, f64)>, StepError> {
    let NextStep { inputs, dt, .. } = next_step;
    let mut solver = Solver::new(model, settings);
    let mut state = State::at_rest(model);
    state.positions.clone_from(&next_step.positions);
    state.velocities.clone_from(&next_step.velocities);
    solver.restart(model, &mut state, inputs, *dt)?;
    let mut iterates: Vec<(u32, Vec<Vec3<f64>>)> = Vec::new();
    solver.step_watched(model, &mut state, inputs, *dt, |iteration, places| {
        if is_measured(iteration) {
            iterates.push((iteration, places.to_vec()));
        }
    })?;
    let mut balance = ForceBalance::default();
    let mut residuals = Vec::new();
    for (iteration, places) in iterates {
        state.positions = places;
        solver.force_balance(model, &state, inputs, &mut balance)?;
        residuals.push((iteration, balance.relative_residual()));
    }
    Ok(residuals)
}

/// The handle of the thread that repeats steps.
#[derive(Debug)]
pub struct Prober {
    steps: Sender<(NextStep, Vec<SolverVariant>)>,
    busy: Arc<AtomicBool>,
}

impl Prober {
    /// Starts the thread; it ends with this. `tell` gets the curves of each step.
    pub fn start(tell: impl Fn(Vec<Curve>) + Send + 'static) -> std::io::Result<Self> {
        let (steps, receive) = channel::<(NextStep, Vec<SolverVariant>)>();
        let busy = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&busy);
        std::thread::Builder::new().name("convergence".to_owned()).spawn(move || {
            for (next_step, variants) in receive {
                let ticked = VARIANTS.iter().filter(|(variant, _)| variants.contains(variant));
                tell(ticked.map(|&(variant, name)| curve(&next_step, variant, name)).collect());
                flag.store(false, Ordering::Release);
            }
        })?;
        Ok(Self { steps, busy })
    }

    /// Whether it would begin at once.
    pub fn is_idle(&self) -> bool {
        !self.busy.load(Ordering::Acquire)
    }

    /// Gives it a step; one at a time.
    pub fn probe(&self, next_step: NextStep, variants: Vec<SolverVariant>) {
        self.busy.store(true, Ordering::Release);
        // Without its thread it stays busy.
        let _ = self.steps.send((next_step, variants));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scene::Scene;
    use viscera::simulation::{Assembly, Simulation};

    fn next_step() -> NextStep {
        let text = include_str!("../../../scenes/grab.toml");
        let scene =
            Scene::parse("grab.toml", text, &[("solver.method", "quasi_newton")]).expect("a scene");
        let assembly = Assembly::new(&scene, &mut |f| Err(f.to_owned())).expect("an assembly");
        let mut simulation = Simulation::<f64>::new(scene, assembly).expect("a simulation");
        for _ in 0..12 {
            simulation.advance().expect("a frame");
        }
        let dt = simulation.scene().time.frame / f64::from(simulation.substeps());
        NextStep {
            solver: simulation.solver().clone(),
            builder: simulation.assembly().builder.clone(),
            positions: simulation.state().positions.clone(),
            velocities: simulation.state().velocities.clone(),
            inputs: simulation.inputs_at(simulation.time() + dt),
            dt,
        }
    }

    #[test]
    fn the_exact_form_ends_in_balance_and_anderson_hurries_it() {
        let next_step = next_step();
        let last = |variant| {
            let curve = curve(&next_step, variant, "method");
            assert_eq!(curve.problem, None);
            let (first, end) = (curve.residuals.first(), curve.residuals.last());
            // Quasi-Newton ends where nothing is left to do.
            let ended = end.map(|(iteration, _)| *iteration);
            assert!(ended == Some(ITERATIONS) || variant == SolverVariant::QuasiNewton);
            (first.map_or(0.0, |r| r.1), end.map_or(1.0, |r| r.1))
        };
        let (start, exact) = last(xpbd(true, false, false));
        let (_, jacobi) = last(xpbd(true, true, false));
        let (_, anderson) = last(xpbd(true, true, true));
        let (_, published) = last(xpbd(false, false, false));
        let (quasi_start, quasi_newton) = last(SolverVariant::QuasiNewton);
        assert!(quasi_newton < 1e-5 * quasi_start, "{quasi_newton} of {quasi_start}");
        // Gauss-Seidel sweeps take at least a tenth off in each: (0.9)^64 is about 1e-3.
        assert!(exact < 1e-3 * start, "{exact} of {start}");
        assert!(anderson < jacobi && exact < published, "{anderson} {jacobi}; {exact} {published}");
    }
}
