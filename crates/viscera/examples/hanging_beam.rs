//! A beam of liver tissue, held at one end, bends under its own weight.

use viscera::material::{Material, MaterialModel};
use viscera::mesh::shapes;
use viscera::model::ModelBuilder;
use viscera::scalar::vec3;
use viscera::settings::SolverSettings;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

/// Builds the beam, runs a second and says how far it hangs.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = shapes::beam(0.08, 0.03, 0.03, 3, 0.0)?; // length, width, height [m]; cells across; no cut
    let tissue = Material::new(MaterialModel::StableNeoHookean, 5e3, 0.45, 1060.0)?;
    let settings = SolverSettings::default();
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue)?;
    let model = builder.build::<f32>()?;

    let wall = (0u32..).zip(mesh.vertices()).filter(|(_, x)| x.x < 1e-6);
    let pins = wall.map(|(vertex, x)| Pin { vertex, target: x.cast() }).collect();
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), pins, ..Inputs::default() };
    let mut state = State::at_rest(&model);
    let mut solver = Solver::new(&model, &settings);
    for _ in 0..600 {
        solver.step(&model, &mut state, &inputs, 1.0 / 600.0)?; // one second
    }
    let lowest = state.positions.iter().map(|x| x.z).fold(f32::INFINITY, f32::min);
    println!("after one second the tip hangs {:.0} mm below the wall", -1e3 * lowest);
    Ok(())
}
