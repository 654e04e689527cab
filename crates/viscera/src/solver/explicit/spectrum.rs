//! The largest frequency of tissue at rest.
//!
//! ```text
//! A = M^-1/2 K M^-1/2,   A Q = Q T + r e_k^T,  T tridiagonal        Lanczos' iteration
//! lambda_max(A) <= theta + |r| |s_k|,   T s = theta s
//! ```
//!
//! Lanczos, "An iteration method for the solution of the eigenvalue problem of linear differential and integral
//! operators", J. Res. Natl. Bur. Stand. 45, 1950; the bound from above is that of Zhou, Saad, Tiago, Chelikowsky,
//! "Self-consistent-field calculations using Chebyshev-filtered subspace iteration", J. Comput. Phys. 219, 2006, weighted
//! by the last component of the vector, as residuals are. The start is a fixed pattern: the same bits everywhere.

use crate::elements::shape_gradients;
use crate::layout::Layout;
use crate::scalar::{Mat3, Real, Vec3, vec3};

/// Rounds: of ten times as many the largest frequency is at most 1 % smaller (`bound_is_close` in the tests).
const ROUNDS: usize = 10;

/// A tetrahedron at rest.
struct Tet {
    vertices: [u32; 4],
    gradients: [Vec3<f64>; 4],
    /// `V mu` and `V lambda` [J].
    lame: [f64; 2],
}

/// An upper estimate of the largest eigenvalue of `M^-1 K` of the tetrahedra of each part [1/s^2].
pub fn largest_eigenvalues<S: Real>(layout: &Layout<S>) -> Vec<f64> {
    of_rounds(layout, ROUNDS)
}

/// See [`largest_eigenvalues`].
fn of_rounds<S: Real>(layout: &Layout<S>, rounds: usize) -> Vec<f64> {
    let tets: Vec<Tet> = layout
        .tet_sets
        .iter()
        .flat_map(|set| layout.tets(set))
        .map(|tet| {
            let material = &layout.materials[tet.material];
            let volume = tet.rest_volume.to_f64();
            Tet {
                vertices: tet.vertices,
                gradients: shape_gradients(&tet.inverse_rest_shape.cast::<f64>()),
                lame: [material.lame_mu, material.lame_lambda].map(|of| volume * of.to_f64()),
            }
        })
        .collect();
    let part_of: Vec<usize> =
        (0..layout.vertex_count()).map(|v| layout.part_at(layout.numbering.of(v as u32))).collect();
    let roots: Vec<f64> = layout.masses.iter().map(|mass| 1.0 / mass.to_f64().sqrt()).collect();
    // A pattern without symmetry in which every vertex moves against its neighbours; of a part whatever is beside it.
    let start = |v: usize| {
        let place = layout.numbering.of(v as u32) - layout.parts[part_of[v]].vertices.start;
        let turn = |k: usize| ((place * 3 + k) as f64 * 0.618_033_988_749_895).fract() - 0.5;
        vec3(turn(1), turn(2), turn(3))
    };
    let mut q: Vec<Vec3<f64>> = (0..roots.len()).map(start).collect();
    let mut before = vec![Vec3::ZERO; q.len()];
    let mut w = vec![Vec3::ZERO; q.len()];
    let mut parts = vec![Tridiagonal::default(); layout.part_count()];
    let lengths = sums(&part_of, parts.len(), |v| q[v].length_squared());
    for (q, &part) in q.iter_mut().zip(&part_of) {
        *q = *q * (1.0 / lengths[part].sqrt());
    }
    for _ in 0..rounds {
        multiply(&tets, &roots, &q, &mut w);
        for ((w, before), &part) in w.iter_mut().zip(&before).zip(&part_of) {
            *w -= *before * parts[part].beside;
        }
        let along = sums(&part_of, parts.len(), |v| w[v].dot(q[v]));
        for ((w, q), &part) in w.iter_mut().zip(&q).zip(&part_of) {
            *w -= *q * along[part];
        }
        let left = sums(&part_of, parts.len(), |v| w[v].length_squared());
        for ((part, along), left) in parts.iter_mut().zip(along).zip(left) {
            part.append(along, left.sqrt());
        }
        for (v, &part) in part_of.iter().enumerate() {
            before[v] = q[v];
            // A part whose vectors are used up stays where it is.
            let beside = parts[part].beside;
            q[v] = if beside > 0.0 { w[v] * (1.0 / beside) } else { Vec3::ZERO };
        }
    }
    parts.iter().map(Tridiagonal::largest).collect()
}

/// `M^-1/2 K M^-1/2 q`.
fn multiply(tets: &[Tet], roots: &[f64], q: &[Vec3<f64>], into: &mut [Vec3<f64>]) {
    into.fill(Vec3::ZERO);
    for Tet { vertices, gradients, lame: [mu, lambda] } in tets {
        let mut strain = Mat3::ZERO;
        for (&v, &g) in vertices.iter().zip(gradients) {
            strain = strain + Mat3::outer(q[v as usize] * roots[v as usize], g);
        }
        let stress =
            (strain + strain.transpose()) * *mu + Mat3::IDENTITY * (*lambda * strain.trace());
        for (&v, &g) in vertices.iter().zip(gradients) {
            into[v as usize] += stress * g;
        }
    }
    for (into, root) in into.iter_mut().zip(roots) {
        *into = *into * *root;
    }
}

