//! The stages of [`super`] in lanes and by all threads, in the order of a [`Layout`].
//!
//! Every sum has one order, whatever the lanes and the threads: tetrahedron by tetrahedron within a piece, then piece by
//! piece; entry by entry within a ring.
#![allow(unsafe_code)]

use std::sync::atomic::AtomicBool;

use super::energies::{PlaceEnergy, Summed, TetEnergy};
use super::kernels::{
    Load, PlaceStrains, PlaceStresses, TetForces, TetGradients, TetStrains, VertexForces,
    VertexGradients,
};
use crate::layout::{Layout, PartRanges, RecoveredTables, TetSet};
use crate::material::MaterialModel;
use crate::scalar::Real;
use crate::scalar::lanes::{self, Eight, LANES, Point};
use crate::solver::cpu::threads::{Shared, Workers};

/// Groups that a thread does at a time.
pub const GROUPS: usize = 64;

/// What passes over the recovered-gradient tetrahedra of a layout keep.
#[derive(Clone, Debug)]
pub struct RecoveredTets<S> {
    /// `G_n` of each place by columns.
    pub(super) gradients: Vec<Point<S>>,
    /// `Fh_t` by columns, of each block.
    pub(super) recovered: Vec<[Eight<S>; 9]>,
    /// Where vertices were [m] when a tetrahedron was below the volume floor last.
    x: Vec<Point<S>>,
    /// Whether one is, of each part.
    crushed: Vec<bool>,
    /// `V_t/4 (det Fh_t - 1)` [m^3], of each copy of a place.
    changes: Vec<S>,
    /// `Jh_n - 1` and `Jh_c - 1` of each place.
    pub(super) means: Vec<[S; 2]>,
    /// `Jh_c - 1` of each cluster.
    cluster_means: Vec<S>,
    /// `p_n` [Pa] of each place.
    pressures: Vec<S>,
    /// What tetrahedra do to `G_n` by columns, of each copy of a place.
    of_tets: Vec<Point<S>>,
    /// `N_n` by columns, of each place.
    stresses: Vec<Point<S>>,
    /// The Green strain at the start of the step of groups of places, where any tissue is viscous.
    pub(super) strains: Vec<[Eight<S>; 6]>,
    /// Energies of pieces and of groups [J].
    partial: Vec<f64>,
}

impl<S: Real> RecoveredTets<S> {
    /// Takes the memory; `tables` are those of the layout.
    pub fn new(layout: &Layout<S>, tables: &RecoveredTables<S>) -> Self {
        let places = tables.volumes.len();
        let copies = tables.copy_offsets.last().map_or(0, |&count| count as usize);
        let partial = |part: &PartRanges| part.pieces.len() + part.groups.len();
        let groups = if set_of(layout).viscous { places / LANES } else { 0 };
        Self {
            gradients: vec![Point::default(); 3 * places],
            recovered: vec![[[S::ZERO; LANES]; 9]; tables.frames.len()],
            x: vec![Point::default(); layout.vertex_count()],
            crushed: vec![false; tables.parts.len()],
            changes: vec![S::ZERO; copies],
            means: vec![[S::ZERO; 2]; places],
            cluster_means: vec![S::ZERO; tables.inverse_cluster_volumes.len()],
            pressures: vec![S::ZERO; places],
            of_tets: vec![Point::default(); 3 * copies],
            stresses: vec![Point::default(); 3 * places],
            strains: vec![[[S::ZERO; LANES]; 6]; groups],
            partial: vec![0.0; tables.parts.iter().map(partial).max().unwrap_or(0)],
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.gradients[..])
            + size_of_val(&self.recovered[..])
            + size_of_val(&self.x[..])
            + size_of_val(&self.crushed[..])
            + size_of_val(&self.changes[..])
            + size_of_val(&self.means[..])
            + size_of_val(&self.cluster_means[..])
            + size_of_val(&self.pressures[..])
            + size_of_val(&self.of_tets[..])
            + size_of_val(&self.stresses[..])
            + size_of_val(&self.strains[..])
            + size_of_val(&self.partial[..])
    }

