//! Marks of plots' axes.

use egui_plot::GridInput;
use viscera::units::format_number;

/// Steps between marks for `uniform_grid_spacer`: the finest is 1, 2 or 5 times a power of ten, of which at most `count` fit into what
/// is shown. The library's own are powers of ten, and small plots have one mark only, or none, between two of them.
pub fn round_steps(input: &GridInput, count: f64) -> [f64; 3] {
    let step = round_step(input.bounds.1 - input.bounds.0, count);
    [4.0 * step, 2.0 * step, step]
}

/// A mark's number without the digits that sums of steps leave; the library would round it to powers of ten.
pub fn mark_text(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    // No sign before nothing.
    format_number(rounded + 0.0)
}

fn round_step(span: f64, count: f64) -> f64 {
    let least = span / count;
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let power = 10f64.powf(least.log10().floor());
    let fits = |factor: &f64| factor * power >= least * (1.0 - 1e-9);
    power * [1.0, 2.0, 5.0].into_iter().find(fits).unwrap_or(10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_few() {
        let steps = [(64.0, 6.0), (12.3, 4.0), (0.09, 4.0), (8.0, 8.0), (1.0, 1.0)]
            .map(|(span, count)| round_step(span, count));
        for (found, wanted) in steps.into_iter().zip([20.0, 5.0, 0.05, 1.0, 1.0]) {
            assert!((found / wanted - 1.0).abs() < 1e-9, "{steps:?}");
        }
        assert_eq!([0.1 + 0.2, -1e-12, 40.0].map(mark_text), ["0.3", "0", "40"]);
        assert_eq!([0.0, f64::NAN, f64::INFINITY].map(|span| round_step(span, 4.0)), [1.0; 3]);
    }
}
