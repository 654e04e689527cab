//! A scene brought to rest by the library's solver, and the same by the reference.

use anyhow::{Context as _, Result};
use viscera::measure::measure_tets;
use viscera::model::Model;
use viscera::scalar::{Real, Vec3};
use viscera::settings::SolverSettings;
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

use crate::load_cases::{FRAME_RATE, LoadCase};
use viscera_reference::{Reference, Standing};

/// Frames of a settling: three seconds.
pub const FRAMES: u32 = 180;

/// Share of the velocities that is left after each frame.
pub const KEPT_VELOCITY: f64 = 0.9;

/// A frame counts as moving while its root mean square speed is above this share of the fastest
/// frame's so far.
const STILL: f64 = 0.01;

/// Parts of the path that the reference takes one after the other, so that it ends in the state that
/// the motion leads to.
const PATH_PARTS: u32 = 8;

/// Where the solver came to.
#[derive(Clone, Debug)]
pub struct Settled {
    /// Positions [m], shape [vertex_count].
    pub positions: Vec<Vec3<f64>>,
    /// Share of all steps that the guard rejected.
    pub rejected: f64,
    /// Share of the steps that the guard rejected in frames in which the body moved.
    pub rejected_moving: f64,
    /// Root mean square speed [m/s] in the last frame.
    pub speed: f64,
    /// Forces [N] by which pins hold their vertices, in the order of the scene's inputs: what is
    /// fixed, then what is driven.
    pub pin_forces: Vec<Vec3<f64>>,
}

/// Runs a scene for [`FRAMES`] frames of one sixtieth of a second each, all velocities times
/// [`KEPT_VELOCITY`] after each.
pub fn settle<S: Real>(load_case: &LoadCase, settings: &SolverSettings) -> Result<Settled> {
    settle_with(load_case, settings, |_: &mut AfterStep<'_, S>| Ok(()))
}

/// What a settling has come to, for a caller who has a hand in it.
pub struct AfterStep<'a, S> {
    /// The scene's.
    pub model: &'a Model<S>,
    /// What moves it.
    pub solver: &'a mut Solver<S>,
    /// At the end of a step.
    pub state: &'a mut State<S>,
    /// Of the last step.
    pub inputs: &'a Inputs<S>,
    /// The length of a step [s].
    pub dt: f64,
}

/// The same, with `after` called at the end of every step.
pub fn settle_with<S: Real>(
    load_case: &LoadCase,
    settings: &SolverSettings,
    mut after: impl FnMut(&mut AfterStep<'_, S>) -> Result<()>,
) -> Result<Settled> {
    let model = load_case.model::<S>()?;
    let mut solver = Solver::new(&model, settings);
    let mut state = State::at_rest(&model);
    let dt = 1.0 / FRAME_RATE / f64::from(settings.substeps());
    let (mut moving, mut rejected_moving) = (0u64, 0u64);
    let (mut fastest, mut speed) = (0.0f64, 0.0);
    for frame in 0..FRAMES {
        let before = solver.rejected_steps();
        for substep in 1..=settings.substeps() {
            let share = f64::from(substep) / f64::from(settings.substeps());
            let inputs = load_case.inputs(f64::from(frame) + share);
            solver.step(&model, &mut state, &inputs, dt)?;
            let (solver, state) = (&mut solver, &mut state);
            after(&mut AfterStep { model: &model, solver, state, inputs: &inputs, dt })?;
        }
        speed = root_mean_square(&state.velocities);
        fastest = fastest.max(speed);
        if speed > STILL * fastest {
            moving += u64::from(settings.substeps());
            rejected_moving += solver.rejected_steps() - before;
        }
        for velocity in &mut state.velocities {
            *velocity = *velocity * S::from_f64(KEPT_VELOCITY);
        }
    }
    let steps = u64::from(FRAMES) * u64::from(settings.substeps());
    let inputs = load_case.inputs(f64::from(FRAMES));
    let mut balance = ForceBalance::default();
    solver.force_balance(&model, &state, &inputs, &mut balance)?;
    let pin_force = |pin: &Pin<S>| balance.residual[pin.vertex as usize];
    Ok(Settled {
        pin_forces: inputs.pins.iter().map(pin_force).collect(),
        positions: state.positions.iter().map(|x| x.cast()).collect(),
        rejected: solver.rejected_steps() as f64 / steps as f64,
        rejected_moving: rejected_moving as f64 / moving.max(1) as f64,
        speed,
    })
}

fn root_mean_square<S: Real>(values: &[Vec3<S>]) -> f64 {
    let sum: f64 = values.iter().map(|v| v.length_squared().to_f64()).sum();
    (sum / values.len().max(1) as f64).sqrt()
}

/// The state of rest of a scene, by Newton's method.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Positions [m], shape [vertex_count].
    pub positions: Vec<Vec3<f64>>,
    /// Its potential and what is left of the gradient.
    pub standing: Standing,
    /// Volume [m^3] of the body there.
    pub volume: f64,
    /// False where the reference stopped at a saddle.
    pub minimum: bool,
    /// Tetrahedra turned inside out.
    pub inverted: usize,
    /// Forces [N] by which pins hold their vertices, in the order of the scene's inputs.
    pub pin_forces: Vec<Vec3<f64>>,
}

/// Follows the scene's path to its end with the reference.
pub fn truth(load_case: &LoadCase) -> Result<Truth> {
    truth_in_parts(load_case, PATH_PARTS)
}

