//! The preconditioner: an inexpensive inverse of the curvature of the incremental potential, on all scales at once.
//!
//! ```text
//! M r = D_0^-1 r + P_1 (D_1^-1 r_1 + P_2 (D_2^-1 r_2 + ... P_L H_L^-1 r_L)),   r_l = P_l^T r_(l-1)
//! D_l: 3 x 3 diagonal blocks of P^T (m' + he^2 K) P,   H_L: all of it,   K: turned and stretched tetrahedra, other elements
//! ```
//!
//! Additive multilevel: Bramble, Pasciak, Xu, "Parallel multilevel preconditioners", Math. Comp. 55, 1990. Level 0 is
//! the mesh, the others nested lattices over the rest shape ([`crate::layout::lattice`]). A vertex alone can only move
//! against its neighbours, which are stiff; a node of a coarse level moves a region as a whole. So the number of
//! iterations does not grow with the mesh.
//!
//! Each connected part has its own. Vertices that are pinned have no place in any level.
#![allow(unsafe_code)]

mod added;
mod dense;
#[cfg(feature = "gpu")]
mod exported;
mod full;
mod prolongation;
mod rotation;
mod sums;
#[cfg(feature = "gpu")]
pub mod tables;
#[cfg(all(test, feature = "gpu-solves"))]
mod tables_tests;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::layout::lattice::Lattice;
use crate::layout::{Layout, Moments, Part};
use crate::model::for_each_kind;
use crate::scalar::lanes::Point;
use crate::scalar::{Mat3, Real, Vec3};
use crate::solver::cpu::threads::{Shared, Workers};
use crate::solver::step::data::{Step, StepConstants};
use dense::Dense;
use full::FullSums;
use prolongation::Prolongation;
use rotation::Turn;
use sums::{DiagonalSums, Grouped, Groups, LocalTets, On, Six, inverse, mapped, times};

/// How coarse the coarsest level is.
#[derive(Clone, Copy, Debug)]
struct Coarseness {
    /// Nodes that it has at most, where the levels can be made so: a dense system of three times as many.
    aim: usize,
    /// With so many it is still solved as a whole.
    most: usize,
}

impl Coarseness {
    const ON_CPU: Self = Self { aim: 64, most: 128 };
}

/// Nodes of a level that a vertex hangs on, at most.
const PARENTS: usize = 8;

/// Nodes, and groups, that a thread does at a time.
const BLOCK_GRAIN: usize = 256;
const GROUP_GRAIN: usize = 32;

/// Of all parts.
#[derive(Clone, Debug)]
pub struct Preconditioner<S> {
    parts: Vec<OfPart<S>>,
    /// The free vertices that the sums are of.
    free: Vec<bool>,
    /// Of each group of the part at hand: room that all parts share.
    turns: Vec<Turn<S>>,
}

#[derive(Clone, Debug)]
struct OfPart<S> {
    vertices: Range<usize>,
    lattice: Lattice,
    /// From the vertices to the finest lattice level, from there to the next, and so on.
    ways_up: Vec<Prolongation<S>>,
    groups: Groups<S>,
    /// Of all levels but the coarsest, and inverses of their blocks.
    levels: Vec<DiagonalSums<S>>,
    inverses: Vec<Vec<Six<S>>>,
    full: FullSums<S>,
    dense: Dense,
    /// Residuals, and then corrections, of the lattice levels.
    vectors: Vec<Vec<Point<S>>>,
    /// The residual of the vertices.
    residual: Vec<Point<S>>,
    /// Nodes of a level that a point hangs on, and its weights: room.
    nodes: Vec<(u32, f64)>,
}

/// What the curvature of a step is made of.
pub struct Curvature<'a, S> {
    /// `he` [s].
    pub dt: f64,
    /// Positions [m].
    pub x: &'a [Point<S>],
    /// What elements depend on.
    pub moments: Moments<'a, S>,
}

