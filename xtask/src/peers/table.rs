//! Numbers and tables of the report.

/// Digits, or a dash where there is nothing.
pub fn shown(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), digits)
}

/// Three significant digits without an exponent where a person can read that.
pub fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    match value.abs().log10().floor() {
        exponent if (-3.0..5.0).contains(&exponent) => {
            format!("{value:.*}", (2.0 - exponent).max(0.0) as usize)
        }
        _ => format!("{value:.1e}"),
    }
}

/// A table in Markdown.
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Column heads.
    pub fn new(heads: &[&str]) -> Self {
        Self { rows: vec![heads.iter().map(|head| (*head).to_owned()).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// The text.
    pub fn to_markdown(&self) -> String {
        let line = |row: &Vec<String>| format!("| {} |", row.join(" | "));
        let mut lines: Vec<String> = self.rows.iter().map(line).collect();
        lines.insert(1, format!("|{}", "---|".repeat(self.rows[0].len())));
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        let cases = [(0.0123, "0.0123"), (1.0, "1.00"), (68.43, "68.4"), (12345.6, "12346")];
        for (value, text) in cases {
            assert_eq!(digits(value), text);
        }
        assert_eq!((digits(2.04e-6), digits(0.0)), ("2.0e-6".into(), "0".into()));
    }
}
