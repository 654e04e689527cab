//! Quantities with units: `"5 kPa"`, `"32 mm"`, `"1/60 s"`, `"1060 kg/m^3"`.
//!
//! Everything inside the library is in SI units; this file is where units come in and go out. A
//! quantity is a number, or a fraction of two, followed by the symbol of a unit. There is no algebra of
//! units: the symbols people write for soft tissue fit in one table.

use std::f64::consts::PI;

/// The quantity that a number measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// A pure number, or percent.
    Ratio,
    /// Metres.
    Length,
    /// Seconds.
    Time,
    /// Metres per second.
    Velocity,
    /// Metres per second squared.
    Acceleration,
    /// Kilograms.
    Mass,
    /// Kilograms per cubic metre.
    Density,
    /// Pascals: moduli, stresses and pressures.
    Pressure,
    /// Newtons.
    Force,
    /// Newtons per metre: springs and attachments.
    Stiffness,
    /// Pascals per metre: stiffness per area, of ties.
    StiffnessPerArea,
    /// Radians; written in degrees.
    Angle,
}

/// One unit: SI value = number * `numerator` / `denominator`.
///
/// Two factors, because dividing by 1000 rounds once and correctly where multiplying by the nearest
/// number to 0.001 does not.
struct Unit {
    symbol: &'static str,
    dimension: Dimension,
    numerator: f64,
    denominator: f64,
    /// Whether results are printed in this unit.
    printed: bool,
}

const fn unit(symbol: &'static str, dimension: Dimension, factors: (f64, f64)) -> Unit {
    Unit { symbol, dimension, numerator: factors.0, denominator: factors.1, printed: true }
}

const fn read_only(symbol: &'static str, dimension: Dimension, factors: (f64, f64)) -> Unit {
    Unit { symbol, dimension, numerator: factors.0, denominator: factors.1, printed: false }
}

/// Every unit there is, smallest first within a dimension.
const UNITS: &[Unit] = &[
    read_only("%", Dimension::Ratio, (1.0, 100.0)),
    unit("", Dimension::Ratio, (1.0, 1.0)),
    unit("um", Dimension::Length, (1.0, 1e6)),
    unit("mm", Dimension::Length, (1.0, 1e3)),
    read_only("cm", Dimension::Length, (1.0, 1e2)),
    unit("m", Dimension::Length, (1.0, 1.0)),
    unit("us", Dimension::Time, (1.0, 1e6)),
    unit("ms", Dimension::Time, (1.0, 1e3)),
    unit("s", Dimension::Time, (1.0, 1.0)),
    read_only("min", Dimension::Time, (60.0, 1.0)),
    unit("mm/s", Dimension::Velocity, (1.0, 1e3)),
    read_only("cm/s", Dimension::Velocity, (1.0, 1e2)),
    unit("m/s", Dimension::Velocity, (1.0, 1.0)),
    read_only("mm/s^2", Dimension::Acceleration, (1.0, 1e3)),
    unit("m/s^2", Dimension::Acceleration, (1.0, 1.0)),
    unit("mg", Dimension::Mass, (1.0, 1e6)),
    unit("g", Dimension::Mass, (1.0, 1e3)),
    unit("kg", Dimension::Mass, (1.0, 1.0)),
    unit("kg/m^3", Dimension::Density, (1.0, 1.0)),
    read_only("g/cm^3", Dimension::Density, (1e3, 1.0)),
    unit("mPa", Dimension::Pressure, (1.0, 1e3)),
    unit("Pa", Dimension::Pressure, (1.0, 1.0)),
    read_only("mmHg", Dimension::Pressure, (133.322_387_415, 1.0)),
    unit("kPa", Dimension::Pressure, (1e3, 1.0)),
    unit("MPa", Dimension::Pressure, (1e6, 1.0)),
    unit("GPa", Dimension::Pressure, (1e9, 1.0)),
    unit("mN", Dimension::Force, (1.0, 1e3)),
    unit("N", Dimension::Force, (1.0, 1.0)),
    unit("kN", Dimension::Force, (1e3, 1.0)),
    read_only("mN/mm", Dimension::Stiffness, (1.0, 1.0)),
    unit("N/m", Dimension::Stiffness, (1.0, 1.0)),
    read_only("N/mm", Dimension::Stiffness, (1e3, 1.0)),
    unit("kN/m", Dimension::Stiffness, (1e3, 1.0)),
    unit("Pa/mm", Dimension::StiffnessPerArea, (1e3, 1.0)),
    unit("kPa/mm", Dimension::StiffnessPerArea, (1e6, 1.0)),
    read_only("N/m^3", Dimension::StiffnessPerArea, (1.0, 1.0)),
    read_only("Pa/m", Dimension::StiffnessPerArea, (1.0, 1.0)),
    read_only("MPa/mm", Dimension::StiffnessPerArea, (1e9, 1.0)),
    unit("deg", Dimension::Angle, (PI, 180.0)),
    read_only("rad", Dimension::Angle, (1.0, 1.0)),
];

