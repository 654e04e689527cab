//! Numbers: a rail to slide on, and beside it the number itself, which is dragged or typed.
//!
//! The rail's range is a convenience: what a scene has and what is typed may lie beyond it. What is dragged acts at
//! once; what is typed acts when it is finished, by Enter, by Tab, or by going elsewhere.

use eframe::egui::{self, DragValue, Id, Response, Slider, SliderClamping, Ui};
use std::cell::Cell;
use std::ops::RangeInclusive;
use viscera::units::format_number;

/// How a number looks.
#[derive(Clone, Debug)]
pub struct Number<'a> {
    /// The unit of what is shown and typed, as a scene file has it: "kg/m^3".
    pub unit: &'a str,
    /// Where the rail begins and ends.
    pub rail: RangeInclusive<f64>,
    /// Equal steps are equal factors.
    pub logarithmic: bool,
    /// A count.
    pub whole: bool,
    /// Digits behind the point that sliding leaves, at most.
    pub decimals: usize,
}

/// What a person has done to a number.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// Dragged or stepped; true for one of many changes that belong together.
    Moved(f64, bool),
    /// Typed. Whether it can be read is for its reader to say.
    Typed(String),
}

impl Edit {
    /// As a scene file has it: a bare number gets the unit in which it is shown.
    pub fn text(&self, unit: &str) -> String {
        let with_unit = |number: &str| format!("{number} {unit}").trim_end().to_owned();
        match self {
            // Without the digits that nobody chose.
            Self::Moved(value, _) => with_unit(&format_number(*value)),
            Self::Typed(text) if text.parse::<f64>().is_ok() => with_unit(text),
            Self::Typed(text) => text.clone(),
        }
    }
}

impl Number<'_> {
    /// Shows it under the name that a label has; what became of it.
    pub fn show(&self, ui: &mut Ui, value: f64, label: Id) -> (Response, Option<Edit>) {
        let mut moved = value;
        let mut rail = Slider::new(&mut moved, self.rail.clone())
            .logarithmic(self.logarithmic)
            .clamping(SliderClamping::Never)
            .show_value(false)
            .max_decimals(self.decimals);
        if self.whole {
            rail = rail.integer();
        }
        let rail = ui.add(rail).labelled_by(label);
        let (number, typed) = self.show_number(ui, &mut moved);
        let number = number.labelled_by(label);
        let is_drag = |part: &Response| part.dragged() || part.drag_stopped();
        let edit = match typed {
            Some(text) => Some(Edit::Typed(text)),
            None if moved != value => Some(Edit::Moved(moved, is_drag(&rail) || is_drag(&number))),
            None => None,
        };
        (rail | number, edit)
    }

    /// For numbers of the window's own, which no scene file has: the number, or why it is none that can be.
    pub fn read(&self, name: &str, edit: &Edit, legal: RangeInclusive<f64>) -> Result<f64, String> {
        let value = match edit {
            Edit::Moved(value, _) => *value,
            Edit::Typed(text) => {
                let bare = text.strip_suffix(self.unit).unwrap_or(text).trim();
                bare.parse().map_err(|_| format!("{name}: `{text}` is no number"))?
            }
        };
        if legal.contains(&value) && (!self.whole || value.fract() == 0.0) {
            return Ok(value);
        }
        let [low, high] = [legal.start(), legal.end()].map(|end| format_number(*end));
        let kind = if self.whole { "whole numbers" } else { "numbers" };
        let found = format_number(value);
        Err(format!("{name}: {found} is not possible; {kind} from {low} to {high} are"))
    }

    /// The number beside the rail, and what was typed into it, where that is finished and something else.
    fn show_number(&self, ui: &mut Ui, value: &mut f64) -> (Response, Option<String>) {
        let id = ui.next_auto_id();
        let shown = format_number(*value);
        let typed = Cell::new(None);
        // The window's toolkit reads numbers and clamps them. What was typed is for who reads scene files: units
        // are understood there, and what is not possible is refused with a reason.
        let keep = |text: &str| -> Option<f64> {
            let text = text.trim();
            if !text.is_empty() && text != shown {
                typed.set(Some(text.to_owned()));
            }
            None
        };
        let [low, high] = [*self.rail.start(), *self.rail.end()];
        // A drag ends where the rail does, or at the value it began with beyond.
        let range = match ui.ctx().is_being_dragged(id) {
            true => low.min(*value)..=high.max(*value),
            false => f64::NEG_INFINITY..=f64::INFINITY,
        };
        let suffix = format!(" {}", self.unit.replace("^2", "²").replace("^3", "³"));
        let speed = self.speed(ui, id, *value);
        let number = DragValue::new(value)
            .speed(speed)
            .range(range)
            .clamp_existing_to_range(false)
            .max_decimals(self.decimals)
            .update_while_editing(false)
            .custom_formatter(|value, _| format_number(value))
            .custom_parser(keep)
            .suffix(suffix.trim_end());
        let response = ui.add(number);
        let is_abandoned = is_abandoned(ui, id);
        (response, typed.take().filter(|_| !is_abandoned))
    }

    /// Change for a point of dragging, and for an arrow key while typing: the whole rail for its width.
    fn speed(&self, ui: &Ui, id: Id, value: f64) -> f64 {
        if self.whole && ui.memory(|memory| memory.has_focus(id)) {
            return 1.0;
        }
        let [low, high] = [*self.rail.start(), *self.rail.end()];
        let span = match self.logarithmic {
            true => value.abs().max(low) * (high / low).ln(),
            false => high - low,
        };
        span / f64::from(ui.spacing().slider_width.max(1.0))
    }
}

