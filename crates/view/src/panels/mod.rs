//! The window's panels. Each shows what is, and says what a person wants changed; only the app changes it.

mod axes;
mod choice;
pub mod convergence;
pub mod forces;
pub mod instruments;
pub mod material;
mod number;
pub mod scene;
pub mod solver;
pub mod time;
pub mod view;

use eframe::egui::{self, Ui};
use std::path::PathBuf;

use crate::choices::{Settings, Side};
use crate::help::Request;
use viscera_stage::{HandId, HoldId};

/// What a person wants.
#[derive(Clone, Debug)]
pub enum Action {
    /// What a key or a button asks for.
    Ask(Request),
    /// Settings of a solver; true while a slider is being dragged.
    Choose(Side, Settings, bool),
    /// Two solvers side by side, or one.
    Compare(bool),
    /// The reference as a ghost.
    Ghost(bool),
    /// Simulated seconds per second of the clock.
    Speed(f64),
    /// Says why something cannot be.
    Warn(String),
    /// Lets go of one point.
    LetGo(HoldId),
    /// Makes an instrument active.
    Activate(HandId),
    /// Opens or closes the jaws of an instrument to an angle [rad].
    OpenJaws(HandId, f64),
    /// Locks its jaws, or unlocks them.
    Lock(HandId),
    /// Puts it away.
    PutAway(HandId),
    /// Another scene.
    Open(PathBuf),
    /// Saves the scene there.
    SaveAs(PathBuf),
    /// Goes on with a large mesh.
    Proceed,
    /// Goes on with the CPU.
    UseCpu,
}

/// A part of the settings that can be folded away.
fn section(ui: &mut Ui, title: &str, open: bool, contents: impl FnOnce(&mut Ui)) {
    egui::CollapsingHeader::new(egui::RichText::new(title).strong())
        .default_open(open)
        .show(ui, contents);
}
