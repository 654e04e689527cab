//! The incremental potential, which a step of implicit Euler minimises, and its gradient.
//!
//! ```text
//! Phi(x) = 1/2 sum_i m_i |x_i - xt_i|^2 + dt^2 (sum_t V_t W(F_t) + springs + attachments)
//! viscosity: W += eta/(2 dt) |C - C_n|_D^2
//! ```

#![allow(unsafe_code)]

use std::cell::Cell;
use std::ops::Range;

use super::cpu::{Ground, StartStrain, Step};
use super::loads::{add_load, points};
use super::tets::{Block, TetPass, load_rows};
use super::threads::Shared;
use super::tissue::{Response, Tissue};
use crate::elements::green_strain::{self, Voigt};
use crate::elements::{
    CornerLoad, attachment, deformation_gradient, internal_forces, shape_gradients, spring,
};
use crate::material::MaterialModel;
use crate::model::{Model, Part};
use crate::scalar::lanes::{Eight, LANES, Lanes, Point};
use crate::scalar::{Mat3, Real};

/// The potential and what of it round-off can pretend.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Potential {
    /// `Phi` [J s^2].
    pub value: f64,
    /// Positions are stored to `eps |x|`; through the stresses that makes this much of `Phi`.
    pub noise: f64,
}

/// Blocks, and vertices, of a part whose sum is taken first. Part of the result's bits.
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

/// Evaluates `Phi` part by part: adds up in double precision, in an order that other parts do not change.
#[derive(Clone, Debug)]
pub(super) struct Evaluator {
    /// Of each part of the model, as of its last evaluation.
    pub potentials: Vec<Potential>,
    /// Potential [J] of tissue, springs and attachments of each part, as of its last evaluation.
    pub stored: Vec<f64>,
    /// What is summed first, part by part.
    pieces: Vec<Piece>,
    /// The first piece of each part, and the end of the last one's.
    first: Vec<usize>,
    /// What the pieces sum up to.
    partial: Vec<[f64; 2]>,
}

/// Vertices or blocks of a part whose sum is taken first.
#[derive(Clone, Debug)]
struct Piece {
    part: usize,
    of: PieceOf,
    /// Among those of the part.
    range: Range<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum PieceOf {
    Vertices,
    /// Of one of the two sets.
    Blocks(usize),
}

impl Evaluator {
    /// For a model, or for none.
    pub fn new<S: Real>(model: Option<&Model<S>>) -> Self {
        let parts = model.map_or(&[][..], |model| &model.parts);
        let (mut pieces, mut first) = (Vec::new(), vec![0]);
        for (number, part) in parts.iter().enumerate() {
            let mut cut = |of, count: usize, size: usize| {
                let starts = (0..count).step_by(size);
                let ranges = starts.map(|start| start..(start + size).min(count));
                pieces.extend(ranges.map(|range| Piece { part: number, of, range }));
            };
            cut(PieceOf::Vertices, part.vertices.len(), VERTEX_PIECE);
            for kind in 0..2 {
                cut(PieceOf::Blocks(kind), part.block_count(kind), PIECE);
            }
            first.push(pieces.len());
        }
        pieces.shrink_to_fit();
        first.shrink_to_fit();
        Self {
            potentials: vec![Potential::default(); parts.len()],
            stored: vec![0.0; parts.len()],
            partial: vec![[0.0; 2]; pieces.len()],
            pieces,
            first,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.potentials[..])
            + size_of_val(&self.stored[..])
            + size_of_val(&self.pieces[..])
            + size_of_val(&self.first[..])
            + size_of_val(&self.partial[..])
    }

    /// `Phi` of every part at `x`, into `potentials`.
    pub fn evaluate_all<S: Real>(
        &mut self,
        ground: &Ground<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
    ) {
        let parts = 0..step.model.parts.len();
        self.sum_pieces(ground, step, x, parts.clone());
        for part in parts {
            self.combine(step, x, part);
        }
    }

    /// `Phi` of one part at `x`, of which only its vertices count.
    pub fn evaluate<S: Real>(
        &mut self,
        ground: &Ground<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
        part: usize,
    ) -> Potential {
        self.sum_pieces(ground, step, x, part..part + 1);
        self.combine(step, x, part);
        self.potentials[part]
    }

