//! A table of texts, for Markdown and for the terminal.

/// Column heads and rows.
#[derive(Clone, Debug)]
pub struct Table {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub fn new<T: Into<String>>(heads: impl IntoIterator<Item = T>) -> Self {
        Self { heads: heads.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Adds a row. Missing cells stay empty; cells beyond the last head get a column without one.
    pub fn row<T: Into<String>>(&mut self, cells: impl IntoIterator<Item = T>) -> &mut Self {
        self.rows.push(cells.into_iter().map(Into::into).collect());
        self
    }

    /// Whether no row has been added.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// As a Markdown table whose columns line up in the source as well.
    pub fn to_markdown(&self) -> String {
        let columns = self.columns(&|text| {
            text.replace('\\', "\\\\").replace('|', "\\|").replace(['\n', '\r'], " ")
        });
        let mut lines = grid(&columns, "| ", " | ", " |");
        let rules: Vec<String> = columns
            .iter()
            .map(|column| match column.numeric {
                true => format!("{}:", "-".repeat(column.width - 1)),
                false => "-".repeat(column.width),
            })
            .collect();
        lines.insert(1, format!("| {} |", rules.join(" | ")));
        lines.join("\n") + "\n"
    }

    /// As text for a terminal.
    pub fn to_text(&self) -> String {
        let lines = grid(&self.columns(&|text| text.replace(['\n', '\r'], " ")), "", "  ", "");
        let mut text = String::new();
        for line in lines {
            text.push_str(line.trim_end());
            text.push('\n');
        }
        text
    }

    /// As CSV (RFC 4180): a line for the heads and for every row, cells with commas or quotes in quotes.
    pub fn to_csv(&self) -> String {
        let cell = |text: &String| match text.contains([',', '"', '\n', '\r']) {
            true => format!("\"{}\"", text.replace('"', "\"\"")),
            false => text.clone(),
        };
        let line = |cells: &Vec<String>| cells.iter().map(cell).collect::<Vec<_>>().join(",");
        std::iter::once(&self.heads).chain(&self.rows).map(|cells| line(cells) + "\n").collect()
    }

    /// Head first; every column with the same number of cells.
    fn columns(&self, clean: &dyn Fn(&str) -> String) -> Vec<Column> {
        let widest = self.rows.iter().map(Vec::len).max().unwrap_or(0).max(self.heads.len());
        let cell = |row: &Vec<String>, at: usize| clean(row.get(at).map_or("", String::as_str));
        (0..widest)
            .map(|at| {
                let mut cells = vec![cell(&self.heads, at)];
                cells.extend(self.rows.iter().map(|row| cell(row, at)));
                // Three are the least that Markdown takes for a rule with an alignment.
                let width = cells.iter().map(|c| c.chars().count()).max().unwrap_or(0).max(3);
                Column { numeric: is_numeric(&cells[1..]), cells, width }
            })
            .collect()
    }
}

struct Column {
    /// Numbers stand to the right, so that their units line up.
    numeric: bool,
    cells: Vec<String>,
    /// Of the widest cell [characters].
    width: usize,
}

/// Whether every cell that says something is a number, with or without a unit, a sign or a `<`.
fn is_numeric(cells: &[String]) -> bool {
    const WORDS: [&str; 4] = ["-", "not a number", "infinite", "-infinite"];
    let filled = || cells.iter().map(|c| c.trim()).filter(|c| !c.is_empty());
    let is_number = |cell: &str| {
        let bare = cell.trim_start_matches(['<', '>', '≤', '≥', '±', '+', '-', '−', ' ']);
        bare.starts_with(|c: char| c.is_ascii_digit()) || WORDS.contains(&cell)
    };
    filled().next().is_some() && filled().all(is_number)
}

fn grid(columns: &[Column], left: &str, between: &str, right: &str) -> Vec<String> {
    let height = columns.first().map_or(1, |column| column.cells.len());
    (0..height)
        .map(|at| {
            let cells: Vec<String> = columns
                .iter()
                .map(|Column { numeric, cells, width }| match numeric {
                    true => format!("{:>width$}", cells[at]),
                    false => format!("{:<width$}", cells[at]),
                })
                .collect();
            format!("{left}{}{right}", cells.join(between))
        })
        .collect()
}
