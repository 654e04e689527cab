//! Kernels compiled for a device.

use super::bindings::{storage_entry, uniform_layout};
use super::device::{Device, Pipeline};
use super::kernels::{Kernel, Variant, key, source};

/// Compiles a kernel, or finds it compiled.
pub fn pipeline(device: &Device, kernel: &Kernel, variant: Variant) -> Pipeline {
    let key = key(kernel, variant);
    let mut known = device.pipelines.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(pipeline) = known.get(&key) {
        return pipeline.clone();
    }
    let made = compile(device, kernel, variant, &key);
    known.insert(key, made.clone());
    made
}

fn compile(device: &Device, kernel: &Kernel, variant: Variant, label: &str) -> Pipeline {
    let wgpu = &device.device;
    let module = wgpu.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(source(kernel, variant).into()),
    });
    let entries: Vec<_> = kernel.slots.iter().map(|&slot| storage_entry(slot)).collect();
    let storage = wgpu.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some(label),
        entries: &entries,
    });
    let uniforms = uniform_layout(wgpu);
    let layout = wgpu.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[Some(&storage), Some(&uniforms)],
        immediate_size: 0,
    });
    let pipeline = wgpu.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        module: &module,
        entry_point: Some(kernel.entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    Pipeline { pipeline, storage }
}
