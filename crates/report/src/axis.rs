//! Axes: what they span, where their ticks stand and what is written there.

use super::numbers::power_of_ten;

/// How values become places along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences are equally far apart.
    Linear,
    /// Equal ratios are equally far apart; values above 0 only.
    Logarithmic,
}

/// An axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Words and the unit, as in `deflection of the tip [mm]`.
    pub label: String,
    /// How values become places.
    pub scale: Scale,
}

impl Axis {
    /// An axis of equal differences.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Linear }
    }

    /// An axis of equal ratios.
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Logarithmic }
    }

    /// Whether a value has a place here.
    pub(super) fn shows(&self, value: f64) -> bool {
        match self.scale {
            // Differences of larger values may be infinite.
            Scale::Linear => value.is_finite() && value.abs() < 1e100,
            Scale::Logarithmic => value.is_finite() && value > 0.0,
        }
    }

    fn coordinate(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic => libm::log10(value),
        }
    }

    /// The stretch of this axis that holds the values, which all have a place on it, and its ticks.
    pub(super) fn span(&self, values: impl Iterator<Item = f64>) -> Span {
        let (low, high) = values
            .map(|value| self.coordinate(value))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let (low, high, ticks) = match self.scale {
            Scale::Linear => linear_ticks(low, high),
            Scale::Logarithmic => logarithmic_ticks(low, high),
        };
        // Markers at the ends stand clear of the frame.
        let margin = 0.03 * (high - low);
        Span { axis: self.clone(), low: low - margin, high: high + margin, ticks }
    }
}

/// A tick at a coordinate; without a label it is a minor one.
pub(super) struct Tick {
    coordinate: f64,
    /// What is written there.
    pub label: Option<String>,
}

/// What part of an axis is drawn.
pub(super) struct Span {
    axis: Axis,
    /// Coordinates of the ends.
    low: f64,
    high: f64,
    /// In ascending order.
    pub ticks: Vec<Tick>,
}

impl Span {
    /// Where a value stands between the ends, 0 to 1.
    pub(super) fn share(&self, value: f64) -> f64 {
        (self.axis.coordinate(value) - self.low) / (self.high - self.low)
    }

    /// Where a tick stands between the ends, 0 to 1.
    pub(super) fn tick_share(&self, tick: &Tick) -> f64 {
        (tick.coordinate - self.low) / (self.high - self.low)
    }
}

/// The ends as they are, and ticks between them at multiples of 1, 2 or 5 times a power of ten: three
/// to eight.
fn linear_ticks(low: f64, high: f64) -> (f64, f64, Vec<Tick>) {
    let largest = low.abs().max(high.abs());
    let (low, high) = if low > high || largest < 1e-100 {
        (0.0, 1.0)
    } else if high - low < 1e-9 * largest {
        // One value, but for round-off.
        (low - 0.5 * largest, high + 0.5 * largest)
    } else {
        (low, high)
    };
    let rough = (high - low) / 7.0;
    let power = libm::floor(libm::log10(rough)) as i32;
    let unit = power_of_ten(power);
    let step = [1.0, 2.0, 5.0].map(|s| s * unit).into_iter().find(|s| *s >= rough);
    let step = step.unwrap_or(10.0 * unit);
    let (first, last) = (libm::ceil(low / step - 1e-9), libm::floor(high / step + 1e-9));
    let largest = step * first.abs().max(last.abs());
    let plain = (-4..=5).contains(&power) && largest < 1e6;
    // A step that was rounded up to the next power of ten needs one decimal less, and says so by
    // its own digits.
    let decimals = if step < 9.5 * unit { -power } else { -power - 1 }.max(0) as usize;
    let ticks = (0..=(last - first) as i32).map(|index| {
        // Adding 0 makes a negative zero positive.
        let value = (first + f64::from(index)) * step + 0.0;
        let label = if plain || value == 0.0 {
            format!("{value:.decimals$}")
        } else {
            let digits = libm::floor(libm::log10(largest)) as i32 - power;
            format!("{value:.*e}", digits.clamp(0, 15) as usize)
        };
        Tick { coordinate: value, label: Some(label) }
    });
    (low, high, ticks.collect())
}

/// Up to so many decades also have labels at 2 and 5.
const FEW_DECADES: f64 = 2.5;

/// Largest number of labels at powers of ten.
const MOST_POWERS: i32 = 10;