    /// Gradients, volumes and pressures of a part where its vertices are, `x` [m]. Returns whether a tetrahedron is inside
    /// out: a linear one, of the same corners.
    pub fn evaluate(
        &mut self,
        workers: &Workers,
        layout: &Layout<S>,
        number: usize,
        x: &[Point<S>],
    ) -> bool {
        let Some(tables) = &layout.recovered else { return false };
        let Self { gradients, recovered, changes, .. } = self;
        let part = &tables.parts[number];
        let set = set_of(layout);
        assert!(x.len() >= layout.vertex_count());
        let shared = Shared::new(gradients);
        workers.each(part.groups.len(), GROUPS, |range| {
            let groups = part.groups.start + range.start..part.groups.start + range.end;
            lanes::run(workers.instructions, VertexGradients { tables, x, groups, into: shared });
        });
        changes[part.copies.clone()].fill(S::ZERO);
        let [inverted, crushed] = [false; 2].map(AtomicBool::new);
        let pass = TetGradients {
            frames: &tables.frames,
            x,
            gradients,
            recovered: Shared::new(recovered),
            changes: Shared::new(changes),
            inverted: &inverted,
            crushed: &crushed,
        };
        workers.each(part.pieces.len(), 1, |range| {
            for blocks in &part.pieces[range] {
                workers.piece(layout, set, blocks.clone(), &pass);
            }
        });
        self.crushed[number] = crushed.into_inner();
        if self.crushed[number] {
            self.x.copy_from_slice(&x[..layout.vertex_count()]);
        }
        self.average(workers, tables, number);
        inverted.into_inner()
    }

    /// Mean volumes and pressures of a part.
    fn average(&mut self, workers: &Workers, tables: &RecoveredTables<S>, number: usize) {
        let Self { changes, means, cluster_means, pressures, .. } = self;
        mean_volumes(workers, tables, number, changes, means, cluster_means);
        let places = tables.parts[number].places();
        let shared = Shared::new(pressures);
        workers.each(places.len(), LANES * GROUPS, |range| {
            for n in places.start + range.start..places.start + range.end {
                let ([domain, cluster], [of_place, of_cluster]) = (tables.bulk[n], means[n]);
                // SAFETY: every place is worked on once.
                unsafe { *shared.at(n) = domain * of_place + cluster * of_cluster };
            }
        });
    }

    /// Elastic energy [J] of a part where [`Self::evaluate`] has left it.
    pub fn energy(&mut self, workers: &Workers, layout: &Layout<S>, number: usize) -> f64 {
        let Some(tables) = &layout.recovered else { return 0.0 };
        let Self { recovered, gradients, means, partial, x, .. } = self;
        let crushed = self.crushed[number].then_some(&x[..]);
        let part = &tables.parts[number];
        let set = set_of(layout);
        let (of_pieces, of_groups) = partial.split_at_mut(part.pieces.len());
        let of_groups = &mut of_groups[..part.groups.len()];
        let shared = Shared::new(of_pieces);
        workers.each(part.pieces.len(), 1, |range| {
            for i in range {
                let mut energy = 0.0;
                let blocks = part.pieces[i].clone();
                let share = tables.shares[0];
                let sum = TetEnergy { set, recovered, crushed, share, blocks, layout };
                lanes::run(workers.instructions, Summed { of: sum, into: &mut energy });
                // SAFETY: every piece is worked on once.
                unsafe { *shared.at(i) = energy };
            }
        });
        let shared = Shared::new(of_groups);
        workers.each(part.groups.len(), GROUPS, |range| {
            for i in range {
                let mut energy = 0.0;
                let group = part.groups.start + i;
                let sum = PlaceEnergy { tables, gradients, means, group };
                lanes::run(workers.instructions, Summed { of: sum, into: &mut energy });
                // SAFETY: every group is worked on once.
                unsafe { *shared.at(i) = energy };
            }
        });
        partial[..part.pieces.len() + part.groups.len()].iter().sum()
    }

