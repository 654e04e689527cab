//! Opening: scenes, files of which scenes are made, and what is dropped onto the window.

use eframe::egui::{
    self, Align2, Color32, CornerRadius, Id, LayerId, Order, Rect, RichText, Stroke,
};
use std::path::{Path, PathBuf};
use viscera_import::{folder_of, is_foreign};
use viscera_resources::{BuiltInScene, files};
use viscera_stage::Coloring;

use super::{App, FIRST_SCENE, Options};
use crate::choices::{Settings, Side};
use crate::document::Document;
use crate::engine::{Command, MadeScene, Setup};
use crate::messages::Messages;
use crate::session::Session;

/// A file of which a scene is being made, and what its simulations are to have.
pub(super) struct Making {
    file: PathBuf,
    settings: Settings,
    beside: Settings,
}

/// What the command line asks for; where that is a mesh or a scan, or cannot be read, the first scene is open meanwhile.
pub(super) fn first_session(
    options: &Options,
    messages: &mut Messages,
) -> anyhow::Result<(Session, Option<Making>)> {
    let data = options.data.as_deref();
    let first = || {
        let first = Document::open(Path::new(FIRST_SCENE), data)?;
        Session::new(first, Settings::new()).map_err(anyhow::Error::msg)
    };
    let (settings, beside) = (options.settings.clone(), options.beside.clone());
    if is_foreign(&options.scene) {
        let file = options.scene.clone();
        return Ok((first()?, Some(Making { file, settings, beside })));
    }
    let opened = Document::open(&options.scene, data)
        .map_err(|error| format!("{error:#}"))
        .and_then(|document| Session::new(document, settings)?.beside(&beside));
    let session = opened.or_else(|error| {
        messages.warn(error);
        first()
    });
    Ok((session?, None))
}

impl App {
    /// Opens what the command line asks for.
    pub(super) fn begin(&mut self) {
        match &self.making {
            Some(making) => self.make(making.file.clone()),
            None => self.begin_first(),
        }
    }

    fn begin_first(&mut self) {
        self.settle_in();
        let load = self.session.load();
        self.send([load]);
    }

    /// A document is open: its name, its colours.
    fn settle_in(&mut self) {
        self.name_save();
        self.suit_colors();
        let path = &self.session.document().path;
        // A built-in scene is in a menu of its own.
        if let (None, Ok(path)) = (BuiltInScene::find(path), std::path::absolute(path)) {
            self.preferences.remember(path);
        }
    }

    fn make(&mut self, file: PathBuf) {
        self.messages.making = Some(format!("reading {}", file.display()));
        let folder = self.scenes.join(folder_of(&file));
        self.engine.send(Command::Make(file, folder));
    }

    /// Opens a scene, or makes the scene of a mesh, a surface or a scan and opens that.
    pub(super) fn open(&mut self, path: &Path) {
        if is_foreign(path) {
            let file = path.to_owned();
            let (settings, beside) = (Settings::new(), Settings::new());
            self.making = Some(Making { file: file.clone(), settings, beside });
            return self.make(file);
        }
        self.stop_waiting();
        if let Err(error) = self.open_scene(path, Settings::new(), &Settings::new()) {
            self.messages.warn(error);
        }
    }

    /// Nothing that is being made is opened any more.
    fn stop_waiting(&mut self) -> Option<Making> {
        self.messages.making = None;
        self.making.take()
    }

    fn open_scene(
        &mut self,
        path: &Path,
        settings: Settings,
        beside: &Settings,
    ) -> Result<(), String> {
        let data = self.session.document().data.clone();
        let document =
            Document::open(path, data.as_deref()).map_err(|error| format!("{error:#}"))?;
        let command = self.session.open(document, settings, beside)?;
        self.send([command]);
        self.made = None;
        self.play(true);
        self.settle_in();
        Ok(())
    }

    /// What the thread is doing to make a scene.
    pub(super) fn hear_making(&mut self, doing: String) {
        if self.making.is_some() {
            self.messages.making = Some(doing);
        }
    }

    /// A scene was made, or could not be. Where something else was opened meanwhile, that stays.
    pub(super) fn take_made(&mut self, file: &Path, made: Result<MadeScene, String>) {
        let is_wanted = self.making.as_ref().is_some_and(|making| making.file == file);
        let making = if is_wanted { self.stop_waiting() } else { None };
        let opened = match (made, making) {
            (Ok(made), Some(Making { settings, beside, .. })) => {
                // As `viscera run` does.
                if let Err(error) = files::print(&made.text) {
                    self.messages.warn(format!("{error:#}"));
                }
                let opened = self.open_scene(&made.scene, settings, &beside);
                self.made = Some(made).filter(|_| opened.is_ok());
                opened
            }
            (Ok(made), None) => {
                self.messages.tell(format!("made {}, and left it closed", made.scene.display()));
                Ok(())
            }
            (Err(error), _) => Err(error),
        };
        let Err(error) = opened else { return };
        self.messages.warn(error);
        if is_wanted && self.setup.is_none() {
            self.begin_first();
        }
    }

