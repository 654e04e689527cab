//! What the window says: short messages that go away, and what stands in the way.

use eframe::egui::{self, Align2, Color32, RichText, vec2};
use std::time::{Duration, Instant};

use crate::engine::{Cure, Failure};
use crate::help::Request;
use crate::panels::Action;

/// How long a message stays.
const SHOWN: Duration = Duration::from_secs(9);

/// Messages, the newest last.
#[derive(Debug, Default)]
pub struct Messages {
    list: Vec<(Instant, bool, String)>,
    /// What takes a while at the moment.
    pub busy: Option<String>,
    /// What a person should know before going on.
    pub expect: Option<String>,
    /// Why nothing runs.
    pub failure: Option<Failure>,
}

impl Messages {
    /// Something worth knowing.
    pub fn tell(&mut self, text: impl Into<String>) {
        self.list.push((Instant::now(), false, text.into()));
    }

    /// Something that did not work.
    pub fn warn(&mut self, text: impl Into<String>) {
        let text = text.into();
        // A slider that is dragged beyond what is possible says it once.
        self.list.retain(|(_, _, known)| *known != text);
        self.list.push((Instant::now(), true, text));
    }

    /// All texts that are shown.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        let stopping = self.failure.as_ref().map(|failure| failure.message.as_str());
        self.list.iter().map(|(_, _, text)| text.as_str()).chain(stopping)
    }

    /// Shows them over a part of the window.
    pub fn show(&mut self, context: &egui::Context, area: egui::Rect, actions: &mut Vec<Action>) {
        self.list.retain(|(since, _, _)| since.elapsed() < SHOWN);
        if !self.list.is_empty() {
            context.request_repaint_after(Duration::from_millis(500));
        }
        let mut dismissed = None;
        let width = (area.width() - 40.0).clamp(80.0, 520.0);
        egui::Area::new(egui::Id::unique("messages"))
            .fixed_pos(area.left_bottom() + vec2(12.0, -12.0))
            .pivot(Align2::LEFT_BOTTOM)
            .show(context, |ui| {
                for (number, (_, is_warning, text)) in self.list.iter().enumerate() {
                    egui::Frame::popup(ui.style()).show(ui, |ui| {
                        ui.set_max_width(width);
                        let text = RichText::new(text);
                        let warning = Color32::from_rgb(225, 120, 40);
                        let text = if *is_warning { text.color(warning) } else { text };
                        let label = egui::Label::new(text).sense(egui::Sense::click());
                        if ui.add(label).on_hover_text("Click to remove").clicked() {
                            dismissed = Some(number);
                        }
                    });
                }
            });
        if let Some(number) = dismissed {
            self.list.remove(number);
        }
        self.show_in_the_way(context, area, actions);
    }

    fn show_in_the_way(
        &self,
        context: &egui::Context,
        area: egui::Rect,
        actions: &mut Vec<Action>,
    ) {
        if let Some(failure) = &self.failure {
            notice(context, area, "The simulation has stopped", &failure.message, |ui| {
                cures(ui, failure.cure, actions);
            });
        } else if let Some(text) = &self.expect {
            notice(context, area, "This is large", text, |ui| {
                if ui.button("Go on").clicked() {
                    actions.push(Action::Proceed);
                }
                ui.label("or open another scene in the settings.");
            });
        } else if let Some(text) = &self.busy {
            notice(context, area, "One moment", text, |ui| {
                ui.spinner();
            });
        }
    }
}

fn cures(ui: &mut egui::Ui, cure: Cure, actions: &mut Vec<Action>) {
    match cure {
        Cure::Reset => {
            if ui.button("Begin again from rest").clicked() {
                actions.push(Action::Ask(Request::Reset));
            }
            if ui.button("Undo the last change").clicked() {
                actions.push(Action::Ask(Request::Undo));
                actions.push(Action::Ask(Request::Reset));
            }
        }
        Cure::Cpu => {
            if ui.button("Go on with the CPU").clicked() {
                actions.push(Action::UseCpu);
            }
        }
        Cure::Open => {
            ui.label("Open another scene in the settings, or correct this one and open it again.");
        }
    }
}

fn notice(
    context: &egui::Context,
    area: egui::Rect,
    title: &str,
    text: &str,
    contents: impl FnOnce(&mut egui::Ui),
) {
    egui::Window::new(title)
        .collapsible(false)
        .resizable(false)
        .pivot(Align2::CENTER_CENTER)
        .fixed_pos(area.center())
        .show(context, |ui| {
            ui.set_max_width(420.0);
            ui.label(text);
            ui.add_space(6.0);
            ui.horizontal_wrapped(contents);
        });
}
