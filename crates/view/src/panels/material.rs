//! What bodies are made of.

use eframe::egui::{self, Ui};
use viscera::material::{LARGEST_POISSON, PRESET_CAUTION, PRESETS, Preset};
use viscera::scene::{Body, Scene};

use super::choice::{Chooser, Row};
use super::number::named;
use super::{Action, section};
use crate::choices::{Side, law_name};

/// Ends of the rail of Young's modulus [kPa]: presets lie between them, with room beside them. Only cartilage lies
/// beyond: a rail that reached it would be coarser for every organ, and what lies beyond is kept.
const SOFTEST: f64 = 0.1;
const STIFFEST: f64 = 1000.0;

/// Of more bodies than these all are folded away.
const MOST_OPEN: usize = 4;

/// Numbers of every body.
pub fn show(ui: &mut Ui, scene: &Scene, actions: &mut Vec<Action>) {
    let mut chooser = Chooser { side: Side::First, actions };
    // Of many bodies one looks for a few, and for what lies below them.
    let is_short = scene.bodies.len() <= MOST_OPEN;
    for body in &scene.bodies {
        let title = match scene.bodies.len() {
            1 => "Material".to_owned(),
            _ => format!("Material of {}", body.name.replace('_', " ")),
        };
        section(ui, &title, is_short, |ui| show_body(ui, body, &mut chooser));
    }
}

fn show_body(ui: &mut Ui, body: &Body, chooser: &mut Chooser<'_>) {
    let key = |name: &str| format!("body.{}.material.{name}", body.name);
    let material = &body.material;
    ui.push_id(&body.name, |ui| {
        presets(ui, body, chooser);
        let laws = [
            ("stable_neo_hookean", "stable neo-Hookean"),
            ("saint_venant_kirchhoff", "Saint Venant-Kirchhoff"),
        ];
        let help = "The law between strain and energy. Stable neo-Hookean tissue withstands \
                    compression and inversion.";
        chooser.menu(ui, &Row::new(&key("model"), "law", help), law_name(material), &laws);
        let young = key("young");
        let row = Row::new(&young, "stiffness E", "Young's modulus at small strain.")
            .unit("kPa")
            .rail(SOFTEST..=STIFFEST)
            .logarithmic()
            .decimals(3);
        chooser.number(ui, &row, material.young() / 1e3);
        let poisson = key("poisson");
        let help = "0.5 would keep its volume exactly; tissue is at 0.45 to 0.49. The nearer to 0.5, \
                    the more iterations a step needs.";
        let row =
            Row::new(&poisson, "Poisson's ratio", help).rail(0.0..=LARGEST_POISSON).decimals(3);
        chooser.number(ui, &row, material.poisson());
        let density = key("density");
        let row = Row::new(&density, "density", "Mass per volume.")
            .unit("kg/m^3")
            .rail(500.0..=2000.0)
            .decimals(0);
        chooser.number(ui, &row, material.density());
        let viscosity = key("viscosity");
        let help = "Kelvin-Voigt retardation time: viscous stress is this times stiffness times strain \
                    rate. More makes tissue settle sooner.";
        let row =
            Row::new(&viscosity, "viscosity", help).unit("ms").rail(0.0..=100.0).decimals(1);
        chooser.number(ui, &row, 1e3 * material.viscosity());
    });
}

/// A menu of tissues, each with its numbers and where they come from.
fn presets(ui: &mut Ui, body: &Body, chooser: &mut Chooser<'_>) {
    let material = &body.material;
    let is = |preset: &&Preset| {
        preset.young == material.young()
            && preset.poisson == material.poisson()
            && preset.density == material.density()
    };
    let shown = PRESETS.iter().find(is).map_or("own numbers".to_owned(), in_words);
    named(ui, "tissue", PRESET_CAUTION, |ui, label| {
        let menu = egui::ComboBox::from_id_salt("preset").selected_text(shown);
        let menu = menu.show_ui(ui, |ui| {
            for preset in PRESETS {
                let label = ui.selectable_label(is(&preset), in_words(preset));
                if label.on_hover_text(preset.description()).clicked() {
                    choose(body, preset, chooser);
                }
            }
        });
        (menu.response.labelled_by(label), ())
    });
}

/// The name of a preset without its underscores.
fn in_words(preset: &Preset) -> String {
    preset.name.replace('_', " ")
}

/// A preset with its numbers, which may stand in the scene as well and would win over the preset's.
fn choose(body: &Body, preset: &Preset, chooser: &mut Chooser<'_>) {
    let key = |name: &str| format!("body.{}.material.{name}", body.name);
    let pairs = [
        (key("preset"), preset.name.to_owned()),
        (key("young"), format!("{} kPa", digits(preset.young / 1e3))),
        (key("poisson"), digits(preset.poisson)),
        (key("density"), format!("{} kg/m^3", digits(preset.density))),
    ];
    let pairs = pairs.each_ref().map(|(key, value)| (key.as_str(), value.as_str()));
    chooser.all(&pairs);
}

/// A number without the digits that nobody chose.
fn digits(value: f64) -> String {
    viscera::units::format_number(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rail_reaches_every_preset_but_cartilage() {
        for preset in PRESETS {
            let young = preset.young / 1e3;
            let is_cartilage = ["trachea", "costal_cartilage"].contains(&preset.name);
            assert!(young > SOFTEST, "{}: {young} kPa", preset.name);
            assert_eq!(young >= STIFFEST, is_cartilage, "{}: {young} kPa", preset.name);
        }
    }
}
