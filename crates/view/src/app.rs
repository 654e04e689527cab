//! The window's state, and what happens to it.

mod files;
mod hearing;
mod opening;
mod steering;

use eframe::egui::{self, CentralPanel, Panel, ScrollArea, Ui};
use eframe::egui_wgpu::RenderState;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use crate::capture::{FOLDER, Recorder};
use viscera::scalar::Vec3;
use viscera::scene::Instrument;

use crate::choices::{Settings, Side};
use crate::controller::Controller;
use crate::curves::ForceCurves;
use crate::document::Document;
use crate::engine::{Command, Cure, Engine, MadeScene, Setup, Snapshot};
use crate::hands::Hands;
use crate::help::{self, Request};
use crate::holds::Holds;
use crate::messages::Messages;
use crate::panels::time::Clock;
use crate::panels::{self, Action, scene::Fields};
use crate::preferences::Preferences;
use crate::probe::Curve;
use crate::session::Session;
use crate::viewport::{Gpu, Viewport};
use opening::Making;
use viscera_stage::Instruments;

/// What the command line asks for.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The scene file, the name of a built-in scene, or a mesh, a surface or a scan of which one is made.
    pub scene: PathBuf,
    /// Settings laid over it.
    pub settings: Settings,
    /// Settings of a second solver beside the first; none without one.
    pub beside: Settings,
    /// Where mesh files are looked for that are not beside the scene.
    pub data: Option<PathBuf>,
    /// Where pictures and recordings go.
    pub pictures: PathBuf,
    /// The folder in whose `out` scenes of other files are made; the one where the program was started, where it is empty.
    pub scenes: PathBuf,
    /// Gets why the window had to close, where it did not close by itself.
    pub farewell: Arc<OnceLock<String>>,
    /// Whether simulations on a graphics processor share the window's device, as they do on hardware, where software draws as
    /// well: pictures wait for them then.
    pub shares_software: bool,
}

/// The scene that is opened where none is named: an organ to pull on, without instruments of its own in the way.
pub const FIRST_SCENE: &str = "liver_lifted";

/// The window.
pub struct App {
    engine: Engine,
    session: Session,
    viewport: Viewport,
    hands: Hands,
    /// Instruments that can be taken.
    tray: Vec<Instrument>,
    controller: Controller,
    /// When the controller was asked last.
    controlled: Instant,
    preferences: Preferences,
    clock: Clock,
    messages: Messages,
    setup: Option<Arc<Setup>>,
    snapshot: Option<Box<Snapshot>>,
    devices: Vec<String>,
    fields: Fields,
    recorder: Option<Recorder>,
    /// Where the run is being recorded.
    recorded_run: Option<PathBuf>,
    pictures: PathBuf,
    scenes: PathBuf,
    farewell: Arc<OnceLock<String>>,
    help_open: bool,
    /// Whether a text field was being written in when the window was shown last.
    was_typing: bool,
    /// Number and moment of the frame from which the rate was counted last.
    counted: (u64, Instant),
    /// Pictures of the window since then.
    shown: u32,
    forces: ForceCurves,
    /// How solvers converge in a step of the first simulation.
    curves: Vec<Curve>,
    /// The file of which a scene is being made.
    making: Option<Making>,
    /// What is to be known of the open scene, where it was made of another file.
    made: Option<MadeScene>,
    /// What is being saved: where, and of what.
    saving: Vec<(PathBuf, Document, Settings)>,
}

impl App {
    /// Opens a scene. A scene that cannot be read is said in the window, with the first scene beneath.
    pub fn new(
        context: &egui::Context,
        render_state: RenderState,
        options: Options,
        preferences: Preferences,
    ) -> anyhow::Result<Self> {
        let mut messages = Messages::default();
        let (session, making) = opening::first_session(&options, &mut messages)?;
        let wake = context.clone();
        let gpu = Gpu::new(render_state);
        let is_shared = options.shares_software || !gpu.device.is_software();
        let device = is_shared.then(|| gpu.device.clone());
        let engine = Engine::start(device, move || wake.request_repaint())?;
        let mut app = Self {
            engine,
            viewport: Viewport::new(gpu),
            hands: Hands::default(),
            tray: viscera_stage::tray()?,
            controller: Controller::open(),
            controlled: Instant::now(),
            clock: Clock::default(),
            setup: None,
            snapshot: None,
            devices: Vec::new(),
            fields: Fields::default(),
            recorder: None,
            recorded_run: None,
            pictures: options.pictures,
            scenes: options.scenes,
            farewell: options.farewell,
            help_open: false,
            was_typing: false,
            counted: (0, Instant::now()),
            shown: 0,
            forces: ForceCurves::default(),
            curves: Vec::new(),
            saving: Vec::new(),
            making,
            made: None,
            session,
            preferences,
            messages,
        };
        app.engine.send(Command::Probe(app.preferences.ticked_variants()));
        app.begin();
        Ok(app)
    }

    /// The newest snapshot, which is shown.
    pub fn snapshot(&self) -> Option<&Snapshot> {
        self.snapshot.as_deref()
    }

