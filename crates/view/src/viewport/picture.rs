//! The tissue in a texture that the window shows. The one place that knows how the renderer is asked.

use eframe::egui::TextureId;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use std::sync::{Arc, OnceLock};
use viscera::scalar::Vec3;
use viscera::solver::gpu::{Device, GpuSurface, Skin};
use viscera_picture::{Color, Image, ImageSize};
use viscera_render::{
    Arrow, BodyView, BoundingSphere, Canvas, GpuDrawing, Markers, Orbit, Paint, Quality,
    RenderError, ScaledValues, ValueBuffer,
};

use crate::engine::{RunSnapshot, Setup};

/// The window's device.
#[derive(Clone)]
pub struct Gpu {
    /// As solver and renderer know it.
    pub device: Device,
    /// As the window knows it.
    pub state: RenderState,
    /// The first thing that went wrong with it.
    failed: Arc<OnceLock<String>>,
}

impl Gpu {
    /// Shares the window's device.
    pub fn new(state: RenderState) -> Self {
        let name = state.adapter.get_info().name;
        let device = Device::from_wgpu(state.device.clone(), state.queue.clone(), name);
        let failed = Arc::new(OnceLock::new());
        let first_error = Arc::clone(&failed);
        // A device that is lost hands out things that cannot be used before it says so.
        state.device.on_uncaptured_error(Arc::new(move |error| {
            let text = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
            // What follows from the first is of no interest.
            let _ = first_error.set(text);
        }));
        Self { device, state, failed }
    }

    /// Why nothing can be drawn any more.
    pub fn failure(&self) -> Option<String> {
        let lost = self.device.check().err().map(|error| error.to_string());
        let name = self.device.name();
        lost.or_else(|| Some(format!("the graphics device {name} failed: {}", self.failed.get()?)))
    }
}

/// The surfaces of one simulation, on the device.
pub struct RunSurface {
    surface: GpuSurface,
    values: ValueBuffer,
    /// Whether the newest snapshot has values.
    has_values: bool,
    /// Encloses it, for its shadow.
    enclosing: Option<BoundingSphere>,
}

impl RunSurface {
    /// Binds the surfaces of all bodies.
    pub fn new(gpu: &Gpu, setup: &Setup) -> Result<Self, String> {
        let bodies = &setup.assembly.bodies;
        let skins: Vec<Skin<'_>> = bodies
            .iter()
            .map(|body| Skin {
                embedding: &body.embedding,
                triangles: &body.surface.triangles,
                first_vertex: body.vertices.start,
            })
            .collect();
        let count = setup.assembly.builder.positions().len();
        let surface = GpuSurface::following(&gpu.device, count, &skins);
        let surface = surface.map_err(|error| error.to_string())?;
        let values = ValueBuffer::new(&gpu.device, surface.vertex_count() as usize);
        Ok(Self { surface, values, has_values: false, enclosing: None })
    }

    /// Moves it to its place in a snapshot.
    pub fn place(&mut self, run: &RunSnapshot) -> Result<(), String> {
        self.surface.place(&run.positions).map_err(|error| error.to_string())?;
        self.surface.update();
        self.has_values = !run.values.is_empty();
        if self.has_values {
            self.values.write(&run.values).map_err(|error| error.to_string())?;
        }
        self.enclosing = BoundingSphere::around(run.positions.iter().map(|x| x.cast()));
        Ok(())
    }
}

/// What a picture shows.
pub struct PictureContents<'a> {
    /// From where.
    pub orbit: Orbit,
    /// The simulation's surfaces.
    pub surface: &'a RunSurface,
    /// The reference, which shines through.
    pub ghost: Option<&'a RunSurface>,
    /// The values that its colours begin and end at, where they show values.
    pub range: Option<[f32; 2]>,
    /// Whether the triangles are drawn.
    pub wireframe: bool,
    /// Whether it throws a shadow.
    pub shadow: bool,
    /// Vertices that are held in place [m].
    pub fixed: &'a [Vec3<f64>],
    /// Where tissue is held by hand [m].
    pub picked: &'a [Vec3<f64>],
    /// Where each of them is pulled to [m].
    pub targets: &'a [Vec3<f64>],
    /// The size of things [m], for markers and arrows.
    pub extent: f64,
}

impl PictureContents<'_> {
    /// Radii as shares of the size of things: large enough to be seen, too small to cover the tissue.
    const FIXED: f64 = 0.005;
    const PICKED: f64 = 0.009;
    const SHAFT: f64 = 0.0045;

    fn drawing(&self) -> GpuDrawing<'_> {
        let surface = self.surface;
        let paint = match self.range.filter(|_| surface.has_values) {
            Some([low, high]) => Paint::Values(ScaledValues { buffer: &surface.values, low, high }),
            None => Paint::Flat(Color::TISSUE),
        };
        let body = BodyView { paint, wireframe: self.wireframe, ..BodyView::of(&surface.surface) };
        let ghost = self.ghost.map(|ghost| BodyView {
            paint: Paint::Flat(Color::REST),
            opacity: 0.3,
            ..BodyView::of(&ghost.surface)
        });
        let balls = |positions, share, color| Markers {
            positions,
            radius: share * self.extent,
            color,
            see_through: 0.0,
        };
        let radius = Self::SHAFT * self.extent;
        let pulls = self.picked.iter().zip(self.targets);
        let arrows = pulls.map(|(&from, &to)| Arrow { from, to, radius, color: Color::PULLED });
        // Shorter ones are hidden by the point they begin at.
        let is_long = |arrow: &Arrow| (arrow.to - arrow.from).length() > Self::PICKED * self.extent;
        GpuDrawing {
            bodies: [Some(body), ghost].into_iter().flatten().collect(),
            markers: vec![
                balls(self.fixed, Self::FIXED, Color::FIXED),
                balls(self.picked, Self::PICKED, Color::PULLED),
            ],
            arrows: arrows.filter(is_long).collect(),
            shadow: surface.enclosing.filter(|_| self.shadow),
            ..GpuDrawing::from(self.orbit)
        }
    }
}

/// A picture in the window, and the window's number for it.
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
        contents: &PictureContents<'_>,
    ) -> Result<(), String> {
        self.take_size(gpu, size).map_err(|error| error.to_string())?;
        let Some((canvas, _)) = &self.shown else { return Ok(()) };
        canvas.draw(&contents.drawing()).map_err(|error| error.to_string())
    }

    /// Makes the canvas, or one of another size, and tells the window of it.
    fn take_size(&mut self, gpu: &Gpu, size: ImageSize) -> Result<(), RenderError> {
        let (device, filter) = (&gpu.state.device, wgpu::FilterMode::Linear);
        match &mut self.shown {
            None => {
                let canvas = Canvas::new(&gpu.device, size, Quality::suited_to(&gpu.device))?;
                let mut window = gpu.state.renderer.write();
                let id = window.register_native_texture(device, canvas.view(), filter);
                self.shown = Some((canvas, id));
            }
            Some((canvas, id)) if canvas.size() != size => {
                canvas.resize(size)?;
                let mut window = gpu.state.renderer.write();
                window.update_egui_texture_from_wgpu_texture(device, canvas.view(), filter, *id);
            }
            Some(_) => {}
        }
        Ok(())
    }

    /// Waits for the picture.
    pub fn read(&self) -> Result<Image, String> {
        let (canvas, _) = self.shown.as_ref().ok_or("nothing has been drawn yet")?;
        canvas.read().map_err(|error| error.to_string())
    }
}
