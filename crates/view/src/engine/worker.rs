//! What the thread does: builds, computes frame after frame at the pace of the clock, obeys in between.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};
use viscera::scene::Scene;
use viscera::settings::DeviceRequest;
use viscera::simulation::Assembly;

use super::frame::{Coloring, Slot};
use super::simulation::{Grip, Live, build};
use super::stage::{MOST_GHOST_TETS, Plan, Stage, expectation};
use super::{Command, Cure, Event, Failure};
use crate::choices::{Settings, put};

/// Calls the window.
pub type Wake = Box<dyn Fn() + Send>;

/// The state of the thread.
pub struct Worker {
    commands: Receiver<Command>,
    events: Sender<Event>,
    slot: Arc<Slot>,
    wake: Wake,
    /// What waits for a person's word.
    asked: Option<(Plan, Assembly)>,
    running: Option<Running>,
    playing: bool,
    /// Frames still to be computed while paused.
    steps: u32,
    speed: f64,
    coloring: Coloring,
    /// When the next frame is due.
    due: Instant,
    /// When frames were measured last.
    measured: Option<Instant>,
}

struct Running {
    stage: Arc<Stage>,
    /// Each with its scene as it was loaded or changed.
    lanes: Vec<Box<dyn Live>>,
    walls: Vec<f64>,
    number: u64,
}

/// Whether the thread goes on.
enum Next {
    On,
    Quit,
}

/// How far the clock may be ahead of the simulation before it is no longer caught up with [s].
const MOST_LATE: Duration = Duration::from_millis(100);

/// How often frames are measured where nothing needs it more often.
const MEASURED_EVERY: Duration = Duration::from_millis(100);

impl Worker {
    /// A thread with nothing to do yet.
    pub fn new(
        commands: Receiver<Command>,
        events: Sender<Event>,
        slot: Arc<Slot>,
        wake: Wake,
    ) -> Self {
        Self {
            commands,
            events,
            slot,
            wake,
            asked: None,
            running: None,
            playing: true,
            steps: 0,
            speed: 1.0,
            coloring: Coloring::default(),
            due: Instant::now(),
            measured: None,
        }
    }

