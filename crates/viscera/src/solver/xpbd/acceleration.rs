//! Acceleration of a fixed-point iteration `q <- g(q)` on `q = (x, l)`.
//!
//! Chebyshev (Wang, "A Chebyshev Semi-Iterative Approach for Accelerating Projective and
//! Position-Based Dynamics", TOG 2015, eq. 12 and 13):
//!
//! ```text
//! omega = 1 for k < S, then 2/(2 - rho^2), then 4/(4 - rho^2 omega)
//! q_(k+1) = omega (gamma (g(q_k) - q_k) + q_k - q_(k-1)) + q_(k-1)
//! ```
//!
//! Anderson, type II (Peng et al., "Anderson Acceleration for Geometry Optimization and Physics
//! Simulation", TOG 2018, eq. 5 to 7): with `G_k = g(q_k)`, `R_k = G_k - q_k`
//!
//! ```text
//! w = argmin | R_k + sum_j w_j (R_(k-j) - R_k) |
//! q_(k+1) = G_k + sum_j w_j (G_(k-j) - G_k)
//! ```
//!
//! in the norm `|R|^2 = sum m |dx|^2 + sum a~ dl^2`; positions and multipliers take the same
//! weights, because affine combinations keep `M (x - xt) = J^T l` where the constraints are
//! nearly linear. Mixing positions alone breaks that tie and stiffens the tissue.

#![allow(unsafe_code)]

use crate::scalar::Real;
pub use crate::solver::cpu::products::LARGEST_WINDOW;
use crate::solver::cpu::products::{PIECE, Products, products};
use crate::solver::cpu::threads::{Shared, Workers};

/// Numbers that a thread mixes at a time.
const GRAIN: usize = 1 << 15;

/// Weight of the last Chebyshev step and what is known of the spectral radius.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Chebyshev {
    iteration: u32,
    omega: f64,
    radius: f64,
    last_change: f64,
}

/// Measured spectral radii are kept below this: at 1 the weights no longer contract.
const LARGEST_RADIUS: f64 = 0.9999;

impl Chebyshev {
    /// Forgets the last solve. `radius` 0 means: measure it.
    pub fn start(&mut self, radius: f64) {
        *self = Self { iteration: 0, omega: 1.0, radius, last_change: 0.0 };
    }

    /// The weight `omega` of the iteration that has just changed `q` by `change` (a norm).
    pub fn weight(&mut self, change: f64, delay: u32, measured: bool) -> f64 {
        let k = self.iteration;
        self.iteration += 1;
        if k < delay {
            // The last ratio of plain iterations is the best estimate: the slowest mode has had
            // the most time to dominate.
            if measured && self.last_change > 0.0 {
                self.radius = (change / self.last_change).min(LARGEST_RADIUS);
            }
            self.last_change = change;
            self.omega = 1.0;
        } else {
            let squared = self.radius * self.radius;
            self.omega =
                if k == delay { 2.0 / (2.0 - squared) } else { 4.0 / (4.0 - squared * self.omega) };
        }
        self.omega
    }
}

/// `q_(k+1)` from `g = g(q_k)`, `q = q_k`, `older = q_(k-1)`, written over `g`.
pub fn chebyshev_update<S: Real>(g: &mut S, q: S, older: S, omega: S, gamma: S) {
    *g = if omega == S::ONE {
        // There need not be anything before the first iterate.
        gamma * (*g - q) + q
    } else {
        omega * (gamma * (*g - q) + q - older) + older
    };
}

/// History of an Anderson iteration over flat vectors. All memory is taken at the start.
#[derive(Clone, Debug)]
pub struct Anderson<S> {
    window: usize,
    /// Mapped iterates `G`, newest at `newest`; shape [window + 1][length].
    mapped: Vec<Vec<S>>,
    /// Residuals `R`, same places.
    residuals: Vec<Vec<S>>,
    newest: usize,
    /// Number of valid entries.
    count: usize,
    last_norm: f64,
    partial: Vec<Products>,
}

