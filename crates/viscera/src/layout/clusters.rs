//! Colours of two levels: clusters of tetrahedra have colours, and so have the tetrahedra in each.
//!
//! One workgroup of a device, or one thread, sweeps over all tetrahedra of a cluster, colour by colour, while their
//! vertices lie in memory of its own. So a sweep waits for all others as often as there are colours of clusters, four in
//! even meshes, in place of some forty. Ton-That, Kry and Andrews, "Parallel Block Neo-Hookean XPBD Using Graph Clustering",
//! Computers & Graphics 110, 2023, colour groups of constraints in this way; here groups are cells of a lattice.
//!
//! Invariants: **no two clusters of one colour share a vertex, and no two tetrahedra of one colour in a cluster do.**
//! Elements that are no tetrahedra have colours of one level, behind those of the clusters.
//!
//! Every connected part is divided and coloured as if it were alone, and alike in both precisions.

use super::cells::{Cell, Most, cells};
use crate::coloring::{Coloring, ConstraintGraph};
use crate::model::{Model, Numbering};
use crate::scalar::Real;
use crate::scalar::lanes::LANES;
use crate::settings::Colors;
use crate::sorting;

/// Whether this build has them: pages, which are light, have colours of one level.
pub(crate) const HAS_CLUSTERS: bool = cfg!(not(target_arch = "wasm32"));

/// Vertices of a cluster, at most: a workgroup has 16 KiB in the baseline, and each takes 16 bytes.
pub(crate) const CLUSTER_VERTICES: usize = 960;

/// No number.
const NONE: u32 = u32::MAX;

/// Which cluster each tetrahedron of a model is in, and its colour there.
#[derive(Clone, Debug, Default)]
pub(super) struct Clustering {
    pub cluster_of: Vec<u32>,
    pub inner_of: Vec<u32>,
    /// Of clusters and of elements that are no tetrahedra: nothing is split.
    pub coloring: Coloring,
}

/// The clusters of a set of tetrahedra.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SetClusters {
    /// Cluster `i` has blocks `offsets[i] .. offsets[i + 1]`.
    pub offsets: Vec<u32>,
    /// Clusters of colour `c` are `color_offsets[c] .. color_offsets[c + 1]`.
    pub color_offsets: Vec<u32>,
    /// The colour of each block within its cluster, ascending there.
    pub inner: Vec<u32>,
    /// The model's number of the last cluster.
    last: Option<u32>,
}

impl Default for SetClusters {
    fn default() -> Self {
        Self { offsets: vec![0], color_offsets: vec![0], inner: Vec::new(), last: None }
    }
}

impl SetClusters {
    /// One more block, of a cluster by the model's number and of a colour there.
    pub(super) fn push(&mut self, [cluster, inner]: [u32; 2]) {
        if self.last.replace(cluster) != Some(cluster) {
            self.offsets.push(self.inner.len() as u32);
        }
        self.inner.push(inner);
        if let Some(end) = self.offsets.last_mut() {
            *end = self.inner.len() as u32;
        }
    }

    /// What comes is of the next colour.
    pub(super) fn end_color(&mut self) {
        self.color_offsets.push(self.len() as u32);
    }

    /// The cluster of a block.
    pub(super) fn of_block(&self, block: usize) -> usize {
        self.offsets.partition_point(|&first| first as usize <= block) - 1
    }

    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Those of a colour.
    pub fn color(&self, color: usize) -> std::ops::Range<usize> {
        self.color_offsets[color] as usize..self.color_offsets[color + 1] as usize
    }

    /// The blocks of some of them.
    pub fn blocks(&self, clusters: std::ops::Range<usize>) -> std::ops::Range<usize> {
        self.offsets[clusters.start] as usize..self.offsets[clusters.end] as usize
    }

    pub fn bytes(&self) -> usize {
        4 * (self.offsets.len() + self.color_offsets.len() + self.inner.len())
    }
}

