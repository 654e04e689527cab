//! From a request to simulations: meshes, models, and forks of one that runs.

use std::sync::Arc;
use std::time::Instant;
use viscera::settings::DeviceRequest;
use viscera::simulation::Assembly;
use viscera_stage::build;

use super::{Cure, Event, Running, Worker};
use crate::engine::setup::{BuildRequest, MOST_GHOST_TETS, Setup, expectation};

impl Worker {
    pub(super) fn load(&mut self, request: BuildRequest) {
        self.running = None;
        self.asked = None;
        let Some(scene) = request.scenes.first() else { return };
        self.tell(Event::Busy("reading and making meshes".to_owned()));
        let assembly = match Setup::assemble(scene, &request.mesh_files) {
            Ok(assembly) => assembly,
            Err(error) => return self.fail(error.to_string(), Cure::Open),
        };
        self.ask_or_start(request, assembly);
    }

    pub(super) fn ask_or_start(&mut self, request: BuildRequest, assembly: Assembly) {
        match expectation(&assembly, &request.scenes) {
            Some(message) => {
                self.asked = Some((request, assembly));
                self.tell(Event::Expect(message));
            }
            None => self.start(request, assembly),
        }
    }

    /// The reference is for small meshes.
    fn leave_ghost_out(&self, request: &mut BuildRequest, assembly: &Assembly) {
        let tets: usize = assembly.bodies.iter().map(|body| body.tets.len()).sum();
        if request.ends_with_ghost && tets > MOST_GHOST_TETS {
            request.scenes.pop();
            request.ends_with_ghost = false;
            self.tell(Event::Refused(format!(
                "the reference is left out: it is for meshes of at most {MOST_GHOST_TETS} \
                 tetrahedra, and this one has {tets}"
            )));
        }
    }

    pub(super) fn accompany(&mut self, mut request: BuildRequest) {
        let Some(running) = &self.running else { return self.load(request) };
        let setup = Arc::clone(&running.setup);
        self.leave_ghost_out(&mut request, &setup.assembly);
        let what =
            if request.ends_with_ghost { "building the reference" } else { "building the model" };
        self.tell(Event::Busy(what.to_owned()));
        let Some(running) = &mut self.running else { return };
        let first = &running.runs[0];
        let forks: Result<Vec<_>, String> =
            request.scenes.iter().skip(1).map(|scene| first.fork(scene)).collect();
        let forks = match forks {
            Ok(forks) => forks,
            Err(message) => {
                request.ends_with_ghost = false;
                self.tell(Event::Alone(message));
                Vec::new()
            }
        };
        let Some(running) = &mut self.running else { return };
        running.runs.truncate(1);
        running.runs.extend(forks);
        running.walls.resize(1, 0.0);
        running.walls.resize(running.runs.len(), 0.0);
        running.setup = Arc::new(Setup {
            generation: request.generation,
            scene: setup.scene.clone(),
            assembly: Arc::clone(&setup.assembly),
            run_count: running.runs.len(),
            has_ghost: request.ends_with_ghost,
        });
        let setup = Arc::clone(&running.setup);
        self.tell(Event::Accompanied(setup));
        self.tell_devices();
        self.due = Instant::now();
        self.publish();
    }

    pub(super) fn start(&mut self, mut request: BuildRequest, assembly: Assembly) {
        self.leave_ghost_out(&mut request, &assembly);
        let Some(scene) = request.scenes.first().cloned() else { return };
        let setup = Arc::new(Setup {
            generation: request.generation,
            scene,
            assembly: Arc::new(assembly),
            run_count: request.scenes.len(),
            has_ghost: request.ends_with_ghost,
        });
        self.build(setup, request.scenes);
    }

    /// Builds simulations at rest.
    pub(super) fn build(&mut self, setup: Arc<Setup>, scenes: Vec<viscera::scene::Scene>) {
        self.running = None;
        let mut runs = Vec::new();
        for scene in scenes {
            let what = match scene.solver.device {
                DeviceRequest::Cpu => "building the model".to_owned(),
                ref device => format!("building the model; device \"{device}\""),
            };
            self.tell(Event::Busy(what));
            let wants_gpu =
                !matches!(scene.solver.device, DeviceRequest::Cpu | DeviceRequest::Auto);
            match build(scene, Assembly::clone(&setup.assembly), self.device.as_ref()) {
                Ok(run) => runs.push(run),
                Err(message) => {
                    return self.fail(message, if wants_gpu { Cure::Cpu } else { Cure::Open });
                }
            }
        }
        let walls = vec![0.0; runs.len()];
        self.tell(Event::Ready(Arc::clone(&setup)));
        self.running = Some(Running { setup, runs, walls, devices: Vec::new(), number: 0 });
        self.tell_devices();
        self.due = Instant::now();
        self.publish();
    }
}
