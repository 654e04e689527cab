//! Elements as listed in a file.

use super::kinds::kind_of;
use super::numbers::Numbers;
use crate::mesh::io::cells::{Cells, Shape};
use crate::mesh::io::error::{Fault, Place, ReadProblem};

/// Elements as listed in the file.
#[derive(Default)]
pub(super) struct Elements {
    pub cells: Vec<(Shape, u64)>,
    /// Where the nodes of each element begin, and those of the last end.
    pub first: Vec<usize>,
    pub nodes: Vec<u64>,
    /// Physical groups, and numbers in the file.
    pub groups: Vec<u64>,
    pub places: Vec<Place>,
    /// Elements of unknown types.
    pub unknown: Cells,
}

impl Elements {
    /// Adds an element whose nodes come next, as four bytes in binary files if so.
    pub fn add(
        &mut self,
        numbers: &mut Numbers<'_>,
        (place, number, kind, group): (Place, u64, u64, u64),
        is_short: bool,
    ) -> Result<(), Fault> {
        let Some(of_kind) = kind_of(kind) else {
            if numbers.is_binary() {
                let found = format!("an element of type {kind} in a binary Gmsh file");
                let advice =
                    "its size is not known here; export the file as text, or without such elements";
                return Err(Fault {
                    place: Some(place),
                    problem: ReadProblem::Unsupported { found, advice },
                });
            }
            self.unknown.skip(&format!("element of type {kind}"));
            return Ok(());
        };
        self.first.push(self.nodes.len());
        for _ in 0..of_kind.nodes {
            let expected = "a vertex number, 1 or more";
            let node =
                if is_short { numbers.natural(expected)? } else { numbers.size(expected)? };
            self.nodes.push(node);
        }
        self.cells.push((of_kind.shape, number));
        self.groups.push(group);
        self.places.push(place);
        Ok(())
    }
}
