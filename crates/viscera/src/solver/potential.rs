//! The incremental potential, which a step of implicit Euler minimises, and its gradient.
//!
//! ```text
//! Phi(x) = 1/2 sum_i m_i |x_i - xt_i|^2 + dt^2 (sum_t V_t W(F_t) + springs + attachments)
//! viscosity: W += eta/(2 dt) |C - C_n|_D^2
//! ```

#![allow(unsafe_code)]

use std::cell::Cell;

use super::cpu::{Ground, StartStrain, Step, energy_slots};
use super::loads::{add_load, points};
use super::tets::{Block, TetPass, load_rows};
use super::threads::Shared;
use crate::elements::green_strain::{self, Voigt};
use crate::elements::{
    CornerLoad, attachment, deformation_gradient, internal_forces, neo_hookean, shape_gradients,
    spring,
};
use crate::material::MaterialModel;
use crate::model::{MaterialConstants, Model, TetSet};
use crate::scalar::lanes::{Eight, LANES, Lanes, Point};
use crate::scalar::{Mat3, Real, Scalar, Vec3};

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

/// The potential and what of it round-off can pretend.
#[derive(Clone, Copy, Debug)]
pub(super) struct Potential {
    /// `Phi` [J s^2].
    pub value: f64,
    /// Positions are stored to `eps |x|`; through the stresses that makes this much of `Phi`.
    pub noise: f64,
}

/// Blocks, and vertices, whose sum is taken first. Part of the result's bits.
const PIECE: usize = 64;
const VERTEX_PIECE: usize = 1024;

/// Evaluates an expression with the law of a set, and whether it is viscous, as constants: kernels of
/// one law each keep more of it in registers.
macro_rules! with_law {
    ($set:expr, $neo:ident, $viscous:ident => $result:expr) => {{
        let neo = $set.model == MaterialModel::StableNeoHookean;
        match (neo, $set.viscous) {
            (false, false) => with_law!(@ $neo false $viscous false $result),
            (false, true) => with_law!(@ $neo false $viscous true $result),
            (true, false) => with_law!(@ $neo true $viscous false $result),
            (true, true) => with_law!(@ $neo true $viscous true $result),
        }
    }};
    (@ $neo:ident $is_neo:literal $viscous:ident $is_viscous:literal $result:expr) => {{
        const $neo: bool = $is_neo;
        const $viscous: bool = $is_viscous;
        $result
    }};
}

/// Evaluates `Phi`: adds up in double precision, in a fixed order.
#[derive(Clone, Debug)]
pub(super) struct Evaluator<S> {
    /// Potential [J] of tissue, springs and attachments of each part of the model, as of the last
    /// evaluation.
    pub stored: Vec<f64>,
    /// Of each tetrahedron [J], where there are several parts.
    energies: Vec<S>,
    partial: Vec<[f64; 2]>,
}

impl<S: Real> Evaluator<S> {
    /// For a model, or for none.
    pub fn new(model: Option<&Model<S>>) -> Self {
        let Some(model) = model else {
            return Self { stored: Vec::new(), energies: Vec::new(), partial: Vec::new() };
        };
        let blocks = model.tet_sets().map(TetSet::block_count);
        let pieces = blocks.map(|count| count.div_ceil(PIECE)).into_iter();
        let pieces = pieces.max().unwrap_or(0).max(model.vertex_count().div_ceil(VERTEX_PIECE));
        Self {
            stored: vec![0.0; model.part_count()],
            energies: vec![S::ZERO; energy_slots(model)],
            partial: vec![[0.0; 2]; pieces],
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.stored[..])
            + size_of_val(&self.energies[..])
            + size_of_val(&self.partial[..])
    }

