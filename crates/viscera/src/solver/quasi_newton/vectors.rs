//! Sums over long vectors, in double precision and in an order that neither threads nor lanes change.
#![allow(unsafe_code)]

use std::ops::Range;

use crate::scalar::lanes::{Kernel, LANES, Lanes, run};
use crate::scalar::{Real, Vec3};
use crate::settings::MOST_HISTORY;
use crate::solver::cpu::threads::{Shared, Workers};

/// Vertices that are summed over first, at least; and how many such sums there are at most. Part of the result's bits.
const PIECE: usize = 1 << 11;
const MOST_PIECES: usize = 64;

/// Products that [`dots`] finds at a time, at most.
pub const MOST_DOTS: usize = 2 * MOST_HISTORY;

/// How many vertices are summed over first, of so many.
fn piece(count: usize) -> usize {
    PIECE.max(count.div_ceil(MOST_PIECES))
}

/// `a . b`.
pub fn dot<S: Real>(workers: &Workers, a: &[Vec3<S>], b: &[Vec3<S>]) -> f64 {
    let mut product = [0.0];
    add_dots(workers, &[(a, b)], &mut product);
    product[0]
}

/// Adds `a . b` of several pairs of vectors of one length.
pub fn add_dots<S: Real>(workers: &Workers, pairs: &[Factors<'_, S>], products: &mut [f64]) {
    let count = pairs.first().map_or(0, |(a, _)| a.len());
    let map = |range: Range<usize>| {
        let mut sums = [0.0; MOST_DOTS];
        run(workers.instructions, Dots { pairs, range, sums: &mut sums });
        sums
    };
    let add = |mut all: [f64; MOST_DOTS], more: [f64; MOST_DOTS]| {
        all.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        all
    };
    let partial = &mut [[0.0; MOST_DOTS]; MOST_PIECES];
    let sums = workers.reduce((count, piece(count)), partial, map, add);
    let sums = sums.unwrap_or([0.0; MOST_DOTS]);
    products.iter_mut().zip(sums).for_each(|(product, sum)| *product += sum);
}

/// Calls with pieces of `0..count`, which threads may share.
pub fn each_piece(workers: &Workers, count: usize, work: impl Fn(Range<usize>) + Sync) {
    workers.each(count, PIECE, work);
}

/// Two vectors whose product is asked for.
pub type Factors<'a, S> = (&'a [Vec3<S>], &'a [Vec3<S>]);

/// `d = z scale + sum a v`, but zero at vertices that are pinned.
pub struct Combination<'a, S> {
    pub z: &'a [Vec3<S>],
    pub scale: S,
    pub terms: &'a [(S, &'a [Vec3<S>])],
    pub pinned: &'a [bool],
}

impl<S: Real> Combination<'_, S> {
    /// Finds `d`, and returns `g . d` and the square of its longest vector.
    pub fn find(&self, workers: &Workers, gradient: &[Vec3<S>], into: &mut [Vec3<S>]) -> [f64; 2] {
        let count = self.z.len();
        let shared = Shared::new(into);
        let map = |range: Range<usize>| {
            // SAFETY: every piece is worked on once.
            let d = unsafe { shared.range(range.clone()) };
            let mut found = [0.0; 2];
            let g = &gradient[range.clone()];
            run(workers.instructions, Combine { all: self, range, d, g, found: &mut found });
            found
        };
        let partial = &mut [[0.0; 2]; MOST_PIECES];
        workers.reduce((count, piece(count)), partial, map, both).unwrap_or([0.0; 2])
    }
}

/// What [`Combination::find`] returns, of two ranges together.
pub fn both(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], larger(a[1], b[1])]
}

/// The larger of two numbers; what is no number is larger than all.
fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

struct Combine<'a, S> {
    all: &'a Combination<'a, S>,
    range: Range<usize>,
    d: &'a mut [Vec3<S>],
    g: &'a [Vec3<S>],
    found: &'a mut [f64; 2],
}

