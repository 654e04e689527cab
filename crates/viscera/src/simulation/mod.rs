//! A scene in motion: inputs from the scene's paths, frames of substeps, and what to report.

mod assemble;

pub use assemble::{AssembleError, AssembledBody, Assembly, ResolvedPatch};

use crate::measure::{
    DeformationSummary, Energies, TetMeasure, measure_energies, measure_tets, summarize_deformation,
};
use crate::model::{Model, ModelError};
use crate::scalar::{Real, Vec3};
use crate::scene::Scene;
use crate::solver::balance::ForceBalance;
use crate::solver::{Inputs, Pin, Solver, StepError};
use crate::state::State;

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
#[derive(Clone, Debug)]
pub struct Simulation<S> {
    scene: Scene,
    assembly: Assembly,
    model: Model<S>,
    state: State<S>,
    solver: Solver<S>,
    inputs: Inputs<S>,
    balance: ForceBalance,
    tets: Vec<TetMeasure>,
    frame: u64,
    rejected_substeps: u64,
}

impl<S: Real> Simulation<S> {
    /// Builds the model and takes the memory for its steps.
    pub fn new(scene: Scene, assembly: Assembly) -> Result<Self, ModelError> {
        let model = assembly.builder.build::<S>(&scene.solver)?;
        let pins = assembly.fixings.iter().chain(&assembly.motions);
        let forces = assembly.forces.iter().map(|patch| patch.vertices.len()).sum();
        let inputs = Inputs {
            gravity: scene.world.gravity.cast(),
            pins: Vec::with_capacity(pins.map(|patch| patch.vertices.len()).sum()),
            anchors: Vec::new(),
            forces: Vec::with_capacity(forces),
        };
        let mut simulation = Self {
            state: State::at_rest(&model),
            solver: Solver::new(&model, &scene.solver),
            inputs,
            balance: ForceBalance::default(),
            tets: Vec::with_capacity(model.tet_count()),
            frame: 0,
            rejected_substeps: 0,
            model,
            scene,
            assembly,
        };
        measure_tets(&simulation.model, &simulation.state.positions, &mut simulation.tets);
        simulation.act(0.0);
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
        let substeps = self.solver.settings().substeps;
        let dt = self.scene.time.frame / f64::from(substeps);
        let start = self.time();
        let rejected = self.solver.rejected_steps();
        for substep in 0..substeps {
            self.act(start + f64::from(substep + 1) * dt);
            self.solver.step(&self.model, &mut self.state, &self.inputs, dt)?;
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
        let factor = S::from_f64(self.scene.time.velocity_factor);
        for velocity in &mut self.state.velocities {
            *velocity = *velocity * factor;
        }
        Ok(())
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

    /// Puts what the scene does at a time [s] into the inputs.
    fn act(&mut self, time: f64) {
        let rest = self.assembly.builder.positions();
        self.inputs.pins.clear();
        for (fixing, patch) in self.scene.fixings.iter().zip(&self.assembly.fixings) {
            if fixing.stiffness.is_none() {
                let pins = patch.vertices.iter();
                let pins = pins.map(|&v| Pin { vertex: v, target: rest[v as usize].cast() });
                self.inputs.pins.extend(pins);
            }
        }
        // Later pins win where patches overlap: a motion takes a fixed vertex along.
        for (motion, patch) in self.scene.motions.iter().zip(&self.assembly.motions) {
            if motion.is_held(time) {
                let pose = motion.pose(time);
                self.inputs.pins.extend(
                    patch
                        .vertices
                        .iter()
                        .map(|&v| Pin { vertex: v, target: pose.apply(rest[v as usize]).cast() }),
                );
            }
        }
        self.inputs.forces.clear();
        for (force, patch) in self.scene.forces.iter().zip(&self.assembly.forces) {
            let share = force.at(time) * (1.0 / patch.vertices.len() as f64);
            self.inputs.forces.extend(patch.vertices.iter().map(|&v| (v, share.cast())));
        }
    }

    fn patch_forces(&self) -> Vec<PatchForce> {
        let held = |v: u32| self.balance.residual.get(v as usize).copied().unwrap_or_default();
        let mut forces = Vec::new();
        for (fixing, patch) in self.scene.fixings.iter().zip(&self.assembly.fixings) {
            let share = fixing.stiffness.map(|total| total / patch.vertices.len() as f64);
            let on_vertex = |v: u32| match share {
                None => held(v),
                Some(stiffness) => {
                    let rest = self.assembly.builder.positions()[v as usize];
                    (rest - self.state.positions[v as usize].cast()) * stiffness
                }
            };
            forces.push(self.sum(&fixing.name, PatchKind::Fixing, patch, on_vertex));
        }
        for (motion, patch) in self.scene.motions.iter().zip(&self.assembly.motions) {
            let is_held = motion.is_held(self.time());
            let on_vertex = |v: u32| if is_held { held(v) } else { Vec3::ZERO };
            forces.push(self.sum(&motion.name, PatchKind::Motion, patch, on_vertex));
        }
        for (force, patch) in self.scene.forces.iter().zip(&self.assembly.forces) {
            let share = force.at(self.time()) * (1.0 / patch.vertices.len() as f64);
            forces.push(self.sum(&force.name, PatchKind::Force, patch, |_| share));
        }
        forces
    }

    /// Adds up forces [N] on the vertices of a patch, and their torque about its middle.
    fn sum(
        &self,
        name: &str,
        kind: PatchKind,
        patch: &ResolvedPatch,
        on_vertex: impl Fn(u32) -> Vec3<f64>,
    ) -> PatchForce {
        let position = |v: u32| self.state.positions[v as usize].cast::<f64>();
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
}
