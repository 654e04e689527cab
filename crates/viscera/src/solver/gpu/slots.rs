//! Bindings of kernels, and the records that lie there.

use bytemuck::{Pod, Zeroable};

use crate::elements::kinds::{CONSTANTS, MOST};
use crate::layout::Layout;
use crate::scalar::{Vec3, vec3};

/// Numbers of the storage buffers in all kernels; bindings.wgsl has the same ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
#[allow(missing_docs)]
pub enum Slot {
    Tets = 0,
    Materials,
    CornerIndices,
    Offsets,
    Points,
    Copies,
    Multipliers,
    Loads,
    Velocities,
    Previous,
    Predicted,
    ExternalForces,
    Targets,
    Updates,
    StartStrain,
    Unknowns,
    Iterate,
    Older,
    Weights,
    Residuals,
    Mapped,
    PartialSums,
    Control,
    Anchors,
    Starts,
    VertexData,
    Table,
    SmallSteps,
    Falls,
    Levels,
    Multilevel,
    Pairs,
    Progress,
    Recovery,
    StageStart,
    Contact,
    ToolSums,
    FramePoints,
    Measured,
    Around,
    Meetings,
    Torn,
}

impl Slot {
    /// Whether kernels only read it.
    pub fn is_read_only(self) -> bool {
        use Slot::{Around, CornerIndices, Levels, Materials, Offsets, Table, Tets, Updates};
        let of_step = matches!(self, Offsets | Updates | Table | Levels | Around);
        of_step || matches!(self, Tets | Materials | CornerIndices)
    }
}

/// A range of one of the buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// The buffer of that number.
    Whole(Slot),
    /// Copies where [`Slot::CornerIndices`] or [`Slot::Offsets`] is asked for in a sweep.
    CopiesOf(Slot),
}

/// Load and hold of one vertex; `Update` of bindings.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Update {
    pub vertex: u32,
    pub is_pinned: u32,
    pub force: [f32; 3],
    pub place: [f32; 3],
    pub stiffness: f32,
    pub inertia: f32,
}

impl Update {
    /// Adds a spring to a place [m]: all of them pull like one to the mean of their places.
    pub fn add_spring(&mut self, stiffness: f32, target: Vec3<f32>) {
        let sum = self.stiffness + stiffness;
        let place = vec3(self.place[0], self.place[1], self.place[2]);
        self.place = match self.stiffness == 0.0 {
            true => target.to_array(),
            false => (place + (target - place) * (stiffness / sum)).to_array(),
        };
        self.stiffness = sum;
    }
}

/// An element that is no tetrahedron, as it stands in the table; lists that are longer than it has vertices repeat
/// its first.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Element {
    /// Its kind by the place in the list.
    pub kind: u32,
    pub part: u32,
    /// Where its first multiplier stands.
    pub multiplier: u32,
    /// The number of its anchor.
    pub anchor: u32,
    pub vertices: [u32; MOST],
    pub copies: [u32; MOST],
    /// Where its loads go.
    pub slots: [u32; MOST],
    pub constants: [f32; CONSTANTS],
}

/// Ranges of buffers begin at a multiple of this: the alignment [bytes] that devices may ask of a
/// binding.
pub const ALIGNMENT: u64 = 256;

/// A slot that lies in another slot's buffer: kernels that need a piece or two are bound to ranges, those that
/// would need too many to the whole.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    pub slot: Slot,
    pub owner: Slot,
    /// [bytes]
    pub start: u64,
    /// [bytes]
    pub size: u64,
}

/// Where the multipliers of a model, or a part, of so many vertices begin among its unknowns [bytes]: behind the
/// vertices there is room for one more.
pub fn multipliers_start(vertices: usize) -> u64 {
    (16 * vertices as u64 + 16).next_multiple_of(ALIGNMENT)
}

/// Bytes of all unknowns.
pub fn unknowns_size(layout: &Layout<f32>) -> u64 {
    multipliers_start(layout.vertex_count()) + 4 * (layout.multiplier_count as u64).max(1)
}
