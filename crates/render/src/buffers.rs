//! Buffers that begin with something in them.

use viscera::solver::gpu::Device;

/// Written by the queue: memory that is mapped when it is made would end the program where the device is
/// lost.
pub(crate) fn filled(
    device: &Device,
    label: &str,
    contents: &[u8],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let (wgpu, queue) = device.wgpu();
    let buffer = wgpu.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: contents.len() as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    queue.write_buffer(&buffer, 0, contents);
    buffer
}
