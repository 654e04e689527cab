//! Isotropic elastic materials, and the constants that solvers make of them.
//!
//! From Young's modulus E and Poisson ratio nu:
//!
//! ```text
//! lambda = E nu / ((1 + nu)(1 - 2 nu)),   mu = E / (2 (1 + nu))
//! ```
//!
//! **Saint Venant-Kirchhoff**, on the Green strain `E = (F^T F - I)/2`:
//! `W = mu E:E + lambda/2 tr(E)^2`. With the strain as six numbers
//! `C = (E00, E11, E22, 2 E12, 2 E02, 2 E01)` this is `W = C^T D C / 2`, and XPBD's compliance
//! per volume is `D^-1`. It has no restoring force through inversion and collapses under strong
//! compression: it is here to reproduce published work.
//!
//! **Stable neo-Hookean**, without logarithm (after Smith, de Goes and Kim, Stable Neo-Hookean Flesh
//! Simulation, 2018; constants chosen so that small strains see exactly E and nu):
//!
//! ```text
//! W = mu/2 (|F|^2 - 3) + lh/2 (J - a)^2,   J = det F,   lh = lambda + mu,   a = 1 + mu/lh
//! ```

mod presets;

pub use presets::{PRESET_CAUTION, PRESETS, Preset, UnknownPreset, preset};

use crate::scalar::{Real, Scalar};
use crate::settings::choices;
use crate::units::Dimension;

choices! {
    /// The law between strain and energy.
    pub enum MaterialModel {
        /// Linear in the Green strain; cannot see inversion.
        SaintVenantKirchhoff = "saint_venant_kirchhoff",
        /// Withstands compression and inversion; the default.
        StableNeoHookean = "stable_neo_hookean",
    }
}

/// The largest Poisson ratio: lambda is 333 times mu there. Nearer to 0.5 lambda leaves all
/// proportion, single precision loses the shear response beside it, and linear tetrahedra lock.
pub const LARGEST_POISSON: f64 = 0.499;

/// An isotropic elastic material. Its numbers are possible ones by construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    model: MaterialModel,
    /// Young's modulus [Pa].
    young: f64,
    /// Poisson ratio [-].
    poisson: f64,
    /// Density [kg/m^3].
    density: f64,
    /// Retardation time [s].
    viscosity: f64,
}

/// Constants of one material in the solver's precision.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialConstants<S> {
    /// Lame's first parameter [Pa].
    pub lame_lambda: S,
    /// Lame's second parameter, the shear modulus [Pa].
    pub lame_mu: S,
    /// Compliance `D^-1` [1/Pa].
    pub compliance: Compliance<S>,
    /// Retardation time [s] of the viscous stress; zero for none.
    pub viscosity: S,
}

impl<S: Real> MaterialConstants<S> {
    /// The same in another precision.
    pub fn cast<T: Real>(&self) -> MaterialConstants<T> {
        let of = |number: S| T::from_f64(number.to_f64());
        let Compliance { normal, cross, shear } = self.compliance;
        MaterialConstants {
            lame_lambda: of(self.lame_lambda),
            lame_mu: of(self.lame_mu),
            compliance: Compliance { normal: of(normal), cross: of(cross), shear: of(shear) },
            viscosity: of(self.viscosity),
        }
    }
}

