//! One step whose exact end is known, and how methods come near it.
//!
//! Error of positions `x`: `|x - x*|_M / |xt - x*|_M`, with `x*` the minimum of the incremental potential
//! by Newton's method, and `xt` the inertial prediction, from which everybody could start.

use anyhow::{Context as _, Result};
use std::time::Instant;
use viscera::measure::measure_tets;
use viscera::model::Model;
use viscera::scalar::{Real, Vec3};
use viscera::settings::{Count, SolverSettings};
use viscera::solver::gpu::GpuSolver;
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

use crate::load_cases::{FRAME_RATE, LoadCase};
use viscera_reference::Reference;

/// Beyond this a curve has left the scene: it is cut there.
const LOST: f64 = 1e6;

/// A step of a frame, from a state that exact implicit Euler has led to.
pub struct MeasuredStep {
    /// Body and what happens to it.
    pub load_case: LoadCase,
    /// At the beginning of the step.
    pub state: State<f64>,
    /// [s].
    pub dt: f64,
    /// Where all vertices are [m] at the end, exactly.
    pub exact: Vec<Vec3<f64>>,
    /// In the middle of things: frames before this one.
    pub history: u32,
    masses: Vec<f64>,
    /// Of the prediction, in the norm of the masses.
    start_error: f64,
    /// Root mean square Green strain of the exact end.
    strain: f64,
}

/// How a method comes near: errors after 0, 1, 2, ... iterations.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Where the method starts, then after each iteration.
    pub errors: Vec<f64>,
    /// Root mean square Green strain at the end over the true one.
    pub strain_ratio: f64,
}

/// What an iteration or a frame costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Passes over the mesh that wait for each other: dispatches of the GPU backend.
    pub passes: usize,
    /// On one thread of this machine [s].
    pub seconds: f64,
}

impl MeasuredStep {
    /// The step of a frame after so many frames of the scene.
    pub fn new(load_case: LoadCase, history: u32) -> Result<Self> {
        Self::after(load_case, history, 1.0 / FRAME_RATE)
    }

    /// A step of `dt` [s] after so many frames of the scene.
    pub fn after(load_case: LoadCase, history: u32, dt: f64) -> Result<Self> {
        let model = load_case.model::<f64>()?;
        let mut reference = Reference::new(&model);
        let mut state = State::at_rest(&model);
        let mut advance = |state: &mut State<f64>, frame: f64, dt: f64| {
            let inputs = load_case.inputs(frame);
            reference
                .step(state, &inputs, dt)
                .with_context(|| format!("the reference of {load_case}, frame {frame}"))
        };
        for frame in 1..=history {
            advance(&mut state, f64::from(frame), 1.0 / FRAME_RATE)?;
        }
        let mut end = state.clone();
        advance(&mut end, f64::from(history) + dt * FRAME_RATE, dt)?;
        Self::between(load_case, history, dt, state, end.positions)
    }

    /// A step of `dt` [s] from a state that stands after so many frames of the scene, however it came there,
    /// and where all vertices are [m] at its exact end.
    pub fn between(
        load_case: LoadCase,
        history: u32,
        dt: f64,
        state: State<f64>,
        exact: Vec<Vec3<f64>>,
    ) -> Result<Self> {
        let masses = load_case.model::<f64>()?.masses.clone();
        let (start_error, strain) = (1.0, 1.0);
        let mut step = Self { load_case, state, dt, exact, history, masses, start_error, strain };
        let predicted = step.predicted();
        step.start_error = step.error(&predicted);
        step.strain = step.strain_of(&step.exact)?;
        Ok(step)
    }

    /// Where inertia and gravity alone would lead [m], pins moved.
    pub fn predicted(&self) -> Vec<Vec3<f64>> {
        let mut predicted = self.state.positions.clone();
        let (inputs, dt) = (self.inputs::<f64>(), self.dt);
        for (x, v) in predicted.iter_mut().zip(&self.state.velocities) {
            *x += *v * dt + inputs.gravity * (dt * dt);
        }
        for pin in &inputs.pins {
            predicted[pin.vertex as usize] = pin.target;
        }
        predicted
    }

