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

mod dense;
mod prolongation;
mod rotation;
mod sums;

use std::ops::Range;

use crate::elements::kinds::{Energy, Kind};
use crate::layout::lattice::Lattice;
use crate::layout::{ElementSet, Layout, Moments, Part};
use crate::model::for_each_kind;
use crate::scalar::lanes::Point;
use crate::scalar::{Mat3, Real, Vec3};
use crate::solver::step::data::StepConstants;
use dense::Dense;
use prolongation::Prolongation;
use rotation::Turn;
use sums::{
    DiagonalSums, FullBlock, FullSums, Grouped, Groups, On, Six, inverse, mapped, tets_of_part,
    times,
};

/// Nodes of the coarsest level at most, where the levels can be made so: a dense system of three times as many.
const MOST_COARSE: usize = 64;

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
    full: FullSums,
    dense: Dense,
    /// Residuals, and then corrections, of the lattice levels.
    vectors: Vec<Vec<Vec3<S>>>,
    /// The residual of free vertices.
    masked: Vec<Vec3<S>>,
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
    /// For a layout, all of whose vertices are free.
    pub fn new(layout: &Layout<S>) -> Self {
        let mut all = Self {
            parts: layout.parts.iter().map(|part| OfPart::new(layout, part)).collect(),
            free: vec![true; layout.vertex_count()],
            turns: Vec::new(),
        };
        for (number, part) in all.parts.iter_mut().enumerate() {
            part.rebuild(layout, number, &all.free[part.vertices.clone()]);
        }
        let most = all.parts.iter().map(|part| part.groups.len()).max().unwrap_or(0);
        all.turns = vec![Turn::NONE; most];
        all
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.parts.iter().map(OfPart::bytes).sum::<usize>()
            + size_of_val(&self.free[..])
            + size_of_val(&self.turns[..])
    }

    /// Takes the sums of the rest shape of a part anew where other vertices are free; takes memory then.
    pub fn fit(&mut self, layout: &Layout<S>, constants: &StepConstants<S>) {
        for (number, part) in self.parts.iter_mut().enumerate() {
            let free = &mut self.free[part.vertices.clone()];
            let masses = &constants.inverse_masses[part.vertices.clone()];
            let mut is_other = false;
            for (free, mass) in free.iter_mut().zip(masses) {
                let is_free = *mass != S::ZERO;
                is_other |= *free != is_free;
                *free = is_free;
            }
            if is_other {
                part.rebuild(layout, number, free);
            }
        }
    }

    /// Turns a part's sums to where it is now, and inverts its blocks.
    pub fn refresh(
        &mut self,
        layout: &Layout<S>,
        constants: &StepConstants<S>,
        curvature: &Curvature<'_, S>,
        number: usize,
    ) {
        let Self { parts, turns, free, .. } = self;
        parts[number].refresh(layout, constants, curvature, &layout.parts[number], turns, free);
    }

    /// The vertices of a part.
    pub fn vertices(&self, number: usize) -> Range<usize> {
        self.parts[number].vertices.clone()
    }

    /// `z = M r` of a part; both are of its vertices.
    pub fn apply(&mut self, number: usize, r: &[Vec3<S>], z: &mut [Vec3<S>]) {
        let part = &mut self.parts[number];
        let free = &self.free[part.vertices.clone()];
        // What was learned before a vertex was pinned may have something there.
        let mut masked = std::mem::take(&mut part.masked);
        for ((masked, r), &free) in masked.iter_mut().zip(r).zip(free) {
            *masked = if free { *r } else { Vec3::ZERO };
        }
        part.apply(&masked, z);
        part.masked = masked;
        // Coarser levels move pinned vertices along.
        for (z, _) in z.iter_mut().zip(free).filter(|(_, free)| !**free) {
            *z = Vec3::ZERO;
        }
    }
}

impl<S: Real> OfPart<S> {
    fn new(layout: &Layout<S>, part: &Part) -> Self {
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
        let lattice = Lattice::new(&places, &tets, &links, MOST_COARSE);
        let count = |level: usize| {
            if level == 0 { places.len() } else { lattice.levels[level - 1].node_count() }
        };
        let ways_up = lattice.levels.iter().enumerate().map(|(level, of)| {
            Prolongation::new(if level == 0 { &of.of_vertices } else { &of.of_finer })
        });
        let levels = lattice.levels.len();
        Self {
            vertices: part.vertices.clone(),
            ways_up: ways_up.collect(),
            groups: Groups::default(),
            levels: vec![DiagonalSums::default(); levels],
            inverses: (0..levels).map(|level| vec![[S::ZERO; 6]; count(level)]).collect(),
            full: FullSums::default(),
            dense: Dense::new(3 * if has_dense(count(levels)) { count(levels) } else { 0 }),
            vectors: (1..=levels).map(|level| vec![Vec3::ZERO; count(level)]).collect(),
            masked: vec![Vec3::ZERO; places.len()],
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
            + size_of_val(&self.masked[..])
            + self.full.bytes()
            + self.dense.bytes()
    }

    /// Where vertices stand on a level: 0 is the mesh.
    fn on(lattice: &Lattice, level: usize) -> On<'_> {
        if level == 0 { On::Vertices } else { On::Lattice(lattice, level - 1) }
    }