/// Why a text is not the wanted quantity. Messages leave out the text: whoever has it knows its place
/// too and prints both.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnitError {
    /// The text does not begin with a number.
    #[error("a quantity begins with a number, for example \"{example}\"")]
    NoNumber {
        /// A text that would do.
        example: &'static str,
    },
    /// Too large for a double, or a division by zero.
    #[error("not a finite number; write for example \"{example}\"")]
    NotFinite {
        /// A text that would do.
        example: &'static str,
    },
    /// A bare number where a unit is needed.
    #[error("write a unit, for example \"{example}\"")]
    NoUnit {
        /// A text that would do.
        example: &'static str,
    },
    /// The unit is not in the table.
    #[error("unknown unit \"{unit}\"; {dimension} is written in {}", .known.join(", "))]
    UnknownUnit {
        /// What was written.
        unit: String,
        /// What is wanted.
        dimension: Dimension,
        /// The units of that dimension, the nearest first.
        known: Vec<&'static str>,
    },
    /// A known unit of another dimension.
    #[error("{found} where {wanted} is needed, for example \"{example}\"")]
    WrongDimension {
        /// What its unit measures.
        found: Dimension,
        /// What is wanted.
        wanted: Dimension,
        /// A text that would do.
        example: &'static str,
    },
}

impl std::fmt::Display for Dimension {
    /// With its article: "a pressure", "an angle".
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Ratio => "a pure number",
            Self::Length => "a length",
            Self::Time => "a time",
            Self::Velocity => "a velocity",
            Self::Acceleration => "an acceleration",
            Self::Mass => "a mass",
            Self::Density => "a density",
            Self::Pressure => "a pressure",
            Self::Force => "a force",
            Self::Stiffness => "a stiffness",
            Self::StiffnessPerArea => "a stiffness per area",
            Self::Angle => "an angle",
        })
    }
}

