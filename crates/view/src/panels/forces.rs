//! The curve of the forces over the last seconds.

use eframe::egui::{Color32, Ui};
use egui_plot::{Legend, Line, LineStyle, Plot, PlotPoints};
use viscera_picture::Color;

use crate::holds::{Holds, REMEMBERED};
use crate::viewport::on_screen;

/// One curve for each point held, dashed for the second solver.
pub fn show(ui: &mut Ui, holds: &Holds, now: f64, is_comparison: bool) {
    if holds.list().is_empty() {
        ui.centered_and_justified(|ui| {
            ui.weak("Press on the tissue and pull: its force is drawn here.")
        });
        return;
    }
    let colors = [
        on_screen(Color::PULLED),
        Color32::from_rgb(64, 132, 214),
        Color32::from_rgb(88, 168, 92),
        Color32::from_rgb(176, 106, 190),
    ];
    let mut plot = Plot::new("forces")
        .x_axis_label("time in s")
        .y_axis_label("force [N]")
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .include_y(0.0)
        .include_x(now)
        .include_x((now - REMEMBERED).max(0.0))
        .set_margin_fraction([0.0, 0.08].into());
    if holds.list().len() > 1 || is_comparison {
        plot = plot.legend(Legend::default().position(egui_plot::Corner::LeftTop));
    }
    plot.show(ui, |plot| {
        for (number, held) in holds.list().iter().enumerate() {
            let color = colors[number % colors.len()];
            for side in 0..if is_comparison { 2 } else { 1 } {
                let points: PlotPoints<'_> =
                    held.curve.iter().map(|(time, forces)| [*time, forces[side]]).collect();
                let mut name = format!("point {}", number + 1);
                if is_comparison {
                    name.push_str([", A", ", B"][side]);
                }
                let line = Line::new(name, points).color(color).width(2.0);
                plot.line(if side == 1 { line.style(LineStyle::dashed_loose()) } else { line });
            }
        }
    });
}
