//! A simulation in either precision, with the caller's numbers for the patches that it holds.

use std::borrow::Cow;

use viscera::model::ModelBuilder;
use viscera::record::{RecordedFile, Recorder};
use viscera::scalar::{Real, Vec3};
use viscera::scene::{Patch, Scene, Selector};
use viscera::settings::{Place, Precision, SolverSettings};
use viscera::simulation::{
    Assembly, PatchForce, PatchKind, ResolvedPatch, Simulation, SimulationError,
};
use viscera::solver::gpu::{Device, GpuSolver};
use viscera::solver::{FrameReading, Inputs};

use crate::color::surface_values;
use crate::hand::{ToolAct, ToolHands};
use crate::snapshot::{Coloring, HeldPatch, HoldId, Measures, RunSnapshot, ScenePatch};
use crate::tools::tools_of;

/// Settings to change: keys and values as one writes them.
pub type Settings = Vec<(String, String)>;

/// One simulation, in whichever precision.
pub trait Run: Send {
    /// What computes it, and why; what a person should know of that.
    fn device(&self) -> (String, Option<String>);
    /// Whether something else than the CPU computes it.
    fn is_on_device(&self) -> bool;
    /// Takes hold of the vertices of a body nearest to a point at rest [m].
    fn take(&mut self, hold: HoldId, grip: &GripTarget) -> Result<(), String>;
    /// Where what is held is to be at the end of the next frame, from where it was taken [m].
    fn lead(&mut self, hold: HoldId, translation: Vec3<f64>) -> Result<(), String>;
    /// Lets go.
    fn let_go(&mut self, hold: HoldId) -> Result<(), String>;
    /// Does something with an instrument.
    fn act(&mut self, act: &ToolAct) -> Result<(), String>;
    /// What a person should know of instruments since it was last asked.
    fn told(&mut self) -> Option<String>;
    /// Begins a recording of what happens from now on, of a scene that needed these files: its first bytes.
    fn begin_recording(&mut self, files: Vec<RecordedFile>) -> Vec<u8>;
    /// After each frame, before hands do anything: the next bytes of the recording.
    fn recorded(&mut self) -> Vec<u8>;
    /// Ends it: the last bytes.
    fn end_recording(&mut self) -> Vec<u8>;
    /// Changes settings; where one is wrong, none.
    fn change(&mut self, settings: &Settings) -> Result<(), String>;
    /// The value of a setting of the solver, as one would write it.
    fn setting(&self, key: &str) -> Option<String>;
    /// Starts from rest again, with the settings in force.
    fn reset(&mut self) -> Result<(), String>;
    /// Computes a frame, and reads so much of it from a device.
    fn advance(&mut self, reading: FrameReading) -> Result<(), String>;
    /// Begins a frame without waiting for what computes it; `reading`: what of it is needed, the balance where
    /// [`Run::measure`] follows.
    fn send(&mut self, reading: FrameReading) -> Result<(), String>;
    /// Takes over the frame that was sent; false while it is under way.
    fn receive(&mut self) -> Result<bool, String>;
    /// Whether a frame was sent that was not taken over.
    fn is_under_way(&self) -> bool;
    /// Positions of the last frame, where they are not here yet.
    fn read_state(&mut self) -> Result<(), String>;
    /// Whether a picture on a device needs no more of a frame than [`FrameReading::Forces`]: the frame is on that device, and
    /// nothing else that is drawn needs to know where tissue is.
    fn is_drawn_unread(&self, device: &Device, coloring: Coloring) -> bool;
    /// Another device for settings that ask for one, or none; it goes on from the last frame.
    fn offer(&mut self, device: Option<&Device>) -> Result<(), String>;
    /// The scene as it is now.
    fn scene(&self) -> &Scene;
    /// The solver's settings in force, with a method in the place of "auto".
    fn solver(&self) -> &SolverSettings;
    /// Measures what it is now: residual, energies, stresses.
    fn measure(&mut self) -> Result<(), String>;
    /// Fills a snapshot with its state now and what was measured last; for pictures on a device, where there are any.
    fn fill(&mut self, coloring: Coloring, device: Option<&Device>, snapshot: &mut RunSnapshot);
    /// What was done to it since it was at rest, as text for its scene file, and its time [s].
    fn done_by_hand(&self) -> (String, f64);
    /// The step that comes next.
    fn next_step(&self) -> NextStep;
    /// Another simulation that goes on from here with another scene's solver.
    fn fork(&self, scene: &Scene) -> Result<Box<dyn Run>, String>;
}