impl<S: Real> Preconditioner<S> {
    /// For a layout. Without the sums, which depend on what is free: [`Preconditioner::fit`] takes them.
    pub fn new(layout: &Layout<S>) -> Self {
        Self {
            parts: (layout.parts.iter())
                .map(|part| OfPart::new(layout, part, Coarseness::ON_CPU))
                .collect(),
            free: vec![true; layout.vertex_count()],
            turns: Vec::new(),
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.parts.iter().map(OfPart::bytes).sum::<usize>()
            + size_of_val(&self.free[..])
            + size_of_val(&self.turns[..])
    }

    /// Takes the sums of the rest shape of a part, at first and where other vertices are free; takes memory then.
    pub fn fit(&mut self, layout: &Layout<S>, constants: &StepConstants<S>) {
        for (number, part) in self.parts.iter_mut().enumerate() {
            let free = &mut self.free[part.vertices.clone()];
            let masses = &constants.inverse_masses[part.vertices.clone()];
            let mut is_other = !part.has_sums();
            for (free, mass) in free.iter_mut().zip(masses) {
                let is_free = *mass != S::ZERO;
                is_other |= *free != is_free;
                *free = is_free;
            }
            if is_other {
                part.rebuild(layout, number, free);
                let groups = part.groups.len();
                self.turns.resize(groups.max(self.turns.len()), Turn::NONE);
            }
        }
    }

    /// Turns a part's sums to where it is now, and inverts its blocks.
    pub fn refresh(
        &mut self,
        step: &Step<'_, S>,
        constants: &StepConstants<S>,
        curvature: &Curvature<'_, S>,
        number: usize,
    ) {
        let Self { parts, turns, free, .. } = self;
        parts[number].refresh(step, constants, curvature, number, turns, free);
    }

    /// The vertices of a part.
    pub fn vertices(&self, number: usize) -> Range<usize> {
        self.parts[number].vertices.clone()
    }

    /// `z = M r` of a part; both are of its vertices. Vertices that are not free count as nothing, and get nothing.
    pub fn apply(&mut self, workers: &Workers, number: usize, r: &[Vec3<S>], z: &mut [Vec3<S>]) {
        self.parts[number].apply(workers, r, z);
    }
}

impl<S: Real> OfPart<S> {
    fn new(layout: &Layout<S>, part: &Part, coarseness: Coarseness) -> Self {
        let first = part.vertices.start;
        let places = places_of(layout, part);
        let (mut tets, mut links) = (Vec::new(), Vec::new());
        for (law, set) in layout.tet_sets.iter().enumerate() {
            for block in part.blocks(law).flatten() {
                let filled = usize::from(set.filled[block]);
                let vertices = &set.blocks[block].vertices;
                let local = |lane: usize| vertices.map(|corner| corner[lane] - first as u32);
                tets.extend((0..filled).map(local));
            }
        }
        for_each_kind!(layout, set => {
            for i in set.of_part(part) {
                for pair in set.points[i].windows(2) {
                    links.push([pair[0] - first as u32, pair[1] - first as u32]);
                }
            }
        });
        let lattice = Lattice::new(&places, &tets, &links, coarseness.aim);
        let count = |level: usize| {
            if level == 0 { places.len() } else { lattice.levels[level - 1].node_count() }
        };
        let levels = lattice.levels.len();
        Self {
            vertices: part.vertices.clone(),
            ways_up: vec![Prolongation::default(); levels],
            groups: Groups::default(),
            levels: vec![DiagonalSums::default(); levels],
            inverses: (0..levels).map(|level| vec![[S::ZERO; 6]; count(level)]).collect(),
            full: FullSums::default(),
            dense: Dense::new(if count(levels) <= coarseness.most { 3 * count(levels) } else { 0 }),
            vectors: (1..=levels).map(|level| vec![Point::default(); count(level)]).collect(),
            residual: vec![Point::default(); places.len()],
            nodes: Vec::with_capacity(4 * PARENTS),
            lattice,
        }
    }

    fn bytes(&self) -> usize {
        let levels = self.lattice.levels.iter().map(|level| {
            size_of_val(&level.of_vertices.entries[..]) + size_of_val(&level.of_finer.entries[..])
        });
        let ways = self.ways_up.iter().map(Prolongation::bytes);
        let sums = self
            .levels
            .iter()
            .map(|sums| size_of_val(&sums.shares[..]) + size_of_val(&sums.offsets[..]));
        let vectors = self.vectors.iter().map(|vector| size_of_val(&vector[..]));
        let inverses = self.inverses.iter().map(|blocks| size_of_val(&blocks[..]));
        levels.sum::<usize>()
            + ways.sum::<usize>()
            + sums.sum::<usize>()
            + vectors.sum::<usize>()
            + inverses.sum::<usize>()
            + size_of_val(&self.groups.entries[..])
            + size_of_val(&self.groups.offsets[..])
            + size_of_val(&self.groups.laws[..])
            + size_of_val(&self.groups.viscosities[..])
            + size_of_val(&self.residual[..])
            + self.full.bytes()
            + self.dense.bytes()
    }

    /// Where vertices stand on a level: 0 is the mesh.
    fn on(lattice: &Lattice, level: usize) -> On<'_> {
        if level == 0 { On::Vertices } else { On::Lattice(lattice, level - 1) }
    }

