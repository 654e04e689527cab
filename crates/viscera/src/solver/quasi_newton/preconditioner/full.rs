//! The whole matrix of a coarsest level, as sums over groups; the formulas are in [`super::sums`].

use std::ops::Range;

use super::sums::{Gathered, Grouped, LocalTet, On};
use crate::scalar::Vec3;

/// The whole matrix of the coarsest level.
#[derive(Clone, Debug, Default)]
pub struct FullSums {
    /// Pairs of nodes with `sum_v m_v w_vc w_vd` [kg], the first not below the second.
    pub masses: Vec<([u32; 2], f64)>,
    /// Of each group.
    pub groups: Vec<FullGroup>,
    /// Nodes of all groups, and their mean gradients [1/m].
    pub nodes: Vec<(u32, Vec3<f64>)>,
    /// Of all groups `t_cd` [N/m], for each of its nodes with itself and with those before it.
    pub traces: Vec<f64>,
    /// The most nodes that a group has.
    pub most: usize,
}

/// A group's share of the coarsest level.
#[derive(Clone, Debug)]
pub struct FullGroup {
    /// Where its nodes and its traces begin.
    pub nodes: Range<usize>,
    pub traces: usize,
    /// `V mu` and `V lambda` [N m].
    pub shear: f64,
    pub volume: f64,
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
        let mut full = Self::default();
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
        let mut means = Gathered::<Vec3<f64>>::new(node_count);
        let mut traces = Gathered::<f64>::new(node_count * node_count);
        let mut gradients = Vec::new();
        for group in 0..grouped.len() {
            means.begin();
            traces.begin();
            let mut volume = 0.0;
            for &tet in grouped.tets(group) {
                let tet = &tets[tet as usize];
                volume += tet.volume;
                on.gradients(tet, free, &mut gradients);
                for &(a, ga) in &gradients {
                    *means.of(a) += ga * tet.volume;
                    for &(b, gb) in gradients.iter().filter(|&&(b, _)| b <= a) {
                        *traces.of(pair(a, b)) += tet.volume * tet.mu * ga.dot(gb);
                    }
                }
            }
            let first = &tets[grouped.tets(group)[0] as usize];
            let nodes = full.nodes.len()..full.nodes.len() + means.list.len();
            full.most = full.most.max(nodes.len());
            full.groups.push(FullGroup {
                nodes,
                traces: full.traces.len(),
                shear: volume * first.mu,
                volume: volume * first.lambda,
            });
            means.list.sort_unstable_by_key(|&(node, _)| node);
            for (i, &(a, _)) in means.list.iter().enumerate() {
                let of = |&(b, _): &(u32, Vec3<f64>)| *traces.of(pair(a, b));
                full.traces.extend(means.list[..=i].iter().map(of));
            }
            let mean = |&(node, sum): &(u32, Vec3<f64>)| (node, sum * (1.0 / volume));
            full.nodes.extend(means.list.iter().map(mean));
        }
        full.groups.shrink_to_fit();
        full.nodes.shrink_to_fit();
        full.traces.shrink_to_fit();
        full
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.masses[..])
            + size_of_val(&self.groups[..])
            + size_of_val(&self.nodes[..])
            + size_of_val(&self.traces[..])
    }
}
