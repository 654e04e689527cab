//! What the thread does: builds, computes frame after frame at the pace of the clock, obeys in between.

mod building;
mod frames;
mod making;
mod recording;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};
use viscera::simulation::Assembly;
use viscera::solver::gpu::Device;
use viscera_stage::{Coloring, GripTarget, Run, ToolAct};

use super::setup::{BuildRequest, Setup};
use super::snapshot::SnapshotExchange;
use super::{Command, Cure, Event, Failure};
use crate::choices::{Settings, put};
use crate::probe::{MOST_TETS, Prober, SolverVariant};
use recording::RunRecording;
use viscera_resources::MeshFiles;

/// Calls the window.
pub type Wake = Box<dyn Fn() + Send + Sync>;

/// The state of the thread.
pub struct Worker {
    commands: Receiver<Command>,
    events: Sender<Event>,
    exchange: Arc<SnapshotExchange>,
    wake: Arc<Wake>,
    /// That of the pictures, where simulations share it.
    device: Option<Device>,
    /// A large mesh that waits for a person's consent.
    asked: Option<(BuildRequest, Assembly)>,
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
    /// Whether that was the last one.
    was_due: bool,
    /// When the window asked for positions last.
    looked: Option<Instant>,
    /// Solvers by which steps are repeated, the thread that does so, and when it was begun last.
    probed: Vec<SolverVariant>,
    prober: Option<Prober>,
    probed_last: Option<Instant>,
    /// The last warning of something that goes on.
    last_warning: Option<String>,
    recording: Option<RunRecording>,
}

struct Running {
    setup: Arc<Setup>,
    /// The first, the second, the reference.
    runs: Vec<Box<dyn Run>>,
    /// What computes each, as it was sent last.
    devices: Vec<String>,
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

/// How often a step is repeated by other methods.
const PROBED_EVERY: Duration = Duration::from_millis(700);

/// How often frames are measured where nothing needs it more often.
const MEASURED_EVERY: Duration = Duration::from_millis(100);

/// How long positions are read after the window has asked for them: it may miss a frame or two.
const LOOKED_AT: Duration = Duration::from_millis(300);

/// Settings of a device that other kernels belong to: some drivers compile them for seconds.
const OTHER_KERNELS: [&str; 5] =
    ["solver.method", "solver.elements", "solver.acceleration", "solver.colors", "solver.clusters"];

impl Worker {
    /// A thread with nothing to do yet.
    pub fn new(
        commands: Receiver<Command>,
        events: Sender<Event>,
        exchange: Arc<SnapshotExchange>,
        wake: Wake,
        device: Option<Device>,
    ) -> Self {
        let wake: Arc<Wake> = Arc::new(wake);
        let (curves_sent, call) = (events.clone(), Arc::clone(&wake));
        // Without that thread there are no curves.
        let prober = Prober::start(move |curves| {
            let _ = curves_sent.send(Event::Curves(curves));
            call();
        });
        let prober = prober.ok();
        Self {
            commands,
            events,
            exchange,
            wake,
            device,
            looked: None,
            asked: None,
            running: None,
            playing: true,
            steps: 0,
            speed: 1.0,
            coloring: Coloring::default(),
            due: Instant::now(),
            measured: None,
            was_due: false,
            probed: Vec::new(),
            prober,
            probed_last: None,
            last_warning: None,
            recording: None,
        }
    }

    /// Works until [`Command::Quit`].
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
        let mut change: Vec<Settings> = Vec::new();
        let mut next = Some(first);
        while let Some(command) = next {
            match command {
                Command::Quit => {
                    self.end_record(None);
                    return Next::Quit;
                }
                Command::Change(run, settings) => {
                    change.resize_with(change.len().max(run + 1), Settings::new);
                    for (key, value) in &settings {
                        put(&mut change[run], key, value);
                    }
                }
                Command::Load(request) => {
                    self.end_record(Some("another scene was opened".to_owned()));
                    change.clear();
                    self.load(*request);
                }
                Command::Accompany(request) => {
                    // They are numbered anew.
                    self.change_all(&mut change);
                    self.accompany(*request);
                }
                other => {
                    // Those have to do with what was changed before.
                    if matches!(other, Command::Save(_) | Command::Reset | Command::Probe(_)) {
                        self.change_all(&mut change);
                    }
                    self.obey(other);
                }
            }
            next = self.commands.try_recv().ok();
        }
        self.change_all(&mut change);
        Next::On
    }

