//! Stable neo-Hookean tetrahedron in the stretch form: six multipliers conjugate to the signed
//! polar stretch.
//!
//! ```text
//! F = U diag(s) V^T                            signed singular values
//! t_i = mu s_i + e s_j s_k,  e = lh (J - a)    Biot stress, principal values
//! L: symmetric, material axes; L' = V^T L V, g' = V^T g
//! impulse on a corner: R L g = U L' g',  R = U V^T
//! r = (L'_11 + s t_1, L'_22 + s t_2, L'_33 + s t_3, L'_23, L'_13, L'_12),  s = V dt^2
//! (C + sum_i w_i B_i B_i^T) d = -C r;  L' += d;  x_i += w_i U (D g'_i)
//! ```
//!
//! `D` is the symmetric matrix of `d`; rows of `B_i` are `g'_a u_a` and `g'_a u_b + g'_b u_a`. `C` is
//! the inverse of the stiffness of the principal stretches and of the shears between them, divided
//! by `s`. It preconditions only: a fixed point needs `r = 0`, so clamps never move it.
//!
//! Unlike the pair of `J` and `|F|`, the multipliers vanish at rest, and so does the geometric
//! stiffness `(t_i + t_j)/(s_i + s_j)` of the rotation: with the rebase the tissue carries no added
//! mass at rest. It is defined through inversion.

use super::green_strain::{Voigt, scaled, symmetric};
use super::singular_values::{SignedSvd, signed_svd};
use super::{
    CornerLoad, Symmetric, TetCorrection, deformation_gradient, shape_gradients, solve_symmetric,
    weighted_images, weighted_products,
};
use crate::scalar::{Mat3, Scalar, Vec3};

/// The stiffness of the principal stretches counts as positive while its minors exceed this
/// fraction of those of `mu I`; below, its indefinite part is left out.
const CLEARLY_POSITIVE: f64 = 1e-3;

/// Smallest shear stiffness as a fraction of mu.
const SOFTEST_SHEAR: f64 = 0.1;

/// Smallest `s_i + s_j` in the mass bound. The true one vanishes where a tetrahedron passes
/// through a flat inverted state; smaller values would freeze it there.
const SMALLEST_PAIR: f64 = 0.3;

/// Principal Biot stresses `t` [Pa], and `e` [Pa].
#[inline(always)]
fn biot_stress<S: Scalar>(sigma: &[S; 3], lame_lambda: S, lame_mu: S) -> ([S; 3], S) {
    let [a, b, c] = *sigma;
    let volume_modulus = lame_lambda + lame_mu;
    let e = volume_modulus * (a * b * c - S::ONE) - lame_mu;
    ([lame_mu * a + e * b * c, lame_mu * b + e * a * c, lame_mu * c + e * a * b], e)
}

/// `V^T L V` as six components.
#[inline(always)]
fn turn<S: Scalar>(v: &Mat3<S>, components: &Voigt<S>) -> Voigt<S> {
    let image = symmetric(components) * *v;
    let [a, b, c] = v.columns;
    let [x, y, z] = image.columns;
    [a.dot(x), b.dot(y), c.dot(z), b.dot(z), a.dot(z), a.dot(y)]
}

/// The multipliers at which the residual of [`solve`] is zero: `L = -V dt^2 V diag(t) V^T`, the Biot
/// stress in material axes.
#[inline(always)]
pub fn constitutive_multipliers<S: Scalar>(
    f: &Mat3<S>,
    lame_lambda: S,
    lame_mu: S,
    step_volume: S,
) -> Voigt<S> {
    let SignedSvd { sigma, v, .. } = signed_svd(f);
    let ([a, b, c], _) = biot_stress(&sigma, lame_lambda, lame_mu);
    let principal = [a, b, c, S::ZERO, S::ZERO, S::ZERO];
    turn(&v.transpose(), &scaled(principal, -step_volume))
}

/// A symmetric 3 x 3 matrix by its lower triangle `(00, 10, 11, 20, 21, 22)`.
type Lower<S> = [S; 6];

/// Stiffness [Pa] of the principal stretches, whose indefinite part is that of `e`.
#[inline(always)]
fn stretch_stiffness<S: Scalar>(sigma: &[S; 3], volume_modulus: S, lame_mu: S, e: S) -> Lower<S> {
    let [s1, s2, s3] = *sigma;
    let c = [s2 * s3, s1 * s3, s1 * s2];
    [
        lame_mu + volume_modulus * c[0] * c[0],
        volume_modulus * c[1] * c[0] + e * s3,
        lame_mu + volume_modulus * c[1] * c[1],
        volume_modulus * c[2] * c[0] + e * s2,
        volume_modulus * c[2] * c[1] + e * s1,
        lame_mu + volume_modulus * c[2] * c[2],
    ]
}

