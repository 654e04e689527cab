//! Sums over long vectors, in double precision and in an order that neither threads nor lanes change.

use std::ops::Range;

use crate::scalar::lanes::{Kernel, LANES, Lanes, run};
use crate::scalar::{Real, Vec3};
use crate::solver::cpu::threads::Workers;

/// Numbers whose products are summed first, at least; and how many such sums there are at most. Part of the result's
/// bits.
const PIECE: usize = 1 << 13;
const MOST_PIECES: usize = 256;

/// `a . b`.
pub fn dot<S: Real>(workers: &Workers, a: &[Vec3<S>], b: &[Vec3<S>]) -> f64 {
    let (a, b) = (Vec3::components(a), Vec3::components(b));
    let map = |range: Range<usize>| {
        let mut sum = 0.0;
        run(workers.instructions, Dot { a: &a[range.clone()], b: &b[range], sum: &mut sum });
        sum
    };
    let piece = PIECE.max(a.len().div_ceil(MOST_PIECES));
    workers.reduce((a.len(), piece), &mut [0.0; MOST_PIECES], map, |a, b| a + b).unwrap_or(0.0)
}

struct Dot<'a, S> {
    a: &'a [S],
    b: &'a [S],
    sum: &'a mut f64,
}

impl<S: Real> Kernel<S> for Dot<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        let (a, b) = (self.a.as_chunks::<LANES>(), self.b.as_chunks::<LANES>());
        let mut sums = [0.0; LANES];
        for (a, b) in a.0.iter().zip(b.0) {
            for lane in 0..LANES {
                sums[lane] += a[lane].to_f64() * b[lane].to_f64();
            }
        }
        for (lane, (a, b)) in a.1.iter().zip(b.1).enumerate() {
            sums[lane] += a.to_f64() * b.to_f64();
        }
        *self.sum = ((sums[0] + sums[4]) + (sums[2] + sums[6]))
            + ((sums[1] + sums[5]) + (sums[3] + sums[7]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    /// Several pieces, the last of them no whole number of lanes: as the sum over all numbers, one after the other.
    #[test]
    fn a_product_is_a_sum_over_all_pieces() {
        let count = PIECE + 77;
        let number = |i: usize| libm::sin((i * i % 7919) as f64);
        let vector = |seed: usize| {
            let at = move |i: usize| vec3(number(i + seed), number(2 * i), number(3 * i + seed));
            (0..count).map(at).collect::<Vec<Vec3<f64>>>()
        };
        let (a, b) = (vector(1), vector(5));
        let exact: f64 = a.iter().zip(&b).map(|(a, b)| a.dot(*b)).sum();
        let found = dot(&Workers::one(), &a, &b);
        // As many additions of numbers below one, in another order.
        assert!((found - exact).abs() < 3.0 * f64::EPSILON * (count * count) as f64);
        let ones = vec![vec3(1.0f32, 1.0, 1.0); MOST_PIECES * PIECE / 2];
        assert_eq!(dot(&Workers::one(), &ones, &ones), 3.0 * ones.len() as f64);
    }
}
