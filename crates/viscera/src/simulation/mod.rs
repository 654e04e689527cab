//! A scene in motion: inputs from the scene's paths, frames of substeps, and what to report.

mod acts;
pub mod advice;
mod assemble;
mod assemble_error;
mod automatic;
mod balance;
mod balanced;
mod carried;
mod checkpoint;
mod checks;
mod choice;
mod crossings;
mod device;
mod error;
mod force_text;
mod forces;
#[cfg(feature = "gpu")]
mod gpu;
mod hands;
mod holding;
mod instruments;
mod live;
mod mesh_error;
mod meshes;
#[cfg(feature = "gpu")]
mod on_device;
mod reading;
mod recorded;
mod report;
mod rest;
mod saved;
mod sent;
mod shadowed;
mod skin;
mod solids;
mod ties;
mod tool_forces;
mod touchable;

pub use acts::Act;
pub use assemble::{AssembledBody, Assembly, Refinement, ResolvedPatch};
pub use assemble_error::{AssembleError, BalanceError};
pub use automatic::{ExpectedErrors, automatic_settings};
pub use balance::Balance;
pub use checkpoint::Checkpoint;
use checks::{check_contact, check_device, check_patches};
pub use crossings::Crossed;
pub use error::{FrameError, LiveError, SimulationError};
pub use forces::Hold;
pub use hands::{Holder, ToolState};
use holding::GraspOrigins;
use instruments::Instruments;
pub use instruments::ToolForce;
pub use live::Live;
use shadowed::Shadowed;

pub use mesh_error::{MESH_ERROR_TETS, MeshReport};
pub use meshes::{SurfaceFiles, TissueFiles};
pub use report::{FrameReport, PatchForce, PatchKind};
pub use rest::{RestReport, Standing};
pub use saved::ResumeError;
pub(crate) use saved::{SavedDifference, difference_of_saved, is_saved};
pub use ties::TieForce;

use crate::contact::Wrench;
use crate::layout::Layout;
use crate::measure::{
    DeformationSummary, Energies, TetMeasure, TissueMeasure, measure_energies, measure_tets,
    measure_tissue,
};
use crate::model::Model;
use crate::scalar::lanes::Instructions;
use crate::scalar::{Real, Vec3};
use crate::scene::{Change, Scene};
use crate::settings::{Count, Elements, Method, SolverSettings};
use crate::solver::balance::ForceBalance;
use crate::solver::oscillations::Oscillations;
use crate::solver::{FrameReading, Inputs, Solver, check_settings, choose};
use crate::state::{ContactState, State};
use device::{Backend, Offered};

/// A running scene.
#[derive(Debug)]
pub struct Simulation<S> {
    scene: Scene,
    /// The scene's, with a method in the place of "auto".
    solver: SolverSettings,
    /// Whether the caller has chosen the device.
    callers_device: bool,
    /// What the caller has at hand for settings that ask for a device.
    offered: Offered,
    /// Whether a frame was sent that has not arrived.
    under_way: bool,
    /// The method that stands in the place of "auto" because a simulation was resumed that had it.
    resumed_method: Option<Method>,
    assembly: Assembly,
    model: Model<S>,
    state: State<S>,
    backend: Backend<S>,
    /// Per frame.
    substeps: u32,
    /// Of the slowest oscillation of what the scene's fixings hold [s]; infinite where nothing is held. Nothing where
    /// nobody had to know it yet.
    oscillations: Option<Oscillations>,
    inputs: Inputs<S>,
    taken: GraspOrigins,
    instruments: Instruments,
    /// Beside the run, where the error of forces is asked for; from its first frame on.
    shadow: Option<Shadowed<S>>,
    /// Substeps of the last frame.
    divided: u32,
    /// The scene without what was done to it by hand.
    written: Scene,
    /// Changes of the scene that have been made.
    changes_made: usize,
    /// Those of them that came by hand.
    by_hand: Vec<Change>,
    /// What was done by hand since it was last asked for, where somebody records that.
    acts: Option<Vec<Act>>,
    balance: ForceBalance,
    /// Positions [m] some frames ago, which tell how fast it moves; of the last frame's beginning, or of the frame that was read
    /// before it.
    before: Vec<Vec3<S>>,
    frames_since_before: u64,
    /// Frames since the one that `state` is of.
    unread: u64,
    /// Whether the solver knows of a step: a new one has nothing to measure yet.
    stepped: bool,
    /// Whether the balance is of a step of this model: a moment that is gone back to has its own.
    is_balanced: bool,
    /// Of the tools of a moment that was gone back to, until the next frame.
    wrenches: Option<Vec<Wrench>>,
    tissue: TissueMeasure,
    frame: u64,
    rejected_substeps: u64,
    /// Steps that the solver had rejected before the last frame.
    rejected_before: u64,
}