/// Divides a model into clusters of up to so many tetrahedra. `graph`: tetrahedra first, then other elements.
pub(super) fn clustered<S: Real>(
    model: &Model<S>,
    graph: &ConstraintGraph,
    numbering: &Numbering,
    size: u32,
) -> Clustering {
    let (tet_count, vertex_count) = (model.tet_count(), model.vertex_count());
    let most = Most { tets: size.max(1) as usize, vertices: CLUSTER_VERTICES };
    let mut all = Clustering {
        cluster_of: vec![0; tet_count],
        inner_of: vec![0; tet_count],
        coloring: Coloring::unsplit(graph, vertex_count),
    };
    // Part by part; in each the order of lowest vertices, the solver's, which is the same in a model of the part alone.
    let corners = |tet: u32| model.tet_vertices[tet as usize].map(|v| numbering.of(v) as u32);
    let lowest = |tet: u32| corners(tet).into_iter().fold(u32::MAX, u32::min);
    let tets = sorting::by_key(0..tet_count as u32, |tet| [u64::from(lowest(tet)), 0]);
    let part = |tet: u32| model.part_of(model.tet_vertices[tet as usize][0]);
    let mut count = 0;
    for of_part in tets.chunk_by(|&a, &b| part(a) == part(b)) {
        let first = lowest(of_part[0]);
        let own: Vec<_> = of_part.iter().map(|&t| corners(t).map(|v| v - first)).collect();
        let last = own.as_flattened().iter().fold(0, |last, &v| last.max(v));
        let user = |v: u32| numbering.order[(first + v) as usize] as usize;
        let places: Vec<_> = (0..=last).map(|v| model.places[user(v)]).collect();
        let law = |t: u32| model.laws[model.tet_materials[of_part[t as usize] as usize] as usize];
        let divided = cells(&own, &places, most);
        let divided = divided.into_iter().flat_map(|cell| {
            // A set has tetrahedra of one law.
            let sorted = sorting::by_key(cell.tets.iter().copied(), |t| [law(t) as u64, 0]);
            let of_law = sorted.chunk_by(|&a, &b| law(a) == law(b));
            of_law.map(|tets| Cell { tets: tets.to_vec(), ..cell }).collect::<Vec<_>>()
        });
        let mut clusters = Clusters::new(divided.collect(), &own, places.len());
        clusters.merge(most, |a, b| law(a) == law(b));
        let mut local = vec![NONE; places.len()];
        for (cluster, color) in clusters.all.iter().zip(clusters.colors()) {
            let tets: Vec<_> = cluster.tets.iter().map(|&t| own[t as usize]).collect();
            for (&t, inner) in cluster.tets.iter().zip(inner_colors(&tets, &mut local)) {
                let tet = of_part[t as usize] as usize;
                all.coloring.color_of[tet] = color;
                (all.cluster_of[tet], all.inner_of[tet]) = (count, inner);
            }
            count += u32::from(!cluster.tets.is_empty());
        }
    }
    all.color_others(graph, tet_count, vertex_count);
    all
}

impl Clustering {
    /// Colours what are no tetrahedra, behind the clusters.
    fn color_others(&mut self, graph: &ConstraintGraph, tet_count: usize, vertex_count: usize) {
        let coloring = &mut self.coloring;
        let of_clusters = coloring.color_of[..tet_count].iter().fold(0, |n, &c| n.max(c + 1));
        let mut others = ConstraintGraph::new();
        (tet_count..graph.constraint_count()).for_each(|c| others.push(graph.vertices(c)));
        let own = others.color(vertex_count, Colors::Unlimited);
        for (color, own) in coloring.color_of[tet_count..].iter_mut().zip(own.color_of) {
            *color = of_clusters + own;
        }
        coloring.color_count = of_clusters + own.color_count;
    }
}

/// The clusters of a connected part, and which share how many vertices.
struct Clusters {
    all: Vec<Cell>,
    neighbors: Vec<Vec<Shared>>,
}

/// A neighbour of a cluster.
#[derive(Clone, Copy, Debug)]
struct Shared {
    cluster: u32,
    vertices: u32,
}

impl Clusters {
    fn new(all: Vec<Cell>, tets: &[[u32; 4]], vertex_count: usize) -> Self {
        let mut at = vec![Vec::new(); vertex_count];
        for (cluster, cell) in (0..).zip(&all) {
            for &v in cell.tets.iter().flat_map(|&tet| &tets[tet as usize]) {
                if at[v as usize].last() != Some(&cluster) {
                    at[v as usize].push(cluster);
                }
            }
        }
        let neighbors = vec![Vec::new(); all.len()];
        let mut clusters = Self { all, neighbors };
        for sharing in &at {
            for (i, &a) in sharing.iter().enumerate() {
                for &b in &sharing[i + 1..] {
                    clusters.share(a, b, 1);
                    clusters.share(b, a, 1);
                }
            }
        }
        clusters
    }

    /// Cluster `a` has so many more vertices of `b`.
    fn share(&mut self, a: u32, b: u32, vertices: u32) {
        let own = &mut self.neighbors[a as usize];
        match own.iter_mut().find(|shared| shared.cluster == b) {
            Some(shared) => shared.vertices += vertices,
            None => own.push(Shared { cluster: b, vertices }),
        }
    }

