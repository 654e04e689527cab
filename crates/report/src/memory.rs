//! Amounts of memory: `"8 GB"`.

use std::fmt;
use std::str::FromStr;
use viscera::units::format_number;

/// Units, powers of a thousand.
const UNITS: [(&str, f64); 5] = [("B", 1.0), ("kB", 1e3), ("MB", 1e6), ("GB", 1e9), ("TB", 1e12)];

/// An amount of memory [B].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory(pub u64);

impl FromStr for Memory {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let help = || "write a number and a unit (B, kB, MB, GB, TB), for example \"8 GB\"".into();
        let text = text.trim();
        let end = text.find(|c: char| c.is_ascii_alphabetic()).ok_or_else(help)?;
        let (number, symbol) = text.split_at(end);
        let unit = UNITS.iter().find(|(unit, _)| unit.eq_ignore_ascii_case(symbol));
        match (number.trim().parse::<f64>(), unit) {
            (Ok(number), Some((_, size))) if number > 0.0 && number * size < u64::MAX as f64 => {
                Ok(Self((number * size).round() as u64))
            }
            _ => Err(help()),
        }
    }
}

impl fmt::Display for Memory {
    /// Three digits, in the unit in which that reads best.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.0 as f64;
        let fitting = UNITS.iter().rfind(|(_, size)| bytes >= *size);
        let (unit, size) = fitting.copied().unwrap_or(UNITS[0]);
        let amount = bytes / size;
        let decimals = if amount < 10.0 { 10.0 } else { 1.0 };
        write!(f, "{} {unit}", format_number((amount * decimals).round() / decimals))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_read_and_printed() {
        for (text, bytes, printed) in [
            ("8 GB", 8_000_000_000, "8 GB"),
            ("1.5gb", 1_500_000_000, "1.5 GB"),
            ("250 kB", 250_000, "250 kB"),
            ("12 B", 12, "12 B"),
        ] {
            assert_eq!(text.parse(), Ok(Memory(bytes)), "{text}");
            assert_eq!(Memory(bytes).to_string(), printed);
        }
    }

    #[test]
    fn what_is_no_amount_is_refused_with_an_example() {
        for text in ["", "8", "GB", "-1 GB", "0 GB", "nan GB", "1e300 GB", "8 Gb/s", "8 mm"] {
            let error = text.parse::<Memory>().expect_err(text);
            assert!(error.contains("8 GB"), "{error}");
        }
    }
}