/// `low` and `high` are logarithms to base ten.
fn logarithmic_ticks(low: f64, high: f64) -> (f64, f64, Vec<Tick>) {
    let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
    // Logarithms of 0.001 and its like are not quite whole.
    let (bottom, top) = (libm::floor(low + 1e-9) as i32, libm::ceil(high - 1e-9) as i32);
    let few = high - low <= FEW_DECADES;
    let top = if few { top.max(bottom + 1) } else { top };
    let stride = (top - bottom + MOST_POWERS - 1) / MOST_POWERS;
    let mut ticks = Vec::new();
    for power in bottom..=top {
        for digit in 1..10 {
            let label = match digit {
                1 if power.rem_euclid(stride.max(1)) == 0 => Some(power_text(1, power, few)),
                2 | 5 if few => Some(power_text(digit, power, few)),
                _ => None,
            };
            // With many decades, ticks within them are noise.
            if label.is_some() || stride <= 1 {
                let coordinate = f64::from(power) + libm::log10(f64::from(digit));
                ticks.push(Tick { coordinate, label });
            }
        }
    }
    // The ends: whole powers, or with few decades the nearest labels.
    let labelled = || ticks.iter().filter(|tick| tick.label.is_some()).map(|tick| tick.coordinate);
    let (mut first, mut last) = (f64::from(bottom), f64::from(top));
    if few {
        first = labelled().filter(|at| *at <= low + 1e-9).fold(first, f64::max);
        last = labelled().filter(|at| *at >= high - 1e-9).fold(last, f64::min);
        if last - first < 0.2 {
            // One value: an axis needs two labels.
            last = labelled().find(|at| *at > first + 0.2).unwrap_or(first + 1.0);
        }
    }
    ticks.retain(|tick| (first - 1e-9..=last + 1e-9).contains(&tick.coordinate));
    (first, last, ticks)
}

/// `digit * 10^power`: in full where an axis of few decades is near 1, else with an exponent.
fn power_text(digit: i32, power: i32, few: bool) -> String {
    if few && (0..=5).contains(&power) {
        return format!("{digit}{}", "0".repeat(power as usize));
    }
    if few && (-3..0).contains(&power) {
        return format!("0.{}{digit}", "0".repeat((-power - 1) as usize));
    }
    let factor = if digit == 1 { String::new() } else { format!("{digit}·") };
    match power {
        0 => format!("{digit}"),
        1 => format!("{digit}0"),
        _ => format!("{factor}10{}", superscript(power)),
    }
}

fn superscript(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let of = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    number.to_string().chars().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: Axis, values: &[f64]) -> Vec<String> {
        let span = axis.span(values.iter().copied());
        for value in values {
            assert!((0.0..=1.0).contains(&span.share(*value)), "{value} is off its axis");
        }
        span.ticks.into_iter().filter_map(|tick| tick.label).collect()
    }

    #[test]
    fn decades_are_labelled_with_powers_of_ten() {
        let found = labels(Axis::logarithmic(""), &[3e-5, 2.0]);
        assert_eq!(found, ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹", "1", "10"]);
        let wide = labels(Axis::logarithmic(""), &[1e-300, 1e300]);
        assert!(wide.len() <= 12, "too many labels to read: {wide:?}");
    }

    #[test]
    fn few_decades_have_labels_between_the_powers() {
        let found = labels(Axis::logarithmic(""), &[5.0, 10.0, 200.0]);
        assert_eq!(found, ["5", "10", "20", "50", "100", "200"]);
        assert!(labels(Axis::logarithmic(""), &[1e-3]).len() >= 2);
        assert_eq!(labels(Axis::logarithmic(""), &[2e-7, 4e-7]), ["2·10⁻⁷", "5·10⁻⁷"]);
    }

    #[test]
    fn linear_ticks_are_round_numbers() {
        assert_eq!(
            labels(Axis::linear(""), &[0.0, 0.6]),
            ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6"]
        );
        assert_eq!(
            labels(Axis::linear(""), &[0.82, 1.38]).first().map(String::as_str),
            Some("0.9")
        );
        assert_eq!(labels(Axis::linear(""), &[0.0, 3e-9])[1], "5.0e-10");
    }

    #[test]
    fn strange_spans_have_an_axis() {
        for values in [&[][..], &[0.0], &[7.0], &[-1e99, 1e99], &[1e-320], &[5.0, 5.0 + 1e-15]] {
            assert!(labels(Axis::linear(""), values).len() >= 2, "{values:?}");
        }
        assert!(labels(Axis::logarithmic(""), &[]).len() >= 2);
        assert!(labels(Axis::logarithmic(""), &[5e-324, f64::MAX]).len() >= 2);
    }
}
