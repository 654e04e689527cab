//! The response of a tetrahedron's tissue to a deformation: its law, and viscosity.

use crate::elements::green_strain::{self, Voigt};
#[cfg(any(test, feature = "gpu"))]
use crate::elements::law::with_law;
use crate::elements::law::{Law, stretch_curvature};
#[cfg(feature = "gpu")]
use crate::elements::text::kernel_text;
use crate::material::MaterialConstants;
use crate::material::MaterialModel;
use crate::scalar::{Mat3, Scalar, Vec3};

/// Twin of the functions of [`Tissue`]; needs those of the Green strain and of all laws.
#[cfg(feature = "gpu")]
pub const TISSUE_WGSL: &str = kernel_text!("tissue_viscous.wgsl", "tissue.wgsl");

/// Its viscous part, which needs no law.
#[cfg(feature = "gpu")]
pub const VISCOUS_WGSL: &str = kernel_text!("tissue_viscous.wgsl");

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

/// The response of a tetrahedron to a deformation.
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

    /// Density [Pa] of the viscous part of the potential.
    #[inline(always)]
    fn viscous_energy(&self, change: &Voigt<S>) -> S {
        self.viscosity_rate * green_strain::energy_density(change, self.lame_lambda, self.lame_mu)
    }

    /// As [`Tissue::respond_by`], by a law that is known at run time only.
    #[cfg(any(test, feature = "gpu"))]
    pub fn respond(&self, f: &Mat3<S>, start: Option<&Voigt<S>>) -> Response<S> {
        with_law!(self.model, L => self.respond_by::<L>(f, start))
    }

    /// Energies and stress, by a law that is known when this is compiled; `start` is the Green strain at the start of the
    /// step, where the tissue is viscous.
    #[inline(always)]
    pub fn respond_by<L: Law>(&self, f: &Mat3<S>, start: Option<&Voigt<S>>) -> Response<S> {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        let piola = L::piola(f, lambda, mu);
        let elastic_energy = L::energy_density(f, lambda, mu);
        let mut response = Response { elastic_energy, viscous_energy: S::ZERO, piola };
        if let Some(start) = start {
            let change = change_since(f, start);
            response.viscous_energy = self.viscous_energy(&change);
            let viscous = green_strain::piola(f, &change, lambda, mu);
            response.piola = response.piola + viscous * self.viscosity_rate;
        }
        response
    }

    /// Bound [Pa] of the curvature of the energy density by one corner, viscosity included, for the corner's
    /// shape gradient `g`: the vertex's diagonal block without its negative part.
    #[cfg(any(test, feature = "gpu"))]
    pub fn curvature(&self, f: &Mat3<S>, g: Vec3<S>) -> S {
        with_law!(self.model, L => self.curvature_of::<L>(f, g))
    }

    /// As [`Tissue::curvature`], of a law that is known when this is compiled.
    #[inline(always)]
    pub fn curvature_of<L: Law>(&self, f: &Mat3<S>, g: Vec3<S>) -> S {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        L::curvature(f, g, lambda, mu) + self.viscosity_rate * stretch_curvature(f, g, lambda, mu)
    }

    /// Change [Pa] of the elastic and the viscous density from `F` to `F + D`, by a law that is known when this is
    /// compiled; see [`Law::energy_change`]. `start` is the Green strain at the start of the step, where the tissue is
    /// viscous.
    #[inline(always)]
    pub fn energy_change_of<L: Law>(
        &self,
        f: &Mat3<S>,
        d: &Mat3<S>,
        start: Option<&Voigt<S>>,
    ) -> S {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        let mut energy = L::energy_change(f, d, lambda, mu);
        if let Some(start) = start {
            let (before, change) = (change_since(f, start), green_strain::strain_change(f, d));
            let viscous = green_strain::energy_density_change(&before, &change, lambda, mu);
            energy += self.viscosity_rate * viscous;
        }
        energy
    }

    /// Second derivative [Pa] of the elastic and the viscous density along `d`: exact, and a positive semidefinite
    /// one; see [`Law::curvature_along`]. `start` as in [`Tissue::energy_change_of`].
    #[inline(always)]
    pub fn curvature_along_of<L: Law>(
        &self,
        f: &Mat3<S>,
        d: &Mat3<S>,
        start: Option<&Voigt<S>>,
    ) -> [S; 2] {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        let [mut exact, mut bound] = L::curvature_along(f, d, lambda, mu);
        if let Some(start) = start {
            let change = change_since(f, start);
            let viscous = green_strain::curvature_along(f, d, &change, lambda, mu);
            exact += self.viscosity_rate * viscous[0];
            bound += self.viscosity_rate * viscous[1];
        }
        [exact, bound]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    const LAME: [f64; 2] = [3e4, 4e3];

    fn tissue(model: MaterialModel) -> Tissue<f64> {
        Tissue { model, lame_lambda: LAME[0], lame_mu: LAME[1], viscosity_rate: 0.0 }
    }

    /// Second derivative [Pa] of the energy density along `F + t d g^T`, by differences of the stress.
    fn second_derivative(tissue: &Tissue<f64>, f: &Mat3<f64>, g: Vec3<f64>, d: Vec3<f64>) -> f64 {
        let t = 1e-5 / g.length();
        let slope = |t: f64| {
            let moved = *f + Mat3::outer(d * t, g);
            d.dot(tissue.respond(&moved, None).piola * g)
        };
        (slope(t) - slope(-t)) / (2.0 * t)
    }

    fn diagonal(x: f64, y: f64, z: f64) -> Mat3<f64> {
        Mat3::from_columns(vec3(x, 0.0, 0.0), vec3(0.0, y, 0.0), vec3(0.0, 0.0, z))
    }

    /// Both laws, any deformation, any direction. Differences of a polynomial are good to 1e-8 of its
    /// largest terms here.
    #[test]
    fn curvature_bounds_the_second_derivative_of_one_corner() {
        let wave = |k: usize| (1.7 * k as f64 + 0.3 * (k * k % 17) as f64).sin();
        for model in [MaterialModel::SaintVenantKirchhoff, MaterialModel::StableNeoHookean] {
            let tissue = tissue(model);
            let mut tightest = f64::INFINITY;
            for sample in 0..400 {
                let vector = |k: usize| {
                    let k = 31 * sample + 3 * k;
                    vec3(wave(k), wave(k + 1), wave(k + 2))
                };
                // Up to threefold stretched, torn, or turned inside out.
                let f = Mat3::from_columns(vector(0) * 3.0, vector(1) * 3.0, vector(2) * 3.0);
                let (g, d) = (vector(3) * 100.0, vector(4));
                let d = d * (1.0 / d.length());
                let bound = tissue.curvature(&f, g);
                let exact = second_derivative(&tissue, &f, g, d);
                assert!(exact <= bound * (1.0 + 1e-8), "{model:?}: {exact:e} above {bound:e}");
                tightest = tightest.min(bound / exact.max(f64::MIN_POSITIVE));
            }
            println!("{model:?}: the bound is at least {tightest:.2} times the derivative");
        }
    }

    /// A fibre of Saint Venant-Kirchhoff tissue, its cross-section collapsed, stretched by `s` along `g`:
    /// `W'' = (lambda + 2 mu) s^2 |g|^2 + S_gg |g|^2` along `g`, and nothing is left to bound.
    #[test]
    fn curvature_is_exact_for_a_stretched_fibre() {
        let tissue = tissue(MaterialModel::SaintVenantKirchhoff);
        let [lambda, mu] = LAME;
        let g = vec3(80.0, 0.0, 0.0);
        for s in [2.0, 3.0, 5.0] {
            let strain = 0.5 * (s * s - 1.0);
            let stress = lambda * (strain - 1.0) + 2.0 * mu * strain;
            let closed = ((lambda + 2.0 * mu) * s * s + stress) * 6400.0;
            let f = diagonal(s, 0.0, 0.0);
            let measured = second_derivative(&tissue, &f, g, vec3(1.0, 0.0, 0.0));
            assert!((measured / closed - 1.0).abs() < 1e-8, "{measured:e} and {closed:e}");
            let bound = tissue.curvature(&f, g);
            assert!((bound / closed - 1.0).abs() < 1e-14, "{bound:e} and {closed:e}");
        }
        // Under pressure the stress is no part of a bound.
        let f = diagonal(0.5, 0.5, 0.5);
        let closed = (lambda + 2.0 * mu) * 0.75 * 6400.0;
        assert!((tissue.curvature(&f, g) / closed - 1.0).abs() < 1e-14);
    }
}
