//! How fast a body that nothing holds oscillates about its rest shape, in many modes.
//!
//! ```text
//! K phi = omega^2 M phi
//! lumped masses    all of them, dense: eigenvalues of M^-1/2 K M^-1/2
//! quadratic        the lowest, by subspace iteration: X <- Ritz vectors of (K + s M)^-1 M X
//! ```
//!
//! Quadratic tetrahedra have consistent masses `int rho N_i N_j`, as their lumped ones are negative at corners. Bathe,
//! "Finite Element Procedures", 2nd ed. 2014, section 11.6.

use faer::{Mat, Side};
use viscera::scalar::Vec3;
use viscera::solver::Inputs;

use super::matrix::{FactorError, MatrixValues, Pattern};
use super::objective::Load;
use super::problem::Problem;
use super::{Analysis, Reference, ReferenceError, objective};

/// `420/V int N_i N_j`: of corners with themselves and others, corners with edges that end there and that do not,
/// edges with themselves, with edges that share a corner and with the one opposite.
const CORNER: [f64; 2] = [6.0, 1.0];
const CORNER_EDGE: [f64; 2] = [-4.0, -6.0];
const EDGE: [f64; 3] = [32.0, 16.0, 8.0];

/// Vectors beside those that are asked for: each step leaves of the error the squared ratio of the last asked value to
/// the first that is left out.
const SPARE: usize = 16;

/// Steps at most.
const STEPS: u32 = 100;

/// Done when no value changes by this share of itself.
const RELATIVE: f64 = 1e-7;

impl Reference {
    /// Squared angular frequencies [1/s^2] of all modes about the rest shape, ascending, where nothing is held: those
    /// of rigid motion are zero but for round-off. Takes the memory of a dense matrix; of lumped masses only.
    pub fn spectrum(&mut self) -> Result<Vec<f64>, ReferenceError> {
        if !self.lumped {
            return Err(ReferenceError::NoStep);
        }
        let analysis = self.analyse(vec![false; self.problem.vertex_count()])?;
        let (pattern, stiffness) = (&analysis.pattern, self.stiffness(&analysis.pattern));
        let count = pattern.unknowns();
        let mut dense = Mat::<f64>::zeros(count, count);
        let weight = |row: usize| 1.0 / self.problem.masses[row / 3].sqrt();
        stiffness.entries(pattern, |row, column, value| {
            dense[(row, column)] = value * weight(row) * weight(column);
        });
        let values = dense.self_adjoint_eigenvalues(Side::Lower);
        self.analysis = Some(analysis);
        // Only a matrix with NaN entries has no eigenvalues.
        values.map_err(|_| ReferenceError::NotFinite { what: "curvature of the potential" })
    }

    /// The lowest so many squared angular frequencies [1/s^2], ascending, of quadratic tetrahedra that nothing holds:
    /// the first six are rigid motion's.
    pub fn lowest_frequencies(&mut self, count: usize) -> Result<Vec<f64>, ReferenceError> {
        let mut analysis = self.analyse(vec![false; self.problem.vertex_count()])?;
        let cost = self.check_memory(&analysis)?;
        let Analysis { pattern, factorization, .. } = &mut analysis;
        let mut shifted = self.stiffness(pattern);
        let mass = masses(&self.problem, pattern);
        // Well below the lowest elastic mode of any body whose tetrahedra can be counted.
        let shift = 1e-6 * shifted.largest_diagonal(pattern) / mass.largest_diagonal(pattern);
        shifted.add_scaled(&mass, shift);
        factorization.factorize(pattern, &shifted).map_err(|error| match error {
            FactorError::TooLarge => self.too_large(&cost),
            FactorError::Indefinite | FactorError::Stopped => ReferenceError::Unstable,
        })?;
        let width = (count + SPARE).min(pattern.unknowns());
        let vertices = self.problem.vertex_count();
        let mut vectors: Vec<Vec<Vec3<f64>>> = (0..width)
            .map(|k| (0..vertices).map(|v| scattered(k * vertices + v)).collect())
            .collect();
        let mut before = vec![0.0; count];
        for _ in 0..STEPS {
            let loads: Vec<_> = vectors.iter().map(|x| mass.multiply(pattern, x)).collect();
            let images: Vec<_> = loads.iter().map(|b| factorization.solve(pattern, b)).collect();
            let weighted: Vec<_> = images.iter().map(|y| mass.multiply(pattern, y)).collect();
            let Some((values, next)) = ritz(&images, &loads, &weighted) else { break };
            vectors = next;
            let squares: Vec<f64> = values[..count].iter().map(|value| value - shift).collect();
            let scale = squares[count - 1];
            let is_done = |(a, b): (&f64, &f64)| (a - b).abs() <= RELATIVE * scale;
            if squares.iter().zip(&before).all(is_done) {
                self.analysis = Some(analysis);
                return Ok(squares);
            }
            before = squares;
        }
        self.analysis = Some(analysis);
        Err(ReferenceError::NoMode { steps: STEPS })
    }