    /// Says what a person should know of simulations that are there now: of how their scene was made, and of its bodies.
    pub(super) fn tell_notes(&mut self, setup: &Setup) {
        if let Some(made) = &self.made {
            self.messages.tell_all(&made.title(), &made.notes);
            made.warnings.iter().for_each(|warning| self.messages.warn(warning));
        }
        self.messages.tell_all("", &setup.assembly.notes);
    }

    /// All that there is to know of them.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some(made) = &self.made {
            let parts = [&made.warnings, &made.notes, &made.of_bodies];
            notes.extend(parts.into_iter().flatten().map(|note| note.trim().to_owned()));
        }
        if let Some(setup) = &self.setup {
            notes.extend(setup.assembly.notes.iter().cloned());
        }
        notes
    }

    /// The tissue's own look is that of its bodies where there are several. What shows values stays.
    fn suit_colors(&mut self) {
        let several = self.session.scene(Side::First).bodies.len() > 1;
        let suited = match self.preferences.coloring {
            Coloring::Plain | Coloring::Bodies if several => Coloring::Bodies,
            Coloring::Plain | Coloring::Bodies => Coloring::Plain,
            values => values,
        };
        self.preferences.coloring = suited;
        self.engine.send(Command::Color(suited));
    }

    /// Opens what is dropped onto the window; shows that it would where files are over it.
    pub(super) fn take_dropped(&mut self, context: &egui::Context) {
        let (dropped, hovering) = context.input(|input| {
            let dropped = input.raw.dropped_files.iter().map(|file| file.path().to_owned());
            let hovering = input.raw.hovered_files.iter().map(|file| file.path.clone());
            (dropped.collect::<Vec<_>>(), hovering.collect::<Vec<_>>())
        });
        if let Some(file) = chosen(&dropped) {
            if dropped.len() > 1 {
                let (count, shown) = (dropped.len(), file.display());
                self.messages.tell(format!("of {count} files {shown} is opened"));
            }
            self.open(file);
        } else if !hovering.is_empty() {
            let known: Vec<PathBuf> = hovering.iter().flatten().cloned().collect();
            show_hovering(context, chosen(&known), hovering.len());
        }
    }
}

/// The one that is opened of files that are dropped together: a scene with its meshes, or a mesh of two files.
fn chosen(files: &[PathBuf]) -> Option<&PathBuf> {
    let is_scene =
        |file: &&PathBuf| file.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let scene = files.iter().find(is_scene);
    scene.or_else(|| files.iter().find(|file| is_foreign(file))).or(files.first())
}

/// An outline around the window, and what would be opened.
fn show_hovering(context: &egui::Context, file: Option<&PathBuf>, count: usize) {
    let area: Rect = context.content_rect();
    let painter = context.layer_painter(LayerId::new(Order::Foreground, Id::unique("dropping")));
    painter.rect_filled(area, CornerRadius::ZERO, Color32::from_black_alpha(90));
    let line = Stroke::new(3.0, Color32::from_rgb(120, 180, 255));
    painter.rect_stroke(area.shrink(8.0), CornerRadius::same(8), line, egui::StrokeKind::Inside);
    let name = file.and_then(|file| file.file_name()).map(|name| name.to_string_lossy());
    let text = match (name, count) {
        (Some(name), 1) => format!("Drop to open {name}"),
        (Some(name), _) => format!("Drop to open {name}, one of {count} files"),
        (None, _) => "Drop to open".to_owned(),
    };
    egui::Area::new(Id::unique("dropping"))
        .order(Order::Tooltip)
        .pivot(Align2::CENTER_CENTER)
        .fixed_pos(area.center())
        .show(context, |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.label(RichText::new(text).size(18.0));
                ui.weak("a scene (.toml), a mesh, a surface or a segmented scan");
            });
        });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_files_dropped_together_the_scene_is_opened() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let all = paths(&["liver.vtu", "skin.ply", "liver.TOML"]);
        assert_eq!(chosen(&all), Some(&all[2]));
        let folder = tempfile::tempdir().expect("a folder");
        let mesh = folder.path().join("a.ele");
        std::fs::write(&mesh, "").expect("a file");
        assert_eq!(chosen(&[folder.path().join("notes.txt"), mesh.clone()]), Some(&mesh));
        assert_eq!((chosen(&all[..2]), chosen(&[])), (Some(&all[0]), None));
    }
}