/// Of what each vertex has, for each part.
fn sums(part_of: &[usize], parts: usize, of: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = vec![0.0; parts];
    part_of.iter().enumerate().for_each(|(v, &part)| sums[part] += of(v));
    sums
}

/// `T` of a part.
#[derive(Clone, Debug, Default)]
struct Tridiagonal {
    diagonal: Vec<f64>,
    /// Beside the diagonal, squared.
    squares: Vec<f64>,
    /// The last one beside the diagonal, not squared: the length of what is left.
    beside: f64,
}

impl Tridiagonal {
    /// One more row, unless the rows before hold all that there is.
    fn append(&mut self, along: f64, beside: f64) {
        if self.diagonal.is_empty() || self.beside > 0.0 {
            self.diagonal.push(along);
            self.squares.push(beside * beside);
            // What is left of nothing is rounding.
            let largest = self.diagonal.iter().fold(0.0f64, |largest, a| largest.max(a.abs()));
            self.beside = if beside > 1e-12 * largest { beside } else { 0.0 };
        }
    }

    /// The largest eigenvalue, with what the rows that are missing may add to it.
    fn largest(&self) -> f64 {
        let n = self.diagonal.len();
        if n == 0 {
            return 0.0;
        }
        // Eigenvalues above `x` are counted by the signs of the pivots of `T - x I` (Sturm).
        let exceeds = |x: f64| {
            let mut pivot = 1.0;
            (0..n).any(|i| {
                let off = if i == 0 { 0.0 } else { self.squares[i - 1] / pivot };
                pivot = self.diagonal[i] - x - off;
                pivot >= 0.0
            })
        };
        let widest = self.squares.iter().fold(0.0f64, |widest, b| widest.max(b.sqrt()));
        let most = self.diagonal.iter().fold(0.0f64, |most, a| most.max(*a));
        let (mut low, mut high) = (0.0, most + 2.0 * widest);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if exceeds(middle) { low = middle } else { high = middle }
        }
        // The eigenvector, from its first component on.
        let (mut previous, mut now, mut sum) = (0.0, 1.0, 1.0);
        for i in 0..n - 1 {
            let off = if i == 0 { 0.0 } else { self.squares[i - 1].sqrt() };
            let next = ((high - self.diagonal[i]) * now - off * previous) / self.squares[i].sqrt();
            (previous, now) = (now, next);
            sum += now * now;
        }
        high + self.beside * (now * now / sum).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::{TetMesh, shapes};
    use crate::model::ModelBuilder;
    use crate::settings::SolverSettings;

    /// Many rounds leave nothing open; a few are above that, and not by much. Two bodies are two parts, each as if it were
    /// alone.
    #[test]
    fn bound_is_close() {
        let mesh = shapes::beam(0.08, 0.02, 0.02, 4, 0.2).expect("a beam");
        let stretched = mesh.vertices().iter().map(|x| vec3(x.x, 0.3 * x.y, x.z)).collect();
        let regions = vec![0; mesh.tets().len()];
        let (flat, _) = TetMesh::new(stretched, mesh.tets().to_vec(), regions).expect("a mesh");
        for poisson in [0.3, 0.45, 0.49] {
            let [soft, stiff] = [1e4, 4e4].map(|young| {
                let law = MaterialModel::StableNeoHookean;
                Material::new(law, young, poisson, 1000.0).expect("legal")
            });
            let layout = |bodies: &[(&TetMesh, &Material)]| {
                let mut builder = ModelBuilder::new();
                for (mesh, material) in bodies {
                    builder.add_body(mesh, material).expect("a body");
                }
                let model = builder.build::<f64>().expect("a model");
                Layout::new(&model, &SolverSettings::default())
            };
            let both = largest_eigenvalues(&layout(&[(&mesh, &soft), (&flat, &stiff)]));
            for (mesh, material, together) in [(&mesh, &soft, both[0]), (&flat, &stiff, both[1])] {
                let alone = layout(&[(mesh, material)]);
                let (few, many) = (largest_eigenvalues(&alone)[0], of_rounds(&alone, 150)[0]);
                println!("nu {poisson}: {:.4} {:.4}", few / many, together / many);
                assert!(few > 0.99 * many && few < 1.1 * many, "{few} of {many}");
                assert!(together > 0.99 * many && together < 1.1 * many);
            }
        }
    }

    /// `2 - 2 cos(pi k/(n + 1))`, those of a chain of equal springs.
    #[test]
    fn the_largest_eigenvalue_of_a_chain_of_springs() {
        let mut chain = Tridiagonal::default();
        for i in 0..12 {
            chain.append(2.0, if i < 11 { 1.0 } else { 0.0 });
        }
        let exact = 2.0 - 2.0 * (std::f64::consts::PI * 12.0 / 13.0).cos();
        let apart = chain.largest() - exact;
        assert!(apart.abs() < 1e-12, "{apart:e}");
        // Cut short it may be anything up to the chain's that goes on for ever.
        let mut cut = Tridiagonal::default();
        (0..6).for_each(|_| cut.append(2.0, 1.0));
        assert!(cut.largest() > exact && cut.largest() < 4.3, "{}", cut.largest());
    }
}
