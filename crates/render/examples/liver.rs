//! The procedural liver, a tenth of a second after its right end was let go, drawn without a window:
//!
//! `cargo run --release -p viscera-render --example liver -- liver.png`

use std::error::Error;

use viscera::material::{Material, MaterialModel};
use viscera::mesh::embed::Embedding;
use viscera::mesh::shapes;
use viscera::model::ModelBuilder;
use viscera::scalar::{Vec3, vec3};
use viscera::settings::SolverSettings;
use viscera::solver::gpu::{Adapter, GpuSolver, GpuSurface, Skin};
use viscera::solver::{Inputs, Pin};
use viscera_picture::{Color, ImageSize, write_png};
use viscera_render::{Look, Offscreen, Orbit};

/// Edge of the tetrahedra [m].
const SPACING: f64 = 0.02;
/// Frames of one sixtieth of a second.
const FRAMES: u32 = 6;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).unwrap_or_else(|| "liver.png".to_owned());
    let liver = shapes::liver(SPACING, 1.0)?;
    let tissue = Material::new(MaterialModel::StableNeoHookean, 5e3, 0.45, 1060.0)?;
    let settings = SolverSettings { substeps: 1, iterations: 20, ..SolverSettings::default() };
    let mut builder = ModelBuilder::new();
    builder.add_body(&liver.tets, &tissue)?;
    let model = builder.build::<f32>(&settings)?;

    let device = Adapter::find(None)?.open()?;
    let mut solver = GpuSolver::new(&device, &model, &settings)?;
    let embedding = Embedding::new(&liver.tets, &liver.surface)?;
    let skin = Skin { embedding: &embedding, triangles: &liver.surface.triangles, first_vertex: 0 };
    let surface = GpuSurface::new(&solver, &model, &[skin])?;

    // Its left half is held.
    let places = liver.tets.vertices();
    let middle = places.iter().map(|x| x.x).sum::<f64>() / places.len() as f64;
    let held = (0..).zip(places).filter(|(_, x)| x.x < middle);
    let pins =
        held.map(|(vertex, x): (u32, &Vec3<f64>)| Pin { vertex, target: x.cast() }).collect();
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), pins, ..Inputs::default() };
    for _ in 0..FRAMES {
        solver.step(&model, &inputs, 1.0 / 60.0)?;
    }
    surface.update();

    let look =
        Look { orbit: Orbit::framing(&liver.surface.vertices), aspect: 1.0, color: Color::TISSUE };
    let offscreen = Offscreen::new(&device, ImageSize::new(960, 720)?)?;
    let image = offscreen.draw(&look, &[&surface])?;
    std::fs::write(&file, write_png(&image)?)?;
    println!("{file}: {} tetrahedra on {}", model.tet_count(), device.name());
    Ok(())
}