    /// `Phi` at `x`.
    pub fn evaluate(
        &mut self,
        ground: &Ground<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
    ) -> Potential {
        let inertia = |range: std::ops::Range<usize>| {
            let (mut sum, mut reach) = (0.0, 0.0f64);
            for v in range {
                let place = x[v].vec3();
                reach = reach.max(place.length_squared().to_f64());
                if ground.inverse_masses[v] != S::ZERO {
                    let away = (place - ground.predicted[v].vec3()).length_squared();
                    sum += (ground.inertias[v] * away).to_f64();
                }
            }
            [sum, reach]
        };
        let work = (x.len(), VERTEX_PIECE);
        let combine = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1].max(b[1])];
        let inertia = ground.workers.reduce(work, &mut self.partial, inertia, combine);
        let [inertia, reach] = inertia.unwrap_or_default();

        self.stored.fill(0.0);
        let mut squared_noise = 0.0;
        for (kind, set) in step.model.tet_sets().into_iter().enumerate() {
            squared_noise += self.add_tets(ground, step, kind, x);
            if self.stored.len() > 1 {
                self.add_by_part(step.model, kind, set);
            }
        }
        self.add_single(step, x);
        let squared = step.dt * step.dt;
        let value = 0.5 * inertia + squared * self.stored.iter().sum::<f64>();
        let noise = squared * S::EPSILON * (reach * squared_noise).sqrt();
        // Rounding has no direction: squares add up. Two evaluations are compared, each of which has
        // also its own arithmetic's round-off, of the same size.
        Potential { value, noise: 4.0 * noise + 8.0 * f64::EPSILON * value.abs() }
    }

    /// Adds the energies of a set where there is one part; returns the sum of squared forces.
    fn add_tets(
        &mut self,
        ground: &Ground<S>,
        step: &Step<'_, S>,
        kind: usize,
        x: &[Point<S>],
    ) -> f64 {
        let model = step.model;
        let set = model.tet_sets()[kind];
        let first = if kind == 0 { 0 } else { LANES * model.green_strain.block_count() };
        let energies = Shared::new(&mut self.energies);
        let map = |blocks| {
            let sums = Sums {
                x,
                start_strain: &ground.start_strain[kind],
                dt: step.dt,
                energies: (energies.len() > 0).then_some((&energies, first)),
                energy: Cell::default(),
                squared_force: Cell::default(),
            };
            with_law!(set, NEO, VISCOUS => {
                ground.workers.piece(model, set, blocks, &OfLaw::<_, NEO, VISCOUS>(&sums));
            });
            [sums.energy, sums.squared_force].map(|lanes| lanes.get().iter().sum())
        };
        let work = (set.block_count(), PIECE);
        let combine = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
        let sums = ground.workers.reduce(work, &mut self.partial, map, combine);
        let [energy, squared_force] = sums.unwrap_or_default();
        if let [only] = &mut self.stored[..] {
            *only += energy;
        }
        squared_force
    }

    /// Adds the energies of a set to the parts of the model, one by one.
    fn add_by_part(&mut self, model: &Model<S>, kind: usize, set: &TetSet<S>) {
        let first = if kind == 0 { 0 } else { model.green_strain.block_count() };
        for (block, lane) in set.places() {
            let part = model.part_at(set.blocks[block].vertices[0][lane] as usize);
            self.stored[part] += self.energies[LANES * (first + block) + lane].to_f64();
        }
    }

    fn add_single(&mut self, step: &Step<'_, S>, x: &[Point<S>]) {
        let model = step.model;
        let mut store = |v: usize, energy: S| {
            self.stored[model.part_at(v)] += energy.to_f64();
        };
        let springs = &model.springs;
        for (i, ends) in springs.vertices.iter().enumerate() {
            let ends = ends.map(|v| model.numbering.of(v));
            let places = ends.map(|v| x[v].vec3());
            store(ends[0], spring::energy(&places, springs.rest_length[i], springs.stiffness[i]));
        }
        let attachments = &model.attachments;
        let anchors = step.inputs.anchors_of(model);
        for (i, &v) in attachments.vertices.iter().enumerate() {
            let v = model.numbering.of(v);
            let anchor = anchors[attachments.order[i] as usize];
            store(v, attachment::energy(x[v].vec3(), anchor, attachments.stiffness[i]));
        }
    }
}