/// When Escape was pressed last, by the window's count of frames.
#[derive(Clone, Copy)]
struct Escaped(u64);

/// Whether Escape has left a number. The toolkit knows of it in that frame alone, and takes over what was typed in
/// the next.
fn is_abandoned(ui: &Ui, id: Id) -> bool {
    let frame = ui.ctx().cumulative_frame_nr();
    let is_pressed = ui.input(|input| input.key_pressed(egui::Key::Escape));
    ui.data_mut(|data| {
        if is_pressed {
            data.insert_temp(id, Escaped(frame));
        }
        data.get_temp(id).is_some_and(|Escaped(at)| frame <= at + 1)
    })
}

/// A control with its name before it and what it means for who points at it. The control gets the label's
/// number, to be named by it.
pub fn named<T>(
    ui: &mut Ui,
    name: &str,
    help: &str,
    control: impl FnOnce(&mut Ui, Id) -> (Response, T),
) -> T {
    ui.horizontal(|ui| {
        let size = egui::vec2(NAMES, ui.spacing().interact_size.y);
        let layout = egui::Layout::left_to_right(egui::Align::Center);
        let label = ui.allocate_ui_with_layout(size, layout, |ui| {
            ui.set_min_width(NAMES);
            ui.label(name)
        });
        let label = label.inner.on_hover_text(help);
        let (response, made) = control(ui, label.id);
        response.on_hover_text(help);
        made
    })
    .inner
}

/// Width of the names before controls [points].
const NAMES: f32 = 104.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_reaches_the_scene_file_digit_by_digit() {
        let text = |typed: &str| Edit::Typed(typed.to_owned()).text("kPa");
        assert_eq!(text("12.345678"), "12.345678 kPa");
        // Units are the scene file's, and so are refusals.
        assert_eq!(text("0.6 MPa"), "0.6 MPa");
        assert_eq!(text("soft"), "soft");
        assert_eq!(Edit::Moved(0.1 + 0.2, true).text("kPa"), "0.3 kPa");
        assert_eq!(Edit::Moved(7.0, false).text(""), "7");
    }

    #[test]
    fn the_windows_own_numbers_are_refused_with_their_range() {
        let look =
            Number { unit: "x", rail: 0.05..=4.0, logarithmic: true, whole: false, decimals: 2 };
        let read = |look: &Number<'_>, typed: &str| {
            look.read("speed", &Edit::Typed(typed.to_owned()), 0.01..=100.0)
        };
        assert_eq!((read(&look, "8"), read(&look, "2.5 x")), (Ok(8.0), Ok(2.5)));
        for typed in ["0", "-1", "NaN", "1e9"] {
            let refused = read(&look, typed).expect_err(typed);
            assert!(refused.contains("0.01 to 100"), "{refused}");
        }
        assert!(read(&look, "fast").expect_err("no number").contains("`fast`"));
        let count = Number { whole: true, ..look };
        assert!(read(&count, "2.5").expect_err("no count").contains("whole"));
    }
}
