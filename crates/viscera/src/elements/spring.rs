//! Spring between two vertices: `C = |x1 - x0| - L`, energy `k C^2 / 2`, compliance `1/k`.

use super::CornerLoad;
use super::kinds::{CONSTANTS, Constant, Energy, Kind, Legal, Moment, XpbdBlock};
use super::text::kernel_text;
use crate::scalar::{Mat3, Real, Scalar, Vec3};

/// The kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Springs;

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring<S> {
    /// Length without force [m].
    pub rest_length: S,
    /// [N/m].
    pub stiffness: S,
}

impl Kind<2, 1> for Springs {
    type Element<T: Real> = Spring<T>;

    const NAME: &'static str = "a spring";

    const IS_ANCHORED: bool = false;

    const CONSTANTS: &'static [Constant] = &[
        Constant { name: "rest length [m]", legal: Legal::NotNegative },
        Constant { name: "spring stiffness [N/m]", legal: Legal::Positive },
    ];

    const WGSL: &'static str = kernel_text!("spring.wgsl");

    fn element<T: Real>(
        [rest_length, stiffness, ..]: [T; CONSTANTS],
        _: &Moment<T, 2>,
    ) -> Spring<T> {
        Spring { rest_length, stiffness }
    }
}

impl<S: Real> Energy<S, 2> for Spring<S> {
    fn energy(&self, x: &[Vec3<S>; 2]) -> S {
        energy(x, self.rest_length, self.stiffness)
    }

    fn forces(&self, x: &[Vec3<S>; 2]) -> [Vec3<S>; 2] {
        forces(x, self.rest_length, self.stiffness)
    }

    fn curvature(&self) -> S {
        self.stiffness
    }

    fn stiffness(&self) -> S {
        S::TWO * self.stiffness
    }

    fn energy_change(&self, x: &[Vec3<S>; 2], d: &[Vec3<S>; 2]) -> S {
        energy_change(x, d, self.rest_length, self.stiffness)
    }

    fn blocks(&self, x: &[Vec3<S>; 2]) -> [[Mat3<S>; 2]; 2] {
        blocks(x, self.rest_length, self.stiffness)
    }
}

impl<S: Real> XpbdBlock<S, 2, 1> for Spring<S> {
    fn solve(
        &self,
        x: &[Vec3<S>; 2],
        w: &[S; 2],
        [multiplier]: &[S; 1],
        compliance: S,
    ) -> ([S; 1], [Vec3<S>; 2]) {
        let (change, moves) = solve(x, w, self.rest_length, *multiplier, compliance);
        ([change], moves)
    }

    fn loads(&self, x: &[Vec3<S>; 2], [multiplier]: &[S; 1], _: S) -> [CornerLoad<S>; 2] {
        corner_loads(x, *multiplier)
    }

    fn constitutive(&self, x: &[Vec3<S>; 2], compliance: S) -> [S; 1] {
        [constitutive_multiplier(x, self.rest_length, compliance)]
    }
}

/// Shortest length [m] at which a spring still has a direction; below it the spring rests for
/// one solve rather than push along round-off.
const SHORTEST: f64 = 1e-12;

/// Direction from the first to the second end, and the length [m].
#[inline(always)]
pub fn direction<S: Scalar>(x: &[Vec3<S>; 2]) -> (Vec3<S>, S) {
    let edge = x[1] - x[0];
    let length = edge.length();
    let short = length.less(S::from_f64(SHORTEST));
    let inverse = S::select(short, S::ZERO, S::ONE / length);
    (edge * inverse, length)
}

/// Energy [J].
#[inline(always)]
pub fn energy<S: Scalar>(x: &[Vec3<S>; 2], rest_length: S, stiffness: S) -> S {
    let (_, length) = direction(x);
    let c = length - rest_length;
    S::HALF * stiffness * c * c
}

/// Change of the energy [J] as the ends move by `d`: `k (l1 - l0) ((l0 + l1)/2 - L)` with
/// `l1 - l0 = d01 . (2 e + d01)/(l0 + l1)`. Its round-off is that of the change, not that of the energy.
#[inline(always)]
pub fn energy_change<S: Scalar>(
    x: &[Vec3<S>; 2],
    d: &[Vec3<S>; 2],
    rest_length: S,
    stiffness: S,
) -> S {
    let (edge, change) = (x[1] - x[0], d[1] - d[0]);
    let sum = edge.length() + (edge + change).length();
    let inverse = S::ONE / sum.max(S::from_f64(SHORTEST));
    let longer = change.dot(edge + edge + change) * inverse;
    stiffness * longer * (S::HALF * sum - rest_length)
}

/// Forces [N] on the two ends.
#[inline(always)]
pub fn forces<S: Scalar>(x: &[Vec3<S>; 2], rest_length: S, stiffness: S) -> [Vec3<S>; 2] {
    let (n, length) = direction(x);
    let pull = n * (stiffness * (length - rest_length));
    [pull, -pull]
}

/// Second derivative [N/m] of the energy by the two ends without its negative part, which a spring shorter than at
/// rest has across: `B = k n n^T + k max(0, 1 - L/l) (I - n n^T)`, with `-B` between the ends. Exact where the spring is
/// stretched.
#[inline(always)]
pub fn blocks<S: Scalar>(x: &[Vec3<S>; 2], rest_length: S, stiffness: S) -> [[Mat3<S>; 2]; 2] {
    let (n, length) = direction(x);
    let slack = rest_length / length.max(S::from_f64(SHORTEST));
    let across = stiffness * (S::ONE - slack).max(S::ZERO);
    let block = Mat3::outer(n, n) * (stiffness - across) + Mat3::IDENTITY * across;
    let other = block * -S::ONE;
    [[block, other], [other, block]]
}

/// One solve: change of the multiplier [J s^2 / m] and of the two positions [m].
/// `compliance_tilde = 1/(k dt^2)`.
#[inline(always)]
pub fn solve<S: Scalar>(
    x: &[Vec3<S>; 2],
    w: &[S; 2],
    rest_length: S,
    multiplier: S,
    compliance_tilde: S,
) -> (S, [Vec3<S>; 2]) {
    let (n, length) = direction(x);
    let numerator = -(length - rest_length) - compliance_tilde * multiplier;
    let change = numerator / (w[0] + w[1] + compliance_tilde);
    (change, [n * (-change * w[0]), n * (change * w[1])])
}

/// The multiplier at which the residual of [`solve`] is zero: `-C/a~`.
#[inline(always)]
pub fn constitutive_multiplier<S: Scalar>(
    x: &[Vec3<S>; 2],
    rest_length: S,
    compliance_tilde: S,
) -> S {
    let (_, length) = direction(x);
    (rest_length - length) / compliance_tilde
}

/// `grad C^T l` on both ends; `d^2 C = (I - n n^T)/|x1 - x0|` gives the bound `2 |l|/|x1 - x0|`.
#[inline(always)]
pub fn corner_loads<S: Scalar>(x: &[Vec3<S>; 2], multiplier: S) -> [CornerLoad<S>; 2] {
    let (n, length) = direction(x);
    let mass_bound = S::TWO * multiplier.abs() / length.max(S::from_f64(SHORTEST));
    [
        CornerLoad { impulse: n * -multiplier, mass_bound },
        CornerLoad { impulse: n * multiplier, mass_bound },
    ]
}
