//! Passes over tetrahedra of one law, which is matched once per set of blocks, outside the lanes.

use std::marker::PhantomData;

use super::tissue::{Response, Tissue};
use crate::elements::deformation_gradient;
use crate::elements::green_strain::Voigt;
use crate::elements::law::Law;
use crate::scalar::lanes::{Eight, Lanes, Point};
use crate::scalar::{Mat3, Real};
use crate::solver::cpu::tets::{Block, load_rows};

/// Evaluates an expression with the law of a set as a type, and whether it is viscous as a constant: kernels of
/// one law each keep more of it in registers.
macro_rules! with_tissue {
    ($set:expr, $law:ident, $viscous:ident => $result:expr) => {
        $crate::elements::law::with_law!($set.model, $law => {
            if $set.viscous {
                const $viscous: bool = true;
                $result
            } else {
                const $viscous: bool = false;
                $result
            }
        })
    };
}
pub(in crate::solver) use with_tissue;

/// A pass over tetrahedra of one law.
pub struct OfLaw<'a, P, W, const VISCOUS: bool> {
    pub pass: &'a P,
    law: PhantomData<W>,
}

impl<'a, P, W, const VISCOUS: bool> OfLaw<'a, P, W, VISCOUS> {
    /// The operation on each block.
    pub fn new(pass: &'a P) -> Self {
        Self { pass, law: PhantomData }
    }
}

/// `F`, the tissue, and what it answers to `F`.
#[inline(always)]
pub fn respond<S: Real, L: Lanes<Real = S>, W: Law, const VISCOUS: bool>(
    tets: &Block<'_, S>,
    x: &[Point<S>],
    start_strain: &[[Eight<S>; 6]],
    dt: f64,
) -> (Mat3<L>, Tissue<L>, Response<L>) {
    let f = deformation_gradient(&tets.corners::<L>(x).x, &tets.shape());
    let tissue = Tissue::new(W::MODEL, &tets.material(), dt);
    let response = if VISCOUS && tets.is_viscous() {
        let start: Voigt<L> = load_rows(start_strain[tets.index].as_flattened(), tets.lane);
        tissue.respond_by::<W>(&f, Some(&start))
    } else {
        tissue.respond_by::<W>(&f, None)
    };
    (f, tissue, response)
}
