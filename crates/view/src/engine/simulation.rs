//! A simulation that is held, led and changed while it runs. The one place that knows how the library
//! does so.

use viscera::measure::{TetMeasure, measure_energies, measure_tets};
use viscera::model::{Model, ModelBuilder, ModelError};
use viscera::scalar::{Real, Vec3};
use viscera::scene::{Scene, Selector};
use viscera::settings::Precision;
use viscera::simulation::{Assembly, PatchForce, PatchKind, ResolvedPatch, Simulation};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

use super::color::surface_values;
use super::frame::{Coloring, Hold, HoldId, Lane, Measures, Tool};
use crate::choices::Settings;

/// What the thread does with a simulation, in either precision.
pub trait Live: Send {
    /// The scene as it is now.
    fn scene(&self) -> &Scene;
    /// What computes it, and why.
    fn device(&self) -> String;
    /// Takes hold of the vertices of a body nearest to a point at rest [m].
    fn take(&mut self, hold: HoldId, grip: &Grip) -> Result<(), String>;
    /// Where what is held is to be at the end of the next frame, from where it was taken [m].
    fn lead(&mut self, hold: HoldId, translation: Vec3<f64>);
    /// Lets go.
    fn let_go(&mut self, hold: HoldId);
    /// Changes settings; where one is wrong, none. `scene` is the scene with them.
    fn change(&mut self, settings: &Settings, scene: &Scene) -> Result<(), String>;
    /// Computes a frame.
    fn advance(&mut self) -> Result<(), String>;
    /// Measures what it is now: residual, energies, stresses.
    fn measure(&mut self);
    /// Says what it is now, and what was measured last.
    fn tell(&mut self, coloring: Coloring, lane: &mut Lane);
}

/// What is taken hold of.
#[derive(Clone, Copy, Debug)]
pub struct Grip {
    /// Position of the body in the scene.
    pub body: usize,
    /// Where at rest [m].
    pub rest: Vec3<f64>,
    /// How many vertices.
    pub count: u32,
    /// Total stiffness [N/m] of the springs; rigidly where there is none.
    pub stiffness: Option<f64>,
}

/// Builds a simulation in the precision that its scene asks for.
pub fn build(scene: Scene, assembly: Assembly) -> Result<Box<dyn Live>, String> {
    Ok(match scene.solver.precision {
        Precision::F32 => Box::new(Running::<f32>::new(scene, assembly)?),
        Precision::F64 => Box::new(Running::<f64>::new(scene, assembly)?),
    })
}

/// Until the library's own simulation can be held: its model and solver, stepped here.
struct Running<S> {
    base: Simulation<S>,
    scene: Scene,
    model: Model<S>,
    state: State<S>,
    solver: Solver<S>,
    inputs: Inputs<S>,
    balance: ForceBalance,
    tets: Vec<TetMeasure>,
    measures: Measures,
    held: Vec<Held>,
    frame: u64,
}

struct Held {
    id: HoldId,
    vertices: Vec<u32>,
    /// Where each was when it was taken [m].
    taken: Vec<Vec3<f64>>,
    stiffness: Option<f64>,
    from: Vec3<f64>,
    to: Vec3<f64>,
    force: Vec3<f64>,
}

impl<S: Real> Running<S> {
    fn new(scene: Scene, assembly: Assembly) -> Result<Self, String> {
        let base = Simulation::new(scene, assembly).map_err(|error| error.to_string())?;
        let scene = base.scene().clone();
        let model =
            base.assembly().builder.build(&scene.solver).map_err(|error| error.to_string())?;
        Ok(Self {
            state: State::at_rest(&model),
            solver: Solver::new(&model, &scene.solver),
            inputs: base.inputs_at(0.0),
            balance: ForceBalance::default(),
            tets: Vec::new(),
            measures: Measures::default(),
            held: Vec::new(),
            frame: 0,
            scene,
            model,
            base,
        })
    }

    /// Forces of what the scene itself moves and pulls.
    fn tools(&self) -> Vec<Tool> {
        let positions: Vec<_> = self.state.positions.iter().map(|x| x.cast()).collect();
        let holding = &self.balance.residual;
        let patches = self.base.patch_forces_at(self.time(), &positions, holding);
        let assembly = self.base.assembly();
        let vertices = assembly.motions.iter().chain(&assembly.forces);
        let pulling = patches.into_iter().filter(|patch| patch.kind != PatchKind::Fixing);
        let tool = |(patch, resolved): (PatchForce, &ResolvedPatch)| Tool {
            name: patch.name,
            vertices: resolved.vertices.clone(),
            force: Vec3::from_f64(patch.force),
        };
        pulling.zip(vertices).map(tool).collect()
    }

    fn time(&self) -> f64 {
        self.frame as f64 * self.scene.time.frame
    }

    /// Pins and springs of what is held, a share of the way through the frame.
    fn hold(&mut self, share: f64) {
        for held in &mut self.held {
            let moved = held.from * (1.0 - share) + held.to * share;
            held.force = Vec3::ZERO;
            for (&vertex, &taken) in held.vertices.iter().zip(&held.taken) {
                let target = taken + moved;
                match held.stiffness {
                    None => self.inputs.pins.push(Pin { vertex, target: target.cast() }),
                    Some(stiffness) => {
                        let place = self.state.positions[vertex as usize].cast::<f64>();
                        let pull = (target - place) * (stiffness / held.vertices.len() as f64);
                        held.force += pull;
                        self.inputs.forces.push((vertex, pull.cast()));
                    }
                }
            }
        }
    }
}

