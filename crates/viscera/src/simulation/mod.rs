//! A scene in motion: inputs from the scene's paths, frames of substeps, and what to report.

mod assemble;
mod device;
#[cfg(feature = "gpu")]
mod gpu;

pub use assemble::{AssembleError, AssembledBody, Assembly, ResolvedPatch};
pub use device::SimulationError;

use crate::measure::{
    DeformationSummary, Energies, TetMeasure, measure_energies, measure_tets, summarize_deformation,
};
use crate::model::Model;
use crate::scalar::lanes::Instructions;
use crate::scalar::{Real, Vec3};
use crate::scene::Scene;
use crate::solver::balance::ForceBalance;
#[cfg(feature = "gpu")]
use crate::solver::gpu::GpuError;
use crate::solver::{Inputs, Pin, Solver, StepError};
use crate::state::State;
use device::Backend;
use std::fmt;

/// Why a frame could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Positions or stresses are no longer numbers.
    #[error(
        "the simulation diverged at {time:.4} s: positions or stresses are no longer numbers; raise \
         solver.substeps, lower solver.relaxation, or turn solver.acceleration off"
    )]
    Diverged {
        /// Simulated time [s].
        time: f64,
    },
    /// A step was refused.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The device failed. What [`Simulation::state`] gives is still that of the last frame.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// What holds or pulls a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PatchKind {
    /// Held in place.
    Fixing,
    /// Moved along a path.
    Motion,
    /// Pulled with a force.
    Force,
}

/// The force on one patch.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PatchForce {
    /// The patch's name in the scene.
    pub name: String,
    /// What holds or pulls it.
    pub kind: PatchKind,
    /// Force [N] of the fixing, tool or load on the tissue: minus internal forces, plus inertia,
    /// minus gravity, summed over the patch.
    pub force: [f64; 3],
    /// Torque [N m] of the same about the middle of the patch.
    pub torque: [f64; 3],
}

impl fmt::Display for PatchForce {
    /// One line of a table, to four decimals unless a precision says otherwise.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(4);
        // What rounds to zero has no sign.
        let smallest = (0..digits).fold(0.5, |smallest, _| 0.1 * smallest);
        let unsigned = |component: f64| if component.abs() < smallest { 0.0 } else { component };
        let ([x, y, z], [a, b, c]) = (self.force.map(unsigned), self.torque);
        let (force, torque) = (x.hypot(y).hypot(z), a.hypot(b).hypot(c));
        write!(
            f,
            "{}: force {force:.digits$} N, as a vector ({x:.digits$}, {y:.digits$}, {z:.digits$}) N, \
             torque {torque:.digits$} N m",
            self.name
        )
    }
}

/// The numbers of one frame.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FrameReport {
    /// Frames computed so far.
    pub frame: u64,
    /// Simulated time [s].
    pub time: f64,
    /// Sum of unbalanced forces on free vertices over the sum of all loads, at the end of the
    /// last substep.
    pub relative_residual: f64,
    /// Estimate of the error of the apparent stiffness, see [`ForceBalance::stiffness_error`].
    pub stiffness_error: f64,
    /// Substeps of this frame that the step guard took back.
    pub rejected_substeps: u64,
    /// Energies [J].
    pub energy: Energies,
    /// Extremes of the deformation.
    pub deformation: DeformationSummary,
    /// Forces on the scene's patches [N].
    pub patches: Vec<PatchForce>,
}

/// A running scene.
#[derive(Debug)]
pub struct Simulation<S> {
    scene: Scene,
    assembly: Assembly,
    model: Model<S>,
    state: State<S>,
    solver: Solver<S>,
    backend: Backend<S>,
    inputs: Inputs<S>,
    balance: ForceBalance,
    tets: Vec<TetMeasure>,
    frame: u64,
    rejected_substeps: u64,
}

impl<S: Real> Simulation<S> {
    /// Builds the model, chooses what computes its steps and takes the memory for them.
    pub fn new(scene: Scene, assembly: Assembly) -> Result<Self, SimulationError> {
        Self::on(scene, assembly, Backend::choose)
    }

