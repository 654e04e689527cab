//! A ball to draw, and what one sees in pictures.

use viscera::mesh::embed::Embedding;
use viscera::mesh::shapes::{CurvedShape, sphere};
use viscera::scalar::Vec3;
use viscera::solver::gpu::{Adapter, Device, GpuSurface, Skin, baseline};
use viscera_picture::{Image, ImageSize};
use viscera_render::{BodyView, Canvas, GpuDrawing, Orbit, Quality};

/// Of the ball [m].
pub const RADIUS: f64 = 0.05;

fn adapter() -> Adapter {
    Adapter::find(None).unwrap_or_else(|error| panic!("{error}"))
}

/// The first device there is; without any the test fails and says what to install.
pub fn device() -> Device {
    adapter().open().unwrap_or_else(|error| panic!("{error}"))
}

/// A device whose textures are smaller than the largest picture.
pub fn small_device() -> Device {
    let limits = wgpu::Limits { max_texture_dimension_2d: 2048, ..baseline() };
    adapter().open_with(limits).unwrap_or_else(|error| panic!("{error}"))
}

/// A ball around the origin.
pub struct Ball {
    pub surface: GpuSurface,
    /// Vertices of its surface.
    pub count: usize,
    pub orbit: Orbit,
    shape: CurvedShape,
    device: Device,
}

impl Ball {
    pub fn new(device: &Device) -> Self {
        let shape = sphere(RADIUS, 0.02).expect("a ball");
        let surface = place(device, &shape, 1.0, Vec3::ZERO);
        let vertices = &shape.surface.vertices;
        Self {
            surface,
            count: vertices.len(),
            orbit: Orbit::framing(vertices),
            shape,
            device: device.clone(),
        }
    }

    /// The same, of another size and elsewhere [m].
    pub fn copy(&self, scale: f64, center: Vec3<f64>) -> GpuSurface {
        place(&self.device, &self.shape, scale, center)
    }

    /// The ball and nothing else.
    pub fn drawing(&self) -> GpuDrawing<'_> {
        GpuDrawing { bodies: vec![BodyView::of(&self.surface)], ..GpuDrawing::from(self.orbit) }
    }

    pub fn canvas(&self, [width, height]: [u32; 2], quality: Quality) -> Canvas {
        let size = ImageSize::new(width, height).expect("a size");
        Canvas::new(&self.device, size, quality).expect("a canvas")
    }

    pub fn picture(&self, canvas: &Canvas, drawing: &GpuDrawing<'_>) -> Image {
        canvas.draw(drawing).expect("a legal drawing");
        canvas.read().expect("a picture")
    }
}

fn place(device: &Device, shape: &CurvedShape, scale: f64, center: Vec3<f64>) -> GpuSurface {
    let embedding = Embedding::new(&shape.tets, &shape.surface).expect("a bound surface");
    let skin = Skin { embedding: &embedding, triangles: &shape.surface.triangles, first_vertex: 0 };
    let vertices = shape.tets.vertices();
    let surface = GpuSurface::following(device, vertices.len(), &[skin]).expect("a surface");
    let positions: Vec<_> = vertices.iter().map(|x| (*x * scale + center).cast()).collect();
    surface.place(&positions).expect("as many positions");
    surface.update();
    surface
}

/// How many pixels are redder than blue: tissue, not background.
pub fn tissue(image: &Image) -> usize {
    image.pixels().iter().filter(|[r, _, b]| *r > b.saturating_add(20)).count()
}

/// A pixel, by its place from the left and from above.
pub fn pixel(image: &Image, [x, y]: [usize; 2]) -> [u8; 3] {
    image.pixels()[y * image.size().width() as usize + x]
}

pub fn brightness(pixel: [u8; 3]) -> i32 {
    pixel.into_iter().map(i32::from).sum()
}

/// Where two pictures of one size are not the same.
pub fn difference(a: &Image, b: &Image) -> Vec<[usize; 2]> {
    let width = a.size().width() as usize;
    let pairs = a.pixels().iter().zip(b.pixels()).enumerate();
    pairs.filter(|(_, (a, b))| a != b).map(|(i, _)| [i % width, i / width]).collect()
}