/// A model with a scene's materials and elastic fixings.
fn builder(assembly: &Assembly, scene: &Scene) -> Result<ModelBuilder, ModelError> {
    let mut builder = ModelBuilder::new();
    for (body, settings) in assembly.bodies.iter().zip(&scene.bodies) {
        let index = builder.add_body(&body.mesh, &settings.material)?;
        for region in &settings.regions {
            builder.set_region_material(index, region.label, &region.material)?;
        }
    }
    for (fixing, patch) in scene.fixings.iter().zip(&assembly.fixings) {
        let Some(stiffness) = fixing.stiffness else { continue };
        for &v in &patch.vertices {
            let anchor = builder.positions()[v as usize];
            builder.add_attachment(v, anchor, stiffness / patch.vertices.len() as f64)?;
        }
    }
    Ok(builder)
}

impl<S: Real> Live for Running<S> {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn device(&self) -> String {
        self.base.device_choice().to_owned()
    }

    fn take(&mut self, hold: HoldId, grip: &Grip) -> Result<(), String> {
        let Some(body) = self.base.assembly().bodies.get(grip.body) else {
            return Err(format!("the scene has no body {}", grip.body));
        };
        let mesh = &body.mesh;
        let count = grip.count.min(mesh.vertices().len() as u32);
        let vertices = Selector::Nearest { point: grip.rest, count }
            .select(mesh.vertices(), mesh.tets(), mesh.regions())
            .map_err(|error| error.to_string())?;
        let vertices: Vec<u32> =
            vertices.into_iter().map(|v| v + body.vertices.start as u32).collect();
        let place = |&v: &u32| self.state.positions[v as usize].cast::<f64>();
        let taken = vertices.iter().map(place).collect();
        let (from, to, force) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        self.held.push(Held {
            id: hold,
            vertices,
            taken,
            stiffness: grip.stiffness,
            from,
            to,
            force,
        });
        Ok(())
    }

    fn lead(&mut self, hold: HoldId, translation: Vec3<f64>) {
        if let Some(held) = self.held.iter_mut().find(|held| held.id == hold) {
            held.to = translation;
        }
    }

    fn let_go(&mut self, hold: HoldId) {
        self.held.retain(|held| held.id != hold);
    }

    fn change(&mut self, _: &Settings, scene: &Scene) -> Result<(), String> {
        let model = builder(self.base.assembly(), scene)
            .and_then(|builder| builder.build::<S>(&scene.solver))
            .map_err(|error| error.to_string())?;
        let mut state = State::at_rest(&model);
        state.positions.clone_from(&self.state.positions);
        state.velocities.clone_from(&self.state.velocities);
        self.solver = Solver::new(&model, &scene.solver);
        (self.model, self.state, self.scene) = (model, state, scene.clone());
        Ok(())
    }

    fn advance(&mut self) -> Result<(), String> {
        let substeps = self.scene.solver.substeps;
        let dt = self.scene.time.frame / f64::from(substeps);
        let start = self.time();
        for substep in 1..=substeps {
            let share = f64::from(substep) / f64::from(substeps);
            self.inputs = self.base.inputs_at(start + f64::from(substep) * dt);
            self.inputs.gravity = self.scene.world.gravity.cast();
            self.hold(share);
            self.solver
                .step(&self.model, &mut self.state, &self.inputs, dt)
                .map_err(|error| error.to_string())?;
        }
        for held in &mut self.held {
            held.from = held.to;
        }
        self.frame += 1;
        let factor = S::from_f64(self.scene.time.velocity_factor);
        for velocity in &mut self.state.velocities {
            *velocity = *velocity * factor;
        }
        match self.state.is_finite() {
            true => Ok(()),
            false => Err(format!(
                "the simulation diverged at {:.4} s: positions are no longer numbers; raise \
                 solver.substeps, lower solver.relaxation, or turn solver.acceleration off",
                self.time()
            )),
        }
    }

    fn measure(&mut self) {
        let balanced =
            self.solver.force_balance(&self.model, &self.state, &self.inputs, &mut self.balance);
        if balanced.is_ok() {
            self.measures.residual = self.balance.relative_residual();
        }
        measure_tets(&self.model, &self.state.positions, &mut self.tets);
        self.measures.energy = measure_energies(&self.model, &self.state, &self.inputs, &self.tets);
        self.measures.rejected = self.solver.rejected_steps();
        self.measures.tools = self.tools();
    }

    fn tell(&mut self, coloring: Coloring, lane: &mut Lane) {
        lane.positions.clear();
        lane.positions.extend(self.state.positions.iter().map(|x| x.cast::<f32>()));
        lane.measures.clone_from(&self.measures);
        lane.holds.clear();
        for held in &mut self.held {
            let (mut place, mut target) = (Vec3::ZERO, Vec3::ZERO);
            let share = 1.0 / held.vertices.len() as f64;
            for (&v, &taken) in held.vertices.iter().zip(&held.taken) {
                place += self.state.positions[v as usize].cast::<f64>() * share;
                target += (taken + held.from) * share;
            }
            if held.stiffness.is_none() {
                let holding = held.vertices.iter().map(|&v| self.balance.residual[v as usize]);
                held.force = holding.fold(Vec3::ZERO, |sum, force| sum + force);
            }
            lane.holds.push(Hold { id: held.id, place, target, force: held.force });
        }
        let assembly = self.base.assembly();
        let positions = &self.state.positions;
        surface_values(assembly, coloring, positions, &self.tets, &mut lane.values);
    }
}
