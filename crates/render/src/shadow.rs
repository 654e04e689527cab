//! The map of what the key light sees.

use viscera::solver::gpu::Device;

use crate::pipelines::Pipelines;
use crate::target::{DEPTH_FORMAT, depth_of_pass};

/// Depths as seen from the key light.
#[derive(Debug)]
pub(crate) struct ShadowMap {
    view: wgpu::TextureView,
    /// Of the map [texels]; nothing where it only stands in for one.
    pub edge: Option<u32>,
    pub bound: wgpu::BindGroup,
}

impl ShadowMap {
    /// Of an edge [texels], or of the device's largest.
    pub fn new(device: &Device, pipelines: &Pipelines, edge: Option<u32>) -> Self {
        let wgpu = device.wgpu().0;
        let edge = edge.map(|edge| edge.clamp(1, device.limits().max_texture_dimension_2d));
        let side = edge.unwrap_or(1);
        let texture = wgpu.create_texture(&wgpu::TextureDescriptor {
            label: Some("shadow"),
            size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = texture.create_view(&Default::default());
        // Between four neighbours: softer by one texel.
        let sampler = wgpu.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            compare: Some(wgpu::CompareFunction::LessEqual),
            ..Default::default()
        });
        let bound = wgpu.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shadow"),
            layout: &pipelines.shadow_layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&view),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::Sampler(&sampler),
                },
            ],
        });
        Self { view, edge, bound }
    }

    /// A pass that draws the map anew.
    pub fn pass<'e>(&self, encoder: &'e mut wgpu::CommandEncoder) -> wgpu::RenderPass<'e> {
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow"),
            color_attachments: &[],
            depth_stencil_attachment: Some(depth_of_pass(&self.view, wgpu::StoreOp::Store)),
            ..Default::default()
        })
    }
}
