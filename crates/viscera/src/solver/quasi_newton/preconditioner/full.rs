//! The whole matrix of a coarsest level, as sums over sets of tetrahedra; the formulas are in [`super::sums`].

use std::ops::Range;

use super::sums::{Gathered, Grouped, LocalTet, On};
use crate::scalar::Vec3;

/// The whole matrix of the coarsest level.
#[derive(Clone, Debug, Default)]
pub struct FullSums {
    /// Pairs of nodes with `sum_v m_v w_vc w_vd` [kg], the first not below the second.
    pub masses: Vec<([u32; 2], f64)>,
    pub sets: Vec<FullSet>,
    /// Nodes of all sets, and their mean gradients [1/m].
    pub nodes: Vec<(u32, Vec3<f64>)>,
    /// Of all sets `t_cd` [N/m], for each of its nodes with itself and with those before it.
    pub traces: Vec<f64>,
    /// The most nodes that a set has.
    pub most: usize,
}

/// Tetrahedra of a group within half the spacing of the level: a whole group, an eighth of one, or a single tetrahedron.
#[derive(Clone, Debug)]
pub struct FullSet {
    pub group: u32,
    pub nodes: Range<usize>,
    /// Where its traces begin.
    pub traces: usize,
    /// `V mu` and `V lambda` [N m].
    pub shear: f64,
    pub volume: f64,
}

/// Whether a little of the volume term counts: nu above 0.455.
fn is_stiff(tet: &LocalTet) -> bool {
    tet.lambda > 10.0 * tet.mu
}

impl FullSums {
    pub fn new(
        on: On<'_>,
        tets: &[LocalTet],
        grouped: &Grouped,
        eighths: &[u8],
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
        let mut members = Vec::new();
        for group in 0..grouped.len() {
            members.clear();
            let within = grouped.tets(group).iter().enumerate();
            members.extend(within.map(|(i, &tet)| match on {
                On::Vertices => (i as u32, tet),
                On::Lattice(_, level) if level == 0 || is_stiff(&tets[tet as usize]) => {
                    (u32::from(eighths[tet as usize]), tet)
                }
                On::Lattice(..) => (0, tet),
            }));
            members.sort_by_key(|&(set, _)| set);
            for set in members.chunk_by(|a, b| a.0 == b.0) {
                means.begin();
                traces.begin();
                let mut volume = 0.0;
                for &(_, tet) in set {
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
                let first = &tets[set[0].1 as usize];
                let nodes = full.nodes.len()..full.nodes.len() + means.list.len();
                full.most = full.most.max(nodes.len());
                full.sets.push(FullSet {
                    group: group as u32,
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
        }
        full.sets.shrink_to_fit();
        full.nodes.shrink_to_fit();
        full.traces.shrink_to_fit();
        full
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.masses[..])
            + size_of_val(&self.sets[..])
            + size_of_val(&self.nodes[..])
            + size_of_val(&self.traces[..])
    }
}
