//! Stable neo-Hookean tetrahedron, without logarithm or barrier: defined through inversion.
//!
//! ```text
//! lh = lambda + mu,  a = 1 + mu/lh
//! W = mu/2 (|F|^2 - 3) + lh/2 (J - a)^2 - lh/2 (1 - a)^2,   P = mu F + lh (J - a) cof F
//! ```
//!
//! With Lame lambda and mu from E and nu this has the small-strain stiffness of E and nu: the
//! shift `lh = lambda + mu` matters (without it tissue is 12 % too soft). After Smith, de Goes,
//! Kim, "Stable Neo-Hookean Flesh Simulation", TOG 2018, section 3, without the logarithmic term.
//!
//! Two constraint forms of this energy: [`super::neo_hookean_pair`] as published, and
//! [`super::neo_hookean_stretch`].
//!
//! Energy and stress are evaluated through `H = F - I`, so that single precision keeps its digits
//! at small strain: `J - 1 = tr H + I2 + det H` with `I2 = (tr(H)^2 - tr(H^2))/2`.
//!
//! From `F` to `F + D` the volume changes by a cubic polynomial, and the energy without a difference of energies:
//!
//! ```text
//! dJ = cof F : D + F : cof D + det D
//! dW = mu ((F - cof F) : D + |D|^2/2 - F : cof D - det D) + lh dJ ((J - 1) + dJ/2)
//! D : d2W/dF2 : D = mu |D|^2 + lh (cof F : D)^2 + 2 (lh (J - 1) - mu) F : cof D
//! ```
//!
//! The first two terms of the second derivative are never negative; the third, the paper's volume Hessian, may be.

use crate::scalar::{Mat3, Scalar};

/// `(tr H, I2, det H)` of `H = F - I`.
#[inline(always)]
fn invariants<S: Scalar>(f: &Mat3<S>) -> (S, S, S) {
    let h = *f - Mat3::IDENTITY;
    let [a, b, c] = h.columns;
    let second = (a.x * b.y - a.y * b.x) + (a.x * c.z - a.z * c.x) + (b.y * c.z - b.z * c.y);
    (h.trace(), second, h.determinant())
}

/// Relative volume change `J - 1`.
#[inline(always)]
pub fn volume_change<S: Scalar>(f: &Mat3<S>) -> S {
    let (trace, second, determinant) = invariants(f);
    trace + second + determinant
}

/// Energy density [Pa], zero at rest.
#[inline(always)]
pub fn energy_density<S: Scalar>(f: &Mat3<S>, lame_lambda: S, lame_mu: S) -> S {
    let (trace, second, determinant) = invariants(f);
    let j = trace + second + determinant;
    let h = *f - Mat3::IDENTITY;
    let shear = h.norm_squared() - S::TWO * (second + determinant);
    S::HALF * (lame_mu * shear + (lame_lambda + lame_mu) * j * j)
}

/// First Piola stress [Pa]: `P = mu (F - cof F) + lh (J - 1) cof F`.
#[inline(always)]
pub fn piola<S: Scalar>(f: &Mat3<S>, lame_lambda: S, lame_mu: S) -> Mat3<S> {
    let cofactor = f.cofactor();
    (*f - cofactor) * lame_mu + cofactor * ((lame_lambda + lame_mu) * volume_change(f))
}

/// `(F - cof F) : D` and `cof F : D`, both through `H`: with `r = tr H tr D - H^T : D + cof H : D`, the derivative of
/// `I2 + det H`, they are `H : D - r` and `tr D + r`.
#[inline(always)]
fn first_derivatives<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>) -> (S, S) {
    let h = *f - Mat3::IDENTITY;
    let trace = d.trace();
    let rest = (h.trace() * trace - h.transpose().dot(*d)) + h.cofactor().dot(*d);
    (h.dot(*d) - rest, trace + rest)
}

/// The volume change from `F` to `F + D` by powers of `D`: `cof F : D`, `F : cof D` and `det D`; they add up to
/// `det(F + D) - det F` without its cancellation, and the second derivative along `D` is twice the second.
#[inline(always)]
pub fn volume_variation<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>) -> [S; 3] {
    let (_, first) = first_derivatives(f, d);
    [first, f.dot(d.cofactor()), d.determinant()]
}

/// `W(F + D) - W(F)` [Pa]. Its round-off is that of its terms, which vanish with `d`; that of a difference of two
/// energies does not.
#[inline(always)]
pub fn energy_change<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lame_lambda: S, lame_mu: S) -> S {
    let (shear, volume) = first_derivatives(f, d);
    let higher = f.dot(d.cofactor()) + d.determinant();
    let volume = volume + higher;
    let shear = shear + S::HALF * d.norm_squared() - higher;
    let middle = volume_change(f) + S::HALF * volume;
    lame_mu * shear + (lame_lambda + lame_mu) * volume * middle
}

/// Second derivative [Pa] of the energy density along `d`: exact, and without the curvature of the volume, which may
/// be negative. The second is positive semidefinite.
#[inline(always)]
pub fn curvature_along<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lame_lambda: S, lame_mu: S) -> [S; 2] {
    let (_, volume) = first_derivatives(f, d);
    let stiffness = lame_lambda + lame_mu;
    let bound = lame_mu * d.norm_squared() + stiffness * volume * volume;
    let pressure = stiffness * volume_change(f) - lame_mu;
    [bound + S::TWO * pressure * f.dot(d.cofactor()), bound]
}