    fn on(
        scene: Scene,
        assembly: Assembly,
        choose: impl FnOnce(&Model<S>, &Solver<S>, f64) -> Result<Backend<S>, SimulationError>,
    ) -> Result<Self, SimulationError> {
        let model = assembly.builder.build::<S>(&scene.solver)?;
        let solver = Solver::new(&model, &scene.solver);
        let mut simulation = Self {
            state: State::at_rest(&model),
            backend: choose(&model, &solver, substep_dt(&scene))?,
            solver,
            inputs: inputs_at(&scene, &assembly, 0.0),
            balance: ForceBalance::default(),
            tets: Vec::with_capacity(model.tet_count()),
            frame: 0,
            rejected_substeps: 0,
            model,
            scene,
            assembly,
        };
        measure_tets(&simulation.model, &simulation.state.positions, &mut simulation.tets);
        Ok(simulation)
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Meshes and patches.
    pub fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    /// What does not move.
    pub fn model(&self) -> &Model<S> {
        &self.model
    }

    /// What moves.
    pub fn state(&self) -> &State<S> {
        &self.state
    }

    /// What computes the steps, and why: "CPU: the mesh has 1,280 tetrahedra; a GPU pays from about
    /// 4,000 on".
    pub fn device_choice(&self) -> &str {
        &self.backend.choice
    }

    /// Whether something else than the CPU computes the steps.
    pub fn is_on_device(&self) -> bool {
        self.backend.elsewhere.is_some()
    }

    /// What a person should know of the device: that it was lost and the CPU went on.
    pub fn device_warning(&self) -> Option<&str> {
        self.backend.warning.as_deref()
    }

    /// The CPU's solver, for what it tells of itself.
    pub fn solver(&self) -> &Solver<S> {
        &self.solver
    }

    /// See [`Solver::use_instructions`].
    pub fn use_instructions(&mut self, instructions: Instructions) {
        self.solver.use_instructions(instructions);
    }

    /// Measures of the tetrahedra after the last frame, in the bodies' order.
    pub fn tets(&self) -> &[TetMeasure] {
        &self.tets
    }

    /// Frames computed so far.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        self.frame as f64 * self.scene.time.frame
    }

    /// Advances by one frame and measures it. Where it fails, the simulation stays where it
    /// failed and will fail again.
    pub fn advance_frame(&mut self) -> Result<(), FrameError> {
        let rejected = self.solver.rejected_steps();
        match self.compute_frame() {
            // What a step refuses, the CPU would refuse as well.
            Err(lost) if self.backend.gives_way && !matches!(lost, FrameError::Step(_)) => {
                // The state is still that of the last frame.
                self.backend.give_way(self.time(), &lost);
                self.compute_frame()?;
            }
            computed => computed?,
        }
        self.frame += 1;
        self.rejected_substeps = self.solver.rejected_steps() - rejected;
        if !self.state.is_finite() {
            return Err(FrameError::Diverged { time: self.time() });
        }
        self.solver.force_balance(&self.model, &self.state, &self.inputs, &mut self.balance)?;
        measure_tets(&self.model, &self.state.positions, &mut self.tets);
        // Files and pictures are in single precision: what it cannot hold has run away as well.
        let is_number = |tet: &TetMeasure| {
            (tet.energy_density as f32).is_finite() && (tet.von_mises as f32).is_finite()
        };
        if !self.tets.iter().all(is_number) {
            return Err(FrameError::Diverged { time: self.time() });
        }
        let factor = self.scene.time.velocity_factor;
        if factor != 1.0 {
            for velocity in &mut self.state.velocities {
                *velocity = *velocity * S::from_f64(factor);
            }
            if let Some(elsewhere) = &mut self.backend.elsewhere {
                elsewhere.write_velocities(&self.model, &self.state.velocities);
            }
        }
        Ok(())
    }

    /// The substeps of a frame, and the state at its end.
    fn compute_frame(&mut self) -> Result<(), FrameError> {
        let dt = substep_dt(&self.scene);
        let start = self.time();
        let Self { model, state, solver, inputs, backend, .. } = self;
        for substep in 0..self.scene.solver.substeps {
            act(&self.scene, &self.assembly, start + f64::from(substep + 1) * dt, inputs);
            backend.step(solver, model, state, inputs, dt)?;
        }
        match &mut backend.elsewhere {
            Some(elsewhere) => elsewhere.read(model, state, solver),
            None => Ok(()),
        }
    }

    /// The numbers of the last frame.
    pub fn report(&self) -> FrameReport {
        FrameReport {
            frame: self.frame,
            time: self.time(),
            relative_residual: self.balance.relative_residual(),
            stiffness_error: self.balance.stiffness_error(),
            rejected_substeps: self.rejected_substeps,
            energy: measure_energies(&self.model, &self.state, &self.inputs, &self.tets),
            deformation: summarize_deformation(&self.tets),
            patches: self.patch_forces(),
        }
    }

    /// What the scene does at a time [s].
    pub fn inputs_at(&self, time: f64) -> Inputs<S> {
        inputs_at(&self.scene, &self.assembly, time)
    }

    fn patch_forces(&self) -> Vec<PatchForce> {
        let positions: Vec<_> = self.state.positions.iter().map(|x| x.cast()).collect();
        self.patch_forces_at(self.time(), &positions, &self.balance.residual)
    }

