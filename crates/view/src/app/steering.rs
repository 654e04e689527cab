//! Instruments that keys and a controller lead.

use eframe::egui::{self, Key};
use std::time::{Duration, Instant};

use super::App;
use crate::controller::News;
use crate::engine::Command;
use crate::help::Request;
use crate::panels::Action;
use crate::steering::steer;
use viscera_stage::{HandId, Nudge, ToolAct};

/// How often a controller is asked where nothing else moves.
const ASKED_EVERY: Duration = Duration::from_millis(20);

/// A controller that was not asked for longer than this does not make up for it [s].
const LONGEST: f64 = 0.1;

impl App {
    /// Leads instruments by the keys that are down and by the controller.
    pub(super) fn steer(&mut self, context: &egui::Context) {
        self.steer_by_keys(context);
        let news = self.controller.news();
        self.hear_controller(&news);
        let time = self.controlled.elapsed().as_secs_f64().min(LONGEST);
        self.controlled = Instant::now();
        let extent = self.viewport.surroundings().extent;
        if let Some(nudge) = self.controller.nudge(time, extent) {
            let instruments = &self.hands.instruments;
            let led = instruments.other().or(instruments.active()).map(|held| held.id);
            self.nudge(led, &nudge);
        }
        if self.controller.name().is_some() {
            context.request_repaint_after(ASKED_EVERY);
        }
    }

    fn steer_by_keys(&mut self, context: &egui::Context) {
        let is_typing = self.was_typing || context.text_edit_focused();
        let instruments = &self.hands.instruments;
        if is_typing || instruments.list().is_empty() {
            return;
        }
        // Tab and arrows would otherwise go from one control to the next.
        if context.memory(|memory| memory.focused()).is_none() {
            context.memory_mut(|memory| memory.move_focus(egui::FocusDirection::None));
        }
        let hands =
            [instruments.active(), instruments.other()].map(|held| held.map(|held| held.id));
        let extent = self.viewport.surroundings().extent;
        let nudges = context.input(|input| steer(input, extent));
        for (hand, nudge) in hands.into_iter().zip(nudges) {
            if let Some(nudge) = nudge {
                self.nudge(hand, &nudge);
                // A key that stays down is no event.
                context.request_repaint();
            }
        }
        // Until its frame a key would be heard as a step of a slider, or of the view.
        for key in [Key::ArrowUp, Key::ArrowDown, Key::PageUp, Key::PageDown] {
            context.input_mut(|input| input.count_and_consume_key(egui::Modifiers::NONE, key));
        }
    }

    fn nudge(&mut self, hand: Option<HandId>, nudge: &Nudge) {
        let Some(hand) = hand else { return };
        let around = self.viewport.surroundings();
        match self.hands.instruments.nudge(hand, nudge, &around) {
            Ok(acts) => self.send(acts.into_iter().map(Command::Tool)),
            Err(told) => self.messages.warn(told),
        }
    }

    /// Takes over what has happened on a controller.
    pub fn hear_controller(&mut self, news: &[News]) {
        for news in news {
            match news {
                News::Connected(name) => {
                    self.messages.tell(format!("{name} is there; it leads instruments"));
                }
                News::Unplugged => {
                    let name = self.controller.name().unwrap_or("the controller").to_owned();
                    self.messages.warn(format!(
                        "{name} was unplugged: what it led stands still; plug it in again, or use pointer and keys"
                    ));
                }
                News::Lock => {
                    let instruments = &self.hands.instruments;
                    let led = instruments.other().or(instruments.active()).map(|held| held.id);
                    let command = led.and_then(|hand| self.hands.instruments.lock(hand));
                    self.send(command.map(Command::Tool));
                }
                News::Next => self.hands.instruments.next(),
                News::Sticks(_) => {}
            }
            self.controller.hear(news);
        }
    }

    /// Does what a panel asks of instruments.
    pub(super) fn act_on_instruments(&mut self, action: &Action) {
        let instruments = &mut self.hands.instruments;
        let command = match *action {
            Action::Activate(hand) => {
                instruments.activate(hand);
                None
            }
            Action::OpenJaws(hand, angle) => instruments.open(hand, angle),
            Action::Lock(hand) => instruments.lock(hand),
            Action::PutAway(hand) => instruments.put_away(hand),
            _ => None,
        };
        self.send(command.map(Command::Tool));
    }

    /// Does what a key or a button asks of instruments.
    pub(super) fn ask_instruments(&mut self, request: Request) {
        let instruments = &mut self.hands.instruments;
        let [active, other] =
            [instruments.active(), instruments.other()].map(|held| held.map(|held| held.id));
        let command: Option<ToolAct> = match request {
            Request::TakeInstrument(number) => {
                let around = self.viewport.surroundings();
                self.tray.get(number).map(|instrument| instruments.take(instrument, &around))
            }
            Request::NextInstrument => {
                instruments.next();
                None
            }
            Request::LockJaws => active.and_then(|hand| instruments.lock(hand)),
            Request::LockOtherJaws => other.and_then(|hand| instruments.lock(hand)),
            Request::PutAway => active.and_then(|hand| instruments.put_away(hand)),
            _ => None,
        };
        self.send(command.map(Command::Tool));
    }
}