    /// What runs, which does not change meanwhile.
    pub fn setup(&self) -> Option<&Setup> {
        self.setup.as_deref()
    }

    /// What is open and chosen.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Whether simulations run, as far as was asked for.
    pub fn is_playing(&self) -> bool {
        self.clock.playing
    }

    /// Proposes where to save.
    pub fn save_under(&mut self, path: &Path) {
        self.fields.save = path.display().to_string();
    }

    /// Whether the window's device was lost.
    pub fn viewport_lost(&self) -> bool {
        self.viewport.lost().is_some()
    }

    /// What is held.
    pub fn holds(&self) -> &Holds {
        &self.hands.holds
    }

    /// Instruments in hands.
    pub fn instruments(&self) -> &Instruments {
        &self.hands.instruments
    }

    /// Where in the window the first picture shows a point [m]; nothing where it is behind the viewer.
    pub fn place(&self, point: Vec3<f64>) -> Option<egui::Pos2> {
        self.viewport.lens()?.place(point)
    }

    /// Forces over the last seconds.
    pub fn forces(&self) -> &ForceCurves {
        &self.forces
    }

    /// What the window has to say.
    pub fn messages(&self) -> &Messages {
        &self.messages
    }

    /// What the window remembers.
    pub fn preferences(&self) -> &Preferences {
        &self.preferences
    }

    /// Hears of the simulation, shows everything, does what is asked for.
    pub fn show(&mut self, ui: &mut Ui) {
        let context = ui.ctx().clone();
        if self.say_farewell(&context) {
            return;
        }
        self.shown += 1;
        self.take_dropped(&context);
        self.hear();
        self.take_snapshot();
        self.steer(&context);
        let coloring = self.preferences.coloring;
        let variants = self.preferences.ticked_variants();
        let mut actions: Vec<Action> =
            help::requests(&context, self.was_typing).into_iter().map(Action::Ask).collect();
        self.show_panels(ui, &mut actions);
        let central = CentralPanel::no_frame().show(ui, |ui| {
            let snapshot = self.snapshot.as_deref();
            self.viewport.show(ui, snapshot, &mut self.hands, &self.preferences)
        });
        let (commands, failed) = central.inner;
        self.send(commands);
        if let Some(error) = failed {
            self.messages.warn(error);
        }
        self.messages.show(&context, central.response.rect, &mut actions);
        help::show(&context, &mut self.help_open, &self.controller);
        if self.preferences.coloring != coloring {
            self.engine.send(Command::Color(self.preferences.coloring));
        }
        if self.preferences.ticked_variants() != variants {
            self.engine.send(Command::Probe(self.preferences.ticked_variants()));
        }
        for action in actions {
            self.act(action);
        }
        if context.dragged_id().is_none() {
            self.session.settle();
        }
        self.was_typing = context.text_edit_focused();
        self.record();
    }

