//! Errors of reading and writing mesh files.

use std::fmt;

use super::parsed::{Format, Patch};
use super::text::printable;
use crate::mesh::{MeshError, MeshPlace};

/// Why a file could not be read: which file, where in it, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}{}: {}", PlaceSuffix(*place), Printable(problem))]
pub struct ReadError {
    /// The name under which the bytes were given.
    pub file: String,
    /// Where in it, if the problem has a place.
    pub place: Option<Place>,
    /// What is wrong.
    pub problem: ReadProblem,
}

impl ReadError {
    /// The line, counting from 1, where the problem has one.
    pub fn line(&self) -> Option<usize> {
        match self.place {
            Some(Place::Line(line)) => Some(line),
            _ => None,
        }
    }
}

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of text, counting from 1.
    Line(usize),
    /// A byte, counting from 0, where numbers stand as they are in memory.
    Byte(usize),
}

struct PlaceSuffix(Option<Place>);

impl fmt::Display for PlaceSuffix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(Place::Line(line)) => write!(f, ", line {line}"),
            Some(Place::Byte(byte)) => write!(f, ", byte {byte}"),
            None => Ok(()),
        }
    }
}

/// A problem on one line: it tells names and words of the file.
struct Printable<'a>(&'a ReadProblem);

impl fmt::Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&printable(&self.0.to_string()))
    }
}

/// The fault of a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadProblem {
    /// No bytes, or only blanks.
    #[error("the file is empty; export the mesh again")]
    Empty,
    /// The unit of the file is not a length.
    #[error("a unit of {meters} m is not a length; give a number above 0, 0.001 for millimetres")]
    Unit {
        /// The unit given `[m]`.
        meters: f64,
    },
    /// Neither content nor extension identifies a format.
    #[error(
        "not a mesh file known here; known are Gmsh (.msh), VTK (.vtk, .vtu, .vtp), TetGen (.ele, .node), Medit (.mesh), \
        Abaqus (.inp), and surfaces in OBJ, STL and PLY"
    )]
    UnknownFormat,
    /// A known format, or a variant of one, that is not read.
    #[error("{found} cannot be read here; {advice}")]
    Unsupported {
        /// What the file is.
        found: String,
        /// How to get a file that can be read.
        advice: &'static str,
    },
    /// The bytes stop before the data does.
    #[error("the file ends inside {reading}; it was cut short, copy or export it again")]
    UnexpectedEnd {
        /// What was being read.
        reading: String,
    },
    /// A part that a mesh needs is not there.
    #[error("the file has no {what}; export the mesh again with it")]
    Missing {
        /// The part.
        what: String,
    },
    /// A part that may occur once occurs again.
    #[error("a second {what}; keep one of them, or merge them before the export")]
    SecondPart {
        /// The part.
        what: String,
    },
    /// More entries are announced than the rest of the file can hold.
    #[error(
        "{claimed} {what} are announced, but only {bytes_left} bytes follow; the file was cut \
        short or the number is wrong, export it again"
    )]
    TooManyClaimed {
        /// What is counted.
        what: &'static str,
        /// The number announced.
        claimed: u64,
        /// Bytes after the announcement.
        bytes_left: usize,
    },
    /// Two counts that must agree do not.
    #[error("{what}: {claimed} are announced, {found} are there; export the mesh again")]
    CountMismatch {
        /// What is counted.
        what: String,
        /// The number announced, or needed.
        claimed: usize,
        /// The number found.
        found: usize,
    },
    /// A word is not what belongs in its place.
    #[error("expected {expected}, found `{found}`; correct the line or export the mesh again")]
    BadWord {
        /// What belongs there.
        expected: &'static str,
        /// What is there, shortened; empty at the end of a line.
        found: String,
    },
    /// An element refers to a vertex number that the file does not list.
    #[error("{element} refers to vertex {vertex}; the file has {vertex_count}{note}; \
        export all vertices", note = NumbersNote { numbers: *.numbers, count: *.vertex_count })]
    UnknownVertex {
        /// The element, with its number in the file.
        element: String,
        /// The vertex number it names.
        vertex: String,
        /// How many vertices the file lists.
        vertex_count: usize,
        /// Lowest and highest vertex number in the file, if it has any.
        numbers: Option<(u64, u64)>,
    },
    /// Two vertices have the same number.
    #[error("vertex number {number} is used twice; renumber the vertices")]
    RepeatedNumber {
        /// The number.
        number: u64,
    },
    /// No element of the file is a solid.
    #[error(
        "the file has no tetrahedra, and nothing that could be cut into some (it has {others}); \
        export its volume elements as well"
    )]
    NoTets {
        /// What the file has instead.
        others: String,
    },
    /// A surface where tissue is needed.
    #[error(
        "this {format} file is a surface of {triangles} triangles, and tissue needs tetrahedra; fill it by \
        `viscera mesh tetrahedralize`"
    )]
    OnlySurface {
        /// The format of the file.
        format: Format,
        /// How many triangles it has.
        triangles: usize,
    },
    /// The file is not well-formed XML.
    #[error("not well-formed XML ({reason}); the file is damaged or cut short, export it again")]
    Xml {
        /// What the XML parser says.
        reason: String,
    },
    /// The numbers could be read, but are no mesh. Indices count from 0, whatever the file does.
    #[error("{0}{note}", note = CountingNote(.0.place()))]
    Mesh(MeshError),
}

