//! The tissue in a texture that the window shows. The one place that knows how the renderer is asked.

use eframe::egui::TextureId;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use viscera::scalar::Vec3;
use viscera::solver::gpu::{Device, GpuSurface, Skin};
use viscera_picture::{Color, Image, ImageSize};
use viscera_render::{DEPTH_FORMAT, Look, Orbit, Renderer};

use crate::engine::{Lane, Stage};

/// The window's device.
#[derive(Clone)]
pub struct Gpu {
    /// As solver and renderer know it.
    pub device: Device,
    /// As the window knows it.
    pub state: RenderState,
}

impl Gpu {
    /// Shares the window's device.
    pub fn new(state: RenderState) -> Self {
        let name = state.adapter.get_info().name;
        let device = Device::from_wgpu(state.device.clone(), state.queue.clone(), name);
        Self { device, state }
    }
}

/// The surfaces of one simulation.
pub struct Tissue {
    surface: GpuSurface,
}

impl Tissue {
    /// Binds the surfaces of all bodies.
    pub fn new(gpu: &Gpu, stage: &Stage) -> Result<Self, String> {
        let bodies = &stage.assembly.bodies;
        let skins: Vec<Skin<'_>> = bodies
            .iter()
            .map(|body| Skin {
                embedding: &body.embedding,
                triangles: &body.surface.triangles,
                first_vertex: body.vertices.start,
            })
            .collect();
        let count = stage.assembly.builder.positions().len();
        let surface = GpuSurface::following(&gpu.device, count, &skins);
        Ok(Self { surface: surface.map_err(|error| error.to_string())? })
    }

    /// Moves it to where a frame has it.
    pub fn place(&self, lane: &Lane) -> Result<(), String> {
        self.surface.place(&lane.positions).map_err(|error| error.to_string())?;
        self.surface.update();
        Ok(())
    }
}

/// What a picture shows.
pub struct Scenery<'a> {
    /// From where.
    pub orbit: Orbit,
    /// The tissue.
    pub tissue: &'a Tissue,
    /// The exact solution, which shines through.
    pub ghost: Option<&'a Tissue>,
    /// The values that its colours begin and end at, where they show values.
    pub range: Option<[f32; 2]>,
    /// Whether the triangles are drawn.
    pub wireframe: bool,
    /// Whether it throws a shadow.
    pub shadow: bool,
    /// Vertices that are held in place [m].
    pub fixed: &'a [Vec3<f64>],
    /// Where tissue is held, and where it is pulled to [m].
    pub pulls: &'a [[Vec3<f64>; 2]],
    /// The size of things [m], for markers and arrows.
    pub extent: f64,
}

/// A texture of a size, and the window's number for it.
pub struct Picture {
    renderer: Renderer,
    target: Option<Target>,
}

struct Target {
    size: ImageSize,
    texture: wgpu::Texture,
    color: wgpu::TextureView,
    depth: wgpu::TextureView,
    id: TextureId,
}

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

impl Picture {
    /// A picture that nothing is drawn in yet.
    pub fn new(gpu: &Gpu) -> Self {
        Self { renderer: Renderer::new(&gpu.device, FORMAT), target: None }
    }

    /// What the window shows.
    pub fn texture(&self) -> Option<TextureId> {
        self.target.as_ref().map(|target| target.id)
    }

    /// Draws; no waiting.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        size: ImageSize,
        scenery: &Scenery<'_>,
    ) -> Result<(), String> {
        if self.target.as_ref().is_none_or(|target| target.size != size) {
            self.resize(gpu, size);
        }
        let Some(target) = &self.target else { return Ok(()) };
        let aspect = f64::from(size.width()) / f64::from(size.height());
        self.renderer.look(&Look { orbit: scenery.orbit, aspect, color: Color::TISSUE });
        let mut encoder = gpu.state.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("tissue"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target.color,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color { r: 0.9, g: 0.92, b: 0.95, a: 1.0 }),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &target.depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(1.0),
                        store: wgpu::StoreOp::Discard,
                    }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            self.renderer.draw(&mut pass, &scenery.tissue.surface);
        }
        gpu.state.queue.submit([encoder.finish()]);
        Ok(())
    }

    fn resize(&mut self, gpu: &Gpu, size: ImageSize) {
        let texture = |format, usage| {
            gpu.state.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("tissue"),
                size: wgpu::Extent3d {
                    width: size.width(),
                    height: size.height(),
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let read = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let color_texture = texture(FORMAT, read);
        let color = color_texture.create_view(&Default::default());
        let depth = texture(DEPTH_FORMAT, wgpu::TextureUsages::empty());
        let depth = depth.create_view(&Default::default());
        let mut window = gpu.state.renderer.write();
        let (device, filter) = (&gpu.state.device, wgpu::FilterMode::Linear);
        let id = match &self.target {
            Some(old) => {
                window.update_egui_texture_from_wgpu_texture(device, &color, filter, old.id);
                old.id
            }
            None => window.register_native_texture(device, &color, filter),
        };
        self.target = Some(Target { size, texture: color_texture, color, depth, id });
    }

    /// Waits for the picture.
    pub fn read(&self, gpu: &Gpu) -> Result<Image, String> {
        let target = self.target.as_ref().ok_or("nothing has been drawn yet")?;
        let (width, height) = (target.size.width(), target.size.height());
        let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let copy = gpu.state.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: u64::from(row) * u64::from(height),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.state.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            target.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &copy,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            target.texture.size(),
        );
        gpu.state.queue.submit([encoder.finish()]);
        copy.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        let lost = || "the device did not give the picture back".to_owned();
        gpu.state.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|_| lost())?;
        let bytes = copy.slice(..).get_mapped_range().map_err(|_| lost())?;
        let mut pixels = Vec::with_capacity((width * height) as usize);
        for row in bytes.chunks(row as usize) {
            let texels = row.as_chunks::<4>().0.iter().take(width as usize);
            pixels.extend(texels.map(|[r, g, b, _]| [*r, *g, *b]));
        }
        Image::from_pixels(target.size, pixels).ok_or_else(lost)
    }
}