    fn show_panels(&mut self, ui: &mut Ui, actions: &mut Vec<Action>) {
        Panel::top("bar").show(ui, |ui| {
            ui.add_space(3.0);
            let recording = [self.recorder.is_some(), self.recorded_run.is_some()];
            let preferences = &mut self.preferences;
            panels::time::show_bar(ui, &self.clock, &self.session, recording, preferences, actions);
            ui.add_space(3.0);
        });
        Panel::bottom("status").show(ui, |ui| {
            ui.horizontal_wrapped(|ui| match (&self.setup, &self.snapshot) {
                (Some(setup), Some(snapshot)) => {
                    panels::time::show_status(ui, &self.clock, setup, snapshot);
                }
                _ => {
                    ui.weak("nothing is running yet");
                }
            });
        });
        if self.preferences.settings_open {
            Panel::right("settings").default_size(330.0).show(ui, |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    self.show_settings(ui, actions);
                });
            });
        }
        if self.preferences.convergence_open {
            Panel::left("convergence").resizable(true).default_size(360.0).show(ui, |ui| {
                panels::convergence::show(ui, &mut self.preferences, &self.curves);
            });
        }
        if self.preferences.curve_open {
            Panel::bottom("curve").resizable(true).default_size(150.0).show(ui, |ui| {
                let now = self.snapshot.as_ref().map_or(0.0, |snapshot| snapshot.time);
                if let Some(run) = self.snapshot.as_ref().and_then(|all| all.runs.first())
                    && let Some(ledger) = run.ledger.filter(|_| !run.tools.is_empty())
                {
                    panels::forces::show_ledger(ui, &ledger);
                }
                panels::forces::show(ui, &self.forces, now, self.session.is_comparison());
            });
        }
    }

    fn show_settings(&mut self, ui: &mut Ui, actions: &mut Vec<Action>) {
        let setup = self.setup.as_deref();
        if self.making.is_some() && setup.is_none() {
            ui.weak("Settings come with the scene.");
            return;
        }
        let notes = self.notes().join("\n");
        let (fields, preferences) = (&mut self.fields, &mut self.preferences);
        let numbers = setup.map(|setup| (setup, notes.as_str()));
        panels::scene::show(ui, &self.session, numbers, fields, preferences, actions);
        let run = self.snapshot.as_ref().and_then(|snapshot| snapshot.runs.first());
        let instruments = &self.hands.instruments;
        panels::instruments::show(ui, &self.tray, instruments, run, &self.controller, actions);
        panels::view::show_grip(
            ui,
            &mut self.preferences,
            &self.hands.holds,
            &self.forces,
            actions,
        );
        panels::view::show(ui, &mut self.preferences, actions);
        panels::material::show(ui, self.session.scene(Side::First), actions);
        let sides: &[(&str, Side)] = match self.session.is_comparison() {
            true => &[("Solver A", Side::First), ("Solver B", Side::Second)],
            false => &[("Solver", Side::First)],
        };
        for (number, (title, side)) in sides.iter().enumerate() {
            let solver = &self.session.scene(*side).solver;
            let device = self.devices.get(number).map(String::as_str);
            panels::solver::show(ui, title, *side, solver, device, actions);
        }
    }

    fn send(&self, commands: impl IntoIterator<Item = Command>) {
        commands.into_iter().for_each(|command| self.engine.send(command));
    }

    /// Does what a panel asks for.
    fn act(&mut self, action: Action) {
        match action {
            Action::Ask(request) => self.ask(request),
            Action::Choose(side, settings, gesture) => {
                let chosen = self.session.choose(side, &settings, gesture);
                self.carry_out(chosen);
            }
            Action::Compare(on) => {
                let chosen = self.session.compare(on, self.session.choices().ghost);
                self.carry_out(chosen);
            }
            Action::Ghost(ghost) => {
                let chosen = self.session.compare(self.session.is_comparison(), ghost);
                if ghost && chosen.as_ref().is_ok_and(|commands| !commands.is_empty()) {
                    self.messages.busy = Some("waiting for the reference".to_owned());
                }
                self.carry_out(chosen);
            }
            Action::Speed(speed) => {
                self.clock.speed = speed;
                self.engine.send(Command::Speed(speed));
            }
            Action::Warn(text) => self.messages.warn(text),
            Action::LetGo(hold) => {
                let command = self.hands.holds.let_go(hold);
                self.send(command);
            }
            of_instruments @ (Action::Activate(_)
            | Action::OpenJaws(..)
            | Action::Lock(_)
            | Action::PutAway(_)) => self.act_on_instruments(&of_instruments),
            Action::Open(path) => self.open(&path),
            Action::SaveAs(path) => self.save_as(&path),
            Action::Proceed => {
                self.messages.expect = None;
                self.engine.send(Command::Proceed);
            }
            Action::UseCpu => {
                let cpu = vec![("solver.device".to_owned(), "cpu".to_owned())];
                let chosen = self.session.choose(Side::First, &cpu, false);
                self.carry_out(chosen);
            }
        }
    }

    fn carry_out(&mut self, commands: Result<Vec<Command>, String>) {
        match commands {
            Ok(commands) if commands.is_empty() => {}
            // Nothing runs that could take a change: everything begins anew with it.
            Ok(_) if self.messages.failure.as_ref().is_some_and(|f| f.cure != Cure::Reset) => {
                let load = self.session.load();
                self.send([load]);
                self.play(true);
            }
            Ok(commands) => self.send(commands),
            Err(error) => self.messages.warn(error),
        }
    }

    /// Does what a key or a button asks for.
    fn ask(&mut self, request: Request) {
        match request {
            Request::PlayPause => self.play(!self.clock.playing),
            Request::Step => {
                self.clock.playing = false;
                self.engine.send(Command::Step);
            }
            Request::Reset => {
                let reset = self.session.begin_again();
                self.engine.send(reset);
                // What has diverged was stopped; beginning anew is meant to run.
                let stopped = self.messages.failure.take_if(|failure| failure.cure == Cure::Reset);
                if stopped.is_some() {
                    self.play(true);
                }
            }
            Request::Undo => {
                let undone = self.session.undo();
                self.carry_out(undone);
            }
            Request::Redo => {
                let redone = self.session.redo();
                self.carry_out(redone);
            }
            Request::Save => {
                let path = PathBuf::from(self.fields.save.trim());
                self.save_as(&path);
            }
            Request::Screenshot => self.take_picture(),
            Request::Record => self.toggle_recording(),
            Request::RecordRun => self.toggle_run_recording(),
            Request::FitView => self.viewport.fit_view(),
            Request::LetGo => {
                let held: Vec<_> = self.hands.holds.list().iter().map(|held| held.id).collect();
                for hold in held {
                    let command = self.hands.holds.let_go(hold);
                    self.send(command);
                }
            }
            Request::Help => self.help_open = !self.help_open,
            of_instruments => self.ask_instruments(of_instruments),
        }
    }

    fn play(&mut self, playing: bool) {
        self.clock.playing = playing;
        self.counted =
            (self.snapshot.as_ref().map_or(0, |snapshot| snapshot.number), Instant::now());
        self.engine.send(Command::Play(playing));
    }
}

/// Where pictures go unless the command line says otherwise.
pub fn default_pictures() -> PathBuf {
    PathBuf::from(FOLDER)
}
