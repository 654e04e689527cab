//! The live convergence plot: residual against iteration for the solvers that are ticked.

use eframe::egui::{self, Color32, Ui};
use egui_plot::{Line, Plot, PlotPoints, uniform_grid_spacer};

use super::axes::round_steps;
use crate::preferences::Preferences;
use crate::probe::{Curve, VARIANTS};

/// Colours that colour-blind people tell apart (Okabe and Ito 2008), one for each solver.
const COLORS: [Color32; VARIANTS.len()] = [
    Color32::from_rgb(240, 240, 240),
    Color32::from_rgb(0, 200, 200),
    Color32::from_rgb(213, 94, 0),
    Color32::from_rgb(230, 159, 0),
    Color32::from_rgb(204, 121, 167),
    Color32::from_rgb(86, 180, 233),
    Color32::from_rgb(0, 158, 115),
    Color32::from_rgb(90, 130, 255),
    Color32::from_rgb(240, 228, 66),
];

/// Ticks for the solvers in the colours of their curves, which is the legend, and the curves; residuals as powers
/// of ten.
pub fn show(ui: &mut Ui, preferences: &mut Preferences, curves: &[Curve]) {
    ui.horizontal(|ui| {
        ui.strong("Convergence");
        ui.weak("of the step that comes next").on_hover_text(
            "Each solver begins the same step anew, in double precision. The residual is the sum of unbalanced \
             forces over that of all loads.",
        );
    });
    for ((variant, name), color) in VARIANTS.iter().zip(COLORS) {
        let mut ticked = preferences.ticked.contains(variant);
        let text = egui::RichText::new(*name).color(color);
        if ui.checkbox(&mut ticked, text).changed() {
            preferences.ticked.retain(|other| other != variant);
            if ticked {
                preferences.ticked.push(*variant);
            }
        }
    }
    for problem in curves.iter().filter_map(|curve| curve.problem.as_ref()) {
        ui.colored_label(ui.visuals().warn_fg_color, problem);
    }
    let mut plot = Plot::new("convergence");
    for end in decades(curves) {
        plot = plot.include_y(end);
    }
    plot.x_axis_label("iteration")
        .y_axis_label("residual")
        .x_grid_spacer(uniform_grid_spacer(|input| round_steps(&input, 6.0)))
        // Powers of ten, the finest of them.
        .y_grid_spacer(uniform_grid_spacer(|_| [4.0, 2.0, 1.0]))
        .y_axis_formatter(|mark, _| format!("1e{:.0}", mark.value))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show(ui, |plot| {
            for curve in curves {
                let color = VARIANTS.iter().position(|(_, name)| *name == curve.name);
                let points: PlotPoints<'_> = (curve.residuals.iter())
                    .map(|&(iteration, residual)| [f64::from(iteration), residual.log10()])
                    .filter(|[_, y]| y.is_finite())
                    .collect();
                let line = Line::new(curve.name.clone(), points).width(2.0);
                plot.line(line.color(color.map_or(Color32::GRAY, |number| COLORS[number])));
            }
        });
}

/// Powers of ten around all residuals: there are at least two marks, however near to each other residuals are.
fn decades(curves: &[Curve]) -> Vec<f64> {
    let residuals = curves.iter().flat_map(|curve| &curve.residuals);
    let powers = residuals.map(|(_, residual)| residual.log10()).filter(|power| power.is_finite());
    let both =
        powers.map(|power| [power, power]).reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]);
    both.map_or_else(Vec::new, |[low, high]| {
        vec![low.floor(), (low.floor() + 1.0).max(high.ceil())]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_lie_between_two_powers_of_ten() {
        let curve = |residuals: &[f64]| {
            let residuals = (0..).zip(residuals.iter().copied()).collect();
            Curve { name: "x".into(), residuals, problem: None }
        };
        assert_eq!(decades(&[curve(&[3e-3, 4e-3])]), [-3.0, -2.0]);
        assert_eq!(decades(&[curve(&[1e-3]), curve(&[])]), [-3.0, -2.0]);
        assert_eq!(decades(&[curve(&[0.5, 0.0]), curve(&[2e-6])]), [-6.0, 0.0]);
        assert!(decades(&[curve(&[0.0])]).is_empty());
    }
}
