//! Files that the window reads and writes: scenes, pictures, recordings.

use anyhow::bail;
use eframe::egui;
use std::path::Path;
use std::time::{Duration, Instant};

use super::App;
use crate::capture::{Recorder, free_name, save_picture};
use crate::choices::{Settings, Side, put};
use crate::document::Document;
use crate::engine::{Command, Event};
use crate::save::save;

/// How long a window that has to close waits for what is to be saved.
const PATIENCE: Duration = Duration::from_secs(5);

impl App {
    /// Proposes a name to save under: never that of the file that is open.
    pub(super) fn name_save(&mut self) {
        let document = self.session.document();
        let name = format!("{}_changed.toml", document.stem());
        let path = document.path.with_file_name(name);
        self.fields.save = path.display().to_string();
    }

    /// Saves the scene: as it is set now, or as it began with what was done by hand since, which the
    /// simulation's thread knows.
    pub(super) fn save_as(&mut self, path: &Path) {
        match self.preferences.save_by_hand {
            true => self.ask_to_save(path),
            false => {
                let settings = self.session.choices().of(Side::First);
                let document = self.session.document().clone();
                self.write(&document, path, &settings, "");
            }
        }
    }

    /// Asks the simulation's thread for what was done by hand. Until it answers, another scene may be open, or
    /// this one may have begun anew: what is saved is what was there.
    fn ask_to_save(&mut self, path: &Path) {
        let begun = self.session.begun().of(Side::First);
        self.saving.push((path.to_owned(), self.session.document().clone(), begun));
        self.engine.send(Command::Save(path.to_owned()));
    }

    /// Saves the scene as it began, with what was done by hand up to a time [s].
    pub(super) fn write_scene(&mut self, path: &Path, by_hand: &str, time: f64) {
        let asked = self.saving.iter().position(|(asked, ..)| asked == path);
        let Some((_, document, mut settings)) = asked.map(|number| self.saving.remove(number))
        else {
            return;
        };
        if time > 0.0 {
            put(&mut settings, "time.duration", &format!("{time} s"));
        }
        self.write(&document, path, &settings, by_hand);
    }

    fn write(&mut self, document: &Document, path: &Path, settings: &Settings, by_hand: &str) {
        let is_comparison = self.session.is_comparison();
        match save(document, settings, by_hand, path) {
            Ok(()) => {
                let of = if is_comparison { " (of A)" } else { "" };
                let shown = path.display();
                self.messages.tell(format!("saved{of}; run it with: viscera run {shown}"));
            }
            Err(error) => self.messages.warn(format!("{error:#}")),
        }
    }

    pub(super) fn take_picture(&mut self) {
        let path = free_name(&self.pictures, &self.session.document().stem(), "png");
        let Some(snapshot) = &self.snapshot else {
            return self.messages.warn("nothing is shown yet");
        };
        let saved = self.viewport.images(snapshot).map_err(anyhow::Error::msg);
        match saved.and_then(|images| save_picture(&images, &path)) {
            Ok(()) => self.messages.tell(format!("saved {}", path.display())),
            Err(error) => self.messages.warn(format!("{error:#}")),
        }
    }

    pub(super) fn toggle_recording(&mut self) {
        if let Some(recorder) = self.recorder.take() {
            match recorder.finish() {
                Ok(summary) => self.messages.tell(format!("saved {summary}")),
                Err(error) => self.messages.warn(format!("{error:#}")),
            }
            return;
        }
        let path = free_name(&self.pictures, &self.session.document().stem(), "gif");
        let frame = self.session.scene(Side::First).time.frame;
        match Recorder::start(path, frame) {
            Ok(recorder) => self.recorder = Some(recorder),
            Err(error) => self.messages.warn(format!("{error:#}")),
        }
    }

    /// Begins or ends a recording of the run, with all that hands do.
    pub(super) fn toggle_run_recording(&mut self) {
        if self.recorded_run.take().is_some() {
            return self.engine.send(Command::EndRecord);
        }
        let document = self.session.document();
        let path = free_name(&self.pictures, &document.stem(), "viscera");
        self.engine.send(Command::Record(path.clone(), document.mesh_files()));
        self.recorded_run = Some(path);
    }

    /// Such a recording has ended.
    pub(super) fn run_was_recorded(&mut self, path: &Path, frames: u64, why: Option<String>) {
        if self.recorded_run.as_deref() == Some(path) {
            self.recorded_run = None;
        }
        let shown = path.display();
        let seconds = frames as f64 * self.session.scene(Side::First).time.frame;
        let saved =
            format!("saved {shown}, {seconds:.2} s; see it again with: viscera replay {shown}");
        match why {
            None => self.messages.tell(saved),
            Some(why) if frames > 0 => {
                self.messages.warn(format!("the recording has ended: {why}; {saved}"))
            }
            Some(why) => self.messages.warn(format!("nothing was recorded: {why}")),
        }
    }

    /// Adds what is shown to the recording, where one is going on and a picture is due.
    pub(super) fn record(&mut self) {
        let (Some(recorder), Some(snapshot)) = (&mut self.recorder, &self.snapshot) else { return };
        if !recorder.is_due(snapshot.time) {
            return;
        }
        let images = self.viewport.images(snapshot).map_err(anyhow::Error::msg);
        if let Err(error) = images.and_then(|images| recorder.push(&images, snapshot.time)) {
            self.messages.warn(format!("{error:#}"));
            self.recorder = None;
        }
    }

    /// Without the window's device nothing can be drawn: saves what there is, and closes. True where that has
    /// happened.
    pub(super) fn say_farewell(&mut self, context: &egui::Context) -> bool {
        if self.farewell.get().is_some() {
            return true;
        }
        let Some(lost) = self.viewport.lost() else { return false };
        self.close();
        let stem = self.session.document().stem();
        let path = free_name(&self.pictures, &format!("{stem}-recovered"), "toml");
        let kept = match self.rescue(&path) {
            Ok(()) => format!("what was done is in {}", path.display()),
            Err(error) => format!("what was done could not be saved: {error:#}"),
        };
        // Nobody else sets it.
        let _ = self.farewell.set(format!("{lost}; {kept}"));
        context.send_viewport_cmd(egui::ViewportCommand::Close);
        true
    }

    /// Saves what was done by hand; waits for the simulation's thread, which is not in a hurry.
    fn rescue(&mut self, path: &Path) -> anyhow::Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        self.ask_to_save(path);
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            for event in self.engine.hear() {
                if let Event::Done { path: saved, text, time } = event {
                    self.write_scene(&saved, &text, time);
                }
            }
            if path.exists() {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        bail!("the simulation did not answer")
    }

    /// Ends what would otherwise be lost.
    pub fn close(&mut self) {
        if self.recorder.is_some() {
            self.toggle_recording();
        }
        if self.recorded_run.is_some() {
            self.toggle_run_recording();
        }
    }
}