/// The same with the path in so many parts, for paths that are long.
pub fn truth_in_parts(load_case: &LoadCase, path_parts: u32) -> Result<Truth> {
    let model = load_case.model::<f64>()?;
    let mut reference = Reference::new(&model);
    let mut positions = model.rest_positions.clone();
    let mut minimum = false;
    let moves = !load_case.driven.is_empty() || load_case.holds.iter().any(|hold| hold.driven);
    let parts = if moves { path_parts } else { 1 };
    for part in 1..=parts {
        let share = f64::from(part) / f64::from(parts);
        let inputs = load_case.inputs(share * f64::from(load_case.path_frames));
        let solution = reference
            .settle(&positions, &inputs)
            .with_context(|| format!("the reference of {load_case}"))?;
        positions = solution.positions;
        minimum = solution.convergence.minimum;
    }
    let end = load_case.inputs(f64::INFINITY);
    let standing = reference.standing(&positions, &end)?;
    let pin_forces = reference.reactions(&positions, &end)?;
    let (volume, inverted) = volume(load_case, &positions)?;
    Ok(Truth { positions, standing, volume, minimum, inverted, pin_forces })
}

/// The body's volume [m^3], and how many tetrahedra are inside out.
pub fn volume(load_case: &LoadCase, positions: &[Vec3<f64>]) -> Result<(f64, usize)> {
    let model = load_case.model::<f64>()?;
    let mut tets = Vec::new();
    measure_tets(&model, positions, &mut tets);
    // The measures are in the user's order of tetrahedra.
    let rest = (0..load_case.mesh.tets().len())
        .map(|t| viscera::mesh::tet_volume(load_case.mesh.corners(t)));
    let sum = tets.iter().zip(rest).map(|(tet, rest)| tet.volume_ratio * rest).sum();
    let inverted = tets.iter().filter(|tet| tet.volume_ratio <= 0.0).count();
    Ok((sum, inverted))
}

/// How far places are from the true ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Root mean square distance over root mean square displacement.
    pub rms: f64,
    /// Largest distance over largest displacement.
    pub largest: f64,
    /// Apparent stiffness: the true displacement over ours along it; 1 is right.
    pub stiffness: f64,
}

impl Distance {
    /// Over the vertices given, of positions [m], shape [vertex_count].
    pub fn new(
        rest: &[Vec3<f64>],
        truth: &[Vec3<f64>],
        positions: &[Vec3<f64>],
        vertices: &[u32],
    ) -> Self {
        let (mut error, mut moved, mut along) = (0.0, 0.0, 0.0);
        let (mut largest_error, mut largest_move) = (0.0f64, 0.0f64);
        for v in vertices.iter().map(|&v| v as usize) {
            let (exact, ours) = (truth[v] - rest[v], positions[v] - rest[v]);
            error += (exact - ours).length_squared();
            moved += exact.length_squared();
            along += exact.dot(ours);
            largest_error = largest_error.max((exact - ours).length());
            largest_move = largest_move.max(exact.length());
        }
        Self {
            rms: (error / moved).sqrt(),
            largest: largest_error / largest_move,
            stiffness: moved / along,
        }
    }
}

/// How far a settled state is from the truth.
#[derive(Clone, Copy, Debug)]
pub struct Error {
    /// Root mean square distance over root mean square displacement, free vertices.
    pub rms: f64,
    /// Largest distance over largest displacement.
    pub largest: f64,
    /// Apparent stiffness: the true displacement over ours along it; 1 is right.
    pub stiffness: f64,
    /// Relative error of the volume.
    pub volume: f64,
    /// Unbalanced force of our state over the load, or over the reaction where nothing weighs.
    pub gradient: f64,
    /// Our potential minus the true one, over the true elastic energy.
    pub energy: f64,
    /// Tetrahedra turned inside out.
    pub inverted: usize,
}

impl Error {
    /// True where the state is in balance yet elsewhere: another minimum than the reference's.
    pub fn is_other_minimum(&self) -> bool {
        self.rms > 0.01 && self.gradient < 1e-4
    }
}

/// Compares.
pub fn compare(load_case: &LoadCase, truth: &Truth, positions: &[Vec3<f64>]) -> Result<Error> {
    let model = load_case.model::<f64>()?;
    let reference = Reference::new(&model);
    let inputs = load_case.inputs(f64::INFINITY);
    let rest = load_case.mesh.vertices();
    let distance = Distance::new(rest, &truth.positions, positions, &load_case.free());
    let finite = positions.iter().all(|x| x.is_finite());
    if !finite {
        let lost = f64::INFINITY;
        return Ok(Error {
            rms: lost,
            largest: lost,
            stiffness: f64::NAN,
            volume: lost,
            gradient: lost,
            energy: lost,
            inverted: load_case.mesh.tets().len(),
        });
    }
    let standing = reference.standing(positions, &inputs)?;
    let reaction = truth.pin_forces.iter().map(|r| r.length_squared()).sum::<f64>().sqrt();
    let (volume, inverted) = volume(load_case, positions)?;
    Ok(Error {
        rms: distance.rms,
        largest: distance.largest,
        stiffness: distance.stiffness,
        volume: volume / truth.volume - 1.0,
        gradient: standing.gradient / standing.load.max(reaction),
        energy: (standing.potential - truth.standing.potential) / truth.standing.elastic_energy,
        inverted,
    })
}
