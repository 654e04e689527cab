//! The bar above: running, stepping, beginning anew, speed; pictures; comparison.

use eframe::egui::{self, Ui};

use super::Action;
use super::number::Number;
use viscera_stage::inverted;

use crate::engine::{Setup, Snapshot};
use crate::help::Request;
use crate::preferences::Preferences;
use crate::session::Session;

/// What runs, and how fast.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Whether it runs.
    pub playing: bool,
    /// Simulated seconds per second.
    pub speed: f64,
    /// Frames computed per second, smoothed; zero while paused.
    pub rate: f64,
    /// Pictures of the window per second of the clock.
    pub drawn: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Self { playing: true, speed: 1.0, rate: 0.0, drawn: 0.0 }
    }
}

/// The bar above.
pub fn show_bar(
    ui: &mut Ui,
    clock: &Clock,
    session: &Session,
    [is_filmed, is_recorded]: [bool; 2],
    preferences: &mut Preferences,
    actions: &mut Vec<Action>,
) {
    ui.horizontal_wrapped(|ui| {
        let mut ask = |ui: &mut Ui, name: &str, help: &str, enabled: bool, request: Request| {
            let button = ui.add_enabled(enabled, egui::Button::new(name)).on_hover_text(help);
            if button.clicked() {
                actions.push(Action::Ask(request));
            }
        };
        let play = if clock.playing { "Pause" } else { "Run" };
        ask(ui, play, "Run or pause (space)", true, Request::PlayPause);
        ask(ui, "Step", "One frame (.)", true, Request::Step);
        ask(ui, "Reset", "Begin again from rest (R)", true, Request::Reset);
        ui.separator();
        let history = session.history();
        ask(ui, "Undo", "Ctrl+Z", history.can_undo(), Request::Undo);
        ask(ui, "Redo", "Ctrl+Y", history.can_redo(), Request::Redo);
        ui.separator();
        ask(ui, "Picture", "Save a picture of the tissue (S)", true, Request::Screenshot);
        let record = if is_filmed { "Stop recording" } else { "Record" };
        ask(
            ui,
            record,
            "An animated image of the motion, at the pace of simulated time (G)",
            true,
            Request::Record,
        );
        let run = if is_recorded { "Stop recording the run" } else { "Record run" };
        let help =
            "The run with all that hands do, to be computed once more with viscera replay (T)";
        ask(ui, run, help, true, Request::RecordRun);
        ask(ui, "Save scene", "Ctrl+S", true, Request::Save);
        ui.separator();
        compare(ui, session, actions);
        ui.separator();
        let name = ui.label("speed");
        let look =
            Number { unit: "x", rail: 0.05..=4.0, logarithmic: true, whole: false, decimals: 2 };
        let (_, edit) = look.show(ui, clock.speed, name.id);
        if let Some(edit) = edit {
            // Slower is standing still, faster is as fast as it goes.
            let speed = look.read("speed", &edit, 1e-3..=1e3);
            actions.push(speed.map_or_else(Action::Warn, Action::Speed));
        }
        ui.separator();
        ui.toggle_value(&mut preferences.settings_open, "Settings");
        ui.toggle_value(&mut preferences.curve_open, "Forces");
        ui.toggle_value(&mut preferences.convergence_open, "Convergence");
        if ui.button("?").on_hover_text("Keyboard and mouse (F1)").clicked() {
            actions.push(Action::Ask(Request::Help));
        }
    });
}

fn compare(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let mut on = session.is_comparison();
    let help = "Two solvers side by side: from the same state, under the same hand, each with its own settings.";
    if ui.toggle_value(&mut on, "A | B").on_hover_text(help).changed() {
        actions.push(Action::Compare(on));
    }
    let mut ghost = session.choices().ghost;
    let help = "The converged solution as a ghost, from the same state; for small meshes.";
    if ui.toggle_value(&mut ghost, "reference (converged)").on_hover_text(help).changed() {
        actions.push(Action::Ghost(ghost));
    }
}

/// The line below: what time it is, and what a frame costs.
pub fn show_status(ui: &mut Ui, clock: &Clock, setup: &Setup, snapshot: &Snapshot) {
    let dt = setup.scene.time.frame;
    let real = clock.rate * dt;
    ui.label(format!("t = {:.2} s", snapshot.time));
    ui.separator();
    let names = ["A", "B", "reference"];
    for (number, run) in snapshot.runs.iter().enumerate() {
        let is_ghost = setup.has_ghost && number + 1 == snapshot.runs.len();
        let name = match (snapshot.runs.len(), is_ghost) {
            (1, _) => "",
            (_, true) => names[2],
            _ => names[number.min(1)],
        };
        let text = format!("{name} {:.1} ms per frame of {:.1} ms", 1e3 * run.wall, 1e3 * dt);
        ui.label(text.trim()).on_hover_text(format!(
            "Substeps: {} of {} iterations, {:.2} ms each. Energy: elastic {:.3e} J, kinetic {:.3e} J. Rejected \
             substeps so far: {}.",
            run.counts[0],
            run.counts[1],
            1e3 * run.wall / f64::from(run.counts[0].max(1)),
            run.measures.energy.elastic,
            run.measures.energy.kinetic,
            run.measures.rejected,
        ));
        ui.weak(format!("residual {:.1e}", run.measures.residual))
            .on_hover_text("Unbalanced forces over loads; at rest, how well the equations hold");
        if let Some(text) = inverted(run) {
            let text = if name.is_empty() { text } else { format!("{name}: {text}") };
            ui.colored_label(ui.visuals().warn_fg_color, text).on_hover_text(
                "Turned inside out. Their stress and strain mean nothing and are left out of the colours. Pull less \
                 far, or take more substeps or iterations.",
            );
        }
        ui.separator();
    }
    let pace = dt / clock.speed;
    if clock.playing && snapshot.waits_for_ghost(setup, pace) {
        ui.spinner();
        ui.label("waits for the reference").on_hover_text(
            "All simulations stay at one time, and the reference takes longer than the clock.",
        );
    }
    if clock.playing {
        ui.label(format!("{real:.2} x real time"));
        let digits = if clock.rate < 10.0 { 1 } else { 0 };
        ui.weak(format!("{:.digits$} frames/s, {:.0} drawn", clock.rate, clock.drawn));
    } else {
        ui.label("paused");
    }
}
