//! The incremental potential, which a step of implicit Euler minimises, and its gradient.
//!
//! ```text
//! Phi(x) = 1/2 sum_i m_i |x_i - xt_i|^2 + dt^2 (sum_t V_t W(F_t) + springs + attachments)
//! viscosity: W += eta/(2 dt) |C - C_n|_D^2
//! ```

#![allow(unsafe_code)]

use std::cell::Cell;
use std::ops::Range;

use super::data::{Step, StepConstants};
use super::law::{OfLaw, respond, with_tissue};
use super::strain::is_recovered;
use crate::elements::kinds::{Energy, Kind};
use crate::elements::law::{LAWS, Law};
use crate::layout::{ElementSet, Moments};
use crate::layout::{Layout, Part};
use crate::model::for_each_kind;
use crate::scalar::Real;
use crate::scalar::lanes::{Eight, LANES, Lanes, Point};
use crate::solver::cpu::tets::{Block, TetPass};
use crate::solver::cpu::threads::Shared;

/// The potential and the part of it that round-off can pretend.
#[derive(Clone, Copy, Debug, Default)]
pub struct Potential {
    /// `Phi` [J s^2].
    pub value: f64,
    /// Positions are stored to `eps |x|`; through the stresses that makes this much of `Phi`.
    pub noise: f64,
}

impl Potential {
    /// Of both together.
    pub fn plus(self, other: Self) -> Self {
        Self { value: self.value + other.value, noise: self.noise + other.noise }
    }

    /// Whether it is at most round-off above the limit.
    pub fn keeps(&self, limit: f64) -> bool {
        self.value <= limit + self.noise
    }
}

/// Blocks, and vertices, of a part whose sum is taken first. Part of the result's bits.
const PIECE: usize = 64;
const VERTEX_PIECE: usize = 1024;

/// Evaluates `Phi` part by part: adds up in double precision, in an order that other parts do not change.
#[derive(Clone, Debug)]
pub struct Evaluator {
    /// Of each part of the model with all that are in its group, as of its last evaluation.
    pub potentials: Vec<Potential>,
    /// Potential [J] of tissue, springs and attachments of each part, as of its last evaluation.
    pub stored: Vec<f64>,
    /// The pieces of all parts, part by part.
    pieces: Vec<Piece>,
    /// The first piece of each part, and the end of the last one's.
    first: Vec<usize>,
    /// The sums of the pieces.
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
    /// Blocks of tetrahedra of one law, by its number.
    Blocks(usize),
}

