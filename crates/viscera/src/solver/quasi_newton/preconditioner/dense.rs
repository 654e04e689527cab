//! A small dense symmetric system: the coarsest level.

use crate::scalar::Mat3;
use crate::scalar::lanes::{Kernel, LANES, Lanes, run};
use crate::solver::cpu::threads::Workers;

/// A pivot below this share of its diagonal entry belongs to a direction that the others can do as well.
const SMALLEST_PIVOT: f64 = 1e-10;

/// The lower triangle of a symmetric matrix, row by row, and then of its factor `L L^T`.
#[derive(Clone, Debug, Default)]
pub struct Dense {
    size: usize,
    values: Vec<f64>,
    right: Vec<f64>,
}

impl Dense {
    /// With so many unknowns.
    pub fn new(size: usize) -> Self {
        Self { size, values: vec![0.0; size * size], right: vec![0.0; size] }
    }

    /// How many unknowns.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..]) + size_of_val(&self.right[..])
    }

    /// All entries zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// An entry of the lower triangle.
    #[cfg(test)]
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.size + column]
    }

    /// Adds to an entry of the lower triangle.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * self.size + column] += value;
    }

    /// Adds the block of a row's node and of one that is no later to the lower triangle.
    pub fn add_block(&mut self, [node, other]: [u32; 2], block: &Mat3<f64>) {
        for (column, entries) in block.columns.iter().enumerate() {
            for (row, entry) in entries.to_array().into_iter().enumerate() {
                let (row, column) = (3 * node as usize + row, 3 * other as usize + column);
                if column <= row {
                    self.add(row, column, entry);
                }
            }
        }
    }

    /// Cholesky's factor takes the place of the matrix. Directions that have no stiffness of their own get none of the
    /// solution.
    pub fn factorize(&mut self, workers: &Workers) {
        run::<f64>(workers.instructions, Factorize(self));
    }

    /// Where the right side is written before, and the solution read after [`Dense::solve`].
    pub fn vector(&mut self) -> &mut [f64] {
        &mut self.right
    }

    /// Solves with the factor.
    pub fn solve(&mut self, workers: &Workers) {
        run::<f64>(workers.instructions, Solve(self));
    }
}

struct Factorize<'a>(&'a mut Dense);

impl Kernel<f64> for Factorize<'_> {
    #[inline(always)]
    fn run<L: Lanes<Real = f64>>(self) {
        let Dense { size, values, .. } = self.0;
        let n = *size;
        for i in 0..n {
            let (before, rest) = values.split_at_mut(i * n);
            let row = &mut rest[..n];
            for j in 0..i {
                let other = &before[j * n..j * n + j + 1];
                let sum = dot::<L>(&row[..j], &other[..j]);
                row[j] = (row[j] - sum) * other[j];
            }
            let diagonal = row[i];
            let pivot = diagonal - dot::<L>(&row[..i], &row[..i]);
            // The inverse of the factor's diagonal; zero leaves the unknown out.
            let keeps = pivot > SMALLEST_PIVOT * diagonal && pivot.is_finite();
            row[i] = if keeps { 1.0 / pivot.sqrt() } else { 0.0 };
        }
    }
}

struct Solve<'a>(&'a mut Dense);

impl Kernel<f64> for Solve<'_> {
    #[inline(always)]
    fn run<L: Lanes<Real = f64>>(self) {
        let Dense { size, values, right } = self.0;
        let n = *size;
        for i in 0..n {
            let row = &values[i * n..i * n + i + 1];
            let sum = dot::<L>(&row[..i], &right[..i]);
            right[i] = (right[i] - sum) * row[i];
        }
        for i in (0..n).rev() {
            let row = &values[i * n..i * n + i + 1];
            let value = right[i] * row[i];
            right[i] = value;
            for (right, entry) in right[..i].iter_mut().zip(row) {
                *right -= entry * value;
            }
        }
    }
}

/// Eight sums side by side.
#[inline(always)]
fn dot<L: Lanes<Real = f64>>(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (a, b) in a.0.iter().zip(b.0) {
        let mut lane = 0;
        while lane < LANES {
            (L::load(&sums, lane) + L::load(a, lane) * L::load(b, lane)).store(&mut sums, lane);
            lane += L::WIDTH;
        }
    }
    for (lane, (a, b)) in a.1.iter().zip(b.1).enumerate() {
        sums[lane] += a * b;
    }
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `A x = b` for a matrix `B B^T + I`, and for one with an unknown that has no stiffness.
    #[test]
    fn a_system_is_solved() {
        let n = 37;
        let number = |i: usize| libm::sin((i * i % 101) as f64);
        let entry = |i: usize, j: usize| -> f64 {
            let product: f64 = (0..n).map(|k| number(i * n + k) * number(j * n + k)).sum();
            product + if i == j { 1.0 } else { 0.0 }
        };
        let mut dense = Dense::new(n + 1);
        for i in 0..n {
            for j in 0..=i {
                dense.add(i, j, entry(i, j));
            }
        }
        dense.factorize(&Workers::one());
        let exact: Vec<f64> = (0..n).map(|i| number(7 * i + 3)).collect();
        for i in 0..n {
            dense.vector()[i] = (0..n).map(|j| entry(i, j) * exact[j]).sum();
        }
        dense.vector()[n] = 0.0;
        dense.solve(&Workers::one());
        for i in 0..n {
            assert!((dense.vector()[i] - exact[i]).abs() < 1e-10, "{i}");
        }
        assert_eq!(dense.vector()[n], 0.0);
    }
}
