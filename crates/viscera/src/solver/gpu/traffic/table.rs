//! What a table says of a kernel: what it reads and writes, one line an array, and how much it computes.
//!
//! Rows of four numbers count whole, whether or not the fourth is used. Constants of a step, materials and single words of
//! records are left out, and what inputs hold or push: a few vertices. Operations are counted in the kernels' text, a square
//! root or a division as one: an estimate to within a factor of two.

use crate::solver::gpu::kernels::Kernel;
use crate::solver::gpu::layout::{LINE_SUMS, PIECE_SUMS, PRODUCTS};
use crate::solver::gpu::slots;
use crate::solver::quasi_newton::progress::{PartProgress, SolveState};

pub use crate::solver::gpu::kernels;
pub use crate::solver::gpu::slots::Slot::{self, *};
pub use crate::solver::step::modes::*;
pub use Count::*;

/// What there is so many of; `Job` of those that a dispatch is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count {
    Never,
    Part,
    Vertex,
    Tet,
    ViscousTet,
    ViscousCorner,
    /// Springs, attachments.
    Element,
    /// Of tetrahedra and elements, four each: their loads.
    Corner,
    Copy,
    JobTet,
    JobCorner,
    JobMultiplier,
    /// Tetrahedra of viscous tissue.
    JobStrain,
    JobElement,
    Multiplier,
    /// Of the long vector.
    Number,
    /// Numbers of Anderson's history.
    Difference,
    /// Workgroups that work on the long vector.
    Group,
    /// Pieces of sums, and how often each is read where every workgroup of a part adds all of its part's up.
    Piece,
    ElementPiece,
    VertexPiece,
    PieceByPiece,
    PieceByVertexPiece,
    PieceByGroup,
    VertexPieceByVertexPiece,
    /// A vertex of each pair that is kept, and of each but the newest.
    VertexPair,
    OlderPair,
    /// A vertex, or a piece, of each five pairs whose products are summed at once.
    VertexChunk,
    PieceChunk,
    PieceChunkByPiece,
    /// Nodes of the finest level; of all others; of all but dense ones; of those all but the finest; all.
    FineNode,
    CoarseNode,
    OrdinaryNode,
    CoarseBlock,
    Node,
    /// Vertices and nodes that have an inverse of three by three.
    Block,
    /// Weights between vertices and levels.
    FineSource,
    CoarseSource,
    VertexSource,
    Parent,
    Up,
    /// Tables of what stiffness is summed of.
    Share,
    Entry,
    TetGroup,
    GroupEntry,
    PairRow,
    DenseNumber,
    DenseProduct,
    /// Of recovered-gradient tetrahedra: themselves, all others, their corners, loads of the others and of elements; domains
    /// and eight of these; entries of rings; clusters and workgroups of them, and these for each piece of vertices.
    RecoveredTet,
    PlainTet,
    RecoveredCorner,
    PlainCorner,
    Place,
    PlaceGroup,
    RingEntry,
    PlaceCluster,
    Average,
    AverageByVertexPiece,
    /// The same where their tissue is viscous.
    ViscousPlace,
    ViscousPlaceCorner,
    ViscousRingEntry,
    /// Of a dispatch for some pieces: tetrahedra and their corners, elements, vertices, pieces.
    PieceTet,
    PieceRecoveredTet,
    PieceRecoveredCorner,
    PieceCorner,
    PieceElement,
    PieceVertex,
    JobPiece,
    /// Samples of the surface, their corners, and workgroups that sum their forces.
    Sample,
    SampleCorner,
    /// A vertex, where there are samples.
    SampleVertex,
    SampleGroup,
    /// Of the skin on which tissue meets tissue: points, triangles and their corners, nodes and leaves of its tree; samples with
    /// ties, and their corners.
    SkinPoint,
    SkinTriangle,
    SkinCorner,
    SkinNode,
    SkinLeaf,
    Meeting,
    MeetingCorner,
    /// Vertices of clusters of tetrahedra.
    JobClusterVertex,
    JobCluster,
}

/// An array of a kernel.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    pub slot: Slot,
    pub bytes: u32,
    /// How many rows there are.
    pub each: Count,
    /// How many the kernel asks for.
    pub by: Count,
    pub is_written: bool,
    /// Bits of the job's mode of which one must be there; none for all modes.
    pub modes: u32,
}

impl Line {
    /// The same, of which every row is asked for by so many.
    pub const fn by(self, by: Count) -> Self {
        Self { by, ..self }
    }

    pub const fn when(self, modes: u32) -> Self {
        Self { modes, ..self }
    }
}

pub const fn r(slot: Slot, bytes: u32, each: Count) -> Line {
    Line { slot, bytes, each, by: each, is_written: false, modes: 0 }
}

pub const fn w(slot: Slot, bytes: u32, each: Count) -> Line {
    Line { is_written: true, ..r(slot, bytes, each) }
}

/// What is read once more: nothing of it is compulsory.
pub const fn again(slot: Slot, bytes: u32, by: Count) -> Line {
    r(slot, bytes, Never).by(by)
}

/// Of a kernel.
pub struct Entry {
    pub kernel: Kernel,
    /// Operations of each.
    pub operations: (u32, Count),
    /// Modes in which it does nothing in an ordinary step.
    pub idle: u32,
    pub lines: &'static [Line],
}

/// Kernels with operations of each of something, the modes in which they do nothing, and their lines.
macro_rules! table {
    ($($kernel:ident, $operations:literal each $count:ident $(, idle $($idle:ident)|+)?: [$($line:expr),* $(,)?];)*) => {
        pub const TABLE: &[Entry] = &[$(Entry {
            kernel: kernels::$kernel,
            operations: ($operations, $count),
            idle: 0 $($(| $idle)+)?,
            lines: &[$($line),*],
        }),*];
    };
}

/// A row of four numbers; constants of a tetrahedron; places of its corners; words and numbers.
pub const ROW: u32 = 16;
pub const TET: u32 = 60;
pub const CORNERS: u32 = 16;
pub const WORD: u32 = 4;
pub const STRAIN: u32 = 24;
pub const ELEMENT: u32 = size_of::<slots::Element>() as u32;
/// Rows of a recovered-gradient tetrahedron at rest and of a domain, its inverse rest shape, and a matrix by columns.
pub const FRAME: u32 = 68;
pub const PLACE: u32 = 32;
pub const SHAPE: u32 = 36;
pub const MATRIX: u32 = 3 * ROW;
/// Rows of pieces, of parts of levels, and of what stands in tables of levels.
pub const PIECE: u32 = 16;
pub const LEVELS_PART: u32 = 20;
pub const WEIGHT: u32 = 8;
pub const SHARE: u32 = 32;
pub const ENTRY: u32 = 40;
pub const GROUP: u32 = 28;
pub const INVERSE: u32 = 24;
pub const VECTOR: u32 = 12;
/// Sums of a piece; those that a verdict reads, and the end of a solve; those of a line.
pub const SUMS: u32 = 4 * PIECE_SUMS as u32;
pub const OF_TRIAL: u32 = 20;
pub const OF_END: u32 = 8;
pub const OF_POTENTIAL: u32 = 28;
pub const LINE: u32 = 4 * LINE_SUMS as u32;
pub const OF_PRODUCTS: u32 = 4 * PRODUCTS as u32;
/// One of the two records of a part, and its short half.
pub const RECORD: u32 = size_of::<PartProgress>() as u32 / 2;
pub const STATE: u32 = size_of::<SolveState>() as u32;

pub(super) use table;
