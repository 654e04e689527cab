//! The page's canvas, drawn by the device: each simulation's picture in its part.

use js_sys::Reflect;
use viscera::scalar::Vec3;
use viscera::solver::gpu::{Adapter, Device, GpuError};
use viscera_picture::ImageSize;
use viscera_render::{Canvas, Quality};
use viscera_stage::{Area, PictureContents, RunSurface};
use wasm_bindgen::JsValue;

use crate::pictures::{background, fixed};
use crate::session::Session;

/// Opens the browser's device: the instance and the device.
pub async fn open_device() -> Result<(wgpu::Instance, Device), GpuError> {
    // Without this entry the graphics interface would not answer, but panic: under plain http, outside browsers.
    let entry = |of: &JsValue, name: &str| Reflect::get(of, &name.into()).unwrap_or_default();
    let navigator = entry(&js_sys::global(), "navigator");
    if navigator.is_undefined() || entry(&navigator, "gpu").is_undefined() {
        return Err(GpuError::NoAdapter);
    }
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::BROWSER_WEBGPU,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapter = Adapter::of_browser(&instance).await?;
    let device = adapter.opening().await?;
    Ok((instance, device))
}

/// The canvas, and what is drawn onto it.
pub struct Screen {
    device: Device,
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
    presenter: Presenter,
    pictures: Vec<Picture>,
}

/// The picture of one simulation.
struct Picture {
    canvas: Canvas,
    bound: wgpu::BindGroup,
    surface: RunSurface,
    /// Which snapshot it shows.
    moved: u64,
    /// Which scene it is of.
    generation: u64,
}

/// Copies pictures onto the canvas.
struct Presenter {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

impl Screen {
    /// Draws onto a canvas from now on.
    pub fn new(
        instance: &wgpu::Instance,
        device: &Device,
        canvas: web_sys::OffscreenCanvas,
    ) -> Result<Self, String> {
        let size = [canvas.width().max(1), canvas.height().max(1)];
        let target = wgpu::SurfaceTarget::OffscreenCanvas(canvas);
        let surface = instance.create_surface(target).map_err(|error| error.to_string())?;
        // Browsers show either as it is; this one is what all have.
        let format = wgpu::TextureFormat::Bgra8Unorm;
        let configuration = wgpu::SurfaceConfiguration {
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            format,
            width: size[0],
            height: size[1],
            present_mode: wgpu::PresentMode::AutoVsync,
            desired_maximum_frame_latency: 2,
            alpha_mode: wgpu::CompositeAlphaMode::Opaque,
            view_formats: Vec::new(),
            color_space: Default::default(),
        };
        surface.configure(device.wgpu().0, &configuration);
        let presenter = Presenter::new(device.wgpu().0, format);
        Ok(Self { device: device.clone(), surface, configuration, presenter, pictures: Vec::new() })
    }

    /// Draws all simulations of a session: no waiting.
    pub fn draw(&mut self, session: &mut Session) -> Result<(), String> {
        let [width, height] = session.size;
        if [self.configuration.width, self.configuration.height] != [width, height] {
            (self.configuration.width, self.configuration.height) = (width, height);
            self.surface.configure(self.device.wgpu().0, &self.configuration);
        }
        let lenses = session.lenses();
        self.pictures.truncate(session.runs.len());
        for (number, lens) in lenses.iter().enumerate().take(session.runs.len()) {
            self.draw_run(session, number, lens)?;
        }
        self.present(&lenses.iter().map(|lens| lens.area).collect::<Vec<_>>())
    }

    fn draw_run(
        &mut self,
        session: &Session,
        number: usize,
        lens: &viscera_stage::Lens,
    ) -> Result<(), String> {
        let (Some(loaded), Some(state)) = (&session.loaded, session.runs.get(number)) else {
            return Ok(());
        };
        let side = |length: f64| (length.round() as u32).max(16);
        let size = ImageSize::new(side(lens.area.width), side(lens.area.height))
            .map_err(|error| error.to_string())?;
        let known =
            self.pictures.get(number).map(|picture| (picture.generation, picture.canvas.size()));
        if known != Some((session.generation, size)) {
            let picture = Picture::new(&self.device, &self.presenter, size, session, loaded)?;
            self.pictures.truncate(number);
            self.pictures.push(picture);
        }
        let Some(picture) = self.pictures.get_mut(number) else { return Ok(()) };
        if picture.moved != state.moved {
            picture.surface.place(&state.snapshot, &loaded.assembly)?;
            picture.moved = state.moved;
        }
        let fixed = fixed(session, &state.snapshot);
        let (picked, targets): (Vec<Vec3<f64>>, Vec<Vec3<f64>>) =
            state.snapshot.held.iter().map(|hold| (hold.place, hold.target)).unzip();
        let contents = PictureContents {
            orbit: lens.orbit,
            surface: &picture.surface,
            ghost: None,
            range: session.legend.range(),
            bodies: &[],
            wireframe: session.wireframe,
            shadow: true,
            fixed: &fixed,
            picked: &picked,
            targets: &targets,
            tools: &state.snapshot.tools,
            in_hand: session.instruments.active().map(|held| held.id),
            force_scale: session.force_scale.metres_per_newton(session.extent),
            extent: session.extent,
        };
        let mut drawing = contents.drawing();
        drawing.background = background(session.dark);
        picture.canvas.draw(&drawing).map_err(|error| error.to_string())
    }

    fn present(&self, areas: &[Area]) -> Result<(), String> {
        let (wgpu, queue) = self.device.wgpu();
        let frame = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(frame)
            | wgpu::CurrentSurfaceTexture::Suboptimal(frame) => frame,
            // The next frame may be drawn; a device that is lost says so by itself.
            _ => return Ok(()),
        };
        let view = frame.texture.create_view(&Default::default());
        let mut encoder = wgpu.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("present"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            pass.set_pipeline(&self.presenter.pipeline);
            for (picture, area) in self.pictures.iter().zip(areas) {
                let Area { left, top, width, height } = *area;
                let [left, top, width, height] = [left, top, width, height].map(|x| x as f32);
                pass.set_viewport(left, top, width.max(1.0), height.max(1.0), 0.0, 1.0);
                pass.set_bind_group(0, &picture.bound, &[]);
                pass.draw(0..3, 0..1);
            }
        }
        queue.submit([encoder.finish()]);
        queue.present(frame);
        Ok(())
    }
}

impl Picture {
    fn new(
        device: &Device,
        presenter: &Presenter,
        size: ImageSize,
        session: &Session,
        loaded: &crate::loaded::Loaded,
    ) -> Result<Self, String> {
        let canvas = Canvas::new(device, size, Quality::suited_to(device));
        let canvas = canvas.map_err(|error| error.to_string())?;
        let bound = device.wgpu().0.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("present"),
            layout: &presenter.layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(canvas.view()),
            }],
        });
        let surface = RunSurface::new(device, &loaded.assembly)?;
        Ok(Self { canvas, bound, surface, moved: 0, generation: session.generation })
    }
}

impl Presenter {
    fn new(device: &wgpu::Device, format: wgpu::TextureFormat) -> Self {
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("present"),
            source: wgpu::ShaderSource::Wgsl(include_str!("present.wgsl").into()),
        });
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("present"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: false },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            }],
        });
        let layouts = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("present"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("present"),
            layout: Some(&layouts),
            vertex: wgpu::VertexState {
                module: &shader,
                entry_point: Some("cover"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &shader,
                entry_point: Some("present"),
                compilation_options: Default::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { pipeline, layout }
    }
}
