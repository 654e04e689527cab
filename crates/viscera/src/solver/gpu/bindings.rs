//! What kernels are bound to: slots of storage, and beside it the job of a dispatch, the constants of a step and its tools.

use super::device::Device;
use super::limits::JOB_STRIDE;
use super::slots::Slot;
use super::uniforms::{FrameConstants, Job};
use crate::solver::step::contacts::on_device::{GRID_ROW, IS_THERE, ToolRecords};

/// What kernels are bound to beside storage: where no kernel computes contact, no tools and distances.
const COUNT: usize = if IS_THERE { 4 } else { 2 };

/// How a kernel is bound to a slot.
pub(super) fn storage_entry(slot: Slot) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding: slot as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: slot.is_read_only() },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

/// The job of a dispatch, and the constants and tools of the step.
pub(super) fn uniform_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let visibility = wgpu::ShaderStages::COMPUTE;
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let uniform = |has_dynamic_offset| wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset,
        min_binding_size: None,
    };
    let distances = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Uint,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("job, frame and tools"),
        entries: &[
            entry(0, uniform(true)),
            entry(1, uniform(false)),
            entry(2, uniform(false)),
            entry(3, distances),
        ][..COUNT],
    })
}

/// Buffers of jobs, of the constants of a step and of its tools, and how kernels are bound to them.
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
        let nothing = IS_THERE.then(|| distances(device, &[0; GRID_ROW as usize]));
        let all = bind(device, [&jobs, &frame, &tools], nothing.as_ref());
        Self { jobs, frame, tools, all }
    }

    /// Puts jobs, one behind the other, from a place among all of them on [bytes].
    pub fn put_jobs(&self, device: &Device, place: u64, jobs: &[Job]) {
        for (number, job) in (0..).zip(jobs) {
            let place = place + JOB_STRIDE * number;
            device.queue.write_buffer(&self.jobs, place, bytemuck::bytes_of(job));
        }
    }

    /// Puts distances of closed surfaces, whole rows of words, in the place of those that were there.
    pub fn put_distances(&mut self, device: &Device, words: &[u32]) {
        let Self { jobs, frame, tools, .. } = &*self;
        let distances = IS_THERE.then(|| distances(device, words));
        self.all = bind(device, [jobs, frame, tools], distances.as_ref());
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
    distances: Option<&wgpu::TextureView>,
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
    ];
    let distances = distances.map(wgpu::BindingResource::TextureView);
    let entries: Vec<_> = (0..)
        .zip(resources.into_iter().chain(distances).take(COUNT))
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
        .collect();
    device.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("job, frame and tools"),
        layout: &uniform_layout(&device.device),
        entries: &entries,
    })
}
