//! Recovered-gradient tetrahedron: four corners and the linear field's data, but it bends without locking.
//!
//! A linear tetrahedron is too stiff because its gradient `F` is constant: what bends must shear. Around a vertex the
//! gradients of its tetrahedra average to one that is right to first order, and two such gradients at the ends of an
//! edge say where the middle of the edge is, beyond the straight line between them. The energy is that of the mean
//! gradient `Fh` of the quadratic field through these middles, and of the average itself:
//!
//! ```text
//! G_n  = (1/V_n) sum_t V_t/4 F_t,   V_n = sum_t V_t/4              over the tetrahedra t of a domain n
//! e_ab = (G_a - G_b) (X_b - X_a)/8                                 the middle of an edge, beyond its ends' mean
//! Fh   = F + sum_ab e_ab (g_a + g_b)^T                             mean gradient of the quadratic field
//!      = F + sum_o c_o k_o g_o^T,  k_o = sum_{p in face o} G_p (X_p - X_o),  c_o = 3 beta/8 or 0
//! Jh_n = (1/V_n) sum_t V_t/4 det Fh_t,   Jh_c likewise over the domains n of a cluster c
//! E    = sum_t V_t (1 - alpha) W(Fh_t; l, mu) + sum_n V_n alpha W(G_n; l, mu)
//!      + sum_n V_n k_n/2 (Jh_n - 1)^2 + sum_c V_c k_c/2 (Jh_c - 1)^2 + sum_t V_t 16 mu/2 min(det F_t - 1/5, 0)^2
//! lambda = l + k_n + k_c
//! ```
//!
//! `e_ab` is exact where the field is quadratic and `G` its gradient; the second line of `Fh` gathers the middles by
//! faces: face `o` lies opposite corner `o`, `X_o` is its centroid, and `-3 V g_o` its outward area. A **domain** is a
//! vertex with its tetrahedra of one material that hang together by faces. A face between two tetrahedra has the same
//! domains on both sides, so the same `k_o`, and opposite areas: `sum_t V_t (Fh_t - F_t) = 0` whatever the `G_n` are,
//! if `c_o` is the face's. At the body's surface and between materials nothing is on the other side, and `c_o = 0`.
//! Hence a body strained alike everywhere is in balance in its inside (the patch test) to round-off, on any mesh.
//! Short waves average to nothing, `G = 0`: their energy is that of linear tetrahedra, so there are no others without
//! energy.
//!
//! `W` is stable neo-Hookean ([`super::neo_hookean`]). Bulk stiffness above the shear modulus counts where volume is
//! averaged, so that nearly incompressible tissue has one volume to keep per vertex rather than per tetrahedron, and
//! above four times the shear modulus, which is above a Poisson ratio of 0.4, per group of vertices ([`BulkShares`]).
//!
//! The last term is the **volume floor**. Averages of volumes do not see one tetrahedron that is inside out between
//! others: `E` without the floor has minima there, in which a body that was crushed stays. The floor is zero for every
//! tetrahedron that keeps a fifth of its volume, so for all of sound tissue.
//!
//! After node-based uniform strain elements with a stabilising share of the linear tetrahedron (Puso, Solberg, "A
//! stabilized nodally integrated tetrahedral", IJNME 67, 2006) and superconvergent recovery of gradients (Zienkiewicz,
//! Zhu, "The superconvergent patch recovery and a posteriori error estimates", IJNME 33, 1992).

use super::neo_hookean::{self, volume_variation};
use crate::scalar::{Mat3, Scalar, Vec3};

/// `alpha`: the share of the energy that counts at vertices. Less stiffens what bends; more leaves short waves too
/// little energy: at 0.6 half as many modes again lie below the true fortieth.
pub const VERTEX_SHARE: f64 = 0.3;

/// `beta`: how much of the recovered bend counts. At 1 tissue of a small Poisson ratio is too soft by a few percent
/// more, as `G` is averaged over whole tetrahedra and so not quite at its vertex.
pub const RECOVERY: f64 = 0.9;

/// The bulk stiffness that counts at vertices, and per tetrahedron, ends at this multiple of the shear modulus: the
/// rest counts per cluster. Lower loses volume within clusters that soft tissue can keep; higher locks.
pub const CLUSTERED_ABOVE: f64 = 4.0;

/// The share of its rest volume below which the volume floor pushes a linear tetrahedron back. Of 200 bodies of 120
/// tetrahedra, crushed by violent grabs or scattered, the explicit method leaves 240 tetrahedra inside out without a
/// floor and 63 with it. A floor at zero leaves 174; 0.3 and 0.4 do no better than 0.2.
pub const VOLUME_FLOOR: f64 = 0.2;