    fn rebuild(&mut self, layout: &Layout<S>, number: usize, free: &[bool]) {
        let part = &layout.parts[number];
        let tets = tets_of_part(layout, number);
        let places = places_of(layout, part);
        let user = &layout.numbering.order[part.vertices.clone()];
        let masses: Vec<f64> = user.iter().map(|&v| layout.masses[v as usize].to_f64()).collect();
        let grouped = Grouped::new(&tets, &places, &self.lattice);
        self.groups = Groups::new(&tets, &grouped, places.len());
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
                self.levels.resize(coarsest + 1, sums);
            }
            _ => self.full = FullSums::new(on, &tets, &grouped, &masses, free),
        }
    }

    fn refresh(
        &mut self,
        layout: &Layout<S>,
        constants: &StepConstants<S>,
        curvature: &Curvature<'_, S>,
        part: &Part,
        turns: &mut [Turn<S>],
        free: &[bool],
    ) {
        let x = &curvature.x[self.vertices.clone()];
        let squared = curvature.dt * curvature.dt;
        for (group, turn) in turns[..self.groups.len()].iter_mut().enumerate() {
            let range =
                self.groups.offsets[group] as usize..self.groups.offsets[group + 1] as usize;
            let mut f = Mat3::<f64>::from_columns(Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
            for &(v, b) in &self.groups.entries[range] {
                f = f + Mat3::outer(x[v as usize].vec3().cast::<f64>(), b.cast());
            }
            let rate = self.groups.viscosities[group] / curvature.dt;
            *turn = Turn::new(self.groups.laws[group], &f, rate);
        }
        self.sum_blocks(constants, squared, turns);
        self.sum_full(squared, turns);
        let free = &free[self.vertices.clone()];
        for tether in constants.tethers_of(part) {
            let stiffness = squared * tether.stiffness.to_f64();
            let v = (tether.vertex - self.vertices.start) as u32;
            // The finest level has them in the inertia of its vertices, unless it is the dense one.
            let block = Mat3::IDENTITY * stiffness;
            self.add_element(&[v], &[[block]], usize::from(!self.inverses.is_empty()), free);
        }
        for_each_kind!(layout, set => self.add_elements(set, part, curvature, squared, free));
        for blocks in &mut self.inverses {
            blocks.iter_mut().for_each(|block| *block = inverse(block));
        }
        self.dense.factorize();
    }

    /// The blocks of all levels but a dense one, of inertia and tetrahedra.
    fn sum_blocks(&mut self, constants: &StepConstants<S>, squared: f64, turns: &[Turn<S>]) {
        let inertias = &constants.inertias[self.vertices.clone()];
        let squared = S::from_f64(squared);
        for (sums, blocks) in self.levels.iter().zip(&mut self.inverses) {
            let masses = if sums.masses.is_empty() { inertias } else { &sums.masses };
            for (node, block) in blocks.iter_mut().enumerate() {
                let (mut diagonal, mut sum) = (S::ZERO, [S::ZERO; 6]);
                let shares = sums.offsets[node] as usize..sums.offsets[node + 1] as usize;
                for share in &sums.shares[shares] {
                    let turn = &turns[share.group as usize];
                    diagonal += share.trace * turn.stiffer;
                    let block = mapped(&turn.map, &share.b);
                    sum.iter_mut().zip(block).for_each(|(sum, b)| *sum += b * turn.stiffer);
                }
                let diagonal = masses[node] + squared * diagonal;
                *block = sum.map(|entry| entry * squared);
                block[..3].iter_mut().for_each(|entry| *entry += diagonal);
            }
        }
    }

    /// The matrix of a dense coarsest level, of inertia and tetrahedra.
    fn sum_full(&mut self, squared: f64, turns: &[Turn<S>]) {
        if self.dense.size() == 0 {
            return;
        }
        self.dense.clear();
        for &(nodes, mass) in &self.full.masses {
            add_block(&mut self.dense, nodes, &(Mat3::IDENTITY * mass));
        }
        for (group, turn) in turns[..self.groups.len()].iter().enumerate() {
            let (r, a) = (turn.rotation.cast::<f64>(), turn.map.cast::<f64>());
            let squared = squared * turn.stiffer.to_f64();
            for &FullBlock { nodes, shear, volume } in &self.full.blocks[self.full.of_group(group)]
            {
                let block = r * shear * r.transpose() + a * volume * a.transpose();
                add_block(&mut self.dense, nodes, &(block * squared));
            }
        }
    }

    /// Of elements of one kind.
    fn add_elements<K: Kind<N, M>, const N: usize, const M: usize>(
        &mut self,
        set: &ElementSet<S, K, N, M>,
        part: &Part,
        curvature: &Curvature<'_, S>,
        squared: f64,
        free: &[bool],
    ) {
        for i in set.of_part(part) {
            let x = set.places(i, curvature.x).map(|x| x.cast::<f64>());
            let blocks = set.element::<f64>(i, &curvature.moments).blocks(&x);
            let blocks = blocks.map(|row| row.map(|block| block * squared));
            let vertices = set.points[i].map(|v| v - self.vertices.start as u32);
            self.add_element(&vertices, &blocks, 0, free);
        }
    }

    /// Adds an element's blocks [kg] to the levels from `first` on. Vertices that are not free count as nothing.
    fn add_element<const N: usize>(
        &mut self,
        vertices: &[u32; N],
        blocks: &[[Mat3<f64>; N]; N],
        first: usize,
        free: &[bool],
    ) {
        for level in first..self.inverses.len() {
            let inverses = &mut self.inverses[level];
            Self::on(&self.lattice, level).each_pair(
                vertices,
                free,
                |[a, b], [node, other], weight| {
                    if node == other {
                        add_six(&mut inverses[node as usize], &blocks[a][b], weight);
                    }
                },
            );
        }
        let coarsest = self.lattice.levels.len();
        if self.dense.size() == 0 || coarsest < first {
            return;
        }
        let dense = &mut self.dense;
        Self::on(&self.lattice, coarsest).each_pair(vertices, free, |[a, b], nodes, weight| {
            if nodes[1] <= nodes[0] {
                add_block(dense, nodes, &(blocks[a][b] * weight));
            }
        });
    }

    fn apply(&mut self, r: &[Vec3<S>], z: &mut [Vec3<S>]) {
        // Down: residuals of all levels.
        for level in 0..self.ways_up.len() {
            let (finer, coarser) = self.vectors.split_at_mut(level);
            let from = finer.last().map_or(r, |vector| &vector[..]);
            self.ways_up[level].restrict(from, &mut coarser[0]);
        }
        // Each level by itself. The vertices' own comes first, into `z`.
        let mut inverses = self.inverses.iter();
        let dense = self.dense.size() > 0;
        if !(dense && self.vectors.is_empty()) {
            let blocks = inverses.next().into_iter().flatten();
            for ((z, r), block) in z.iter_mut().zip(r).zip(blocks) {
                *z = times(block, *r);
            }
        }
        for (vector, blocks) in self.vectors.iter_mut().zip(inverses) {
            for (value, block) in vector.iter_mut().zip(blocks) {
                *value = times(block, *value);
            }
        }
        if dense {
            match self.vectors.last_mut() {
                Some(coarsest) => solve(&mut self.dense, coarsest),
                None => {
                    z.copy_from_slice(r);
                    solve(&mut self.dense, z);
                }
            }
        }
        // Up: corrections of coarser levels are added to those of finer ones.
        for level in (0..self.ways_up.len()).rev() {
            let (finer, coarser) = self.vectors.split_at_mut(level);
            match finer.last_mut() {
                Some(finer) => self.ways_up[level].add(&coarser[0], finer),
                None => self.ways_up[level].add(&coarser[0], z),
            }
        }
    }
}

