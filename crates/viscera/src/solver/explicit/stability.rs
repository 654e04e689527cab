//! How large a small step may be.
//!
//! ```text
//! h <= (2/omega) (sqrt(1 + xi^2) - xi),   xi = eta omega/2       with viscosity eta
//! omega^2 <= max_i sum_(e at i) c rho(K_e)/m_i
//! ```
//!
//! With `c = 1` the bound holds for every shape of which the stiffness of elements is known. It is too large by 1.4 to 1.8
//! at rest, where the largest frequency of a part is found by Lanczos' iteration (spectrum.rs); `c` is what it is smaller by,
//! but never below the squared share of the stable step that is taken, or the share itself with viscosity: no small step is longer than is stable by the bound.

use super::spectrum::largest_eigenvalues;
use crate::elements::kinds::{Energy, Kind};
use crate::elements::shape_gradients;
use crate::layout::{ElementSet, Layout, Part};
use crate::model::for_each_kind;
use crate::scalar::{Mat3, Real};
use crate::settings::SolverSettings;
use crate::solver::error::StepError;
use crate::solver::oscillations::Growth;
use crate::solver::step::tethers::Bundle;

/// More small steps than this in one step are a mistake of units rather than patience.
const MOST_SMALL_STEPS: f64 = 100_000.0;

#[cfg(feature = "gpu")]
/// The share of the stable step at most, where small steps are those of the shape at rest whatever happens.
const AT_REST_ONLY: f64 = 0.5;

/// Rounds of the power method for an element's stiffness: 1 % is enough for a bound with a margin.
const POWER_ROUNDS: usize = 20;

/// Quantities that the largest stable small step depends on.
#[derive(Clone, Debug)]
pub struct Stability {
    /// The largest small step [s] of the stiffest part without tethers, with the margin of the settings.
    pub step: f64,
    /// Of the elements around each vertex, the user's order [N/m].
    stiffness: Vec<f64>,
    parts: Vec<PartStability>,
    /// The share of the limit that small steps take.
    pub safety: f64,
}

/// Of one connected part of the model.
#[derive(Clone, Copy, Debug, Default)]
struct PartStability {
    /// Largest [1/s].
    frequency: f64,
    /// What the stiffness of tetrahedra counts, `c`.
    share: f64,
    /// Largest [s].
    viscosity: f64,
}

impl PartStability {
    /// The largest small step [s] with this largest frequency [1/s].
    fn limit(&self, frequency: f64) -> f64 {
        let xi = 0.5 * self.viscosity * frequency;
        (2.0 / frequency) * ((1.0 + xi * xi).sqrt() - xi)
    }
}

impl Stability {
    /// Of a model.
    pub fn new<S: Real>(layout: &Layout<S>, settings: &SolverSettings) -> Self {
        Self::with(layout, settings.explicit_safety)
    }

    /// Of a model whose small steps do not follow the present shape.
    #[cfg(feature = "gpu")]
    pub fn for_a_device<S: Real>(layout: &Layout<S>, settings: &SolverSettings) -> Self {
        Self::with(layout, settings.explicit_safety.min(AT_REST_ONLY))
    }

    fn with<S: Real>(layout: &Layout<S>, safety: f64) -> Self {
        let (stiffness, parts) = part_stability(layout, safety);
        let mut stability = Self { step: f64::INFINITY, stiffness, parts, safety };
        stability.step = stability.step(layout, &[]);
        stability
    }

    /// The largest small step [s] of the stiffest part with these tethers.
    pub fn step<S: Real>(&self, layout: &Layout<S>, tethers: &[Bundle<S>]) -> f64 {
        self.steps(layout, tethers).fold(f64::INFINITY, f64::min)
    }

    /// The largest small step [s] of each part with these tethers, sorted by vertex.
    pub fn steps<S: Real>(
        &self,
        layout: &Layout<S>,
        tethers: &[Bundle<S>],
    ) -> impl Iterator<Item = f64> {
        let mut tethers = tethers.iter().peekable();
        self.parts.iter().zip(layout.parts.iter()).map(move |(stability, part)| {
            let mut frequency = stability.frequency;
            while let Some(tether) = tethers.next_if(|t| t.vertex < part.vertices.end) {
                let v = layout.numbering.order[tether.vertex] as usize;
                let stiffness = self.stiffness[v] + tether.stiffness.to_f64();
                frequency = frequency.max((stiffness / layout.masses[v].to_f64()).sqrt());
            }
            self.safety * stability.limit(frequency)
        })
    }

    /// The largest small step [s] of a part where its largest frequency is this one [1/s], without margin.
    pub fn limit(&self, part: usize, frequency: f64) -> f64 {
        self.parts[part].limit(frequency)
    }

    /// What the stiffness of a part's tetrahedra counts: at most one.
    pub fn share(&self, part: usize) -> f64 {
        self.parts[part].share
    }

    /// The largest viscosity [s] in a part.
    pub fn viscosity(&self, part: usize) -> f64 {
        self.parts[part].viscosity
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.stiffness[..]) + size_of_val(&self.parts[..])
    }
}