    fn has_sums(&self) -> bool {
        !self.groups.offsets.is_empty()
    }

    fn rebuild(&mut self, layout: &Layout<S>, number: usize, free: &[bool]) {
        // Old and new ones are never there at a time: they are large.
        self.groups = Groups::default();
        self.ways_up.fill_with(Prolongation::default);
        self.levels.fill_with(DiagonalSums::default);
        self.full = FullSums::default();
        let part = &layout.parts[number];
        let tets = LocalTets::new(layout, number);
        let places = places_of(layout, part);
        let user = &layout.numbering.order[part.vertices.clone()];
        let masses: Vec<f64> = user.iter().map(|&v| layout.masses[v as usize].to_f64()).collect();
        let grouped = Grouped::new(&tets, &places, &self.lattice);
        self.groups = Groups::new(&tets, &grouped, places.len());
        for (level, (way, of)) in self.ways_up.iter_mut().zip(&self.lattice.levels).enumerate() {
            let weights = if level == 0 { &of.of_vertices } else { &of.of_finer };
            *way = Prolongation::new(weights, of.node_count(), |node| level > 0 || free[node]);
        }
        let coarsest = self.lattice.levels.len();
        for (level, sums) in self.levels.iter_mut().take(coarsest).enumerate() {
            let on = Self::on(&self.lattice, level);
            *sums = DiagonalSums::new(on, &tets, &grouped, &masses, free);
        }
        let on = Self::on(&self.lattice, coarsest);
        match self.dense.size() {
            0 => {
                let sums = DiagonalSums::new(on, &tets, &grouped, &masses, free);
                self.inverses.resize(coarsest + 1, vec![[S::ZERO; 6]; sums.offsets.len() - 1]);
                self.levels.truncate(coarsest);
                self.levels.push(sums);
            }
            _ => self.full = FullSums::new(on, &tets, &grouped, &masses, free),
        }
    }

    fn refresh(
        &mut self,
        step: &Step<'_, S>,
        constants: &StepConstants<S>,
        curvature: &Curvature<'_, S>,
        number: usize,
        turns: &mut [Turn<S>],
        free: &[bool],
    ) {
        let layout = step.layout;
        let part = &layout.parts[number];
        let x = &curvature.x[self.vertices.clone()];
        let squared = curvature.dt * curvature.dt;
        let groups = &self.groups;
        let shared = Shared::new(&mut turns[..groups.len()]);
        constants.workers.each(groups.len(), GROUP_GRAIN, |range| {
            // SAFETY: every group is worked on once.
            let turns = unsafe { shared.range(range.clone()) };
            for (group, turn) in range.zip(turns) {
                let rate = groups.viscosities[group] / curvature.dt;
                *turn = Turn::new(groups.laws[group], &groups.deformation(group, x), rate);
            }
        });
        let free = &free[self.vertices.clone()];
        self.sum_blocks(constants, squared, turns, free);
        self.sum_full(&constants.workers, squared, turns);
        for tether in constants.tethers_of(part) {
            let stiffness = squared * tether.stiffness.to_f64();
            let v = (tether.vertex - self.vertices.start) as u32;
            // The finest level has them in the inertia of its vertices, unless it is the dense one.
            let block = Mat3::IDENTITY * stiffness;
            self.add_element(&[v], &[[block]], usize::from(!self.inverses.is_empty()), free);
        }
        for_each_kind!(layout, set => self.add_elements(set, part, curvature, squared, free));
        let first = self.vertices.start as u32;
        constants.contacts.each_block(&step.contact(), number, curvature.x, |sample, block| {
            let vertices = sample.vertices.map(|v| v - first);
            self.add_point((&vertices, &sample.weights), &(block * squared), free);
        });
        let places = step.contact().places(curvature.x);
        constants.contacts.pairs.each_block(places, |vertices, weights, block| {
            // The other side is another part's, or comes as well.
            if self.vertices.contains(&(vertices[0] as usize)) {
                self.add_point((&vertices.map(|v| v - first), weights), &(block * squared), free);
            }
        });
        for blocks in &mut self.inverses {
            let shared = Shared::new(blocks);
            constants.workers.each(shared.len(), BLOCK_GRAIN, |range| {
                // SAFETY: every node is worked on once.
                let blocks = unsafe { shared.range(range) };
                blocks.iter_mut().for_each(|block| *block = inverse(block));
            });
        }
        self.dense.factorize(&constants.workers);
    }