    /// Works until it is told to quit.
    pub fn run(mut self) {
        loop {
            let idle = self.running.is_none() || !(self.playing || self.steps > 0);
            let heard = if idle {
                self.commands.recv().map_err(|_| RecvTimeoutError::Disconnected)
            } else {
                let pause = self.due.saturating_duration_since(Instant::now());
                self.commands.recv_timeout(pause)
            };
            match heard {
                Ok(command) => {
                    if let Next::Quit = self.obey_all(command) {
                        return;
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return,
                Err(RecvTimeoutError::Timeout) => self.advance(),
            }
        }
    }

    /// Obeys everything that has been asked for so far. Of changes that follow each other only the last
    /// is worth building a model for.
    fn obey_all(&mut self, first: Command) -> Next {
        let mut change: Vec<Option<(Settings, Box<Scene>)>> = Vec::new();
        let mut next = Some(first);
        while let Some(command) = next {
            match command {
                Command::Quit => return Next::Quit,
                Command::Change(lane, settings, scene) => {
                    change.resize_with(change.len().max(lane + 1), || None);
                    let mut merged = change[lane].take().map(|(old, _)| old).unwrap_or_default();
                    for (key, value) in &settings {
                        put(&mut merged, key, value);
                    }
                    change[lane] = Some((merged, scene));
                }
                Command::Load(plan) => {
                    change.clear();
                    self.load(*plan);
                }
                other => self.obey(other),
            }
            next = self.commands.try_recv().ok();
        }
        for (lane, wanted) in change.into_iter().enumerate() {
            if let Some((settings, scene)) = wanted {
                self.change(lane, &settings, &scene);
            }
        }
        Next::On
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Proceed => {
                if let Some((plan, assembly)) = self.asked.take() {
                    self.start(plan, assembly);
                }
            }
            Command::Play(playing) => {
                self.playing = playing;
                self.steps = 0;
                self.due = Instant::now();
            }
            Command::Step => {
                self.playing = false;
                self.steps += 1;
                self.due = Instant::now();
            }
            Command::Reset => self.reset(),
            Command::Speed(speed) => self.speed = speed,
            Command::Take { hold, body, rest, count, stiffness } => {
                let grip = Grip { body, rest, count, stiffness };
                self.each(|lane| lane.take(hold, &grip));
            }
            Command::Lead(hold, translation) => self.each(|lane| {
                lane.lead(hold, translation);
                Ok(())
            }),
            Command::LetGo(hold) => self.each(|lane| {
                lane.let_go(hold);
                Ok(())
            }),
            Command::Color(coloring) => {
                self.coloring = coloring;
                self.publish();
            }
            // The rest was obeyed where commands are gathered.
            Command::Load(_) | Command::Change(..) | Command::Quit => {}
        }
    }

    fn tell(&self, event: Event) {
        // Where the window is gone, `Quit` or a closed channel follows.
        let _ = self.events.send(event);
        (self.wake)();
    }

    fn each(&mut self, act: impl Fn(&mut Box<dyn Live>) -> Result<(), String>) {
        let Some(running) = &mut self.running else { return };
        let refused = running.lanes.iter_mut().find_map(|lane| act(lane).err());
        if let Some(message) = refused {
            self.tell(Event::Refused(message));
        }
    }

    fn fail(&mut self, message: String, cure: Cure) {
        self.running = None;
        self.tell(Event::Failed(Failure { message, cure }));
    }

    fn load(&mut self, plan: Plan) {
        self.running = None;
        self.asked = None;
        let Some(scene) = plan.scenes.first() else { return };
        self.tell(Event::Busy("reading and making meshes".to_owned()));
        let assembly = match Stage::assemble(scene, &plan.library) {
            Ok(assembly) => assembly,
            Err(error) => return self.fail(error.to_string(), Cure::Open),
        };
        self.ask_or_start(plan, assembly);
    }

    fn ask_or_start(&mut self, plan: Plan, assembly: Assembly) {
        match expectation(&assembly, &plan.scenes) {
            Some(message) => {
                self.asked = Some((plan, assembly));
                self.tell(Event::Expect(message));
            }
            None => self.start(plan, assembly),
        }
    }

    fn start(&mut self, mut plan: Plan, assembly: Assembly) {
        let tets: usize = assembly.bodies.iter().map(|body| body.tets.len()).sum();
        if plan.ends_with_ghost && tets > MOST_GHOST_TETS {
            plan.scenes.pop();
            plan.ends_with_ghost = false;
            self.tell(Event::Refused(format!(
                "the exact solution is left out: it is for meshes of at most {MOST_GHOST_TETS} \
                 tetrahedra, and this one has {tets}"
            )));
        }
        let Some(scene) = plan.scenes.first().cloned() else { return };
        let stage = Arc::new(Stage {
            generation: plan.generation,
            scene,
            assembly: Arc::new(assembly),
            lane_count: plan.scenes.len(),
            has_ghost: plan.ends_with_ghost,
        });
        self.build(stage, plan.scenes, 0);
    }

    /// Builds simulations at rest.
    fn build(&mut self, stage: Arc<Stage>, scenes: Vec<Scene>, number: u64) {
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
        let devices = lanes.iter().map(|lane| lane.device()).collect();
        self.tell(Event::Ready(Arc::clone(&stage)));
        self.tell(Event::Devices(devices));
        self.running = Some(Running { stage, lanes, walls, number });
        self.due = Instant::now();
        self.publish();
    }

    fn reset(&mut self) {
        let Some(running) = self.running.take() else { return };
        let scenes = running.lanes.iter().map(|lane| lane.scene().clone()).collect();
        self.build(running.stage, scenes, 0);
    }

    fn change(&mut self, lane: usize, settings: &Settings, scene: &Scene) {
        if let Some((mut plan, assembly)) = self.asked.take() {
            if let Some(changed) = plan.scenes.get_mut(lane) {
                changed.clone_from(scene);
            }
            return self.ask_or_start(plan, assembly);
        }
        let Some(running) = &mut self.running else { return };
        let Some(changed) = running.lanes.get_mut(lane) else { return };
        match changed.change(settings, scene) {
            Ok(()) => {
                let devices = running.lanes.iter().map(|lane| lane.device()).collect();
                self.tell(Event::Devices(devices));
            }
            Err(message) => self.tell(Event::Refused(message)),
        }
    }

    /// Computes a frame of each simulation, one after the other: they stay at one time.
    fn advance(&mut self) {
        let Some(running) = &mut self.running else { return };
        let mut failed = None;
        for (lane, wall) in running.lanes.iter_mut().zip(&mut running.walls) {
            let start = Instant::now();
            failed = failed.or(lane.advance().err());
            *wall = start.elapsed().as_secs_f64();
        }
        running.number += 1;
        self.steps = self.steps.saturating_sub(1);
        let frame = Duration::try_from_secs_f64(running.stage.scene.time.frame / self.speed);
        self.due += frame.unwrap_or_default();
        // What is lost is not caught up with: tissue would jump.
        if let Some(earliest) = Instant::now().checked_sub(MOST_LATE) {
            self.due = self.due.max(earliest);
        }
        match failed {
            None => self.publish(),
            // The last frame stays to be seen; Reset begins anew.
            Some(message) => {
                (self.playing, self.steps) = (false, 0);
                self.tell(Event::Failed(Failure { message, cure: Cure::Reset }));
            }
        }
    }

    /// Whether this frame is to be measured: colours need it, or the last time was long ago. What is held
    /// rigidly has its force from there.
    fn is_measured(&mut self) -> bool {
        let colors = matches!(self.coloring, Coloring::Strain | Coloring::Stress);
        let long_ago = self.measured.is_none_or(|since| since.elapsed() > MEASURED_EVERY);
        if long_ago || !self.playing {
            self.measured = Some(Instant::now());
        }
        colors || long_ago || !self.playing
    }

    fn publish(&mut self) {
        let measured = self.is_measured();
        let Some(running) = &mut self.running else { return };
        let mut frame = self.slot.blank();
        frame.generation = running.stage.generation;
        frame.number = running.number;
        frame.time = running.number as f64 * running.stage.scene.time.frame;
        frame.coloring = self.coloring;
        frame.lanes.resize_with(running.lanes.len(), Default::default);
        for ((lane, simulation), wall) in
            frame.lanes.iter_mut().zip(&mut running.lanes).zip(&running.walls)
        {
            if measured {
                simulation.measure();
            }
            simulation.tell(self.coloring, lane);
            lane.wall = *wall;
        }
        self.slot.publish(frame);
        (self.wake)();
    }
}
