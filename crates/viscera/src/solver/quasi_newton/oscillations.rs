//! The oscillations that a load in proportion to mass excites, which tell how many steps follow the motion.
//!
//! ```text
//! (M + h^2 K) d_1 = M e for each axis e, h long;   (M + h^2 K) d_j+1 = M v_j;   v_j: d_j made orthonormal by M
//! T = V^T (M + h^2 K) V = Q L Q^T;   w_k^2 = (L_k - 1)/h^2,   a_k = |d_1|_M Q_1k/sqrt(m),   m: the part's mass
//! ```
//!
//! Lanczos' iteration from the static response: its nodes and weights are those of Gauss' quadrature over all
//! oscillations (Golub, Meurant, "Matrices, Moments and Quadrature", 2010). Systems are solved by conjugate gradients with the
//! preconditioner at hand; products with `K` are differences of the gradient. What the solves leave is not lost: `T` is
//! made of products that were found.

use super::preconditioner::Curvature;
use super::{Memory, Way, moments, vectors};
use crate::scalar::{Real, Vec3, vec3};
use crate::solver::oscillations::{Oscillation, Oscillations};
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::predict::Tethers;
use crate::solver::step::strain::put_strains;

/// Iterations at most; a residual this much smaller than the load is small enough.
const ITERATIONS: usize = 15;
const RESIDUAL: f64 = 0.03;

/// Oscillations that are told apart along each axis.
const ROUNDS: usize = 3;

/// A step [s] that is far longer than any period, so that stiffness decides and viscosity does not.
const LONG: f64 = 100.0;

/// Displacement of a difference, as a share of the body's extent.
const DIFFERENCE: f64 = 1e-4;

/// What is left of a vector by round-off when those before it are taken out, as a share.
const NOTHING: f64 = 1e-3;

/// A vector of a part, and its product with `M + h^2 K`.
struct Basis<S> {
    vector: Vec<Vec3<S>>,
    product: Vec<Vec3<S>>,
}

