//! What is added to the levels in every step: elements other than tetrahedra, and contact.
//!
//! ```text
//! element with blocks K_ab of its corners:  K_cd += sum_ab w_ac w_bd K_ab
//! point p = sum_a b_a x_a with block C:     K_cd += w_c w_d C,   w_c = sum_a b_a w_ac
//! w_ac: weight of node c of the level in corner a
//! ```

use super::sums::add_six;
use super::{Curvature, OfPart};
use crate::elements::kinds::{Energy, Kind};
use crate::layout::{ElementSet, Part};
use crate::scalar::{Mat3, Real};

impl<S: Real> OfPart<S> {
    /// Of elements of one kind.
    pub(super) fn add_elements<K: Kind<N, M>, const N: usize, const M: usize>(
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
    pub(super) fn add_element<const N: usize>(
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
                dense.add_block(nodes, &(blocks[a][b] * weight));
            }
        });
    }

    /// Adds the block [kg] of a point that hangs on vertices with weights to all levels. Vertices that are not free count as
    /// nothing.
    pub(super) fn add_point(
        &mut self,
        (vertices, weights): (&[u32; 4], &[f64; 4]),
        block: &Mat3<f64>,
        free: &[bool],
    ) {
        let Self { lattice, inverses, dense, nodes, .. } = self;
        let coarsest = lattice.levels.len();
        for level in 0..=coarsest {
            nodes.clear();
            let on = Self::on(lattice, level);
            for (&v, &weight) in vertices.iter().zip(weights) {
                if weight == 0.0 || !free[v as usize] {
                    continue;
                }
                on.each(v, |node, share| match nodes.iter_mut().find(|(at, _)| *at == node) {
                    Some((_, sum)) => *sum += weight * share,
                    None => nodes.push((node, weight * share)),
                });
            }
            if let Some(inverses) = inverses.get_mut(level) {
                for &(node, weight) in &*nodes {
                    add_six(&mut inverses[node as usize], block, weight * weight);
                }
            } else if dense.size() > 0 {
                for &(node, weight) in &*nodes {
                    for &(other, share) in nodes.iter().filter(|(other, _)| *other <= node) {
                        dense.add_block([node, other], &(*block * (weight * share)));
                    }
                }
            }
        }
    }
}
