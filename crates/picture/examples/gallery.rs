//! Draws a bent beam and a pulled organ: `cargo run --release -p viscera-picture --example gallery`.
//!
//! Writes `beam.png`, `organ.png` and `organ.gif` to the folder given as the argument, `out` if
//! there is none.

use std::path::PathBuf;
use std::time::Instant;

use viscera::mesh::SurfaceMesh;
use viscera::scalar::{Vec3, vec3};
use viscera_picture::{
    Animation, Arrow, Bounds, Camera, Color, ColorScale, Drawing, ImageSize, Markers, Outline,
    Paint, Surface, ViewDirection, write_png,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)?;
    let size = ImageSize::new(1280, 720)?;

    let beam = beam(48, 8);
    let bent: Vec<_> = beam.vertices.iter().map(|&p| bend(p)).collect();
    let fixed: Vec<_> = beam.vertices.iter().copied().filter(|p| p.x == 0.0).collect();
    let picture = draw(&Subject {
        title: "Cantilever",
        caption: "t = 2.00 s",
        rest: &beam,
        positions: &bent,
        fixed: &fixed,
        pulled: &[],
        marker_radius: 1.2e-3,
        size,
    })?;
    std::fs::write(folder.join("beam.png"), write_png(&picture)?)?;

    let organ = bumpy_sphere(100, 100);
    let positions = pulled(&organ.vertices, 1.0);
    let held: Vec<_> = organ
        .vertices
        .iter()
        .copied()
        .filter(|p| p.x < -0.075 || p.z < -0.052)
        .step_by(9)
        .collect();
    let grabbed: Vec<_> =
        positions.iter().zip(&organ.vertices).filter(|p| near_grip(*p.1)).map(|p| *p.0).collect();
    let picture = draw(&Subject {
        title: "Liver retraction",
        caption: "t = 1.25 s",
        rest: &organ,
        positions: &positions,
        fixed: &held,
        pulled: &grabbed,
        marker_radius: 1.1e-3,
        size,
    })?;
    std::fs::write(folder.join("organ.png"), write_png(&picture)?)?;

    let size = ImageSize::new(640, 400)?;
    let mut animation = Animation::new(size)?;
    let started = Instant::now();
    for frame in 0..90 {
        let time = f64::from(frame) / 30.0;
        let positions = pulled(&organ.vertices, 0.5 - 0.5 * libm::cos(time * std::f64::consts::PI));
        let grabbed: Vec<_> = positions
            .iter()
            .zip(&organ.vertices)
            .filter(|p| near_grip(*p.1))
            .map(|p| *p.0)
            .collect();
        let picture = draw(&Subject {
            title: "Liver retraction",
            caption: &format!("t = {time:.2} s"),
            rest: &organ,
            positions: &positions,
            fixed: &held,
            pulled: &grabbed,
            marker_radius: 1.1e-3,
            size,
        })?;
        animation.push(&picture, time)?;
        if frame == 30 {
            std::fs::write(folder.join("organ_small.png"), write_png(&picture)?)?;
        }
    }
    let gif = animation.finish(1.0 / 30.0)?;
    println!("animation: {} bytes, {:?}", gif.len(), started.elapsed());
    std::fs::write(folder.join("organ.gif"), gif)?;
    Ok(())
}

struct Subject<'a> {
    title: &'a str,
    caption: &'a str,
    rest: &'a SurfaceMesh,
    positions: &'a [Vec3<f64>],
    fixed: &'a [Vec3<f64>],
    pulled: &'a [Vec3<f64>],
    marker_radius: f64,
    size: ImageSize,
}

fn draw(subject: &Subject) -> Result<viscera_picture::Image, viscera_picture::PictureError> {
    let rest = subject.rest;
    let displacement: Vec<f64> = subject
        .positions
        .iter()
        .zip(&rest.vertices)
        .map(|(&x, &rest)| (x - rest).length() * 1e3)
        .collect();
    let largest = if subject.pulled.is_empty() { 39.0 } else { 47.0 };

    let mut bounds = Bounds::of(&rest.vertices);
    bounds.include(subject.positions);
    let mut arrows = Vec::new();
    if !subject.pulled.is_empty() {
        let grip = GRIP + PULL;
        let direction = PULL * (1.0 / PULL.length());
        let middle = subject.pulled.iter().fold(Vec3::ZERO, |sum, &p| sum + p)
            * (1.0 / subject.pulled.len() as f64);
        let from = middle + direction * 0.004;
        let to = middle + direction * 0.034;
        bounds.include(&[grip + direction * 0.040]);
        arrows.push(Arrow { from, to, radius: 1.3e-3, color: Color::PULLED });
    }
    let camera = Camera::framing(&bounds, ViewDirection::default(), subject.size);
    let marker = |positions, color| Markers {
        positions,
        radius: subject.marker_radius,
        color,
        see_through: 0.15,
    };
    let drawing = Drawing {
        title: subject.title,
        caption: subject.caption,
        surfaces: vec![Surface {
            positions: subject.positions,
            triangles: &rest.triangles,
            paint: Paint::Values(&displacement),
        }],
        outlines: vec![Outline {
            positions: &rest.vertices,
            triangles: &rest.triangles,
            color: Color::REST,
        }],
        markers: vec![marker(subject.fixed, Color::FIXED), marker(subject.pulled, Color::PULLED)],
        arrows,
        color_scale: Some(ColorScale::rounded("displacement [mm]", 0.0, largest)?),
        length_scale: true,
        ..Drawing::default()
    };
    let started = Instant::now();
    let drawn = drawing.draw(&camera)?;
    if subject.size.width() > 1000 {
        println!("{}: {} triangles, {:?}", subject.title, rest.triangles.len(), started.elapsed());
    }
    Ok(drawn.image)
}