/// Stiffness of the volume floor over the shear modulus. At 4 it leaves 172 of the tetrahedra above; at 32 no fewer than
/// at 16.
pub const FLOOR_STIFFNESS: f64 = 16.0;

/// Where the parts of Lame's first parameter count [Pa]; they add up to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BulkShares<S> {
    /// `l`, per tetrahedron and vertex, beside the shear: at most the shear modulus.
    pub local: S,
    /// `k_n`, on the mean volume around a vertex.
    pub domain: S,
    /// `k_c`, on the mean volume of a cluster of vertices.
    pub cluster: S,
}

/// Splits Lame's first parameter [Pa].
#[inline(always)]
pub fn bulk_shares<S: Scalar>(lame_lambda: S, lame_mu: S) -> BulkShares<S> {
    let local = lame_lambda.min(lame_mu);
    let averaged = lame_lambda.min(lame_mu * S::from_f64(CLUSTERED_ABOVE));
    BulkShares { local, domain: averaged - local, cluster: lame_lambda - averaged }
}

/// A tetrahedron at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestFrame<S> {
    /// `g_a`: gradients [1/m] of the linear shape functions.
    pub gradients: [Vec3<S>; 4],
    /// `r_a = X_a - X`: the corners from the centroid [m].
    pub arms: [Vec3<S>; 4],
    /// `c_o` of the face opposite each corner.
    pub face_weights: [S; 4],
}

/// `Fh`: the mean gradient with the bend that the gradients `G` of the corners' domains tell of.
///
/// With `y_p = G_p r_p`: `k_o = sum_p y_p - 4/3 (y_o - mean(G) r_o)`, as `X_o = X - r_o/3`.
#[inline(always)]
pub fn recovered_gradient<S: Scalar>(
    f: &Mat3<S>,
    vertex_gradients: &[Mat3<S>; 4],
    rest: &RestFrame<S>,
) -> Mat3<S> {
    let [a, b, c, d] = vertex_gradients;
    let mean = ((*a + *b) + (*c + *d)) * S::from_f64(0.25);
    let mut images = [Vec3::ZERO; 4];
    for p in 0..4 {
        images[p] = vertex_gradients[p] * rest.arms[p];
    }
    let sum = (images[0] + images[1]) + (images[2] + images[3]);
    let mut recovered = *f;
    for o in 0..4 {
        let apart = (images[o] - mean * rest.arms[o]) * S::from_f64(4.0 / 3.0);
        let moment = (sum - apart) * rest.face_weights[o];
        recovered = recovered + Mat3::outer(moment, rest.gradients[o]);
    }
    recovered
}

/// What `dE/dFh` [J], of the whole tetrahedron, is as derivatives by the gradients of the corners' domains: the
/// transpose of [`recovered_gradient`].
///
/// With `s_o = dE/dFh g_o`: `dE/dG_p = (sum_o c_o s_o - 4/3 c_p s_p) r_p^T + 1/3 sum_o c_o s_o r_o^T`.
#[inline(always)]
pub fn vertex_stresses<S: Scalar>(stress: &Mat3<S>, rest: &RestFrame<S>) -> [Mat3<S>; 4] {
    let mut pulls = [Vec3::ZERO; 4];
    let (mut sum, mut moment) = (Vec3::ZERO, Mat3::ZERO);
    for o in 0..4 {
        pulls[o] = *stress * rest.gradients[o] * rest.face_weights[o];
        sum += pulls[o];
        moment = moment + Mat3::outer(pulls[o], rest.arms[o]);
    }
    let moment = moment * S::from_f64(1.0 / 3.0);
    let mut stresses = [moment; 4];
    for p in 0..4 {
        let own = sum - pulls[p] * S::from_f64(4.0 / 3.0);
        stresses[p] = stresses[p] + Mat3::outer(own, rest.arms[p]);
    }
    stresses
}

/// Derivative [Pa] by `Fh` of a tetrahedron's energy over its volume: `share` of the law's stress, and the mean
/// `pressure` [Pa] of its four domains, `k_n (Jh_n - 1) + k_c (Jh_c - 1)`, on its volume.
#[inline(always)]
pub fn tet_stress<S: Scalar>(
    recovered: &Mat3<S>,
    local: S,
    lame_mu: S,
    share: S,
    pressure: S,
) -> Mat3<S> {
    neo_hookean::piola(recovered, local, lame_mu) * share + recovered.cofactor() * pressure
}

