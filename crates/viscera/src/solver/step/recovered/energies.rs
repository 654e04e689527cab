//! Elastic energies of eight tetrahedra, of eight domains.
#![allow(unsafe_code)]

use std::ops::Range;

use super::kernels::{eight, gather_matrix, load_matrix, local_of, rows_of};
use crate::elements::recovered::{bulk_energy, bulk_shares, floor_energy};
use crate::elements::{deformation_gradient, neo_hookean};
use crate::layout::{Layout, RecoveredTables, TetSet};
use crate::scalar::lanes::{Eight, Kernel, LANES, Lanes, Point};
use crate::scalar::{Mat3, Real};
use crate::solver::cpu::tets::Block;

/// What adds up energies [J], in an order that lanes do not change.
pub trait Sum<S: Real> {
    /// `#[inline(always)]`.
    fn sum<L: Lanes<Real = S>>(self) -> f64;
}

pub struct Summed<'a, K> {
    pub of: K,
    pub into: &'a mut f64,
}

impl<S: Real, K: Sum<S>> Kernel<S> for Summed<'_, K> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        *self.into = self.of.sum::<L>();
    }
}

/// `sum_t V_t (1 - alpha) W(Fh_t)` of some blocks, and their volume floor.
pub struct TetEnergy<'a, S> {
    pub layout: &'a Layout<S>,
    pub set: &'a TetSet<S>,
    pub recovered: &'a [[Eight<S>; 9]],
    /// Where vertices are, if one is below the volume floor.
    pub crushed: Option<&'a [Point<S>]>,
    pub share: S,
    pub blocks: Range<usize>,
}

impl<S: Real> Sum<S> for TetEnergy<'_, S> {
    #[inline(always)]
    fn sum<L: Lanes<Real = S>>(self) -> f64 {
        let mut sum = 0.0;
        for index in self.blocks {
            let mut energies = [S::ZERO; LANES];
            for lane in (0..LANES).step_by(L::WIDTH) {
                let block = Block::new(self.layout, self.set, index, lane);
                let material = block.material::<L>();
                let local = bulk_shares(material.lame_lambda, material.lame_mu).local;
                let recovered = load_matrix::<L>(&self.recovered[index], lane);
                let density = neo_hookean::energy_density(&recovered, local, material.lame_mu);
                let mut density = density * L::splat(self.share);
                if let Some(x) = self.crushed {
                    let f = deformation_gradient(&block.corners::<L>(x).x, &block.shape());
                    density += floor_energy(&f, material.lame_mu);
                }
                (density * block.volume::<L>()).store(&mut energies, lane);
            }
            let filled = usize::from(self.set.filled[index]);
            energies[..filled].iter().for_each(|energy| sum += energy.to_f64());
        }
        sum
    }
}

/// `V_n (alpha W(G_n) + k_n/2 (Jh_n - 1)^2 + k_c/2 (Jh_c - 1)^2)` of a group: a cluster's volume is the sum of its
/// domains', each counts its part.
pub struct PlaceEnergy<'a, S> {
    pub tables: &'a RecoveredTables<S>,
    pub gradients: &'a [Point<S>],
    pub means: &'a [[S; 2]],
    pub group: usize,
}

impl<S: Real> Sum<S> for PlaceEnergy<'_, S> {
    #[inline(always)]
    fn sum<L: Lanes<Real = S>>(self) -> f64 {
        let Self { tables, gradients, means, group } = self;
        let share = tables.shares[1];
        let rows = rows_of(group);
        let mut energies = [S::ZERO; LANES];
        let (means, bulk) = (eight(means, group), eight(&tables.bulk, group));
        let of = |pairs: &Eight<[S; 2]>, i: usize| std::array::from_fn(|lane| pairs[lane][i]);
        let [domain, cluster] = [0, 1].map(|i| (of(means, i), of(bulk, i)));
        for lane in (0..LANES).step_by(L::WIDTH) {
            // SAFETY: the group's places.
            let gradient: Mat3<L> = unsafe { gather_matrix(gradients.as_ptr(), &rows, lane) };
            let [local, mu, _] = local_of(tables, group, lane);
            let mut density = neo_hookean::energy_density(&gradient, local, mu) * L::splat(share);
            for (change, stiffness) in [&domain, &cluster] {
                density += bulk_energy(L::load(change, lane), L::load(stiffness, lane));
            }
            let volume = L::load(eight(&tables.volumes, group), lane);
            (density * volume).store(&mut energies, lane);
        }
        energies.iter().map(|energy| energy.to_f64()).sum()
    }
}
