//! Draws surfaces of the solver's into a texture.

use bytemuck::{Pod, Zeroable};
use viscera::scalar::Vec3;
use viscera::solver::gpu::{Device, GpuSurface};
use viscera_picture::Color;

use crate::orbit::Orbit;

/// What the depth of a picture is kept in.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// How tissue is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Where the viewer is.
    pub orbit: Orbit,
    /// Width of the picture over its height.
    pub aspect: f64,
    /// The tissue's colour.
    pub color: Color,
}

/// `View` of surface.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct View {
    position: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
    backward: [f32; 4],
    lens: [f32; 4],
    color: [f32; 4],
}

/// Draws into textures of one format.
#[derive(Debug)]
pub struct Renderer {
    queue: wgpu::Queue,
    pipeline: wgpu::RenderPipeline,
    view: wgpu::Buffer,
    bound: wgpu::BindGroup,
    /// Whether colours are written as sRGB values: the format does not do so itself.
    encodes: bool,
}

impl Renderer {
    /// For targets of this format with a depth of [`DEPTH_FORMAT`].
    pub fn new(device: &Device, format: wgpu::TextureFormat) -> Self {
        let (wgpu, queue) = device.wgpu();
        let module = wgpu.create_shader_module(wgpu::include_wgsl!("surface.wgsl"));
        let pipeline = wgpu.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("tissue"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("place"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[Some(GpuSurface::vertex_layout())],
            },
            // Both sides: a surface that has turned inside out must not become invisible.
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Less),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("shade"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let view = wgpu.create_buffer(&wgpu::BufferDescriptor {
            label: Some("view"),
            size: size_of::<View>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let bound = wgpu.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("view"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: view.as_entire_binding() }],
        });
        Self { queue: queue.clone(), pipeline, view, bound, encodes: !format.is_srgb() }
    }

    /// Says from where, for the pictures that are drawn from now on.
    pub fn look(&self, look: &Look) {
        let [right, up, backward] = look.orbit.axes();
        let four = |v: Vec3<f64>| [v.x as f32, v.y as f32, v.z as f32, 0.0];
        let [x, y] = Orbit::lens(look.aspect);
        let distance = look.orbit.distance;
        let Color { r, g, b } = look.color;
        let view = View {
            position: four(look.orbit.position()),
            right: four(right),
            up: four(up),
            backward: four(backward),
            lens: [x as f32, y as f32, (0.01 * distance) as f32, (100.0 * distance) as f32],
            color: [r, g, b, if self.encodes { 1.0 } else { 0.0 }],
        };
        self.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
    }

    /// Draws a surface in a pass whose target and depth have the renderer's formats.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, surface: &GpuSurface) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bound, &[]);
        pass.set_vertex_buffer(0, surface.vertices().slice(..));
        pass.set_index_buffer(surface.indices().slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..surface.index_count(), 0, 0..1);
    }
}
