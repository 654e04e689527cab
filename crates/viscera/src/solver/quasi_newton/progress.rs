//! Where the solve of a part stands on a device; its twin is `progress_record.wgsl`. The host only knows how large it is.

use bytemuck::{Pod, Zeroable};

use crate::settings::MOST_HISTORY;

/// Of pairs, by both places.
type Products = [[f32; MOST_HISTORY]; MOST_HISTORY];

/// `SolveState` of the kernels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SolveState {
    pub phase: u32,
    pub passes_left: u32,
    pub accepted: u32,
    pub ahead: u32,
    pub failures: u32,
    pub rejections: u32,
    pub calm: u32,
    pub count: u32,
    pub newest: u32,
    pub scale: f32,
    pub length: f32,
    pub slope: f32,
}

/// `PartProgress` of the kernels: two records, of which one is read while the other is written.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PartProgress {
    pub states: [SolveState; 2],
    pub sy: [Products; 2],
    pub yw: [Products; 2],
    pub was_rejected: u32,
    pub calm: u32,
    pub takes_trial: u32,
    pub slides: u32,
}
