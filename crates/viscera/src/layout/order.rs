//! Constraints sorted by colour, and their places in the flat arrays.

use super::clusters::Clustering;
use super::lattice::cell_order;
use crate::coloring::{Coloring, ConstraintGraph};
use crate::model::{Model, Numbering};
use crate::scalar::Real;
use crate::scalar::lanes::{Eight, LANES};
use crate::sorting;

/// Vertices cell by cell of the finest lattice of their part, for what gathers them cell by cell; parts stand in the
/// order that they have in the model's numbering.
pub(super) fn cell_by_cell<S: Real>(model: &Model<S>) -> Numbering {
    let parts = &model.part_numbers;
    let mut tets = vec![Vec::new(); model.part_count];
    for tet in &*model.tet_vertices {
        tets[parts[tet[0] as usize] as usize].push(*tet);
    }
    let mut order = Vec::with_capacity(parts.len());
    let mut local = vec![0; parts.len()];
    for of_part in model.numbering.order.chunk_by(|&a, &b| parts[a as usize] == parts[b as usize]) {
        of_part.iter().zip(0..).for_each(|(&v, place)| local[v as usize] = place);
        let places: Vec<_> = of_part.iter().map(|&v| model.places[v as usize]).collect();
        let tets = &mut tets[parts[of_part[0] as usize] as usize];
        tets.iter_mut().for_each(|tet| *tet = tet.map(|v| local[v as usize]));
        let mut sorted: Vec<_> = cell_order(&places, tets).into_iter().zip(of_part).collect();
        sorted.sort_unstable();
        order.extend(sorted.into_iter().map(|(_, &v)| v));
    }
    let mut rank = vec![0; order.len()];
    for (place, &v) in order.iter().enumerate() {
        rank[v as usize] = place as u32;
    }
    Numbering { order, rank }
}

/// First copy of each vertex in the solver's numbering.
pub(super) fn renumbered_copies(coloring: &Coloring, numbering: &Numbering) -> Vec<u32> {
    let mut offsets = Vec::with_capacity(numbering.order.len() + 1);
    let mut next = 0;
    offsets.push(next);
    for &v in &numbering.order {
        let v = v as usize;
        next += coloring.copy_offsets[v + 1] - coloring.copy_offsets[v];
        offsets.push(next);
    }
    offsets
}

/// Hands out places in the flat arrays while the sets are laid out one after the other.
pub(super) struct Order<'a> {
    pub graph: &'a ConstraintGraph,
    pub coloring: &'a Coloring,
    /// Where colours have two levels.
    pub clusters: Option<&'a Clustering>,
    pub numbering: &'a Numbering,
    /// Of the solver's vertices, ascending.
    pub part_of: &'a [u32],
    /// Of the solver's vertices.
    pub copy_offsets: &'a [u32],
    pub multipliers: usize,
    /// Constraints that have been sorted: tetrahedra first, then other elements kind by kind.
    pub sorted: usize,
}

impl Order<'_> {
    /// Sorts constraints by colour, cluster and colour in the cluster, then by place, and so by part, then by number;
    /// returns them with the offsets of the colours.
    pub fn sort(&self, constraints: impl Iterator<Item = u32>) -> (Vec<u32>, Vec<u32>) {
        let key = |c: u32| {
            let vertices = self.graph.vertices(c as usize).iter();
            let place = vertices.map(|&v| self.numbering.of(v) as u64).fold(u64::MAX, u64::min);
            let [cluster, inner] = self.cluster(c).map(u64::from);
            let color = u64::from(self.coloring.color_of[c as usize]);
            [(color << 32) | cluster, (inner << 32) | place]
        };
        let constraints = sorting::by_key(constraints, key);
        let mut offsets = vec![0u32; self.coloring.color_count as usize + 1];
        for &c in &constraints {
            offsets[self.coloring.color_of[c as usize] as usize + 1] += 1;
        }
        for color in 1..offsets.len() {
            offsets[color] += offsets[color - 1];
        }
        (constraints, offsets)
    }

    /// The part of a constraint.
    pub fn part(&self, constraint: u32) -> usize {
        let first = self.graph.vertices(constraint as usize)[0];
        self.part_of[self.numbering.of(first)] as usize
    }

    /// The cluster of a constraint and its colour there; nothing but zeros where colours have one level.
    pub fn cluster(&self, constraint: u32) -> [u32; 2] {
        let c = constraint as usize;
        let of = |all: &Clustering| Some([*all.cluster_of.get(c)?, *all.inner_of.get(c)?]);
        self.clusters.and_then(of).unwrap_or_default()
    }

    /// Tetrahedra of a colour in blocks: up to eight of one part, of one colour in one cluster.
    pub fn blocks<'t>(&self, order: &'t [u32], color: &[u32]) -> impl Iterator<Item = &'t [u32]> {
        order[color[0] as usize..color[1] as usize]
            .chunk_by(|&a, &b| self.part(a) == self.part(b) && self.cluster(a) == self.cluster(b))
            .flat_map(|of_part| of_part.chunks(LANES))
    }

    pub fn copy_count(&self) -> usize {
        self.copy_offsets.last().map_or(0, |&count| count as usize)
    }

    pub fn is_split(&self) -> bool {
        self.copy_count() > self.numbering.order.len()
    }

    /// The copies of a constraint's corners, in the solver's numbering.
    pub fn copies<const N: usize>(&self, constraint: usize) -> [u32; N] {
        let first = self.graph.corner_range(constraint).start;
        let vertices = self.graph.vertices(constraint);
        std::array::from_fn(|corner| {
            let v = vertices[corner];
            let local =
                self.coloring.copy_of[first + corner] - self.coloring.copy_offsets[v as usize];
            self.copy_offsets[self.numbering.of(v)] + local
        })
    }

    /// The copies of up to eight tetrahedra.
    pub fn block_copies(&self, tets: &[u32]) -> [Eight<u32>; 4] {
        let mut block = [[0; LANES]; 4];
        for lane in 0..LANES {
            let copies = self.copies::<4>(tets[lane.min(tets.len() - 1)] as usize);
            for (corner, copy) in copies.into_iter().enumerate() {
                block[corner][lane] = copy;
            }
        }
        block
    }

    pub fn take_multipliers(&mut self, count: usize) -> usize {
        self.multipliers += count;
        self.multipliers - count
    }
}
