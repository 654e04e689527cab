//! How the energy of recovered-gradient tetrahedra changes on a way, and how it is curved along it.
//!
//! ```text
//! D_t, D_n: gradients of displacements, linear as Fh_t and G_n are;   J(F + D) - J(F) = J_1 + J_2 + J_3, by powers of D
//! change:    sum_t V_t (1 - alpha) (W(Fh + D) - W(Fh)) + sum_n V_n alpha (W(G + D) - W(G)) + sum V k dJ (J - 1 + dJ/2)
//! curvature: the same of second derivatives, and sum V k (J_1^2 + 2 (J - 1) J_2)
//! ```
//!
//! Every term is computed from the displacements: its round-off is that of the change, not that of the energy.
#![allow(unsafe_code)]

use std::cell::Cell;

use super::RecoveredTets;
use super::kernels::{
    VertexGradients, eight, gather_matrix, load_matrix, local_of, rows_of, scatter_changes,
};
use super::passes::{GROUPS, mean_volumes, set_of};
use crate::elements::deformation_gradient;
use crate::elements::law::StableNeoHookean;
use crate::elements::neo_hookean::volume_variation;
use crate::elements::recovered::{
    bulk_shares, floor_curvature_along, floor_energy_change, recovered_gradient,
};
use crate::layout::{Frames, Layout, RecoveredTables};
use crate::material::MaterialModel;
use crate::scalar::lanes::{self, Eight, Kernel, LANES, Lanes, Point};
use crate::scalar::{Mat3, Real};
use crate::solver::cpu::tets::{Block, TetPass, load_rows};
use crate::solver::cpu::threads::{Shared, Workers};
use crate::solver::step::tissue::Tissue;

/// Room for displacements and what follows from them.
#[derive(Clone, Debug)]
pub struct Along<S> {
    /// Displacements [m] of vertices, in the order of the layout.
    pub moved: Vec<Point<S>>,
    /// Their gradients at places, by columns.
    gradients: Vec<Point<S>>,
    /// Of copies of places, what a volume changes by: all of it, or `J_1` and `J_2`.
    changes: [Vec<S>; 2],
    /// The same, of places and their clusters.
    means: [Vec<[S; 2]>; 2],
    cluster_means: Vec<S>,
    /// Of pieces and of groups [J].
    partial: Vec<[f64; 2]>,
}

/// What is found along displacements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// The change of the energy by the whole of them [J], and the sum of its terms' magnitudes.
    Change,
    /// The second derivative [J], and without what may be negative in it.
    Curvature,
}

/// What viscosity acts against: the strains at the start of tetrahedra, and the time since then [s].
#[derive(Clone, Copy)]
pub struct Since<'a, S> {
    pub strains: &'a [[Eight<S>; 6]],
    pub dt: f64,
}

impl<S: Real> Along<S> {
    /// Takes the memory; `tables` are those of the layout.
    pub fn new(layout: &Layout<S>, tables: &RecoveredTables<S>) -> Self {
        let places = tables.volumes.len();
        let copies = tables.copy_offsets.last().map_or(0, |&count| count as usize);
        let partial = tables.parts.iter().map(|part| part.pieces.len() + part.groups.len());
        Self {
            moved: vec![Point::default(); layout.vertex_count()],
            gradients: vec![Point::default(); 3 * places],
            changes: [0, 1].map(|_| vec![S::ZERO; copies]),
            means: [0, 1].map(|_| vec![[S::ZERO; 2]; places]),
            cluster_means: vec![S::ZERO; tables.inverse_cluster_volumes.len()],
            partial: vec![[0.0; 2]; partial.max().unwrap_or(0)],
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.moved[..])
            + size_of_val(&self.gradients[..])
            + self.changes.iter().map(|of| size_of_val(&of[..])).sum::<usize>()
            + self.means.iter().map(|of| size_of_val(&of[..])).sum::<usize>()
            + size_of_val(&self.cluster_means[..])
            + size_of_val(&self.partial[..])
    }
}

impl<S: Real> RecoveredTets<S> {
    /// Along the displacements `along.moved` of a part from where [`Self::evaluate`] has left it; `since` counts where tissue
    /// is viscous.
    pub fn along(
        &self,
        workers: &Workers,
        layout: &Layout<S>,
        number: usize,
        (along, found): (&mut Along<S>, Found),
        since: Since<'_, S>,
    ) -> [f64; 2] {
        match found {
            Found::Change => self.find::<false>(workers, layout, number, along, since),
            Found::Curvature => self.find::<true>(workers, layout, number, along, since),
        }
    }

