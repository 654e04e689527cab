//! Kinds of elements for tests of what the list of kinds promises: one without multipliers, which XPBD has between its
//! sweeps only, on three vertices, and one on four. `b`, `d` are vectors, `k` stiffnesses [N/m]:
//!
//! ```text
//! hinge  b = x0 - 2 x1 + x2,                energy k |b|^2 / 2
//! strut  d = (x0 + x1 - x2 - x3)/2,         C = |d| - L,   energy k C^2 / 2
//! ```

use super::CornerLoad;
use super::kinds::{CONSTANTS, Constant, Energy, Kind, Legal, Moment, XpbdBlock};
use super::text::kernel_text;
use crate::scalar::{Real, Scalar, Vec3};

/// Three vertices that like to lie evenly on a line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hinges;

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hinge<S> {
    /// [N/m].
    pub stiffness: S,
}

/// Two pairs of vertices that keep their middles apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Struts;

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strut<S> {
    /// Length without force [m].
    pub rest_length: S,
    /// [N/m].
    pub stiffness: S,
}

impl Kind<3, 0> for Hinges {
    type Element<T: Real> = Hinge<T>;

    const NAME: &'static str = "a hinge";

    const IS_ANCHORED: bool = false;

    const CONSTANTS: &'static [Constant] =
        &[Constant { name: "hinge stiffness [N/m]", legal: Legal::Positive }];

    const WGSL: &'static str = kernel_text!("trial.wgsl");

    fn element<T: Real>([stiffness, ..]: [T; CONSTANTS], _: &Moment<T, 3>) -> Hinge<T> {
        Hinge { stiffness }
    }
}

impl Kind<4, 1> for Struts {
    type Element<T: Real> = Strut<T>;

    const NAME: &'static str = "a strut";

    const IS_ANCHORED: bool = false;

    const CONSTANTS: &'static [Constant] = &[
        Constant { name: "rest length [m]", legal: Legal::Positive },
        Constant { name: "strut stiffness [N/m]", legal: Legal::Positive },
    ];

    // In the text of hinges.
    const WGSL: &'static str = "";

    fn element<T: Real>(
        [rest_length, stiffness, ..]: [T; CONSTANTS],
        _: &Moment<T, 4>,
    ) -> Strut<T> {
        Strut { rest_length, stiffness }
    }
}

impl<S: Scalar> Hinge<S> {
    fn bend([a, b, c]: &[Vec3<S>; 3]) -> Vec3<S> {
        *a + *c - *b * S::TWO
    }
}

impl<S: Scalar> Energy<S, 3> for Hinge<S> {
    fn energy(&self, x: &[Vec3<S>; 3]) -> S {
        S::HALF * self.stiffness * Self::bend(x).length_squared()
    }

    fn forces(&self, x: &[Vec3<S>; 3]) -> [Vec3<S>; 3] {
        let pull = Self::bend(x) * self.stiffness;
        [-pull, pull * S::TWO, -pull]
    }

    fn curvature(&self) -> S {
        S::from_f64(4.0) * self.stiffness
    }

    fn stiffness(&self) -> S {
        S::from_f64(6.0) * self.stiffness
    }
}

impl<S: Scalar> XpbdBlock<S, 3, 0> for Hinge<S> {}

impl<S: Scalar> Strut<S> {
    /// Direction and length [m].
    fn axis([a, b, c, d]: &[Vec3<S>; 4]) -> (Vec3<S>, S) {
        let axis = (*a + *b - *c - *d) * S::HALF;
        let length = axis.length();
        (axis * (S::ONE / length), length)
    }

    /// `-grad C` times a number.
    fn pull(x: &[Vec3<S>; 4], by: S) -> [Vec3<S>; 4] {
        let half = Self::axis(x).0 * (by * S::HALF);
        [-half, -half, half, half]
    }

    fn residual(&self, x: &[Vec3<S>; 4]) -> S {
        Self::axis(x).1 - self.rest_length
    }
}

impl<S: Scalar> Energy<S, 4> for Strut<S> {
    fn energy(&self, x: &[Vec3<S>; 4]) -> S {
        S::HALF * self.stiffness * self.residual(x) * self.residual(x)
    }

    fn forces(&self, x: &[Vec3<S>; 4]) -> [Vec3<S>; 4] {
        Self::pull(x, self.stiffness * self.residual(x))
    }

    // Of one vertex a quarter of it.
    fn curvature(&self) -> S {
        self.stiffness
    }

    fn stiffness(&self) -> S {
        self.stiffness
    }
}

impl<S: Scalar> XpbdBlock<S, 4, 1> for Strut<S> {
    fn solve(
        &self,
        x: &[Vec3<S>; 4],
        w: &[S; 4],
        [multiplier]: &[S; 1],
        compliance: S,
    ) -> ([S; 1], [Vec3<S>; 4]) {
        let quarter = S::HALF * S::HALF;
        let weight = (w[0] + w[1] + w[2] + w[3]) * quarter;
        let change = (-self.residual(x) - compliance * *multiplier) / (weight + compliance);
        let pull = Self::pull(x, -change);
        ([change], std::array::from_fn(|i| pull[i] * w[i]))
    }

    fn loads(&self, x: &[Vec3<S>; 4], [multiplier]: &[S; 1], _: S) -> [CornerLoad<S>; 4] {
        // `d^2 C` is `(I - n n^T)/|d|` with halves before it: twice the block of one vertex covers its row.
        let mass_bound = multiplier.abs() / Self::axis(x).1;
        Self::pull(x, -*multiplier).map(|impulse| CornerLoad { impulse, mass_bound })
    }

    fn constitutive(&self, x: &[Vec3<S>; 4], compliance: S) -> [S; 1] {
        [-self.residual(x) / compliance]
    }
}
