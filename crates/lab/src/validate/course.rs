//! The course of a scene, frame by frame, beside that of small explicit steps.

use anyhow::{Result, anyhow};
use viscera::mesh::TetMesh;
use viscera::mesh::io::gmsh;
use viscera::scalar::{Real, Vec3};
use viscera::scene::Scene;
use viscera::settings::{Method, SolverSettings};
use viscera::simulation::{Assembly, Simulation};

/// Of the largest stable step, small explicit ones take this share: their path changes by less than a
/// thousandth when it is halved.
pub(super) const SAFETY: f64 = 0.25;

/// The truth about motion: small explicit steps.
pub(super) fn small_steps() -> SolverSettings {
    let method = Method::Explicit;
    SolverSettings { method, explicit_safety: SAFETY, ..SolverSettings::xpbd() }
}

/// A scene, ready to run. Where it names a mesh file, that is the mesh given.
pub(super) fn begin<S: Real>(scene: Scene, mesh: Option<&TetMesh>) -> Result<Simulation<S>> {
    let mut load = |file: &str| match mesh {
        Some(mesh) => Ok(gmsh::write(mesh).into_bytes()),
        None => Err(format!("{file}: no files here")),
    };
    let assembly = Assembly::new(&scene, &mut load)?;
    Ok(Simulation::<S>::new(scene, assembly)?)
}

/// Runs a scene to its end; what is measured at its beginning and after each frame.
pub(super) fn follow<S: Real, T>(
    simulation: &mut Simulation<S>,
    measure: impl Fn(&Simulation<S>) -> T,
) -> Result<Vec<T>> {
    let mut measured = vec![measure(simulation)];
    for _ in 0..simulation.scene().frame_count() {
        simulation.advance_frame().map_err(|error| anyhow!("{error}"))?;
        measured.push(measure(simulation));
    }
    Ok(measured)
}

/// Places [m] of some points at the beginning and after each frame.
pub(super) type Places = Vec<Vec<Vec3<f64>>>;

/// Root mean square distance of places from others, over root mean square displacement of those, over all frames.
pub(super) fn distance(ours: &Places, exact: &Places) -> f64 {
    let (mut error, mut moved) = (0.0, 0.0);
    for (ours, places) in ours.iter().zip(exact) {
        for ((x, y), rest) in ours.iter().zip(places).zip(&exact[0]) {
            error += (*x - *y).length_squared();
            moved += (*y - *rest).length_squared();
        }
    }
    (error / moved).sqrt()
}