impl Evaluator {
    /// For a model.
    pub fn new<S: Real>(layout: &Layout<S>) -> Self {
        let parts = &layout.parts;
        let (mut pieces, mut first) = (Vec::new(), vec![0]);
        for (number, part) in parts.iter().enumerate() {
            let mut cut = |of, count: usize, size: usize| {
                let starts = (0..count).step_by(size);
                let ranges = starts.map(|start| start..(start + size).min(count));
                pieces.extend(ranges.map(|range| Piece { part: number, of, range }));
            };
            cut(PieceOf::Vertices, part.vertices.len(), VERTEX_PIECE);
            for (kind, set) in layout.tet_sets.iter().enumerate() {
                // Their energy is added where it is wanted: see `add_recovered`.
                if !is_recovered(layout, set) {
                    cut(PieceOf::Blocks(kind), part.block_count(kind), PIECE);
                }
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
        constants: &StepConstants<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
    ) {
        let parts = 0..step.layout.parts.len();
        self.sum_pieces(constants, step, x, parts.clone());
        for part in parts {
            self.combine(constants, step, x, part);
        }
        constants.groups.pool(&mut self.potentials, Potential::plus);
    }

    /// `Phi` of the group of one part at `x`, of which only its vertices count.
    pub fn evaluate<S: Real>(
        &mut self,
        constants: &StepConstants<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
        part: usize,
    ) -> Potential {
        let groups = &constants.groups;
        let mut all = Potential::default();
        for part in groups.of(part) {
            self.sum_pieces(constants, step, x, part..part + 1);
            self.combine(constants, step, x, part);
            all = all.plus(self.potentials[part]);
        }
        for part in groups.of(part) {
            self.potentials[part] = all;
        }
        all
    }

    /// Adds to `stored` what recovered-gradient tetrahedra of every part store at `x`.
    pub fn add_recovered_of_all<S: Real>(
        &mut self,
        constants: &mut StepConstants<S>,
        layout: &Layout<S>,
        x: &[Point<S>],
    ) {
        for number in 0..layout.part_count() {
            self.add_recovered(constants, layout, x, number);
        }
    }

    /// The same of one part.
    pub fn add_recovered<S: Real>(
        &mut self,
        constants: &mut StepConstants<S>,
        layout: &Layout<S>,
        x: &[Point<S>],
        number: usize,
    ) {
        if let StepConstants { workers, recovered: Some(tets), .. } = constants {
            tets.evaluate(workers, layout, number, x);
            self.stored[number] += tets.energy(workers, layout, number);
        }
    }

    /// Pieces of parts in a row.
    fn sum_pieces<S: Real>(
        &mut self,
        constants: &StepConstants<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
        parts: Range<usize>,
    ) {
        let range = self.first[parts.start]..self.first[parts.end];
        let pieces = &self.pieces[range.clone()];
        let partial = Shared::new(&mut self.partial[range]);
        constants.workers.each(pieces.len(), 1, |range| {
            for i in range {
                let sum = pieces[i].sum(constants, step, x);
                // SAFETY: every piece is worked on once.
                unsafe { *partial.at(i) = sum };
            }
        });
    }

    /// Adds up the pieces of a part, in order.
    fn combine<S: Real>(
        &mut self,
        constants: &StepConstants<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
        part: usize,
    ) {
        let range = self.first[part]..self.first[part + 1];
        let of = |of: PieceOf| {
            let all = self.pieces[range.clone()].iter().zip(&self.partial[range.clone()]);
            all.filter(move |(piece, _)| piece.of == of).map(|(_, &sum)| sum)
        };
        let inertia = of(PieceOf::Vertices).reduce(|a, b| [a[0] + b[0], a[1].max(b[1])]);
        let [inertia, reach] = inertia.unwrap_or_default();
        let (mut stored, mut squared_noise) = (0.0, 0.0);
        for kind in 0..LAWS {
            let sums = of(PieceOf::Blocks(kind)).reduce(|a, b| [a[0] + b[0], a[1] + b[1]]);
            let [energy, squared_force] = sums.unwrap_or_default();
            stored += energy;
            squared_noise += squared_force;
        }
        let of = &step.layout.parts[part];
        let moments = constants.moments(step);
        for_each_kind!(step.layout, set => add_energies(set, &mut stored, &moments, x, of));
        let contact = constants.contacts.sums(&step.contact(), part, x);
        stored += contact.energy;
        squared_noise += contact.squared_force;
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
    fn sum<S: Real>(
        &self,
        constants: &StepConstants<S>,
        step: &Step<'_, S>,
        x: &[Point<S>],
    ) -> [f64; 2] {
        let part = &step.layout.parts[self.part];
        let Range { start, end } = self.range;
        match self.of {
            PieceOf::Vertices => {
                let first = part.vertices.start;
                inertia(constants, x, first + start..first + end)
            }
            PieceOf::Blocks(kind) => {
                let set = &step.layout.tet_sets[kind];
                let sums = Sums {
                    x,
                    start_strain: &constants.start_strain[kind],
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
                        with_tissue!(set, L, VISCOUS => {
                            let pass = OfLaw::<_, L, VISCOUS>::new(&sums);
                            constants.workers.piece(step.layout, set, blocks, &pass);
                        });
                    }
                    before += blocks.len();
                }
                [sums.energy, sums.squared_force].map(|lanes| lanes.get().iter().sum())
            }
        }
    }
}

fn inertia<S: Real>(
    constants: &StepConstants<S>,
    x: &[Point<S>],
    vertices: Range<usize>,
) -> [f64; 2] {
    let (mut sum, mut reach) = (0.0, 0.0f64);
    for v in vertices {
        let place = x[v].vec3();
        reach = reach.max(place.length_squared().to_f64());
        if constants.inverse_masses[v] != S::ZERO {
            let away = (place - constants.predicted[v].vec3()).length_squared();
            sum += (constants.inertias[v] * away).to_f64();
        }
    }
    [sum, reach]
}

/// Adds the energies [J] of a part's elements of one kind.
fn add_energies<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    sum: &mut f64,
    moments: &Moments<'_, S>,
    x: &[Point<S>],
    part: &Part,
) {
    for i in set.of_part(part) {
        let element = set.element::<S>(i, moments);
        *sum += element.energy(&set.places(i, x)).to_f64();
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

impl<S: Real, W: Law, const VISCOUS: bool> TetPass<S> for OfLaw<'_, Sums<'_, S>, W, VISCOUS> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let sums = self.pass;
        let shape = tets.shape::<L>();
        let (_, _, response) =
            respond::<S, L, W, VISCOUS>(tets, sums.x, sums.start_strain, sums.dt);
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