impl Dimension {
    /// A quantity of this dimension as one would write it.
    pub fn example(self) -> &'static str {
        match self {
            Self::Ratio => "0.5",
            Self::Length => "32 mm",
            Self::Time => "16.7 ms",
            Self::Velocity => "50 mm/s",
            Self::Acceleration => "9.81 m/s^2",
            Self::Mass => "30 g",
            Self::Density => "1060 kg/m^3",
            Self::Pressure => "5 kPa",
            Self::Force => "0.5 N",
            Self::Stiffness => "200 N/m",
            Self::StiffnessPerArea => "20 kPa/mm",
            Self::Angle => "30 deg",
        }
    }

    /// The symbols a quantity of this dimension may be written with.
    pub fn symbols(self) -> impl Iterator<Item = &'static str> {
        UNITS.iter().filter(move |unit| unit.dimension == self).map(|unit| unit.symbol)
    }

    /// The symbol of its SI unit, of which quantities are read to the last digit; empty for pure numbers.
    pub fn si_symbol(self) -> &'static str {
        let is_one = |unit: &&Unit| unit.dimension == self && unit.numerator == unit.denominator;
        let units = || UNITS.iter().filter(is_one);
        let found = units().find(|unit| unit.printed).or_else(|| units().next());
        found.map_or("", |unit| unit.symbol)
    }

    /// Reads a quantity of this dimension; the result is in SI units.
    ///
    /// ```
    /// use viscera::units::Dimension;
    /// assert_eq!(Dimension::Pressure.parse("5 kPa"), Ok(5000.0));
    /// assert_eq!(Dimension::Time.parse("1/60 s"), Ok(1.0 / 60.0));
    /// assert!(Dimension::Pressure.parse("5 mm").is_err());
    /// ```
    pub fn parse(self, text: &str) -> Result<f64, UnitError> {
        let example = self.example();
        let (number, symbol) = split_number(text.trim());
        let number = match number {
            Some(number) if number.is_finite() => number,
            Some(_) => return Err(UnitError::NotFinite { example }),
            None => return Err(UnitError::NoNumber { example }),
        };
        let symbol = plain_symbol(symbol);
        let candidates = || UNITS.iter().filter(|unit| unit.symbol == symbol);
        if let Some(unit) = candidates().find(|unit| unit.dimension == self) {
            let value = number * unit.numerator / unit.denominator;
            return if value.is_finite() {
                Ok(value)
            } else {
                Err(UnitError::NotFinite { example })
            };
        }
        if symbol.is_empty() {
            return Err(UnitError::NoUnit { example });
        }
        Err(match candidates().next() {
            Some(unit) => {
                UnitError::WrongDimension { found: unit.dimension, wanted: self, example }
            }
            None => {
                let unit = shorten(&symbol);
                let mut known: Vec<_> = self.symbols().filter(|known| !known.is_empty()).collect();
                known.sort_by_key(|known| strsim::levenshtein(known, &unit));
                UnitError::UnknownUnit { unit, dimension: self, known }
            }
        })
    }

    /// Prints an SI value with the unit in which it reads best, to six significant digits.
    ///
    /// ```
    /// use viscera::units::Dimension;
    /// assert_eq!(Dimension::Pressure.format(5000.0), "5 kPa");
    /// assert_eq!(Dimension::Length.format(0.032), "32 mm");
    /// ```
    pub fn format(self, value: f64) -> String {
        let size = |unit: &Unit| unit.numerator / unit.denominator;
        let printed = || UNITS.iter().filter(|unit| unit.dimension == self && unit.printed);
        // Six digits round 0.9999999 kPa up to 1000 Pa: choose the unit with that in mind.
        let magnitude = value.abs() * (1.0 + 1e-6);
        let fitting = printed().rfind(|unit| magnitude >= size(unit));
        let zero_unit = || printed().find(|unit| size(unit) == 1.0);
        let unit = if value == 0.0 { zero_unit() } else { fitting };
        match unit.or_else(|| printed().next()) {
            Some(unit) => {
                let number = format_number(value * unit.denominator / unit.numerator);
                format!("{number} {}", unit.symbol).trim_end().to_owned()
            }
            None => format_number(value),
        }
    }
}

/// Six significant digits without trailing zeros; powers of ten where that is shorter.
pub fn format_number(value: f64) -> String {
    let rounded: f64 = match format!("{value:.5e}").parse() {
        Ok(rounded) => rounded,
        Err(_) => value,
    };
    let magnitude = rounded.abs();
    if rounded != 0.0 && !(1e-4..1e9).contains(&magnitude) {
        format!("{rounded:e}")
    } else {
        format!("{}", rounded + 0.0)
    }
}

/// At most 40 characters of something a person wrote, for an error message.
pub(crate) fn shorten(text: &str) -> String {
    const LIMIT: usize = 40;
    // A message is one line.
    let plain = |letter: char| if letter.is_control() { ' ' } else { letter };
    let mut letters = text.chars().map(plain);
    let mut short: String = letters.by_ref().take(LIMIT).collect();
    if letters.next().is_some() {
        short.push_str("...");
    }
    short
}

/// The number at the front of a text (`12`, `-1.5e3`, `1/60`) and what follows it.
fn split_number(text: &str) -> (Option<f64>, &str) {
    let (Some(number), rest) = split_decimal(text) else { return (None, text) };
    if let Some(denominator) = rest.trim_start().strip_prefix('/')
        && let (Some(denominator), rest) = split_decimal(denominator.trim_start())
    {
        return (Some(number / denominator), rest);
    }
    (Some(number), rest)
}

