//! A report: text, tables and figures in the order in which they are added.

use super::output::Output;
use super::{Plot, Table};
use anyhow::{Result, ensure};
use std::path::Path;

/// A report that becomes one Markdown file and a folder of figures beside it.
pub struct Document {
    output: Output,
    title: String,
    /// Markdown that stands before everything else.
    opening: Vec<String>,
    /// Markdown, one text per block.
    blocks: Vec<String>,
    /// Names and contents of the files beside it, in order.
    files: Vec<(String, Vec<u8>)>,
}

impl Document {
    /// An empty report. Makes sure that `path`, a Markdown file, and the folder of figures beside
    /// it can be written, so that nobody computes for an hour and then loses it.
    pub fn prepare(path: &Path, title: impl Into<String>) -> Result<Self> {
        Ok(Self {
            output: Output::prepare(path)?,
            title: title.into(),
            opening: Vec::new(),
            blocks: Vec::new(),
            files: Vec::new(),
        })
    }

    /// Where the report will be.
    pub fn path(&self) -> &Path {
        self.output.document()
    }

    /// A paragraph that stands before everything that was and will be added without `open_`.
    pub fn open_with_paragraph(&mut self, markdown: impl Into<String>) {
        self.opening.push(markdown.into());
    }

    /// A table that stands before everything that was and will be added without `open_`.
    pub fn open_with_table(&mut self, table: &Table) {
        self.opening.push(table.to_markdown());
    }

    /// The heading of a section.
    pub fn heading(&mut self, text: &str) {
        self.blocks.push(format!("## {text}"));
    }

    /// A heading within a section.
    pub fn subheading(&mut self, text: &str) {
        self.blocks.push(format!("### {text}"));
    }

    /// A paragraph of Markdown.
    pub fn paragraph(&mut self, markdown: impl Into<String>) {
        self.blocks.push(markdown.into());
    }

    /// A table.
    pub fn table(&mut self, table: &Table) {
        self.blocks.push(table.to_markdown());
    }

    /// A plot in an SVG file of this name, which is made of small letters, digits and `-` and is given
    /// once.
    pub fn figure(&mut self, name: &str, plot: &Plot) -> Result<()> {
        self.show(&format!("{name}.svg"), &plot.title, plot.to_svg()?.into_bytes())
    }

    /// A picture in a PNG file of this name, with words for those who do not see it.
    pub fn picture(&mut self, name: &str, words: &str, png: Vec<u8>) -> Result<()> {
        self.show(&format!("{name}.png"), words, png)
    }

    /// A table's numbers in full, as a CSV file of this name that the text points to.
    pub fn data(&mut self, name: &str, words: &str, table: &Table) -> Result<()> {
        let file = format!("{name}.csv");
        self.file(&file, table.to_csv().into_bytes())?;
        self.blocks.push(format!("{words}: [{file}]({})", self.output.link(&file)));
        Ok(())
    }

    fn show(&mut self, file: &str, words: &str, bytes: Vec<u8>) -> Result<()> {
        self.file(file, bytes)?;
        let words = words.replace(['[', ']'], "");
        self.blocks.push(format!("![{words}]({})", self.output.link(file)));
        Ok(())
    }

    fn file(&mut self, file: &str, bytes: Vec<u8>) -> Result<()> {
        let name = file.rsplit_once('.').map_or(file, |(name, _)| name);
        let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        ensure!(
            !name.is_empty() && name.chars().all(legal),
            "figure `{name}`: make the name of small letters, digits and `-`"
        );
        ensure!(
            self.files.iter().all(|(taken, _)| taken != file),
            "figure `{name}` is there already; give this one another name"
        );
        self.files.push((file.to_owned(), bytes));
        Ok(())
    }

    /// The text of the report.
    pub fn to_markdown(&self) -> String {
        let mut text = format!("# {}\n", self.title);
        for block in self.opening.iter().chain(&self.blocks) {
            text.push_str(&format!("\n{}\n", block.trim_end()));
        }
        text
    }

    /// Writes figures and text, each file atomically.
    pub fn write(&self) -> Result<()> {
        self.output.write(&self.to_markdown(), &self.files)
    }
}
