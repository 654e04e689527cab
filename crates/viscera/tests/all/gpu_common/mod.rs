//! A shader run over records of numbers.

pub mod comparison;
pub mod functions;
pub mod inputs;

use viscera::solver::gpu::Device;
use wgpu::util::DeviceExt;

/// Threads of a workgroup.
const GROUP: usize = 64;

/// What shaders read and write: records of numbers, taken and put one after the other.
const RECORDS: &str = include_str!("records.wgsl");

/// What runs it.
pub struct Gpu(pub &'static Device);

impl Gpu {
    /// Runs `body` once for each record; it takes its numbers with `take()` and
    /// its like and puts `outputs` results. `library` holds the functions that it calls.
    pub fn map(
        &self,
        library: &str,
        body: &str,
        records: &inputs::Records,
        outputs: usize,
    ) -> Vec<f32> {
        let (inputs, count) = (records.size, records.each().len());
        let entry = format!(
            "const COUNT = {count}u;\nconst INPUTS = {inputs}u;\nconst OUTPUTS = {outputs}u;\n\
             @compute @workgroup_size({GROUP})\n\
             fn main(@builtin(global_invocation_id) id: vec3u) {{\n\
                 if id.x >= COUNT {{ return; }}\n\
                 next_input = id.x * INPUTS;\nnext_output = id.x * OUTPUTS;\n{body}\n}}\n"
        );
        let source = [library, RECORDS, &entry].concat();
        let (device, queue) = self.0.wgpu();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: Default::default(),
            cache: None,
        });
        let input = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents: bytemuck::cast_slice(&records.numbers),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let size = (4 * outputs * count) as u64;
        let buffer = |usage| {
            let mapped_at_creation = false;
            let descriptor =
                wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation };
            device.create_buffer(&descriptor)
        };
        let output = buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let readable = buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: input.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: output.as_entire_binding() },
            ],
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bind_group, &[]);
            pass.dispatch_workgroups(count.div_ceil(GROUP) as u32, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&output, 0, &readable, 0, size);
        queue.submit([encoder.finish()]);
        readable.map_async(wgpu::MapMode::Read, .., |result| result.expect("results come back"));
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
        let bytes = readable.get_mapped_range(..).expect("results are mapped");
        bytemuck::cast_slice(&bytes).to_vec()
    }
}