/// A beam of 0.2 x 0.03 x 0.03 m: the surface of a grid of `along` x `across` x `across` cells.
fn beam(along: u32, across: u32) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    let cells = [along, across, across];
    let index = |i: [u32; 3]| (i[0] * (across + 1) + i[1]) * (across + 1) + i[2];
    for i in 0..=along {
        for j in 0..=across {
            for k in 0..=across {
                let part = |n: u32, cells: u32| f64::from(n) / f64::from(cells);
                mesh.vertices.push(vec3(
                    0.2 * part(i, along),
                    0.03 * part(j, across),
                    0.03 * part(k, across),
                ));
            }
        }
    }
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for far in [false, true] {
            for a in 0..cells[u] {
                for b in 0..cells[v] {
                    let corner = |da: u32, db: u32| {
                        let mut i = [0; 3];
                        i[axis] = if far { cells[axis] } else { 0 };
                        i[u] = a + da;
                        i[v] = b + db;
                        index(i)
                    };
                    let mut quad = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    if !far {
                        quad.reverse();
                    }
                    mesh.triangles.push([quad[0], quad[1], quad[2]]);
                    mesh.triangles.push([quad[0], quad[2], quad[3]]);
                }
            }
        }
    }
    mesh
}

/// Bends the beam's axis into an arc.
fn bend(p: Vec3<f64>) -> Vec3<f64> {
    let radius = 0.5;
    let (sin, cos) = libm::sincos(p.x / radius);
    let above = p.z + radius;
    vec3(above * sin, p.y, above * cos - radius)
}

/// An ellipsoid with folds.
fn bumpy_sphere(rings: u32, sides: u32) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    for ring in 0..=rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        let count = if ring == 0 || ring == rings { 1 } else { sides };
        for side in 0..count {
            let (sin_p, cos_p) = libm::sincos(polar);
            let (sin_a, cos_a) =
                libm::sincos(std::f64::consts::TAU * f64::from(side) / f64::from(sides));
            let n = vec3(sin_p * cos_a, sin_p * sin_a, cos_p);
            let lobes =
                libm::sin(3.1 * n.x + 1.0) * libm::sin(4.3 * n.y + 0.4) * libm::cos(3.7 * n.z);
            let cleft = libm::exp(-60.0 * (n.x - 0.25) * (n.x - 0.25));
            let radius = 1.0 + 0.13 * lobes - 0.16 * cleft * (0.6 - 0.4 * n.y);
            mesh.vertices.push(vec3(0.09 * n.x, 0.06 * n.y, 0.055 * n.z) * radius);
        }
    }
    let vertex = |ring: u32, side: u32| match ring {
        0 => 0,
        r if r == rings => 1 + (rings - 1) * sides,
        r => 1 + (r - 1) * sides + side % sides,
    };
    for ring in 0..rings {
        for side in 0..sides {
            let (a, b) = (vertex(ring, side), vertex(ring, side + 1));
            let (c, d) = (vertex(ring + 1, side), vertex(ring + 1, side + 1));
            if ring > 0 {
                mesh.triangles.push([a, c, b]);
            }
            if ring + 1 < rings {
                mesh.triangles.push([b, c, d]);
            }
        }
    }
    mesh
}

/// Where the organ is gripped, at rest [m].
const GRIP: Vec3<f64> = vec3(0.082, -0.018, 0.010);
/// How far the grip is moved [m].
const PULL: Vec3<f64> = vec3(0.022, -0.008, 0.038);

fn near_grip(p: Vec3<f64>) -> bool {
    (p - GRIP).length() < 0.016
}

/// The organ with its grip moved by a part of [`PULL`].
fn pulled(rest: &[Vec3<f64>], part: f64) -> Vec<Vec3<f64>> {
    rest.iter()
        .map(|&p| {
            let distance = (p - GRIP).length();
            p + PULL * (part * libm::exp(-distance * distance / (2.0 * 0.045 * 0.045)))
        })
        .collect()
}