/// Why numbers are not a material.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// Young's modulus is zero, negative, or NaN.
    #[error(
        "Young's modulus {value} Pa cannot hold a shape; it must be above 0, for example 5 kPa"
    )]
    Young {
        /// What was given [Pa].
        value: f64,
    },
    /// Poisson ratio of 0.5 and nearly so.
    #[error("Poisson ratio {value} is {}; use at most {LARGEST_POISSON}", incompressible(*value))]
    Incompressible {
        /// What was given.
        value: f64,
    },
    /// Poisson ratio of -1 or less, or NaN.
    #[error(
        "Poisson ratio {value} is unstable; it must be above -1, and about 0.45 for most tissue"
    )]
    Poisson {
        /// What was given.
        value: f64,
    },
    /// Density is zero, negative, or NaN.
    #[error("density {value} kg/m^3 has no inertia; it must be above 0, for example 1060 kg/m^3")]
    Density {
        /// What was given [kg/m^3].
        value: f64,
    },
    /// Viscosity is negative, or NaN.
    #[error("viscosity {value} s would add energy; it must be at least 0, for example 10 ms")]
    Viscosity {
        /// What was given [s].
        value: f64,
    },
    /// Each number is possible, but a constant made of them is not.
    #[error(
        "Young's modulus {young} Pa with Poisson ratio {poisson} is beyond double precision; tissue \
         has 100 Pa to 10 MPa"
    )]
    Overflow {
        /// Young's modulus [Pa].
        young: f64,
        /// Poisson ratio.
        poisson: f64,
    },
}

fn incompressible(poisson: f64) -> &'static str {
    match poisson {
        0.5 => "incompressible",
        poisson if poisson > 0.5 => "impossible (the body would swell under pressure)",
        _ => "nearly incompressible",
    }
}

/// Refuses an impossible Young's modulus [Pa].
pub fn check_young(value: f64) -> Result<(), MaterialError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(MaterialError::Young { value }) }
}

/// Refuses an impossible Poisson ratio.
pub fn check_poisson(value: f64) -> Result<(), MaterialError> {
    if value > LARGEST_POISSON {
        Err(MaterialError::Incompressible { value })
    } else if value > -1.0 {
        Ok(())
    } else {
        Err(MaterialError::Poisson { value })
    }
}

/// Refuses an impossible density [kg/m^3].
pub fn check_density(value: f64) -> Result<(), MaterialError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(MaterialError::Density { value }) }
}

/// Refuses an impossible viscosity [s].
pub fn check_viscosity(value: f64) -> Result<(), MaterialError> {
    if value >= 0.0 && value.is_finite() { Ok(()) } else { Err(MaterialError::Viscosity { value }) }
}

impl Material {
    /// A material without viscosity. `young` in Pa, `density` in kg/m^3.
    ///
    /// ```
    /// use viscera::material::{Material, MaterialModel};
    /// let error = Material::new(MaterialModel::StableNeoHookean, 5000.0, 0.5, 1060.0).unwrap_err();
    /// assert_eq!(error.to_string(), "Poisson ratio 0.5 is incompressible; use at most 0.499");
    /// ```
    pub fn new(
        model: MaterialModel,
        young: f64,
        poisson: f64,
        density: f64,
    ) -> Result<Self, MaterialError> {
        check_young(young)?;
        check_poisson(poisson)?;
        check_density(density)?;
        let material = Self { model, young, poisson, density, viscosity: 0.0 };
        let constants =
            [material.lame_lambda(), material.lame_mu(), 1.0 / young, 1.0 / material.lame_mu()];
        let nonzero = material.lame_mu() > 0.0 && material.volume_modulus() > 0.0;
        match nonzero && constants.iter().all(|constant| constant.is_finite()) {
            true => Ok(material),
            false => Err(MaterialError::Overflow { young, poisson }),
        }
    }

    /// The same material with Kelvin-Voigt viscosity: the viscous stress is `retardation` [s]
    /// times the stiffness times the strain rate.
    pub fn with_viscosity(self, retardation: f64) -> Result<Self, MaterialError> {
        check_viscosity(retardation)?;
        Ok(Self { viscosity: retardation, ..self })
    }

    /// The law between strain and energy.
    pub fn model(&self) -> MaterialModel {
        self.model
    }

    /// Young's modulus [Pa].
    pub fn young(&self) -> f64 {
        self.young
    }

    /// Poisson ratio [-].
    pub fn poisson(&self) -> f64 {
        self.poisson
    }