    fn find<const CURVED: bool>(
        &self,
        workers: &Workers,
        layout: &Layout<S>,
        number: usize,
        along: &mut Along<S>,
        since: Since<'_, S>,
    ) -> [f64; 2] {
        let Some(tables) = &layout.recovered else { return [0.0; 2] };
        let Along { moved, gradients, changes, means, cluster_means, partial } = along;
        let (part, set) = (&tables.parts[number], set_of(layout));
        assert!(moved.len() >= layout.vertex_count());
        let into = Shared::new(gradients);
        workers.each(part.groups.len(), GROUPS, |range| {
            let groups = part.groups.start + range.start..part.groups.start + range.end;
            lanes::run(workers.instructions, VertexGradients { tables, x: moved, groups, into });
        });
        for of_power in &mut *changes {
            of_power[part.copies.clone()].fill(S::ZERO);
        }
        let (of_pieces, of_groups) = partial.split_at_mut(part.pieces.len());
        let shared = Shared::new(of_pieces);
        let [first, second] = changes.each_mut().map(|of_power| Shared::new(of_power));
        workers.each(part.pieces.len(), 1, |range| {
            for i in range {
                let pass = TetsAlong::<S, CURVED> {
                    frames: &tables.frames,
                    recovered: &self.recovered,
                    crushed: self.crushed_at(number),
                    moved,
                    gradients,
                    changes: [&first, &second],
                    share: tables.shares[0],
                    since,
                    sum: Cell::default(),
                };
                workers.piece(layout, set, part.pieces[i].clone(), &pass);
                // SAFETY: every piece is worked on once.
                unsafe { *shared.at(i) = pass.sum.get() };
            }
        });
        for (changes, means) in changes.iter().zip(&mut *means) {
            mean_volumes(workers, tables, number, changes, means, cluster_means);
        }
        let of_groups = &mut of_groups[..part.groups.len()];
        let shared = Shared::new(of_groups);
        workers.each(part.groups.len(), GROUPS, |range| {
            for i in range {
                let mut sum = [0.0; 2];
                let pass = PlacesAlong::<S, CURVED> {
                    tables,
                    at: self,
                    gradients,
                    means,
                    dt: since.dt,
                    group: part.groups.start + i,
                    sum: &mut sum,
                };
                lanes::run(workers.instructions, pass);
                // SAFETY: every group is worked on once.
                unsafe { *shared.at(i) = sum };
            }
        });
        let all = &partial[..part.pieces.len() + part.groups.len()];
        all.iter().fold([0.0; 2], |[a, b], more| [a + more[0], b + more[1]])
    }
}

/// Of the tissue of a law at `F` along `D`: the change of its density [Pa], twice; or its curvature and the bound of that.
#[inline(always)]
fn densities<L: Lanes, const CURVED: bool>(
    tissue: &Tissue<L>,
    f: &Mat3<L>,
    d: &Mat3<L>,
    start: Option<&[L; 6]>,
) -> [L; 2] {
    if CURVED {
        tissue.curvature_along_of::<StableNeoHookean>(f, d, start)
    } else {
        [tissue.energy_change_of::<StableNeoHookean>(f, d, start); 2]
    }
}

/// The same of the volume floor.
#[inline(always)]
fn of_floor<L: Lanes, const CURVED: bool>(f: &Mat3<L>, d: &Mat3<L>, mu: L) -> [L; 2] {
    if CURVED { floor_curvature_along(f, d, mu) } else { [floor_energy_change(f, d, mu); 2] }
}

/// Adds densities, of some lanes, to a sum: both of a curvature, or a change and its magnitude.
#[inline(always)]
fn add<const CURVED: bool>(sum: &mut [f64; 2], [first, second]: [f64; 2]) {
    sum[0] += first;
    sum[1] += if CURVED { second } else { first.abs() };
}

/// `V_t (1 - alpha)` times the densities, and volumes to the corners' places.
struct TetsAlong<'a, S, const CURVED: bool> {
    frames: &'a [Frames<S>],
    recovered: &'a [[Eight<S>; 9]],
    crushed: Option<&'a [Point<S>]>,
    moved: &'a [Point<S>],
    gradients: &'a [Point<S>],
    changes: [&'a Shared<'a, S>; 2],
    share: S,
    since: Since<'a, S>,
    sum: Cell<[f64; 2]>,
}

