//! The whole matrix of a coarsest level, as sums over groups; the formulas are in [`super::sums`].

use std::ops::Range;

use super::sums::{Gathered, Grouped, LocalTet, On};
use crate::scalar::{Mat3, Vec3};

/// Of a pair of nodes, the first not below the second, in the rest shape.
#[derive(Clone, Copy, Debug)]
pub struct FullBlock {
    pub nodes: [u32; 2],
    /// `sum V g_c g_d^T` [m].
    pub b: Mat3<f64>,
}

/// The whole matrix of the coarsest level.
#[derive(Clone, Debug, Default)]
pub struct FullSums {
    /// Pairs of nodes with `sum_v m_v w_vc w_vd` [kg], the first not below the second.
    pub masses: Vec<([u32; 2], f64)>,
    /// Of each group.
    pub blocks: Vec<FullBlock>,
    /// Blocks of group `g` are `offsets[g] .. offsets[g + 1]`.
    offsets: Vec<usize>,
    /// Lame's parameters of each group [Pa]: mu and lambda.
    pub lame: Vec<[f64; 2]>,
}

impl FullSums {
    pub fn new(
        on: On<'_>,
        tets: &[LocalTet],
        grouped: &Grouped,
        masses: &[f64],
        free: &[bool],
    ) -> Self {
        let node_count = on.node_count(masses.len());
        let mut full = Self { offsets: vec![0], ..Self::default() };
        // By pairs: a coarsest level is small.
        let pair = |a: u32, b: u32| a.max(b) * node_count as u32 + a.min(b);
        let nodes = |pair: u32| [pair / node_count as u32, pair % node_count as u32];
        let mut mass = vec![0.0; node_count * node_count];
        let mut of_vertex = Vec::new();
        for v in (0..masses.len() as u32).filter(|&v| free[v as usize]) {
            of_vertex.clear();
            on.each(v, |node, w| of_vertex.push((node, w)));
            for &(a, wa) in &of_vertex {
                for &(b, wb) in of_vertex.iter().filter(|&&(b, _)| b <= a) {
                    mass[pair(a, b) as usize] += masses[v as usize] * wa * wb;
                }
            }
        }
        let kept = (0..).zip(mass).filter(|&(_, mass)| mass != 0.0);
        full.masses = kept.map(|(pair, mass)| (nodes(pair), mass)).collect();
        let mut sums = Gathered::<Mat3<f64>>::new(node_count * node_count);
        let mut gradients: Vec<(u32, Vec3<f64>)> = Vec::new();
        for group in 0..grouped.len() {
            sums.begin();
            for &tet in grouped.tets(group) {
                let tet = &tets[tet as usize];
                on.gradients(tet, free, &mut gradients);
                for &(a, ga) in &gradients {
                    for &(b, gb) in gradients.iter().filter(|&&(b, _)| b <= a) {
                        let sum = sums.of(pair(a, b));
                        *sum = *sum + Mat3::outer(ga * tet.volume, gb);
                    }
                }
            }
            let block = |&(pair, b): &(u32, Mat3<f64>)| FullBlock { nodes: nodes(pair), b };
            full.blocks.extend(sums.list.iter().map(block));
            full.offsets.push(full.blocks.len());
            let first = &tets[grouped.tets(group)[0] as usize];
            full.lame.push([first.mu, first.lambda]);
        }
        full.blocks.shrink_to_fit();
        full
    }

    /// Blocks of a group.
    pub fn of_group(&self, group: usize) -> Range<usize> {
        self.offsets[group]..self.offsets[group + 1]
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.masses[..])
            + size_of_val(&self.blocks[..])
            + size_of_val(&self.offsets[..])
            + size_of_val(&self.lame[..])
    }
}
