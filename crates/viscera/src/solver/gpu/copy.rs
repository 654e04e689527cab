//! How fast a device copies memory: the measure that sweeps are held against.

use wgpu::BufferUsages;

use super::clock::Clock;
use super::device::Device;
use super::error::GpuError;
use super::limits::MOST_GROUPS;
use super::reading;

/// Source and target [B each]: beyond the caches of most devices, and what every device can bind.
const COPIED: u64 = 128 << 20;

/// Threads of a workgroup in copy.wgsl, and what each of them copies [B].
const WORKGROUP: u64 = 256;
const EACH: u64 = 16;

/// Copies one buffer to another on a device.
#[derive(Debug)]
pub struct MemoryCopy {
    device: Device,
    pipeline: wgpu::ComputePipeline,
    storage: wgpu::BindGroup,
    groups: u32,
}

impl MemoryCopy {
    /// Makes room for both.
    pub fn new(device: &Device) -> Result<Self, GpuError> {
        let limits = device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let groups = (COPIED.min(limit) / (WORKGROUP * EACH)).min(MOST_GROUPS.into()) as u32;
        let wgpu = &device.device;
        let buffer = |label| {
            wgpu.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: u64::from(groups) * WORKGROUP * EACH,
                usage: BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let (source, target) = (buffer("source"), buffer("target"));
        let module = wgpu.create_shader_module(wgpu::include_wgsl!("copy.wgsl"));
        let pipeline = wgpu.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("copy"),
            layout: None,
            module: &module,
            entry_point: Some("copy"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let storage = wgpu.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("copy"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: source.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: target.as_entire_binding() },
            ],
        });
        // Memory may have been too little.
        device.check()?;
        Ok(Self { device: device.clone(), pipeline, storage, groups })
    }

    /// Bytes that one copy reads and writes.
    pub fn bytes(&self) -> u64 {
        2 * u64::from(self.groups) * WORKGROUP * EACH
    }

    /// So many copies, one after the other, and waits for them. Returns what they took by the device's
    /// clock [s]; nothing where it has none.
    pub fn time(&self, count: u32) -> Result<Option<f64>, GpuError> {
        let clock = Clock::new(&self.device, 2);
        let marks = clock.as_ref().map(|clock| clock.around(0)).unwrap_or_default();
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("copies") };
        let mut encoder = self.device.device.create_command_encoder(&descriptor);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("copies"),
                timestamp_writes: marks.writes(),
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.storage, &[]);
            for _ in 0..count {
                pass.dispatch_workgroups(self.groups, 1, 1);
            }
        }
        self.device.queue.submit([encoder.finish()]);
        match clock {
            Some(clock) => Ok(Some(clock.read(2)?[1])),
            None => reading::wait(&self.device).map(|()| None),
        }
    }
}
