//! Weighted products of a residual and the differences of older ones to it: what Anderson's small
//! least-squares problem is made of, in one pass over long vectors.

use std::ops::Range;

use super::threads::Workers;
use crate::scalar::Real;
use crate::scalar::lanes::{Kernel, LANES, Lanes, run};

/// The longest Anderson window.
pub const LARGEST_WINDOW: usize = 10;

/// Numbers whose products are summed first. Part of the result's bits.
pub const PIECE: usize = 1 << 13;

/// Numbers that are converted to double precision at a time: they stay in the first cache.
const BATCH: usize = 8 * LANES;

/// With `d_j = r_j - r` and the norm's weights `a`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Products {
    /// `sum a r r`.
    pub norm: f64,
    /// `sum a d_j r`.
    pub right: [f64; LARGEST_WINDOW],
    /// `sum a d_j d_k`, lower triangle.
    pub gram: [[f64; LARGEST_WINDOW]; LARGEST_WINDOW],
}

impl Products {
    fn plus(mut self, other: Self) -> Self {
        self.norm += other.norm;
        for j in 0..LARGEST_WINDOW {
            self.right[j] += other.right[j];
            for k in 0..=j {
                self.gram[j][k] += other.gram[j][k];
            }
        }
        self
    }
}

/// Products of the `newest` residual and the `older` first of `history`, in double precision.
pub fn products<S: Real>(
    workers: &Workers,
    weights: &[S],
    newest: &[S],
    history: [&[S]; LARGEST_WINDOW],
    older: usize,
    partial: &mut [Products],
) -> Products {
    let map = |range: Range<usize>| {
        let mut sum = Products::default();
        let history = &history[..older];
        run(workers.instructions, Piece { weights, newest, history, range, sum: &mut sum });
        sum
    };
    let work = (newest.len(), PIECE);
    workers.reduce(work, partial, map, Products::plus).unwrap_or_default()
}

struct Piece<'a, S> {
    weights: &'a [S],
    newest: &'a [S],
    history: &'a [&'a [S]],
    range: Range<usize>,
    sum: &'a mut Products,
}

type Batch = [f64; BATCH];

impl<S: Real> Kernel<S> for Piece<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        let mut differences = [[0.0; BATCH]; LARGEST_WINDOW];
        let mut start = self.range.start;
        while start < self.range.end {
            let end = (start + BATCH).min(self.range.end);
            let newest = converted(&self.newest[start..end]);
            let weights = converted(&self.weights[start..end]);
            let weighted = times(&weights, &newest);
            self.sum.norm += dot(&weighted, &newest);
            for (j, older) in self.history.iter().enumerate() {
                differences[j] = minus(&converted(&older[start..end]), &newest);
                self.sum.right[j] += dot(&differences[j], &weighted);
                let weighted = times(&weights, &differences[j]);
                for k in 0..=j {
                    self.sum.gram[j][k] += dot(&weighted, &differences[k]);
                }
            }
            start = end;
        }
    }
}

/// The last batch is padded with zeros.
#[inline(always)]
fn converted<S: Real>(values: &[S]) -> Batch {
    let mut batch = [0.0; BATCH];
    for (place, value) in batch.iter_mut().zip(values) {
        *place = value.to_f64();
    }
    batch
}

#[inline(always)]
fn times(a: &Batch, b: &Batch) -> Batch {
    let mut result = *a;
    for i in 0..BATCH {
        result[i] *= b[i];
    }
    result
}

#[inline(always)]
fn minus(a: &Batch, b: &Batch) -> Batch {
    let mut result = *a;
    for i in 0..BATCH {
        result[i] -= b[i];
    }
    result
}

/// Eight sums side by side, then their sum.
#[inline(always)]
fn dot(a: &Batch, b: &Batch) -> f64 {
    let mut sums = [0.0; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that follow no pattern a sum could hide behind.
    fn numbers(seed: usize, count: usize) -> Vec<f64> {
        let number = |i: usize| libm::sin((i * i % 7919) as f64 + seed as f64);
        (0..count).map(number).collect()
    }

    /// Several pieces, the last of them short: sums of all numbers, one after the other.
    #[test]
    fn products_are_sums_over_all_pieces() {
        let count = 2 * PIECE + 77;
        let (weights, newest) = (numbers(1, count), numbers(2, count));
        let older = [numbers(3, count), numbers(4, count)];
        let mut history: [&[f64]; LARGEST_WINDOW] = [&[]; LARGEST_WINDOW];
        history[..2].copy_from_slice(&[&older[0], &older[1]]);
        let mut partial = vec![Products::default(); 3];
        let found = products(&Workers::one(), &weights, &newest, history, 2, &mut partial);

        let difference = |j: usize, i: usize| older[j][i] - newest[i];
        let sum = |of: &dyn Fn(usize) -> f64| (0..count).map(|i| weights[i] * of(i)).sum::<f64>();
        // As many additions of numbers below four, in another order.
        let rounding = 4.0 * f64::EPSILON * (count * count) as f64;
        let expect = |found: f64, exact: f64| {
            assert!((found - exact).abs() < rounding, "{found}, not {exact}");
        };
        expect(found.norm, sum(&|i| newest[i] * newest[i]));
        for j in 0..2 {
            expect(found.right[j], sum(&|i| difference(j, i) * newest[i]));
            for k in 0..=j {
                expect(found.gram[j][k], sum(&|i| difference(j, i) * difference(k, i)));
            }
        }
    }
}
