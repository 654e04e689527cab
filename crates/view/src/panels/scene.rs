//! What is open, another scene, and saving.

use eframe::egui::{self, Ui};
use std::path::PathBuf;
use viscera_resources::BUILT_IN;

use super::choice::{Chooser, Row};
use super::{Action, section};
use crate::choices::Side;
use crate::engine::Setup;
use crate::preferences::Preferences;
use crate::session::Session;

/// What is being written into text fields.
#[derive(Debug, Default)]
pub struct Fields {
    /// Of another scene.
    pub open: String,
    /// Where to save.
    pub save: String,
}

/// The scene's title, its numbers with notes on them, and text fields for files.
pub fn show(
    ui: &mut Ui,
    session: &Session,
    numbers: Option<(&Setup, &str)>,
    fields: &mut Fields,
    preferences: &mut Preferences,
    actions: &mut Vec<Action>,
) {
    section(ui, "Scene", true, |ui| {
        let scene = session.scene(Side::First);
        // A scene without a title has its file's name, folders and all.
        let title = match scene.title == scene.name {
            true => session.document().stem(),
            false => scene.title.clone(),
        };
        let title = ui.label(egui::RichText::new(title).size(15.0));
        if !scene.description.is_empty() {
            title.on_hover_text(scene.description.trim());
        }
        if let Some((setup, notes)) = numbers {
            let vertices = setup.assembly.builder.positions().len();
            let text = format!("{} tetrahedra, {vertices} vertices", setup.tet_count());
            ui.weak(text).on_hover_text(notes);
        }
        gravity(ui, session, actions);
        ui.horizontal_wrapped(|ui| {
            let label = ui.label("open");
            let field = egui::TextEdit::singleline(&mut fields.open)
                .hint_text("a scene, a mesh, a scan")
                .desired_width(150.0);
            let field = ui.add(field).labelled_by(label.id);
            let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
            let button = ui.button("Open").on_hover_text("Reads the scene, or makes one of a mesh, a surface or a segmented scan, and begins from rest; files can be \
                 dropped onto the window, too");
            if (entered || button.clicked()) && !fields.open.trim().is_empty() {
                actions.push(Action::Open(PathBuf::from(fields.open.trim())));
            }
            ui.menu_button("built-in", |ui| {
                for scene in &BUILT_IN {
                    if ui.button(scene.name).clicked() {
                        actions.push(Action::Open(PathBuf::from(scene.name)));
                        ui.close();
                    }
                }
            });
            recent(ui, preferences, actions);
        });
        ui.horizontal(|ui| {
            let label = ui.label("save");
            let field = egui::TextEdit::singleline(&mut fields.save).desired_width(150.0);
            ui.add(field).labelled_by(label.id).on_hover_text(
                "The file gets what was chosen here and keeps what was written; `viscera run` takes it",
            );
            if ui.button("Save").on_hover_text("Ctrl+S").clicked() {
                actions.push(Action::SaveAs(PathBuf::from(fields.save.trim())));
            }
        });
        ui.checkbox(&mut preferences.save_by_hand, "with what was done by hand").on_hover_text(
            "The saved scene repeats everything since the last reset, pulls and changes at their times, to the \
             bit. Without this it begins with the settings as they are now.",
        );
    });
}

/// A menu of files that were open before, the newest first.
fn recent(ui: &mut Ui, preferences: &Preferences, actions: &mut Vec<Action>) {
    ui.add_enabled_ui(!preferences.recent.is_empty(), |ui| {
        ui.menu_button("recent", |ui| {
            for path in &preferences.recent {
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                let button = ui.button(name).on_hover_text(path.display().to_string());
                if button.clicked() {
                    actions.push(Action::Open(path.clone()));
                    ui.close();
                }
            }
        });
    });
}

fn gravity(ui: &mut Ui, session: &Session, actions: &mut Vec<Action>) {
    let gravity = session.scene(Side::First).world.gravity;
    // A scene may let it pull sideways; the number is for what is usual.
    if gravity.x == 0.0 && gravity.y == 0.0 && gravity.z <= 0.0 {
        let help = "Acceleration downwards, along -z.";
        let row = Row::new("world.gravity", "gravity", help).unit("m/s^2").rail(0.0..=20.0);
        let mut chooser = Chooser { side: Side::First, actions };
        chooser.number(ui, &row, 0.0 - gravity.z);
    }
}
