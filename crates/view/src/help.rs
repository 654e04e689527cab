//! The keyboard and the mouse: what each does, in one list that the window reads and shows.

use eframe::egui::{self, Key, Modifiers};

use crate::controller::{self, Controller};
use crate::steering::HELD;

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Runs or pauses.
    PlayPause,
    /// Computes one frame.
    Step,
    /// Begins anew.
    Reset,
    /// Takes a change back.
    Undo,
    /// Makes it again.
    Redo,
    /// Saves the scene.
    Save,
    /// Saves a picture.
    Screenshot,
    /// Begins or ends a recording.
    Record,
    /// Begins or ends a recording of the run, for a replay.
    RecordRun,
    /// Fits all tissue into the view.
    FitView,
    /// Lets go of everything.
    LetGo,
    /// Takes the instrument of this number from the tray.
    TakeInstrument(usize),
    /// Makes the other instrument active.
    NextInstrument,
    /// Locks the jaws of the active instrument, or unlocks them.
    LockJaws,
    /// The same of the other one.
    LockOtherJaws,
    /// Puts the active instrument away.
    PutAway,
    /// Shows this list.
    Help,
}

struct Shortcut {
    modifiers: Modifiers,
    key: Key,
    request: Request,
    shown: &'static str,
    text: &'static str,
}

const fn plain(key: Key, request: Request, shown: &'static str, text: &'static str) -> Shortcut {
    Shortcut { modifiers: Modifiers::NONE, key, request, shown, text }
}

const fn command(key: Key, request: Request, shown: &'static str, text: &'static str) -> Shortcut {
    Shortcut { modifiers: Modifiers::COMMAND, key, request, shown, text }
}

/// More modifiers first: Ctrl+Shift+Z would otherwise be heard as Ctrl+Z.
const SHORTCUTS: &[Shortcut] = &[
    Shortcut {
        modifiers: Modifiers::COMMAND.plus(Modifiers::SHIFT),
        key: Key::Z,
        request: Request::Redo,
        shown: "",
        text: "",
    },
    command(Key::Z, Request::Undo, "Ctrl+Z", "take the last change of a setting back"),
    command(Key::Y, Request::Redo, "Ctrl+Y", "make it again"),
    command(Key::S, Request::Save, "Ctrl+S", "save the scene"),
    plain(Key::Space, Request::PlayPause, "space", "run or pause"),
    plain(Key::Period, Request::Step, ".", "one frame"),
    plain(Key::R, Request::Reset, "R", "begin again from rest"),
    plain(Key::F, Request::FitView, "F", "fit view"),
    plain(Key::Escape, Request::LetGo, "Esc", "let go of everything"),
    plain(Key::S, Request::Screenshot, "S", "save a picture, in pictures/"),
    plain(
        Key::G,
        Request::Record,
        "G",
        "begin or end recording an animated image, at the pace of simulated time",
    ),
    plain(
        Key::T,
        Request::RecordRun,
        "T",
        "begin or end recording the run with all that hands do, for viscera replay",
    ),
    plain(Key::F1, Request::Help, "F1, ?", "this list"),
    plain(Key::Questionmark, Request::Help, "", ""),
];

/// Of instruments.
const OF_INSTRUMENTS: &[Shortcut] = &[
    plain(Key::Num1, Request::TakeInstrument(0), "1 to 5", "take an instrument from the tray"),
    plain(Key::Num2, Request::TakeInstrument(1), "", ""),
    plain(Key::Num3, Request::TakeInstrument(2), "", ""),
    plain(Key::Num4, Request::TakeInstrument(3), "", ""),
    plain(Key::Num5, Request::TakeInstrument(4), "", ""),
    plain(Key::Tab, Request::NextInstrument, "Tab", "the other instrument is active"),
    plain(Key::X, Request::LockJaws, "X, other: M", "lock the jaws, or unlock them"),
    plain(Key::M, Request::LockOtherJaws, "", ""),
    plain(Key::Delete, Request::PutAway, "Del", "put the active instrument away"),
];

const MOUSE: &[(&str, &str)] = &[
    ("left, on tissue", "take hold and pull"),
    ("left, beside it", "turn the view"),
    ("right, or middle", "turn the view; with Ctrl or Shift move it"),
    ("wheel", "nearer, farther"),
    ("left, on an instrument", "move it; wheel or Ctrl in depth, Shift turns it, Alt rolls it"),
    ("Shift at release", "hold on; Esc lets go"),
    ("drop a file", "open it: a scene, a mesh, a surface or a segmented scan"),
];

fn all() -> impl Iterator<Item = &'static Shortcut> {
    SHORTCUTS.iter().chain(OF_INSTRUMENTS)
}

/// What the keyboard asks for. A text field that is being written in keeps its keys: Escape, which leaves it, as
/// well, so `was_typing` says whether there was one in the frame before.
pub fn requests(context: &egui::Context, was_typing: bool) -> Vec<Request> {
    if was_typing || context.text_edit_focused() {
        return Vec::new();
    }
    context.input_mut(|input| {
        let pressed = all().filter(|s| input.consume_key(s.modifiers, s.key)).map(|s| s.request);
        pressed.collect()
    })
}

/// The list, in a window of its own.
pub fn show(context: &egui::Context, open: &mut bool, controller: &Controller) {
    egui::Window::new("Keyboard and mouse")
        .open(open)
        .resizable(false)
        .collapsible(false)
        .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
        .show(context, |ui| {
            ui.set_min_width(460.0);
            egui::Grid::new("shortcuts").num_columns(2).spacing([18.0, 5.0]).show(ui, |ui| {
                let keys = |all: &'static [Shortcut]| all.iter().map(|s| (s.shown, s.text));
                let held = HELD.iter().copied();
                let instruments = keys(OF_INSTRUMENTS).chain(held);
                for (shown, text) in MOUSE.iter().copied().chain(keys(SHORTCUTS)).chain(instruments)
                {
                    if !shown.is_empty() {
                        ui.strong(shown);
                        ui.label(text);
                        ui.end_row();
                    }
                }
            });
            ui.add_space(6.0);
            match controller.missing() {
                Some(missing) => ui.weak(format!("game controller: {missing}")),
                None => ui.label(controller::HELP),
            };
        });
}
