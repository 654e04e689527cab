//! Places of elements.

use roxmltree::Node;

use crate::mesh::io::error::{Fault, ReadProblem};

/// A fault at the line where an XML element begins.
pub(super) fn fault_at(node: Node, problem: ReadProblem) -> Fault {
    let position = node.document().text_pos_at(node.range().start);
    Fault::at(position.row as usize, problem)
}
