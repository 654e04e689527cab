//! Values of a coarser level at the nodes of a finer one, and back.

use crate::layout::lattice::Weights;
use crate::scalar::{Real, Vec3};

/// Weights of the nodes of a coarser level in each node of a finer one.
#[derive(Clone, Debug, Default)]
pub struct Prolongation<S> {
    offsets: Vec<u32>,
    entries: Vec<(u32, S)>,
}

impl<S: Real> Prolongation<S> {
    /// From the weights of a lattice.
    pub fn new(weights: &Weights) -> Self {
        Self {
            offsets: weights.offsets.clone(),
            entries: weights.entries.iter().map(|&(node, w)| (node, S::from_f64(w))).collect(),
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.offsets[..]) + size_of_val(&self.entries[..])
    }

    fn row(&self, node: usize) -> &[(u32, S)] {
        &self.entries[self.offsets[node] as usize..self.offsets[node + 1] as usize]
    }

    /// `P^T` of a finer level's values.
    pub fn restrict(&self, finer: &[Vec3<S>], coarser: &mut [Vec3<S>]) {
        coarser.fill(Vec3::ZERO);
        for (node, &value) in finer.iter().enumerate() {
            for &(parent, weight) in self.row(node) {
                coarser[parent as usize] += value * weight;
            }
        }
    }

    /// Adds `P` times a coarser level's values.
    pub fn add(&self, coarser: &[Vec3<S>], finer: &mut [Vec3<S>]) {
        for (node, value) in finer.iter_mut().enumerate() {
            for &(parent, weight) in self.row(node) {
                *value += coarser[parent as usize] * weight;
            }
        }
    }
}
