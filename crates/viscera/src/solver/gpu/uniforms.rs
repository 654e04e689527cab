//! The job of a dispatch and the constants of a step: the uniforms of every kernel.

use bytemuck::{Pod, Zeroable};

/// `Job` of bindings.wgsl.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Job {
    pub first: u32,
    pub count: u32,
    pub set_first: u32,
    pub multiplier_offset: u32,
    pub viscous_offset: u32,
    pub is_viscous: u32,
    pub mode: u32,
    pub parameter: f32,
    pub tet_count: u32,
}

/// `Frame` of bindings.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct FrameConstants {
    pub gravity: [f32; 3],
    pub dt: f32,
    pub squared_dt: f32,
    pub inverse_dt: f32,
    pub rescale: f32,
    pub relaxation_multipliers: f32,
    pub relaxation_positions: f32,
    pub update_count: u32,
    pub part_count: u32,
    pub chebyshev_damping: f32,
}