    /// What acts during the step.
    pub fn inputs<S: Real>(&self) -> Inputs<S> {
        self.load_case.inputs(self.time(1.0))
    }

    /// In frames, after a share of the step.
    fn time(&self, share: f64) -> f64 {
        f64::from(self.history) + share * (self.dt * FRAME_RATE)
    }

    /// How far positions [m] are from the exact end.
    pub fn error(&self, positions: &[Vec3<f64>]) -> f64 {
        self.distance(positions, &self.exact)
    }

    /// How far positions [m] are from others, in the same measure.
    pub fn distance(&self, positions: &[Vec3<f64>], others: &[Vec3<f64>]) -> f64 {
        let distances = positions.iter().zip(others).map(|(x, y)| (*x - *y).length_squared());
        let sum: f64 = distances.zip(&self.masses).map(|(d, m)| d * m).sum();
        sum.sqrt() / self.start_error
    }

    /// Root mean square Green strain over the body's volume.
    fn strain_of(&self, positions: &[Vec3<f64>]) -> Result<f64> {
        let model = self.load_case.model::<f64>()?;
        let mut tets = Vec::new();
        measure_tets(&model, positions, &mut tets);
        let squared = |stretches: [f64; 3]| -> f64 {
            stretches.iter().map(|s| (0.5 * (s * s - 1.0)).powi(2)).sum()
        };
        let sum: f64 = tets.iter().map(|tet| tet.rest_volume * squared(tet.stretches)).sum();
        Ok((sum / tets.iter().map(|tet| tet.rest_volume).sum::<f64>()).sqrt())
    }

    /// A method on this step. Steps of its own begin with its own rules, but where multipliers are kept:
    /// the exact steps before have left those that answer to the positions.
    pub fn follow<S: Real>(&self, settings: &SolverSettings) -> Result<Curve> {
        let model = self.load_case.model::<S>()?;
        let (mut solver, mut state) = self.begin(&model, settings)?;
        let mut errors = Vec::with_capacity(settings.iterations() as usize + 1);
        let mut last = self.exact.clone();
        solver.step_watched(&model, &mut state, &self.inputs(), self.dt, |_, x| {
            let error = self.error(x);
            if errors.last().is_none_or(|last| *last < LOST) {
                errors.push(if error.is_finite() { error } else { f64::INFINITY });
                last.copy_from_slice(x);
            }
        })?;
        let strain_ratio = self.strain_ratio(&last)?;
        Ok(Curve { errors, strain_ratio })
    }

    /// Strain of positions [m] over the true strain.
    pub fn strain_ratio(&self, positions: &[Vec3<f64>]) -> Result<f64> {
        Ok(self.strain_of(positions)? / self.strain)
    }

    /// Strain of positions [m] over that of others.
    pub fn strain_over(&self, positions: &[Vec3<f64>], others: &[Vec3<f64>]) -> Result<f64> {
        Ok(self.strain_of(positions)? / self.strain_of(others)?)
    }

    /// Where a method has the vertices [m] after its iterations, safeguards of the step included.
    pub fn end<S: Real>(&self, settings: &SolverSettings) -> Result<Vec<Vec3<f64>>> {
        let model = self.load_case.model::<S>()?;
        let (mut solver, mut state) = self.begin(&model, settings)?;
        for (inputs, dt) in self.substeps(settings.substeps()) {
            solver.step(&model, &mut state, &inputs, dt)?;
        }
        Ok(state.positions.iter().map(|x| x.cast()).collect())
    }

    /// The step divided into so many: what acts in each, and how long it is [s].
    pub fn substeps<S: Real>(&self, count: u32) -> impl Iterator<Item = (Inputs<S>, f64)> {
        (1..=count).map(move |substep| {
            let share = f64::from(substep) / f64::from(count);
            (self.load_case.inputs(self.time(share)), self.dt / f64::from(count))
        })
    }

