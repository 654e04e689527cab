//! Rows of settings: a name, a slider or a menu, and what it means when one points at it.

use eframe::egui::{self, Response, Ui};
use std::ops::RangeInclusive;

use super::Action;
use super::number::{Edit, Number, named};
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

    /// A number of a scene file, in the row's unit.
    pub fn number(&mut self, ui: &mut Ui, row: &Row<'_>, value: f64) {
        let edit = labelled(ui, row, |ui, label| row.number.show(ui, value, label));
        if let Some(edit) = edit {
            let gesture = matches!(edit, Edit::Moved(_, true));
            self.one(row.key, edit.text(row.number.unit), gesture);
        }
    }

    /// A box to tick.
    pub fn tick(&mut self, ui: &mut Ui, key: &str, name: &str, help: &str, value: bool) {
        let mut shown = value;
        if ui.checkbox(&mut shown, name).on_hover_text(help).changed() {
            self.one(key, shown.to_string(), false);
        }
    }

    /// A box that leaves a number to the method; `usual` where it is unticked.
    pub fn automatic(&mut self, ui: &mut Ui, row: &Row<'_>, is_automatic: bool, usual: u32) {
        let mut shown = is_automatic;
        let name = format!("automatic {}", row.name);
        if ui.checkbox(&mut shown, name).on_hover_text(row.help).changed() {
            let value = if shown { "auto".to_owned() } else { usual.to_string() };
            self.one(row.key, value, false);
        }
    }

    /// A menu of names: each as a scene file has it, and in words.
    pub fn menu(&mut self, ui: &mut Ui, row: &Row<'_>, value: &str, names: &[(&str, &str)]) {
        let shown = names.iter().find(|(name, _)| *name == value).map_or(value, |(_, words)| words);
        let mut chosen = None;
        labelled(ui, row, |ui, label| {
            let menu = egui::ComboBox::from_id_salt(row.key)
                .selected_text(shown)
                .width(ui.spacing().slider_width + 40.0)
                .show_ui(ui, |ui| {
                    for (name, words) in names {
                        if ui.selectable_label(*name == value, *words).clicked() {
                            chosen = Some(*name);
                        }
                    }
                });
            (menu.response.labelled_by(label), ())
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
    /// How its number looks, where it is one.
    pub number: Number<'a>,
}

impl<'a> Row<'a> {
    /// A plain one.
    pub fn new(key: &'a str, name: &'a str, help: &'a str) -> Self {
        let number =
            Number { unit: "", rail: 0.0..=1.0, logarithmic: false, whole: false, decimals: 2 };
        Self { key, name, help, number }
    }

    /// With a rail from here to there; what is typed may lie beyond.
    pub fn rail(mut self, rail: RangeInclusive<f64>) -> Self {
        self.number.rail = rail;
        self
    }

    /// With a unit, as a scene file has it.
    pub fn unit(mut self, unit: &'a str) -> Self {
        self.number.unit = unit;
        self
    }

    /// Over factors.
    pub fn logarithmic(mut self) -> Self {
        self.number.logarithmic = true;
        self
    }

    /// In whole numbers.
    pub fn whole(mut self) -> Self {
        self.number.whole = true;
        self
    }

    /// With so many digits behind the point at most, where it is slid.
    pub fn decimals(mut self, decimals: usize) -> Self {
        self.number.decimals = decimals;
        self
    }
}

fn labelled<T>(
    ui: &mut Ui,
    row: &Row<'_>,
    control: impl FnOnce(&mut Ui, egui::Id) -> (Response, T),
) -> T {
    named(ui, row.name, &format!("{}\n\n{}", row.help, row.key), control)
}
