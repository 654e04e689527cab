//! The stiffness of a body at small strain, as a matrix.
//!
//! ```text
//! K_ab = sum_t V (lambda g_a g_b^T + mu g_b g_a^T + mu (g_a . g_b) I)      over the free vertices
//! ```
//!
//! Conjugate gradients with the inverses of the diagonal blocks: Hestenes and Stiefel, 1952.

use super::dot;
use crate::elements::shape_gradients;
use crate::model::Model;
use crate::scalar::{Mat3, Vec3};

/// Iterations at most: more than the longest chain of tetrahedra that fits into memory needs.
const MOST_ITERATIONS: usize = 4000;

/// A symmetric positive definite matrix of 3 x 3 blocks, by rows; held vertices have rows without entries.
#[derive(Debug)]
pub(super) struct Stiffness {
    first: Vec<u32>,
    columns: Vec<u32>,
    blocks: Vec<Mat3<f64>>,
    /// Inverses of the diagonal blocks; zero where a vertex is held.
    inverses: Vec<Mat3<f64>>,
}

impl Stiffness {
    /// That of a model's tetrahedra at their stress-free shape, with `moves` of shape [vertex_count].
    pub fn new(model: &Model<f64>, moves: &[bool]) -> Self {
        let mut first = vec![0; moves.len() + 1];
        let mut pairs = Vec::with_capacity(16 * model.tet_count());
        for tet in &*model.tet_vertices {
            for a in tet.iter().filter(|&&a| moves[a as usize]) {
                pairs.extend(tet.iter().filter(|&&b| moves[b as usize]).map(|&b| (*a, b)));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        for &(row, _) in &pairs {
            first[row as usize + 1] += 1;
        }
        for row in 0..moves.len() {
            first[row + 1] += first[row];
        }
        let columns: Vec<u32> = pairs.into_iter().map(|(_, column)| column).collect();
        let mut blocks = vec![Mat3::ZERO; columns.len()];
        for tet in model.tets() {
            let material = &model.materials[tet.material as usize];
            let (lambda, mu) = (material.lame_lambda, material.lame_mu);
            let gradients = shape_gradients(&tet.inverse_rest_shape);
            for (&a, ga) in tet.vertices.iter().zip(gradients) {
                let row = first[a as usize] as usize..first[a as usize + 1] as usize;
                for (&b, gb) in tet.vertices.iter().zip(gradients) {
                    let Ok(place) = columns[row.clone()].binary_search(&b) else { continue };
                    let block = Mat3::outer(ga, gb) * lambda
                        + Mat3::outer(gb, ga) * mu
                        + Mat3::IDENTITY * (mu * ga.dot(gb));
                    let entry = &mut blocks[row.start + place];
                    *entry = *entry + block * tet.rest_volume;
                }
            }
        }
        let mut inverses = vec![Mat3::ZERO; moves.len()];
        for (a, inverse) in inverses.iter_mut().enumerate().filter(|(a, _)| moves[*a]) {
            let row = first[a] as usize..first[a + 1] as usize;
            if let Ok(place) = columns[row.clone()].binary_search(&(a as u32)) {
                *inverse = blocks[row.start + place].inverse();
            }
        }
        Self { first, columns, blocks, inverses }
    }

    /// `K d = r` up to a residual of the share `solved` of `r`, in the norm of the preconditioner; zero where a vertex is
    /// held. And how many iterations that took.
    pub fn solve(&self, r: &[Vec3<f64>], solved: f64) -> (Vec<Vec3<f64>>, usize) {
        let n = r.len();
        let mut residual = r.to_vec();
        let mut solution = vec![Vec3::ZERO; n];
        let [mut direction, mut image, mut preconditioned] = [(); 3].map(|()| vec![Vec3::ZERO; n]);
        let (mut product, mut begun, mut iterations) = (0.0, 0.0, 0);
        while iterations < MOST_ITERATIONS {
            for v in 0..n {
                preconditioned[v] = self.inverses[v] * residual[v];
            }
            let next = dot(&residual, &preconditioned);
            if iterations == 0 {
                begun = next;
            }
            // Zero: solved. No number: so was the residual.
            if next.is_nan() || next <= solved * solved * begun {
                break;
            }
            let beta = if iterations == 0 { 0.0 } else { next / product };
            product = next;
            for v in 0..n {
                direction[v] = preconditioned[v] + direction[v] * beta;
            }
            self.times(&direction, &mut image);
            let alpha = product / dot(&direction, &image);
            for v in 0..n {
                solution[v] += direction[v] * alpha;
                residual[v] -= image[v] * alpha;
            }
            iterations += 1;
        }
        (solution, iterations)
    }

    fn times(&self, x: &[Vec3<f64>], image: &mut [Vec3<f64>]) {
        for (row, image) in image.iter_mut().enumerate() {
            let mut sum = Vec3::ZERO;
            let places = self.first[row] as usize..self.first[row + 1] as usize;
            for (block, &column) in self.blocks[places.clone()].iter().zip(&self.columns[places]) {
                sum += *block * x[column as usize];
            }
            *image = sum;
        }
    }
}
