//! Pictures without a window.

use std::sync::mpsc;

use viscera::solver::gpu::{Device, GpuError, GpuSurface};
use viscera_picture::{Image, ImageSize};

use crate::renderer::{DEPTH_FORMAT, Look, Renderer};

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The device has failed.
    #[error(transparent)]
    Device(#[from] GpuError),
    /// The picture is larger than the device's textures.
    #[error("a picture of {width} x {height} pixels; {name} draws up to {most} on a side")]
    TooLarge {
        /// Asked [pixels].
        width: u32,
        /// Asked [pixels].
        height: u32,
        /// The device.
        name: String,
        /// Its limit [pixels].
        most: u32,
    },
    /// The picture did not come back.
    #[error("{name} did not give the picture back; it may be lost: start again, or use the CPU")]
    Lost {
        /// The device.
        name: String,
    },
}

/// Rows of a texture's copy begin at multiples of this [bytes].
const ROW: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// What lies behind the tissue, in linear light.
const BACKGROUND: wgpu::Color = wgpu::Color { r: 0.86, g: 0.88, b: 0.91, a: 1.0 };

/// A texture to draw into, and the way back.
#[derive(Debug)]
pub struct Offscreen {
    device: Device,
    renderer: Renderer,
    size: ImageSize,
    target: wgpu::Texture,
    depth: wgpu::Texture,
    copy: wgpu::Buffer,
    row: u32,
}

impl Offscreen {
    /// For pictures of one size.
    pub fn new(device: &Device, size: ImageSize) -> Result<Self, RenderError> {
        let (width, height) = (size.width(), size.height());
        let most = device.limits().max_texture_dimension_2d;
        if width.max(height) > most {
            let name = device.name().to_owned();
            return Err(RenderError::TooLarge { width, height, name, most });
        }
        let (wgpu, _) = device.wgpu();
        let format = wgpu::TextureFormat::Rgba8UnormSrgb;
        let texture = |label, format, usage| {
            wgpu.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let row = (4 * width).next_multiple_of(ROW);
        let offscreen = Self {
            renderer: Renderer::new(device, format),
            target: texture("picture", format, wgpu::TextureUsages::COPY_SRC),
            depth: texture("depth", DEPTH_FORMAT, wgpu::TextureUsages::empty()),
            copy: wgpu.create_buffer(&wgpu::BufferDescriptor {
                label: Some("picture"),
                size: u64::from(row) * u64::from(height),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            device: device.clone(),
            size,
            row,
        };
        // Memory may have been too little.
        offscreen.device.check()?;
        Ok(offscreen)
    }

    /// Draws surfaces as they are on the device and waits for the picture. The look's aspect is that of
    /// the picture.
    pub fn draw(&self, look: &Look, surfaces: &[&GpuSurface]) -> Result<Image, RenderError> {
        let aspect = f64::from(self.size.width()) / f64::from(self.size.height());
        self.renderer.look(&Look { aspect, ..*look });
        let (wgpu, queue) = self.device.wgpu();
        let [target, depth] = [&self.target, &self.depth]
            .map(|texture| texture.create_view(&wgpu::TextureViewDescriptor::default()));
        let mut encoder =
            wgpu.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("picture") });
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("picture"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(BACKGROUND),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(1.0),
                        store: wgpu::StoreOp::Discard,
                    }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            for surface in surfaces {
                self.renderer.draw(&mut pass, surface);
            }
        }
        encoder.copy_texture_to_buffer(
            self.target.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.copy,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(self.row),
                    rows_per_image: None,
                },
            },
            self.target.size(),
        );
        queue.submit([encoder.finish()]);
        self.read()
    }

    fn read(&self) -> Result<Image, RenderError> {
        let lost = || RenderError::Lost { name: self.device.name().to_owned() };
        let (told, hear) = mpsc::channel();
        self.copy.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // Nobody listens where waiting has failed.
            let _ = told.send(result.is_ok());
        });
        let waited = self.device.wgpu().0.poll(wgpu::PollType::wait_indefinitely());
        if waited.is_err() || !hear.try_recv().unwrap_or(false) {
            self.device.check()?;
            return Err(lost());
        }
        let mut pixels = Vec::with_capacity((self.size.width() * self.size.height()) as usize);
        {
            let bytes = self.copy.slice(..).get_mapped_range().map_err(|_| lost())?;
            for row in bytes.chunks(self.row as usize) {
                let texels = row.as_chunks::<4>().0.iter().take(self.size.width() as usize);
                pixels.extend(texels.map(|[r, g, b, _]| [*r, *g, *b]));
            }
        }
        self.copy.unmap();
        self.device.check()?;
        Image::from_pixels(self.size, pixels).ok_or_else(lost)
    }
}
