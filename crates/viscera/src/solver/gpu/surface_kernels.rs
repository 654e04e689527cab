//! Kernels of surfaces, and the arrays that they are bound to.

use wgpu::BufferUsages;

use super::device::{Device, Pipeline};
use super::error::GpuError;
use super::shown::SHOWS_VALUES;
use crate::elements::text::kernel_text;

/// A kernel with its arrays.
#[derive(Debug)]
pub struct Ready {
    pub pipeline: wgpu::ComputePipeline,
    pub storage: wgpu::BindGroup,
}

/// Threads of a workgroup in surface.wgsl.
pub const WORKGROUP: u32 = 64;

/// Bytes of a vertex.
pub const STRIDE: u64 = 32;

/// Numbers of the arrays in surface.wgsl and surface_values.wgsl, and what kernels only read.
pub const POINTS: usize = 0;
pub const VALUES: usize = 6;
pub const BINDINGS: [(&str, bool); 7] = [
    ("positions", true),
    ("weights of the surface", true),
    ("vertices of the surface", true),
    ("triangles of the surface", true),
    ("surface", false),
    ("surface at rest", true),
    ("values of the surface", false),
];

pub fn check_size(device: &Device, needed: u64, vertices: usize) -> Result<(), GpuError> {
    let limits = device.limits();
    let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    if needed <= limit {
        return Ok(());
    }
    let largest = (vertices as f64 * limit as f64 / needed as f64) as u64;
    Err(GpuError::SurfaceTooLarge { needed, limit, name: device.name().to_owned(), largest })
}

pub fn buffer(device: &Device, label: &str, size: u64, usage: BufferUsages) -> wgpu::Buffer {
    device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        // A binding is never empty.
        size: size.max(STRIDE),
        usage,
        mapped_at_creation: false,
    })
}

pub fn filled(device: &Device, label: &str, bytes: &[u8], usage: BufferUsages) -> wgpu::Buffer {
    let buffer = buffer(device, label, bytes.len() as u64, usage);
    device.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// A kernel with its arrays by their numbers.
pub fn prepare(device: &Device, entry: &'static str, arrays: &[(usize, &wgpu::Buffer)]) -> Ready {
    let mut known = device.pipelines.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let made = known.entry(entry.to_owned()).or_insert_with(|| compile(device, entry, arrays));
    let entries: Vec<_> = arrays
        .iter()
        .map(|&(i, array)| wgpu::BindGroupEntry {
            binding: i as u32,
            resource: array.as_entire_binding(),
        })
        .collect();
    let storage = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(entry),
        layout: &made.storage,
        entries: &entries,
    });
    Ready { pipeline: made.pipeline.clone(), storage }
}

fn compile(device: &Device, entry: &'static str, arrays: &[(usize, &wgpu::Buffer)]) -> Pipeline {
    let wgpu = &device.device;
    let text = match arrays.iter().any(|(i, _)| *i == VALUES) {
        true if SHOWS_VALUES => kernel_text!("surface_values.wgsl"),
        _ => kernel_text!("surface.wgsl"),
    };
    let module = wgpu.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(entry),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let entries: Vec<_> = arrays
        .iter()
        .map(|&(i, _)| wgpu::BindGroupLayoutEntry {
            binding: i as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: BINDINGS[i].1 },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        })
        .collect();
    let storage = wgpu.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some(entry),
        entries: &entries,
    });
    let layout = wgpu.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(entry),
        bind_group_layouts: &[Some(&storage)],
        immediate_size: 0,
    });
    let pipeline = wgpu.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: Some(&layout),
        module: &module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    Pipeline { pipeline, storage }
}
