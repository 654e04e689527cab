//! The incremental potential, which a step of implicit Euler minimises, and its gradient.
//!
//! ```text
//! Phi(x) = 1/2 sum_i m_i |x_i - xt_i|^2 + dt^2 (sum_t V_t W(F_t) + springs + attachments)
//! viscosity: W += eta/(2 dt) |C - C_n|_D^2
//! ```

use super::cpu::Step;
use super::sweep::corners;
use crate::elements::green_strain::{self, Voigt};
use crate::elements::{
    CornerLoad, attachment, deformation_gradient, internal_forces, neo_hookean, shape_gradients,
    spring,
};
use crate::material::MaterialModel;
use crate::model::{Model, TetSet};
use crate::scalar::{Mat3, Real, Scalar, Vec3};

/// The constants of a tetrahedron's tissue for one step.
pub(super) struct Tissue<S> {
    pub model: MaterialModel,
    /// [Pa].
    pub lame_lambda: S,
    /// [Pa].
    pub lame_mu: S,
    /// Retardation time over the step.
    pub viscosity_rate: S,
}

/// What a tetrahedron answers to a deformation.
pub(super) struct Response<S> {
    /// Elastic energy density [Pa].
    pub elastic_energy: S,
    /// Density [Pa] of the viscous part of the potential.
    pub viscous_energy: S,
    /// First Piola stress [Pa], viscosity included.
    pub piola: Mat3<S>,
}

impl<S: Scalar> Tissue<S> {
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

