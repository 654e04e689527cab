//! Entries of sections.

use super::kinds::kind_of;
use super::numbers::Numbers;
use crate::mesh::io::cells::{Cells, Shape};
use crate::mesh::io::error::{Fault, Place, ReadProblem};
use crate::mesh::io::lines::bad_word;
use crate::scalar::{Vec3, vec3};

/// Bytes of the shortest entry of a vertex or of an element, in text and in binary files: bounds what a file can hold, so
/// that no number in it can ask for more memory than its size warrants.
pub(super) const SHORTEST_VERTEX: [usize; 2] = [6, 24];
pub(super) const SHORTEST_ELEMENT: [usize; 2] = [4, 8];
pub(super) const SHORTEST_ENTITY: [usize; 2] = [2, 4];

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

/// The header of a block of version 4.
pub(super) struct Block {
    pub dimension: u64,
    pub tag: i64,
    /// The type of elements, or whether vertices have parameters.
    pub third: u64,
    pub count: u64,
}

impl Numbers<'_> {
    pub fn position(&mut self) -> Result<Vec3<f64>, Fault> {
        let mut coordinate = || self.float("a coordinate");
        Ok(vec3(coordinate()?, coordinate()?, coordinate()?))
    }

    /// The first of so many tags, the physical one; 0 without any.
    pub fn first_tag(&mut self, tags: u64) -> Result<u64, Fault> {
        let mut first = 0;
        for tag in 0..tags {
            if tag == 0 {
                first = self.natural("a physical tag, 0 or more")?;
            } else {
                self.whole("a tag")?;
            }
        }
        Ok(first)
    }

    /// Numbers of blocks and of entries.
    pub fn block_header(
        &mut self,
        what: &'static str,
        shortest: [usize; 2],
        is_new: bool,
    ) -> Result<[usize; 2], Fault> {
        self.record()?;
        let blocks = self.size("a number of blocks")?;
        let count = self.size("a count")?;
        if is_new {
            self.size("the lowest number")?;
            self.size("the highest number")?;
        }
        let blocks = self.check_count("blocks", blocks, SHORTEST_ENTITY)?;
        Ok([blocks, self.check_count(what, count, shortest)?])
    }

    pub fn entity(&mut self, is_new: bool) -> Result<Block, Fault> {
        self.record()?;
        let first = self.whole("a dimension or a tag")?;
        let second = self.whole("a dimension or a tag")?;
        let (dimension, tag) = if is_new { (first, second) } else { (second, first) };
        let dimension = u64::try_from(dimension).ok().filter(|dimension| *dimension <= 3);
        let Some(dimension) = dimension else {
            return Err(self.fault(bad_word("a dimension, 0 to 3", first.to_string().as_bytes())));
        };
        let third = self.natural("an element type, or whether there are parameters")?;
        Ok(Block { dimension, tag, third, count: self.size("a count")? })
    }

    pub fn expect_count(&self, what: &str, claimed: usize, found: usize) -> Result<(), Fault> {
        if claimed == found {
            return Ok(());
        }
        Err(self.fault(ReadProblem::CountMismatch { what: what.into(), claimed, found }))
    }
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
