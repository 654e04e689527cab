//! Rows of settings: a name, a slider or a menu, and what it means when one points at it.

use eframe::egui::{self, Response, Slider, Ui};
use std::ops::RangeInclusive;

use super::Action;
use crate::choices::{Settings, Side};

/// Where rows put what is chosen.
pub struct Chooser<'a> {
    /// Whose settings.
    pub side: Side,
    /// Where they go.
    pub actions: &'a mut Vec<Action>,
}

impl Chooser<'_> {
    /// Chooses several settings at once.
    pub fn all(&mut self, pairs: &[(&str, &str)]) {
        let settings: Settings =
            pairs.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        self.actions.push(Action::Choose(self.side, settings, false));
    }

    fn one(&mut self, key: &str, value: String, gesture: bool) {
        let settings = vec![(key.to_owned(), value)];
        self.actions.push(Action::Choose(self.side, settings, gesture));
    }

    /// A slider; `text` writes the value as a scene file has it.
    pub fn slider(
        &mut self,
        ui: &mut Ui,
        row: &Row<'_>,
        value: f64,
        range: RangeInclusive<f64>,
        text: impl Fn(f64) -> String,
    ) {
        let mut shown = value;
        let mut slider = Slider::new(&mut shown, range)
            .logarithmic(row.logarithmic)
            .suffix(row.suffix)
            // What the scene has may lie beyond the slider, and is shown as it is.
            .clamping(egui::SliderClamping::Edits)
            .smart_aim(true);
        if row.whole {
            slider = slider.integer();
        } else {
            slider = slider.max_decimals(row.decimals);
        }
        let response = labelled(ui, row, |ui| ui.add(slider));
        if response.changed() && shown != value {
            self.one(row.key, text(shown), response.dragged());
        }
    }

    /// A box to tick.
    pub fn tick(&mut self, ui: &mut Ui, key: &str, name: &str, help: &str, value: bool) {
        let mut shown = value;
        if ui.checkbox(&mut shown, name).on_hover_text(help).changed() {
            self.one(key, shown.to_string(), false);
        }
    }

    /// A menu of names: each as a scene file has it, and in words.
    pub fn menu(&mut self, ui: &mut Ui, row: &Row<'_>, value: &str, names: &[(&str, &str)]) {
        let shown = names.iter().find(|(name, _)| *name == value).map_or(value, |(_, words)| words);
        let mut chosen = None;
        labelled(ui, row, |ui| {
            egui::ComboBox::from_id_salt(row.key)
                .selected_text(shown)
                .width(ui.spacing().slider_width + 40.0)
                .show_ui(ui, |ui| {
                    for (name, words) in names {
                        if ui.selectable_label(*name == value, *words).clicked() {
                            chosen = Some(*name);
                        }
                    }
                })
                .response
        });
        if let Some(name) = chosen
            && name != value
        {
            self.one(row.key, name.to_owned(), false);
        }
    }
}

/// How a row looks.
pub struct Row<'a> {
    /// The key in a scene file.
    pub key: &'a str,
    /// In words.
    pub name: &'a str,
    /// What it means.
    pub help: &'a str,
    /// Behind the number: " kPa".
    pub suffix: &'a str,
    /// Equal steps are equal factors.
    pub logarithmic: bool,
    /// A count.
    pub whole: bool,
    /// Digits behind the point, at most.
    pub decimals: usize,
}

impl<'a> Row<'a> {
    /// A plain one.
    pub fn new(key: &'a str, name: &'a str, help: &'a str) -> Self {
        Self { key, name, help, suffix: "", logarithmic: false, whole: false, decimals: 2 }
    }

    /// With a unit.
    pub fn unit(self, suffix: &'a str) -> Self {
        Self { suffix, ..self }
    }

    /// Over factors.
    pub fn logarithmic(self) -> Self {
        Self { logarithmic: true, ..self }
    }

    /// In whole numbers.
    pub fn whole(self) -> Self {
        Self { whole: true, ..self }
    }

    /// With so many digits behind the point at most.
    pub fn decimals(self, decimals: usize) -> Self {
        Self { decimals, ..self }
    }
}

/// Width of the names before sliders [points].
const NAMES: f32 = 104.0;

fn labelled(ui: &mut Ui, row: &Row<'_>, control: impl FnOnce(&mut Ui) -> Response) -> Response {
    named(ui, row.name, &format!("{}\n\n{}", row.help, row.key), control)
}

/// A control with its name before it and what it means for who points at it.
pub fn named(
    ui: &mut Ui,
    name: &str,
    help: &str,
    control: impl FnOnce(&mut Ui) -> Response,
) -> Response {
    ui.horizontal(|ui| {
        let size = egui::vec2(NAMES, ui.spacing().interact_size.y);
        let layout = egui::Layout::left_to_right(egui::Align::Center);
        let label = ui.allocate_ui_with_layout(size, layout, |ui| {
            ui.set_min_width(NAMES);
            ui.label(name)
        });
        let label = label.inner.on_hover_text(help);
        control(ui).labelled_by(label.id).on_hover_text(help)
    })
    .inner
}
