//! The tissue in a texture that the window shows. The one place that knows how the renderer is asked.

use eframe::egui::TextureId;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use std::sync::{Arc, OnceLock};
use viscera::solver::gpu::Device;
use viscera_picture::{Image, ImageSize};
use viscera_render::{Canvas, Quality, RenderError};
use viscera_stage::PictureContents;

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
