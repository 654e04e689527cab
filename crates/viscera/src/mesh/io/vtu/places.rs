//! Where things stand in the XML.

use roxmltree::Node;

use crate::mesh::io::error::{Fault, ReadProblem};

/// A fault at the line where an XML element begins.
pub(super) fn fault_at(node: Node, problem: ReadProblem) -> Fault {
    let position = node.document().text_pos_at(node.range().start);
    Fault::at(position.row as usize, problem)
}

/// Finds lines of a text without going through all of it each time.
pub(super) struct LineIndex<'a> {
    text: &'a [u8],
    /// Line ends before each stretch of so many bytes.
    before: Vec<usize>,
}

impl<'a> LineIndex<'a> {
    const STRETCH: usize = 4096;

    pub fn new(text: &'a [u8]) -> Self {
        let mut count = 0;
        let before = text.chunks(Self::STRETCH).map(|stretch| {
            let before = count;
            count += line_ends(stretch);
            before
        });
        Self { before: before.collect(), text }
    }

    /// The line, counting from 1, in which a byte stands.
    pub fn line_at(&self, byte: usize) -> usize {
        let stretch = byte / Self::STRETCH;
        let rest = self.text.get(stretch * Self::STRETCH..byte).unwrap_or_default();
        1 + self.before.get(stretch).copied().unwrap_or(0) + line_ends(rest)
    }
}

fn line_ends(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&byte| byte == b'\n').count()
}