impl<S: Real, const CURVED: bool> TetPass<S> for TetsAlong<'_, S, CURVED> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let (frame, lane) = (&self.frames[tets.index], tets.lane);
        let shape = tets.shape::<L>();
        let linear = deformation_gradient(&tets.corners::<L>(self.moved).x, &shape);
        let mut of_corners = [Mat3::ZERO; 4];
        for corner in 0..4 {
            // SAFETY: places of the tables, whose gradients there are.
            of_corners[corner] =
                unsafe { gather_matrix(self.gradients.as_ptr(), &frame.places[corner], lane) };
        }
        let d = recovered_gradient(&linear, &of_corners, &frame.rest(&shape, lane));
        let f = load_matrix::<L>(&self.recovered[tets.index], lane);
        let material = tets.material::<L>();
        let mut tissue = Tissue::new(MaterialModel::StableNeoHookean, &material, self.since.dt);
        tissue.lame_lambda = bulk_shares(material.lame_lambda, material.lame_mu).local;
        let mut start = [L::ZERO; 6];
        let is_viscous = tets.is_viscous();
        if is_viscous {
            start = load_rows(self.since.strains[tets.index].as_flattened(), lane);
        }
        let of_tissue = densities::<L, CURVED>(&tissue, &f, &d, is_viscous.then_some(&start));
        let mut densities = of_tissue.map(|density| density * L::splat(self.share));
        if let Some(x) = self.crushed {
            let f = deformation_gradient(&tets.corners::<L>(x).x, &shape);
            let of_floor = of_floor::<L, CURVED>(&f, &linear, material.lame_mu);
            densities = [densities[0] + of_floor[0], densities[1] + of_floor[1]];
        }
        let volume = tets.volume::<L>();
        let mut both = [[S::ZERO; LANES]; 2];
        for (lanes, density) in both.iter_mut().zip(densities) {
            (density * volume).store(lanes, lane);
        }
        let mut sum = self.sum.get();
        for lane in lane..(lane + L::WIDTH).min(tets.filled()) {
            add::<CURVED>(&mut sum, both.map(|of| of[lane].to_f64()));
        }
        self.sum.set(sum);
        let [first, second, third] = volume_variation(&f, &d);
        // SAFETY: the piece has copies of its own, and one thread does all of it.
        unsafe {
            if CURVED {
                scatter_changes(tets, frame, first, self.changes[0]);
                scatter_changes(tets, frame, second, self.changes[1]);
            } else {
                scatter_changes(tets, frame, (first + second) + third, self.changes[0]);
            }
        }
    }
}

/// `V_n alpha` times the densities, and what mean volumes store, of a group.
struct PlacesAlong<'a, S, const CURVED: bool> {
    tables: &'a RecoveredTables<S>,
    at: &'a RecoveredTets<S>,
    gradients: &'a [Point<S>],
    means: &'a [Vec<[S; 2]>; 2],
    dt: f64,
    group: usize,
    sum: &'a mut [f64; 2],
}

impl<S: Real, const CURVED: bool> Kernel<S> for PlacesAlong<'_, S, CURVED> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        let Self { tables, at, gradients, means, dt, group, sum } = self;
        let rows = rows_of(group);
        for lane in (0..LANES).step_by(L::WIDTH) {
            // SAFETY: the group's places.
            let [f, d]: [Mat3<L>; 2] = [&at.gradients[..], gradients]
                .map(|of| unsafe { gather_matrix(of.as_ptr(), &rows, lane) });
            let [local, mu, viscosity] = local_of(tables, group, lane);
            let tissue = Tissue {
                model: MaterialModel::StableNeoHookean,
                lame_lambda: local,
                lame_mu: mu,
                viscosity_rate: viscosity * L::from_f64(1.0 / dt),
            };
            let start = at.strains.get(group).map(|start| load_rows(start.as_flattened(), lane));
            let of_tissue = densities::<L, CURVED>(&tissue, &f, &d, start.as_ref());
            let volume = L::load(eight(&tables.volumes, group), lane);
            let mut both = [[S::ZERO; LANES]; 2];
            for (lanes, value) in both.iter_mut().zip(of_tissue) {
                (value * volume * L::splat(tables.shares[1])).store(lanes, lane);
            }
            for lane in lane..lane + L::WIDTH {
                add::<CURVED>(sum, both.map(|of| of[lane].to_f64()));
            }
        }
        for n in LANES * group..LANES * (group + 1) {
            for which in 0..2 {
                let stiffness = (tables.volumes[n] * tables.bulk[n][which]).to_f64();
                let here = at.means[n][which].to_f64();
                let [first, second] = [0, 1].map(|power| means[power][n][which].to_f64());
                if CURVED {
                    let bound = stiffness * first * first;
                    let exact = bound + 2.0 * stiffness * here * second;
                    add::<CURVED>(sum, [exact, bound]);
                } else {
                    let change = stiffness * first * (here + 0.5 * first);
                    add::<CURVED>(sum, [change, change]);
                }
            }
        }
    }
}
