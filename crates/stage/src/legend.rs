//! Which values colours stand for, and how values are written.

use viscera::units::Dimension;
use viscera_picture::ColorScale;

use crate::snapshot::Coloring;

/// Which values the colours stand for. Its upper end is a round number, and calm: it grows with the values,
/// and shrinks only where they have become much smaller. A few extreme values of strain and stress do not take the
/// scale: they are beyond its end, and the legend says how large they are.
#[derive(Clone, Debug, Default)]
pub struct Legend {
    coloring: Coloring,
    /// SI; nothing where there are no values.
    high: Option<f32>,
    /// The largest value, SI.
    largest: f32,
    /// Whether there are places without a value: around inverted tetrahedra.
    has_gaps: bool,
}

/// The share of the coloured vertices that the scale holds. A stress concentration is at fewer than one in a
/// hundred; those of displacement are no outliers, and tools press on few vertices, of which all count.
fn share_held(coloring: Coloring) -> f64 {
    match coloring {
        Coloring::Strain | Coloring::Stress => 0.99,
        _ => 1.0,
    }
}

/// Values may fall to this share of the scale before it shrinks. Larger makes the colours of a swinging
/// body flicker.
const LOWEST: f32 = 0.2;

/// The least that colours tell apart: a tenth of a millimetre, a thousandth, a pascal. Round-off would show
/// as colours otherwise.
fn least(coloring: Coloring) -> f32 {
    match coloring {
        Coloring::Displacement => 1e-4,
        Coloring::Strain => 1e-3,
        _ => 1.0,
    }
}

impl Legend {
    /// Follows the values of a frame.
    pub fn follow(&mut self, coloring: Coloring, values: impl Iterator<Item = f32>) {
        if coloring != self.coloring {
            *self = Self { coloring, ..Self::default() };
        }
        let (mut known, gaps): (Vec<f32>, Vec<f32>) = values.partition(|value| value.is_finite());
        self.has_gaps = !gaps.is_empty();
        let held = (share_held(coloring) * known.len() as f64).ceil() as usize;
        let Some(last) = held.checked_sub(1) else {
            self.high = None;
            return;
        };
        let (_, end, beyond) = known.select_nth_unstable_by(last, f32::total_cmp);
        self.largest = beyond.iter().copied().fold(*end, f32::max);
        let end = end.max(least(coloring));
        let fits = self.high.is_some_and(|high| end <= high && end >= LOWEST * high);
        if !fits {
            self.high = Some(round_up(end));
        }
    }

    /// What the colours do not show, in words: a value beyond the scale, and places without one.
    pub fn remarks(&self) -> Vec<String> {
        let beyond = self.high.is_some_and(|high| self.largest > high);
        let three_digits = |value: f32| format!("{value:.2e}").parse().unwrap_or(value);
        let beyond = beyond.then(|| format!("largest {}", self.text(three_digits(self.largest))));
        let gaps = self.has_gaps.then(|| "grey: inverted".to_owned());
        beyond.into_iter().chain(gaps).collect()
    }

    /// The values of the first and the last colour; nothing for plain tissue.
    pub fn range(&self) -> Option<[f32; 2]> {
        self.high.map(|high| [0.0, high])
    }

    /// A value as the legend writes it.
    pub fn text(&self, value: f32) -> String {
        let value = f64::from(value);
        match self.coloring {
            Coloring::Plain | Coloring::Bodies => String::new(),
            Coloring::Displacement => Dimension::Length.format(value),
            Coloring::Strain => format!("{} %", viscera::units::format_number(100.0 * value)),
            Coloring::Stress | Coloring::Pressure => Dimension::Pressure.format(value),
        }
    }

    /// The same for a picture without the window: numbers in a unit that the title names.
    pub fn scale(&self) -> Option<ColorScale> {
        let high = f64::from(self.high?);
        let (unit, factor) = match self.coloring {
            Coloring::Plain | Coloring::Bodies => return None,
            Coloring::Displacement => ("mm", 1e3),
            Coloring::Strain => ("%", 100.0),
            Coloring::Stress | Coloring::Pressure if high < 1e3 => ("Pa", 1.0),
            Coloring::Stress | Coloring::Pressure => ("kPa", 1e-3),
        };
        ColorScale::new(format!("{} [{unit}]", self.title()), 0.0, factor * high).ok()
    }

    /// What the values are.
    pub fn title(&self) -> &'static str {
        match self.coloring {
            Coloring::Plain | Coloring::Bodies => "",
            Coloring::Displacement => "displacement",
            Coloring::Strain => "largest strain",
            Coloring::Stress => "von Mises stress",
            Coloring::Pressure => "contact pressure",
        }
    }
}

/// The next larger of 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8 times a power of ten.
pub(crate) fn round_up(value: f32) -> f32 {
    let power = 10f64.powf(f64::from(value).log10().floor());
    let steps = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let step = steps.into_iter().find(|step| f64::from(value) <= step * power * (1.0 + 1e-6));
    (step.unwrap_or(10.0) * power) as f32
}

