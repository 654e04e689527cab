//! The slowest oscillation about a state of rest, by inverse iteration.
//!
//! ```text
//! K phi = omega^2 M phi:   phi <- K^-1 M phi,   phi^T M phi = 1,   omega^2 = phi^T K phi
//! ```
//!
//! `K`: Hessian of the elastic potential where the body rests; `M`: lumped masses. Bathe, "Finite
//! Element Procedures", 2nd ed. 2014, section 11.2.1.

use viscera::scalar::Vec3;
use viscera::solver::Inputs;

use super::matrix::FactorError;
use super::objective::Load;
use super::{Analysis, Reference, ReferenceError, dead_loads, fixing, objective};

/// Iterations at most. Of the error of `omega^2` each leaves the fourth power of the ratio of the
/// two lowest frequencies, a fortieth and less in a slender bar.
const STEPS: u32 = 500;

/// Done when `omega^2` changes by this share of itself.
const RELATIVE: f64 = 1e-12;

/// What of `omega^2` the last two steps may differ by where that is not reached: two modes that are
/// nearly equally slow pass into each other slowly.
const NEARLY: f64 = 1e-6;

/// An oscillation of small amplitude.
#[derive(Clone, Debug)]
pub struct Mode {
    /// Angular frequency [rad/s].
    pub omega: f64,
    /// Displacements, normalised so that `sum_i m_i |shape_i|^2 = 1` [kg^-1/2], shape [vertex_count].
    pub shape: Vec<Vec3<f64>>,
}

impl Reference {
    /// The slowest oscillation about the state of rest `x` [m], of those that move the body's weight
    /// along `direction`: a bar of square cross-section bends as slowly to either side.
    pub fn lowest_mode(
        &mut self,
        x: &[Vec3<f64>],
        inputs: &Inputs<f64>,
        direction: Vec3<f64>,
    ) -> Result<Mode, ReferenceError> {
        if !self.lumped {
            return Err(ReferenceError::NoStep);
        }
        if !(direction.is_finite() && direction.length_squared() > 0.0) {
            return Err(ReferenceError::NotFinite { what: "direction" });
        }
        let pinned = self.check(x, inputs)?;
        if let Some(loose) = fixing::find_loose(&self.problem, inputs, &pinned, x) {
            return Err(ReferenceError::Loose { vertex: loose.vertex, turns: loose.turns });
        }
        let mut analysis = self.analyse(pinned)?;
        let cost = self.check_memory(&analysis)?;
        let objective =
            objective(&self.problem, inputs, Load::Forces(dead_loads(&self.problem, inputs)));
        let Analysis { pattern, factorization, .. } = &mut analysis;
        let hessian = objective.hessian(x, pattern, false);
        factorization.factorize(pattern, &hessian).map_err(|error| match error {
            FactorError::TooLarge => self.too_large(&cost),
            FactorError::Indefinite | FactorError::Stopped => ReferenceError::Unstable,
        })?;
        let masses = &self.problem.masses;
        let weighted = |shape: &[Vec3<f64>]| -> Vec<Vec3<f64>> {
            shape.iter().zip(masses).map(|(u, mass)| *u * *mass).collect()
        };
        let mut mode = Mode { omega: 0.0, shape: vec![direction; x.len()] };
        let (mut squared, mut before_last) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..STEPS {
            let load = weighted(&mode.shape);
            let mut shape = factorization.solve(pattern, &load);
            let inertia = product(&shape, &weighted(&shape));
            let next = product(&shape, &load) / inertia;
            let norm = 1.0 / inertia.sqrt();
            for u in &mut shape {
                *u = *u * norm;
            }
            mode = Mode { omega: next.sqrt(), shape };
            if (next - squared).abs() <= RELATIVE * next {
                self.analysis = Some(analysis);
                return Ok(mode);
            }
            (before_last, squared) = (squared, next);
        }
        let known = mode.omega * mode.omega;
        self.analysis = Some(analysis);
        if (known - before_last).abs() <= NEARLY * known {
            return Ok(mode);
        }
        Err(ReferenceError::NoMode { steps: STEPS })
    }
}

fn product(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