/// Which numbers vertices have, where they do not just count from 1.
struct NumbersNote {
    numbers: Option<(u64, u64)>,
    count: usize,
}

impl fmt::Display for NumbersNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.numbers {
            Some((low, high)) if (low, high) != (1, self.count as u64) => {
                write!(f, ", numbered {low} to {high}")
            }
            _ => Ok(()),
        }
    }
}

/// The lines of many files number elements differently from the mesh.
struct CountingNote(MeshPlace);

impl fmt::Display for CountingNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            MeshPlace::Whole => Ok(()),
            MeshPlace::Vertex(_) | MeshPlace::Tet(_) => f.write_str(" (counting from 0)"),
        }
    }
}

/// A problem and its place; becomes a [`ReadError`] where the file's name is known.
pub(super) struct Fault {
    pub place: Option<Place>,
    pub problem: ReadProblem,
}

impl Fault {
    pub fn at(line: usize, problem: ReadProblem) -> Self {
        Self { place: Some(Place::Line(line)), problem }
    }

    /// What only programs with the feature `formats` read.
    pub fn not_built() -> Self {
        let found = "this format".to_owned();
        let advice = "build with the feature `formats` of viscera, or prepare the file by the page's second module";
        Self::whole_file(ReadProblem::Unsupported { found, advice })
    }

    pub fn whole_file(problem: ReadProblem) -> Self {
        Self { place: None, problem }
    }
}

/// Why arrays could not be written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// An array does not have one entry for each point, or for each cell.
    #[error("array `{array}` has {found} entries; {wanted} are needed, one for each {what}")]
    Length {
        /// The array's name.
        array: String,
        /// "point" or "cell".
        what: &'static str,
        /// Entries needed.
        wanted: usize,
        /// Entries given.
        found: usize,
    },
    /// A value is not finite in single precision; other programs refuse to read such a file.
    #[error(
        "array `{array}`, entry {entry} is not a finite number in single precision; \
        write an earlier state, or leave the array out"
    )]
    NonFinite {
        /// The array's name.
        array: String,
        /// The entry, counting from 0.
        entry: usize,
    },
    /// A cell refers to a point that does not exist.
    #[error("cell {cell} refers to point {point}; there are {point_count}")]
    IndexOutOfRange {
        /// The cell, counting from 0.
        cell: usize,
        /// The point it names.
        point: u32,
        /// How many points there are.
        point_count: usize,
    },
    /// A patch has a vertex that the mesh does not have.
    #[error("patch `{patch}` has vertex {vertex}; the mesh has {vertex_count}")]
    UnknownVertex {
        /// The patch's name.
        patch: String,
        /// The vertex, counting from 0.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A number that the format has no room for.
    #[error("{what} {value} has no room in {format}, which ends at {limit}; write another format")]
    TooLarge {
        /// What the number is.
        what: &'static str,
        /// The number.
        value: u64,
        /// The largest that has room.
        limit: u64,
        /// The format.
        format: &'static str,
    },
    /// A surface without triangles, which the format cannot hold.
    #[error("surface `{surface}` has no triangles; leave it out")]
    NoTriangles {
        /// The surface's name.
        surface: String,
    },
    /// A colour that is none.
    #[error("the colour of surface `{surface}` has a component outside 0 to 1")]
    Color {
        /// The surface's name.
        surface: String,
    },
    /// Times of frames that do not go forward from 0 or later.
    #[error(
        "frame {frame} is at {time} s; times begin at 0 or later, and each is after the one before"
    )]
    Time {
        /// The frame, counting from 0.
        frame: usize,
        /// Its time [s].
        time: f32,
    },
}

/// Refuses a patch with vertices that a mesh does not have.
pub(super) fn check_patch(patch: &Patch, vertex_count: usize) -> Result<(), WriteError> {
    match patch.vertices.iter().find(|&&vertex| vertex as usize >= vertex_count) {
        Some(&vertex) => {
            let patch = patch.name.clone();
            Err(WriteError::UnknownVertex { patch, vertex, vertex_count })
        }
        None => Ok(()),
    }
}
