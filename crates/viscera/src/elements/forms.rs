//! The ways in which a tetrahedron's energy is written as constraints, behind one trait.

use super::{CornerLoad, TetCorrection, deformation_gradient};
use super::{green_strain, neo_hookean_pair, neo_hookean_stretch};
use crate::material::MaterialConstants;
use crate::scalar::{Mat3, Scalar, Vec3};

/// `N` constraints of a tetrahedron.
pub trait Form<const N: usize>: Sync {
    /// One block solve; `step_volume = V dt^2` [m^3 s^2].
    fn solve<L: Scalar>(
        x: &[Vec3<L>; 4],
        w: &[L; 4],
        shape: &Mat3<L>,
        multipliers: &[L; N],
        material: &MaterialConstants<L>,
        step_volume: L,
    ) -> TetCorrection<L, N>;

    /// Force times squared step on each corner, and the bound of its geometric stiffness.
    fn corner_loads<L: Scalar>(
        x: &[Vec3<L>; 4],
        shape: &Mat3<L>,
        multipliers: &[L; N],
    ) -> [CornerLoad<L>; 4];

    /// The multipliers at which no constraint has a residual.
    fn constitutive<L: Scalar>(
        x: &[Vec3<L>; 4],
        shape: &Mat3<L>,
        material: &MaterialConstants<L>,
        step_volume: L,
    ) -> [L; N];

    /// Diagonal of `a~`.
    fn compliances<L: Scalar>(material: &MaterialConstants<L>, step_volume: L) -> [L; N];
}

/// See [`green_strain`].
pub struct GreenStrain;

/// See [`neo_hookean_pair`].
pub struct NeoHookeanPair;

/// See [`neo_hookean_stretch`].
pub struct NeoHookeanStretch;

/// Evaluates an expression with `$form` as the type that belongs to a [`crate::elements::TetForm`].
macro_rules! with_form {
    ($chosen:expr, $form:ident => $result:expr) => {
        match $chosen {
            $crate::elements::TetForm::GreenStrain => {
                type $form = $crate::elements::forms::GreenStrain;
                $result
            }
            $crate::elements::TetForm::NeoHookeanPair => {
                type $form = $crate::elements::forms::NeoHookeanPair;
                $result
            }
            $crate::elements::TetForm::NeoHookeanStretch => {
                type $form = $crate::elements::forms::NeoHookeanStretch;
                $result
            }
        }
    };
}
pub(crate) use with_form;

/// Makes a type with the form as its last parameter a pass, by its method for any form.
macro_rules! pass_by_form {
    ($pass:ident $method:ident) => {
        pass_by_form!(@ $pass $method GreenStrain 6);
        pass_by_form!(@ $pass $method NeoHookeanPair 2);
        pass_by_form!(@ $pass $method NeoHookeanStretch 6);
    };
    (@ $pass:ident $method:ident $form:ident $count:literal) => {
        impl<S: Real> TetPass<S> for $pass<'_, S, $crate::elements::forms::$form> {
            #[inline(always)]
            fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
                self.$method::<L, $count>(tets);
            }
        }
    };
}
pub(crate) use pass_by_form;

/// `diag D^-1/(V dt^2)`, of both forms with six components.
#[inline(always)]
fn six_compliances<L: Scalar>(material: &MaterialConstants<L>, step_volume: L) -> [L; 6] {
    let scaled = material.compliance.scaled(L::ONE / step_volume);
    let (n, s) = (scaled.normal, scaled.shear);
    [n, n, n, s, s, s]
}

impl Form<6> for GreenStrain {
    #[inline(always)]
    fn solve<L: Scalar>(
        x: &[Vec3<L>; 4],
        w: &[L; 4],
        shape: &Mat3<L>,
        multipliers: &[L; 6],
        material: &MaterialConstants<L>,
        step_volume: L,
    ) -> TetCorrection<L, 6> {
        let compliance = material.compliance.scaled(L::ONE / step_volume);
        green_strain::solve(x, w, shape, multipliers, None, &compliance)
    }

    #[inline(always)]
    fn corner_loads<L: Scalar>(
        x: &[Vec3<L>; 4],
        shape: &Mat3<L>,
        multipliers: &[L; 6],
    ) -> [CornerLoad<L>; 4] {
        green_strain::corner_loads(x, shape, multipliers)
    }

    #[inline(always)]
    fn constitutive<L: Scalar>(
        x: &[Vec3<L>; 4],
        shape: &Mat3<L>,
        material: &MaterialConstants<L>,
        step_volume: L,
    ) -> [L; 6] {
        let strain = green_strain::strain(&deformation_gradient(x, shape));
        let (lambda, mu) = (material.lame_lambda, material.lame_mu);
        green_strain::constitutive_multipliers(&strain, lambda, mu, step_volume)
    }

    #[inline(always)]
    fn compliances<L: Scalar>(material: &MaterialConstants<L>, step_volume: L) -> [L; 6] {
        six_compliances(material, step_volume)
    }
}

macro_rules! neo_hookean_form {
    ($form:ident $module:ident $count:literal $compliances:expr) => {
        impl Form<$count> for $form {
            #[inline(always)]
            fn solve<L: Scalar>(
                x: &[Vec3<L>; 4],
                w: &[L; 4],
                shape: &Mat3<L>,
                multipliers: &[L; $count],
                material: &MaterialConstants<L>,
                step_volume: L,
            ) -> TetCorrection<L, $count> {
                let (lambda, mu) = (material.lame_lambda, material.lame_mu);
                $module::solve(x, w, shape, multipliers, lambda, mu, step_volume)
            }

            #[inline(always)]
            fn corner_loads<L: Scalar>(
                x: &[Vec3<L>; 4],
                shape: &Mat3<L>,
                multipliers: &[L; $count],
            ) -> [CornerLoad<L>; 4] {
                $module::corner_loads(x, shape, multipliers)
            }

            #[inline(always)]
            fn constitutive<L: Scalar>(
                x: &[Vec3<L>; 4],
                shape: &Mat3<L>,
                material: &MaterialConstants<L>,
                step_volume: L,
            ) -> [L; $count] {
                let f = deformation_gradient(x, shape);
                let (lambda, mu) = (material.lame_lambda, material.lame_mu);
                $module::constitutive_multipliers(&f, lambda, mu, step_volume)
            }

            #[inline(always)]
            fn compliances<L: Scalar>(
                material: &MaterialConstants<L>,
                step_volume: L,
            ) -> [L; $count] {
                $compliances(material, step_volume)
            }
        }
    };
}
neo_hookean_form!(NeoHookeanPair neo_hookean_pair 2 pair_compliances);
neo_hookean_form!(NeoHookeanStretch neo_hookean_stretch 6 six_compliances);

/// `1/(lh V dt^2)` and `1/(mu V dt^2)`.
#[inline(always)]
fn pair_compliances<L: Scalar>(material: &MaterialConstants<L>, step_volume: L) -> [L; 2] {
    let volume = (material.lame_lambda + material.lame_mu) * step_volume;
    [L::ONE / volume, L::ONE / (material.lame_mu * step_volume)]
}
