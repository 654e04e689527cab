//! The live convergence plot: residual against iteration for the methods that are ticked.

use eframe::egui::Ui;
use egui_plot::{Legend, Line, Plot, PlotPoints};

/// One method's curve for the current step.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// The method, in words.
    pub name: String,
    /// Relative residual after each iteration, from before the first.
    pub residuals: Vec<f64>,
}

/// Draws the curves, residuals as powers of ten.
pub fn show(ui: &mut Ui, curves: &[Curve]) {
    Plot::new("convergence")
        .x_axis_label("iteration")
        .y_axis_label("log10 residual")
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .legend(Legend::default())
        .show(ui, |plot| {
            for curve in curves {
                let logarithms = curve.residuals.iter().map(|residual| residual.log10());
                let points: PlotPoints<'_> = logarithms
                    .enumerate()
                    .filter(|(_, y)| y.is_finite())
                    .map(|(iteration, y)| [iteration as f64, y])
                    .collect();
                plot.line(Line::new(curve.name.clone(), points).width(2.0));
            }
        });
}