impl<S: Real> Anderson<S> {
    /// History for vectors of the given length.
    pub fn new(window: usize, length: usize) -> Self {
        let window = window.min(LARGEST_WINDOW);
        let slots = window + 1;
        Self {
            window,
            mapped: vec![vec![S::ZERO; length]; slots],
            residuals: vec![vec![S::ZERO; length]; slots],
            newest: 0,
            count: 0,
            last_norm: f64::INFINITY,
            partial: vec![Products::default(); length.div_ceil(PIECE)],
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        let histories = self.mapped.iter().chain(&self.residuals);
        let histories: usize = histories.map(|vector| size_of_val(&vector[..])).sum();
        histories + size_of_val(&self.partial[..])
    }

    /// Forgets everything.
    pub fn start(&mut self) {
        self.count = 0;
        self.last_norm = f64::INFINITY;
    }

    /// Enters `G = g(q)` for the iterate `q`: returns where to write `G` and `R = G - q`.
    pub fn push(&mut self) -> (&mut [S], &mut [S]) {
        // One slot more than the window: the newest iterate and `window` older ones. The oldest is overwritten.
        self.newest = (self.newest + 1) % (self.window + 1);
        self.count = (self.count + 1).min(self.window + 1);
        (&mut self.mapped[self.newest], &mut self.residuals[self.newest])
    }

    /// `G_k`, and whether there is anything older to mix it with.
    pub fn newest(&self) -> (&[S], bool) {
        (&self.mapped[self.newest], self.count > 1)
    }

    /// The history entry `age` steps back.
    fn place(&self, age: usize) -> usize {
        (self.newest + self.window + 1 - age) % (self.window + 1)
    }

    /// Weights of the older iterates, newest first, for the norm `sum weight_i r_i^2`; returns
    /// how many there are. With `guard`, a residual that has grown restarts the history.
    pub fn mixing_weights(
        &mut self,
        norm_weights: &[S],
        guard: bool,
    ) -> ([f64; LARGEST_WINDOW], usize) {
        self.weights_by(&Workers::one(), norm_weights, guard)
    }

    /// As [`Anderson::mixing_weights`], by threads.
    pub(crate) fn weights_by(
        &mut self,
        workers: &Workers,
        norm_weights: &[S],
        guard: bool,
    ) -> ([f64; LARGEST_WINDOW], usize) {
        let mut older = self.count.saturating_sub(1);
        // An array, because a step allocates nothing; entries beyond `older` repeat the oldest and are not read.
        let history: [&[S]; LARGEST_WINDOW] = std::array::from_fn(|j| {
            let age = (j + 1).min(older);
            let place = (self.newest + self.window + 1 - age) % (self.window + 1);
            self.residuals[place].as_slice()
        });
        let newest = &self.residuals[self.newest];
        let partial = &mut self.partial;
        let mut products = products(workers, norm_weights, newest, history, older, partial);
        // Both norms are squared. A residual that has grown says that the last extrapolation went wrong. One entry
        // stays, so that this sweep is taken as it is (no weights) and the next is mixed with it.
        if guard && products.norm > self.last_norm {
            self.count = 1;
            older = 0;
        }
        self.last_norm = products.norm;
        // In single precision the residuals themselves carry round-off of that size.
        let regularisation = if S::EPSILON > 1e-10 { 1e-7 } else { 1e-13 };
        // `|R + sum w_j d_j|` is least where `sum_k (d_j . d_k) w_k = -d_j . R`.
        for value in &mut products.right {
            *value = -*value;
        }
        (least_squares(products.gram, products.right, older, regularisation), older)
    }

    /// `G_k + sum_j w_j (G_(k-j) - G_k)`, the components from `first` on.
    pub fn mix(&self, weights: &[f64], first: usize, into: &mut [S]) {
        self.mix_by(&Workers::one(), weights, first, into);
    }

    /// As [`Anderson::mix`], by threads.
    pub(crate) fn mix_by(&self, workers: &Workers, weights: &[f64], first: usize, into: &mut [S]) {
        // Differences to the newest and not weights that sum to one: near the fixed point they are small, and so is
        // what rounding makes of them. A component that no sweep has changed stays to the bit.
        let into = Shared::new(into);
        workers.each(into.len(), GRAIN, |range| {
            let places = first + range.start..first + range.end;
            let newest = &self.mapped[self.newest][places.clone()];
            // SAFETY: every place is worked on once.
            let into = unsafe { into.range(range) };
            into.copy_from_slice(newest);
            for (j, &weight) in weights.iter().enumerate() {
                let older = &self.mapped[self.place(j + 1)][places.clone()];
                let weight = S::from_f64(weight);
                for ((sum, &older), &newest) in into.iter_mut().zip(older).zip(newest) {
                    *sum += weight * (older - newest);
                }
            }
        });
    }
}

/// Solves `gram w = right` (lower triangle, the first `n` rows) with columns scaled to unit
/// length and a small multiple of the identity added, by Cholesky. Columns without length get
/// weight zero.
fn least_squares(
    mut gram: [[f64; LARGEST_WINDOW]; LARGEST_WINDOW],
    mut right: [f64; LARGEST_WINDOW],
    n: usize,
    regularisation: f64,
) -> [f64; LARGEST_WINDOW] {
    // Residuals shrink from sweep to sweep by orders of magnitude. Unscaled, a regularisation that suits the oldest
    // differences would be far above the newest; with columns of length 1 it is relative to each.
    let mut scale = [0.0; LARGEST_WINDOW];
    for j in 0..n {
        scale[j] = if gram[j][j] > 0.0 { 1.0 / gram[j][j].sqrt() } else { 0.0 };
    }
    for j in 0..n {
        for k in 0..=j {
            gram[j][k] *= scale[j] * scale[k];
        }
        // Two differences in nearly one direction have huge weights of opposite signs, which rounding decides; the
        // addend bounds them. A column without length becomes a row of the identity, with the answer zero.
        gram[j][j] += if scale[j] > 0.0 { regularisation } else { 1.0 };
        right[j] *= scale[j];
    }
    // `gram = L L^T`, L over the lower triangle. Rounding can make the last pivots zero or negative: the floor keeps
    // the root from NaN, which would reach every position.
    for j in 0..n {
        for k in 0..=j {
            let mut value = gram[j][k];
            for i in 0..k {
                value -= gram[j][i] * gram[k][i];
            }
            gram[j][k] = if k < j { value / gram[k][k] } else { value.max(regularisation).sqrt() };
        }
    }
    // L y = right, then L^T w = y; last the scales, because the weights are asked for unscaled differences.
    for j in 0..n {
        for k in 0..j {
            right[j] -= gram[j][k] * right[k];
        }
        right[j] /= gram[j][j];
    }
    for j in (0..n).rev() {
        for k in j + 1..n {
            right[j] -= gram[k][j] * right[k];
        }
        right[j] /= gram[j][j];
    }
    for j in 0..n {
        right[j] *= scale[j];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear fixed-point map of n unknowns is solved by n + 1 Anderson steps of window n.
    #[test]
    fn anderson_solves_a_linear_map_in_as_many_steps_as_unknowns() {
        let matrix = [[0.5, 0.3, -0.1], [0.2, 0.6, 0.2], [-0.3, 0.1, 0.7]];
        let shift = [1.0, -2.0, 0.5];
        let map = |q: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| shift[i] + (0..3).map(|j| matrix[i][j] * q[j]).sum::<f64>())
        };
        let mut anderson = Anderson::<f64>::new(3, 3);
        anderson.start();
        let mut q = [0.0; 3];
        for _ in 0..5 {
            let g = map(q);
            let (mapped, residual) = anderson.push();
            mapped.copy_from_slice(&g);
            for i in 0..3 {
                residual[i] = g[i] - q[i];
            }
            let (weights, count) = anderson.mixing_weights(&[1.0; 3], false);
            anderson.mix(&weights[..count], 0, &mut q);
        }
        let g = map(q);
        for i in 0..3 {
            assert!((g[i] - q[i]).abs() < 1e-8, "{q:?} is not a fixed point: {g:?}");
        }
    }

    /// On a symmetric map with spectrum in [-rho, rho], k Chebyshev steps reduce the error by
    /// 1/T_k(1/rho), far below rho^k.
    #[test]
    fn chebyshev_beats_the_plain_iteration_by_its_polynomial() {
        let eigenvalues = [-0.95, -0.5, 0.1, 0.7, 0.95];
        let rho: f64 = 0.95;
        let steps = 40;
        let mut state = Chebyshev::default();
        state.start(rho);
        let mut q = [1.0f64; 5];
        let mut older = q;
        for _ in 0..steps {
            let previous = q;
            // The theory starts with one plain step, which has no iterate before it.
            let omega = state.weight(1.0, 1, false);
            for i in 0..5 {
                let mut g = eigenvalues[i] * previous[i];
                chebyshev_update(&mut g, previous[i], older[i], omega, 1.0);
                q[i] = g;
            }
            older = previous;
        }
        let t = (f64::from(steps) * (1.0 / rho).acosh()).cosh();
        let worst = q.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        assert!(worst < 3.0 / t, "error {worst:e} after {steps} steps; theory {:e}", 1.0 / t);
        assert!(worst < 1e-3 * rho.powi(steps));
    }
}