impl<S: Real> Memory<S> {
    /// See [`crate::solver::Solver::oscillations`]. Positions and velocities of `data` are lost.
    pub fn oscillations(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) -> Oscillations {
        let layout = step.layout;
        let step = Step { dt: LONG, ..*step };
        data.read_positions(layout, &layout.rest_positions);
        data.prepare(&step, Tethers::AsInertia);
        data.constants.previous.copy_from_slice(&data.points);
        data.constants.predicted.copy_from_slice(&data.points);
        self.base.copy_from_slice(&data.points);
        self.stage_start.copy_from_slice(&data.points);
        for number in 0..layout.part_count() {
            put_strains(&mut data.constants, layout, number, &data.points, S::ZERO);
        }
        self.preconditioner.fit(layout, &data.constants);
        let curvature =
            Curvature { dt: step.dt, x: &self.base, moments: moments(&step, &self.stage_start) };
        for number in 0..layout.part_count() {
            self.preconditioner.refresh(&step, &data.constants, &curvature, number);
        }
        self.gradient_at(&step, data, |_| true);
        self.start_velocities.copy_from_slice(&self.trial_gradient);
        let axes = [vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0)];
        let held = (0..layout.part_count())
            .filter(|&number| data.constants.holds(number, &layout.parts[number]))
            .collect::<Vec<_>>();
        Oscillations::new(held.into_iter().map(|number| {
            axes.iter().flat_map(|&axis| self.along_axis(axis, &step, data, number)).collect()
        }))
    }

    /// The gradient at the trial, of some parts.
    fn gradient_at(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        acts: impl Fn(usize) -> bool + Sync,
    ) {
        let Self { evaluation, base, stage_start, trial_gradient, .. } = self;
        let StepData { constants, points, loads, .. } = data;
        let way = Way { from: base, to: points, moments: moments(step, stage_start) };
        evaluation.gradient(constants, step, &way, acts, loads, trial_gradient);
    }

    /// Those of a part that a load along an axis excites; none where that tells nothing.
    fn along_axis(
        &mut self,
        axis: Vec3<f64>,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        number: usize,
    ) -> Vec<Oscillation> {
        let range = step.layout.parts[number].vertices.clone();
        let mut mass = 0.0;
        for v in range.clone() {
            mass += data.constants.masses[v].to_f64();
            let is_free = data.constants.inverse_masses[v] != S::ZERO;
            let load = axis.cast::<S>() * data.constants.masses[v];
            self.gradient[v] = if is_free { load } else { Vec3::ZERO };
        }
        let mut basis: Vec<Basis<S>> = Vec::new();
        let mut moved = 0.0;
        for round in 0..ROUNDS {
            let Some(mut new) = self.give_way(step, data, number) else { break };
            let inertia = |a: &[Vec3<S>], b: &[Vec3<S>]| -> f64 {
                let mass = |i: usize| data.constants.masses[range.start + i].to_f64();
                a.iter().zip(b).enumerate().map(|(i, (a, b))| mass(i) * a.dot(*b).to_f64()).sum()
            };
            let whole = inertia(&new.vector, &new.vector);
            // Twice: the first time takes what the second would leave by round-off.
            for before in basis.iter().chain(&basis) {
                new.add(before, -inertia(&new.vector, &before.vector));
            }
            let left = inertia(&new.vector, &new.vector);
            // What is no number is nothing either.
            let is_new = left > NOTHING * NOTHING * whole;
            if !is_new {
                break;
            }
            if round == 0 {
                moved = left / mass;
            }
            new.scale(1.0 / left.sqrt());
            for (v, &vector) in range.clone().zip(&new.vector) {
                self.gradient[v] = vector * data.constants.masses[v];
            }
            basis.push(new);
        }
        let product = |a: usize, b: usize| -> f64 {
            vectors::dot(&data.constants.workers, &basis[a].vector, &basis[b].product)
        };
        let mut matrix = [[0.0; ROUNDS]; ROUNDS];
        for a in 0..basis.len() {
            for b in 0..basis.len() {
                matrix[a][b] = 0.5 * (product(a, b) + product(b, a));
            }
        }
        let (values, vectors) = eigenvectors(matrix);
        let oscillation = |k: usize| {
            let squared = (values[k] - 1.0) / (LONG * LONG);
            let period = 2.0 * std::f64::consts::PI / squared.sqrt();
            Oscillation { period, weight: moved * vectors[0][k] * vectors[0][k] }
        };
        // What is no number is no oscillation.
        (0..ROUNDS).map(oscillation).collect()
    }

    /// How a part gives way to the load in `gradient`: conjugate gradients. Nothing where no direction is found.
    fn give_way(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        number: usize,
    ) -> Option<Basis<S>> {
        let range = step.layout.parts[number].vertices.clone();
        // `gradient` is the residual, `trial_z` the solution, `direction` that of conjugate gradients.
        for v in range.clone() {
            self.first_velocities[v] = self.gradient[v];
            self.trial_z[v] = Vec3::ZERO;
            self.direction[v] = Vec3::ZERO;
        }
        let enough = RESIDUAL * RESIDUAL * self.along(data, number, |m| [&m.gradient, &m.gradient]);
        let mut rz = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let Self { preconditioner, gradient, z, .. } = self;
            let (r, into) = (&gradient[range.clone()], &mut z[range.clone()]);
            preconditioner.apply(&data.constants.workers, number, r, into);
            let before = rz;
            rz = self.along(data, number, |m| [&m.gradient, &m.z]);
            let share = S::from_f64(rz / before);
            for v in range.clone() {
                self.direction[v] = self.z[v] + self.direction[v] * share;
            }
            if !self.stiffen(step, data, number) {
                break;
            }
            let length = rz / self.along(data, number, |m| [&m.direction, &m.trial_gradient]);
            if !(length > 0.0 && length.is_finite()) {
                break;
            }
            let length = S::from_f64(length);
            for v in range.clone() {
                self.trial_z[v] += self.direction[v] * length;
                self.gradient[v] = self.gradient[v] - self.trial_gradient[v] * length;
            }
            if self.along(data, number, |m| [&m.gradient, &m.gradient]) < enough {
                break;
            }
        }
        let vector = self.trial_z[range.clone()].to_vec();
        let product = range.map(|v| self.first_velocities[v] - self.gradient[v]).collect();
        vector.iter().any(|d| *d != Vec3::ZERO).then_some(Basis { vector, product })
    }

    /// The product of two vectors of a part.
    fn along<'a>(
        &'a self,
        data: &StepData<S>,
        number: usize,
        vectors: impl FnOnce(&'a Self) -> [&'a Vec<Vec3<S>>; 2],
    ) -> f64 {
        let [a, b] = vectors(self);
        let range = self.preconditioner.vertices(number);
        vectors::dot(&data.constants.workers, &a[range.clone()], &b[range])
    }

    /// `(M + h^2 K) d` of a part into `trial_gradient`, by a difference; false of a direction that is none.
    fn stiffen(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, number: usize) -> bool {
        let range = step.layout.parts[number].vertices.clone();
        let first = self.base[range.start].vec3();
        let (low, high) = range.clone().fold((first, first), |(low, high), v| {
            (low.min(self.base[v].vec3()), high.max(self.base[v].vec3()))
        });
        let extent = (high - low).length().to_f64();
        let largest =
            range.clone().fold(0.0, |most: f64, v| most.max(self.direction[v].length().to_f64()));
        if !(largest > 0.0 && largest.is_finite() && extent > 0.0) {
            return false;
        }
        let small = S::from_f64(DIFFERENCE * extent / largest);
        for v in range.clone() {
            data.points[v].set_vec3(self.base[v].vec3() + self.direction[v] * small);
        }
        self.gradient_at(step, data, |part| part == number);
        data.points[range.clone()].copy_from_slice(&self.base[range.clone()]);
        let inverse = S::ONE / small;
        for v in range {
            let change = self.trial_gradient[v] - self.start_velocities[v];
            self.trial_gradient[v] = change * inverse;
        }
        true
    }
}