impl<S: Real> Simulation<S> {
    /// Builds the model, chooses what computes its steps and takes the memory for them.
    pub fn new(scene: Scene, assembly: Assembly) -> Result<Self, SimulationError> {
        Self::offered(scene, assembly, Offered::default())
    }

    fn offered(
        scene: Scene,
        assembly: Assembly,
        offered: Offered,
    ) -> Result<Self, SimulationError> {
        let at_hand = offered.clone();
        let choose = |model: &Model<S>, settings: &SolverSettings, ready| {
            Backend::choose(model, settings, ready, &at_hand)
        };
        Ok(Self { offered, ..Self::on(scene, assembly, false, choose)? })
    }

    fn on(
        scene: Scene,
        mut assembly: Assembly,
        callers_device: bool,
        choose: impl FnOnce(
            &Model<S>,
            &SolverSettings,
            Option<Solver<S>>,
        ) -> Result<Backend<S>, SimulationError>,
    ) -> Result<Self, SimulationError> {
        check_patches(&scene, &assembly)?;
        check_device(&scene, callers_device)?;
        assembly.apply_balance(&scene, scene.solver.foreseen_elements(callers_device))?;
        let model = assembly.builder.build::<S>()?;
        let automatic::Chosen { settings: solver, oscillations, solver: ready } =
            automatic::choose_method(&scene, &assembly, &model, callers_device);
        check_settings(&solver)?;
        check_contact(&scene, &solver)?;
        let mut simulation = Self {
            state: State::at_rest(&model),
            substeps: solver.substeps(),
            backend: choose(&model, &solver, ready)?,
            solver,
            callers_device,
            offered: Offered::default(),
            under_way: false,
            resumed_method: None,
            oscillations,
            inputs: Inputs::default(),
            taken: GraspOrigins::default(),
            instruments: Instruments::new(&assembly.tools, scene.time.frame),
            shadow: None,
            divided: 0,
            written: scene.clone(),
            changes_made: 0,
            by_hand: Vec::new(),
            acts: None,
            balance: ForceBalance::default(),
            before: model.rest_positions.clone(),
            frames_since_before: 0,
            unread: 0,
            stepped: false,
            is_balanced: false,
            wrenches: None,
            tissue: TissueMeasure::default(),
            frame: 0,
            rejected_substeps: 0,
            rejected_before: 0,
            model,
            scene,
            assembly,
        };
        simulation.inputs = simulation.inputs_at(0.0);
        simulation.state.contact = ContactState::of(&simulation.inputs.tools);
        simulation.choose_substeps();
        simulation.divided = simulation.substeps;
        simulation.measure_tissue();
        Ok(simulation)
    }

    /// As many substeps as the settings ask for, or as the slowest oscillation of what the scene's fixings hold asks for.
    fn choose_substeps(&mut self) {
        let inputs = automatic::fixings(&self.scene, &self.assembly);
        let frame = self.scene.time.frame;
        let known = self.oscillations.take();
        let Self { scene, assembly, model, solver, backend, .. } = self;
        let measured = || automatic::oscillations(scene, assembly, model);
        (self.oscillations, self.substeps) =
            backend.substeps(&inputs, solver, known, frame, measured);
        let may_lie_on_tools =
            self.instruments.there().contains(&true) && has_loose_parts(self.layout(), &inputs);
        if may_lie_on_tools && self.solver.substeps == Count::Auto {
            self.substeps = self.substeps.max(LEAST_ON_TOOLS);
        }
    }

