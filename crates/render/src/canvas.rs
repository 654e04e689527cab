//! The one place that draws.
//!
//! ```text
//! shadow map   solid bodies and tools as the key light sees them
//! picture      background, solid bodies and their wires, tools where tissue hides them, tools,
//!              arrows where tissue hides them, markers and arrows,
//!              ghosts: their nearest layer's depths, then its colours
//! ```

use bytemuck::{Pod, Zeroable};
use viscera::solver::gpu::Device;
use viscera_picture::{Color, Image, ImageSize, Paint};

use crate::buffers::filled;
use crate::drawing::{BodyView, GpuDrawing, ScaledValues};
use crate::error::RenderError;
use crate::pipelines::{BODY_BYTES, Painted, Pipelines};
use crate::quality::Quality;
use crate::shadow::ShadowMap;
use crate::solids::{Meshes, Solids};
use crate::target::Target;
use crate::tools::{PlacedTools, ToolView};
use crate::values::palette;
use crate::view::View;

/// Offsets of uniforms are multiples of this on every device [bytes].
const ALIGNMENT: usize = 256;

/// A picture of one size, and everything to draw it with.
#[derive(Debug)]
pub struct Canvas {
    device: Device,
    quality: Quality,
    target: Target,
    pipelines: Pipelines,
    meshes: Meshes,
    shadow: ShadowMap,
    view: wgpu::Buffer,
    view_bound: wgpu::BindGroup,
}

/// `Body` of surface.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Body {
    color: [f32; 4],
    scale: [f32; 4],
}

const _: () = assert!(size_of::<Body>() as u64 == BODY_BYTES);

impl Body {
    fn of(body: &BodyView<'_>) -> Self {
        let (Color { r, g, b }, [low, per_value]) = match body.paint {
            Paint::Flat(color) => (color, [0.0, 0.0]),
            Paint::Values(ScaledValues { low, high, .. }) => {
                // Where both ends are one, every value is the first colour.
                let per_value = (high - low).recip();
                let per_value = if per_value.is_finite() { per_value } else { 0.0 };
                (Color::MISSING, [low, per_value])
            }
        };
        Self { color: [r, g, b, body.opacity.clamp(0.0, 1.0)], scale: [low, per_value, 0.0, 0.0] }
    }
}

impl Canvas {
    /// For pictures of a size, which the device's textures must have room for.
    pub fn new(device: &Device, size: ImageSize, quality: Quality) -> Result<Self, RenderError> {
        let target = Target::new(device, size, quality.samples())?;
        let wgpu = device.wgpu().0;
        let pipelines = Pipelines::new(wgpu, quality.samples());
        let view = wgpu.create_buffer(&wgpu::BufferDescriptor {
            label: Some("view"),
            size: size_of::<View>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let palette = palette();
        let uniform = wgpu::BufferUsages::UNIFORM;
        let colors = filled(device, "colours of values", bytemuck::cast_slice(&palette), uniform);
        let view_bound = wgpu.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("view"),
            layout: &pipelines.view_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: view.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: colors.as_entire_binding() },
            ],
        });
        let canvas = Self {
            target,
            meshes: Meshes::new(device),
            shadow: ShadowMap::new(device, &pipelines, quality.shadow),
            pipelines,
            view,
            view_bound,
            quality,
            device: device.clone(),
        };
        // Memory may have been too little.
        canvas.device.check()?;
        Ok(canvas)
    }

    /// Pictures of another size from now on; where that is refused, it stays as it is.
    pub fn resize(&mut self, size: ImageSize) -> Result<(), RenderError> {
        if size != self.target.size() {
            self.target = Target::new(&self.device, size, self.quality.samples())?;
        }
        Ok(())
    }

    /// How large pictures are.
    pub fn size(&self) -> ImageSize {
        self.target.size()
    }

    /// The picture on the device: `Rgba8Unorm` in sRGB values, for windows that show textures as they are.
    /// Another one after [`Canvas::resize`].
    pub fn view(&self) -> &wgpu::TextureView {
        self.target.view()
    }

    /// Draws surfaces as they are on the device: one submission, no waiting.
    pub fn draw(&self, drawing: &GpuDrawing<'_>) -> Result<(), RenderError> {
        check(drawing)?;
        let (wgpu, queue) = self.device.wgpu();
        let size = self.target.size();
        let aspect = f64::from(size.width()) / f64::from(size.height());
        let view = View::of(drawing, aspect, self.shadow.edge);
        queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        let bodies = self.bind(&drawing.bodies);
        let solids = Solids::new(&self.device, &drawing.markers, &drawing.arrows);
        let tools = PlacedTools::new(&self.device, &drawing.tools);

        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("picture") };
        let mut encoder = wgpu.create_command_encoder(&descriptor);
        if view.has_shadow() {
            let pass = &mut self.shadow.pass(&mut encoder);
            self.draw_shadow(pass, &drawing.bodies, tools.as_ref());
        }
        let mut brush = Brush { canvas: self, pass: self.target.pass(&mut encoder), bodies };
        brush.begin();
        brush.bodies(&drawing.bodies, is_solid);
        if let Some(tools) = &tools {
            brush.tools(tools);
        }
        if let Some(solids) = &solids {
            brush.solids(solids);
        }
        brush.bodies(&drawing.bodies, is_ghost);
        drop(brush);
        queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Waits for the device and reads what was last drawn; black before that.
    pub fn read(&self) -> Result<Image, RenderError> {
        self.target.read(&self.device)
    }

    /// Colours of all bodies, one after the other.
    fn bind(&self, bodies: &[BodyView<'_>]) -> wgpu::BindGroup {
        let wgpu = self.device.wgpu().0;
        // A binding is never empty.
        let mut bytes = vec![0; ALIGNMENT * bodies.len().max(1)];
        for (body, place) in bodies.iter().zip(bytes.chunks_mut(ALIGNMENT)) {
            place[..size_of::<Body>()].copy_from_slice(bytemuck::bytes_of(&Body::of(body)));
        }
        let buffer = filled(&self.device, "bodies", &bytes, wgpu::BufferUsages::UNIFORM);
        wgpu.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("bodies"),
            layout: &self.pipelines.body_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: &buffer,
                    offset: 0,
                    size: wgpu::BufferSize::new(BODY_BYTES),
                }),
            }],
        })
    }

    fn draw_shadow(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        bodies: &[BodyView<'_>],
        tools: Option<&PlacedTools<'_>>,
    ) {
        pass.set_pipeline(&self.pipelines.shadow);
        pass.set_bind_group(0, &self.view_bound, &[]);
        for body in bodies.iter().filter(|body| is_solid(body)) {
            draw_triangles(pass, body);
        }
        if let Some(tools) = tools {
            pass.set_pipeline(&self.pipelines.tool_shadow);
            tools.draw(pass, |tool| tool.has_shadow);
        }
    }
}

