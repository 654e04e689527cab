//! Buffers that begin with something in them.

use std::sync::mpsc;

use viscera::solver::gpu::Device;

use crate::error::RenderError;

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

/// Memory that the host reads.
pub(crate) fn readable(device: &Device, label: &str, size: u64) -> wgpu::Buffer {
    device.wgpu().0.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Submits commands that fill readable memory, waits for the device and looks at it.
pub(crate) fn read<T>(
    device: &Device,
    encoder: wgpu::CommandEncoder,
    copy: &wgpu::Buffer,
    look: impl FnOnce(&[u8]) -> T,
) -> Result<T, RenderError> {
    let (wgpu, queue) = device.wgpu();
    queue.submit([encoder.finish()]);
    let lost = || RenderError::Lost { name: device.name().to_owned() };
    let (sender, receiver) = mpsc::channel();
    copy.slice(..).map_async(wgpu::MapMode::Read, move |result| {
        // Nobody listens where waiting has failed.
        let _ = sender.send(result.is_ok());
    });
    let waited = wgpu.poll(wgpu::PollType::wait_indefinitely());
    device.check()?;
    if waited.is_err() || !receiver.try_recv().unwrap_or(false) {
        return Err(lost());
    }
    let bytes = copy.slice(..).get_mapped_range().map_err(|_| lost())?;
    Ok(look(&bytes))
}
