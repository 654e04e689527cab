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

/// What the page may take as it travels, before a person opens a file of their own [bytes].
pub const BUDGET: usize = 1_000_000;

/// What the second module may take, which that takes [bytes].
pub const FILES_BUDGET: usize = 700_000;

/// Of the second module.
const OF_FILES: &str = "viscera_files";

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

/// What each file takes, the largest first.
pub struct Sizes {
    /// Raw, by gzip and by Brotli [bytes].
    rows: Vec<(String, [usize; 3])>,
}

impl Sizes {
    /// Of files, and of those of them that are there once more by Brotli.
    pub fn new(files: &Files, copies: &Files) -> Self {
        let sizes = |(path, content): (&String, &Vec<u8>)| {
            let small = copies.get(&format!("{path}.br")).map_or(content.len(), Vec::len);
            (path.clone(), [content.len(), gzip(content).len(), small])
        };
        let mut rows: Vec<(String, [usize; 3])> = files.iter().map(sizes).collect();
        rows.sort_by_key(|(path, [.., small])| (std::cmp::Reverse(*small), path.clone()));
        Self { rows }
    }

    /// Sums of the page, and of its second module.
    fn sums(&self) -> [[usize; 3]; 2] {
        [false, true].map(|of_files| {
            let of = self.rows.iter().filter(|(path, _)| path.starts_with(OF_FILES) == of_files);
            of.fold([0; 3], |sum, (_, sizes)| std::array::from_fn(|kind| sum[kind] + sizes[kind]))
        })
    }

    /// A line for each file, and what the page and its second module take.
    pub fn table(&self) -> String {
        let [page, of_files] = self.sums();
        let sums = [("page".to_owned(), page), ("second module".to_owned(), of_files)];
        let rows = || self.rows.iter().chain(&sums);
        let width = rows().map(|(path, _)| path.len()).max().unwrap_or(0);
        let head = ["raw", "gzip", "Brotli"].map(|kind| format!("  {kind:>9}")).concat();
        let mut text = format!("{:<width$}{head}\n", "bytes");
        for (path, [raw, gzip, small]) in rows() {
            let _ = writeln!(text, "{path:<width$}  {raw:>9}  {gzip:>9}  {small:>9}");
        }
        text
    }

    /// Refuses a page that takes more than the budget.
    pub fn check(&self) -> Result<()> {
        let [page, of_files] = self.sums().map(|[.., small]| small);
        for (what, sum, budget) in
            [("page", page, BUDGET), ("second module", of_files, FILES_BUDGET)]
        {
            if sum > budget {
                let over = sum - budget;
                bail!(
                    "the {what} takes {sum} bytes with Brotli, {over} more than the {budget} it may: look at the largest lines \
                     above; `twiggy top` names what is in a module"
                );
            }
        }
        Ok(())
    }
}