/// A pass over the picture while it is drawn.
struct Brush<'a, 'e> {
    canvas: &'a Canvas,
    pass: wgpu::RenderPass<'e>,
    /// Colours of the bodies.
    bodies: wgpu::BindGroup,
}

impl Brush<'_, '_> {
    fn begin(&mut self) {
        let canvas = self.canvas;
        self.pass.set_bind_group(0, &canvas.view_bound, &[]);
        self.pass.set_bind_group(1, &self.bodies, &[0]);
        self.pass.set_bind_group(2, &canvas.shadow.bound, &[]);
        self.pass.set_pipeline(&canvas.pipelines.background);
        self.pass.draw(0..3, 0..1);
    }

    /// Draws those bodies that are chosen.
    fn bodies(&mut self, bodies: &[BodyView<'_>], is_chosen: fn(&BodyView<'_>) -> bool) {
        let pipelines = &self.canvas.pipelines;
        for (number, body) in bodies.iter().enumerate().filter(|(_, body)| is_chosen(body)) {
            self.pass.set_bind_group(1, &self.bodies, &[(number * ALIGNMENT) as u32]);
            if is_ghost(body) {
                self.pass.set_pipeline(&pipelines.ghost_depth);
                draw_triangles(&mut self.pass, body);
                self.surface(body, &pipelines.ghost);
            } else {
                self.surface(body, &pipelines.solid_body);
            }
            if body.wireframe {
                self.wires(body);
            }
        }
    }

    fn surface(&mut self, body: &BodyView<'_>, painted: &Painted) {
        match body.paint {
            Paint::Flat(_) => self.pass.set_pipeline(&painted.plain),
            Paint::Values(ScaledValues { buffer, .. }) => {
                self.pass.set_pipeline(&painted.values);
                self.pass.set_vertex_buffer(1, buffer.buffer().slice(..));
            }
        }
        draw_triangles(&mut self.pass, body);
    }

    fn wires(&mut self, body: &BodyView<'_>) {
        let edges = body.surface.edges();
        self.pass.set_pipeline(&self.canvas.pipelines.wire);
        self.pass.set_vertex_buffer(0, body.surface.vertices().slice(..));
        self.pass.set_index_buffer(edges.slice(..), wgpu::IndexFormat::Uint32);
        let indices = edges.size() / size_of::<u32>() as u64;
        self.pass.draw_indexed(0..indices as u32, 0, 0..1);
    }

    /// Hidden parts first: later tools would hide themselves.
    fn tools(&mut self, tools: &PlacedTools<'_>) {
        let pipelines = &self.canvas.pipelines;
        self.pass.set_pipeline(&pipelines.hidden_tools);
        tools.draw(&mut self.pass, shines_through);
        self.pass.set_pipeline(&pipelines.tools);
        tools.draw(&mut self.pass, |_| true);
    }

    /// Hidden parts first: later the arrows would hide themselves.
    fn solids(&mut self, solids: &Solids) {
        let (pipelines, meshes) = (&self.canvas.pipelines, &self.canvas.meshes);
        self.pass.set_pipeline(&pipelines.hidden_solids);
        solids.draw(&mut self.pass, meshes, true);
        self.pass.set_pipeline(&pipelines.solids);
        solids.draw(&mut self.pass, meshes, false);
    }
}

fn shines_through(tool: &ToolView<'_>) -> bool {
    tool.see_through > 0.0
}

fn is_solid(body: &BodyView<'_>) -> bool {
    body.opacity >= 1.0
}

fn is_ghost(body: &BodyView<'_>) -> bool {
    !is_solid(body)
}

fn draw_triangles(pass: &mut wgpu::RenderPass<'_>, body: &BodyView<'_>) {
    let surface = body.surface;
    pass.set_vertex_buffer(0, surface.vertices().slice(..));
    pass.set_index_buffer(surface.indices().slice(..), wgpu::IndexFormat::Uint32);
    let [first, end] = body.triangles.map(|number| (3 * number).min(surface.index_count()));
    pass.draw_indexed(first..end, 0, 0..1);
}

fn check(drawing: &GpuDrawing<'_>) -> Result<(), RenderError> {
    for body in &drawing.bodies {
        let expected = body.surface.vertex_count() as usize;
        if let Paint::Values(ScaledValues { buffer, .. }) = body.paint
            && buffer.count() != expected
        {
            return Err(RenderError::ValueCount { found: buffer.count(), expected });
        }
    }
    Ok(())
}