/// Energy [Pa] of a mean volume over the volume that it is the mean of: `k/2 (Jh - 1)^2`; `change` is `Jh - 1`.
#[inline(always)]
pub fn bulk_energy<S: Scalar>(change: S, stiffness: S) -> S {
    S::HALF * stiffness * (change * change)
}

/// `min(det F - 1/5, 0)` of a linear tetrahedron.
#[inline(always)]
pub fn below_floor<S: Scalar>(f: &Mat3<S>) -> S {
    (f.determinant() - S::from_f64(VOLUME_FLOOR)).min(S::ZERO)
}

/// Energy density [Pa] of the volume floor.
#[inline(always)]
pub fn floor_energy<S: Scalar>(f: &Mat3<S>, lame_mu: S) -> S {
    let below = below_floor(f);
    S::HALF * S::from_f64(FLOOR_STIFFNESS) * lame_mu * (below * below)
}

/// Derivative [Pa] of [`floor_energy`] by `F`.
#[inline(always)]
pub fn floor_piola<S: Scalar>(f: &Mat3<S>, lame_mu: S) -> Mat3<S> {
    f.cofactor() * (S::from_f64(FLOOR_STIFFNESS) * lame_mu * below_floor(f))
}

/// `floor_energy(F + D) - floor_energy(F)`, with the round-off of the change.
#[inline(always)]
pub fn floor_energy_change<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lame_mu: S) -> S {
    let volume = f.determinant() - S::from_f64(VOLUME_FLOOR);
    let below = volume.min(S::ZERO);
    let above = volume - below;
    let [first, second, third] = volume_variation(f, d);
    // What goes up ends at the floor, what comes down starts there.
    let change = (((first + second) + third) + above).min(-below);
    S::from_f64(FLOOR_STIFFNESS) * lame_mu * change * (below + S::HALF * change)
}

