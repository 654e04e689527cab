//! One step of Newton's method, by conjugate gradients, for equations that tell nothing but their gradient.
//!
//! ```text
//! K d = r,   r = -grad V(x),   K p ~ (grad V(x + e p) - grad V(x))/e,   preconditioned by the diagonal of K
//! ```
//!
//! Hestenes and Stiefel, 1952; the sum of `alpha r.z` over some iterations is what they add to `d.K d` and bounds what
//! was missing before (Strakos and Tichy, "On error estimation in the conjugate gradient method", 2002, section 4).

use crate::scalar::Vec3;

/// The difference quotient's step, as a share of the shortest distance over which strain changes by one: far
/// above the square root of round-off, far below where curvature changes.
const DIFFERENCE: f64 = 1e-6;

/// Iterations at most, and at least where the mesh is large.
const MOST_ITERATIONS: f64 = 1000.0;
const FEWEST_ITERATIONS: f64 = 50.0;

/// The static equations of a body.
pub(super) trait Equations {
    /// `grad V` [N] of nodes that move, zero for others; all of shape [node_count].
    fn gradient(&self, x: &[Vec3<f64>], gradient: &mut [Vec3<f64>]);
    /// Inverse of the diagonal of `K` at small strain [m/N], shape [node_count].
    fn softness(&self) -> &[f64];
    /// The length [m] over which strain changes by one, the smallest of the mesh.
    fn shortest(&self) -> f64;
    /// What a gradient costs, in linear tetrahedra.
    fn pass(&self) -> f64;
}

/// How long conjugate gradients go on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// They end where the last of their iterations add less than this share of `d.K d`.
    pub complete: f64,
    /// Passes over single linear tetrahedra at most.
    pub most_work: f64,
    /// `s` of `(K + s D) d = r` with the diagonal `D` of `K` at small strain: zero for Newton's step, more for a shorter one
    /// that leads down where `K` is not positive definite (Levenberg, 1944).
    pub shift: f64,
}

/// The result of conjugate gradients.
pub(super) struct Found {
    /// `d` [m], shape [node_count].
    pub way: Vec<Vec3<f64>>,
    /// False where the iterations ended before all of the way was found.
    pub complete: bool,
    /// False where forces push on rather than back along some way.
    pub stable: bool,
    /// What it took, in passes over single linear tetrahedra.
    pub work: f64,
}

/// `d` at `x` [m], shape [node_count].
pub(super) fn solve(equations: &impl Equations, x: &[Vec3<f64>], effort: Effort) -> Found {
    let n = x.len();
    let softness = equations.softness();
    let mut at_x = vec![Vec3::ZERO; n];
    equations.gradient(x, &mut at_x);
    // The iterates start at `d = 0`, where the residual is all of `-grad V`. It is updated from step to step;
    // computing it anew would be a second pass over the mesh in each iteration.
    let mut residual: Vec<Vec3<f64>> = at_x.iter().map(|&gradient| -gradient).collect();
    let mut way = vec![Vec3::ZERO; n];
    let [mut direction, mut image, mut moved] = [(); 3].map(|()| vec![Vec3::ZERO; n]);
    let passes = effort.most_work / equations.pass().max(1.0);
    let most = passes.clamp(FEWEST_ITERATIONS, MOST_ITERATIONS) as usize;
    // A smooth error is seen once information has gone through the whole body, some cells an iteration.
    let delay = 10 + 2 * libm::cbrt(n as f64) as usize;
    let mut added = Vec::with_capacity(most);
    // `added[k]` is `alpha r.z` of iteration k [J]: by how much `d . K d` has grown. No product with the unknown
    // solution is needed.
    let (mut product, mut total) = (preconditioned(softness, &residual), 0.0);
    let mut beta = 0.0;
    let work = |added: &Vec<f64>| equations.pass() * (added.len() + 1) as f64;
    for _ in 0..most {
        // Zero: the equations are solved. NaN or infinite: the state itself is; the way found so far is returned.
        if !(product > 0.0 && product.is_finite()) {
            break;
        }
        for v in 0..n {
            direction[v] = residual[v] * softness[v] + direction[v] * beta;
        }
        times_stiffness(equations, x, &at_x, &direction, &mut moved, &mut image);
        if effort.shift > 0.0 {
            for v in 0..n {
                // What does not move has no direction, and perhaps no stiffness.
                let stiffness = if softness[v] > 0.0 { 1.0 / softness[v] } else { 0.0 };
                image[v] += direction[v] * (effort.shift * stiffness);
            }
        }
        let curvature = dot(&direction, &image);
        // Forces drive the tissue on along `direction`: `K` is not positive definite, and a Newton step may lead
        // to a saddle. The way up to here descends, so it is kept, as a part of what is left.
        if curvature.is_nan() || curvature <= 0.0 {
            return Found { way, complete: false, stable: false, work: work(&added) };
        }
        let alpha = product / curvature;
        for v in 0..n {
            way[v] += direction[v] * alpha;
            residual[v] -= image[v] * alpha;
        }
        total += alpha * product;
        added.push(alpha * product);
        // What the last `delay` iterations added bounds from below what was missing before them. One small
        // addition proves nothing: the iteration stalls until information has reached the far end of a body.
        let last: f64 = added.iter().rev().take(delay).sum();
        if added.len() > delay && last < effort.complete * total {
            return Found { way, complete: true, stable: true, work: work(&added) };
        }
        let next = preconditioned(softness, &residual);
        beta = next / product;
        product = next;
    }
    Found { way, complete: added.len() < most, stable: true, work: work(&added) }
}

/// `r.z` with `z` the preconditioned `r`.
fn preconditioned(softness: &[f64], residual: &[Vec3<f64>]) -> f64 {
    residual.iter().zip(softness).map(|(r, c)| r.length_squared() * c).sum()
}

/// `K p`; `at_x` is the gradient at `x`, and `moved` is room for places.
pub(super) fn times_stiffness(
    equations: &impl Equations,
    x: &[Vec3<f64>],
    at_x: &[Vec3<f64>],
    p: &[Vec3<f64>],
    moved: &mut [Vec3<f64>],
    image: &mut [Vec3<f64>],
) {
    // Scaled by the longest vector of `p`, so that strain changes by about `DIFFERENCE` at most: directions
    // shrink by orders of magnitude from the first iteration to the last.
    let step = DIFFERENCE * equations.shortest() / longest(p).max(f64::MIN_POSITIVE);
    for ((moved, x), p) in moved.iter_mut().zip(x).zip(p) {
        *moved = *x + *p * step;
    }
    equations.gradient(moved, image);
    for (image, at_x) in image.iter_mut().zip(at_x) {
        *image = (*image - *at_x) * (1.0 / step);
    }
}

pub(super) fn dot(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

pub(super) fn longest(all: &[Vec3<f64>]) -> f64 {
    all.iter().fold(0.0, |longest: f64, v| longest.max(v.length()))
}
