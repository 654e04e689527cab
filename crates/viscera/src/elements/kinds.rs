//! What every kind of element answers. Tetrahedra, of which a mesh has many, answer in lanes by their law
//! ([`super::law`]) and their constraint formulation; all others, few and alike, answer here, one by one.

use super::{CornerLoad, attachment, spring};
use crate::scalar::{Real, Scalar, Vec3, vec3};

/// An element on `N` vertices that stores energy. `x` are its vertices' positions [m].
pub trait Energy<S: Scalar, const N: usize> {
    /// Energy [J].
    fn energy(&self, x: &[Vec3<S>; N]) -> S;

    /// Forces [N] on its vertices.
    fn forces(&self, x: &[Vec3<S>; N]) -> [Vec3<S>; N];

    /// Bound [N/m] of the energy's curvature by one vertex, the others at rest.
    fn curvature(&self) -> S;

    /// The largest eigenvalue [N/m] of its stiffness: of all vertices together.
    fn stiffness(&self) -> S;
}

/// An element that XPBD can solve: `M` constraints with a multiplier each. Not every kind is one.
pub trait XpbdBlock<S: Scalar, const N: usize, const M: usize>: Energy<S, N> {
    /// `a~ = 1/(k dt^2)` of each constraint; `squared = dt^2` [s^2].
    fn compliance(&self, squared: S) -> S;

    /// One solve: change of the multipliers [J s^2/m] and of the positions [m]; `w` are inverse masses [1/kg].
    fn solve(
        &self,
        x: &[Vec3<S>; N],
        w: &[S; N],
        multipliers: &[S; M],
        compliance: S,
    ) -> ([S; M], [Vec3<S>; N]);

    /// Force times squared step on each vertex, and the bound of its geometric stiffness.
    fn loads(x: &[Vec3<S>; N], multipliers: &[S; M]) -> [CornerLoad<S>; N];

    /// The multipliers at which no constraint has a residual.
    fn constitutive(&self, x: &[Vec3<S>; N], compliance: S) -> [S; M];
}

/// See [`spring`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring<S> {
    /// Length without force [m].
    pub rest_length: S,
    /// [N/m].
    pub stiffness: S,
}

impl<S: Real> Energy<S, 2> for Spring<S> {
    fn energy(&self, x: &[Vec3<S>; 2]) -> S {
        spring::energy(x, self.rest_length, self.stiffness)
    }

    fn forces(&self, x: &[Vec3<S>; 2]) -> [Vec3<S>; 2] {
        spring::forces(x, self.rest_length, self.stiffness)
    }

    fn curvature(&self) -> S {
        self.stiffness
    }

    fn stiffness(&self) -> S {
        S::TWO * self.stiffness
    }
}

impl<S: Real> XpbdBlock<S, 2, 1> for Spring<S> {
    fn compliance(&self, squared: S) -> S {
        S::ONE / (self.stiffness * squared)
    }

    fn solve(
        &self,
        x: &[Vec3<S>; 2],
        w: &[S; 2],
        [multiplier]: &[S; 1],
        compliance: S,
    ) -> ([S; 1], [Vec3<S>; 2]) {
        let (change, moves) = spring::solve(x, w, self.rest_length, *multiplier, compliance);
        ([change], moves)
    }

    fn loads(x: &[Vec3<S>; 2], [multiplier]: &[S; 1]) -> [CornerLoad<S>; 2] {
        spring::corner_loads(x, *multiplier)
    }

    fn constitutive(&self, x: &[Vec3<S>; 2], compliance: S) -> [S; 1] {
        [spring::constitutive_multiplier(x, self.rest_length, compliance)]
    }
}

/// See [`attachment`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment<S> {
    /// Where its vertex is pulled to [m].
    pub anchor: Vec3<S>,
    /// [N/m].
    pub stiffness: S,
}

impl<S: Real> Energy<S, 1> for Attachment<S> {
    fn energy(&self, &[x]: &[Vec3<S>; 1]) -> S {
        attachment::energy(x, self.anchor, self.stiffness)
    }

    fn forces(&self, &[x]: &[Vec3<S>; 1]) -> [Vec3<S>; 1] {
        [attachment::force(x, self.anchor, self.stiffness)]
    }

    fn curvature(&self) -> S {
        self.stiffness
    }

    fn stiffness(&self) -> S {
        self.stiffness
    }
}

impl<S: Real> XpbdBlock<S, 1, 3> for Attachment<S> {
    fn compliance(&self, squared: S) -> S {
        S::ONE / (self.stiffness * squared)
    }

    fn solve(
        &self,
        &[x]: &[Vec3<S>; 1],
        &[w]: &[S; 1],
        multipliers: &[S; 3],
        compliance: S,
    ) -> ([S; 3], [Vec3<S>; 1]) {
        let [a, b, c] = *multipliers;
        let l = vec3(a, b, c);
        let (change, moved) = attachment::solve(x, w, self.anchor, l, compliance);
        (change.to_array(), [moved])
    }

    fn loads(_: &[Vec3<S>; 1], &[a, b, c]: &[S; 3]) -> [CornerLoad<S>; 1] {
        [CornerLoad { impulse: vec3(a, b, c), mass_bound: S::ZERO }]
    }

    fn constitutive(&self, &[x]: &[Vec3<S>; 1], compliance: S) -> [S; 3] {
        attachment::constitutive_multipliers(x, self.anchor, compliance).to_array()
    }
}
