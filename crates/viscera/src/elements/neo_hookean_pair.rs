//! Stable neo-Hookean tetrahedron as a pair of XPBD constraints.
//!
//! ```text
//! C_H = J - a, compliance 1/(lh V);  C_D = |F|, compliance 1/(mu V)
//! ```
//!
//! solved as one 2 x 2 block (Macklin and Mueller, "A Constraint-based Formulation of Stable
//! Neo-Hookean Materials", MIG 2021, section 4, solve them one after the other).
//!
//! At rest both multipliers are of the size of mu and only their sum vanishes. Nearly all of the
//! shear stiffness is then geometric: as published the pair depends strongly on the path, and with
//! the rebase its mass bound slows motion down. [`super::neo_hookean_stretch`] has neither fault.

use super::neo_hookean::volume_change;
use super::{CornerLoad, TetCorrection, shape_gradients};
use crate::scalar::{Mat3, Scalar, Vec3};

/// Below this fraction of its rest value `sqrt(3)`, `|F|` has no usable direction: a tetrahedron
/// collapsed to a point. Larger values would weaken strongly compressed tissue; smaller ones let
/// round-off choose the direction.
const COLLAPSED: f64 = 1e-6;

/// `(C_H, C_D) = (J - a, |F|)`.
#[inline(always)]
pub fn constraints<S: Scalar>(f: &Mat3<S>, lame_lambda: S, lame_mu: S) -> [S; 2] {
    let offset = lame_mu / (lame_lambda + lame_mu);
    [volume_change(f) - offset, f.norm_squared().sqrt()]
}

/// The multipliers at which the residual of [`solve`] is zero: `-V dt^2 (lh C_H, mu C_D)`.
#[inline(always)]
pub fn constitutive_multipliers<S: Scalar>(
    f: &Mat3<S>,
    lame_lambda: S,
    lame_mu: S,
    step_volume: S,
) -> [S; 2] {
    let [volume, shear] = constraints(f, lame_lambda, lame_mu);
    [-(lame_lambda + lame_mu) * step_volume * volume, -lame_mu * step_volume * shear]
}

/// Gradients of `(C_H, C_D)` by one corner position [1/m]: `cof F g`, `F g / |F|`.
#[inline(always)]
pub fn gradient<S: Scalar>(f: &Mat3<S>, g: Vec3<S>) -> [Vec3<S>; 2] {
    [f.cofactor() * g, *f * g * inverse_norm(f)]
}

/// `1/|F|`, bounded where the tetrahedron has collapsed to a point.
#[inline(always)]
fn inverse_norm<S: Scalar>(f: &Mat3<S>) -> S {
    S::ONE / f.norm_squared().sqrt().max(S::from_f64(COLLAPSED))
}

/// One 2 x 2 block solve. `step_volume = V dt^2` [m^3 s^2], so that
/// `a~ = (1/(lh V dt^2), 1/(mu V dt^2))`. `w` are the inverse masses of the corners.
#[inline(always)]
pub fn solve<S: Scalar>(
    x: &[Vec3<S>; 4],
    w: &[S; 4],
    inverse_rest_shape: &Mat3<S>,
    multipliers: &[S; 2],
    lame_lambda: S,
    lame_mu: S,
    step_volume: S,
) -> TetCorrection<S, 2> {
    let f = super::deformation_gradient(x, inverse_rest_shape);
    let g = shape_gradients(inverse_rest_shape);
    let cofactor = f.cofactor();
    let scale = inverse_norm(&f);
    let mut volume_gradient = [Vec3::ZERO; 4];
    let mut shear_gradient = [Vec3::ZERO; 4];
    for i in 0..4 {
        volume_gradient[i] = cofactor * g[i];
        shear_gradient[i] = f * g[i] * scale;
    }
    let [volume, shear] = constraints(&f, lame_lambda, lame_mu);
    let volume_compliance = S::ONE / ((lame_lambda + lame_mu) * step_volume);
    let shear_compliance = S::ONE / (lame_mu * step_volume);

    let (mut a00, mut a01, mut a11) = (volume_compliance, S::ZERO, shear_compliance);
    for i in 0..4 {
        a00 += w[i] * volume_gradient[i].length_squared();
        a01 += w[i] * volume_gradient[i].dot(shear_gradient[i]);
        a11 += w[i] * shear_gradient[i].length_squared();
    }
    let b0 = -volume - volume_compliance * multipliers[0];
    let b1 = -shear - shear_compliance * multipliers[1];
    // Elimination rather than Cramer's rule: the products a00 a11 and a01^2 may nearly cancel.
    let ratio = a01 / a00;
    let d1 = (b1 - ratio * b0) / (a11 - ratio * a01);
    let d0 = (b0 - a01 * d1) / a00;
    let mut positions = [Vec3::ZERO; 4];
    for i in 0..4 {
        positions[i] = (volume_gradient[i] * d0 + shear_gradient[i] * d1) * w[i];
    }
    TetCorrection { multipliers: [d0, d1], positions }
}

/// `grad C^T l` on each corner, and the bound of its geometric stiffness:
/// `|l_D|/|F| sum_b |g_i . g_b| + |l_H| sum_{b != i} |F (g_i x g_b)|`.
#[inline(always)]
pub fn corner_loads<S: Scalar>(
    x: &[Vec3<S>; 4],
    inverse_rest_shape: &Mat3<S>,
    multipliers: &[S; 2],
) -> [CornerLoad<S>; 4] {
    let f = super::deformation_gradient(x, inverse_rest_shape);
    let g = shape_gradients(inverse_rest_shape);
    let [volume, shear] = *multipliers;
    let shear = shear * inverse_norm(&f);
    let stress = f.cofactor() * volume + f * shear;
    let mut loads = [CornerLoad::default(); 4];
    for i in 0..4 {
        let mut mass_bound = S::ZERO;
        for b in 0..4 {
            let twist = if b == i { S::ZERO } else { (f * g[i].cross(g[b])).length() };
            mass_bound += shear.abs() * g[i].dot(g[b]).abs() + volume.abs() * twist;
        }
        loads[i] = CornerLoad { impulse: stress * g[i], mass_bound };
    }
    loads
}
