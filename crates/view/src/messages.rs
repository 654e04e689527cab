//! What the window says: short messages that go away, and what stands in the way.

use eframe::egui::{self, Align2, Color32, RichText, vec2};
use std::time::{Duration, Instant};

use crate::engine::{Cure, Failure};
use crate::help::Request;
use crate::panels::Action;

/// How long a message stays.
const SHOWN: Duration = Duration::from_secs(9);

/// Lines of a message that is made of several.
const MOST_LINES: usize = 5;

/// Messages, the newest last.
#[derive(Debug, Default)]
pub struct Messages {
    list: Vec<(Instant, bool, String)>,
    /// What takes a while at the moment.
    pub busy: Option<String>,
    /// What is being done to make a scene of a file.
    pub making: Option<String>,
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

    /// Lines that belong together, the first of them below a title, where there is one.
    pub fn tell_all(&mut self, title: &str, lines: &[String]) {
        let shown = if lines.len() > MOST_LINES { MOST_LINES - 1 } else { lines.len() };
        let mut text: Vec<&str> = vec![title];
        text.extend(lines[..shown].iter().map(|line| line.trim()));
        let more =
            format!("and {} more, which are told at the number of tetrahedra", lines.len() - shown);
        text.extend((shown < lines.len()).then_some(more.as_str()));
        text.retain(|line| !line.is_empty());
        if !text.is_empty() {
            self.tell(text.join("\n"));
        }
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
        if let Some(doing) = &self.making {
            notice(context, area, "Making a scene", doing, |ui| {
                ui.spinner();
            });
        } else if let Some(failure) = &self.failure {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_belong_together_are_one_message_and_not_a_long_one() {
        let mut messages = Messages::default();
        messages.tell_all("", &[]);
        assert_eq!(messages.texts().count(), 0);
        let lines: Vec<String> = (1..=MOST_LINES).map(|n| format!("note {n}")).collect();
        messages.tell_all("", &lines);
        messages.tell_all("made", &[&lines[..], &lines[..]].concat());
        let told: Vec<Vec<&str>> = messages.texts().map(|text| text.lines().collect()).collect();
        assert_eq!((told.len(), told[0].len(), told[1].len()), (2, MOST_LINES, MOST_LINES + 1));
        assert_eq!((told[1][0], told[1][1]), ("made", "note 1"));
        assert!(told[1][MOST_LINES].starts_with("and 6 more"), "{told:?}");
    }
}