/// What is taken hold of.
#[derive(Clone, Copy, Debug)]
pub struct GripTarget {
    /// Position of the body in the scene.
    pub body: usize,
    /// Where at rest [m].
    pub rest: Vec3<f64>,
    /// How many vertices.
    pub count: u32,
    /// Total stiffness [N/m] of the springs; rigidly where there is none.
    pub stiffness: Option<f64>,
}

/// The step that comes next: the state before it, and what acts in it.
#[derive(Clone, Debug)]
pub struct NextStep {
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

/// Builds a simulation in the precision that its scene asks for; on the caller's device, where it has one and the
/// settings ask for one.
pub fn build(
    scene: Scene,
    assembly: Assembly,
    device: Option<&Device>,
) -> Result<Box<dyn Run>, String> {
    Ok(match (scene.solver.precision, device) {
        (Precision::F32, Some(device)) => {
            let simulation = Simulation::with_device(scene, assembly, device.clone());
            Box::new(SimulationRun::new(simulation)?)
        }
        (Precision::F32, None) => {
            Box::new(SimulationRun::new(Simulation::<f32>::new(scene, assembly))?)
        }
        #[cfg(feature = "double")]
        (Precision::F64, _) => {
            Box::new(SimulationRun::new(Simulation::<f64>::new(scene, assembly))?)
        }
        #[cfg(not(feature = "double"))]
        (Precision::F64, _) => return Err(ONLY_SINGLE.to_owned()),
    })
}

#[cfg(not(feature = "double"))]
const ONLY_SINGLE: &str = "this program computes in single precision; leave solver.precision out, or run the scene with \
                           `viscera run`";

struct SimulationRun<S> {
    simulation: Simulation<S>,
    /// What is held, and the motion that each is.
    held: Vec<(HoldId, usize)>,
    hands: ToolHands,
    recorder: Option<Recorder>,
    measures: Measures,
}

impl<S: Real> SimulationRun<S> {
    fn new(simulation: Result<Simulation<S>, SimulationError>) -> Result<Self, String> {
        let simulation = simulation.map_err(text)?;
        let (held, hands) = (Vec::new(), ToolHands::default());
        let measures = Measures::default();
        Ok(Self { simulation, held, hands, recorder: None, measures })
    }

    /// Forces of what the scene itself moves and pulls.
    fn scene_patches(&self, patches: Vec<PatchForce>) -> Vec<ScenePatch> {
        let assembly = self.simulation.assembly();
        let by_hand = self.simulation.first_hold()..assembly.motions.len();
        let vertices = assembly.motions.iter().chain(&assembly.forces);
        let pulling = patches.into_iter().filter(|patch| patch.kind != PatchKind::Fixing);
        let with_vertices = |(patch, resolved): (PatchForce, &ResolvedPatch)| ScenePatch {
            name: patch.name,
            vertices: resolved.vertices.clone(),
            force: Vec3::from_f64(patch.force),
        };
        let all = pulling.zip(vertices).enumerate();
        all.filter(|(number, _)| !by_hand.contains(number))
            .map(|(_, one)| with_vertices(one))
            .collect()
    }

    fn fork_as<T: Real>(&self, scene: &Scene) -> Result<SimulationRun<T>, String> {
        let values = scene.solver.values().into_iter().filter(|(key, _)| *key != "precision");
        let settings: Settings =
            values.map(|(key, value)| (format!("solver.{key}"), value)).collect();
        Ok(SimulationRun {
            simulation: self.simulation.fork(&settings).map_err(text)?,
            held: self.held.clone(),
            hands: self.hands.clone(),
            recorder: None,
            measures: self.measures.clone(),
        })
    }

