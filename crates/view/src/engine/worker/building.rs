//! From a plan to simulations: meshes, models, and what accompanies one that runs.

use std::sync::Arc;
use std::time::Instant;
use viscera::settings::DeviceRequest;
use viscera::simulation::Assembly;

use super::{Cure, Event, Running, Worker};
use crate::engine::simulation::build;
use crate::engine::stage::{MOST_GHOST_TETS, Plan, Stage, expectation};

impl Worker {
    pub(super) fn load(&mut self, plan: Plan) {
        self.running = None;
        self.asked = None;
        let Some(scene) = plan.scenes.first() else { return };
        self.tell(Event::Busy("reading and making meshes".to_owned()));
        let assembly = match Stage::assemble(scene, &plan.mesh_files) {
            Ok(assembly) => assembly,
            Err(error) => return self.fail(error.to_string(), Cure::Open),
        };
        self.ask_or_start(plan, assembly);
    }

    pub(super) fn ask_or_start(&mut self, plan: Plan, assembly: Assembly) {
        match expectation(&assembly, &plan.scenes) {
            Some(message) => {
                self.asked = Some((plan, assembly));
                self.tell(Event::Expect(message));
            }
            None => self.start(plan, assembly),
        }
    }

    /// The exact solution is for small meshes.
    fn leave_ghost_out(&self, plan: &mut Plan, assembly: &Assembly) {
        let tets: usize = assembly.bodies.iter().map(|body| body.tets.len()).sum();
        if plan.ends_with_ghost && tets > MOST_GHOST_TETS {
            plan.scenes.pop();
            plan.ends_with_ghost = false;
            self.tell(Event::Refused(format!(
                "the exact solution is left out: it is for meshes of at most {MOST_GHOST_TETS} \
                 tetrahedra, and this one has {tets}"
            )));
        }
    }

    pub(super) fn accompany(&mut self, mut plan: Plan) {
        let Some(running) = &self.running else { return self.load(plan) };
        let stage = Arc::clone(&running.stage);
        self.leave_ghost_out(&mut plan, &stage.assembly);
        let what =
            if plan.ends_with_ghost { "building the true solution" } else { "building the model" };
        self.tell(Event::Busy(what.to_owned()));
        let Some(running) = &mut self.running else { return };
        let first = &running.lanes[0];
        let forks: Result<Vec<_>, String> =
            plan.scenes.iter().skip(1).map(|scene| first.fork(scene)).collect();
        let forks = match forks {
            Ok(forks) => forks,
            Err(message) => {
                plan.ends_with_ghost = false;
                self.tell(Event::Alone(message));
                Vec::new()
            }
        };
        let Some(running) = &mut self.running else { return };
        running.lanes.truncate(1);
        running.lanes.extend(forks);
        running.walls.resize(1, 0.0);
        running.walls.resize(running.lanes.len(), 0.0);
        running.stage = Arc::new(Stage {
            generation: plan.generation,
            scene: stage.scene.clone(),
            assembly: Arc::clone(&stage.assembly),
            lane_count: running.lanes.len(),
            has_ghost: plan.ends_with_ghost,
        });
        let stage = Arc::clone(&running.stage);
        self.tell(Event::Accompanied(stage));
        self.tell_devices();
        self.due = Instant::now();
        self.publish();
    }

    pub(super) fn start(&mut self, mut plan: Plan, assembly: Assembly) {
        self.leave_ghost_out(&mut plan, &assembly);
        let Some(scene) = plan.scenes.first().cloned() else { return };
        let stage = Arc::new(Stage {
            generation: plan.generation,
            scene,
            assembly: Arc::new(assembly),
            lane_count: plan.scenes.len(),
            has_ghost: plan.ends_with_ghost,
        });
        self.build(stage, plan.scenes);
    }

    /// Builds simulations at rest.
    pub(super) fn build(&mut self, stage: Arc<Stage>, scenes: Vec<viscera::scene::Scene>) {
        self.running = None;
        let mut lanes = Vec::new();
        for scene in scenes {
            let what = match scene.solver.device {
                DeviceRequest::Cpu => "building the model".to_owned(),
                ref device => format!("building the model; device \"{device}\""),
            };
            self.tell(Event::Busy(what));
            let wants_gpu =
                !matches!(scene.solver.device, DeviceRequest::Cpu | DeviceRequest::Auto);
            match build(scene, Assembly::clone(&stage.assembly)) {
                Ok(lane) => lanes.push(lane),
                Err(message) => {
                    return self.fail(message, if wants_gpu { Cure::Cpu } else { Cure::Open });
                }
            }
        }
        let walls = vec![0.0; lanes.len()];
        self.tell(Event::Ready(Arc::clone(&stage)));
        self.running = Some(Running { stage, lanes, walls, devices: Vec::new(), number: 0 });
        self.tell_devices();
        self.due = Instant::now();
        self.publish();
    }
}
