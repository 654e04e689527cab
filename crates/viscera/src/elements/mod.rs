//! Elements: everything that acts on tissue, each an energy with a constraint view.
//!
//! One file per kind. Each holds pure functions of positions and rest data, generic over
//! [`Scalar`]: constraint, gradient, energy, and the local solve of one
//! constraint block. They load and store nothing; the solver does.
//!
//! Kernels loop over the corners rather than `map` over arrays, and call functions that are
//! `#[inline(always)]` rather than closures: what the compiler leaves a call is not compiled for the
//! instructions that [`crate::scalar::lanes::run`] chose.
//!
//! Linear tetrahedra share this file's kinematics. With `Ds = [x1-x0, x2-x0, x3-x0]` and its rest
//! value `Dm`, the deformation gradient is `F = Ds Dm^-1 = sum_i x_i g_i^T`, where `g_1..g_3` are
//! the rows of `Dm^-1` and `g_0 = -(g_1 + g_2 + g_3)`.

pub mod attachment;
pub(crate) mod forms;
pub mod green_strain;
pub mod kinds;
pub mod law;
pub(crate) mod list;
pub mod neo_hookean;
pub mod neo_hookean_pair;
pub mod neo_hookean_stretch;
pub mod recovered;
pub mod singular_values;
pub mod spring;
pub(crate) mod text;
#[cfg(test)]
pub mod trial;
#[cfg(feature = "gpu")]
pub mod wgsl;

use crate::scalar::{Mat3, Scalar, Vec3};

/// The changes by a local solve of a tetrahedron.
#[derive(Clone, Copy, Debug)]
pub struct TetCorrection<S, const N: usize> {
    /// Change of the multipliers [J s^2], one per constraint.
    pub multipliers: [S; N],
    /// Change of the corner positions [m].
    pub positions: [Vec3<S>; 4],
}

/// The load of a constraint with its multipliers on one corner.
#[derive(Clone, Copy, Debug, Default)]
pub struct CornerLoad<S> {
    /// `grad C^T lambda` [N s^2]: the force times the squared step.
    pub impulse: Vec3<S>,
    /// Bound on the row of the geometric stiffness `sum lambda d^2 C` [kg].
    pub mass_bound: S,
}

/// How the energy of a tetrahedron is written as constraints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TetForm {
    /// Saint Venant-Kirchhoff as six components of the Green strain.
    GreenStrain,
    /// Stable neo-Hookean as volume and norm of the deformation gradient, as published.
    NeoHookeanPair,
    /// Stable neo-Hookean as six components of the stretch, exact at rest without added mass.
    NeoHookeanStretch,
}

impl TetForm {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::GreenStrain, Self::NeoHookeanPair, Self::NeoHookeanStretch];

    /// Multipliers of one tetrahedron.
    pub fn multiplier_count(self) -> usize {
        match self {
            Self::GreenStrain | Self::NeoHookeanStretch => 6,
            Self::NeoHookeanPair => 2,
        }
    }
}

/// Edge vectors from corner 0 as columns [m].
#[inline(always)]
pub fn edge_matrix<S: Scalar>(x: &[Vec3<S>; 4]) -> Mat3<S> {
    Mat3::from_columns(x[1] - x[0], x[2] - x[0], x[3] - x[0])
}

/// `F = Ds Dm^-1`.
#[inline(always)]
pub fn deformation_gradient<S: Scalar>(x: &[Vec3<S>; 4], inverse_rest_shape: &Mat3<S>) -> Mat3<S> {
    edge_matrix(x) * *inverse_rest_shape
}

/// Gradients [1/m] of the four linear shape functions.
#[inline(always)]
pub fn shape_gradients<S: Scalar>(inverse_rest_shape: &Mat3<S>) -> [Vec3<S>; 4] {
    let [g1, g2, g3] = inverse_rest_shape.transpose().columns;
    [-(g1 + g2 + g3), g1, g2, g3]
}

/// Internal forces [N] of one tetrahedron on its corners: `f_i = -V P g_i`, `P` the first Piola
/// stress [Pa].
#[inline(always)]
pub fn internal_forces<S: Scalar>(
    piola: &Mat3<S>,
    inverse_rest_shape: &Mat3<S>,
    rest_volume: S,
) -> [Vec3<S>; 4] {
    weighted_images(piola, &shape_gradients(inverse_rest_shape), &[-rest_volume; 4])
}

/// The body once for each literal, with the index as a constant: loops that compilers leave rolled
/// keep their matrices in memory instead of registers.
macro_rules! unrolled {
    ($index:ident in [$($value:literal)*] $body:block) => {
        $({
            const $index: usize = $value;
            $body
        })*
    };
}

/// A symmetric 3 x 3 matrix.
#[derive(Clone, Copy, Debug)]
struct Symmetric<S> {
    xx: S,
    yy: S,
    zz: S,
    yz: S,
    xz: S,
    xy: S,
}

/// `sum_i w_i g_i g_i^T` over the corners.
#[inline(always)]
fn weighted_products<S: Scalar>(g: &[Vec3<S>; 4], w: &[S; 4]) -> Symmetric<S> {
    let h = [g[0] * w[0], g[1] * w[1], g[2] * w[2], g[3] * w[3]];
    Symmetric {
        xx: sum_products(&h, g, 0, 0),
        yy: sum_products(&h, g, 1, 1),
        zz: sum_products(&h, g, 2, 2),
        yz: sum_products(&h, g, 1, 2),
        xz: sum_products(&h, g, 0, 2),
        xy: sum_products(&h, g, 0, 1),
    }
}

#[inline(always)]
fn sum_products<S: Scalar>(h: &[Vec3<S>; 4], g: &[Vec3<S>; 4], a: usize, b: usize) -> S {
    (h[0][a] * g[0][b] + h[1][a] * g[1][b]) + (h[2][a] * g[2][b] + h[3][a] * g[3][b])
}

/// `w_i P g_i` for each corner; as `g_0 = -(g_1 + g_2 + g_3)`, the first is the sum of the
/// others turned round.
#[inline(always)]
fn weighted_images<S: Scalar>(p: &Mat3<S>, g: &[Vec3<S>; 4], w: &[S; 4]) -> [Vec3<S>; 4] {
    let (a, b, c) = (*p * g[1], *p * g[2], *p * g[3]);
    [(a + b + c) * -w[0], a * w[1], b * w[2], c * w[3]]
}

/// Solves `A x = b` for a symmetric positive definite matrix given by its lower triangle:
/// `A = L D L^T`, no square roots and no branches. `L` takes the place of the upper triangle.
#[inline(always)]
fn solve_symmetric<S: Scalar>(mut a: [[S; 6]; 6], mut b: [S; 6]) -> [S; 6] {
    let mut inverse_pivot = [S::ZERO; 6];
    unrolled!(J in [0 1 2 3 4 5] {
        inverse_pivot[J] = S::ONE / a[J][J];
        unrolled!(I in [1 2 3 4 5] {
            if I > J {
                a[J][I] = a[I][J] * inverse_pivot[J];
                unrolled!(K in [1 2 3 4 5] {
                    if K > J && K <= I {
                        let product = a[J][K] * a[I][J];
                        a[I][K] -= product;
                    }
                });
                let product = a[J][I] * b[J];
                b[I] -= product;
            }
        });
    });
    unrolled!(FROM_LAST in [0 1 2 3 4 5] {
        const I: usize = 5 - FROM_LAST;
        b[I] *= inverse_pivot[I];
        unrolled!(K in [1 2 3 4 5] {
            if K > I {
                let product = a[I][K] * b[K];
                b[I] -= product;
            }
        });
    });
    b
}