    /// The blocks of all levels but a dense one, of inertia and tetrahedra; zero of vertices that are not free.
    fn sum_blocks(
        &mut self,
        constants: &StepConstants<S>,
        squared: f64,
        turns: &[Turn<S>],
        free: &[bool],
    ) {
        let inertias = &constants.inertias[self.vertices.clone()];
        let squared = S::from_f64(squared);
        for (sums, blocks) in self.levels.iter().zip(&mut self.inverses) {
            let are_vertices = sums.masses.is_empty();
            let masses = if are_vertices { inertias } else { &sums.masses };
            let shared = Shared::new(blocks);
            constants.workers.each(shared.len(), BLOCK_GRAIN, |range| {
                // SAFETY: every node is worked on once.
                let blocks = unsafe { shared.range(range.clone()) };
                for (node, block) in range.zip(blocks) {
                    *block = [S::ZERO; 6];
                    if are_vertices && !free[node] {
                        continue;
                    }
                    let mut diagonal = S::ZERO;
                    for share in sums.of_node(node) {
                        let turn = &turns[share.group as usize];
                        diagonal += share.trace * turn.stiffer;
                        let mapped = mapped(&turn.map, &share.b);
                        block.iter_mut().zip(mapped).for_each(|(sum, b)| *sum += b * turn.stiffer);
                    }
                    let diagonal = masses[node] + squared * diagonal;
                    *block = block.map(|entry| entry * squared);
                    block[..3].iter_mut().for_each(|entry| *entry += diagonal);
                }
            });
        }
    }

    /// The matrix of a dense coarsest level, of inertia and tetrahedra.
    fn sum_full(&mut self, workers: &Workers, squared: f64, turns: &[Turn<S>]) {
        if self.dense.size() == 0 {
            return;
        }
        self.dense.clear();
        for &(nodes, mass) in &self.full.masses {
            self.dense.add_block(nodes, &(Mat3::IDENTITY * mass));
        }
        let Self { full, dense, .. } = self;
        for (group, turn) in turns[..self.groups.len()].iter().enumerate() {
            full.each_block(workers, group, turn, squared, |nodes, block| {
                dense.add_block(nodes, &block.cast());
            });
        }
    }

    fn apply(&mut self, workers: &Workers, r: &[Vec3<S>], z: &mut [Vec3<S>]) {
        let Self { ways_up, inverses, dense, vectors, residual, .. } = self;
        for (point, r) in residual.iter_mut().zip(r) {
            point.set_vec3(*r);
        }
        // Down: residuals of all levels.
        for (level, way) in ways_up.iter().enumerate() {
            let (finer, coarser) = vectors.split_at_mut(level);
            let from = finer.last().unwrap_or(residual);
            way.restrict(workers, from, &mut coarser[0]);
        }
        // The coarsest level by itself.
        let levels = ways_up.len();
        let coarsest = vectors.last_mut().unwrap_or(residual);
        match inverses.get(levels) {
            Some(blocks) => {
                for (value, block) in coarsest.iter_mut().zip(blocks) {
                    value.set_vec3(times(block, value.vec3()));
                }
            }
            None => solve(dense, workers, coarsest),
        }
        // Up: to the correction of each level that of the coarser one.
        for level in (1..levels).rev() {
            let (finer, coarser) = vectors.split_at_mut(level);
            let blocks = &inverses[level];
            let way = &ways_up[level];
            way.prolong(workers, &coarser[0], &mut finer[level - 1], |node, above, value| {
                value.set_vec3(times(&blocks[node], value.vec3()) + above.vec3());
            });
        }
        match ways_up.first() {
            Some(way) => {
                let blocks = &inverses[0];
                way.prolong(workers, &vectors[0], z, |v, above, z| {
                    *z = times(&blocks[v], r[v]) + above.vec3();
                });
            }
            None => z.iter_mut().zip(residual).for_each(|(z, point)| *z = point.vec3()),
        }
    }
}

/// Rest positions [m] of a part's vertices.
fn places_of<S: Real>(layout: &Layout<S>, part: &Part) -> Vec<Vec3<f64>> {
    let user = &layout.numbering.order[part.vertices.clone()];
    user.iter().map(|&v| layout.rest_positions[v as usize].cast()).collect()
}

fn solve<S: Real>(dense: &mut Dense, workers: &Workers, values: &mut [Point<S>]) {
    for (place, value) in dense.vector().as_chunks_mut::<3>().0.iter_mut().zip(&*values) {
        *place = value.vec3().to_array().map(S::to_f64);
    }
    dense.solve(workers);
    for (place, value) in dense.vector().as_chunks::<3>().0.iter().zip(values) {
        value.set_vec3(Vec3::from_f64(*place));
    }
}
