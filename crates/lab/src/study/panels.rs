//! Bodies side by side, each with the true one as a ghost.

use anyhow::Result;
use viscera::mesh::boundary_surface;
use viscera::scalar::Vec3;
use viscera_picture::{
    Bounds, Camera, Color, ColorScale, Drawing, Image, ImageSize, Markers, Outline, Paint, Surface,
    ViewDirection,
};

use crate::load_cases::LoadCase;

/// Size of one panel [pixels].
const PANEL: [u32; 2] = [640, 480];

/// A body that is where a method has put it.
pub struct Panel {
    /// The method.
    pub title: String,
    /// What it costs and how far it is off.
    pub caption: String,
    /// [m], shape [vertex_count].
    pub positions: Vec<Vec3<f64>>,
    /// Where the vertices should be [m].
    pub truth: Vec<Vec3<f64>>,
}

/// All panels in rows of `columns`, coloured by the distance from the true places [m].
pub fn draw(load_case: &LoadCase, panels: &[Panel], columns: usize) -> Result<Image> {
    let boundary = boundary_surface(&load_case.mesh);
    let on_surface = |x: &[Vec3<f64>]| -> Vec<Vec3<f64>> {
        boundary.mesh_vertices.iter().map(|&v| x[v as usize]).collect()
    };
    let triangles = &boundary.surface.triangles;
    let (mut bounds, mut largest) = (Bounds::default(), 0.0f64);
    let mut bodies = Vec::with_capacity(panels.len());
    for panel in panels {
        let [surface, ghost] = [&panel.positions, &panel.truth].map(|x| on_surface(x));
        bounds.include(&ghost);
        bounds.include(&surface);
        let distances: Vec<f64> =
            surface.iter().zip(&ghost).map(|(x, y)| 1e3 * (*x - *y).length()).collect();
        largest = distances.iter().copied().filter(|d| d.is_finite()).fold(largest, f64::max);
        bodies.push((surface, ghost, distances));
    }
    let scale = ColorScale::rounded("distance from the truth [mm]", 0.0, largest)?;
    let radius = 0.006 * bounds.diagonal();
    let at = |x: &[Vec3<f64>], vertices: &[u32]| -> Vec<Vec3<f64>> {
        vertices.iter().map(|&v| x[v as usize]).collect()
    };
    let size = ImageSize::new(PANEL[0], PANEL[1])?;
    let view = ViewDirection { azimuth: -80.0, elevation: 8.0 };
    let camera = Camera::framing(&bounds, view, size);
    let mut images = Vec::with_capacity(panels.len());
    for (panel, (surface, ghost, distances)) in panels.iter().zip(&bodies) {
        let held =
            [&load_case.fixed, &load_case.driven].map(|vertices| at(&panel.positions, vertices));
        let drawing = Drawing {
            title: &panel.title,
            caption: &panel.caption,
            surfaces: vec![Surface {
                positions: surface,
                triangles,
                paint: Paint::Values(distances),
            }],
            outlines: vec![Outline { positions: ghost, triangles, color: Color::REST }],
            markers: vec![
                markers(&held[0], radius, Color::FIXED),
                markers(&held[1], radius, Color::PULLED),
            ],
            color_scale: Some(scale.clone()),
            length_scale: true,
            ..Drawing::default()
        };
        images.push(drawing.draw(&camera)?.image);
    }
    Ok(Image::tiled(&images, columns)?)
}

fn markers(positions: &[Vec3<f64>], radius: f64, color: Color) -> Markers<'_> {
    Markers { positions, radius, color, see_through: 0.0 }
}