    fn motion(&self, hold: HoldId) -> Option<usize> {
        self.held.iter().find(|(id, _)| *id == hold).map(|(_, motion)| *motion)
    }
}

impl<S: Real> Run for SimulationRun<S> {
    fn device(&self) -> (String, Option<String>) {
        let warning = self.simulation.device_warning();
        (self.simulation.device_choice().to_owned(), warning.map(str::to_owned))
    }

    fn is_on_device(&self) -> bool {
        self.simulation.is_on_device()
    }

    fn take(&mut self, hold: HoldId, grip: &GripTarget) -> Result<(), String> {
        let bodies = &self.simulation.assembly().bodies;
        let most = bodies.get(grip.body).map_or(1, |body| body.mesh.vertices().len() as u32);
        let patch = Patch {
            body: grip.body,
            selector: Selector::Nearest { point: grip.rest, count: grip.count.min(most) },
            purpose: "hand".to_owned(),
            place: Place::Override { key: "hand".into() },
        };
        let motion = self.simulation.take_hold("hand", patch, grip.stiffness).map_err(text)?;
        self.held.push((hold, motion));
        Ok(())
    }

    fn lead(&mut self, hold: HoldId, translation: Vec3<f64>) -> Result<(), String> {
        match self.motion(hold) {
            Some(motion) => self.simulation.lead(motion, translation).map_err(text),
            // It was let go, or everything has begun anew, while the hand moved on.
            None => Ok(()),
        }
    }

    fn let_go(&mut self, hold: HoldId) -> Result<(), String> {
        let Some(motion) = self.motion(hold) else { return Ok(()) };
        self.held.retain(|(id, _)| *id != hold);
        self.simulation.let_go(motion).map_err(text)
    }

    fn act(&mut self, act: &ToolAct) -> Result<(), String> {
        self.hands.act(&mut self.simulation, act)
    }

    fn told(&mut self) -> Option<String> {
        self.hands.told()
    }

    fn begin_recording(&mut self, files: Vec<RecordedFile>) -> Vec<u8> {
        let (recorder, bytes) = Recorder::begin(&mut self.simulation, files);
        self.recorder = Some(recorder);
        bytes
    }

    fn recorded(&mut self) -> Vec<u8> {
        let Self { recorder, simulation, .. } = self;
        recorder.as_mut().map_or_else(Vec::new, |recorder| recorder.frame(simulation))
    }

    fn end_recording(&mut self) -> Vec<u8> {
        self.recorder.take().map_or_else(Vec::new, Recorder::end)
    }

    fn change(&mut self, settings: &Settings) -> Result<(), String> {
        self.simulation.change(settings).map_err(text)
    }

    fn setting(&self, key: &str) -> Option<String> {
        let values = self.simulation.scene().solver.values();
        let own = key.strip_prefix("solver.")?;
        values.into_iter().find(|(name, _)| *name == own).map(|(_, value)| value)
    }

    fn reset(&mut self) -> Result<(), String> {
        self.held.clear();
        self.hands.clear();
        self.measures = Measures::default();
        self.simulation.reset().map_err(text)
    }

    fn advance(&mut self, reading: FrameReading) -> Result<(), String> {
        self.hands.lead(&mut self.simulation);
        self.simulation.advance_reading(reading).map_err(text)
    }

    fn send(&mut self, reading: FrameReading) -> Result<(), String> {
        self.hands.lead(&mut self.simulation);
        self.simulation.send_frame(reading).map_err(text)
    }

    fn receive(&mut self) -> Result<bool, String> {
        self.simulation.take_frame().map_err(text)
    }

    fn is_under_way(&self) -> bool {
        self.simulation.is_under_way()
    }

    fn read_state(&mut self) -> Result<(), String> {
        self.simulation.read_state().map_err(text)
    }

    fn is_drawn_unread(&self, device: &Device, coloring: Coloring) -> bool {
        let is_there = self.simulation.gpu().is_some_and(|gpu| gpu.device().is_same(device));
        let shows = |gpu: &GpuSolver| coloring.of_tissue().is_none_or(|value| gpu.shows(value));
        let is_shown = self.simulation.gpu().is_some_and(shows);
        // Patches that move have marks where they are.
        let assembly = self.simulation.assembly();
        let moves = self.simulation.first_hold() > 0 || !assembly.forces.is_empty();
        is_there && is_shown && self.held.is_empty() && !moves && self.recorder.is_none()
    }