    /// Density [kg/m^3].
    pub fn density(&self) -> f64 {
        self.density
    }

    /// Kelvin-Voigt retardation time eta [s]; 0 without viscosity.
    pub fn viscosity(&self) -> f64 {
        self.viscosity
    }

    /// Lame's first parameter lambda [Pa].
    pub fn lame_lambda(&self) -> f64 {
        self.young * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))
    }

    /// The shear modulus mu [Pa].
    pub fn lame_mu(&self) -> f64 {
        self.young / (2.0 * (1.0 + self.poisson))
    }

    /// The stable neo-Hookean energy's `lh = lambda + mu` [Pa]. Positive for every material.
    pub fn volume_modulus(&self) -> f64 {
        // lambda + mu without cancellation at negative Poisson ratios.
        self.young / (2.0 * (1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))
    }

    /// The stable neo-Hookean energy's `a = 1 + mu/lh`: the volume ratio that its second term
    /// wants, above 1 to balance the first.
    pub fn volume_target(&self) -> f64 {
        2.0 - 2.0 * self.poisson
    }

    /// The stiffness D [Pa] of the strain `(E00, E11, E22, 2 E12, 2 E02, 2 E01)`.
    pub fn stiffness_matrix(&self) -> [[f64; 6]; 6] {
        let (lambda, mu) = (self.lame_lambda(), self.lame_mu());
        isotropic(lambda + 2.0 * mu, lambda, mu)
    }

    /// The compliance D^-1 [1/Pa], from E and nu directly: exact where inverting D would cancel.
    pub fn compliance(&self) -> Compliance<f64> {
        Compliance {
            normal: 1.0 / self.young,
            cross: -self.poisson / self.young,
            shear: 2.0 * (1.0 + self.poisson) / self.young,
        }
    }

    /// The compliance as a matrix.
    pub fn compliance_matrix(&self) -> [[f64; 6]; 6] {
        let Compliance { normal, cross, shear } = self.compliance();
        isotropic(normal, cross, shear)
    }
}

/// The compliance `D^-1` of an isotropic law [1/Pa], or a multiple of it: the numbers of the 6 x 6
/// matrix for `C = (E00, E11, E22, 2 E12, 2 E02, 2 E01)` that are not zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Compliance<S> {
    /// Of a normal strain to its own stress.
    pub normal: S,
    /// Of a normal strain to the other two normal stresses.
    pub cross: S,
    /// Of a shear.
    pub shear: S,
}

impl<S: Scalar> Compliance<S> {
    /// A multiple of it.
    #[inline(always)]
    pub fn scaled(&self, factor: S) -> Self {
        Self {
            normal: self.normal * factor,
            cross: self.cross * factor,
            shear: self.shear * factor,
        }
    }

    /// The matrix times six components.
    #[inline(always)]
    pub fn times(&self, v: &[S; 6]) -> [S; 6] {
        let common = self.cross * (v[0] + v[1] + v[2]);
        let own = self.normal - self.cross;
        [
            common + own * v[0],
            common + own * v[1],
            common + own * v[2],
            self.shear * v[3],
            self.shear * v[4],
            self.shear * v[5],
        ]
    }
}

/// The 6 x 6 matrix of an isotropic law: normal strains coupled, shears alone.
fn isotropic(normal: f64, coupling: f64, shear: f64) -> [[f64; 6]; 6] {
    let entry = |row: usize, column: usize| match (row < 3, column < 3, row == column) {
        (true, true, true) => normal,
        (true, true, false) => coupling,
        (false, false, true) => shear,
        _ => 0.0,
    };
    std::array::from_fn(|row| std::array::from_fn(|column| entry(row, column)))
}