    /// The settings in force: the scene's, with the method that "auto" stands for.
    pub fn solver(&self) -> &SolverSettings {
        &self.solver
    }

    /// The scene with the settings in force: what advice depends on.
    pub fn scene_in_force(&self) -> Scene {
        let mut scene = self.scene.clone();
        scene.solver = self.solver.clone();
        scene
    }

    /// The errors that the settings in force lead one to expect, before anything has moved.
    pub fn expected_errors(&self) -> ExpectedErrors {
        let automatic = SolverSettings { iterations: Count::Auto, ..self.solver.clone() };
        let fewest = choose(&automatic, &self.model.materials).passes;
        let is_solved = match (self.solver.method, self.solver.iterations) {
            (Method::Explicit, _) | (_, Count::Auto) => true,
            (_, Count::Of(passes)) => passes >= fewest,
        };
        let frame = self.scene.time.frame;
        let oscillations = self.oscillations.clone().unwrap_or_else(|| match self.solver.method {
            Method::Explicit => automatic::oscillations(&self.scene, &self.assembly, &self.model),
            _ => Oscillations::default(),
        });
        let (substeps, small) = (self.substeps, self.stable_step());
        let expected =
            automatic::expected_errors(&self.solver, &oscillations, frame, substeps, small);
        // What fewer passes leave is not known.
        ExpectedErrors { motion: expected.motion.filter(|_| is_solved), ..expected }
    }

    /// Substeps per frame.
    pub fn substeps(&self) -> u32 {
        self.substeps
    }

    /// What a frame is expected to cost, in passes that add up the forces of all tetrahedra once: what "auto" chooses the
    /// method by. Not a number for XPBD.
    pub fn expected_cost(&self) -> f64 {
        let frame = self.scene.time.frame;
        automatic::cost(&self.solver, &self.model, frame, self.substeps, self.stable_step())
    }

    /// Iterations per substep, or per solve of a substep where it has several.
    pub fn iterations(&self) -> u32 {
        let solver = &self.solver;
        match solver.method {
            Method::Auto | Method::QuasiNewton => choose(solver, &self.model.materials).passes,
            Method::Xpbd | Method::Explicit => solver.iterations(),
        }
    }

    /// A substep [s].
    fn substep_dt(&self) -> f64 {
        substep_dt(&self.scene, self.substeps)
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

    /// The model as the solver works on it.
    pub fn layout(&self) -> &Layout<S> {
        self.backend.layout()
    }

    /// What moves. Positions and velocities stay where they are in memory, as long as the simulation lives. Where a
    /// graphics processor computes, multipliers stay there: these are older ones; and so do positions and velocities of frames
    /// that were asked for without ([`Simulation::advance_reading`]).
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
        self.backend.device().is_some()
    }

    /// What a person should know of the device: that it was lost and the CPU went on.
    pub fn device_warning(&self) -> Option<&str> {
        self.backend.warning.as_deref()
    }

    /// The largest small step [s] of the explicit method; infinite for others.
    pub fn stable_step(&self) -> f64 {
        self.backend.stable_step()
    }

    /// How many steps were rejected since the solver was built: at the last change of settings, or at the beginning.
    pub fn rejected_steps(&self) -> u64 {
        self.backend.rejected_steps()
    }

    /// See [`Solver::use_instructions`]; where a graphics processor computes nothing changes.
    pub fn use_instructions(&mut self, instructions: Instructions) {
        self.backend.use_instructions(instructions);
    }

    /// Measures of the tetrahedra as they are now, in the bodies' order: computed when they are asked for, which costs
    /// several times as much as [`Simulation::measure`].
    pub fn tets(&self) -> Vec<TetMeasure> {
        let mut tets = Vec::new();
        measure_tets(&self.model, &self.state.positions, &mut tets);
        tets
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
        self.advance()?;
        self.measure()
    }

