//! Values of a coarser level at the nodes of a finer one, and back.
#![allow(unsafe_code)]

use crate::layout::lattice::Weights;
use crate::scalar::Real;
use crate::scalar::lanes::Point;
use crate::solver::cpu::threads::{Shared, Workers};

/// Nodes that a thread does at a time: each has at most eight parents, or some sixty children.
const FINER_GRAIN: usize = 1024;
const COARSER_GRAIN: usize = 128;

/// Weights of the nodes of a coarser level in each node of a finer one.
#[derive(Clone, Debug, Default)]
pub struct Prolongation<S> {
    parents: Rows<S>,
    children: Rows<S>,
}

/// The nodes that each node depends on, and their weights.
#[derive(Clone, Debug, Default)]
struct Rows<S> {
    offsets: Vec<u32>,
    entries: Vec<(u32, S)>,
}

impl<S: Real> Rows<S> {
    fn bytes(&self) -> usize {
        size_of_val(&self.offsets[..]) + size_of_val(&self.entries[..])
    }

    /// The sum of what a node depends on.
    #[inline(always)]
    fn sum(&self, node: usize, values: &[Point<S>]) -> Point<S> {
        let row = self.offsets[node] as usize..self.offsets[node + 1] as usize;
        let mut sum = Point::default();
        for &(other, weight) in &self.entries[row] {
            sum.add_scaled(&values[other as usize], weight);
        }
        sum
    }

    /// The same dependences, seen from the other side: in the order of the nodes that have them.
    fn turned_round(&self, others: usize) -> Self {
        let mut offsets = vec![0; others + 1];
        for &(other, _) in &self.entries {
            offsets[other as usize + 1] += 1;
        }
        for other in 0..others {
            offsets[other + 1] += offsets[other];
        }
        let mut next = offsets.clone();
        let mut entries = vec![(0, S::ZERO); self.entries.len()];
        for node in 0..self.offsets.len() - 1 {
            let row = self.offsets[node] as usize..self.offsets[node + 1] as usize;
            for &(other, weight) in &self.entries[row] {
                let place = &mut next[other as usize];
                entries[*place as usize] = (node as u32, weight);
                *place += 1;
            }
        }
        Self { offsets, entries }
    }
}

impl<S: Real> Prolongation<S> {
    /// From the weights of a lattice; finer nodes that are not free take no part.
    pub fn new(weights: &Weights, coarser: usize, is_free: impl Fn(usize) -> bool) -> Self {
        let mut parents = Rows { offsets: vec![0], entries: Vec::new() };
        for node in 0..weights.offsets.len() - 1 {
            if is_free(node) {
                let row = weights.of(node).iter();
                parents.entries.extend(row.map(|&(parent, w)| (parent, S::from_f64(w.into()))));
            }
            parents.offsets.push(parents.entries.len() as u32);
        }
        parents.entries.shrink_to_fit();
        Self { children: parents.turned_round(coarser), parents }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.parents.bytes() + self.children.bytes()
    }

    /// `P^T` of a finer level's values.
    pub fn restrict(&self, workers: &Workers, finer: &[Point<S>], coarser: &mut [Point<S>]) {
        let shared = Shared::new(coarser);
        workers.each(shared.len(), COARSER_GRAIN, |range| {
            // SAFETY: every node is worked on once.
            let values = unsafe { shared.range(range.clone()) };
            for (node, value) in range.zip(values) {
                *value = self.children.sum(node, finer);
            }
        });
    }

    /// Replaces each of the finer level's values: `with` gets its number, and what `P` makes of a coarser level's there.
    pub fn prolong<T>(
        &self,
        workers: &Workers,
        coarser: &[Point<S>],
        finer: &mut [T],
        with: impl Fn(usize, Point<S>, &mut T) + Sync,
    ) where
        T: Send,
    {
        let shared = Shared::new(finer);
        workers.each(shared.len(), FINER_GRAIN, |range| {
            // SAFETY: every node is worked on once.
            let values = unsafe { shared.range(range.clone()) };
            for (node, value) in range.zip(values) {
                with(node, self.parents.sum(node, coarser), value);
            }
        });
    }
}
