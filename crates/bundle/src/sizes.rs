//! What travels: a table of sizes, and the limit.

use std::fmt::Write as _;
use std::io::Write as _;

use anyhow::{Result, bail};
use flate2::Compression;
use flate2::write::GzEncoder;

use crate::files::Files;

/// What the page may take as it travels [bytes].
pub const BUDGET: usize = 1_000_000;

/// As a server sends it.
pub fn gzip(content: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    // Memory takes everything.
    let _ = encoder.write_all(content);
    encoder.finish().unwrap_or_default()
}

/// A line for each file, the largest first, and their sum; the sum with gzip [bytes].
pub fn table(files: &Files) -> (String, usize) {
    let mut rows: Vec<(&str, usize, usize)> =
        files.iter().map(|(path, c)| (path.as_str(), c.len(), gzip(c).len())).collect();
    rows.sort_by_key(|(path, _, small)| (std::cmp::Reverse(*small), *path));
    let raw = rows.iter().map(|(_, raw, _)| raw).sum();
    let sum = rows.iter().map(|(_, _, small)| small).sum();
    rows.push(("sum", raw, sum));
    let width = rows.iter().map(|(path, ..)| path.len()).max().unwrap_or(0);
    let mut text = format!("{:<width$}  {:>9}  {:>9}\n", "bytes", "raw", "gzip");
    for (path, raw, small) in rows {
        let _ = writeln!(text, "{path:<width$}  {raw:>9}  {small:>9}");
    }
    (text, sum)
}

/// Refuses a page that takes more than the budget.
pub fn check(sum: usize) -> Result<()> {
    if sum > BUDGET {
        let over = sum - BUDGET;
        bail!(
            "the page takes {sum} bytes with gzip, {over} more than the {BUDGET} it may: look at the largest \
             lines above; wasm-opt on the PATH makes the module smaller, `twiggy top` names what is in it"
        );
    }
    Ok(())
}
