//! How the tissue is shown, and how one takes hold of it.

use eframe::egui::{self, Ui};
use std::ops::RangeInclusive;
use viscera_stage::{Coloring, newtons};

use super::number::{Number, named};
use super::{Action, section};
use crate::curves::{ForceCurves, Source};
use crate::help::Request;
use crate::holds::Holds;
use crate::preferences::Preferences;

const COLORINGS: [(Coloring, &str, &str); 6] = [
    (Coloring::Plain, "tissue", "The tissue's own colour"),
    (Coloring::Bodies, "bodies", "Each body in a colour of its own, organs as one knows them"),
    (Coloring::Displacement, "displacement", "How far each point is from where it is at rest"),
    (Coloring::Strain, "strain", "By how much the most stretched direction is longer than at rest"),
    (Coloring::Stress, "stress", "Von Mises stress"),
    (Coloring::Pressure, "contact", "How hard tools press on the surface, as a pressure"),
];

/// Colours, marks.
pub fn show(ui: &mut Ui, preferences: &mut Preferences, actions: &mut Vec<Action>) {
    section(ui, "View", true, |ui| {
        ui.horizontal_wrapped(|ui| {
            for (coloring, name, help) in COLORINGS {
                ui.selectable_value(&mut preferences.coloring, coloring, name).on_hover_text(help);
            }
        });
        ui.horizontal(|ui| {
            ui.checkbox(&mut preferences.fixings, "fixings")
                .on_hover_text("Mark vertices that are held in place");
            ui.checkbox(&mut preferences.wireframe, "wireframe")
                .on_hover_text("Draw the surface's triangles");
            ui.checkbox(&mut preferences.shadow, "shadow");
            if ui.button("fit view").on_hover_text("Show everything (F)").clicked() {
                actions.push(Action::Ask(Request::FitView));
            }
        });
    });
}

/// Numbers of vertices that one can take hold of; more than a body has are all of them.
const MOST_GRIPPED: RangeInclusive<f64> = 1.0..=1e6;

/// Stiffness of the hand's spring [N/m]. Beyond, single precision is left without digits.
const SPRINGS: RangeInclusive<f64> = 1e-3..=1e6;

/// A number of the window's own, by its name and what it means: what it is now.
fn own(
    ui: &mut Ui,
    (name, help): (&str, &str),
    look: &Number<'_>,
    value: f64,
    legal: RangeInclusive<f64>,
    actions: &mut Vec<Action>,
) -> f64 {
    let edit = named(ui, name, help, |ui, label| look.show(ui, value, label));
    let chosen = edit.map(|edit| look.read(name, &edit, legal));
    match chosen {
        None => value,
        Some(Ok(chosen)) => chosen,
        Some(Err(error)) => {
            actions.push(Action::Warn(error));
            value
        }
    }
}

/// The hand, and what it holds.
pub fn show_grip(
    ui: &mut Ui,
    preferences: &mut Preferences,
    holds: &Holds,
    curves: &ForceCurves,
    actions: &mut Vec<Action>,
) {
    section(ui, "Hand", true, |ui| {
        let grip = &mut preferences.grip;
        let help = "How many vertices the next press takes hold of";
        let look = Number {
            unit: "vertices",
            rail: 1.0..=60.0,
            logarithmic: false,
            whole: true,
            decimals: 0,
        };
        let count = own(ui, ("grip", help), &look, f64::from(grip.count), MOST_GRIPPED, actions);
        grip.count = count as u32;
        let help = "Stiffness of the spring between hand and tissue, all vertices together";
        let look = Number {
            unit: "N/m",
            rail: 10.0..=5000.0,
            logarithmic: true,
            whole: false,
            decimals: 0,
        };
        ui.add_enabled_ui(!grip.rigid, |ui| {
            let name = ("spring", help);
            grip.stiffness = own(ui, name, &look, grip.stiffness, SPRINGS, actions);
        });
        ui.horizontal(|ui| {
            ui.checkbox(&mut grip.rigid, "rigid").on_hover_text("Hold without a spring");
            ui.checkbox(&mut grip.keep, "keep")
                .on_hover_text("Hold on when the button is released, as with Shift");
        });
        for (number, held) in holds.list().iter().enumerate() {
            ui.horizontal(|ui| {
                let last = curves.last(&Source::Hold(held.id));
                let force = last.map_or(f64::NAN, |point| point.forces[0]);
                ui.label(format!("point {}", number + 1));
                ui.strong(if force.is_nan() { "...".to_owned() } else { newtons(force) });
                ui.weak(format!("{:.0} mm away", 1e3 * held.translation.length()));
                if ui.button("let go").clicked() {
                    actions.push(Action::LetGo(held.id));
                }
            });
        }
        if holds.list().is_empty() {
            ui.label(egui::RichText::new("Press on the tissue and pull.").weak().italics());
        }
    });
}
