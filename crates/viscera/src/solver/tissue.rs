//! What a tetrahedron's tissue answers to a deformation: both laws, and viscosity.

use crate::elements::green_strain::{self, Voigt};
use crate::elements::neo_hookean;
use crate::material::MaterialModel;
use crate::model::MaterialConstants;
use crate::scalar::{Mat3, Scalar, Vec3};

/// Twin of the functions of [`Tissue`]; needs those of the Green strain and of neo-Hookean tissue.
#[cfg(feature = "gpu")]
pub const TISSUE_WGSL: &str = include_str!("tissue.wgsl");

/// The constants of a tetrahedron's tissue for one step.
pub struct Tissue<S> {
    /// Its law.
    pub model: MaterialModel,
    /// [Pa].
    pub lame_lambda: S,
    /// [Pa].
    pub lame_mu: S,
    /// Retardation time over the step.
    pub viscosity_rate: S,
}

/// What a tetrahedron answers to a deformation.
pub struct Response<S> {
    /// Elastic energy density [Pa].
    pub elastic_energy: S,
    /// Density [Pa] of the viscous part of the potential.
    pub viscous_energy: S,
    /// First Piola stress [Pa], viscosity included.
    pub piola: Mat3<S>,
}

impl<S: Scalar> Tissue<S> {
    /// Of one material; `dt` is the step [s].
    #[inline(always)]
    pub fn new(model: MaterialModel, material: &MaterialConstants<S>, dt: f64) -> Self {
        Self {
            model,
            lame_lambda: material.lame_lambda,
            lame_mu: material.lame_mu,
            viscosity_rate: material.viscosity * S::from_f64(1.0 / dt),
        }
    }

    /// Elastic energy density [Pa].
    #[inline(always)]
    fn elastic_energy(&self, f: &Mat3<S>) -> S {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        match self.model {
            MaterialModel::SaintVenantKirchhoff => {
                green_strain::energy_density(&green_strain::strain(f), lambda, mu)
            }
            MaterialModel::StableNeoHookean => neo_hookean::energy_density(f, lambda, mu),
        }
    }

    /// Density [Pa] of the viscous part of the potential.
    #[inline(always)]
    fn viscous_energy(&self, change: &Voigt<S>) -> S {
        self.viscosity_rate * green_strain::energy_density(change, self.lame_lambda, self.lame_mu)
    }

    /// Energies and stress; `start` is the Green strain at the start of the step, where the tissue
    /// is viscous.
    #[inline(always)]
    pub fn respond(&self, f: &Mat3<S>, start: Option<&Voigt<S>>) -> Response<S> {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        let piola = match self.model {
            MaterialModel::SaintVenantKirchhoff => {
                green_strain::piola(f, &green_strain::strain(f), lambda, mu)
            }
            MaterialModel::StableNeoHookean => neo_hookean::piola(f, lambda, mu),
        };
        let elastic_energy = self.elastic_energy(f);
        let mut response = Response { elastic_energy, viscous_energy: S::ZERO, piola };
        if let Some(start) = start {
            let change = change_since(f, start);
            response.viscous_energy = self.viscous_energy(&change);
            let viscous = green_strain::piola(f, &change, lambda, mu);
            response.piola = response.piola + viscous * self.viscosity_rate;
        }
        response
    }

    /// Bound [Pa] of the curvature of the energy density by one corner, for the corner's shape
    /// gradient `g`: the vertex's diagonal block without its negative part.
    #[inline(always)]
    pub fn curvature(&self, f: &Mat3<S>, g: Vec3<S>) -> S {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        let stretch = (lambda + S::TWO * mu) * f.norm_squared() * g.length_squared();
        let elastic = match self.model {
            MaterialModel::SaintVenantKirchhoff => {
                let strain = green_strain::strain(f);
                let pressure = lambda * (strain[0] + strain[1] + strain[2]);
                let [a, b, c, yz, xz, xy] = strain;
                let tensor = [a, b, c, S::HALF * yz, S::HALF * xz, S::HALF * xy];
                let along = g.dot(green_strain::symmetric(&tensor) * g);
                stretch + (S::TWO * mu * along + pressure * g.length_squared()).max(S::ZERO)
            }
            MaterialModel::StableNeoHookean => {
                let volume = (f.cofactor() * g).length_squared();
                mu * g.length_squared() + (lambda + mu) * volume
            }
        };
        elastic + self.viscosity_rate * stretch
    }
}

/// Change of the Green strain since the start of the step.
#[inline(always)]
fn change_since<S: Scalar>(f: &Mat3<S>, start: &Voigt<S>) -> Voigt<S> {
    let mut change = green_strain::strain(f);
    for p in 0..6 {
        change[p] -= start[p];
    }
    change
}
