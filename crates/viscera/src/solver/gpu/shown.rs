//! What pictures show of tissue by colours: names, and what is kept for it.

use std::sync::OnceLock;

use super::uniforms::Job;
use crate::layout::Layout;
use crate::scalar::lanes::LANES;

/// Whether kernels are there: pages read each frame, and know values from there.
pub(super) const SHOWS_VALUES: bool = cfg!(not(target_arch = "wasm32"));

/// What colours may show of tissue on a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TissueValue {
    /// Distance from rest [m].
    Displacement,
    /// Largest principal stretch less one.
    Strain,
    /// Von Mises stress [Pa].
    Stress,
    /// Normal force of tools over area at rest [Pa].
    Pressure,
}

/// The mode of a job for stress.
const STRESS: u32 = 1;

/// Of strain, of stress, of vertices.
pub(super) const JOBS: usize = 3;

/// Jobs of the kernels here.
pub(super) fn jobs(layout: &Layout<f32>) -> [Job; JOBS] {
    let count = (LANES * layout.block_count()) as u32;
    let of = |count, mode| Job { count, mode, ..Job::default() };
    [of(count, 0), of(count, STRESS), of(layout.vertex_count() as u32, 0)]
}

/// What values are found by, made when a picture first asks for it.
#[derive(Default)]
pub(super) struct OfValues {
    /// A number of each lane of tetrahedra, and those around each vertex.
    pub tets: OnceLock<[wgpu::Buffer; 2]>,
    /// One over the area of each vertex.
    pub areas: OnceLock<wgpu::Buffer>,
}

impl OfValues {
    /// Bytes of its arrays.
    pub fn bytes(&self) -> u64 {
        let tets = self.tets.get().into_iter().flatten();
        tets.chain(self.areas.get()).map(wgpu::Buffer::size).sum()
    }
}
