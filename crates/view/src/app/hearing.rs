//! What the simulation's thread says and shows.

use std::sync::Arc;
use std::time::Instant;

use super::App;
use crate::engine::Event;

impl App {
    /// What the simulation's thread has sent.
    pub(super) fn hear(&mut self) {
        for event in self.engine.hear() {
            match event {
                Event::Busy(text) => {
                    self.messages.failure = None;
                    self.messages.expect = None;
                    self.messages.busy = Some(text);
                }
                Event::Making(doing) => self.hear_making(doing),
                Event::Made(file, made) => self.take_made(&file, made),
                Event::Expect(text) => {
                    self.messages.busy = None;
                    self.messages.expect = Some(text);
                }
                Event::Ready(setup) => {
                    self.messages.busy = None;
                    self.messages.failure = None;
                    let late = self.hands.clear();
                    self.send(late);
                    self.curves.clear();
                    self.forces.clear();
                    if let Err(error) = self.viewport.enter(&setup) {
                        self.messages.warn(error);
                    }
                    // A reset has nothing new to say.
                    if self.setup.as_ref().is_none_or(|old| !Arc::ptr_eq(old, &setup)) {
                        self.tell_notes(&setup);
                    }
                    self.setup = Some(setup);
                }
                Event::Accompanied(setup) => {
                    self.messages.busy = None;
                    if let Err(error) = self.viewport.enter(&setup) {
                        self.messages.warn(error);
                    }
                    self.setup = Some(setup);
                }
                Event::Changed => self.messages.busy = None,
                Event::Devices(devices) => self.devices = devices,
                Event::Refused(text) => self.messages.warn(text),
                Event::Done { path, text, time } => self.write_scene(&path, &text, time),
                Event::Kept { run, key, value } => self.session.keep(run, &key, &value),
                Event::Recorded(path, frames, why) => self.run_was_recorded(&path, frames, why),
                Event::NotTaken(hand, text) => {
                    self.hands.instruments.forget(hand);
                    self.messages.warn(text);
                }
                Event::Alone(text) => {
                    self.messages.busy = None;
                    self.messages.warn(text);
                    self.session.stay_alone();
                }
                Event::Curves(curves) => self.curves = curves,
                Event::Failed(failure) => {
                    self.messages.busy = None;
                    self.clock.playing = false;
                    self.messages.failure = Some(failure);
                }
            }
        }
    }

    pub(super) fn take_snapshot(&mut self) {
        if !self.engine.newest(&mut self.snapshot) {
            return;
        }
        let Some(snapshot) = &self.snapshot else { return };
        if let Err(error) = self.viewport.place(snapshot) {
            self.messages.warn(error);
        }
        self.forces.note(snapshot);
        let (number, since) = self.counted;
        let elapsed = since.elapsed().as_secs_f64();
        if snapshot.number < number {
            self.counted = (snapshot.number, Instant::now());
            self.shown = 0;
        } else if elapsed > 0.5 {
            self.clock.rate = (snapshot.number - number) as f64 / elapsed;
            self.clock.drawn = f64::from(std::mem::take(&mut self.shown)) / elapsed;
            self.counted = (snapshot.number, Instant::now());
        }
    }
}
