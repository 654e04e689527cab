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
    /// Names and SVG, in order.
    figures: Vec<(String, String)>,
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
            figures: Vec::new(),
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

    /// A figure in a file of this name, which is made of small letters, digits and `-` and is given
    /// once.
    pub fn figure(&mut self, name: &str, plot: &Plot) -> Result<()> {
        let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        ensure!(
            !name.is_empty() && name.chars().all(legal),
            "figure `{name}`: make the name of small letters, digits and `-`"
        );
        ensure!(
            self.figures.iter().all(|(taken, _)| taken != name),
            "figure `{name}` is there already; give this one another name"
        );
        self.figures.push((name.to_owned(), plot.to_svg()?));
        let words = plot.title.replace(['[', ']'], "");
        self.blocks.push(format!("![{words}]({})", self.output.link(name)));
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

    /// Writes figures and text, each whole or not at all.
    pub fn write(&self) -> Result<()> {
        self.output.write(&self.to_markdown(), &self.figures)
    }
}
