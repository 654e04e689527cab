//! The record of the device's decisions during a step; its twin is control.wgsl.

#![allow(unsafe_code)]

use bytemuck::{Pod, Zeroable};

use crate::solver::cpu::products::LARGEST_WINDOW;
use crate::solver::step::control::PartGuard;

/// `Control` of control.wgsl, with as many parts as there are in place of one.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Control {
    pub small_step: u32,
    pub small_steps_done: u32,
    pub step: u32,
    pub rejected_step: u32,
    pub rejected: u32,
    pub parts: PartControl,
}

/// Where the parts' records begin [bytes].
pub const PARTS_START: usize = std::mem::offset_of!(Control, parts);

/// `PartControl` of control.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PartControl {
    pub sweeps: u32,
    pub next: u32,
    pub differences: u32,
    pub last_norm: f32,
    pub shares: [f32; LARGEST_WINDOW],
    pub gram: [[f32; LARGEST_WINDOW]; LARGEST_WINDOW],
    pub iteration: u32,
    pub omega: f32,
    pub radius: f32,
    pub last_change: f32,
    pub guard: PartGuard<f32>,
    pub is_broken: u32,
    pub pressed_step: u32,
}

// SAFETY: twelve fields of four bytes each, none of which leaves a gap, and any bits are a value of each.
unsafe impl Zeroable for PartGuard<f32> {}
// SAFETY: as above.
unsafe impl Pod for PartGuard<f32> {}

/// Bytes of `Control` for so many parts.
pub fn control_size(parts: usize) -> u64 {
    (PARTS_START + parts.max(1) * size_of::<PartControl>()) as u64
}

/// How many steps were rejected, out of the bytes of `Control`.
pub fn rejected_steps(control: &[u8]) -> u64 {
    let at = std::mem::offset_of!(Control, rejected);
    bytemuck::pod_read_unaligned::<u32>(&control[at..at + 4]).into()
}
