//! The laws of tissue: what every law answers, and the only list of them.

use super::TetForm;
use super::green_strain;
use super::neo_hookean;
use super::text::kernel_text;
use crate::material::MaterialModel;
use crate::scalar::{Mat3, Scalar, Vec3};
use crate::settings::{Choice, NeoHookean, SolverSettings};

/// A law between the deformation gradient `F` and energy; `lambda` and `mu` are Lame's parameters [Pa].
pub trait Law: Copy + Send + Sync {
    /// Its name in settings.
    const MODEL: MaterialModel;

    /// Its functions for graphics processors, with its name in settings before them.
    const WGSL: &'static str;

    /// Energy density [Pa].
    fn energy_density<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> S;

    /// First Piola stress [Pa].
    fn piola<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> Mat3<S>;

    /// Bound [Pa/m^2] of the curvature of the energy density by one corner, for the corner's shape gradient
    /// `g` [1/m]: the vertex's diagonal block without its negative part.
    fn curvature<S: Scalar>(f: &Mat3<S>, g: Vec3<S>, lambda: S, mu: S) -> S;

    /// `W(F + D) - W(F)` [Pa] without the cancellation of a difference: its round-off is that of its terms, which
    /// vanish with `d`.
    fn energy_change<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lambda: S, mu: S) -> S;

    /// Second derivative `D : d2W/dF2 : D` [Pa] of the energy density along `d`: exact, and a positive semidefinite
    /// one that drops what may be negative.
    fn curvature_along<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lambda: S, mu: S) -> [S; 2];

    /// Bound [Pa] of the second derivative, `D : d2W/dF2 : D <= bound |D|^2` for every `D`: never negative, inside out
    /// neither.
    fn stiffness<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> S;

    /// `A` of the largest part of the second derivative by a corner with the shape gradient `g`:
    /// `lambda (A g) (A g)^T`. A rotation where nothing is stretched.
    fn gradient_map<S: Scalar>(f: &Mat3<S>) -> Mat3<S>;
}

/// How many laws there are.
pub const LAWS: usize = <MaterialModel as Choice>::ALL.len();

/// All of them, each at the place of its number.
pub const ALL_LAWS: [MaterialModel; LAWS] = {
    let mut all = [MaterialModel::SaintVenantKirchhoff; LAWS];
    let mut i = 0;
    while i < LAWS {
        all[i] = <MaterialModel as Choice>::ALL[i].0;
        i += 1;
    }
    all
};

/// See [`green_strain`].
#[derive(Clone, Copy, Debug)]
pub struct SaintVenantKirchhoff;

/// See [`neo_hookean`].
#[derive(Clone, Copy, Debug)]
pub struct StableNeoHookean;

/// Evaluates an expression with `$law` as the type that belongs to a [`MaterialModel`]: the only list of laws.
macro_rules! with_law {
    ($model:expr, $law:ident => $result:expr) => {
        match $model {
            $crate::material::MaterialModel::SaintVenantKirchhoff => {
                type $law = $crate::elements::law::SaintVenantKirchhoff;
                $result
            }
            $crate::material::MaterialModel::StableNeoHookean => {
                type $law = $crate::elements::law::StableNeoHookean;
                $result
            }
        }
    };
}
pub(crate) use with_law;

/// The constraint formulation in which XPBD solves a law. The stretch is made for the rebase; XPBD as published
/// has the pair.
pub fn law_form(law: MaterialModel, settings: &SolverSettings) -> TetForm {
    match (law, settings.neo_hookean, settings.rebase) {
        (MaterialModel::SaintVenantKirchhoff, ..) => TetForm::GreenStrain,
        (_, NeoHookean::Pair, _) | (_, NeoHookean::Auto, false) => TetForm::NeoHookeanPair,
        (_, NeoHookean::Stretch, _) | (_, NeoHookean::Auto, true) => TetForm::NeoHookeanStretch,
    }
}

/// Stretching of a line along `g`, of the Green strain: `(lambda + 2 mu) |F|^2 |g|^2`, a bound of its own.
#[inline(always)]
pub fn stretch_curvature<S: Scalar>(f: &Mat3<S>, g: Vec3<S>, lambda: S, mu: S) -> S {
    (lambda + S::TWO * mu) * f.norm_squared() * g.length_squared()
}

impl Law for SaintVenantKirchhoff {
    const MODEL: MaterialModel = MaterialModel::SaintVenantKirchhoff;

    const WGSL: &'static str = kernel_text!("green_strain.wgsl");

    #[inline(always)]
    fn energy_density<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> S {
        green_strain::energy_density(&green_strain::strain(f), lambda, mu)
    }

    #[inline(always)]
    fn piola<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> Mat3<S> {
        green_strain::piola(f, &green_strain::strain(f), lambda, mu)
    }

    #[inline(always)]
    fn curvature<S: Scalar>(f: &Mat3<S>, g: Vec3<S>, lambda: S, mu: S) -> S {
        let strain = green_strain::strain(f);
        let pressure = lambda * (strain[0] + strain[1] + strain[2]);
        let [a, b, c, yz, xz, xy] = strain;
        let tensor = [a, b, c, S::HALF * yz, S::HALF * xz, S::HALF * xy];
        let along = g.dot(green_strain::symmetric(&tensor) * g);
        stretch_curvature(f, g, lambda, mu)
            + (S::TWO * mu * along + pressure * g.length_squared()).max(S::ZERO)
    }