    /// Adds the forces [N] of a part where [`Self::evaluate`] has left it to copies of its vertices: those of tetrahedra to
    /// those of their piece, those of domains to the first.
    pub fn add_forces(
        &mut self,
        workers: &Workers,
        layout: &Layout<S>,
        number: usize,
        load: &Load<'_, S>,
        loads: &mut [Point<S>],
    ) {
        let Some(tables) = &layout.recovered else { return };
        let Self { gradients, recovered, pressures, of_tets, stresses, strains, x, .. } = self;
        let part = &tables.parts[number];
        let set = set_of(layout);
        assert!(loads.len() >= layout.copy_count());
        let strains = Shared::new(strains);
        of_tets[3 * part.copies.start..3 * part.copies.end].fill(Point::default());
        let pass = TetForces {
            frames: &tables.frames,
            recovered,
            crushed: self.crushed[number].then_some(&x[..]),
            pressures,
            share: tables.shares[0],
            load,
            of_tets: Shared::new(of_tets),
            loads: Shared::new(loads),
        };
        workers.each(part.pieces.len(), 1, |range| {
            for blocks in &part.pieces[range] {
                workers.piece(layout, set, blocks.clone(), &pass);
            }
        });
        let into = Shared::new(stresses);
        workers.each(part.groups.len(), GROUPS, |range| {
            let groups = part.groups.start + range.start..part.groups.start + range.end;
            let pass = PlaceStresses { tables, gradients, of_tets, load, strains, groups, into };
            lanes::run(workers.instructions, pass);
        });
        let loads = Shared::new(loads);
        workers.each(part.vertex_groups.len(), GROUPS, |range| {
            let first = part.vertex_groups.start;
            let groups = first + range.start..first + range.end;
            let pass = VertexForces { tables, layout, stresses, groups, loads };
            lanes::run(workers.instructions, pass);
        });
    }

    /// Where vertices are, if a tetrahedron of a part is below the volume floor.
    pub(super) fn crushed_at(&self, number: usize) -> Option<&[Point<S>]> {
        self.crushed[number].then_some(&self.x)
    }

    /// The Green strain of a part where [`Self::evaluate`] has left it in the place of another, of which a share of the
    /// change since then is left. `of_tets` are the strains of tetrahedra.
    pub fn put_strains(
        &mut self,
        workers: &Workers,
        layout: &Layout<S>,
        number: usize,
        share: S,
        of_tets: &mut [[Eight<S>; 6]],
    ) {
        let (Some(tables), set) = (&layout.recovered, set_of(layout)) else { return };
        if !set.viscous {
            return;
        }
        let Self { gradients, recovered, strains, .. } = self;
        let part = &tables.parts[number];
        let pass = TetStrains { recovered, share, strains: Shared::new(of_tets) };
        workers.each(part.pieces.len(), 1, |range| {
            for blocks in &part.pieces[range] {
                workers.piece(layout, set, blocks.clone(), &pass);
            }
        });
        let strains = Shared::new(strains);
        workers.each(part.groups.len(), GROUPS, |range| {
            let groups = part.groups.start + range.start..part.groups.start + range.end;
            lanes::run(workers.instructions, PlaceStrains { gradients, groups, share, strains });
        });
    }
}

pub fn set_of<S>(layout: &Layout<S>) -> &TetSet<S> {
    &layout.tet_sets[MaterialModel::StableNeoHookean as usize]
}

/// Means over places and over clusters, of both at each place, of what is given per copy of a place [m^3].
pub fn mean_volumes<S: Real>(
    workers: &Workers,
    tables: &RecoveredTables<S>,
    number: usize,
    changes: &[S],
    means: &mut [[S; 2]],
    cluster_means: &mut [S],
) {
    let part = &tables.parts[number];
    let (places, clusters) = (part.places(), part.clusters.clone());
    let grain = LANES * GROUPS;
    let shared = Shared::new(means);
    workers.each(places.len(), grain, |range| {
        for n in places.start + range.start..places.start + range.end {
            let copies = tables.copy_offsets[n] as usize..tables.copy_offsets[n + 1] as usize;
            let sum = changes[copies].iter().fold(S::ZERO, |sum, &change| sum + change);
            // SAFETY: every place is worked on once.
            unsafe { shared.at(n)[0] = sum * tables.inverse_volumes[n] };
        }
    });
    let of_clusters = Shared::new(cluster_means);
    workers.each(clusters.len(), grain, |range| {
        for c in clusters.start + range.start..clusters.start + range.end {
            let [first, end] = [c, c + 1].map(|c| tables.cluster_offsets[c] as usize);
            let change = |&n: &u32| tables.volumes[n as usize] * means[n as usize][0];
            let all = tables.cluster_places[first..end].iter().map(change);
            let sum = all.fold(S::ZERO, |sum, change| sum + change);
            // SAFETY: every cluster is worked on once.
            unsafe { *of_clusters.at(c) = sum * tables.inverse_cluster_volumes[c] };
        }
    });
    let shared = Shared::new(means);
    workers.each(places.len(), grain, |range| {
        for n in places.start + range.start..places.start + range.end {
            // SAFETY: every place is worked on once.
            unsafe { shared.at(n)[1] = cluster_means[tables.clusters[n] as usize] };
        }
    });
}
