//! How near a step comes to the one that is solved to the end.

use super::computers::Stepper;
use super::measurement::Bench;
use super::subjects::hanging;
use anyhow::Result;
use viscera::mesh::TetMesh;
use viscera::model::ModelBuilder;
use viscera::scalar::{Real, Vec3};
use viscera::settings::{Count, Precision, SolverSettings, Threads};
use viscera::solver::Solver;
use viscera::state::State;

/// Steps before the one that is judged, whose solve goes on with what these have learned.
const BEFORE: u32 = 3;
/// Passes that are taken for the end.
const CONVERGED: u32 = 40;

/// The error of a step of the quasi-Newton method, against the same step that the processor solves to the end in double
/// precision, as a share of the error of inertia alone: root mean squares over the vertices.
pub fn left(bench: &Bench<'_>, mesh: &TetMesh, stepper: &mut dyn Stepper, dt: f64) -> Result<f64> {
    let before = stepper.state_after(BEFORE)?;
    let after = stepper.state_after(BEFORE + 1)?;
    let mut builder = ModelBuilder::new();
    builder.add_body(mesh, &bench.entry.tissue()?)?;
    let model = builder.build::<f64>()?;
    let settings = SolverSettings {
        precision: Precision::F64,
        iterations: Count::Of(CONVERGED),
        threads: Threads::Auto,
        ..bench.entry.settings()
    };
    let mut truth = State::at_rest(&model);
    truth.positions = before.positions.iter().map(|x| x.cast()).collect();
    truth.velocities = before.velocities.iter().map(|v| v.cast()).collect();
    let inputs = hanging::<f64>(mesh);
    let moved = truth.positions.iter().zip(&truth.velocities);
    let mut inertia: Vec<_> = moved.map(|(x, v)| *x + *v * dt).collect();
    inputs.pins.iter().for_each(|pin| inertia[pin.vertex as usize] = pin.target);
    Solver::new(&model, &settings).step(&model, &mut truth, &inputs, dt)?;
    Ok(apart(&after.positions, &truth.positions) / apart(&inertia, &truth.positions))
}

fn apart<S: Real>(places: &[Vec3<S>], truth: &[Vec3<f64>]) -> f64 {
    let squared = places.iter().zip(truth).map(|(a, b)| (a.cast::<f64>() - *b).length_squared());
    (squared.sum::<f64>() / truth.len() as f64).sqrt()
}
