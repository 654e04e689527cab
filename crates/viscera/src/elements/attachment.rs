//! Attachment: a vertex held elastically at a point in space (the anchor `p`).
//! `C = x - p` (three components), energy `k |C|^2 / 2`, compliance `1/k`. Linear, so it has no
//! geometric stiffness.

use crate::scalar::{Scalar, Vec3};

/// Energy [J].
#[inline(always)]
pub fn energy<S: Scalar>(x: Vec3<S>, anchor: Vec3<S>, stiffness: S) -> S {
    S::HALF * stiffness * (x - anchor).length_squared()
}

/// Force [N] on the vertex.
#[inline(always)]
pub fn force<S: Scalar>(x: Vec3<S>, anchor: Vec3<S>, stiffness: S) -> Vec3<S> {
    (anchor - x) * stiffness
}

/// One solve: changes of the three multipliers and of the position [m].
/// `compliance_tilde = 1/(k dt^2)`.
#[inline(always)]
pub fn solve<S: Scalar>(
    x: Vec3<S>,
    w: S,
    anchor: Vec3<S>,
    multipliers: Vec3<S>,
    compliance_tilde: S,
) -> (Vec3<S>, Vec3<S>) {
    let scale = S::ONE / (w + compliance_tilde);
    let change = (anchor - x - multipliers * compliance_tilde) * scale;
    (change, change * w)
}

/// The multipliers at which the residual of [`solve`] is zero: `-C/a~`.
#[inline(always)]
pub fn constitutive_multipliers<S: Scalar>(
    x: Vec3<S>,
    anchor: Vec3<S>,
    compliance_tilde: S,
) -> Vec3<S> {
    (anchor - x) * (S::ONE / compliance_tilde)
}
