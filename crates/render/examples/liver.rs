//! The procedural liver, a tenth of a second after its right end was let go, drawn without a window:
//!
//! `cargo run --release -p viscera-render --example liver -- liver.png`
//!
//! With `--everything` in colours of displacement, with its triangles, what is held, a pull, a shadow and the
//! shape at rest as a ghost.

use std::error::Error;
use std::slice;

use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::embed::Embedding;
use viscera::mesh::shapes;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Vec3, vec3};
use viscera::settings::{Count, SolverSettings};
use viscera::solver::gpu::{Adapter, Device, GpuSolver, GpuSurface, Skin};
use viscera::solver::{Inputs, Pin};
use viscera_picture::{Color, ColorScale, ImageSize, Overlay, write_png};
use viscera_render::{
    Arrow, BodyView, BoundingSphere, Canvas, GpuDrawing, Markers, Orbit, Paint, Quality,
    ScaledValues, ValueBuffer,
};

/// Edge of the tetrahedra [m].
const SPACING: f64 = 0.02;
/// Frames of one sixtieth of a second.
const FRAMES: u32 = 6;

fn main() -> Result<(), Box<dyn Error>> {
    let (flags, files): (Vec<_>, Vec<_>) =
        std::env::args().skip(1).partition(|argument| argument.starts_with("--"));
    if let Some(flag) = flags.iter().find(|flag| *flag != "--everything") {
        return Err(format!("{flag} is unknown; there is --everything").into());
    }
    let file = files.first().map_or("liver.png", String::as_str);
    let liver = shapes::liver(SPACING, 1.0)?;
    let tissue = Material::new(MaterialModel::StableNeoHookean, 5e3, 0.45, 1060.0)?;
    let settings = SolverSettings {
        substeps: Count::Of(1),
        iterations: Count::Of(20),
        ..SolverSettings::xpbd()
    };
    let mut builder = ModelBuilder::new();
    builder.add_body(&liver.tets, &tissue)?;
    let model = builder.build::<f32>()?;

    let device = Adapter::find(None)?.open()?;
    let mut solver = GpuSolver::new(&device, &model, &settings)?;
    let embedding = Embedding::new(&liver.tets, &liver.surface)?;
    let skin = Skin { embedding: &embedding, triangles: &liver.surface.triangles, first_vertex: 0 };
    let surface = GpuSurface::new(&solver, &model, &[skin])?;

    let held = left_half(&liver.tets);
    fall(&mut solver, &model, &held)?;
    surface.update();

    let orbit = Orbit::framing(&liver.surface.vertices);
    let mut drawing =
        GpuDrawing { bodies: vec![BodyView::of(&surface)], ..GpuDrawing::from(orbit) };
    let rest = GpuSurface::following(&device, liver.tets.vertices().len(), &[skin])?;
    let values = ValueBuffer::new(&device, liver.surface.vertices.len());
    let held: Vec<_> = held.into_iter().map(|(_, x)| x).collect();
    let now: Vec<Vec3<f64>> = surface.read()?[0].iter().map(|x| x.cast()).collect();
    let picked = now.iter().copied().reduce(|a, b| if a.x > b.x { a } else { b });
    let picked = picked.unwrap_or_default();
    let mut scale = None;
    if !flags.is_empty() {
        rest.place(&liver.tets.vertices().iter().map(|x| x.cast()).collect::<Vec<_>>())?;
        rest.update();
        let extras = Extras {
            values: &values,
            rest: &rest,
            at_rest: &liver.surface.vertices,
            now: &now,
            held: &held,
            picked: &picked,
        };
        scale = extras.add(&mut drawing)?;
    }
    let canvas = Canvas::new(&device, ImageSize::new(960, 640)?, quality(&device))?;
    canvas.draw(&drawing)?;
    let mut image = canvas.read()?;
    let overlay = Overlay {
        title: "Liver",
        caption: "a tenth of a second after its right end was let go",
        color_scale: scale.as_ref(),
        pixels_per_meter: Some(orbit.pixels_per_meter(image.size().height())),
        ..Overlay::default()
    };
    overlay.draw(&mut image);
    std::fs::write(file, write_png(&image)?)?;
    println!("{file}: {} tetrahedra on {}", model.tet_count(), device.name());
    Ok(())
}

/// One picture may take its time: smooth edges everywhere.
fn quality(device: &Device) -> Quality {
    Quality { smooth_edges: true, ..Quality::suited_to(device) }
}

/// Vertices of the left half, and where they are [m].
fn left_half(mesh: &TetMesh) -> Vec<(u32, Vec3<f64>)> {
    let places = mesh.vertices();
    let middle = places.iter().map(|x| x.x).sum::<f64>() / places.len() as f64;
    (0..).zip(places.iter().copied()).filter(|(_, x)| x.x < middle).collect()
}

fn fall(
    solver: &mut GpuSolver,
    model: &Model<f32>,
    held: &[(u32, Vec3<f64>)],
) -> Result<(), Box<dyn Error>> {
    let pins = held.iter().map(|&(vertex, x)| Pin { vertex, target: x.cast() }).collect();
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), pins, ..Inputs::default() };
    for _ in 0..FRAMES {
        solver.step(model, &inputs, 1.0 / 60.0)?;
    }
    Ok(())
}

/// What `--everything` adds.
struct Extras<'a> {
    values: &'a ValueBuffer,
    rest: &'a GpuSurface,
    /// The surface's vertices at rest and now [m].
    at_rest: &'a [Vec3<f64>],
    now: &'a [Vec3<f64>],
    /// Vertices that are held, and the one that is pulled [m].
    held: &'a [Vec3<f64>],
    picked: &'a Vec3<f64>,
}

impl<'a> Extras<'a> {
    /// Returns what the colours mean.
    fn add(&self, drawing: &mut GpuDrawing<'a>) -> Result<Option<ColorScale>, Box<dyn Error>> {
        let [tissue] = drawing.bodies.as_mut_slice() else { return Ok(None) };
        let moved = |(a, b): (&Vec3<f64>, &Vec3<f64>)| (*a - *b).length() as f32;
        let moved: Vec<f32> = self.now.iter().zip(self.at_rest).map(moved).collect();
        self.values.write(&moved)?;
        let largest = moved.iter().copied().fold(0.0, f32::max);
        let scale = ColorScale::rounded("displacement [mm]", 0.0, 1e3 * f64::from(largest))?;
        let high = 1e-3 * scale.range()[1] as f32;
        tissue.paint = Paint::Values(ScaledValues { buffer: self.values, low: 0.0, high });
        tissue.wireframe = true;
        let color = Color::REST;
        let ghost =
            BodyView { paint: Paint::Flat(color), opacity: 0.25, ..BodyView::of(self.rest) };
        drawing.bodies.push(ghost);

        let extent = drawing.orbit.distance;
        let from = *self.picked;
        let to = from + vec3(0.06, 0.0, 0.12) * extent;
        let radius = 0.004 * extent;
        let mark =
            |positions, radius, color| Markers { positions, radius, color, see_through: 0.0 };
        drawing.markers.push(mark(self.held, 0.003 * extent, Color::FIXED));
        drawing.markers.push(mark(slice::from_ref(self.picked), 2.0 * radius, Color::PULLED));
        drawing.arrows.push(Arrow { from, to, radius, color: Color::PULLED });
        drawing.shadow = BoundingSphere::around(self.now.iter().copied());
        Ok(Some(scale))
    }
}
