//! Numbers as one reads them in a table.

/// A fraction in percent, with two significant digits or to the unit: `0.00123` is `0.12 %`,
/// `1.234` is `123 %`.
pub fn percent(fraction: f64) -> String {
    let value = 100.0 * fraction;
    if !value.is_finite() {
        return not_finite(value);
    }
    let exponent = rounded_exponent(value, 1);
    // Beyond this, leading zeros or digits that nobody measured take over.
    if value != 0.0 && !(-4..6).contains(&exponent) {
        return format!("{} %", scientific(value));
    }
    let decimals = if value == 0.0 { 0 } else { (1 - exponent).max(0) as usize };
    format!("{:.decimals$} %", value + 0.0)
}

/// A quantity with a prefix and three significant digits: `si(0.0123, "m")` is `12.3 mm`. For
/// units that take a prefix, which `kg` and `m^2` do not.
pub fn si(value: f64, unit: &str) -> String {
    const PREFIXES: [&str; 8] = ["p", "n", "µ", "m", "", "k", "M", "G"];
    if !value.is_finite() {
        return not_finite(value);
    }
    if value == 0.0 {
        return format!("0 {unit}");
    }
    let exponent = rounded_exponent(value, 2);
    let group = exponent.div_euclid(3);
    match usize::try_from(group + 4).ok().and_then(|at| PREFIXES.get(at)) {
        Some(prefix) => {
            let decimals = (2 - exponent.rem_euclid(3)) as usize;
            format!("{:.decimals$} {prefix}{unit}", value / power_of_ten(3 * group))
        }
        None => format!("{value:.2e} {unit}"),
    }
}

/// Two significant digits and a power of ten: `1.2e-9`.
pub fn scientific(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if value.is_finite() { format!("{value:.1e}") } else { not_finite(value) }
}

fn not_finite(value: f64) -> String {
    let text = match value {
        v if v.is_nan() => "not a number",
        v if v > 0.0 => "infinite",
        _ => "-infinite",
    };
    text.into()
}

/// The power of ten of a value after rounding to so many decimals of its mantissa: 9.96 has 1.
fn rounded_exponent(value: f64, decimals: usize) -> i32 {
    let text = format!("{value:.decimals$e}");
    text.rsplit('e').next().and_then(|exponent| exponent.parse().ok()).unwrap_or(0)
}

/// Rounded once for positive exponents, and once more for negative ones.
pub(super) fn power_of_ten(exponent: i32) -> f64 {
    // Powers up to 22 are exact; a product of two rounded ones is still good for a drawing.
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percents_keep_two_digits_and_never_round_above_the_unit() {
        let cases = [
            (0.00123, "0.12 %"),
            (0.0, "0 %"),
            (-0.0, "0 %"),
            (0.0996, "10 %"),
            (0.012, "1.2 %"),
            (1.254, "125 %"),
            (-0.5, "-50 %"),
            (1.23e-9, "1.2e-7 %"),
            (1e6, "1.0e8 %"),
            (f64::NAN, "not a number"),
            (f64::INFINITY, "infinite"),
        ];
        for (value, text) in cases {
            assert_eq!(percent(value), text, "{value}");
        }
    }

    #[test]
    fn quantities_take_the_prefix_that_leaves_three_digits() {
        let cases = [
            (0.0123, "m", "12.3 mm"),
            (1e4, "Pa", "10.0 kPa"),
            (0.9996, "N", "1.00 N"),
            (-2.5e-6, "m", "-2.50 µm"),
            (3e-10, "J", "300 pJ"),
            (1e-20, "m", "1.00e-20 m"),
            (5e12, "Pa", "5.00e12 Pa"),
            (0.0, "m", "0 m"),
        ];
        for (value, unit, text) in cases {
            assert_eq!(si(value, unit), text, "{value}");
        }
    }

    #[test]
    fn scientific_numbers_have_two_digits() {
        assert_eq!(scientific(1.2e-9), "1.2e-9");
        assert_eq!(scientific(0.0), "0");
        assert_eq!(scientific(f64::NEG_INFINITY), "-infinite");
    }
}
