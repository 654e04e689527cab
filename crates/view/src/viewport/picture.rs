//! The tissue in a texture that the window shows. The one place that knows how the renderer is asked.

use eframe::egui::TextureId;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use viscera::scalar::Vec3;
use viscera::solver::gpu::{Device, GpuSurface, Skin};
use viscera_picture::{Color, Image, ImageSize};
use viscera_render::{
    Arrow, BodyView, Canvas, Drawing, Markers, Orbit, Paint, Quality, Room, ValueBuffer,
};

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
    values: ValueBuffer,
    has_values: bool,
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
        let surface = GpuSurface::following(&gpu.device, count, &skins).map_err(text)?;
        let values = ValueBuffer::new(&gpu.device, surface.vertex_count() as usize);
        Ok(Self { surface, values, has_values: false })
    }

    /// Moves it to where a frame has it, and takes over its values.
    pub fn place(&mut self, lane: &Lane) -> Result<(), String> {
        self.surface.place(&lane.positions).map_err(text)?;
        self.surface.update();
        self.has_values = !lane.values.is_empty();
        if self.has_values {
            self.values.write(&lane.values).map_err(text)?;
        }
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
    /// What throws shadows on itself [m]; without places there are no shadows.
    pub shadow: Option<&'a [Vec3<f32>]>,
    /// Vertices that are held in place [m].
    pub fixed: Vec<Vec3<f64>>,
    /// Where tissue is held, and where it is pulled to [m].
    pub pulls: &'a [[Vec3<f64>; 2]],
    /// The size of things [m], for markers and arrows.
    pub extent: f64,
}

/// How much of what lies behind it a ghost covers.
const GHOST: f32 = 0.4;

/// Radii of marks, as shares of the size of things: seen, and not in the way.
const FIXED: f64 = 0.004;
const PULLED: f64 = 0.009;
const SHAFT: f64 = 0.005;

/// Arrows that are shorter than this share of the size of things say nothing.
const SHORTEST: f64 = 0.01;

impl Scenery<'_> {
    fn drawing(&self) -> Drawing<'_> {
        let Self { tissue, extent, .. } = self;
        let mut body = BodyView { wireframe: self.wireframe, ..BodyView::of(&tissue.surface) };
        if let Some([low, high]) = self.range.filter(|_| tissue.has_values) {
            body.paint = Paint::Values { buffer: &tissue.values, low, high };
        }
        let ghost = self.ghost.map(|ghost| BodyView {
            paint: Paint::Plain(Color::REST),
            opacity: GHOST,
            ..BodyView::of(&ghost.surface)
        });
        let held = self.pulls.iter().map(|[place, _]| *place).collect();
        let far = |[from, to]: &&[Vec3<f64>; 2]| (*to - *from).length() > SHORTEST * extent;
        let arrow = |&[from, to]: &[Vec3<f64>; 2]| Arrow {
            from,
            to,
            radius: SHAFT * extent,
            color: Color::PULLED,
        };
        let marks = |positions, share, color| Markers { positions, radius: share * extent, color };
        let room = |all: &[Vec3<f32>]| Room::around(all.iter().map(|x| x.cast()));
        Drawing {
            bodies: std::iter::once(body).chain(ghost).collect(),
            markers: vec![
                marks(self.fixed.clone(), FIXED, Color::FIXED),
                marks(held, PULLED, Color::PULLED),
            ],
            arrows: self.pulls.iter().filter(far).map(arrow).collect(),
            shadow: self.shadow.and_then(room),
            ..Drawing::from(self.orbit)
        }
    }
}

/// A picture on the device, and the window's number for it.
#[derive(Default)]
pub struct Picture {
    shown: Option<(Canvas, TextureId)>,
}

impl Picture {
    /// What the window shows.
    pub fn texture(&self) -> Option<TextureId> {
        self.shown.as_ref().map(|(_, id)| *id)
    }

    /// Draws; no waiting.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        size: ImageSize,
        scenery: &Scenery<'_>,
    ) -> Result<(), String> {
        self.resize(gpu, size)?;
        match &self.shown {
            Some((canvas, _)) => canvas.draw(&scenery.drawing()).map_err(text),
            None => Ok(()),
        }
    }

    fn resize(&mut self, gpu: &Gpu, size: ImageSize) -> Result<(), String> {
        let (device, filter) = (&gpu.state.device, wgpu::FilterMode::Linear);
        match &mut self.shown {
            Some((canvas, _)) if canvas.size() == size => {}
            Some((canvas, id)) => {
                canvas.resize(size).map_err(text)?;
                let mut window = gpu.state.renderer.write();
                window.update_egui_texture_from_wgpu_texture(device, canvas.view(), filter, *id);
            }
            None => {
                let quality = Quality::suited_to(&gpu.device);
                let canvas = Canvas::new(&gpu.device, size, quality).map_err(text)?;
                let mut window = gpu.state.renderer.write();
                let id = window.register_native_texture(device, canvas.view(), filter);
                drop(window);
                self.shown = Some((canvas, id));
            }
        }
        Ok(())
    }

    /// Waits for the picture.
    pub fn read(&self) -> Result<Image, String> {
        let (canvas, _) = self.shown.as_ref().ok_or("nothing has been drawn yet")?;
        canvas.read().map_err(text)
    }
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}
