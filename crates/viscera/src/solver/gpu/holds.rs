//! Attachments on the device in an explicit step, vertex by vertex.

use crate::model::Model;
use crate::scalar::Vec3;

/// The attachments of one vertex: together they pull like a single one to the mean of their anchors,
/// weighted by stiffness. A vertex advances by itself, so that a small step needs no third dispatch.
#[derive(Clone, Debug)]
pub(super) struct Hold {
    /// The solver's number.
    pub vertex: u32,
    /// Sum [N/m].
    pub stiffness: f64,
    /// The user's number of each attachment, and its stiffness [N/m].
    attachments: Vec<(usize, f64)>,
}

impl Hold {
    /// One for each vertex that is attached.
    pub fn all(model: &Model<f32>) -> Vec<Self> {
        let mut holds: Vec<Self> = Vec::new();
        let mut hold_of = vec![usize::MAX; model.vertex_count()];
        let held = &model.attachments;
        for (i, &v) in held.vertices.iter().enumerate() {
            let vertex = model.numbering.of(v);
            if hold_of[vertex] == usize::MAX {
                hold_of[vertex] = holds.len();
                let vertex = vertex as u32;
                holds.push(Self { vertex, stiffness: 0.0, attachments: Vec::new() });
            }
            let hold = &mut holds[hold_of[vertex]];
            let stiffness = f64::from(held.stiffness[i]);
            hold.stiffness += stiffness;
            hold.attachments.push((held.order[i] as usize, stiffness));
        }
        holds
    }

    /// Where it pulls to [m]; `anchors` in the user's order. One anchor keeps its bits.
    pub fn place(&self, anchors: &[Vec3<f32>]) -> [f32; 3] {
        let mut sum = Vec3::ZERO;
        for &(i, stiffness) in &self.attachments {
            sum += anchors[i].cast::<f64>() * (stiffness / self.stiffness);
        }
        sum.cast::<f32>().to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Adapter, GpuSolver, Slot};
    use crate::material::{Material, MaterialModel};
    use crate::mesh::shapes::Block;
    use crate::model::ModelBuilder;
    use crate::scalar::vec3;
    use crate::settings::{Method, SolverSettings};
    use crate::solver::{Inputs, Pin, Solver};
    use crate::state::State;

    /// A force balance of the mean acceleration needs it.
    #[test]
    fn prediction_is_the_processor_s() {
        let settings = SolverSettings { method: Method::Explicit, ..SolverSettings::default() };
        let mesh = Block::new(vec3(0.04, 0.02, 0.02), [2, 1, 1]).mesh().expect("a block");
        let law = MaterialModel::StableNeoHookean;
        let mut builder = ModelBuilder::new();
        let tissue = Material::new(law, 1e4, 0.4, 1000.0).expect("a legal material");
        builder.add_body(&mesh, &tissue).expect("a body");
        let model = builder.build::<f32>(&settings).expect("a model");
        let device = Adapter::find(None).and_then(|adapter| adapter.open());
        let device = device.unwrap_or_else(|error| panic!("{error}"));
        let inputs = Inputs {
            gravity: vec3(0.0, 0.0, -9.81),
            pins: vec![Pin { vertex: 0, target: model.rest_positions[0] }],
            forces: vec![(5, vec3(0.01, 0.0, 0.0))],
            ..Inputs::default()
        };
        let (mut cpu, mut state) = (Solver::new(&model, &settings), State::at_rest(&model));
        let mut gpu = GpuSolver::new(&device, &model, &settings).expect("a model that fits");
        for _ in 0..3 {
            cpu.step(&model, &mut state, &inputs, 0.01).expect("a legal step");
            gpu.step(&model, &inputs, 0.01).expect("a legal step");
        }
        let bytes = gpu.read_buffer(Slot::Predicted).expect("a device");
        let found: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
        for (v, expected) in cpu.memory.data.constants.predicted.iter().enumerate() {
            let [x, y, z, _] = found[v];
            let away = (vec3(x, y, z) - expected.vec3()).length();
            // Some thousand roundings of places of 4 cm, which mostly cancel.
            assert!(away < 100.0 * 0.04 * f32::EPSILON, "vertex {v}: {away:e} m");
        }
    }
}
