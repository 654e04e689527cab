//! The textures that a picture is drawn into, and the way back.

use viscera::solver::gpu::Device;
use viscera_picture::{Image, ImageSize};

use crate::buffers::{read, readable};
use crate::error::RenderError;

/// Colours as screens take them, encoded by the shaders: windows show such a texture as it is.
pub(crate) const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// What depths are kept in.
pub(crate) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Rows of a texture's copy begin at multiples of this [bytes].
const ROW: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// Colour and depth of one size.
#[derive(Debug)]
pub(crate) struct Target {
    size: ImageSize,
    color: wgpu::Texture,
    view: wgpu::TextureView,
    /// Several samples a pixel, averaged into the colour; nothing where there is one.
    samples: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
}

impl Target {
    pub fn new(device: &Device, size: ImageSize, samples: u32) -> Result<Self, RenderError> {
        let (width, height) = (size.width(), size.height());
        let most = device.limits().max_texture_dimension_2d;
        if width.max(height) > most {
            let name = device.name().to_owned();
            return Err(RenderError::TooLarge { width, height, name, most });
        }
        let texture = |format, samples, usage| {
            device.wgpu().0.create_texture(&wgpu::TextureDescriptor {
                label: Some("picture"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: samples,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let all = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let read = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let none = wgpu::TextureUsages::empty();
        let color = texture(COLOR_FORMAT, 1, read);
        let target = Self {
            size,
            view: all(&color),
            samples: (samples > 1).then(|| all(&texture(COLOR_FORMAT, samples, none))),
            depth: all(&texture(DEPTH_FORMAT, samples, none)),
            color,
        };
        // Memory may have been too little.
        device.check()?;
        Ok(target)
    }

    pub fn size(&self) -> ImageSize {
        self.size
    }

    pub fn view(&self) -> &wgpu::TextureView {
        &self.view
    }

    /// A pass that draws all of the picture anew.
    pub fn pass<'e>(&self, encoder: &'e mut wgpu::CommandEncoder) -> wgpu::RenderPass<'e> {
        let (view, resolve_target) = match &self.samples {
            Some(samples) => (samples, Some(&self.view)),
            None => (&self.view, None),
        };
        let store = match resolve_target {
            Some(_) => wgpu::StoreOp::Discard,
            None => wgpu::StoreOp::Store,
        };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("picture"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store },
            })],
            depth_stencil_attachment: Some(depth_of_pass(&self.depth, wgpu::StoreOp::Discard)),
            ..Default::default()
        })
    }

    /// Waits for the device and reads the picture.
    pub fn read(&self, device: &Device) -> Result<Image, RenderError> {
        let (width, height) = (self.size.width(), self.size.height());
        let row = (4 * width).next_multiple_of(ROW);
        let copy = readable(device, "picture", u64::from(row) * u64::from(height));
        let mut encoder = device.wgpu().0.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            self.color.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &copy,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            self.color.size(),
        );
        let pixels = read(device, encoder, &copy, |bytes| {
            let mut pixels = Vec::with_capacity((width * height) as usize);
            for row in bytes.chunks(row as usize) {
                let texels = row.as_chunks::<4>().0.iter().take(width as usize);
                pixels.extend(texels.map(|[r, g, b, _]| [*r, *g, *b]));
            }
            pixels
        })?;
        let lost = || RenderError::Lost { name: device.name().to_owned() };
        Image::from_pixels(self.size, pixels).ok_or_else(lost)
    }
}

/// Depths that begin farthest away.
pub(crate) fn depth_of_pass(
    view: &wgpu::TextureView,
    store: wgpu::StoreOp,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store }),
        stencil_ops: None,
    }
}
