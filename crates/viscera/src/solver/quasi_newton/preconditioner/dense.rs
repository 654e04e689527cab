//! A small dense symmetric system: the coarsest level.

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

    /// Adds to an entry of the lower triangle.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * self.size + column] += value;
    }

    /// Cholesky's factor takes the place of the matrix. Directions that have no stiffness of their own get none of the
    /// solution.
    pub fn factorize(&mut self) {
        let n = self.size;
        for i in 0..n {
            let (before, rest) = self.values.split_at_mut(i * n);
            let row = &mut rest[..n];
            for j in 0..i {
                let other = &before[j * n..j * n + j + 1];
                let sum: f64 = dot(&row[..j], &other[..j]);
                row[j] = (row[j] - sum) * other[j];
            }
            let diagonal = row[i];
            let pivot = diagonal - dot(&row[..i], &row[..i]);
            // The inverse of the factor's diagonal; zero leaves the unknown out.
            let keeps = pivot > SMALLEST_PIVOT * diagonal && pivot.is_finite();
            row[i] = if keeps { 1.0 / pivot.sqrt() } else { 0.0 };
        }
    }

    /// Where the right side is written before, and the solution read after [`Dense::solve`].
    pub fn vector(&mut self) -> &mut [f64] {
        &mut self.right
    }

    /// Solves with the factor.
    pub fn solve(&mut self) {
        let n = self.size;
        for i in 0..n {
            let row = &self.values[i * n..i * n + i + 1];
            let sum = dot(&row[..i], &self.right[..i]);
            self.right[i] = (self.right[i] - sum) * row[i];
        }
        for i in (0..n).rev() {
            let row = &self.values[i * n..i * n + i + 1];
            let value = self.right[i] * row[i];
            self.right[i] = value;
            for (right, entry) in self.right[..i].iter_mut().zip(row) {
                *right -= entry * value;
            }
        }
    }
}

/// Four sums side by side.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.0.iter().zip(b.0) {
        for lane in 0..4 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a.1.iter().zip(b.1).map(|(a, b)| a * b).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
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
        dense.factorize();
        let exact: Vec<f64> = (0..n).map(|i| number(7 * i + 3)).collect();
        for i in 0..n {
            dense.vector()[i] = (0..n).map(|j| entry(i, j) * exact[j]).sum();
        }
        dense.vector()[n] = 0.0;
        dense.solve();
        for i in 0..n {
            assert!((dense.vector()[i] - exact[i]).abs() < 1e-10, "{i}");
        }
        assert_eq!(dense.vector()[n], 0.0);
    }
}