    /// As [`Simulation::advance_frame`], without the numbers of the report, which are of an earlier frame then: for
    /// who needs positions, not numbers.
    pub fn advance(&mut self) -> Result<(), FrameError> {
        self.advance_reading(FrameReading::State)
    }

    fn diverged(&self) -> FrameError {
        FrameError::Diverged { time: self.time(), advice: advice::diverged(&self.scene_in_force()) }
    }

    /// Measures the last frame, for [`Simulation::report`]. The balance of forces is
    /// that of a step: after a change of settings it stays as it was until the next one.
    pub fn measure(&mut self) -> Result<(), FrameError> {
        match self.read_state() {
            // A device lost since the frame: what was measured stays that of the frame before, and the next one gives way.
            Err(lost) if self.backend.gives_way_after(&lost) => return Ok(()),
            read => read?,
        }
        if self.stepped {
            let Self { backend, model, state, inputs, balance, .. } = self;
            match backend.force_balance(model, state, inputs, balance) {
                // A device lost since the frame: the balance stays that of the frame before, and the next one gives way.
                Err(lost) if backend.gives_way_after(&lost) => {}
                measured => measured?,
            }
            self.is_balanced = true;
        }
        self.measure_tissue();
        // Files and pictures are in single precision: what it cannot hold has run away as well.
        let is_number = |tet: &TetMeasure| {
            (tet.energy_density as f32).is_finite() && (tet.von_mises as f32).is_finite()
        };
        if !self.tissue.is_moderate && !self.tets().iter().all(is_number) {
            return Err(self.diverged());
        }
        Ok(())
    }

    fn measure_tissue(&mut self) {
        self.tissue = measure_tissue(&self.model, &self.state.positions);
    }

    /// Energies; of recovered-gradient tetrahedra with their own, once a step has found it.
    fn energies(&self) -> Energies {
        let mut all = measure_energies(&self.model, &self.state, &self.inputs, &self.tissue);
        if self.solver.elements == Elements::Recovered && self.is_balanced {
            all.elastic += self.balance.elastic_energy - self.tissue.elastic_energy;
        }
        all
    }

    /// Sum of unbalanced forces on free vertices over the sum of all loads, as last measured.
    pub fn relative_residual(&self) -> f64 {
        self.balance.relative_residual()
    }

    /// Extremes of the deformation, as last measured.
    pub fn deformation(&self) -> DeformationSummary {
        self.tissue.deformation
    }

    /// The numbers of the last frame.
    pub fn report(&self) -> FrameReport {
        FrameReport {
            frame: self.frame,
            time: self.time(),
            relative_residual: self.relative_residual(),
            stiffness_error: self.balance.stiffness_error(),
            rejected_substeps: self.rejected_substeps,
            energy: self.energies(),
            deformation: self.deformation(),
            patches: self.patch_forces(),
            divided: self.divided,
            tools: self.tool_forces(),
            ties: self.tie_forces(),
        }
    }
}

/// Substeps of a frame, at least, where the method chooses them by the oscillations of what fixings hold, and tools alone may
/// hold a part: it has no such oscillations.
const LEAST_ON_TOOLS: u32 = 2;

/// Whether there is a part that neither these inputs hold nor an attachment.
fn has_loose_parts<S: Real>(layout: &Layout<S>, inputs: &Inputs<S>) -> bool {
    let mut held: Vec<bool> = layout.parts.iter().map(|part| part.is_anchored()).collect();
    let pins = inputs.pins.iter().map(|pin| pin.vertex);
    for vertex in pins.chain(inputs.tethers.iter().map(|tether| tether.vertex)) {
        held[layout.part_at(layout.numbering.of(vertex))] = true;
    }
    held.contains(&false)
}

/// A substep of a scene [s], of so many per frame.
fn substep_dt(scene: &Scene, substeps: u32) -> f64 {
    scene.time.frame / f64::from(substeps)
}
