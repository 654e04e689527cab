//! The tray of instruments, and what is in hands.

use eframe::egui::{self, Ui};
use viscera::scene::Instrument;
use viscera_stage::{InHand, Instruments, RunSnapshot};

use super::number::{Number, named};
use super::{Action, section};
use crate::controller::Controller;
use crate::help::Request;

/// Instruments to take; those in hands, each with its force; the controller.
pub fn show(
    ui: &mut Ui,
    tray: &[Instrument],
    hands: &Instruments,
    run: Option<&RunSnapshot>,
    controller: &Controller,
    actions: &mut Vec<Action>,
) {
    section(ui, "Instruments", true, |ui| {
        ui.horizontal_wrapped(|ui| {
            for (number, instrument) in tray.iter().enumerate() {
                let help = format!("Take it in hand ({})", number + 1);
                if ui.button(&instrument.name).on_hover_text(help).clicked() {
                    actions.push(Action::Ask(Request::TakeInstrument(number)));
                }
            }
        });
        for held in hands.list() {
            let is_active = hands.active().is_some_and(|active| active.id == held.id);
            show_held(ui, held, is_active, run, actions);
        }
        if hands.list().is_empty() {
            let text = "Take one, then press on it and drag. Tools of the scene can be taken by pressing on them.";
            ui.label(egui::RichText::new(text).weak().italics());
        }
        show_controller(ui, hands, controller);
    });
}

fn show_held(
    ui: &mut Ui,
    held: &InHand,
    is_active: bool,
    run: Option<&RunSnapshot>,
    actions: &mut Vec<Action>,
) {
    ui.horizontal(|ui| {
        let help = "Led by the pointer and the arrow keys (Tab)";
        if ui.selectable_label(is_active, &held.name).on_hover_text(help).clicked() {
            actions.push(Action::Activate(held.id));
        }
        let tool = run.and_then(|run| run.tools.iter().find(|tool| tool.hand == Some(held.id)));
        ui.strong(tool.map_or_else(|| "...".to_owned(), |tool| tool.force_text()));
        if held.jaws.is_some() {
            let mut locked = held.is_locked;
            let help = "What the jaws press on stays tied to them (X)";
            if ui.checkbox(&mut locked, "lock").on_hover_text(help).changed() {
                actions.push(Action::Lock(held.id));
            }
        }
        if ui.button("put away").on_hover_text("Del").clicked() {
            actions.push(Action::PutAway(held.id));
        }
    });
    let Some([angle, least, widest]) = held.jaws else { return };
    // Digits that nobody chose are left out.
    let degrees = |angle: f64| (10.0 * angle.to_degrees()).round() / 10.0;
    let [angle, least, widest] = [angle, least, widest].map(degrees);
    let look =
        Number { unit: "°", rail: least..=widest, logarithmic: false, whole: false, decimals: 0 };
    let name = format!("{} jaws", held.name);
    let edit = named(ui, &name, "How far its jaws are open: C closes, V opens", |ui, label| {
        look.show(ui, angle, label)
    });
    match edit.map(|edit| look.read(&name, &edit, -180.0..=180.0)) {
        None => {}
        Some(Ok(angle)) => actions.push(Action::OpenJaws(held.id, angle.to_radians())),
        Some(Err(error)) => actions.push(Action::Warn(error)),
    }
}

fn show_controller(ui: &mut Ui, hands: &Instruments, controller: &Controller) {
    let Some(name) = controller.name() else { return };
    match hands.other().or(hands.active()) {
        Some(led) => ui.weak(format!("{name} leads the {}", led.name)),
        None => ui.weak(format!("{name} is there: it leads an instrument that is taken")),
    };
}
