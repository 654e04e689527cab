//! Simulations to build, and what does not change while they run.

use std::sync::Arc;
use viscera::scene::Scene;
use viscera::settings::{Accuracy, Count, Method, SolverSettings};
use viscera::simulation::{AssembleError, Assembly};
use viscera_resources::{Memory, MeshFiles, memory};

/// Simulations to build.
#[derive(Debug)]
pub struct BuildRequest {
    /// Larger than in every request before it.
    pub generation: u64,
    /// One scene for each simulation; they differ in their solvers.
    pub scenes: Vec<Scene>,
    /// Whether the last one is the reference, which is left out for large meshes.
    pub ends_with_ghost: bool,
    /// Where mesh files are.
    pub mesh_files: MeshFiles,
}

/// The largest mesh that has a reference beside it [tetrahedra]: it costs twenty iterations for
/// each substep.
pub const MOST_GHOST_TETS: usize = 5000;

/// What does not change while simulations run.
#[derive(Debug)]
pub struct Setup {
    /// That of the request.
    pub generation: u64,
    /// The scene of the first simulation.
    pub scene: Scene,
    /// Meshes and patches.
    pub assembly: Arc<Assembly>,
    /// How many simulations there are.
    pub run_count: usize,
    /// Whether the last of them is the reference.
    pub has_ghost: bool,
}

impl Setup {
    /// Number of tetrahedra of all bodies.
    pub fn tet_count(&self) -> usize {
        tet_count(&self.assembly)
    }

    /// Reads or makes the meshes.
    pub fn assemble(scene: &Scene, mesh_files: &MeshFiles) -> Result<Assembly, AssembleError> {
        Assembly::new(scene, &mut |name| mesh_files.load(name))
    }
}

fn tet_count(assembly: &Assembly) -> usize {
    assembly.bodies.iter().map(|body| body.tets.len()).sum()
}

/// What one iteration over a tetrahedron takes, a sweep or a pass, on a slow core without vector registers [s]. A guess
/// that only has to warn in time: too small, and a window seems to hang; too large, and it asks for nothing.
const SWEEP: f64 = 2e-7;

/// Of a small explicit step, likewise.
const SMALL_STEP: f64 = 5e-8;

/// How many of those a frame usually takes: 50 to 100 on the scenes that come with the program; the model is not there
/// yet that tells it.
const SMALL_STEPS: f64 = 100.0;

/// Substeps that the quasi-Newton method usually chooses with "standard": 1 to 3 on the same scenes. Twice the error takes
/// seven tenths of them.
const STANDARD_SUBSTEPS: f64 = 2.0;

/// Passes of a substep of that method besides those of its two solves.
const BESIDES: f64 = 3.0;

/// A frame that takes longer than this is worth a question [s].
const LONG: f64 = 2.0;

/// What a person should know before waiting for so large a mesh; nothing where it is no matter.
pub fn expectation(assembly: &Assembly, scenes: &[Scene]) -> Option<String> {
    let tets = tet_count(assembly);
    let (mut bytes, mut seconds) = (0, 0.0);
    for scene in scenes {
        bytes += memory::of_run(tets, &scene.solver).0;
        seconds += frame_seconds(tets, &scene.solver);
    }
    let needed = Memory(bytes);
    let free = memory::free();
    let fits = free.is_none_or(|free| needed.0 <= free.0);
    if fits && seconds <= LONG {
        return None;
    }
    let memory = match (fits, free) {
        (false, Some(free)) => format!("about {needed} of memory, of which {free} are free"),
        _ => format!("about {needed} of memory"),
    };
    Some(format!(
        "{tets} tetrahedra: {memory}, and up to {seconds:.0} s for one frame on this processor. Fewer \
         solver.substeps or a coarser mesh (body.NAME.spacing) are quicker; a graphics processor \
         may be much faster."
    ))
}

/// What a frame takes [s], by the method that is foreseen.
fn frame_seconds(tets: usize, solver: &SolverSettings) -> f64 {
    let solver = solver.foreseen();
    let (substeps, iterations) = (f64::from(solver.substeps()), f64::from(solver.iterations()));
    let per_tet = match solver.method {
        Method::Xpbd => substeps * iterations * SWEEP,
        Method::Explicit => SMALL_STEPS * SMALL_STEP,
        Method::Auto | Method::QuasiNewton => {
            let substeps = match solver.substeps {
                Count::Of(_) => substeps,
                Count::Auto => {
                    let finer = Accuracy::Standard.share() / solver.accuracy.share();
                    (STANDARD_SUBSTEPS * finer.sqrt()).max(1.0)
                }
            };
            substeps * (2.0 * iterations + BESIDES) * SWEEP
        }
    };
    tets as f64 * per_tet
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::settings::DeviceRequest;

    #[test]
    fn a_frame_costs_what_the_method_in_force_does() {
        let automatic = SolverSettings::default();
        let with = |method| SolverSettings { method, ..automatic.clone() };
        let seconds = |solver: &SolverSettings| frame_seconds(100_000, solver);
        // Two substeps of two solves of eight passes, and what is besides.
        assert!((seconds(&automatic) - 0.76).abs() < 1e-9, "{}", seconds(&automatic));
        assert_eq!(seconds(&with(Method::QuasiNewton)), seconds(&automatic));
        let named = SolverSettings { device: DeviceRequest::Gpu, ..automatic.clone() };
        assert_eq!(seconds(&named), seconds(&with(Method::QuasiNewton)));
        assert!((seconds(&with(Method::Xpbd)) - 0.4).abs() < 1e-9);
        assert!((seconds(&with(Method::Explicit)) - 0.5).abs() < 1e-9);
        let fine = SolverSettings { accuracy: Accuracy::Fine, ..automatic.clone() };
        let four = SolverSettings { substeps: Count::Of(4), ..automatic };
        assert!(seconds(&fine) > 3.0 * seconds(&four) / 2.0 && seconds(&four) > 1.5);
    }
}
