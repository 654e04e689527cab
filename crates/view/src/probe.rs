//! The step that comes next, by several methods: how its residual falls with the iterations. On a thread of
//! its own, so that neither the window nor the simulation waits for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use viscera::model::ModelBuilder;
use viscera::scalar::Vec3;
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Colors, Method as Integrator, NeoHookean, Precision,
    SolverSettings, Start, Threads,
};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Solver, StepError};
use viscera::state::State;

/// A method that can be ticked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Method {
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
}

const fn xpbd(exact: bool, jacobi: bool, anderson: bool) -> Method {
    Method::Xpbd { exact, jacobi, anderson }
}

/// All that can be ticked, with their names.
pub const METHODS: [(Method, &str); 8] = [
    (Method::AsSet, "as set"),
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

impl Method {
    /// Its settings: those in force with the method's laid over them, in double precision on one thread.
    fn settings(self, set: &SolverSettings) -> SolverSettings {
        let base = SolverSettings {
            precision: Precision::F64,
            threads: Threads::Count(1),
            iterations: ITERATIONS,
            ..set.clone()
        };
        let Self::Xpbd { exact, jacobi, anderson } = self else { return base };
        SolverSettings {
            method: Integrator::Xpbd,
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

/// What a simulation is before a step, and what acts in it.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Settings in force.
    pub solver: SolverSettings,
    /// Meshes with their materials.
    pub builder: ModelBuilder,
    /// [m], shape [vertex_count].
    pub positions: Vec<Vec3<f64>>,
    /// [m/s], shape [vertex_count].
    pub velocities: Vec<Vec3<f64>>,
    /// What acts in the step.
    pub inputs: Inputs<f64>,
    /// The step [s].
    pub dt: f64,
}

/// One method's curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// The method, in words.
    pub name: String,
    /// Iteration, and unbalanced forces over loads after it; 0 is where the iteration starts.
    pub residuals: Vec<(u32, f64)>,
    /// Why there is none.
    pub problem: Option<String>,
}

/// The step of a moment by one method. Multipliers are those of tissue at its places.
pub fn curve(moment: &Moment, method: Method, name: &str) -> Curve {
    let settings = method.settings(&moment.solver);
    if settings.method == Integrator::Explicit {
        // Its small steps approach nothing.
        let problem = Some("the explicit method has no iterations".to_owned());
        return Curve { name: name.to_owned(), residuals: Vec::new(), problem };
    }
    let (residuals, problem) = match moment.builder.build::<f64>(&settings) {
        Ok(model) => match residuals(moment, &model, &settings) {
            Ok(residuals) => (residuals, None),
            Err(error) => (Vec::new(), Some(error.to_string())),
        },
        Err(error) => (Vec::new(), Some(error.to_string())),
    };
    Curve { name: name.to_owned(), residuals, problem }
}

fn residuals(
    moment: &Moment,
    model: &viscera::model::Model<f64>,
    settings: &SolverSettings,
) -> Result<Vec<(u32, f64)>, StepError> {
    let Moment { inputs, dt, .. } = moment;
    let mut solver = Solver::new(model, settings);
    let mut state = State::at_rest(model);
    state.positions.clone_from(&moment.positions);
    state.velocities.clone_from(&moment.velocities);
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

/// The thread, seen from who gives it moments.
#[derive(Debug)]
pub struct Prober {
    moments: Sender<(Moment, Vec<Method>)>,
    busy: Arc<AtomicBool>,
}

impl Prober {
    /// Starts the thread; it ends with this. `tell` gets the curves of each moment.
    pub fn start(tell: impl Fn(Vec<Curve>) + Send + 'static) -> std::io::Result<Self> {
        let (moments, receive) = channel::<(Moment, Vec<Method>)>();
        let busy = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&busy);
        std::thread::Builder::new().name("convergence".to_owned()).spawn(move || {
            for (moment, methods) in receive {
                let ticked = METHODS.iter().filter(|(method, _)| methods.contains(method));
                tell(ticked.map(|&(method, name)| curve(&moment, method, name)).collect());
                flag.store(false, Ordering::Release);
            }
        })?;
        Ok(Self { moments, busy })
    }

    /// Whether it would begin at once.
    pub fn is_idle(&self) -> bool {
        !self.busy.load(Ordering::Acquire)
    }

    /// Gives it a moment; one at a time.
    pub fn probe(&self, moment: Moment, methods: Vec<Method>) {
        self.busy.store(true, Ordering::Release);
        // Without its thread it stays busy.
        let _ = self.moments.send((moment, methods));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scene::Scene;
    use viscera::simulation::{Assembly, Simulation};

    fn moment() -> Moment {
        let text = include_str!("../../../scenes/grab.toml");
        let scene = Scene::parse("grab.toml", text, &[]).expect("a scene");
        let assembly = Assembly::new(&scene, &mut |f| Err(f.to_owned())).expect("an assembly");
        let mut simulation = Simulation::<f64>::new(scene, assembly).expect("a simulation");
        for _ in 0..12 {
            simulation.advance().expect("a frame");
        }
        let dt = simulation.scene().time.frame / f64::from(simulation.scene().solver.substeps);
        Moment {
            solver: simulation.scene().solver.clone(),
            builder: simulation.assembly().builder.clone(),
            positions: simulation.state().positions.clone(),
            velocities: simulation.state().velocities.clone(),
            inputs: simulation.inputs_at(simulation.time() + dt),
            dt,
        }
    }

    #[test]
    fn the_exact_form_ends_in_balance_and_anderson_hurries_it() {
        let moment = moment();
        let last = |method| {
            let curve = curve(&moment, method, "method");
            assert_eq!(curve.problem, None);
            let (first, end) = (curve.residuals.first(), curve.residuals.last());
            assert_eq!(end.map(|(iteration, _)| *iteration), Some(ITERATIONS));
            (first.map_or(0.0, |r| r.1), end.map_or(1.0, |r| r.1))
        };
        let (start, exact) = last(xpbd(true, false, false));
        let (_, jacobi) = last(xpbd(true, true, false));
        let (_, anderson) = last(xpbd(true, true, true));
        let (_, published) = last(xpbd(false, false, false));
        // Gauss-Seidel sweeps take at least a tenth off in each: (0.9)^64 is about 1e-3.
        assert!(exact < 1e-3 * start, "{exact} of {start}");
        assert!(anderson < jacobi && exact < published, "{anderson} {jacobi}; {exact} {published}");
    }
}
