//! What a dispatch moves.

use crate::solver::gpu::slots::Slot;

/// What a dispatch moves.
#[derive(Clone, Debug, PartialEq)]
pub struct DispatchTraffic {
    /// The kernel.
    pub kernel: &'static str,
    /// What it cannot do without [B].
    pub compulsory: f64,
    /// What of it is written [B].
    pub written: f64,
    /// The same as `compulsory` where every gather goes to memory [B].
    pub moved: f64,
    /// The array that it moves most of; none where it does nothing in an ordinary step.
    pub most: Option<Slot>,
    /// Additions, multiplications and the like in single precision, estimated to within a factor of two.
    pub operations: f64,
}

/// Of no dispatch.
pub const NOTHING: DispatchTraffic = DispatchTraffic {
    kernel: "",
    compulsory: 0.0,
    written: 0.0,
    moved: 0.0,
    most: None,
    operations: 0.0,
};

impl DispatchTraffic {
    /// Adds so many of another.
    pub fn add(&mut self, other: &Self, times: u32) {
        let times = f64::from(times);
        self.compulsory += times * other.compulsory;
        self.written += times * other.written;
        self.moved += times * other.moved;
        self.operations += times * other.operations;
    }
}
