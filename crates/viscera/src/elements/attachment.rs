//! Attachment: a vertex held elastically at a point in space (the anchor `p`).
//! `C = x - p` (three components), energy `k |C|^2 / 2`, compliance `1/k`. Linear, so it has no
//! geometric stiffness.

use super::CornerLoad;
use super::kinds::{CONSTANTS, Constant, Energy, Kind, Legal, Moment, XpbdBlock};
use super::text::kernel_text;
use crate::scalar::{Mat3, Real, Scalar, Vec3, vec3};

/// The kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Attachments;

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment<S> {
    /// Where its vertex is pulled to [m].
    pub anchor: Vec3<S>,
    /// [N/m].
    pub stiffness: S,
}

impl Kind<1, 3> for Attachments {
    type Element<T: Real> = Attachment<T>;

    const NAME: &'static str = "an attachment";

    const IS_ANCHORED: bool = true;

    const CONSTANTS: &'static [Constant] =
        &[Constant { name: "attachment stiffness [N/m]", legal: Legal::Positive }];

    const WGSL: &'static str = kernel_text!("attachment.wgsl");

    fn element<T: Real>([stiffness, ..]: [T; CONSTANTS], moment: &Moment<T, 1>) -> Attachment<T> {
        Attachment { anchor: moment.anchor, stiffness }
    }
}

impl<S: Real> Energy<S, 1> for Attachment<S> {
    fn energy(&self, &[x]: &[Vec3<S>; 1]) -> S {
        energy(x, self.anchor, self.stiffness)
    }

    fn forces(&self, &[x]: &[Vec3<S>; 1]) -> [Vec3<S>; 1] {
        [force(x, self.anchor, self.stiffness)]
    }

    fn curvature(&self) -> S {
        self.stiffness
    }

    fn stiffness(&self) -> S {
        self.stiffness
    }

    fn energy_change(&self, &[x]: &[Vec3<S>; 1], &[d]: &[Vec3<S>; 1]) -> S {
        energy_change(x, d, self.anchor, self.stiffness)
    }

    fn blocks(&self, _: &[Vec3<S>; 1]) -> [[Mat3<S>; 1]; 1] {
        [[Mat3::IDENTITY * self.stiffness]]
    }
}

impl<S: Real> XpbdBlock<S, 1, 3> for Attachment<S> {
    fn solve(
        &self,
        &[x]: &[Vec3<S>; 1],
        &[w]: &[S; 1],
        multipliers: &[S; 3],
        compliance: S,
    ) -> ([S; 3], [Vec3<S>; 1]) {
        let [a, b, c] = *multipliers;
        let (change, moved) = solve(x, w, self.anchor, vec3(a, b, c), compliance);
        (change.to_array(), [moved])
    }

    fn loads(&self, _: &[Vec3<S>; 1], &[a, b, c]: &[S; 3], _: S) -> [CornerLoad<S>; 1] {
        [CornerLoad { impulse: vec3(a, b, c), mass_bound: S::ZERO }]
    }

    fn constitutive(&self, &[x]: &[Vec3<S>; 1], compliance: S) -> [S; 3] {
        constitutive_multipliers(x, self.anchor, compliance).to_array()
    }
}

/// Energy [J].
#[inline(always)]
pub fn energy<S: Scalar>(x: Vec3<S>, anchor: Vec3<S>, stiffness: S) -> S {
    S::HALF * stiffness * (x - anchor).length_squared()
}

/// Change of the energy [J] as the vertex moves by `d` [m], with the round-off of the change.
#[inline(always)]
pub fn energy_change<S: Scalar>(x: Vec3<S>, d: Vec3<S>, anchor: Vec3<S>, stiffness: S) -> S {
    stiffness * d.dot(x - anchor + d * S::HALF)
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
