//! Green strain of viscous tetrahedra, against which viscosity acts.
#![allow(unsafe_code)]

use super::data::{StartStrain, StepConstants};
use super::recovered::RecoveredTets;
use crate::elements::{deformation_gradient, green_strain};
use crate::layout::{Layout, Part, TetSet};
use crate::material::MaterialModel;
use crate::scalar::Real;
use crate::scalar::lanes::{Eight, Lanes, Point};
use crate::solver::cpu::tets::{Block, TetPass};
use crate::solver::cpu::threads::{Shared, Workers};

/// Green strain at `x` of the tetrahedra of viscous sets, of all or of one part.
pub fn measure_strain<S: Real>(
    workers: &Workers,
    layout: &Layout<S>,
    part: Option<&Part>,
    x: &[Point<S>],
    start_strain: &mut StartStrain<S>,
) {
    pass_over(workers, layout, part, x, S::ZERO, start_strain);
}

/// Brings the start strain of a part nearer to that at `x`: a share of the change between both is left.
fn keep_share<S: Real>(
    workers: &Workers,
    layout: &Layout<S>,
    part: &Part,
    x: &[Point<S>],
    share: S,
    start_strain: &mut StartStrain<S>,
) {
    pass_over(workers, layout, Some(part), x, share, start_strain);
}

/// The same of all tetrahedra of a part, recovered-gradient ones among them.
pub fn put_strains<S: Real>(
    constants: &mut StepConstants<S>,
    layout: &Layout<S>,
    number: usize,
    x: &[Point<S>],
    share: S,
) {
    let StepConstants { workers, recovered, start_strain, .. } = constants;
    put_strains_of(workers, layout, (number, recovered.as_mut()), x, share, start_strain);
}

/// The same, whoever keeps what recovered-gradient ones work with.
pub fn put_strains_of<S: Real>(
    workers: &Workers,
    layout: &Layout<S>,
    (number, recovered): (usize, Option<&mut RecoveredTets<S>>),
    x: &[Point<S>],
    share: S,
    start_strain: &mut StartStrain<S>,
) {
    keep_share(workers, layout, &layout.parts[number], x, share, start_strain);
    let law = MaterialModel::StableNeoHookean as usize;
    if let Some(tets) = recovered.filter(|_| layout.tet_sets[law].viscous) {
        tets.evaluate(workers, layout, number, x);
        tets.put_strains(workers, layout, number, share, &mut start_strain[law]);
    }
}

fn pass_over<S: Real>(
    workers: &Workers,
    layout: &Layout<S>,
    part: Option<&Part>,
    x: &[Point<S>],
    share: S,
    start_strain: &mut StartStrain<S>,
) {
    for (law, (set, strains)) in layout.tet_sets.iter().zip(start_strain).enumerate() {
        let pass = Strain { x, share, strains: Shared::new(strains) };
        match part {
            // Those of recovered-gradient tetrahedra are other strains.
            _ if !set.viscous || is_recovered(layout, set) => {}
            None => workers.pass(layout, set, 0..set.block_count(), &pass),
            Some(part) => {
                part.blocks(law).for_each(|blocks| workers.pass(layout, set, blocks, &pass));
            }
        }
    }
}

/// Whether the tetrahedra of a set are recovered-gradient tetrahedra.
pub fn is_recovered<S: Real>(layout: &Layout<S>, set: &TetSet<S>) -> bool {
    layout.recovered.is_some() && set.model == MaterialModel::StableNeoHookean
}

/// `E(x) + share (E - E(x))` in the place of `E`.
struct Strain<'a, S> {
    x: &'a [Point<S>],
    share: S,
    strains: Shared<'a, [Eight<S>; 6]>,
}

impl<S: Real> TetPass<S> for Strain<'_, S> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let f = deformation_gradient(&tets.corners::<L>(self.x).x, &tets.shape());
        // SAFETY: every block has a place of its own and is worked on once.
        let place = unsafe { self.strains.at(tets.index) };
        for (p, component) in green_strain::strain(&f).into_iter().enumerate() {
            let mut strain = component;
            if self.share != S::ZERO {
                let before = L::load(&place[p], tets.lane);
                strain = component + (before - component) * L::splat(self.share);
            }
            strain.store(&mut place[p], tets.lane);
        }
    }
}
