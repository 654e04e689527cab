//! Simulations to build, and what does not change while they run.

use std::sync::Arc;
use viscera::scene::Scene;
use viscera::settings::SolverSettings;
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

/// What one iteration over a tetrahedron takes, on a slow core without vector registers [s]. A guess that only
/// has to warn in time: too small, and a window seems to hang; too large, and it asks for nothing.
const SWEEP: f64 = 2e-7;

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

fn frame_seconds(tets: usize, solver: &SolverSettings) -> f64 {
    tets as f64 * f64::from(solver.substeps()) * f64::from(solver.iterations()) * SWEEP
}
