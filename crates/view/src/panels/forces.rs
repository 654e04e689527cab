//! The curve of the forces over the last seconds, and what tools have put into the tissue.

use eframe::egui::{Color32, Ui};
use egui_plot::{FilledArea, Line, LineStyle, Plot, PlotPoints, uniform_grid_spacer};
use viscera::solver::Ledger;
use viscera::units::format_number;
use viscera_picture::Color;

use super::axes::{mark_text, round_steps};
use crate::curves::{ForceCurve, ForceCurves, REMEMBERED, Source};
use crate::viewport::on_screen;

/// One curve for each point held and for each tool, dashed for the second solver; a band where it is known what a force may
/// be off by.
pub fn show(ui: &mut Ui, curves: &ForceCurves, now: f64, is_comparison: bool) {
    if curves.list().is_empty() {
        ui.centered_and_justified(|ui| {
            ui.weak("Press on the tissue and pull, or take an instrument: its force is drawn here.")
        });
        return;
    }
    let colors = [
        on_screen(Color::PULLED),
        Color32::from_rgb(64, 132, 214),
        Color32::from_rgb(88, 168, 92),
        Color32::from_rgb(176, 106, 190),
    ];
    show_names(ui, curves, colors, is_comparison);
    let plot = Plot::new("forces")
        .x_axis_label("time in s")
        .y_axis_label("force [N]")
        .x_grid_spacer(uniform_grid_spacer(|input| round_steps(&input, 8.0)))
        .y_grid_spacer(uniform_grid_spacer(|input| round_steps(&input, 4.0)))
        .x_axis_formatter(|mark, _| mark_text(mark.value))
        .y_axis_formatter(|mark, _| mark_text(mark.value))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .include_y(0.0)
        .include_x(now)
        .include_x((now - REMEMBERED).max(0.0))
        .set_margin_fraction([0.0, 0.08].into());
    plot.show(ui, |plot| {
        for (number, curve) in curves.list().iter().enumerate() {
            let color = colors[number % colors.len()];
            if let Some(band) = band(curve, color) {
                plot.add(band);
            }
            for side in 0..if is_comparison { 2 } else { 1 } {
                let points: PlotPoints<'_> =
                    curve.points.iter().map(|point| [point.time, point.forces[side]]).collect();
                let mut name = curve.name.clone();
                if is_comparison {
                    name.push_str([", A", ", B"][side]);
                }
                let line = Line::new(name, points).color(color).width(2.0);
                plot.line(if side == 1 { line.style(LineStyle::dashed_loose()) } else { line });
            }
        }
    });
}

/// The legend, above the curves and not on them.
fn show_names(ui: &mut Ui, curves: &ForceCurves, colors: [Color32; 4], is_comparison: bool) {
    let is_tool = |curve: &ForceCurve| matches!(curve.source, Source::Tool(_));
    let are_several = curves.list().len() > 1 || curves.list().iter().any(is_tool);
    if !are_several && !is_comparison {
        return;
    }
    ui.horizontal_wrapped(|ui| {
        for (curve, color) in curves.list().iter().zip(colors.iter().cycle()) {
            ui.colored_label(*color, &curve.name);
        }
        if is_comparison {
            ui.weak("A as a line, B dashed");
        }
    });
}

/// From the force less its error to the force and its error; nothing where no error is known. Without a name it is
/// not in the legend.
fn band(curve: &ForceCurve, color: Color32) -> Option<FilledArea> {
    let known = curve.points.iter().filter_map(|point| {
        let (force, error) = (point.forces[0], point.error?);
        (force + error).is_finite().then(|| (point.time, [(force - error).max(0.0), force + error]))
    });
    let (times, ends): (Vec<f64>, Vec<[f64; 2]>) = known.unzip();
    let [low, high] = [0, 1].map(|end| ends.iter().map(|ends| ends[end]).collect::<Vec<f64>>());
    (times.len() > 1)
        .then(|| FilledArea::new("", &times, &low, &high).fill_color(color.gamma_multiply(0.25)))
}

/// Work and energy [J], in one line.
pub fn show_ledger(ui: &mut Ui, ledger: &Ledger) {
    ui.horizontal_wrapped(|ui| {
        let mut entry = |name: &str, energy: f64, help: &str| {
            ui.weak(name).on_hover_text(help);
            ui.label(joules(energy)).on_hover_text(help);
            ui.add_space(8.0);
        };
        entry("work of tools", ledger.work, "What tools have put into the tissue, less what they got back");
        entry("stored", ledger.stored, "Elastic energy of tissue and contact now");
        entry("most stored", ledger.most_stored, "The most that was ever stored");
        let share = ledger.surplus / ledger.most_stored;
        let help = "Energy that steps have made of nothing while tools touched the tissue: an error of the method, and small \
                    beside what was stored";
        entry("surplus", ledger.surplus, help);
        if share.is_finite() && share > 0.0 {
            ui.weak(format!("({share:.1e} of the most stored)")).on_hover_text(help);
        }
    });
}

/// An energy [J] with three digits.
fn joules(energy: f64) -> String {
    let (factor, unit) = match energy.abs() {
        0.0 => (1.0, "J"),
        small if small < 1e-6 => (1e9, "nJ"),
        small if small < 1e-3 => (1e6, "µJ"),
        small if small < 1.0 => (1e3, "mJ"),
        _ => (1.0, "J"),
    };
    let rounded = format!("{:.2e}", factor * energy).parse().unwrap_or(f64::NAN);
    format!("{} {unit}", format_number(rounded))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energies_are_read_at_a_glance() {
        let texts = [0.0, 1.2345e-7, -3.2e-4, 0.012_34, 12.0].map(joules);
        assert_eq!(texts, ["0 J", "123 nJ", "-320 µJ", "12.3 mJ", "12 J"]);
    }
}