impl<S: Real> Kernel<S> for Combine<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        let Self { all, range, d, g, found } = self;
        for (d, z) in d.iter_mut().zip(&all.z[range.clone()]) {
            *d = *z * all.scale;
        }
        for &(factor, vector) in all.terms {
            for (d, v) in d.iter_mut().zip(&vector[range.clone()]) {
                *d += *v * factor;
            }
        }
        let mut longest = S::ZERO;
        let mut is_number = true;
        for (d, &pinned) in d.iter_mut().zip(&all.pinned[range]) {
            if pinned {
                *d = Vec3::ZERO;
            }
            let squared = d.length_squared();
            is_number &= squared.is_finite();
            longest = longest.max(squared);
        }
        found[1] = if is_number { longest.to_f64() } else { f64::NAN };
        [found[0]] = products([[Vec3::components(d), Vec3::components(g)]]);
    }
}

struct Dots<'a, S> {
    pairs: &'a [Factors<'a, S>],
    range: Range<usize>,
    sums: &'a mut [f64; MOST_DOTS],
}

impl<S: Real> Kernel<S> for Dots<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        let Self { pairs, range, sums } = self;
        // Two at a time: the additions of one wait for each other.
        let (two, rest) = pairs.as_chunks::<2>();
        for (sums, [first, second]) in sums.as_chunks_mut::<2>().0.iter_mut().zip(two) {
            *sums = products([components(first, &range), components(second, &range)]);
        }
        if let [last] = rest {
            [sums[pairs.len() - 1]] = products([components(last, &range)]);
        }
    }
}

#[inline(always)]
fn components<'a, S: Real>(factors: &Factors<'a, S>, range: &Range<usize>) -> [&'a [S]; 2] {
    [factors.0, factors.1].map(|vector| Vec3::components(&vector[range.clone()]))
}

/// Products of vectors of one length, lane by lane.
#[inline(always)]
fn products<S: Real, const N: usize>(pairs: [[&[S]; 2]; N]) -> [f64; N] {
    let mut sums = [[0.0; LANES]; N];
    let chunks = pairs.map(|pair| pair.map(|vector| vector.as_chunks::<LANES>()));
    for i in 0..chunks[0][0].0.len() {
        for (sums, [a, b]) in sums.iter_mut().zip(&chunks) {
            let (a, b) = (&a.0[i], &b.0[i]);
            for lane in 0..LANES {
                sums[lane] += a[lane].to_f64() * b[lane].to_f64();
            }
        }
    }
    for (sums, [a, b]) in sums.iter_mut().zip(&chunks) {
        for (lane, (a, b)) in a.1.iter().zip(b.1).enumerate() {
            sums[lane] += a.to_f64() * b.to_f64();
        }
    }
    sums.map(|s| ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7])))
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
        let ones = vec![vec3(1.0f32, 1.0, 1.0); 2 * MOST_PIECES * PIECE];
        assert_eq!(dot(&Workers::one(), &ones, &ones), 3.0 * ones.len() as f64);
    }

    /// Over several pieces: each vertex has its sum, pinned ones nothing; slope and length are of all of it.
    #[test]
    fn a_combination_is_one_of_every_vertex() {
        let count = 2 * PIECE + 5;
        let vector = |seed: usize| {
            let at = |i: usize| libm::sin(((i * i + seed) % 7919) as f64);
            (0..count).map(|i| vec3(at(i), at(2 * i), at(3 * i))).collect::<Vec<Vec3<f64>>>()
        };
        let (z, s, w, g) = (vector(1), vector(2), vector(3), vector(4));
        let pinned: Vec<bool> = (0..count).map(|i| i % 7 == 3).collect();
        let terms = [(0.5, &s[..]), (-2.0, &w[..])];
        let all = Combination { z: &z, scale: -1.5, terms: &terms, pinned: &pinned };
        let mut d = vec![Vec3::ZERO; count];
        let [slope, longest] = all.find(&Workers::one(), &g, &mut d);
        let (mut product, mut most) = (0.0, 0.0f64);
        for v in 0..count {
            let sum = z[v] * -1.5 + s[v] * 0.5 - w[v] * 2.0;
            let expected = if pinned[v] { Vec3::ZERO } else { sum };
            assert_eq!(d[v], expected, "{v}");
            product += g[v].dot(expected);
            most = most.max(expected.length_squared());
        }
        assert!((slope - product).abs() < 3.0 * f64::EPSILON * (count * count) as f64);
        assert_eq!(longest, most);
        let none = vec![vec3(f64::NAN, 0.0, 0.0); count];
        let all = Combination { z: &none, ..all };
        assert!(all.find(&Workers::one(), &g, &mut d)[1].is_nan());
    }
}