    /// A solver, and the state at the beginning.
    pub fn begin<S: Real>(
        &self,
        model: &Model<S>,
        settings: &SolverSettings,
    ) -> Result<(Solver<S>, State<S>)> {
        let mut solver = Solver::new(model, settings);
        let mut state = State::at_rest(model);
        state.positions = self.state.positions.iter().map(|x| x.cast()).collect();
        state.velocities = self.state.velocities.iter().map(|v| v.cast()).collect();
        let before: Inputs<S> = self.load_case.inputs(self.time(0.0));
        let dt = self.dt / f64::from(settings.substeps());
        solver.restart(model, &mut state, &before, dt)?;
        Ok((solver, state))
    }

    /// What an iteration of a method costs, in single precision on one thread.
    pub fn cost(&self, settings: &SolverSettings) -> Result<Cost> {
        const ITERATIONS: u32 = 20;
        let settings =
            SolverSettings { substeps: Count::Of(1), step_guard: false, ..settings.clone() };
        // A step of so many iterations less one of a single one: what surrounds iterations goes out.
        let of = |iterations| {
            self.frame_cost(&SolverSettings {
                iterations: Count::Of(iterations),
                ..settings.clone()
            })
            .map(|c| c.seconds)
        };
        let seconds = ((of(1 + ITERATIONS)? - of(1)?) / f64::from(ITERATIONS)).max(0.0);
        let model = self.load_case.model::<f32>()?;
        Ok(Cost { passes: GpuSolver::dispatches_of(&model, &settings)[1], seconds })
    }

    /// What a frame of a method costs, with everything around its iterations.
    pub fn frame_cost(&self, settings: &SolverSettings) -> Result<Cost> {
        /// The best of so many, and of so much time [s]: small meshes take microseconds.
        const LEAST: (usize, f64) = (3, 5e-3);
        let threads = viscera::settings::Threads::Count(1);
        let settings = SolverSettings { threads, ..settings.clone() };
        let model = self.load_case.model::<f32>()?;
        let (mut solver, start) = self.begin(&model, &settings)?;
        let inputs: Vec<(Inputs<f32>, f64)> = self.substeps(settings.substeps()).collect();
        let (mut seconds, mut times, mut total) = (f64::INFINITY, 0, 0.0);
        while times < LEAST.0 || total < LEAST.1 {
            let mut state = start.clone();
            let begin = Instant::now();
            for (inputs, dt) in &inputs {
                solver.step(&model, &mut state, inputs, *dt)?;
            }
            let taken = begin.elapsed().as_secs_f64();
            (seconds, times, total) = (seconds.min(taken), times + 1, total + taken);
        }
        let [before, each, after] = GpuSolver::dispatches_of(&model, &settings);
        let step = before + settings.iterations() as usize * each + after;
        Ok(Cost { passes: settings.substeps() as usize * step, seconds })
    }
}

impl Curve {
    /// The first iteration after which the error is at most `level`.
    pub fn first_below(&self, level: f64) -> Option<usize> {
        self.errors.iter().position(|error| *error <= level)
    }

    /// The smallest error.
    pub fn least(&self) -> f64 {
        self.errors.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The error after the last iteration.
    pub fn last(&self) -> f64 {
        self.errors.last().copied().unwrap_or(f64::INFINITY)
    }

    /// Where errors have come to stand, or wander without gain: their median over the last fifth of the
    /// iterations, if that fifth gains less than a twentieth, and less than a tenth of what the ones before
    /// have gained per iteration, in factors. A slow method that is on its way gains alike all the time.
    pub fn plateau(&self) -> Option<f64> {
        let cut = self.errors.len() * 4 / 5;
        let least = |errors: &[f64]| errors.iter().copied().fold(f64::INFINITY, f64::min);
        let (before, after) = (least(&self.errors[..cut]), least(&self.errors[cut..]));
        let (early, late) = (libm::log(self.errors[0] / before), libm::log(before / after));
        // Four fifths came before.
        let stands = late <= (0.1 * early / 4.0).min(libm::log(1.05));
        let mut last = self.errors[cut..].to_vec();
        last.sort_by(f64::total_cmp);
        last.get(last.len() / 2).copied().filter(|_| stands)
    }
}