/// Second derivative [Pa] of [`floor_energy`] along `D`, and without the curvature of the volume, which may be negative.
#[inline(always)]
pub fn floor_curvature_along<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lame_mu: S) -> [S; 2] {
    let below = below_floor(f);
    let [first, second, _] = volume_variation(f, d);
    let stiffness = S::from_f64(FLOOR_STIFFNESS) * lame_mu;
    let bound = S::select(below.less(S::ZERO), stiffness * first * first, S::ZERO);
    [bound + S::TWO * stiffness * below * second, bound]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elements::{edge_matrix, shape_gradients};
    use crate::mesh::topology::{TET_EDGES, TET_FACES};
    use crate::scalar::vec3;

    fn number(seed: usize) -> f64 {
        libm::sin(seed as f64 * 12.9898 + 0.3) * 0.7
    }

    fn vector(seed: usize) -> Vec3<f64> {
        vec3(number(3 * seed), number(3 * seed + 1), number(3 * seed + 2))
    }

    fn matrix(seed: usize) -> Mat3<f64> {
        Mat3 { columns: [vector(3 * seed), vector(3 * seed + 1), vector(3 * seed + 2)] }
    }

    /// A tetrahedron of any shape, with weights of any faces.
    fn frame(seed: usize) -> ([Vec3<f64>; 4], RestFrame<f64>) {
        let corners = [0, 1, 2, 3].map(|a| vector(seed + 5 * a));
        let centroid = (corners[0] + corners[1] + corners[2] + corners[3]) * 0.25;
        let rest = RestFrame {
            gradients: shape_gradients(&edge_matrix(&corners).inverse()),
            arms: corners.map(|x| x - centroid),
            face_weights: [0, 1, 2, 3].map(|a| number(seed + 7 * a)),
        };
        (corners, rest)
    }

    /// The sum over faces is the sum over edges of the quadratic field, less what lies on the faces left out.
    #[test]
    fn faces_gather_the_middles_of_edges() {
        for seed in 0..40 {
            let (corners, mut rest) = frame(seed);
            let f = matrix(seed + 50);
            let gradients = [0, 1, 2, 3].map(|a| matrix(seed + 60 + a));
            let beta = 0.7;
            for left_out in [None, Some(seed % 4)] {
                rest.face_weights = [3.0 * beta / 8.0; 4];
                let mut expected = f;
                for [a, b] in TET_EDGES {
                    let middle = (gradients[a] - gradients[b]) * (corners[b] - corners[a]) * 0.125;
                    let mut sides = rest.gradients[a] + rest.gradients[b];
                    if let Some(o) =
                        left_out.filter(|&o| TET_FACES[o].contains(&a) && TET_FACES[o].contains(&b))
                    {
                        rest.face_weights[o] = 0.0;
                        sides += rest.gradients[o];
                    }
                    expected = expected + Mat3::outer(middle, sides) * beta;
                }
                let recovered = recovered_gradient(&f, &gradients, &rest);
                let error = (recovered - expected).norm_squared() / expected.norm_squared();
                assert!(error < 1e-24, "{seed} {left_out:?}: {error:e}");
            }
        }
    }

    /// Corners of one gradient bend nothing.
    #[test]
    fn one_gradient_is_recovered() {
        for seed in 0..40 {
            let (_, rest) = frame(seed);
            let f = matrix(seed + 50);
            let recovered = recovered_gradient(&f, &[f; 4], &rest);
            assert!((recovered - f).norm_squared() < 1e-26 * f.norm_squared() * scale(&rest));
        }
    }

    /// Of the terms that cancel: an arm times a gradient, squared.
    fn scale(rest: &RestFrame<f64>) -> f64 {
        let longest =
            |all: &[Vec3<f64>; 4]| all.iter().map(|v| v.length_squared()).fold(1.0, f64::max);
        longest(&rest.arms) * longest(&rest.gradients)
    }

    /// `S : recovered_gradient(0, dG) = sum_p vertex_stresses(S)_p : dG_p` for any stress and any change.
    #[test]
    fn stresses_are_the_transpose() {
        for seed in 0..40 {
            let (_, rest) = frame(seed);
            let stress = matrix(seed + 90);
            let changes = [0, 1, 2, 3].map(|a| matrix(seed + 60 + a));
            let along = stress.dot(recovered_gradient(&Mat3::ZERO, &changes, &rest));
            let stresses = vertex_stresses(&stress, &rest);
            let sum: f64 = stresses.iter().zip(&changes).map(|(n, d)| n.dot(*d)).sum();
            assert!((along - sum).abs() < 1e-13 * scale(&rest), "{seed}: {along} {sum}");
        }
    }

    /// Change, stress, curvature and bound of the floor against its energy: below it, above it, and from one to the other.
    #[test]
    fn the_floor_pushes_back_what_is_crushed() {
        let mu = 3.0;
        let (mut below, mut crossed) = (0, 0);
        for seed in 0..200 {
            // Of squares: nine sines in a row have no volume.
            let part = |k: usize| number((seed * seed + 31 * k * k + 17 * k * seed) % 1009);
            let column = |k: usize| vec3(part(3 * k), part(3 * k + 1), part(3 * k + 2));
            let f = Mat3::IDENTITY * 0.5 + Mat3 { columns: [0, 1, 2].map(column) };
            let d = Mat3 { columns: [3, 4, 5].map(column) };
            let at = |s: f64| f + d * s;
            let energy = |s: f64| floor_energy(&at(s), mu);
            let sides = [f, at(1.0)].map(|f| f.determinant() < VOLUME_FLOOR);
            below += usize::from(sides[0]);
            crossed += usize::from(sides[0] != sides[1]);
            assert_eq!(energy(0.0) > 0.0, sides[0], "{seed}");
            let change = floor_energy_change(&f, &d, mu);
            let expected = energy(1.0) - energy(0.0);
            assert!((change - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{seed}");
            if (f.determinant() - VOLUME_FLOOR).abs() < 1e-2 {
                continue;
            }
            let h = 1e-4;
            let first = (energy(h) - energy(-h)) / (2.0 * h);
            assert!((floor_piola(&f, mu).dot(d) - first).abs() < 1e-4, "{seed}: {first}");
            let second = (energy(h) - 2.0 * energy(0.0) + energy(-h)) / (h * h);
            let [exact, bound] = floor_curvature_along(&f, &d, mu);
            assert!(
                (exact - second).abs() < 1e-3 * (1.0 + second.abs()),
                "{seed}: {exact} {second}"
            );
            assert!(bound >= 0.0);
        }
        assert!(below > 50 && crossed > 20, "{below} {crossed}");
    }

    #[test]
    fn bulk_shares_add_up() {
        for (lambda, mu, expected) in [
            (-1.0, 3.0, [-1.0, 0.0, 0.0]),
            (2.0, 3.0, [2.0, 0.0, 0.0]),
            (9.0, 3.0, [3.0, 6.0, 0.0]),
            (60.0, 3.0, [3.0, 9.0, 48.0]),
        ] {
            let BulkShares { local, domain, cluster } = bulk_shares::<f64>(lambda, mu);
            assert_eq!([local, domain, cluster], expected);
        }
    }
}