    fn change_all(&mut self, change: &mut Vec<Settings>) {
        for (run, settings) in change.drain(..).enumerate() {
            self.change(run, &settings);
        }
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Proceed => {
                if let Some((request, assembly)) = self.asked.take() {
                    self.start(request, assembly);
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
            Command::Make(file, folder) => self.make(file, &folder),
            Command::Reset => self.reset(),
            Command::Speed(speed) => self.speed = speed,
            Command::Take { hold, body, rest, count, stiffness } => {
                let grip = GripTarget { body, rest, count, stiffness };
                self.each(|run| run.take(hold, &grip));
            }
            Command::Lead(hold, translation) => self.each(|run| run.lead(hold, translation)),
            Command::LetGo(hold) => self.each(|run| run.let_go(hold)),
            Command::Tool(act) => self.act(&act),
            Command::Record(path, mesh_files) => self.record(path, &mesh_files),
            Command::EndRecord => self.end_record(None),
            Command::Save(path) => self.save(path),
            Command::Probe(variants) => {
                self.probed = variants;
                self.probe();
            }
            Command::Color(coloring) => {
                self.coloring = coloring;
                // The scale of its colours is that of a frame that is read.
                (self.measured, self.was_due) = (None, false);
                self.publish();
            }
            Command::Look => {
                self.looked = Some(Instant::now());
                self.each(|run| run.read_state());
                self.publish();
            }
            // The rest was obeyed where commands are gathered.
            Command::Load(_) | Command::Accompany(_) | Command::Change(..) | Command::Quit => {}
        }
    }

    /// Warns of what would otherwise be said ten times a second.
    fn warn_once(&mut self, text: String) {
        if self.last_warning.as_ref() != Some(&text) {
            self.last_warning = Some(text.clone());
            self.tell(Event::Refused(text));
        }
    }

    fn tell(&self, event: Event) {
        // Where the window is gone, `Quit` or a closed channel follows.
        let _ = self.events.send(event);
        (self.wake)();
    }

    fn each(&mut self, act: impl Fn(&mut Box<dyn Run>) -> Result<(), String>) {
        let Some(running) = &mut self.running else { return };
        let refused = running.runs.iter_mut().find_map(|run| act(run).err());
        if let Some(message) = refused {
            self.tell(Event::Refused(message));
        }
    }

    /// Does something with an instrument in all simulations. What one of them does not take none has.
    fn act(&mut self, act: &ToolAct) {
        let Some(running) = &mut self.running else { return };
        let hand = act.hand();
        let refused = running.runs.iter_mut().find_map(|run| run.act(act).err());
        let Some(message) = refused else { return };
        if act.is_taking() {
            for run in &mut running.runs {
                // Where it was not taken there is nothing to put away.
                let _ = run.act(&ToolAct::PutAway { hand });
            }
            self.tell(Event::NotTaken(hand, message));
        } else {
            self.warn_once(message);
        }
    }

    fn record(&mut self, path: PathBuf, mesh_files: &MeshFiles) {
        self.end_record(None);
        let Some(run) = self.running.as_mut().and_then(|running| running.runs.first_mut()) else {
            return self.tell(Event::Recorded(path, 0, Some("nothing is running".to_owned())));
        };
        match RunRecording::begin(path.clone(), mesh_files, &mut **run) {
            Ok(recording) => self.recording = Some(recording),
            Err(message) => self.tell(Event::Recorded(path, 0, Some(message))),
        }
    }

    fn end_record(&mut self, why: Option<String>) {
        let Some(recording) = self.recording.take() else { return };
        let path = recording.path().to_owned();
        let run = self.running.as_mut().and_then(|running| running.runs.first_mut());
        match run.map(|run| recording.end(&mut **run)) {
            Some(Ok((path, frames))) => self.tell(Event::Recorded(path, frames, why)),
            Some(Err(message)) => self.tell(Event::Recorded(path, 0, Some(message))),
            None => self.tell(Event::Recorded(path, 0, why)),
        }
    }

    /// A frame was computed.
    fn record_frame(&mut self) {
        let run = self.running.as_mut().and_then(|running| running.runs.first_mut());
        let Some((recording, run)) = self.recording.as_mut().zip(run) else { return };
        if let Err(message) = recording.frame(&mut **run) {
            self.end_record(Some(message));
        }
    }

    fn fail(&mut self, message: String, cure: Cure) {
        self.end_record(Some("the simulation has stopped".to_owned()));
        self.running = None;
        self.tell(Event::Failed(Failure { message, cure }));
    }

    fn reset(&mut self) {
        let Some(running) = &mut self.running else { return };
        running.number = 0;
        let setup = Arc::clone(&running.setup);
        let refused = running.runs.iter_mut().find_map(|run| run.reset().err());
        self.due = Instant::now();
        match refused {
            None => {
                self.tell(Event::Ready(setup));
                self.publish();
            }
            Some(message) => self.fail(message, Cure::Open),
        }
    }

    fn change(&mut self, run: usize, settings: &Settings) {
        if let Some((mut request, assembly)) = self.asked.take() {
            let changed =
                request.scenes.get_mut(run).map_or(Ok(()), |scene| scene.change(settings));
            if let Err(error) = changed {
                self.tell(Event::Refused(error.to_string()));
            }
            return self.ask_or_start(request, assembly);
        }
        let Some(running) = &self.running else { return };
        let Some(changed) = running.runs.get(run).filter(|_| !settings.is_empty()) else {
            return;
        };
        let on_device = changed.is_on_device();
        let compiles = settings.iter().any(|(key, _)| {
            key == "solver.device" || on_device && OTHER_KERNELS.contains(&key.as_str())
        });
        if compiles {
            self.tell(Event::Busy("building the model, and kernels for its device".to_owned()));
        }
        let refused = self.try_change(run, settings);
        refused.into_iter().for_each(|event| self.tell(event));
        self.tell_devices();
        if compiles {
            self.tell(Event::Changed);
        }
    }

    /// Changes what can be changed; returns the events that report what was refused.
    fn try_change(&mut self, run: usize, settings: &Settings) -> Vec<Event> {
        let runs = self.running.as_mut().map(|running| &mut running.runs);
        let Some(changed) = runs.and_then(|runs| runs.get_mut(run)) else { return Vec::new() };
        let mut refused = Vec::new();
        if changed.change(settings).is_err() {
            // What can be, is.
            for setting in settings {
                if let Err(message) = changed.change(&vec![setting.clone()]) {
                    let key = setting.0.clone();
                    let kept = changed.setting(&key).map(|value| Event::Kept { run, key, value });
                    refused.extend([Some(Event::Refused(message)), kept].into_iter().flatten());
                }
            }
        }
        refused
    }

    fn save(&mut self, path: PathBuf) {
        let first = self.running.as_ref().and_then(|running| running.runs.first());
        match first.map(|run| run.done_by_hand()) {
            Some((text, time)) => self.tell(Event::Done { path, text, time }),
            None => self.tell(Event::Done { path, text: String::new(), time: 0.0 }),
        }
    }

    /// What computes the simulations, where that is news: one that was lost has left it to the CPU.
    fn tell_devices(&mut self) {
        let Some(running) = &mut self.running else { return };
        let now: Vec<_> = running.runs.iter().map(|run| run.device()).collect();
        let devices: Vec<String> = now.iter().map(|(device, _)| device.clone()).collect();
        if devices == running.devices {
            return;
        }
        running.devices.clone_from(&devices);
        for (_, warning) in now {
            if let Some(warning) = warning {
                self.tell(Event::Refused(warning));
            }
        }
        self.tell(Event::Devices(devices));
    }

    /// Gives the step that comes next to the thread that repeats it, where that has nothing to do.
    fn probe(&mut self) {
        let Some(running) = self.running.as_ref().filter(|_| !self.probed.is_empty()) else {
            return;
        };
        let tets = running.setup.tet_count();
        if tets > MOST_TETS {
            return self.warn_once(format!(
                "convergence is shown for meshes of at most {MOST_TETS} tetrahedra, and this one has {tets}"
            ));
        }
        let long_ago = self.probed_last.is_none_or(|since| since.elapsed() > PROBED_EVERY);
        if let Some(first) = running.runs.first()
            && (long_ago || !self.playing)
            && self.prober.as_ref().is_some_and(Prober::is_idle)
        {
            let next_step = first.next_step();
            self.probed_last = Some(Instant::now());
            if let Some(prober) = &self.prober {
                prober.probe(next_step, self.probed.clone());
            }
        }
    }
}
