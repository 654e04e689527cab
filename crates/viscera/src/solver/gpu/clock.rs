//! The device's own clock: timestamps where compute passes begin and end.

use super::device::Device;
use super::error::GpuError;
use super::reading;

/// Where in a step its clock is read; nowhere where there is none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Marks<'a> {
    clock: Option<&'a Clock>,
    begin: Option<u32>,
    end: Option<u32>,
}

impl Marks<'_> {
    /// Of all passes but the last.
    pub fn before_the_end(self) -> Self {
        Self { end: None, ..self }
    }

    /// Of all passes but the first.
    pub fn after_the_beginning(self) -> Self {
        Self { begin: None, ..self }
    }

    /// For the pass that is made.
    pub fn writes(&self) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let clock = self.clock.filter(|_| self.begin.is_some() || self.end.is_some())?;
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &clock.queries,
            beginning_of_pass_write_index: self.begin,
            end_of_pass_write_index: self.end,
        })
    }
}

/// The device's clock.
#[derive(Debug)]
pub(super) struct Clock {
    device: Device,
    queries: wgpu::QuerySet,
    /// Of a tick [s].
    tick: f64,
}

impl Clock {
    /// For so many readings. Nothing where the device has no clock, or more is asked than a set of queries holds.
    pub fn new(device: &Device, count: u32) -> Option<Self> {
        let tick = 1e-9 * f64::from(device.queue.get_timestamp_period());
        let has_one = device.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        if !has_one || tick <= 0.0 || count > wgpu::QUERY_SET_MAX_QUERIES {
            return None;
        }
        let queries = device.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("clock"),
            ty: wgpu::QueryType::Timestamp,
            count,
        });
        Some(Self { device: device.clone(), queries, tick })
    }

    /// Two readings around a pass, the first of them numbered so.
    pub fn around(&self, first: u32) -> Marks<'_> {
        Marks { clock: Some(self), begin: Some(first), end: Some(first + 1) }
    }

    /// Waits for the device; the first so many readings, since the very first of them [s]. Drivers wait
    /// for readings that were never asked for.
    pub fn read(&self, count: u32) -> Result<Vec<f64>, GpuError> {
        let size = u64::from(count) * u64::from(wgpu::QUERY_SIZE);
        let resolved = self.device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readings"),
            size,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("readings") };
        let mut encoder = self.device.device.create_command_encoder(&descriptor);
        encoder.resolve_query_set(&self.queries, 0..count, &resolved, 0);
        self.device.queue.submit([encoder.finish()]);
        let mut readings = Vec::new();
        reading::read(&self.device, &[(&resolved, 0..size)], |read| {
            let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(read[0]);
            let since = |t: &u64| t.wrapping_sub(ticks[0]) as i64 as f64 * self.tick;
            readings = ticks.iter().map(since).collect();
        })?;
        Ok(readings)
    }
}

impl Device {
    /// Whether it can measure the time of its work.
    pub fn has_clock(&self) -> bool {
        Clock::new(self, 2).is_some()
    }
}
