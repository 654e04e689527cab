//! Measures of a state: strains, stresses, energies. In double precision, in the user's order.
//!
//! ```text
//! J = det F                                       relative volume
//! s_1 >= s_2 >= |s_3|, F = U diag(s) V^T         principal stretches; s_3 < 0 where J < 0
//! sigma = P F^T / J                               Cauchy stress
//! von Mises = sqrt(3/2 dev(sigma) : dev(sigma))
//! ```

use crate::elements::kinds::{Energy, Kind};
use crate::elements::singular_values::signed_svd;
use crate::elements::{deformation_gradient, law};
use crate::model::{ElementList, for_each_kind};
use crate::model::{Model, Tet};
use crate::scalar::{Mat3, Real, Vec3};
use crate::solver::Inputs;
use crate::state::State;

/// The measures of one tetrahedron.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TetMeasure {
    /// Rest volume [m^3].
    pub rest_volume: f64,
    /// Relative volume `J`; zero or less where inverted.
    pub volume_ratio: f64,
    /// Principal stretches, largest first.
    pub stretches: [f64; 3],
    /// Von Mises stress [Pa] of the Cauchy stress.
    pub von_mises: f64,
    /// Elastic energy density [Pa] of the rest volume.
    pub energy_density: f64,
}

impl TetMeasure {
    /// Whether it is turned inside out, flat, or NaN.
    pub fn is_inverted(&self) -> bool {
        // Written so that a volume that is NaN counts.
        !matches!(self.volume_ratio.partial_cmp(&0.0), Some(std::cmp::Ordering::Greater))
    }
}

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

/// Stress of a collapsed tetrahedron is divided by at least this relative volume, so that it
/// stays a number.
const SMALLEST_VOLUME_RATIO: f64 = 1e-6;

/// Measures every tetrahedron; `measures` gets the user's order, shape [tet_count].
pub fn measure_tets<S: Real>(
    model: &Model<S>,
    positions: &[Vec3<S>],
    measures: &mut Vec<TetMeasure>,
) {
    measures.clear();
    measures.resize(model.tet_count(), TetMeasure::default());
    for (tet, measure) in model.tets().zip(measures) {
        *measure = measure_tet(model, positions, &tet);
    }
}

fn measure_tet<S: Real>(model: &Model<S>, positions: &[Vec3<S>], tet: &Tet<S>) -> TetMeasure {
    let x = tet.vertices.map(|v| positions[v as usize].cast::<f64>());
    let f = deformation_gradient(&x, &tet.inverse_rest_shape.cast());
    let material = &model.materials[tet.material as usize];
    let (lambda, mu) = (material.lame_lambda.to_f64(), material.lame_mu.to_f64());
    let (energy_density, piola) = law::respond(tet.law, &f, lambda, mu);
    let volume_ratio = f.determinant();
    let divisor = volume_ratio.abs().max(SMALLEST_VOLUME_RATIO).copysign(volume_ratio);
    let cauchy = piola * f.transpose() * (1.0 / divisor);
    TetMeasure {
        rest_volume: tet.rest_volume.to_f64(),
        volume_ratio,
        stretches: signed_svd(&f).sigma,
        von_mises: von_mises(&cauchy),
        energy_density,
    }
}

fn von_mises(cauchy: &Mat3<f64>) -> f64 {
    let pressure = cauchy.trace() / 3.0;
    let deviator = *cauchy - Mat3::IDENTITY * pressure;
    (1.5 * deviator.norm_squared()).sqrt()
}

/// Energies of a state.
pub fn measure_energies<S: Real>(
    model: &Model<S>,
    state: &State<S>,
    inputs: &Inputs<S>,
    tets: &[TetMeasure],
) -> Energies {
    let mut energies = Energies::default();
    for tet in tets {
        energies.elastic += tet.rest_volume * tet.energy_density;
    }
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

/// Extremes and sums over tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct DeformationSummary {
    /// Present volume over rest volume.
    pub volume_ratio: f64,
    /// Largest principal stretch.
    pub largest_stretch: f64,
    /// Smallest principal stretch; negative where a tetrahedron is inverted.
    pub smallest_stretch: f64,
    /// Number of tetrahedra with `J <= 0`.
    pub inverted: usize,
}

/// Summarises measures of tetrahedra.
pub fn summarize_deformation(tets: &[TetMeasure]) -> DeformationSummary {
    let (mut rest, mut now) = (0.0, 0.0);
    let mut summary = DeformationSummary {
        volume_ratio: 1.0,
        largest_stretch: 0.0,
        smallest_stretch: f64::INFINITY,
        inverted: 0,
    };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    #[test]
    fn von_mises_of_uniaxial_stress_is_that_stress() {
        let cauchy =
            Mat3::from_columns(vec3(250.0, 0.0, 0.0), vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 0.0));
        assert!((von_mises(&cauchy) - 250.0).abs() < 1e-12);
        assert!(von_mises(&(Mat3::IDENTITY * 40.0)) < 1e-12);
    }
}
