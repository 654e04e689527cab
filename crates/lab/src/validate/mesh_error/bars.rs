//! Three bars side by side: coarse with linear tetrahedra, coarse with recovered-gradient ones, and fine.

use anyhow::Result;
use viscera::mesh::boundary_surface;
use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::settings::Elements;
use viscera::simulation::Assembly;
use viscera_picture::{
    Bounds, Camera, Color, ColorScale, Drawing, Image, ImageSize, Outline, Paint, Surface,
    ViewDirection,
};

use crate::converge::levels::{at_rest, refined};

/// Size of one bar's picture [pixels].
const PANEL: [u32; 2] = [480, 480];

/// Bars and how often their mesh is refined.
const BARS: [(&str, Elements, u32); 3] = [
    ("linear tetrahedra", Elements::Plain, 0),
    ("recovered-gradient", Elements::Recovered, 0),
    ("fine mesh", Elements::Recovered, 2),
];

/// A bar at rest: its surface [m], triangles, and how far each vertex has sunk [mm].
struct Bar {
    title: String,
    caption: String,
    positions: Vec<Vec3<f64>>,
    triangles: Vec<[u32; 3]>,
    sunk: Vec<f64>,
}

fn bar(scene: &Scene, (name, elements, times): (&str, Elements, u32)) -> Result<Bar> {
    let finer = refined(scene, times);
    let assembly = Assembly::new(&finer, &mut |file| Err(file.to_owned()))?;
    let kept = [assembly.bodies[0].vertices.len()];
    let rest = at_rest(&finer, &assembly, elements, &kept, false, None)?;
    let mesh = &assembly.bodies[0].mesh;
    let boundary = boundary_surface(mesh);
    let of = |all: &[Vec3<f64>]| -> Vec<Vec3<f64>> {
        boundary.mesh_vertices.iter().map(|&v| all[v as usize]).collect()
    };
    let (positions, before) = (of(&rest.all), of(mesh.vertices()));
    let moves = positions.iter().zip(&before).map(|(x, y)| 1e3 * (*x - *y).length());
    let sunk: Vec<f64> = moves.collect();
    let largest = sunk.iter().copied().fold(0.0, f64::max);
    Ok(Bar {
        title: name.to_owned(),
        caption: format!("{} tetrahedra, end sinks by {largest:.1} mm", rest.tets),
        positions,
        triangles: boundary.surface.triangles,
        sunk,
    })
}

/// The picture; each bar with the outline of the fine one.
pub fn draw(scene: &Scene) -> Result<Image> {
    let bars = BARS.into_iter().map(|row| bar(scene, row)).collect::<Result<Vec<_>>>()?;
    let [.., fine] = &bars[..] else { anyhow::bail!("no bars") };
    let mut bounds = Bounds::default();
    bars.iter().for_each(|bar| bounds.include(&bar.positions));
    let largest = bars.iter().flat_map(|bar| &bar.sunk).copied().fold(0.0, f64::max);
    let scale = ColorScale::rounded("displacement [mm]", 0.0, largest)?;
    let size = ImageSize::new(PANEL[0], PANEL[1])?;
    let view = ViewDirection { azimuth: -80.0, elevation: 8.0 };
    let camera = Camera::framing(&bounds, view, size);
    let mut images = Vec::new();
    for bar in &bars {
        let drawing = Drawing {
            title: &bar.title,
            caption: &bar.caption,
            surfaces: vec![Surface {
                positions: &bar.positions,
                triangles: &bar.triangles,
                paint: Paint::Values(&bar.sunk),
            }],
            outlines: vec![Outline {
                positions: &fine.positions,
                triangles: &fine.triangles,
                color: Color::REST,
            }],
            color_scale: Some(scale.clone()),
            length_scale: true,
            ..Drawing::default()
        };
        images.push(drawing.draw(&camera)?.image);
    }
    Ok(Image::tiled(&images, BARS.len())?)
}
