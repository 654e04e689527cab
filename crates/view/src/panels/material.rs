//! What bodies are made of.

use eframe::egui::{self, Ui};
use viscera::material::{LARGEST_POISSON, PRESET_CAUTION, PRESETS, Preset};
use viscera::scene::{Body, Scene};

use super::choice::{Chooser, Row, named};
use super::{Action, section};
use crate::choices::{Side, law_name};

/// Sliders of every body.
pub fn show(ui: &mut Ui, scene: &Scene, actions: &mut Vec<Action>) {
    let mut chooser = Chooser { side: Side::First, actions };
    for body in &scene.bodies {
        let title = match scene.bodies.len() {
            1 => "Material".to_owned(),
            _ => format!("Material of {}", body.name),
        };
        section(ui, &title, true, |ui| show_body(ui, body, &mut chooser));
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
            .unit(" kPa")
            .logarithmic()
            .decimals(3);
        chooser.slider(ui, &row, material.young() / 1e3, 0.5..=200.0, |value| {
            format!("{} kPa", digits(value))
        });
        let poisson = key("poisson");
        let help = "0.5 would keep its volume exactly; tissue is at 0.45 to 0.49. The nearer to 0.5, \
                    the more iterations a step needs.";
        let row = Row::new(&poisson, "Poisson's ratio", help).decimals(3);
        chooser.slider(ui, &row, material.poisson(), 0.0..=LARGEST_POISSON, digits);
        let density = key("density");
        let row = Row::new(&density, "density", "Mass per volume.").unit(" kg/m³").decimals(0);
        chooser.slider(ui, &row, material.density(), 500.0..=2000.0, |value| {
            format!("{} kg/m^3", digits(value))
        });
        let viscosity = key("viscosity");
        let help = "Kelvin-Voigt retardation time: viscous stress is this times stiffness times strain \
                    rate. More makes tissue settle sooner.";
        let row = Row::new(&viscosity, "viscosity", help).unit(" ms").decimals(1);
        chooser.slider(ui, &row, 1e3 * material.viscosity(), 0.0..=100.0, |value| {
            format!("{} ms", digits(value))
        });
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
    let shown = PRESETS.iter().find(is).map_or("own numbers", |preset| preset.name);
    named(ui, "tissue", PRESET_CAUTION, |ui| {
        let menu = egui::ComboBox::from_id_salt("preset").selected_text(shown).show_ui(ui, |ui| {
            for preset in PRESETS {
                let label = ui.selectable_label(is(&preset), preset.name);
                if label.on_hover_text(preset.description()).clicked() {
                    choose(body, preset, chooser);
                }
            }
        });
        menu.response
    });
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

/// A number of a slider, without the digits that nobody chose.
fn digits(value: f64) -> String {
    viscera::units::format_number(value)
}
