//! Measures of a state: strains, stresses, energies. In double precision, in the user's order.
//!
//! ```text
//! J = det F                                       relative volume
//! s_1 >= s_2 >= |s_3|, F = U diag(s) V^T         principal stretches; s_3 < 0 where J < 0
//! sigma = P F^T / J                               Cauchy stress
//! von Mises = sqrt(3/2 dev(sigma) : dev(sigma))
//! ```

mod tissue;

pub use tissue::{
    DeformationSummary, TetMeasure, TissueMeasure, measure_tets, measure_tets_by_pieces,
    measure_tissue,
};

use crate::elements::kinds::{Energy, Kind};
use crate::model::Model;
use crate::model::{ElementList, for_each_kind};
use crate::scalar::{Real, Vec3};
use crate::solver::Inputs;
use crate::state::State;

/// Sums over a model.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Energies {
    /// Elastic energy [J] of tetrahedra, springs and attachments.
    pub elastic: f64,
    /// Kinetic energy [J].
    pub kinetic: f64,
    /// Potential energy [J] in gravity, zero at rest.
    pub gravitational: f64,
}

impl Energies {
    /// Their sum [J].
    pub fn total(&self) -> f64 {
        self.elastic + self.kinetic + self.gravitational
    }
}

/// Energies of a state; `tissue` is measured in it.
pub fn measure_energies<S: Real>(
    model: &Model<S>,
    state: &State<S>,
    inputs: &Inputs<S>,
    tissue: &TissueMeasure,
) -> Energies {
    let mut energies = Energies { elastic: tissue.elastic_energy, ..Energies::default() };
    let elastic = &mut energies.elastic;
    for_each_kind!(model, set => add_energies(set, model, state, inputs, elastic));
    let gravity = inputs.gravity.cast::<f64>();
    for v in 0..model.vertex_count() {
        let mass = model.masses[v].to_f64();
        let velocity = state.velocities[v].cast::<f64>();
        let moved = state.positions[v].cast::<f64>() - model.rest_positions[v].cast();
        energies.kinetic += 0.5 * mass * velocity.length_squared();
        energies.gravitational -= mass * gravity.dot(moved);
    }
    energies
}

/// Adds the energies [J] of the elements of one kind.
fn add_energies<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementList<S, K, N, M>,
    model: &Model<S>,
    state: &State<S>,
    inputs: &Inputs<S>,
    sum: &mut f64,
) {
    let anchors = inputs.anchors_of(&model.rest_anchors);
    for (i, vertices) in set.vertices.iter().enumerate() {
        let x = vertices.map(|v| state.positions[v as usize].cast::<f64>());
        *sum += set.element::<f64>(i, anchors).energy(&x);
    }
}

/// Summarises measures of tetrahedra.
pub fn summarize_deformation(tets: &[TetMeasure]) -> DeformationSummary {
    let (mut rest, mut now) = (0.0, 0.0);
    let mut summary = DeformationSummary::default();
    for tet in tets {
        rest += tet.rest_volume;
        now += tet.rest_volume * tet.volume_ratio;
        summary.largest_stretch = summary.largest_stretch.max(tet.stretches[0]);
        summary.smallest_stretch = summary.smallest_stretch.min(tet.stretches[2]);
        summary.inverted += usize::from(tet.is_inverted());
    }
    if rest > 0.0 {
        summary.volume_ratio = now / rest;
    }
    summary
}

/// Displacements from rest [m] and their largest length.
pub fn measure_displacements<S: Real>(
    model: &Model<S>,
    positions: &[Vec3<S>],
    displacements: &mut Vec<Vec3<f64>>,
) -> f64 {
    displacements.clear();
    let pairs = positions.iter().zip(&model.rest_positions);
    displacements.extend(pairs.map(|(x, rest)| x.cast::<f64>() - rest.cast()));
    displacements.iter().fold(0.0, |largest: f64, u| largest.max(u.length()))
}
