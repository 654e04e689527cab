//! What travels: a table of sizes, and the limit.
//!
//! Browsers that know WebAssembly take Brotli over https, and servers send it where the file lies ready (`name.br`); gzip is
//! what the rest sends.

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

/// The smallest that a browser takes: made once, when the page is built.
pub fn brotli(content: &[u8]) -> Vec<u8> {
    let mut small = Vec::new();
    let parameters =
        brotli::enc::BrotliEncoderParams { quality: 11, lgwin: 22, ..Default::default() };
    // Memory takes everything.
    let _ = brotli::BrotliCompress(&mut &*content, &mut small, &parameters);
    small
}

/// Smaller files travel as they are: a header more costs what they save.
const WORTH_IT: usize = 1000;

/// Each file that is worth it once more, by Brotli, under its name with `.br` behind.
pub fn small_copies(files: &Files) -> Files {
    let large = files.iter().filter(|(_, content)| content.len() > WORTH_IT);
    large.map(|(path, content)| (format!("{path}.br"), brotli(content))).collect()
}

/// A line for each file, the largest first, and their sum; the sum with Brotli [bytes].
pub fn table(files: &Files, copies: &Files) -> (String, usize) {
    let sizes = |(path, content): (&String, &Vec<u8>)| {
        let small = copies.get(&format!("{path}.br")).map_or(content.len(), Vec::len);
        (path.clone(), [content.len(), gzip(content).len(), small])
    };
    let mut rows: Vec<(String, [usize; 3])> = files.iter().map(sizes).collect();
    rows.sort_by_key(|(path, [.., small])| (std::cmp::Reverse(*small), path.clone()));
    let sums = [0, 1, 2].map(|kind| rows.iter().map(|(_, sizes)| sizes[kind]).sum());
    rows.push(("sum".to_owned(), sums));
    let width = rows.iter().map(|(path, _)| path.len()).max().unwrap_or(0);
    let mut text = format!("{:<width$}  {:>9}  {:>9}  {:>9}\n", "bytes", "raw", "gzip", "Brotli");
    for (path, [raw, gzip, small]) in rows {
        let _ = writeln!(text, "{path:<width$}  {raw:>9}  {gzip:>9}  {small:>9}");
    }
    (text, sums[2])
}

/// Refuses a page that takes more than the budget.
pub fn check(sum: usize) -> Result<()> {
    if sum > BUDGET {
        let over = sum - BUDGET;
        bail!(
            "the page takes {sum} bytes with Brotli, {over} more than the {BUDGET} it may: look at the largest \
             lines above; `twiggy top` names what is in the module"
        );
    }
    Ok(())
}
