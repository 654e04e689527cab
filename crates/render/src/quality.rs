//! How much work a picture is worth.

use viscera::solver::gpu::Device;

/// How much work a picture is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quality {
    /// Four samples a pixel instead of one.
    pub smooth_edges: bool,
    /// Edge of the shadow map [texels]; without one there are no shadows.
    pub shadow: Option<u32>,
}

impl Quality {
    /// As cheap as it gets.
    pub fn plain() -> Self {
        Self { smooth_edges: false, shadow: None }
    }

    /// Smooth edges and shadows.
    pub fn fine() -> Self {
        Self { smooth_edges: true, shadow: Some(2048) }
    }

    /// Fine on graphics processors. Where a processor does their work, it should draw in a few
    /// hundredths of a second: one sample, small shadows.
    pub fn suited_to(device: &Device) -> Self {
        match device.wgpu().0.adapter_info().device_type {
            wgpu::DeviceType::Cpu => Self { smooth_edges: false, shadow: Some(512) },
            _ => Self::fine(),
        }
    }

    pub(crate) fn samples(self) -> u32 {
        if self.smooth_edges { 4 } else { 1 }
    }
}