/// The leading minor of two rows.
#[inline(always)]
fn minor<S: Scalar>(d: &Lower<S>) -> S {
    d[0] * d[2] - d[1] * d[1]
}

#[inline(always)]
fn determinant<S: Scalar>(d: &Lower<S>) -> S {
    d[0] * (d[2] * d[5] - d[4] * d[4]) - d[1] * (d[1] * d[5] - d[4] * d[3])
        + d[3] * (d[1] * d[4] - d[2] * d[3])
}

/// Inverse of the stiffness of the principal stretches, times `1/(V dt^2)`.
#[inline(always)]
fn stretch_compliance<S: Scalar>(
    sigma: &[S; 3],
    lame_lambda: S,
    lame_mu: S,
    e: S,
    step_volume: S,
) -> Lower<S> {
    let volume_modulus = lame_lambda + lame_mu;
    let full = stretch_stiffness(sigma, volume_modulus, lame_mu, e);
    // Far from rest the terms with `e` can make the stiffness indefinite; the solve would then move corners the
    // wrong way, or divide by zero. What remains without them is `mu I` plus a square, so at least `mu`. By a mask,
    // because lanes take no branches. The first minor needs no test: it is `mu` plus a square.
    let floor = S::from_f64(CLEARLY_POSITIVE) * lame_mu * lame_mu;
    let keep = S::select(minor(&full).less(floor), S::ZERO, S::ONE);
    let keep = S::select(determinant(&full).less(floor * lame_mu), S::ZERO, keep);
    let d = stretch_stiffness(sigma, volume_modulus, lame_mu, keep * e);
    // The adjugate over the determinant: six products, no pivots. `1/(V dt^2)` makes stiffness a compliance over
    // dt^2, in the unit of the sum that it is added to.
    let scale = S::ONE / (determinant(&d) * step_volume);
    [
        (d[2] * d[5] - d[4] * d[4]) * scale,
        (d[3] * d[4] - d[1] * d[5]) * scale,
        (d[0] * d[5] - d[3] * d[3]) * scale,
        (d[1] * d[4] - d[3] * d[2]) * scale,
        (d[1] * d[3] - d[0] * d[4]) * scale,
        minor(&d) * scale,
    ]
}

/// Compliance of a shear in the plane across a principal axis, with the floor of its stiffness.
#[inline(always)]
fn shear_compliance<S: Scalar>(sigma: S, lame_mu: S, e: S, step_volume: S) -> S {
    let stiffness = (S::from_f64(SOFTEST_SHEAR) * lame_mu).max(lame_mu - e * sigma);
    S::TWO / (stiffness * step_volume)
}