    #[inline(always)]
    fn energy_change<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lambda: S, mu: S) -> S {
        let (strain, change) = (green_strain::strain(f), green_strain::strain_change(f, d));
        green_strain::energy_density_change(&strain, &change, lambda, mu)
    }

    #[inline(always)]
    fn curvature_along<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lambda: S, mu: S) -> [S; 2] {
        green_strain::curvature_along(f, d, &green_strain::strain(f), lambda, mu)
    }

    /// `lambda |F|^2 + 2 mu |C| + |lambda tr E| + 2 mu |E|`, `C = F^T F`: of the stress by strain, and of the stress itself.
    #[inline(always)]
    fn stiffness<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> S {
        let [a, b, c, yz, xz, xy] = green_strain::strain(f);
        let shears = S::HALF * (yz * yz + xz * xz + xy * xy);
        let norm = |x: S, y: S, z: S, shears: S| (x * x + y * y + z * z + shears).sqrt();
        let [x, y, z] = [a, b, c].map(|strain| S::TWO * strain + S::ONE);
        let c_norm = norm(x, y, z, S::TWO * S::TWO * shears);
        let pressure = lambda * (a + b + c);
        let of_stress = pressure.abs() + S::TWO * mu * norm(a, b, c, shears);
        lambda * f.norm_squared() + S::TWO * mu * c_norm + of_stress
    }

    /// Of the derivative of `tr E`: `F`.
    #[inline(always)]
    fn gradient_map<S: Scalar>(f: &Mat3<S>) -> Mat3<S> {
        *f
    }
}

impl Law for StableNeoHookean {
    const MODEL: MaterialModel = MaterialModel::StableNeoHookean;

    const WGSL: &'static str = kernel_text!("neo_hookean.wgsl");

    #[inline(always)]
    fn energy_density<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> S {
        neo_hookean::energy_density(f, lambda, mu)
    }

    #[inline(always)]
    fn piola<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> Mat3<S> {
        neo_hookean::piola(f, lambda, mu)
    }

    #[inline(always)]
    fn curvature<S: Scalar>(f: &Mat3<S>, g: Vec3<S>, lambda: S, mu: S) -> S {
        let volume = (f.cofactor() * g).length_squared();
        mu * g.length_squared() + (lambda + mu) * volume
    }

    #[inline(always)]
    fn energy_change<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lambda: S, mu: S) -> S {
        neo_hookean::energy_change(f, d, lambda, mu)
    }

    #[inline(always)]
    fn curvature_along<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>, lambda: S, mu: S) -> [S; 2] {
        neo_hookean::curvature_along(f, d, lambda, mu)
    }

    /// `mu + lh |cof F|^2 + |lh (J - 1) - mu| 2/sqrt 3 |F|`: of shape, of volume, and of the curvature of the volume, whose
    /// eigenvalues `e` solve `e^3 - |F|^2 e = 2 J` or are stretches.
    #[inline(always)]
    fn stiffness<S: Scalar>(f: &Mat3<S>, lambda: S, mu: S) -> S {
        let pressure = (lambda + mu) * neo_hookean::volume_change(f) - mu;
        let bent = S::from_f64(4.0 / 3.0) * f.norm_squared();
        mu + (lambda + mu) * f.cofactor().norm_squared() + pressure.abs() * bent.sqrt()
    }

    /// Of the derivative of `det F`: its cofactors.
    #[inline(always)]
    fn gradient_map<S: Scalar>(f: &Mat3<S>) -> Mat3<S> {
        f.cofactor()
    }
}

/// Energy density [Pa] and first Piola stress [Pa] of a law that is known at run time only.
pub fn respond<S: Scalar>(model: MaterialModel, f: &Mat3<S>, lambda: S, mu: S) -> (S, Mat3<S>) {
    with_law!(model, L => (L::energy_density(f, lambda, mu), L::piola(f, lambda, mu)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    /// The list has every law, under its own name.
    #[test]
    fn every_law_is_on_the_list_under_its_name() {
        for (model, ..) in MaterialModel::ALL {
            assert_eq!(with_law!(model, L => L::MODEL), *model);
        }
    }

    /// Along a move `u` of one corner: `D = u g^T`. The second derivative of the neo-Hookean density is then
    /// `mu |u|^2 |g|^2 + (lambda + mu) (A g . u)^2` for any `F`; that of the Green strain's, without `mu` and where
    /// `tr E` is zero, `lambda (A g . u)^2`.
    #[test]
    fn the_gradient_map_is_that_of_the_second_derivative() {
        let (lambda, mu) = (7.0, 2.0);
        for seed in 0..50 {
            let number = |k: usize| libm::sin((seed * 17 + k) as f64 * 12.9898);
            let vector = |k: usize| vec3(number(k), number(k + 1), number(k + 2));
            let f = Mat3::from_columns(vector(0), vector(3), vector(6));
            let (u, g) = (vector(9), vector(12));
            let d = Mat3::outer(u, g);
            let along = (StableNeoHookean::gradient_map(&f) * g).dot(u);
            let expected =
                mu * u.length_squared() * g.length_squared() + (lambda + mu) * along * along;
            let [exact, _] = StableNeoHookean::curvature_along(&f, &d, lambda, mu);
            assert!((exact - expected).abs() < 1e-12 * (1.0 + expected), "{exact} {expected}");
            let f = f * (3.0 / f.norm_squared()).sqrt();
            let along = (SaintVenantKirchhoff::gradient_map(&f) * g).dot(u);
            let [exact, _] = SaintVenantKirchhoff::curvature_along(&f, &d, lambda, 0.0);
            let expected = lambda * along * along;
            assert!((exact - expected).abs() < 1e-12 * (1.0 + expected), "{exact} {expected}");
        }
    }
}
