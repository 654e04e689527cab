//! The device's inputs of a step: loads and holds of vertices, and the weights of its norm.

use super::buffers::Buffers;
use super::layout::copy_offsets;
use super::slots::Update;
use super::solver::GpuSolver;
use crate::layout::Layout;
use crate::settings::{Acceleration, AndersonOn, Method, SolverSettings};
use crate::solver::inputs::Inputs;
use crate::solver::step::tethers::bundle;
use crate::solver::xpbd::iterates::fill_multiplier_weights;

impl GpuSolver {
    /// Loads and holds of vertices in this step, and the freedom of those that the last one held; those that the device does
    /// not know from the last step are to be sent.
    pub(super) fn collect_updates(&mut self, layout: &Layout<f32>, inputs: &Inputs<f32>, dt: f64) {
        bundle(layout, inputs, &mut self.tethers);
        std::mem::swap(&mut self.updates, &mut self.updates_before);
        self.updates.clear();
        let (updates, update_of) = (&mut self.updates, &mut self.update_of);
        let mut update = |vertex: u32| {
            let place = &mut update_of[vertex as usize];
            if *place == u32::MAX {
                *place = updates.len() as u32;
                updates.push(Update { vertex, ..Update::default() });
            }
            *place as usize
        };
        for vertex in self.touched.drain(..) {
            update(vertex);
        }
        let of = |vertex: u32| layout.numbering.of(vertex) as u32;
        let forces: Vec<(usize, [f32; 3])> = (inputs.forces.iter())
            .map(|&(vertex, force)| (update(of(vertex)), force.to_array()))
            .collect();
        let pins: Vec<(usize, [f32; 3])> =
            inputs.pins.iter().map(|pin| (update(of(pin.vertex)), pin.target.to_array())).collect();
        let tethers: Vec<usize> =
            self.tethers.iter().map(|tether| update(tether.vertex as u32)).collect();
        for (place, tether) in tethers.into_iter().zip(&self.tethers) {
            self.updates[place].add_spring(tether.stiffness, tether.target);
        }
        for (place, force) in forces {
            for axis in 0..3 {
                self.updates[place].force[axis] += force[axis];
            }
        }
        for (place, target) in pins {
            self.updates[place].is_pinned = 1;
            self.updates[place].place = target;
            self.updates[place].stiffness = 0.0;
        }
        let is_free = |place: u32| self.updates[place as usize].is_pinned == 0;
        self.tethers.retain(|tether| is_free(self.update_of[tether.vertex]));
        // Small explicit steps take springs as forces.
        let he = dt * self.solve_share();
        let squared_dt = match self.settings.method {
            Method::Xpbd | Method::QuasiNewton => (he * he) as f32,
            Method::Explicit | Method::Auto => 0.0,
        };
        for update in &mut self.updates {
            self.update_of[update.vertex as usize] = u32::MAX;
            let mass = layout.masses[layout.numbering.order[update.vertex as usize] as usize];
            update.inertia = mass + update.stiffness * squared_dt;
            if update.is_pinned != 0 || update.force != [0.0; 3] || update.stiffness != 0.0 {
                self.touched.push(update.vertex);
            }
        }
        // The same vertices are held in the same order, step by step: what stands where it stood is there already.
        let bytes = bytemuck::bytes_of::<Update>;
        let all = self.updates.iter().enumerate();
        let is_new = |(place, update): &(usize, &Update)| {
            self.updates_before.get(*place).is_none_or(|before| bytes(before) != bytes(update))
        };
        self.updates_sent.clear();
        self.updates_sent.extend(all.filter(is_new).map(|(_, update)| *update));
    }
}

/// Weights of the norm in which iterates are compared, for a step of `dt` [s].
pub(super) fn norm_weights(
    layout: &Layout<f32>,
    settings: &SolverSettings,
    buffers: &Buffers,
    dt: f64,
) -> Vec<f32> {
    let mut weights = vec![0.0; buffers.length as usize];
    let (positions, multipliers) = weights.split_at_mut((buffers.multipliers_start / 4) as usize);
    for (four, &v) in positions.as_chunks_mut::<4>().0.iter_mut().zip(&layout.numbering.order) {
        let mass = layout.masses[v as usize];
        *four = [mass, mass, mass, 0.0];
    }
    fill_multiplier_weights(layout, dt, multipliers);
    if settings.acceleration == Acceleration::Anderson {
        match settings.anderson_on {
            AndersonOn::Positions => multipliers.fill(0.0),
            AndersonOn::Multipliers => positions.fill(0.0),
            AndersonOn::Both => {}
        }
    }
    // No weight, but the number of a vertex's first copy: Anderson joins them. What fills up behind the vertices
    // has none.
    let (positions, _) = weights.split_at_mut((buffers.multipliers_start / 4) as usize);
    let mut copies = copy_offsets(layout);
    copies.resize(positions.len() / 4, layout.copy_count() as u32);
    for (four, first) in positions.as_chunks_mut::<4>().0.iter_mut().zip(copies) {
        four[3] = f32::from_bits(first);
    }
    weights
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
        let settings = SolverSettings {
            method: Method::Explicit,
            explicit_safety: 0.5,
            ..SolverSettings::xpbd()
        };
        let mesh = Block::new(vec3(0.04, 0.02, 0.02), [2, 1, 1]).mesh().expect("a block");
        let law = MaterialModel::StableNeoHookean;
        let mut builder = ModelBuilder::new();
        let tissue = Material::new(law, 1e4, 0.4, 1000.0).expect("a legal material");
        builder.add_body(&mesh, &tissue).expect("a body");
        let model = builder.build::<f32>().expect("a model");
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
        let steps = (0.01 / gpu.stable_step()).ceil() as f32;
        let bytes = gpu.read_buffer(Slot::Predicted).expect("a device");
        let found: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
        for (v, expected) in cpu.memory.data.constants.predicted.iter().enumerate() {
            let [x, y, z, _] = found[v];
            let away = (vec3(x, y, z) - expected.vec3()).length();
            // A rounding of a place of 4 cm changes accelerations by up to `4/h^2` of it.
            assert!(away < 4.0 * steps * steps * 0.04 * f32::EPSILON, "vertex {v}: {away:e} m");
        }
    }
}
