//! The job of a dispatch, the constants of a step and its tools: what every kernel is bound to beside storage.

use bytemuck::{Pod, Zeroable};

use super::device::Device;
use super::kernels;
use super::limits::JOB_STRIDE;
use crate::solver::step::contacts::on_device::{GRID_ROW, ToolRecords};

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

/// Their buffers, and how kernels are bound to them.
#[derive(Debug)]
pub struct Uniforms {
    pub jobs: wgpu::Buffer,
    pub frame: wgpu::Buffer,
    pub tools: wgpu::Buffer,
    pub all: wgpu::BindGroup,
}

impl Uniforms {
    /// For so many jobs.
    pub fn new(device: &Device, job_count: u64) -> Self {
        let make = |label, size| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let jobs = make("jobs", JOB_STRIDE * job_count.max(1));
        let frame = make("frame", size_of::<FrameConstants>() as u64);
        let tools = make("tools", size_of::<ToolRecords>() as u64);
        let nothing = distances(device, &[0; GRID_ROW as usize]);
        let all = bind(device, [&jobs, &frame, &tools], &nothing);
        Self { jobs, frame, tools, all }
    }

    /// Puts distances of closed surfaces, whole rows of words, in the place of those that were there.
    pub fn put_distances(&mut self, device: &Device, words: &[u32]) {
        let Self { jobs, frame, tools, .. } = &*self;
        self.all = bind(device, [jobs, frame, tools], &distances(device, words));
    }
}

/// Words as a picture: textures are no storage buffers, of which kernels have eight.
fn distances(device: &Device, words: &[u32]) -> wgpu::TextureView {
    let size = wgpu::Extent3d {
        width: GRID_ROW,
        height: (words.len() as u32 / GRID_ROW).max(1),
        depth_or_array_layers: 1,
    };
    let texture = device.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("distances"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let rows = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(4 * GRID_ROW),
        rows_per_image: None,
    };
    device.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(words), rows, size);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

fn bind(
    device: &Device,
    [jobs, frame, tools]: [&wgpu::Buffer; 3],
    distances: &wgpu::TextureView,
) -> wgpu::BindGroup {
    let one_job = wgpu::BufferBinding {
        buffer: jobs,
        offset: 0,
        size: std::num::NonZero::new(size_of::<Job>() as u64),
    };
    let resources = [
        wgpu::BindingResource::Buffer(one_job),
        frame.as_entire_binding(),
        tools.as_entire_binding(),
        wgpu::BindingResource::TextureView(distances),
    ];
    let entries: Vec<_> = (0..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
        .collect();
    device.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("job, frame and tools"),
        layout: &kernels::uniform_layout(&device.device),
        entries: &entries,
    })
}