impl std::fmt::Display for Material {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let young = Dimension::Pressure.format(self.young);
        let density = Dimension::Density.format(self.density);
        write!(formatter, "{}, E {young}, nu {}, {density}", self.model, self.poisson)?;
        match self.viscosity {
            0.0 => Ok(()),
            viscosity => write!(formatter, ", viscosity {}", Dimension::Time.format(viscosity)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn material(young: f64, poisson: f64) -> Material {
        Material::new(MaterialModel::StableNeoHookean, young, poisson, 1000.0).unwrap()
    }

    proptest! {
        /// D is conditioned like (1 + nu)/(1 - 2 nu), below 1500 at 0.499 and below 200 at -0.99
        /// for its counterpart; each entry of the product sums six rounded products.
        #[test]
        fn compliance_inverts_stiffness(young in 1.0..1e9f64, poisson in -0.99..0.499f64) {
            let material = material(young, poisson);
            let (stiffness, compliance) = (material.stiffness_matrix(), material.compliance_matrix());
            let condition = ((1.0 + poisson) / (1.0 - 2.0 * poisson)).max(3.0 / (1.0 + poisson));
            for row in 0..6 {
                for column in 0..6 {
                    let product: f64 =
                        (0..6).map(|k| stiffness[row][k] * compliance[k][column]).sum();
                    let identity = f64::from(u8::from(row == column));
                    prop_assert!((product - identity).abs() <= 32.0 * f64::EPSILON * condition);
                }
            }
        }

        /// The first derivative of W = mu/2 (3 s^2 - 3) + lh/2 (s^3 - a)^2 vanishes at s = 1.
        #[test]
        fn neo_hookean_body_rests_at_rest(young in 1.0..1e9f64, poisson in -0.99..0.499f64) {
            let material = material(young, poisson);
            let slope = material.lame_mu() + material.volume_modulus() * (1.0 - material.volume_target());
            prop_assert!(slope.abs() <= 8.0 * f64::EPSILON * material.volume_modulus().max(material.lame_mu()));
        }

        #[test]
        fn neo_hookean_constants_follow_from_lame(young in 1.0..1e9f64, poisson in 0.0..0.499f64) {
            let material = material(young, poisson);
            let lh = material.lame_lambda() + material.lame_mu();
            let a = 1.0 + material.lame_mu() / lh;
            prop_assert!((material.volume_modulus() - lh).abs() <= 8.0 * f64::EPSILON * lh);
            prop_assert!((material.volume_target() - a).abs() <= 8.0 * f64::EPSILON * a);
        }
    }

    #[test]
    fn impossible_materials_cannot_be_built() {
        let build = |young, poisson, density| {
            Material::new(MaterialModel::StableNeoHookean, young, poisson, density)
                .map_err(|error| error.to_string())
        };
        for (young, poisson, density, reason) in [
            (5000.0, 0.5, 1000.0, "Poisson ratio 0.5 is incompressible; use at most 0.499"),
            (5000.0, 0.4995, 1000.0, "nearly incompressible"),
            (5000.0, 0.6, 1000.0, "impossible"),
            (5000.0, -1.0, 1000.0, "unstable"),
            (5000.0, f64::NAN, 1000.0, "unstable"),
            (0.0, 0.4, 1000.0, "Young's modulus 0 Pa"),
            (-1.0, 0.4, 1000.0, "Young's modulus"),
            (f64::NAN, 0.4, 1000.0, "Young's modulus"),
            (f64::INFINITY, 0.4, 1000.0, "Young's modulus"),
            (5000.0, 0.4, 0.0, "density"),
            (5000.0, 0.4, f64::NAN, "density"),
            (1e-320, 0.4, 1000.0, "beyond double precision"),
            (1.7e308, 0.499, 1000.0, "beyond double precision"),
        ] {
            let message = build(young, poisson, density).unwrap_err();
            assert!(message.contains(reason), "{message}");
        }
        let soft = material(5000.0, 0.45);
        assert!(soft.with_viscosity(-1.0).is_err());
        assert_eq!(soft.with_viscosity(0.01).map(|viscous| viscous.viscosity()), Ok(0.01));
    }
}