    /// Density [Pa] of the potential; `start` as in [`Tissue::respond`].
    #[inline(always)]
    fn potential(&self, f: &Mat3<S>, start: Option<&Voigt<S>>) -> S {
        let viscous = start.map(|start| self.viscous_energy(&change_since(f, start)));
        self.elastic_energy(f) + viscous.unwrap_or(S::ZERO)
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
    fn curvature(&self, f: &Mat3<S>, g: Vec3<S>) -> S {
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

/// The potential and what of it round-off can pretend.
#[derive(Clone, Copy, Debug)]
pub(super) struct Potential {
    /// `Phi` [J s^2].
    pub value: f64,
    /// Positions are stored to `eps |x|`; through the stresses that makes this much of `Phi`.
    pub noise: f64,
}

/// One evaluation of `Phi`: adds up in double precision, in a fixed order.
pub(super) fn potential<S: Real>(
    step: &Step<'_, S>,
    predicted: &[Vec3<S>],
    inverse_masses: &[S],
    start_strain: &[Vec<Voigt<S>>; 2],
    x: &[Vec3<S>],
) -> Potential {
    let model = step.model;
    let squared = step.dt * step.dt;
    let (mut value, mut noise) = (0.0, 0.0);
    let mut reach = 0.0f64;
    for v in 0..x.len() {
        reach = reach.max(x[v].length_squared().to_f64());
        if inverse_masses[v] != S::ZERO {
            value += 0.5 * (model.masses[v] * (x[v] - predicted[v]).length_squared()).to_f64();
        }
    }
    let rounding = S::EPSILON * reach.sqrt();
    for (set, strains) in model.tet_sets().into_iter().zip(start_strain) {
        for tet in 0..set.len() {
            let shape = &set.inverse_rest_shape[tet];
            let f = deformation_gradient(&corners(x, set.vertices[tet]), shape);
            let response = tissue(model, set, tet, step.dt).respond(&f, strains.get(tet));
            let volume = squared * set.rest_volume[tet].to_f64();
            value += volume * (response.elastic_energy + response.viscous_energy).to_f64();
            let force =
                volume * (response.piola.norm_squared() * shape.norm_squared()).sqrt().to_f64();
            noise += (force * rounding) * (force * rounding);
        }
    }
    let springs = &model.springs;
    for (i, ends) in springs.vertices.iter().enumerate() {
        let ends = [x[ends[0] as usize], x[ends[1] as usize]];
        let energy = spring::energy(&ends, springs.rest_length[i], springs.stiffness[i]);
        value += squared * energy.to_f64();
    }
    let attachments = &model.attachments;
    let anchors = step.inputs.anchors_of(model);
    for (i, &v) in attachments.vertices.iter().enumerate() {
        let anchor = anchors[attachments.order[i] as usize];
        let energy = attachment::energy(x[v as usize], anchor, attachments.stiffness[i]);
        value += squared * energy.to_f64();
    }
    // Rounding has no direction: squares add up. Two evaluations are compared, each of which has
    // also its own arithmetic's round-off, of the same size.
    Potential { value, noise: 4.0 * noise.sqrt() + 8.0 * f64::EPSILON * value.abs() }
}

/// Adds the potential [J] of tissue, springs and attachments at `x` to the part of the model to which
/// it belongs.
pub(super) fn add_inner_potential<S: Real>(
    step: &Step<'_, S>,
    start_strain: &[Vec<Voigt<S>>; 2],
    x: &[Vec3<S>],
    mut add: impl FnMut(usize, f64),
) {
    let model = step.model;
    let mut store =
        |vertex: u32, energy: f64| add(model.component_of[vertex as usize] as usize, energy);
    for (set, strains) in model.tet_sets().into_iter().zip(start_strain) {
        for (tet, vertices) in set.vertices.iter().enumerate() {
            let f = deformation_gradient(&corners(x, *vertices), &set.inverse_rest_shape[tet]);
            let density = tissue(model, set, tet, step.dt).potential(&f, strains.get(tet));
            store(vertices[0], (set.rest_volume[tet] * density).to_f64());
        }
    }
    let springs = &model.springs;
    for (i, ends) in springs.vertices.iter().enumerate() {
        let places = [x[ends[0] as usize], x[ends[1] as usize]];
        let energy = spring::energy(&places, springs.rest_length[i], springs.stiffness[i]);
        store(ends[0], energy.to_f64());
    }
    let attachments = &model.attachments;
    let anchors = step.inputs.anchors_of(model);
    for (i, &v) in attachments.vertices.iter().enumerate() {
        let anchor = anchors[attachments.order[i] as usize];
        store(v, attachment::energy(x[v as usize], anchor, attachments.stiffness[i]).to_f64());
    }
}

/// Per corner `dt^2` times the force of its element, and the bound of its curvature: the gradient of
/// `Phi` without inertia, in the slots that the rebase uses as well.
pub(super) fn load_forces<S: Real>(
    step: &Step<'_, S>,
    start_strain: &[Vec<Voigt<S>>; 2],
    x: &[Vec3<S>],
    loads: &mut [CornerLoad<S>],
) {
    let model = step.model;
    let squared = S::from_f64(step.dt * step.dt);
    for (set, strains) in model.tet_sets().into_iter().zip(start_strain) {
        for tet in 0..set.len() {
            let shape = &set.inverse_rest_shape[tet];
            let f = deformation_gradient(&corners(x, set.vertices[tet]), shape);
            let tissue = tissue(model, set, tet, step.dt);
            let response = tissue.respond(&f, strains.get(tet));
            let volume = squared * set.rest_volume[tet];
            let forces = internal_forces(&response.piola, shape, volume);
            let g = shape_gradients(shape);
            for i in 0..4 {
                let mass_bound = volume * tissue.curvature(&f, g[i]);
                loads[set.corner_offset + 4 * tet + i] =
                    CornerLoad { impulse: forces[i], mass_bound };
            }
        }
    }
    let springs = &model.springs;
    for (i, ends) in springs.vertices.iter().enumerate() {
        let ends = [x[ends[0] as usize], x[ends[1] as usize]];
        let forces = spring::forces(&ends, springs.rest_length[i], springs.stiffness[i]);
        let mass_bound = squared * springs.stiffness[i];
        for (end, force) in forces.into_iter().enumerate() {
            loads[springs.corner_offset + 2 * i + end] =
                CornerLoad { impulse: force * squared, mass_bound };
        }
    }
    let attachments = &model.attachments;
    let anchors = step.inputs.anchors_of(model);
    for (i, &v) in attachments.vertices.iter().enumerate() {
        let (anchor, stiffness) =
            (anchors[attachments.order[i] as usize], attachments.stiffness[i]);
        let force = attachment::force(x[v as usize], anchor, stiffness);
        loads[attachments.corner_offset + i] =
            CornerLoad { impulse: force * squared, mass_bound: squared * stiffness };
    }
}

fn tissue<S: Real>(model: &Model<S>, set: &TetSet<S>, tet: usize, dt: f64) -> Tissue<S> {
    let material = &model.materials[set.material[tet] as usize];
    Tissue {
        model: set.model,
        lame_lambda: material.lame_lambda,
        lame_mu: material.lame_mu,
        viscosity_rate: material.viscosity * S::from_f64(1.0 / dt),
    }
}
