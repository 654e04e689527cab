//! Values that colours show, on the device.

use bytemuck::{Pod, Zeroable};
use viscera::solver::gpu::Device;
use viscera_picture::map_color;

use crate::buffers::{read, readable};
use crate::error::RenderError;

/// A value as shaders have it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Value {
    value: f32,
    /// 1 where it is none. Shaders need not know what is not a number.
    missing: f32,
}

/// Larger values, infinite ones among them, count as this: it can be mixed without overflow.
const LARGEST: f32 = 1e30;

impl Value {
    fn of(value: f32) -> Self {
        match value.is_nan() {
            true => Self { value: 0.0, missing: 1.0 },
            false => Self { value: value.clamp(-LARGEST, LARGEST), missing: 0.0 },
        }
    }
}

/// One value for each vertex of a surface.
#[derive(Debug)]
pub struct ValueBuffer {
    device: Device,
    buffer: wgpu::Buffer,
    count: usize,
}

impl ValueBuffer {
    /// Zeros, for a surface of so many vertices.
    pub fn new(device: &Device, count: usize) -> Self {
        let (wgpu, _) = device.wgpu();
        let buffer = wgpu.create_buffer(&wgpu::BufferDescriptor {
            label: Some("values"),
            size: (size_of::<Value>() * count.max(1)) as u64,
            usage: wgpu::BufferUsages::VERTEX
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::COPY_SRC
                | wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        Self { device: device.clone(), buffer, count }
    }

    /// Takes over values of the surface's vertices, for pictures drawn from now on; NaN is drawn grey.
    pub fn write(&self, values: &[f32]) -> Result<(), RenderError> {
        let (found, expected) = (values.len(), self.count);
        if found != expected {
            return Err(RenderError::ValueCount { found, expected });
        }
        let values: Vec<Value> = values.iter().copied().map(Value::of).collect();
        self.device.wgpu().1.write_buffer(&self.buffer, 0, bytemuck::cast_slice(&values));
        Ok(())
    }

    /// Waits for the device and reads the values, of which NaN is none.
    pub fn read(&self) -> Result<Vec<f32>, RenderError> {
        let copy = readable(&self.device, "values", self.buffer.size());
        let mut encoder = self.device.wgpu().0.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &copy, 0, copy.size());
        read(&self.device, encoder, &copy, |bytes| {
            let all: &[Value] = bytemuck::cast_slice(bytes);
            let value = |own: &Value| if own.missing > 0.0 { f32::NAN } else { own.value };
            all.iter().take(self.count).map(value).collect()
        })
    }

    /// How many values there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Two floats a vertex: the value, and one where there is none. For kernels that write them.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// How a value lies in memory: at location 2, after those of the surface.
    pub(crate) fn layout() -> wgpu::VertexBufferLayout<'static> {
        const ATTRIBUTES: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![2 => Float32x2];
        wgpu::VertexBufferLayout {
            array_stride: size_of::<Value>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &ATTRIBUTES,
        }
    }
}

/// Colours of values from first to last, in linear light.
pub(crate) fn palette() -> Vec<[f32; 4]> {
    let color = |i: u16| map_color(f32::from(i) / 255.0);
    (0..256).map(color).map(|c| [c.r, c.g, c.b, 1.0]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_reach_the_device_as_numbers() {
        assert_eq!(Value::of(f32::NAN), Value { value: 0.0, missing: 1.0 });
        assert_eq!(Value::of(f32::NEG_INFINITY).value, -LARGEST);
        assert_eq!(Value::of(0.25), Value { value: 0.25, missing: 0.0 });
    }
}