    /// Pieces of parts in a row.
    fn sum_pieces<S: Real>(
        &mut self,
        ground: &Ground<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
        parts: Range<usize>,
    ) {
        let range = self.first[parts.start]..self.first[parts.end];
        let pieces = &self.pieces[range.clone()];
        let partial = Shared::new(&mut self.partial[range]);
        ground.workers.each(pieces.len(), 1, |range| {
            for i in range {
                let sum = pieces[i].sum(ground, step, x);
                // SAFETY: every piece is worked on once.
                unsafe { *partial.at(i) = sum };
            }
        });
    }

    /// Adds up the pieces of a part, in order.
    fn combine<S: Real>(&mut self, step: &Step<'_, S>, x: &[Point<S>], part: usize) {
        let range = self.first[part]..self.first[part + 1];
        let of = |of: PieceOf| {
            let all = self.pieces[range.clone()].iter().zip(&self.partial[range.clone()]);
            all.filter(move |(piece, _)| piece.of == of).map(|(_, &sum)| sum)
        };
        let inertia = of(PieceOf::Vertices).reduce(|a, b| [a[0] + b[0], a[1].max(b[1])]);
        let [inertia, reach] = inertia.unwrap_or_default();
        let (mut stored, mut squared_noise) = (0.0, 0.0);
        for kind in 0..2 {
            let sums = of(PieceOf::Blocks(kind)).reduce(|a, b| [a[0] + b[0], a[1] + b[1]]);
            let [energy, squared_force] = sums.unwrap_or_default();
            stored += energy;
            squared_noise += squared_force;
        }
        add_single_energies(&mut stored, step, x, &step.model.parts[part]);
        let squared = step.dt * step.dt;
        let value = 0.5 * inertia + squared * stored;
        let noise = squared * S::EPSILON * (reach * squared_noise).sqrt();
        self.stored[part] = stored;
        // Rounding has no direction: squares add up. Two evaluations are compared, each of which has
        // also its own arithmetic's round-off, of the same size.
        let noise = 4.0 * noise + 8.0 * f64::EPSILON * value.abs();
        self.potentials[part] = Potential { value, noise };
    }
}

impl Piece {
    /// Twice the inertia's part of `Phi` and the largest squared distance from the origin, or energies [J] and
    /// squared forces [N^2].
    fn sum<S: Real>(&self, ground: &Ground<S>, step: &Step<'_, S>, x: &[Point<S>]) -> [f64; 2] {
        let part = &step.model.parts[self.part];
        let Range { start, end } = self.range;
        match self.of {
            PieceOf::Vertices => {
                let first = part.vertices.start;
                inertia(ground, x, first + start..first + end)
            }
            PieceOf::Blocks(kind) => {
                let set = step.model.tet_sets()[kind];
                let sums = Sums {
                    x,
                    start_strain: &ground.start_strain[kind],
                    dt: step.dt,
                    energy: Cell::default(),
                    squared_force: Cell::default(),
                };
                let mut before = 0;
                for blocks in part.blocks(kind) {
                    let chosen = start.max(before)..end.min(before + blocks.len());
                    if !chosen.is_empty() {
                        let first = blocks.start - before;
                        let blocks = first + chosen.start..first + chosen.end;
                        with_law!(set, NEO, VISCOUS => {
                            let pass = OfLaw::<_, NEO, VISCOUS>(&sums);
                            ground.workers.piece(step.model, set, blocks, &pass);
                        });
                    }
                    before += blocks.len();
                }
                [sums.energy, sums.squared_force].map(|lanes| lanes.get().iter().sum())
            }
        }
    }
}

fn inertia<S: Real>(ground: &Ground<S>, x: &[Point<S>], vertices: Range<usize>) -> [f64; 2] {
    let (mut sum, mut reach) = (0.0, 0.0f64);
    for v in vertices {
        let place = x[v].vec3();
        reach = reach.max(place.length_squared().to_f64());
        if ground.inverse_masses[v] != S::ZERO {
            let away = (place - ground.predicted[v].vec3()).length_squared();
            sum += (ground.inertias[v] * away).to_f64();
        }
    }
    [sum, reach]
}

/// Adds the energies [J] of a part's springs and attachments.
fn add_single_energies<S: Real>(sum: &mut f64, step: &Step<'_, S>, x: &[Point<S>], part: &Part) {
    let model = step.model;
    let springs = &model.springs;
    for i in part.springs() {
        let places = springs.vertices[i].map(|v| x[model.numbering.of(v)].vec3());
        *sum += spring::energy(&places, springs.rest_length[i], springs.stiffness[i]).to_f64();
    }
    let attachments = &model.attachments;
    let anchors = step.inputs.anchors_of(model);
    for i in part.attachments() {
        let place = x[model.numbering.of(attachments.vertices[i])].vec3();
        let anchor = anchors[attachments.order[i] as usize];
        *sum += attachment::energy(place, anchor, attachments.stiffness[i]).to_f64();
    }
}

/// Energies [J] and squared forces [N^2] of a piece, lane by lane.
struct Sums<'a, S> {
    x: &'a [Point<S>],
    start_strain: &'a [[Eight<S>; 6]],
    dt: f64,
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
        for lane in lanes {
            // Selected, not multiplied by zero: energies may be infinite.
            let counts = lane < tets.filled();
            let volume = volumes[lane].to_f64();
            let force = volume * volume * stress[lane].to_f64();
            energies[lane] += if counts { energy[lane].to_f64() } else { 0.0 };
            forces[lane] += if counts { force } else { 0.0 };
        }
        sums.energy.set(energies);
        sums.squared_force.set(forces);
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

/// Per copy of a part `dt^2` times the force of its elements, and the bound of their curvature: the gradient of
/// `Phi` without inertia, in the places that the rebase uses as well. Without `BOUND` the bounds are
/// zero.
pub(super) fn load_forces<S: Real, const BOUND: bool>(
    ground: &Ground<S>,
    step: &Step<'_, S>,
    part: &Part,
    x: &[Point<S>],
    loads: &mut [Point<S>],
) {
    let model = step.model;
    loads[part.copies.clone()].fill(Point::default());
    for color in &part.colors {
        let shared = Shared::new(loads);
        for (kind, set) in model.tet_sets().into_iter().enumerate() {
            let blocks = color.blocks[kind].start as usize..color.blocks[kind].end as usize;
            let start_strain = &ground.start_strain[kind];
            let forces = Forces::<_, BOUND> { x, start_strain, dt: step.dt, loads: &shared };
            with_law!(set, NEO, VISCOUS => {
                let pass = OfLaw::<_, NEO, VISCOUS>(&forces);
                ground.workers.pass(model, set, blocks, &pass);
            });
        }
    }
    let squared = S::from_f64(step.dt * step.dt);
    let springs = &model.springs;
    for i in part.springs() {
        let ends = springs.vertices[i].map(|v| x[model.numbering.of(v)].vec3());
        let forces = spring::forces(&ends, springs.rest_length[i], springs.stiffness[i]);
        let mass_bound = squared * springs.stiffness[i];
        for (copy, force) in springs.copies[i].into_iter().zip(forces) {
            add_load(loads, copy, &CornerLoad { impulse: force * squared, mass_bound });
        }
    }
    let attachments = &model.attachments;
    let anchors = step.inputs.anchors_of(model);
    for i in part.attachments() {
        let stiffness = attachments.stiffness[i];
        let anchor = anchors[attachments.order[i] as usize];
        let place = x[model.numbering.of(attachments.vertices[i])].vec3();
        let force = attachment::force(place, anchor, stiffness);
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

/// Green strain at `x` of the tetrahedra of viscous sets, of all or of one part.
pub(super) fn measure_strain<S: Real>(
    workers: &super::threads::Workers,
    model: &Model<S>,
    part: Option<&Part>,
    x: &[Point<S>],
    start_strain: &mut StartStrain<S>,
) {
    for (kind, (set, strains)) in model.tet_sets().into_iter().zip(start_strain).enumerate() {
        let pass = Strain { x, strains: Shared::new(strains) };
        match part {
            _ if !set.viscous => {}
            None => workers.pass(model, set, 0..set.block_count(), &pass),
            Some(part) => {
                part.blocks(kind).for_each(|blocks| workers.pass(model, set, blocks, &pass));
            }
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