/// One block solve. `w` are the inverse masses [1/kg] of the corners, `multipliers` the components
/// of `L` [J s^2] in material axes, `step_volume = V dt^2` [m^3 s^2].
#[inline(always)]
pub fn solve<S: Scalar>(
    x: &[Vec3<S>; 4],
    w: &[S; 4],
    inverse_rest_shape: &Mat3<S>,
    multipliers: &Voigt<S>,
    lame_lambda: S,
    lame_mu: S,
    step_volume: S,
) -> TetCorrection<S, 6> {
    let f = deformation_gradient(x, inverse_rest_shape);
    let SignedSvd { u, sigma, v } = signed_svd(&f);
    // Everything in principal axes: there the stiffness is one block of the three stretches and a number for each
    // shear, and products of constraint gradients need no rotation, because the axes `u` are orthonormal.
    let mut g = shape_gradients(inverse_rest_shape);
    let material_axes = v.transpose();
    for gradient in &mut g {
        *gradient = material_axes * *gradient;
    }
    let (stress, e) = biot_stress(&sigma, lame_lambda, lame_mu);
    let principal = turn(&v, multipliers);
    // `L' + s t`: multipliers are forces that the stress exerts, hence the sign. The Biot stress has no shears in
    // principal axes, so that what `L'` has there is residual.
    let residual = [
        principal[0] + step_volume * stress[0],
        principal[1] + step_volume * stress[1],
        principal[2] + step_volume * stress[2],
        principal[3],
        principal[4],
        principal[5],
    ];

    // sum_i w_i B_i B_i^T, from G = sum_i w_i g'_i g'_i^T; the axes u are orthonormal.
    let Symmetric { xx: g00, yy: g11, zz: g22, yz: g12, xz: g02, xy: g01 } =
        weighted_products(&g, w);
    let zero = S::ZERO;
    let c = stretch_compliance(&sigma, lame_lambda, lame_mu, e, step_volume);
    let shears = [
        shear_compliance(sigma[0], lame_mu, e, step_volume),
        shear_compliance(sigma[1], lame_mu, e, step_volume),
        shear_compliance(sigma[2], lame_mu, e, step_volume),
    ];
    // Lower triangle; `solve_symmetric` works in the upper one. Example: a stretch is `g'_1 u_1`, a shear
    // `g'_1 u_2 + g'_2 u_1`, their product `g'_1 g'_2`: entry 3,1 is `g12`.
    let matrix = [
        [c[0] + g00, zero, zero, zero, zero, zero],
        [c[1], c[2] + g11, zero, zero, zero, zero],
        [c[3], c[4], c[5] + g22, zero, zero, zero],
        [zero, g12, g12, shears[0] + g11 + g22, zero, zero],
        [g02, zero, g02, g01, shears[1] + g00 + g22, zero],
        [g01, g01, zero, g02, g12, shears[2] + g00 + g11],
    ];
    // XPBD's equation with the compliance, not the stiffness: for nearly incompressible tissue (large `lh`) `C` gets
    // small beside the sum over corners and does no harm, where its inverse would drown that sum.
    let right = [
        -(c[0] * residual[0] + c[1] * residual[1] + c[3] * residual[2]),
        -(c[1] * residual[0] + c[2] * residual[1] + c[4] * residual[2]),
        -(c[3] * residual[0] + c[4] * residual[1] + c[5] * residual[2]),
        -(shears[0] * residual[3]),
        -(shears[1] * residual[4]),
        -(shears[2] * residual[5]),
    ];
    // Multipliers go back to material axes, where they are kept: principal axes turn from sweep to sweep.
    let change = solve_symmetric(matrix, right);
    let positions = weighted_images(&(u * symmetric(&change)), &g, w);
    TetCorrection { multipliers: turn(&material_axes, &change), positions }
}

/// `R L g` on each corner, and the bound of its geometric stiffness: with
/// `tau = max_(i<j) (|L'_ii + L'_jj| + 2 max |L'_offdiagonal|)/(s_i + s_j)`, `tau sum_b |g_i . g_b|`.
#[inline(always)]
pub fn corner_loads<S: Scalar>(
    x: &[Vec3<S>; 4],
    inverse_rest_shape: &Mat3<S>,
    multipliers: &Voigt<S>,
) -> [CornerLoad<S>; 4] {
    let f = deformation_gradient(x, inverse_rest_shape);
    let SignedSvd { u, sigma, v } = signed_svd(&f);
    let g = shape_gradients(inverse_rest_shape);
    let l = turn(&v, multipliers);
    // Half way through a solve `L'` has shears as well. They turn with the axes like the rest, and without their part
    // the bound would be too small just where the iteration is far from its end.
    let off_diagonal = S::TWO * l[3].abs().max(l[4].abs()).max(l[5].abs());
    let tau = rotation_stiffness(&l, &sigma, off_diagonal, 0, 1)
        .max(rotation_stiffness(&l, &sigma, off_diagonal, 0, 2))
        .max(rotation_stiffness(&l, &sigma, off_diagonal, 1, 2));
    // `R L`: multipliers are those of the unrotated tissue, the rotation brings them into space.
    let stress = u * v.transpose() * symmetric(multipliers);
    let mut loads = [CornerLoad::default(); 4];
    for i in 0..4 {
        let mut reach = S::ZERO;
        // Row sum of `|g_i . g_b|`: by it the diagonal bounds the coupled blocks of all four corners.
        for b in 0..4 {
            reach += g[i].dot(g[b]).abs();
        }
        loads[i] = CornerLoad { impulse: stress * g[i], mass_bound: tau * reach };
    }
    loads
}

#[inline(always)]
fn rotation_stiffness<S: Scalar>(
    l: &Voigt<S>,
    sigma: &[S; 3],
    off_diagonal: S,
    i: usize,
    j: usize,
) -> S {
    let floor = S::from_f64(SMALLEST_PAIR);
    ((l[i] + l[j]).abs() + off_diagonal) / (sigma[i] + sigma[j]).max(floor)
}
