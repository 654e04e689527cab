//! For tests inside the solver: a model of everything, and the memory in the middle of a step.

use super::Inputs;
use super::cpu::Memory;
use super::step::data::Step;
use super::step::stage::StepStage;
use crate::layout::Layout;
use crate::material::{Material, MaterialModel};
use crate::mesh::shapes::Block;
use crate::model::ModelBuilder;
use crate::scalar::lanes::Point;
use crate::scalar::{Vec3, vec3};
use crate::settings::{SolverSettings, Start};
use crate::state::State;

/// Two bars of different laws, both viscous, springs between them, and attachments.
pub(super) fn everything(
    settings: &SolverSettings,
    laws: [MaterialModel; 2],
    poisson: f64,
) -> Layout<f64> {
    let mesh = Block::new(vec3(0.04, 0.02, 0.02), [2, 1, 1]).mesh().expect("a bar");
    let mut builder = ModelBuilder::new();
    for law in laws {
        let tissue = Material::new(law, 1e4, poisson, 1000.0).expect("legal");
        builder.add_body(&mesh, &tissue.with_viscosity(0.02).expect("legal")).expect("a body");
    }
    let count = mesh.vertices().len() as u32;
    for v in (0..count).step_by(3) {
        builder.add_spring([v, count + v], 40.0, Some(0.01)).expect("a spring");
        let anchor = mesh.vertices()[v as usize] + vec3(2e-3, 0.0, 1e-3);
        builder.add_attachment(v, anchor, 30.0).expect("an attachment");
    }
    Layout::new(&builder.build().expect("a model"), settings)
}

/// Memory that has begun a step from `places`, at rest there.
pub(super) fn begun(step: &Step<'_, f64>, places: &[Vec3<f64>]) -> Memory<f64> {
    let mut memory = Memory::new(step.layout, step.settings);
    let mut state = State {
        positions: places.to_vec(),
        velocities: vec![Vec3::ZERO; places.len()],
        multipliers: vec![0.0; step.layout.multiplier_count],
        multiplier_dt: 0.0,
        learned: Default::default(),
        contact: Default::default(),
    };
    for stage in [
        StepStage::ReadState,
        StepStage::MeasureStrain,
        StepStage::Predict { start: Start::Previous, is_kept: true },
    ] {
        memory.run(&stage.into(), step, &mut state);
    }
    memory
}

/// A step of `dt` [s] in which nothing acts from outside.
pub(super) fn quiet<'a>(
    layout: &'a Layout<f64>,
    inputs: &'a Inputs<f64>,
    settings: &'a SolverSettings,
    dt: f64,
) -> Step<'a, f64> {
    Step { layout, inputs, dt, settings }
}

/// Moves every point by some tenths of a millimetre.
pub(super) fn shake(points: &mut [Point<f64>]) {
    for (v, point) in points.iter_mut().enumerate() {
        let phase = v as f64;
        let away = vec3((7.0 * phase).sin(), (11.0 * phase).sin(), (13.0 * phase).cos());
        point.set_vec3(point.vec3() + away * 5e-4);
    }
}
