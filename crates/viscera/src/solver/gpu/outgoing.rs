//! What is on its way to the device: inputs and dispatches of steps, sent together.
//!
//! ```text
//! step 1              step 2                        step 3
//! queue writes | pass | copies of its inputs | pass | copies | pass |   one submission
//!                            ^------- staged: written at once before it
//! ```
//!
//! A queue's writes take effect before all of the next submission. Inputs of a later step in the same one therefore wait in
//! memory of their own, and are copied where its pass begins.

use super::clock::Marks;
use super::device::Device;

/// Dispatches in one submission. Drivers reset a device whose submission takes some seconds. Reckoned, not
/// measured: one of a million tetrahedra moves some 0.15 GB, half a millisecond at 300 GB/s, so that 1024 take half
/// a second. Smaller, and submissions would count beside the work of small meshes.
pub(super) const MOST_DISPATCHES: usize = 1024;

/// Inputs that wait in one submission [B]. Where whole organs are held, steps are sent one by one.
const MOST_STAGED: u64 = 16 << 20;

/// A dispatch ready to be sent.
pub(super) struct Ready {
    pub pipeline: wgpu::ComputePipeline,
    pub storage: wgpu::BindGroup,
    /// Where its job lies among the jobs [bytes].
    pub job: u32,
    pub groups: [u32; 2],
    /// Whether it forgets the accelerations' past.
    pub starts_acceleration: bool,
}

/// Commands that are not submitted yet. Between calls of a solver there are none.
pub(super) struct Outgoing {
    device: Device,
    encoder: Option<wgpu::CommandEncoder>,
    /// In the encoder.
    dispatches: usize,
    /// Inputs that wait, and where the device finds them.
    staged: Vec<u8>,
    staging: Option<wgpu::Buffer>,
    /// Bytes of the next memory for them.
    room: u64,
    submissions: u64,
    /// Of inputs so far.
    bytes: u64,
}

impl Outgoing {
    /// Nothing.
    pub fn new(device: &Device) -> Self {
        let device = device.clone();
        let (encoder, staging) = (None, None);
        Self {
            device,
            encoder,
            dispatches: 0,
            staged: Vec::new(),
            staging,
            room: 4096,
            submissions: 0,
            bytes: 0,
        }
    }

    /// Submissions so far.
    pub fn submissions(&self) -> u64 {
        self.submissions
    }

    /// Bytes of inputs so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Writes bytes, whole words, behind all that is on its way. Not inlined, like the two
    /// below: a page would carry each several times.
    #[inline(never)]
    pub fn write(&mut self, buffer: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        let (start, size) = (self.staged.len() as u64, bytes.len() as u64);
        self.bytes += size;
        let end = start + size;
        if self.dispatches > 0 && end > self.room {
            self.room = self.room.max(end.next_power_of_two().min(MOST_STAGED));
            // Commands name the memory that is too small: the next frame has more.
            if start > 0 || end > self.room {
                self.submit();
            }
        }
        if self.dispatches == 0 {
            self.device.queue.write_buffer(buffer, offset, bytes);
            return;
        }
        if start == 0 && self.staging.as_ref().is_none_or(|staging| staging.size() < self.room) {
            self.staging = Some(self.device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("inputs of later steps"),
                size: self.room,
                usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        self.staged.extend_from_slice(bytes);
        if let (Some(encoder), Some(staging)) = (&mut self.encoder, &self.staging) {
            encoder.copy_buffer_to_buffer(staging, start, buffer, offset, size);
        }
    }

    /// One compute pass of lists of dispatches, behind all that is on its way.
    #[inline(never)]
    pub fn pass(
        &mut self,
        label: &str,
        uniforms: &wgpu::BindGroup,
        lists: &[&[Ready]],
        marks: Marks<'_>,
    ) {
        let count: usize = lists.iter().map(|list| list.len()).sum();
        if self.dispatches > 0 && self.dispatches + count > MOST_DISPATCHES {
            self.submit();
        }
        self.dispatches += count;
        let encoder = self.encoder.get_or_insert_with(|| {
            let descriptor = wgpu::CommandEncoderDescriptor { label: Some(label) };
            self.device.device.create_command_encoder(&descriptor)
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(label),
            timestamp_writes: marks.writes(),
        });
        for dispatch in lists.iter().copied().flatten() {
            pass.set_pipeline(&dispatch.pipeline);
            pass.set_bind_group(0, &dispatch.storage, &[]);
            pass.set_bind_group(1, uniforms, &[dispatch.job]);
            pass.dispatch_workgroups(dispatch.groups[0], dispatch.groups[1], 1);
        }
    }

    /// Sends all.
    #[inline(never)]
    pub fn submit(&mut self) {
        let Some(encoder) = self.encoder.take() else { return };
        if let Some(staging) = self.staging.as_ref().filter(|_| !self.staged.is_empty()) {
            self.device.queue.write_buffer(staging, 0, &self.staged);
        }
        self.device.queue.submit([encoder.finish()]);
        self.staged.clear();
        self.dispatches = 0;
        self.submissions += 1;
    }
}