/// Whether a coarsest level of so many nodes is solved as a whole.
fn has_dense(nodes: usize) -> bool {
    nodes <= 2 * MOST_COARSE
}

/// Rest positions [m] of a part's vertices.
fn places_of<S: Real>(layout: &Layout<S>, part: &Part) -> Vec<Vec3<f64>> {
    let user = &layout.numbering.order[part.vertices.clone()];
    user.iter().map(|&v| layout.rest_positions[v as usize].cast()).collect()
}

fn solve<S: Real>(dense: &mut Dense, values: &mut [Vec3<S>]) {
    for (place, value) in dense.vector().as_chunks_mut::<3>().0.iter_mut().zip(&*values) {
        *place = value.to_array().map(S::to_f64);
    }
    dense.solve();
    for (place, value) in dense.vector().as_chunks::<3>().0.iter().zip(values) {
        *value = Vec3::from_f64(*place);
    }
}

fn add_six<S: Real>(into: &mut Six<S>, block: &Mat3<f64>, weight: f64) {
    let [x, y, z] = block.columns;
    let entries = [x.x, y.y, z.z, z.y, z.x, y.x];
    into.iter_mut().zip(entries).for_each(|(sum, entry)| *sum += S::from_f64(entry * weight));
}

/// Adds a block to the lower triangle.
fn add_block(dense: &mut Dense, [node, other]: [u32; 2], block: &Mat3<f64>) {
    for (column, entries) in block.columns.iter().enumerate() {
        for (row, entry) in entries.to_array().into_iter().enumerate() {
            let (row, column) = (3 * node as usize + row, 3 * other as usize + column);
            if column <= row {
                dense.add(row, column, entry);
            }
        }
    }
}