    /// Small clusters, which the surface cuts off, become part of a neighbour that has room and whose class nobody around
    /// has: their tetrahedra would fill few lanes of their blocks. The smallest first; `alike`: may two be in one.
    fn merge(&mut self, most: Most, alike: impl Fn(u32, u32) -> bool) {
        let order = sorting::by_key(0..self.all.len() as u32, |c| {
            [self.all[c as usize].tets.len() as u64, 0]
        });
        for small in order {
            let cell = &self.all[small as usize];
            if cell.tets.is_empty() || 2 * cell.tets.len() > most.tets {
                continue;
            }
            let around = &self.neighbors[small as usize];
            let takes = |shared: &&Shared| {
                let other = &self.all[shared.cluster as usize];
                let is_free = |s: &Shared| {
                    s.cluster == shared.cluster || self.all[s.cluster as usize].class != other.class
                };
                other.tets.len() + cell.tets.len() <= most.tets
                    && other.vertices + cell.vertices <= most.vertices
                    && alike(other.tets[0], cell.tets[0])
                    && around.iter().all(is_free)
            };
            let key = |s: &&Shared| (s.vertices, std::cmp::Reverse(s.cluster));
            if let Some(&taker) = around.iter().filter(takes).max_by_key(key) {
                self.take_in(taker.cluster, small);
            }
        }
    }

    /// Cluster `small` becomes part of `taker`. Of what three share too much is counted, which only orders.
    fn take_in(&mut self, taker: u32, small: u32) {
        let Cell { tets, vertices, .. } = std::mem::take(&mut self.all[small as usize]);
        let cell = &mut self.all[taker as usize];
        cell.tets.extend(tets);
        cell.tets.sort_unstable();
        cell.vertices += vertices;
        for shared in std::mem::take(&mut self.neighbors[small as usize]) {
            self.neighbors[shared.cluster as usize].retain(|other| other.cluster != small);
            if shared.cluster != taker {
                self.share(shared.cluster, taker, shared.vertices);
                self.share(taker, shared.cluster, shared.vertices);
            }
        }
    }

    /// A colour for each cluster: its class where no neighbour has it, otherwise the lowest that none has. Those with many
    /// neighbours choose first.
    fn colors(&self) -> Vec<u32> {
        let most = u64::from(u32::MAX);
        let order = sorting::by_key(0..self.all.len() as u32, |c| {
            [most - self.neighbors[c as usize].len() as u64, 0]
        });
        let mut colors = vec![u32::MAX; self.all.len()];
        for cluster in order {
            let around = &self.neighbors[cluster as usize];
            let is_free = |color: &u32| around.iter().all(|s| colors[s.cluster as usize] != *color);
            let class = self.all[cluster as usize].class;
            // One more colour than there are neighbours is always free.
            let free = [class].into_iter().chain(0..=around.len() as u32).find(is_free);
            colors[cluster as usize] = free.unwrap_or(0);
        }
        // Small parts do not have cells of every class: the colours that they have in a row.
        let mut used = colors.clone();
        used.sort_unstable();
        used.dedup();
        colors.iter().map(|color| used.partition_point(|other| other < color) as u32).collect()
    }
}

/// A colour for each tetrahedron of a cluster: of those that are free the first whose last block is not full, so that few
/// lanes stay empty; a new one where none is free. Tetrahedra that meet many others choose first. `local`: room for
/// numbers of vertices, which comes and goes without any.
fn inner_colors(tets: &[[u32; 4]], local: &mut [u32]) -> Vec<u32> {
    let mut valence = Vec::new();
    for &v in tets.as_flattened() {
        let number = &mut local[v as usize];
        if *number == NONE {
            *number = valence.len() as u32;
            valence.push(0u32);
        }
        valence[*number as usize] += 1;
    }
    let corners = |tet: u32| tets[tet as usize].map(|v| local[v as usize] as usize);
    let crowding = |tet: u32| corners(tet).into_iter().map(|v| valence[v]).sum::<u32>();
    let order =
        sorting::by_key(0..tets.len() as u32, |tet| [u64::from(u32::MAX - crowding(tet)), 0]);
    let mut colors = vec![0; tets.len()];
    // Of each colour: how many tetrahedra it has, and which vertices.
    let mut open: Vec<(usize, Vec<bool>)> = Vec::new();
    for tet in order {
        let corners = corners(tet);
        let free = (0..open.len()).filter(|&c| corners.iter().all(|&v| !open[c].1[v]));
        let color = free.min_by_key(|&c| open[c].0.is_multiple_of(LANES)).unwrap_or(open.len());
        if color == open.len() {
            open.push((0, vec![false; valence.len()]));
        }
        let (count, taken) = &mut open[color];
        *count += 1;
        corners.into_iter().for_each(|v| taken[v] = true);
        colors[tet as usize] = color as u32;
    }
    tets.as_flattened().iter().for_each(|&v| local[v as usize] = NONE);
    colors
}