/// A force as it is written everywhere: "1.25 N".
pub fn newtons(force: f64) -> String {
    match force {
        force if force < 0.1 => format!("{:.1} mN", 1e3 * force),
        force if force < 100.0 => format!("{force:.2} N"),
        force => format!("{force:.0} N"),
    }
}

/// A force with what it may be off by [N], where that is known: "1.25 ± 0.03 N". The error is rounded up.
pub fn newtons_within(force: f64, error: Option<f64>) -> String {
    let Some(error) = error.filter(|error| error.is_finite()) else { return newtons(force) };
    let (factor, digits, unit) = match force.max(error) {
        large if large < 0.1 => (1e3, 1, "mN"),
        large if large < 100.0 => (1.0, 2, "N"),
        _ => (1.0, 0, "N"),
    };
    let scale = 10f64.powi(digits as i32);
    // What rounding leaves above a number of these digits is none of the error's.
    let up = (factor * error * scale - 1e-9).ceil().max(0.0) / scale;
    format!("{:.digits$} ± {up:.digits$} {unit}", factor * force)
}

/// A torque [N m] as it is written everywhere: "12.5 N mm".
pub fn newton_millimetres(torque: f64) -> String {
    match 1e3 * torque {
        torque if torque < 100.0 => format!("{torque:.1} N mm"),
        torque => format!("{torque:.0} N mm"),
    }
}

/// A small distance [m] as it is written everywhere: "0.25 mm".
pub fn millimetres(distance: f64) -> String {
    match 1e3 * distance {
        0.0 => "0 mm".to_owned(),
        distance if distance < 0.01 => format!("{:.2} µm", 1e3 * distance),
        distance if distance < 10.0 => format!("{distance:.2} mm"),
        distance => format!("{distance:.0} mm"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_ends_at_a_round_number_and_stays_calm() {
        assert_eq!([0.011, 0.1, 730.0, 9.5].map(round_up), [0.012, 0.1, 800.0, 10.0]);
        let mut legend = Legend::default();
        let mut after = |largest: f32| {
            legend.follow(Coloring::Displacement, [0.0, largest, f32::NAN].into_iter());
            legend.range().map(|range| range[1])
        };
        assert_eq!(after(0.011), Some(0.012));
        assert_eq!(after(0.004), Some(0.012));
        assert_eq!(after(0.013), Some(0.015));
        assert_eq!(after(0.002), Some(0.002));
        assert_eq!(after(1e-9), Some(1e-4));
    }

    #[test]
    fn a_few_extreme_values_do_not_take_the_scale() {
        let mut legend = Legend::default();
        // Stress of 1 to 5 kPa at a thousand vertices; four beside an inverted tetrahedron, and its own without.
        let many = (0..1000).map(|k| 1e3 + 4.0 * k as f32);
        let few = [2e7, 3e8, 1.2345e9, 5e7, f32::NAN, f32::NAN, f32::INFINITY];
        legend.follow(Coloring::Stress, many.clone().chain(few));
        assert_eq!(legend.range(), Some([0.0, 5e3]));
        assert_eq!(legend.remarks(), ["largest 1.23 GPa", "grey: inverted"]);
        legend.follow(Coloring::Stress, many);
        assert_eq!((legend.range(), legend.remarks().len()), (Some([0.0, 5e3]), 0));
        // All displacements are meant.
        legend.follow(Coloring::Displacement, (0..1000).map(|k| if k == 7 { 0.03 } else { 1e-3 }));
        assert_eq!(legend.range(), Some([0.0, 0.03]));
        // Of few values none is left out.
        legend.follow(Coloring::Strain, [0.1, 0.2, 0.9].into_iter());
        assert_eq!(legend.range(), Some([0.0, 1.0]));
        legend.follow(Coloring::Strain, [f32::NAN].into_iter());
        assert_eq!(legend.range(), None);
    }

    #[test]
    fn forces_are_read_at_a_glance() {
        assert_eq!([0.0123, 1.254, 120.4].map(newtons), ["12.3 mN", "1.25 N", "120 N"]);
        let within = [(0.0123, Some(1e-4)), (1.254, Some(0.0301)), (0.02, Some(0.2)), (3.0, None)];
        let texts = within.map(|(force, error)| newtons_within(force, error));
        assert_eq!(texts, ["12.3 ± 0.1 mN", "1.25 ± 0.04 N", "0.02 ± 0.20 N", "3.00 N"]);
        assert_eq!(newton_millimetres(0.0125), "12.5 N mm");
        let distances = [0.0, 1.5e-6, 8.3e-4, 0.032].map(millimetres);
        assert_eq!(distances, ["0 mm", "1.50 µm", "0.83 mm", "32 mm"]);
    }
}
