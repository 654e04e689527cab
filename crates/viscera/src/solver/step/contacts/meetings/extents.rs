//! How much there is of everything, and what kernels call it.

use crate::layout::{LaidSkin, Layout};
use crate::settings::{HAS_MEETINGS, SolverSettings};

/// Vectors of a meeting; of a triangle, of a node of the tree and of an entry of the sorted list in a step.
pub const MEETING_VECTORS: usize = 7;
pub const TRIANGLE_VECTORS: usize = 2;
pub const NODE_VECTORS: usize = 2;

/// Words of rows of the skin in the table.
pub const SKIN_SAMPLE_WORDS: usize = 13;
pub const POINT_WORDS: usize = 8;
pub const TRIANGLE_WORDS: usize = 5;
pub const NODE_WORDS: usize = 4;
pub const TIE_WORDS: usize = 10;

/// A sample's site is a point and not the middle of a triangle.
pub const ON_POINT: u32 = 1 << 31;

/// Bits of a pass of the sort.
pub const DIGIT_BITS: u32 = 4;

/// Names and values that kernels share.
pub fn names() -> [(&'static str, u32); 10] {
    [
        ("MEETING_VECTORS", MEETING_VECTORS as u32),
        ("TRIANGLE_VECTORS", TRIANGLE_VECTORS as u32),
        ("NODE_VECTORS", NODE_VECTORS as u32),
        ("SKIN_SAMPLE_WORDS", SKIN_SAMPLE_WORDS as u32),
        ("POINT_WORDS", POINT_WORDS as u32),
        ("TRIANGLE_WORDS", TRIANGLE_WORDS as u32),
        ("NODE_WORDS", NODE_WORDS as u32),
        ("TIE_WORDS", TIE_WORDS as u32),
        ("ON_POINT", ON_POINT),
        ("DIGIT_BITS", DIGIT_BITS),
    ]
}

/// How much there is of everything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Meetings {
    pub samples: u32,
    pub ties: u32,
    pub points: u32,
    pub triangles: u32,
    /// Of the tree, and how many of them are leaves; levels above these.
    pub nodes: u32,
    pub leaves: u32,
    pub levels: u32,
}

impl Meetings {
    /// Of a layout whose tissue meets tissue on devices.
    pub fn new(layout: &Layout<f32>, settings: &SolverSettings) -> Option<Self> {
        let skin = layout.skin.as_ref().filter(|_| settings.meets_on_device())?;
        let (nodes, levels) = skin.tree.rows();
        Some(Self {
            samples: skin.samples.len() as u32,
            ties: skin.ties.len() as u32,
            points: skin.skin.points.len() as u32,
            triangles: skin.skin.triangles.len() as u32,
            nodes: nodes.len() as u32,
            leaves: levels.first().map_or(0, Vec::len) as u32,
            levels: levels.len().saturating_sub(1) as u32,
        })
    }

    /// The same, known to be none where no kernels are: such builds leave out what asks.
    #[inline]
    pub fn known(meetings: Option<Self>) -> Option<Self> {
        meetings.filter(|_| HAS_MEETINGS)
    }

    /// Samples and ties.
    pub fn count(self) -> u32 {
        self.samples + self.ties
    }

    /// Vectors behind the loads: of meetings, points, triangles, nodes, the list in two places, ties, and the reach of the step.
    pub fn extents(self) -> [u64; 8] {
        let count = u64::from(self.count());
        [
            MEETING_VECTORS as u64 * count,
            self.points.into(),
            TRIANGLE_VECTORS as u64 * u64::from(self.triangles),
            NODE_VECTORS as u64 * u64::from(self.nodes),
            count,
            count,
            self.ties.into(),
            1,
        ]
    }

    /// All of them.
    pub fn vectors(self) -> u64 {
        self.extents().iter().sum()
    }

    /// Where ties begin among them, after the meetings.
    pub fn first_torn(self) -> u64 {
        self.extents()[..6].iter().sum()
    }

    /// Passes of the sort, an even number: it ends where it began.
    pub fn passes(self) -> u32 {
        let bits = u32::BITS - self.triangles.leading_zeros();
        bits.div_ceil(DIGIT_BITS).next_multiple_of(2)
    }
}

/// The skin of a layout that has one.
pub fn skin_of(layout: &Layout<f32>) -> Option<&LaidSkin> {
    layout.skin.as_ref().filter(|_| HAS_MEETINGS)
}