/// Of the elements around each vertex [N/m], and what of it decides in each part; `safety` is the share of the stable step
/// that is taken.
fn part_stability<S: Real>(layout: &Layout<S>, safety: f64) -> (Vec<f64>, Vec<PartStability>) {
    let mut stiffness = vec![0.0; layout.vertex_count()];
    let mut parts = vec![PartStability::default(); layout.part_count()];
    for set in &layout.tet_sets {
        for tet in layout.tets(set) {
            let material = &layout.materials[tet.material];
            let viscosity =
                &mut parts[layout.part_at(layout.numbering.of(tet.vertices[0]))].viscosity;
            *viscosity = viscosity.max(material.viscosity.to_f64());
            let shape = tet.inverse_rest_shape.cast::<f64>();
            let lame = [material.lame_lambda, material.lame_mu].map(Real::to_f64);
            let largest = tet.rest_volume.to_f64() * element_stiffness(&shape, lame);
            for v in tet.vertices {
                stiffness[v as usize] += largest;
            }
        }
    }
    let bounds = largest_of_parts(layout, &stiffness);
    let largest = largest_eigenvalues(layout);
    for (stability, (largest, bound)) in parts.iter_mut().zip(largest.into_iter().zip(bounds)) {
        // The limit goes with `1/omega`, with much viscosity with its square.
        let least = if stability.viscosity > 0.0 { safety } else { safety * safety };
        // Also where a part has no tetrahedra.
        stability.share = (largest / bound).max(least).min(1.0);
    }
    for (v, stiffness) in stiffness.iter_mut().enumerate() {
        *stiffness *= parts[layout.part_at(layout.numbering.of(v as u32))].share;
    }
    for_each_kind!(layout, set => add_stiffness(set, layout, &mut stiffness));
    for (stability, bound) in parts.iter_mut().zip(largest_of_parts(layout, &stiffness)) {
        stability.frequency = bound.sqrt();
    }
    (stiffness, parts)
}

/// The largest of stiffness [N/m] over mass in each part [1/s^2].
fn largest_of_parts<S: Real>(layout: &Layout<S>, stiffness: &[f64]) -> Vec<f64> {
    let largest = |part: &Part| {
        let vertices = layout.numbering.order[part.vertices.clone()].iter().map(|&v| v as usize);
        let ratios = vertices.map(|v| stiffness[v] / layout.masses[v].to_f64());
        ratios.fold(0.0, f64::max)
    };
    layout.parts.iter().map(largest).collect()
}

/// Adds the stiffness of the elements of one kind to their vertices [N/m].
fn add_stiffness<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    layout: &Layout<S>,
    stiffness: &mut [f64],
) {
    for (i, vertices) in set.vertices.iter().enumerate() {
        let of_element = set.list.element::<f64>(i, &layout.rest_anchors).stiffness();
        for &v in vertices {
            stiffness[v as usize] += of_element;
        }
    }
}

/// The largest eigenvalue of a tetrahedron's stiffness at rest, per volume [Pa/m^2]. Both laws have the
/// same stiffness at rest: that of linear elasticity.
pub(super) fn element_stiffness(shape: &Mat3<f64>, [lambda, mu]: [f64; 2]) -> f64 {
    let g = shape_gradients(shape);
    // Any displacement but a rigid one will do; swelling and shear together meet every eigenvector.
    let mut u = [g[1] + g[2] * 0.3, g[2] - g[0] * 0.2, g[3] + g[0] * 0.7, g[1] * -0.4 + g[0]];
    let mut value = 0.0;
    for _ in 0..POWER_ROUNDS {
        let length = u.iter().map(|u| u.length_squared()).sum::<f64>().sqrt();
        let mut gradient = Mat3::ZERO;
        for (u, g) in u.iter().zip(g) {
            gradient = gradient + Mat3::outer(*u * (1.0 / length), g);
        }
        let stress =
            (gradient + gradient.transpose()) * mu + Mat3::IDENTITY * (lambda * gradient.trace());
        for (u, g) in u.iter_mut().zip(g) {
            *u = stress * g;
        }
        value = u.iter().map(|u| u.length_squared()).sum::<f64>().sqrt();
    }
    value
}

/// What a small step makes of an oscillation that turns by an angle in it: drift, kick, drift turns it by `phi`,
/// `cos phi = 1 - angle^2/2`, and neither damps it nor lets it grow while `angle < 2`.
pub fn growth(angle: f64) -> Growth {
    Growth { logarithm: 0.0, angle: 2.0 * libm::asin((0.5 * angle).min(1.0)) }
}

/// Substeps of a frame [s] in which every substep has some [`FEWEST`] small steps, of `stable` [s] at most: what moves or
/// loads the body is followed as often as costs next to nothing.
pub fn substeps_for(stable: f64, frame: f64) -> u32 {
    (frame / stable / FEWEST).clamp(1.0, MOST_SUBSTEPS) as u32
}

/// A substep costs as much as two or three small steps besides.
const FEWEST: f64 = 32.0;

/// As many as settings ask for that leave substeps to the explicit method on a device.
const MOST_SUBSTEPS: f64 = 10.0;

/// How many small steps, of `stable` [s] at most, make a step of `dt` [s].
pub fn small_steps(dt: f64, stable: f64) -> Result<u32, StepError> {
    let count = (dt / stable).ceil().max(1.0);
    if count <= MOST_SMALL_STEPS {
        return Ok(count as u32);
    }
    Err(StepError::TooStiff { dt, stable })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drift, kick, drift on `x'' = -x` from rest, step after step.
    #[test]
    fn growth_is_that_of_small_steps() {
        for h in [0.01, 0.3, 1.9] {
            let found = growth(h);
            let (mut x, mut v) = (1.0, 0.0);
            for step in 1..=7 {
                x += 0.5 * h * v;
                v -= h * x;
                x += 0.5 * h * v;
                let expected = libm::cos(f64::from(step) * found.angle);
                assert!((x - expected).abs() < 1e-13, "{h}: {x} of {expected}");
            }
            assert_eq!(found.logarithm, 0.0);
        }
    }
}
