//! The traits of every kind of element; the list of kinds stands in `list.rs` beside this file. Tetrahedra, of which a
//! mesh has many, answer in lanes by their law ([`super::law`]) and their constraint formulation; all others, few and
//! alike, answer here, one by one. Each kind has a file of its own, beside its twin for graphics processors.

use super::CornerLoad;
use crate::scalar::{Mat3, Real, Scalar, Vec3};

/// Constants of an element, at most: those that it does not use are zero.
pub const CONSTANTS: usize = 4;

/// Vertices of an element, and multipliers, at most.
pub const MOST: usize = 4;

/// A constant of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Constant {
    /// Its name, with its unit.
    pub name: &'static str,
    /// The values it may have.
    pub legal: Legal,
}

/// The values that a constant may have, beside finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Legal {
    /// Above zero.
    Positive,
    /// Zero or more.
    NotNegative,
    /// Any number.
    Any,
}

/// Data that an element may depend on beside its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment<T, const N: usize> {
    /// Its anchor at the end of the step [m], of kinds that have one.
    pub anchor: Vec3<T>,
    /// Its vertices at the start of the step [m]; `None` in no step, where nothing has moved.
    pub start: Option<[Vec3<T>; N]>,
    /// The step [s]; zero in no step.
    pub dt: T,
}

/// Implemented by the list of kinds for those that stand there, and by nobody else.
pub trait Listed: sealed::Sealed {
    /// The place in the list.
    const NUMBER: usize;
}

pub(super) mod sealed {
    /// Only this module's parent can name it.
    pub trait Sealed {}
}

/// A kind of element: `N` vertices, `M` multipliers.
pub trait Kind<const N: usize, const M: usize>: Listed + Send + Sync + 'static {
    /// One of them, in the caller's precision.
    type Element<T: Real>: XpbdBlock<T, N, M>;

    /// Its name in messages.
    const NAME: &'static str;

    /// Whether one has an anchor, which moves with the inputs of a step.
    const IS_ANCHORED: bool;

    /// Its constants, in the order in which [`Kind::element`] gets them.
    const CONSTANTS: &'static [Constant];

    /// Its functions for graphics processors, with the name of the kind's field before them.
    const WGSL: &'static str;

    /// From constants, and what is so in a step.
    fn element<T: Real>(constants: [T; CONSTANTS], moment: &Moment<T, N>) -> Self::Element<T>;
}

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

    /// Change of the energy [J] as the vertices move by `d` [m]. Where no kind has a better way this is a difference,
    /// good to the round-off of the energy: ask in double precision.
    fn energy_change(&self, x: &[Vec3<S>; N], d: &[Vec3<S>; N]) -> S {
        let mut moved = *x;
        for i in 0..N {
            moved[i] += d[i];
        }
        self.energy(&moved) - self.energy(x)
    }

    /// Second derivative [N/m] of the energy by the vertices of row and column, or a positive semidefinite
    /// approximation of it. Without a better one: [`Energy::curvature`] in every direction of each vertex by itself.
    fn blocks(&self, _x: &[Vec3<S>; N]) -> [[Mat3<S>; N]; N] {
        let mut blocks = [[Mat3::ZERO; N]; N];
        for i in 0..N {
            blocks[i][i] = Mat3::IDENTITY * self.curvature();
        }
        blocks
    }
}

/// An element that XPBD can solve: `M` constraints with a multiplier each. A kind that is none has no multipliers
/// and no functions here: its forces act between sweeps, in the rebase. Without the rebase (`rebase = false`) they do
/// not act in XPBD.
pub trait XpbdBlock<S: Scalar, const N: usize, const M: usize>: Energy<S, N> {
    /// `a~ = 1/(k dt^2)` of each constraint; `squared = dt^2` [s^2].
    fn compliance(&self, squared: S) -> S {
        S::ONE / (self.curvature() * squared)
    }

    /// One solve: change of the multipliers [J s^2/m] and of the positions [m]; `w` are inverse masses [1/kg].
    fn solve(
        &self,
        _x: &[Vec3<S>; N],
        _w: &[S; N],
        _multipliers: &[S; M],
        _compliance: S,
    ) -> ([S; M], [Vec3<S>; N]) {
        ([S::ZERO; M], [Vec3::splat(S::ZERO); N])
    }

    /// Force times squared step on each vertex, and the bound of its geometric stiffness.
    fn loads(&self, x: &[Vec3<S>; N], _multipliers: &[S; M], squared: S) -> [CornerLoad<S>; N] {
        let mass_bound = self.curvature() * squared;
        self.forces(x).map(|force| CornerLoad { impulse: force * squared, mass_bound })
    }

    /// The multipliers at which no constraint has a residual.
    fn constitutive(&self, _x: &[Vec3<S>; N], _compliance: S) -> [S; M] {
        [S::ZERO; M]
    }
}