fn split_decimal(text: &str) -> (Option<f64>, &str) {
    let bytes = text.as_bytes();
    let digits_from = |start: usize| {
        start + bytes.iter().skip(start).take_while(|byte| byte.is_ascii_digit()).count()
    };
    let sign = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let mut end = digits_from(sign);
    if bytes.get(end) == Some(&b'.') {
        end = digits_from(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let exponent_sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = end + 1 + exponent_sign;
        // "5 em" has no exponent: digits must follow.
        if digits_from(exponent) > exponent {
            end = digits_from(exponent);
        }
    }
    // Only ASCII was passed over, so `end` is on a character boundary.
    let (number, rest) = text.split_at(end);
    (number.parse().ok(), rest)
}

/// A unit's symbol in the table's spelling: no spaces, `^` for powers, `u` for micro.
fn plain_symbol(symbol: &str) -> String {
    let mut plain = String::with_capacity(symbol.len());
    for character in symbol.chars().filter(|character| !character.is_whitespace()) {
        match character {
            '\u{b5}' | '\u{3bc}' => plain.push('u'),
            '\u{b2}' => plain.push_str("^2"),
            '\u{b3}' => plain.push_str("^3"),
            '\u{b0}' => plain.push_str("deg"),
            other => plain.push(other),
        }
    }
    for (written, meant) in [("m/s2", "m/s^2"), ("kg/m3", "kg/m^3"), ("g/cm3", "g/cm^3")] {
        if plain == written {
            return meant.to_owned();
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_read_into_si_units() {
        for (dimension, text, value) in [
            (Dimension::Pressure, "5 kPa", 5000.0),
            (Dimension::Pressure, "5kPa", 5000.0),
            (Dimension::Length, "32 mm", 0.032),
            (Dimension::Length, "5 \u{b5}m", 5e-6),
            (Dimension::Density, "1060 kg/m^3", 1060.0),
            (Dimension::Density, "1.06 g/cm\u{b3}", 1060.0),
            (Dimension::Time, "16.7 ms", 0.0167),
            (Dimension::Time, "1/60 s", 1.0 / 60.0),
            (Dimension::Acceleration, "-9.81 m/s^2", -9.81),
            (Dimension::Stiffness, "200 N/m", 200.0),
            (Dimension::Force, "5e-1 N", 0.5),
            (Dimension::Angle, "180 deg", PI),
            (Dimension::Ratio, "20 %", 0.2),
            (Dimension::Ratio, "0.25", 0.25),
        ] {
            let read = dimension.parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
            assert!((read - value).abs() <= f64::EPSILON * value.abs(), "{text}: {read}");
        }
    }

    #[test]
    fn a_wrong_quantity_is_refused_with_its_reason() {
        for (dimension, text, message) in [
            (
                Dimension::Pressure,
                "5 mm",
                "a length where a pressure is needed, for example \"5 kPa\"",
            ),
            (Dimension::Pressure, "5000", "write a unit, for example \"5 kPa\""),
            (
                Dimension::Pressure,
                "5 kPs",
                "unknown unit \"kPs\"; a pressure is written in kPa, mPa, Pa, MPa, GPa, mmHg",
            ),
            (Dimension::Length, "long", "a quantity begins with a number, for example \"32 mm\""),
            (Dimension::Time, "1/0 s", "not a finite number; write for example \"16.7 ms\""),
            (Dimension::Pressure, "1e308 GPa", "not a finite number; write for example \"5 kPa\""),
        ] {
            assert_eq!(
                dimension.parse(text).map_err(|error| error.to_string()),
                Err(message.into())
            );
        }
    }

    #[test]
    fn printing_and_reading_agree_to_six_digits() {
        for dimension in [
            Dimension::Ratio,
            Dimension::Length,
            Dimension::Time,
            Dimension::Velocity,
            Dimension::Acceleration,
            Dimension::Density,
            Dimension::Pressure,
            Dimension::Force,
            Dimension::Stiffness,
            Dimension::StiffnessPerArea,
            Dimension::Angle,
        ] {
            assert!(dimension.parse(dimension.example()).is_ok());
            for exponent in -12..13 {
                for mantissa in [1.0, -3.456_789_1, 9.999_999_9] {
                    let value = mantissa * 10f64.powi(exponent);
                    let text = dimension.format(value);
                    let read = dimension.parse(&text);
                    let read = read.unwrap_or_else(|error| panic!("{text}: {error}"));
                    assert!((read - value).abs() <= 5.1e-6 * value.abs(), "{value} {text}");
                }
            }
        }
        assert_eq!(Dimension::Time.format(1.0 / 60.0), "16.6667 ms");
        assert_eq!(Dimension::Length.format(0.0), "0 m");
        assert_eq!(Dimension::Pressure.format(999.999_999), "1 kPa");
    }
}
