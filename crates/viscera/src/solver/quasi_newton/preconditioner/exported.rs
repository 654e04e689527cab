//! What a connected part adds to the tables of a device ([`super::tables`]), in numbers of its own.

use super::sums::On;
use super::{Coarseness, OfPart};
use crate::elements::kinds::{Energy, Kind};
use crate::layout::lattice::{Lattice, Weights};
use crate::layout::{Before, ElementSet, Layout, Moments, Part};
use crate::model::for_each_kind;
use crate::scalar::Mat3;
use crate::scalar::lanes::Point;

/// A part with its sums.
pub struct Exported {
    pub of_part: OfPart<f32>,
    pub free: Vec<bool>,
    /// Nodes of each of its levels; vertices, where there is none.
    pub counts: Vec<usize>,
    pub has_dense: bool,
    /// Stiffness [N/m] of elements that are no tetrahedra: pairs of vertices.
    links: Vec<([u32; 2], f64)>,
}

impl Exported {
    pub fn new(layout: &Layout<f32>, number: usize, free: &[bool]) -> Self {
        let part = &layout.parts[number];
        let free = free[part.vertices.clone()].to_vec();
        let mut of_part = OfPart::new(layout, part, Coarseness::ON_DEVICE);
        of_part.rebuild(layout, number, &free);
        let counts = of_part.lattice.levels.iter().map(|level| level.node_count()).collect();
        let has_dense = of_part.dense.size() > 0;
        Self { links: links_of(layout, part), of_part, free, counts, has_dense }
    }

    /// Lattice levels that are solved block by block.
    pub fn ordinary_levels(&self) -> usize {
        self.counts.len() - usize::from(self.has_dense && !self.counts.is_empty())
    }

    /// Nodes of its dense level.
    pub fn dense_count(&self) -> usize {
        let on_lattice = self.counts.last().copied().unwrap_or(self.free.len());
        if self.has_dense { on_lattice } else { 0 }
    }

    /// Stiffness [N/m] between nodes of a level that other elements than tetrahedra have.
    pub fn stiffness(&self, on: On<'_>, mut add: impl FnMut([u32; 2], f64)) {
        for &(vertices, stiffness) in &self.links {
            if vertices.iter().all(|&v| self.free[v as usize]) {
                on.each(vertices[0], |a, wa| {
                    on.each(vertices[1], |b, wb| add([a, b], stiffness * wa * wb));
                });
            }
        }
    }
}

/// Pairs of a part's vertices that other elements tie, with a bound of the stiffness [N/m] between them at rest: what such an
/// element does to the directions that it does not stiffen is known to no table.
fn links_of(layout: &Layout<f32>, part: &Part) -> Vec<([u32; 2], f64)> {
    let mut links = Vec::new();
    let order = layout.numbering.order.iter();
    let places: Vec<Point<f32>> =
        order.map(|&v| Point::new(layout.rest_positions[v as usize], 0.0)).collect();
    let moments =
        Moments { anchors: &layout.rest_anchors, start: Before::Places(&places), dt: 1.0 };
    for_each_kind!(layout, set => add_links(set, part, &moments, &places, &mut links));
    links
}

fn add_links<K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<f32, K, N, M>,
    part: &Part,
    moments: &Moments<'_, f32>,
    places: &[Point<f32>],
    links: &mut Vec<([u32; 2], f64)>,
) {
    let first = part.vertices.start as u32;
    for i in set.of_part(part) {
        let x = set.places(i, places).map(|x| x.cast::<f64>());
        let blocks = set.element::<f64>(i, moments).blocks(&x);
        for (a, row) in blocks.iter().enumerate() {
            for (b, block) in row.iter().enumerate() {
                let pair = [a, b].map(|corner| set.points[i][corner] - first);
                links.push((pair, bound_of(block)));
            }
        }
    }
}

/// The largest sum of a row, with the sign of the trace.
fn bound_of(block: &Mat3<f64>) -> f64 {
    let [x, y, z] = block.columns;
    let sum = |a: f64, b: f64, c: f64| a.abs() + b.abs() + c.abs();
    let sums = [sum(x.x, y.x, z.x), sum(x.y, y.y, z.y), sum(x.z, y.z, z.z)];
    sums.into_iter().fold(0.0, f64::max).copysign(block.trace())
}

/// Weights of every coarser level in the nodes of the finest one.
pub fn composed(lattice: &Lattice) -> Vec<Weights> {
    let mut all: Vec<Weights> = Vec::new();
    for level in lattice.levels.iter().skip(1) {
        let next = match all.last() {
            None => level.of_finer.clone(),
            Some(before) => product(before, &level.of_finer),
        };
        all.push(next);
    }
    all
}

fn product(first: &Weights, second: &Weights) -> Weights {
    let mut product = Weights { offsets: vec![0], entries: Vec::new() };
    let mut row: Vec<(u32, f32)> = Vec::new();
    for node in 0..first.offsets.len() - 1 {
        row.clear();
        for &(middle, w) in first.of(node) {
            for &(parent, v) in second.of(middle as usize) {
                match row.iter_mut().find(|(known, _)| *known == parent) {
                    Some((_, sum)) => *sum += w * v,
                    None => row.push((parent, w * v)),
                }
            }
        }
        row.sort_unstable_by_key(|(parent, _)| *parent);
        product.entries.extend_from_slice(&row);
        product.offsets.push(product.entries.len() as u32);
    }
    product
}