/// Energies [J] and squared forces [N^2] of a piece, lane by lane.
struct Sums<'a, S> {
    x: &'a [Point<S>],
    start_strain: &'a [[Eight<S>; 6]],
    dt: f64,
    /// Where each tetrahedron's energy goes, and the place of the set's first.
    energies: Option<(&'a Shared<'a, S>, usize)>,
    energy: Cell<Eight<f64>>,
    squared_force: Cell<Eight<f64>>,
}

/// A pass over tetrahedra of one law.
struct OfLaw<'a, P, const NEO: bool, const VISCOUS: bool>(&'a P);

impl<S: Real, const NEO: bool, const VISCOUS: bool> TetPass<S>
    for OfLaw<'_, Sums<'_, S>, NEO, VISCOUS>
{
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let sums = self.0;
        let shape = tets.shape::<L>();
        let (_, _, response) =
            respond::<S, L, NEO, VISCOUS>(tets, sums.x, sums.start_strain, sums.dt);
        let volume = tets.volume::<L>();
        let density = response.elastic_energy + response.viscous_energy;
        let [mut energy, mut stress, mut volumes] = [[S::ZERO; LANES]; 3];
        (volume * density).store(&mut energy, tets.lane);
        let squared = response.piola.norm_squared() * shape.norm_squared();
        squared.store(&mut stress, tets.lane);
        volume.store(&mut volumes, tets.lane);
        let (mut energies, mut forces) = (sums.energy.get(), sums.squared_force.get());
        let lanes = tets.lane..tets.lane + L::WIDTH;
        for lane in lanes.clone() {
            // Selected, not multiplied by zero: energies may be infinite.
            let counts = lane < tets.filled();
            let volume = volumes[lane].to_f64();
            let force = volume * volume * stress[lane].to_f64();
            energies[lane] += if counts { energy[lane].to_f64() } else { 0.0 };
            forces[lane] += if counts { force } else { 0.0 };
        }
        sums.energy.set(energies);
        sums.squared_force.set(forces);
        if let Some((all, first)) = sums.energies {
            let at = first + LANES * tets.index;
            // SAFETY: every tetrahedron has a place of its own and is worked on once.
            let places = unsafe { all.range(at + lanes.start..at + lanes.end) };
            places.copy_from_slice(&energy[lanes]);
        }
    }
}

/// `F`, the tissue, and what it answers to `F`.
#[inline(always)]
fn respond<S: Real, L: Lanes<Real = S>, const NEO: bool, const VISCOUS: bool>(
    tets: &Block<'_, S>,
    x: &[Point<S>],
    start_strain: &[[Eight<S>; 6]],
    dt: f64,
) -> (Mat3<L>, Tissue<L>, Response<L>) {
    let f = deformation_gradient(&tets.corners::<L>(x).x, &tets.shape());
    let law =
        if NEO { MaterialModel::StableNeoHookean } else { MaterialModel::SaintVenantKirchhoff };
    let tissue = Tissue::new(law, &tets.material(), dt);
    let response = if VISCOUS && tets.is_viscous() {
        let start: Voigt<L> = load_rows(start_strain[tets.index].as_flattened(), tets.lane);
        tissue.respond(&f, Some(&start))
    } else {
        tissue.respond(&f, None)
    };
    (f, tissue, response)
}