impl<S: Real> Basis<S> {
    /// So much of another one.
    fn add(&mut self, other: &Self, share: f64) {
        let share = S::from_f64(share);
        for (into, of) in [(&mut self.vector, &other.vector), (&mut self.product, &other.product)] {
            into.iter_mut().zip(of).for_each(|(a, b)| *a += *b * share);
        }
    }

    fn scale(&mut self, by: f64) {
        let by = S::from_f64(by);
        self.vector.iter_mut().chain(&mut self.product).for_each(|a| *a = *a * by);
    }
}

/// Eigenvalues of a symmetric matrix, and its eigenvectors as columns: Jacobi's rotations. Rows and columns of zeros make zeros.
fn eigenvectors<const N: usize>(mut matrix: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut vectors = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    // Off-diagonal entries fall quadratically: five or six times around are enough for 3 x 3.
    for _ in 0..12 {
        for p in 0..N {
            for q in p + 1..N {
                if matrix[p][q] == 0.0 {
                    continue;
                }
                let theta = 0.5 * (matrix[q][q] - matrix[p][p]) / matrix[p][q];
                let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
                let sine = tangent * cosine;
                let turn = |a: &mut f64, b: &mut f64| {
                    (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
                };
                for row in matrix.iter_mut().chain(&mut vectors) {
                    let (left, right) = row.split_at_mut(q);
                    turn(&mut left[p], &mut right[0]);
                }
                let (above, below) = matrix.split_at_mut(q);
                above[p].iter_mut().zip(&mut below[0]).for_each(|(a, b)| turn(a, b));
            }
        }
    }
    (std::array::from_fn(|k| matrix[k][k]), vectors)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `A Q = Q L` with `Q` orthonormal, of two matrices; the eigenvalues of the first are 1, 2 and 3.
    #[test]
    fn eigenvectors_of_a_symmetric_matrix() {
        let matrix = [[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
        let mixed = [[3.0, 1.0, 0.0], [1.0, 3.0, 1.0], [0.0, 1.0, 3.0]];
        for matrix in [matrix, mixed] {
            let (values, vectors) = eigenvectors(matrix);
            for k in 0..3 {
                for i in 0..3 {
                    let product: f64 = (0..3).map(|j| matrix[i][j] * vectors[j][k]).sum();
                    assert!((product - values[k] * vectors[i][k]).abs() < 1e-14);
                }
            }
        }
        let (mut values, _) = eigenvectors(matrix);
        values.sort_by(f64::total_cmp);
        for (value, expected) in values.into_iter().zip([1.0, 2.0, 3.0]) {
            assert!((value - expected).abs() < 1e-14);
        }
    }
}
