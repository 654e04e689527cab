//! Soft position constraints to moving targets, which come and go between steps: what tools hold tissue by.
//!
//! ```text
//! 1/2 m |x - xt|^2 + dt^2 k/2 |x - a|^2 = 1/2 m' |x - xt'|^2 + const
//! m' = m + dt^2 k,   y = x_n + dt v + dt^2 g,   xt' = y + dt^2 (f + k (a - y))/m'
//! ```
//!
//! A spring without length on one vertex is a heavier vertex with another inertial prediction: completing the
//! square takes it into the step exactly, implicitly, and without a constraint, so that it costs no
//! colour, no multiplier and no new model. Constraint formulations, guards and accelerations know nothing of it; the
//! energy limit does, because kinetic energy is that of the mass alone.

use crate::layout::Layout;
use crate::scalar::{Real, Vec3};
use crate::solver::inputs::{Inputs, Tether};

/// All tethers of one vertex together, which pull like a single one of their summed stiffness to the mean
/// of their targets, weighted by stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bundle<S> {
    /// The solver's number.
    pub vertex: usize,
    /// [N/m].
    pub stiffness: S,
    /// [m].
    pub target: Vec3<S>,
}

impl<S: Real> Bundle<S> {
    /// On the vertex at `x` [N].
    pub fn force(&self, x: Vec3<S>) -> Vec3<S> {
        (self.target - x) * self.stiffness
    }

    /// With the vertex at `x` [J].
    pub fn energy(&self, x: Vec3<S>) -> f64 {
        let away = (self.target - x).cast::<f64>();
        0.5 * self.stiffness.to_f64() * away.length_squared()
    }
}

/// The tethers of a step, vertex by vertex; takes no memory where `bundles` has room. One alone keeps its
/// bits.
pub fn bundle<S: Real>(layout: &Layout<S>, inputs: &Inputs<S>, bundles: &mut Vec<Bundle<S>>) {
    bundles.clear();
    let pulling = inputs.tethers.iter().filter(|tether| tether.stiffness > S::ZERO);
    bundles.extend(pulling.map(|&Tether { vertex, target, stiffness }| Bundle {
        vertex: layout.numbering.of(vertex),
        stiffness,
        target,
    }));
    // What is the same to the sorting is added in whatever order: by all of its numbers, then.
    let key = |bundle: &Bundle<S>| {
        let [x, y, z] = bundle.target.to_array().map(S::to_f64);
        [bundle.stiffness.to_f64(), x, y, z]
    };
    bundles.sort_unstable_by(|a, b| {
        let numbers =
            || key(a).iter().zip(key(b)).map(|(a, b)| a.total_cmp(&b)).find(|o| o.is_ne());
        a.vertex.cmp(&b.vertex).then_with(|| numbers().unwrap_or(std::cmp::Ordering::Equal))
    });
    bundles.dedup_by(|next, kept| {
        if next.vertex != kept.vertex {
            return false;
        }
        let sum = kept.stiffness + next.stiffness;
        kept.target += (next.target - kept.target) * (next.stiffness / sum);
        kept.stiffness = sum;
        true
    });
}