/// Per copy `dt^2` times the force of its elements, and the bound of their curvature: the gradient of
/// `Phi` without inertia, in the places that the rebase uses as well. Without `BOUND` the bounds are
/// zero.
pub(super) fn load_forces<S: Real, const BOUND: bool>(
    ground: &Ground<S>,
    step: &Step<'_, S>,
    x: &[Point<S>],
    loads: &mut [Point<S>],
) {
    let model = step.model;
    loads.fill(Point::default());
    for color in 0..model.color_count {
        let shared = Shared::new(loads);
        for (set, start_strain) in model.tet_sets().into_iter().zip(&ground.start_strain) {
            let forces = Forces::<_, BOUND> { x, start_strain, dt: step.dt, loads: &shared };
            with_law!(set, NEO, VISCOUS => {
                let pass = OfLaw::<_, NEO, VISCOUS>(&forces);
                ground.workers.pass(model, set, set.color(color), &pass);
            });
        }
    }
    let squared = S::from_f64(step.dt * step.dt);
    let springs = &model.springs;
    for (i, ends) in springs.vertices.iter().enumerate() {
        let ends = ends.map(|v| x[model.numbering.of(v)].vec3());
        let forces = spring::forces(&ends, springs.rest_length[i], springs.stiffness[i]);
        let mass_bound = squared * springs.stiffness[i];
        for (copy, force) in springs.copies[i].into_iter().zip(forces) {
            add_load(loads, copy, &CornerLoad { impulse: force * squared, mass_bound });
        }
    }
    let attachments = &model.attachments;
    let anchors = step.inputs.anchors_of(model);
    for (i, &v) in attachments.vertices.iter().enumerate() {
        let stiffness = attachments.stiffness[i];
        let anchor = anchors[attachments.order[i] as usize];
        let force = attachment::force(x[model.numbering.of(v)].vec3(), anchor, stiffness);
        let load = CornerLoad { impulse: force * squared, mass_bound: squared * stiffness };
        add_load(loads, attachments.copies[i], &load);
    }
}

struct Forces<'a, S, const BOUND: bool> {
    x: &'a [Point<S>],
    start_strain: &'a [[Eight<S>; 6]],
    dt: f64,
    loads: &'a Shared<'a, Point<S>>,
}

impl<S: Real, const BOUND: bool, const NEO: bool, const VISCOUS: bool> TetPass<S>
    for OfLaw<'_, Forces<'_, S, BOUND>, NEO, VISCOUS>
{
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let Forces { x, start_strain, dt, loads: into } = *self.0;
        let (f, tissue, response) = respond::<S, L, NEO, VISCOUS>(tets, x, start_strain, dt);
        let shape = tets.shape::<L>();
        let volume = tets.volume::<L>() * L::from_f64(dt * dt);
        let forces = internal_forces(&response.piola, &shape, volume);
        let g = shape_gradients(&shape);
        let mut loads = [CornerLoad::default(); 4];
        for corner in 0..4 {
            let mass_bound = if BOUND { volume * tissue.curvature(&f, g[corner]) } else { L::ZERO };
            loads[corner] = CornerLoad { impulse: forces[corner], mass_bound };
        }
        // SAFETY: constraints of one colour share no copy, and every block is worked on once.
        unsafe { tets.add(into, &points(&loads)) };
    }
}

/// Green strain at `x` of the tetrahedra of a viscous set.
pub(super) fn measure_strain<S: Real>(
    workers: &super::threads::Workers,
    model: &Model<S>,
    x: &[Point<S>],
    start_strain: &mut StartStrain<S>,
) {
    for (set, strains) in model.tet_sets().into_iter().zip(start_strain) {
        let pass = Strain { x, strains: Shared::new(strains) };
        if set.viscous {
            workers.pass(model, set, 0..set.block_count(), &pass);
        }
    }
}

struct Strain<'a, S> {
    x: &'a [Point<S>],
    strains: Shared<'a, [Eight<S>; 6]>,
}

impl<S: Real> TetPass<S> for Strain<'_, S> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let f = deformation_gradient(&tets.corners::<L>(self.x).x, &tets.shape());
        // SAFETY: every block has a place of its own and is worked on once.
        let place = unsafe { self.strains.at(tets.index) };
        for (p, component) in green_strain::strain(&f).into_iter().enumerate() {
            component.store(&mut place[p], tets.lane);
        }
    }
}