    /// Forces on the scene's patches at a time [s], for a caller with a state of its own:
    /// `positions` [m], and the forces `holding` [N] by which held vertices are held where they are,
    /// both of shape [vertex_count].
    pub fn patch_forces_at(
        &self,
        time: f64,
        positions: &[Vec3<f64>],
        holding: &[Vec3<f64>],
    ) -> Vec<PatchForce> {
        let (scene, assembly) = (&self.scene, &self.assembly);
        let rest = assembly.builder.positions();
        let position = |v: u32| positions.get(v as usize).copied().unwrap_or(rest[v as usize]);
        let held = |v: u32| holding.get(v as usize).copied().unwrap_or_default();
        let mut forces = Vec::new();
        for (fixing, patch) in scene.fixings.iter().zip(&assembly.fixings) {
            let share = fixing.stiffness.map(|total| total / patch.vertices.len() as f64);
            let on_vertex = |v: u32| match share {
                None => held(v),
                Some(stiffness) => (rest[v as usize] - position(v)) * stiffness,
            };
            forces.push(sum(&fixing.name, PatchKind::Fixing, patch, position, on_vertex));
        }
        for (motion, patch) in scene.motions.iter().zip(&assembly.motions) {
            let is_held = motion.is_held(time);
            let on_vertex = |v: u32| if is_held { held(v) } else { Vec3::ZERO };
            forces.push(sum(&motion.name, PatchKind::Motion, patch, position, on_vertex));
        }
        for (force, patch) in scene.forces.iter().zip(&assembly.forces) {
            let share = force.at(time) * (1.0 / patch.vertices.len() as f64);
            forces.push(sum(&force.name, PatchKind::Force, patch, position, |_| share));
        }
        forces
    }
}

/// A substep of a scene [s].
fn substep_dt(scene: &Scene) -> f64 {
    scene.time.frame / f64::from(scene.solver.substeps)
}

/// What a scene does at a time [s], with room for what it does at any other.
fn inputs_at<S: Real>(scene: &Scene, assembly: &Assembly, time: f64) -> Inputs<S> {
    let count = |patches: &[ResolvedPatch]| -> usize {
        patches.iter().map(|patch| patch.vertices.len()).sum()
    };
    let mut inputs = Inputs {
        gravity: scene.world.gravity.cast(),
        pins: Vec::with_capacity(count(&assembly.fixings) + count(&assembly.motions)),
        tethers: Vec::new(),
        anchors: Vec::new(),
        forces: Vec::with_capacity(count(&assembly.forces)),
    };
    act(scene, assembly, time, &mut inputs);
    inputs
}

/// Puts what a scene does at a time [s] into the inputs; takes no memory where they have room.
fn act<S: Real>(scene: &Scene, assembly: &Assembly, time: f64, inputs: &mut Inputs<S>) {
    let rest = assembly.builder.positions();
    inputs.pins.clear();
    for (fixing, patch) in scene.fixings.iter().zip(&assembly.fixings) {
        if fixing.stiffness.is_none() {
            let pins = patch.vertices.iter();
            let pins = pins.map(|&v| Pin { vertex: v, target: rest[v as usize].cast() });
            inputs.pins.extend(pins);
        }
    }
    // Later pins win where patches overlap: a motion takes a fixed vertex along.
    for (motion, patch) in scene.motions.iter().zip(&assembly.motions) {
        if motion.is_held(time) {
            let pose = motion.pose(time);
            let pins = patch.vertices.iter();
            let target = |v: u32| pose.apply(rest[v as usize]).cast();
            inputs.pins.extend(pins.map(|&v| Pin { vertex: v, target: target(v) }));
        }
    }
    inputs.forces.clear();
    for (force, patch) in scene.forces.iter().zip(&assembly.forces) {
        let share = force.at(time) * (1.0 / patch.vertices.len() as f64);
        inputs.forces.extend(patch.vertices.iter().map(|&v| (v, share.cast())));
    }
}

/// Adds up forces [N] on the vertices of a patch, and their torque about its middle.
fn sum(
    name: &str,
    kind: PatchKind,
    patch: &ResolvedPatch,
    position: impl Fn(u32) -> Vec3<f64>,
    on_vertex: impl Fn(u32) -> Vec3<f64>,
) -> PatchForce {
    let mut middle = Vec3::<f64>::ZERO;
    for &v in &patch.vertices {
        middle += position(v) * (1.0 / patch.vertices.len() as f64);
    }
    let (mut force, mut torque) = (Vec3::ZERO, Vec3::ZERO);
    for &v in &patch.vertices {
        force += on_vertex(v);
        torque += (position(v) - middle).cross(on_vertex(v));
    }
    let (force, torque) = (force.to_array(), torque.to_array());
    PatchForce { name: name.to_owned(), kind, force, torque }
}