    /// `K` at rest.
    fn stiffness(&self, pattern: &Pattern) -> MatrixValues {
        let inputs = Inputs::default();
        let load = Load::Forces(vec![Vec3::ZERO; self.problem.vertex_count()]);
        let rest = &self.problem.rest_positions;
        objective(&self.problem, &inputs, load).hessian(rest, pattern, false)
    }
}

/// Consistent masses of quadratic tetrahedra.
fn masses(problem: &Problem, pattern: &Pattern) -> MatrixValues {
    let mut matrix = MatrixValues::new(pattern);
    let corners = viscera::mesh::topology::TET_EDGES;
    let elements = &problem.quadratic;
    for (tet, nodes) in elements.nodes.iter().enumerate() {
        let points = tet * elements.points_per_tet..(tet + 1) * elements.points_per_tet;
        let volume: f64 = elements.points[points].iter().map(|point| point.volume).sum();
        for i in 0..10 {
            for j in 0..10 {
                let weight = match (i < 4, j < 4) {
                    (true, true) => CORNER[usize::from(i != j)],
                    (true, false) => CORNER_EDGE[usize::from(!corners[j - 4].contains(&i))],
                    (false, true) => CORNER_EDGE[usize::from(!corners[i - 4].contains(&j))],
                    (false, false) => {
                        let shared = corners[i - 4].iter().filter(|c| corners[j - 4].contains(c));
                        EDGE[2 - shared.count()]
                    }
                };
                let mass = problem.density * volume * weight / 420.0;
                let block = [[mass, 0.0, 0.0], [0.0, mass, 0.0], [0.0, 0.0, mass]];
                if pattern.holds(nodes[i], nodes[j]) {
                    matrix.add(pattern, nodes[i], nodes[j], &block);
                }
            }
        }
    }
    matrix
}

type Vectors = Vec<Vec<Vec3<f64>>>;

/// Values, ascending, and vectors with which the span of `images` meets the pencil `(K + s M, M)`: with `Y = images`,
/// `Y^T (K + s M) Y = Y^T loads` and `Y^T M Y = Y^T weighted`.
fn ritz(images: &Vectors, loads: &Vectors, weighted: &Vectors) -> Option<(Vec<f64>, Vectors)> {
    let width = images.len();
    let product =
        |a: &[Vec3<f64>], b: &[Vec3<f64>]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
    let stiffness = Mat::from_fn(width, width, |i, j| {
        0.5 * (product(&images[i], &loads[j]) + product(&images[j], &loads[i]))
    });
    let mass = Mat::from_fn(width, width, |i, j| product(&images[i], &weighted[j]));
    // Of length one in the masses first.
    let eigen = mass.self_adjoint_eigen(Side::Lower).ok()?;
    let (lengths, axes) = (eigen.S().column_vector(), eigen.U());
    let axes =
        Mat::from_fn(width, width, |i, j| axes[(i, j)] / lengths[j].max(f64::MIN_POSITIVE).sqrt());
    let reduced = axes.transpose() * &stiffness * &axes;
    let eigen = reduced.self_adjoint_eigen(Side::Lower).ok()?;
    let values = (0..width).map(|k| eigen.S().column_vector()[k]).collect();
    let mix = &axes * eigen.U();
    let vectors = (0..width).map(|k| {
        let mut sum = vec![Vec3::ZERO; images[0].len()];
        for (i, image) in images.iter().enumerate() {
            for (sum, y) in sum.iter_mut().zip(image) {
                *sum += *y * mix[(i, k)];
            }
        }
        sum
    });
    Some((values, vectors.collect()))
}

/// A vector of the `n`-th of numbers that lie evenly and without order in [-1/2, 1/2): multiples of three irrational numbers.
fn scattered(n: usize) -> Vec3<f64> {
    // Powers of the root of `x^4 = x + 1`: Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018.
    Vec3::from_f64(
        [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3]
            .map(|step: f64| (n as f64 * step).fract() - 0.5),
    )
}
