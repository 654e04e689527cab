//! What a step gives to the device: what acts on vertices, and the weights of its norm.

use super::buffers::Buffers;
use super::layout::copy_offsets;
use super::slots::Update;
use super::solver::GpuSolver;
use crate::model::Model;
use crate::settings::{Acceleration, AndersonOn, Method, SolverSettings};
use crate::solver::inputs::Inputs;
use crate::solver::step::tethers::bundle;
use crate::solver::xpbd::iterates::fill_multiplier_weights;

impl GpuSolver {
    /// What acts on vertices in this step, and the freedom of those that the last one held.
    pub(super) fn collect_updates(&mut self, model: &Model<f32>, inputs: &Inputs<f32>, dt: f64) {
        bundle(model, inputs, &mut self.tethers);
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
        let of = |vertex: u32| model.numbering.of(vertex) as u32;
        let holds: Vec<usize> = self.holds.iter().map(|hold| update(hold.vertex)).collect();
        let forces: Vec<(usize, [f32; 3])> = (inputs.forces.iter())
            .map(|&(vertex, force)| (update(of(vertex)), force.to_array()))
            .collect();
        let pins: Vec<(usize, [f32; 3])> =
            inputs.pins.iter().map(|pin| (update(of(pin.vertex)), pin.target.to_array())).collect();
        let tethers: Vec<usize> =
            self.tethers.iter().map(|tether| update(tether.vertex as u32)).collect();
        let anchors = inputs.anchors_of(model);
        for (place, hold) in holds.into_iter().zip(&self.holds) {
            self.updates[place].place = hold.place(anchors);
            self.updates[place].stiffness = hold.stiffness as f32;
        }
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
        let squared_dt = match self.settings.method {
            Method::Xpbd => (dt * dt) as f32,
            Method::Explicit => 0.0,
        };
        for update in &mut self.updates {
            self.update_of[update.vertex as usize] = u32::MAX;
            let mass = model.masses[model.numbering.order[update.vertex as usize] as usize];
            update.inertia = mass + update.stiffness * squared_dt;
            if update.is_pinned != 0 || update.force != [0.0; 3] || update.stiffness != 0.0 {
                self.touched.push(update.vertex);
            }
        }
    }
}

/// Weights of the norm in which iterates are compared, for a step of `dt` [s].
pub(super) fn norm_weights(
    model: &Model<f32>,
    settings: &SolverSettings,
    buffers: &Buffers,
    dt: f64,
) -> Vec<f32> {
    let mut weights = vec![0.0; buffers.length as usize];
    let (positions, multipliers) = weights.split_at_mut((buffers.multipliers_start / 4) as usize);
    for (four, &v) in positions.as_chunks_mut::<4>().0.iter_mut().zip(&model.numbering.order) {
        let mass = model.masses[v as usize];
        *four = [mass, mass, mass, 0.0];
    }
    fill_multiplier_weights(model, dt, multipliers);
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
    let mut copies = copy_offsets(model);
    copies.resize(positions.len() / 4, model.copy_count() as u32);
    for (four, first) in positions.as_chunks_mut::<4>().0.iter_mut().zip(copies) {
        four[3] = f32::from_bits(first);
    }
    weights
}