    fn offer(&mut self, device: Option<&Device>) -> Result<(), String> {
        self.simulation.offer_device(device.cloned()).map_err(text)
    }

    fn scene(&self) -> &Scene {
        self.simulation.scene()
    }

    fn solver(&self) -> &SolverSettings {
        self.simulation.solver()
    }

    fn measure(&mut self) -> Result<(), String> {
        if self.simulation.frame() == 0 {
            return Ok(());
        }
        self.simulation.measure().map_err(text)?;
        let report = self.simulation.report();
        self.measures.residual = report.relative_residual;
        self.measures.energy = report.energy;
        self.measures.inverted = report.deformation.inverted;
        self.measures.rejected = self.simulation.rejected_steps();
        self.measures.scene_patches = self.scene_patches(report.patches);
        Ok(())
    }

    fn fill(&mut self, coloring: Coloring, device: Option<&Device>, snapshot: &mut RunSnapshot) {
        let drawn =
            self.simulation.gpu().filter(|gpu| device.is_some_and(|d| gpu.device().is_same(d)));
        let kept = snapshot.on_device.take();
        snapshot.on_device = drawn.map(|gpu| gpu.copy_positions(kept, coloring.of_tissue()));
        snapshot.unread = self.simulation.unread_frames();
        let positions = &self.simulation.state().positions;
        snapshot.positions.clear();
        snapshot.positions.extend(positions.iter().map(|x| x.cast::<f32>()));
        snapshot.measures.clone_from(&self.measures);
        snapshot.counts = [self.simulation.substeps(), self.simulation.iterations()];
        snapshot.held.clear();
        for &(id, motion) in &self.held {
            if let Some(hold) = self.simulation.hold(motion) {
                let viscera::simulation::Hold { place, target, force } = hold;
                snapshot.held.push(HeldPatch { id, place, target, force });
            }
        }
        tools_of(&self.simulation, &self.hands, &mut snapshot.tools);
        snapshot.ledger = self.simulation.ledger();
        let assembly = self.simulation.assembly();
        if snapshot.unread > 0 {
            snapshot.values.clear();
            return;
        }
        let tets = match coloring {
            Coloring::Strain | Coloring::Stress => self.simulation.tets(),
            Coloring::Plain | Coloring::Bodies | Coloring::Displacement | Coloring::Pressure => {
                Vec::new()
            }
        };
        let touches = match coloring {
            Coloring::Pressure => self.simulation.touches(),
            _ => Cow::default(),
        };
        surface_values(assembly, coloring, positions, &tets, &touches, &mut snapshot.values);
    }

    fn done_by_hand(&self) -> (String, f64) {
        (self.simulation.live().text(self.simulation.scene()), self.simulation.time())
    }

    fn fork(&self, scene: &Scene) -> Result<Box<dyn Run>, String> {
        Ok(match scene.solver.precision {
            Precision::F32 => Box::new(self.fork_as::<f32>(scene)?),
            #[cfg(feature = "double")]
            Precision::F64 => Box::new(self.fork_as::<f64>(scene)?),
            #[cfg(not(feature = "double"))]
            Precision::F64 => return Err(ONLY_SINGLE.to_owned()),
        })
    }

    fn next_step(&self) -> NextStep {
        let simulation = &self.simulation;
        let scene = simulation.scene();
        let dt = scene.time.frame / f64::from(simulation.substeps());
        let inputs = simulation.inputs_at(simulation.time() + dt);
        let double = |all: &[Vec3<S>]| all.iter().map(|x| x.cast()).collect();
        NextStep {
            solver: simulation.solver().clone(),
            builder: simulation.assembly().builder.clone(),
            positions: double(&simulation.state().positions),
            velocities: double(&simulation.state().velocities),
            inputs: inputs.cast(),
            dt,
        }
    }
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}
