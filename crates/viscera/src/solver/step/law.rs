//! Passes over tetrahedra of one law, which is matched once per set of blocks, outside the lanes.

use super::tissue::{Response, Tissue};
use crate::elements::deformation_gradient;
use crate::elements::green_strain::Voigt;
use crate::material::MaterialModel;
use crate::scalar::lanes::{Eight, Lanes, Point};
use crate::scalar::{Mat3, Real};
use crate::solver::cpu::tets::{Block, load_rows};

/// Evaluates an expression with the law of a set, and whether it is viscous, as constants: kernels of
/// one law each keep more of it in registers.
macro_rules! with_law {
    ($set:expr, $neo:ident, $viscous:ident => $result:expr) => {{
        let neo = $set.model == MaterialModel::StableNeoHookean;
        match (neo, $set.viscous) {
            (false, false) => with_law!(@ $neo false $viscous false $result),
            (false, true) => with_law!(@ $neo false $viscous true $result),
            (true, false) => with_law!(@ $neo true $viscous false $result),
            (true, true) => with_law!(@ $neo true $viscous true $result),
        }
    }};
    (@ $neo:ident $is_neo:literal $viscous:ident $is_viscous:literal $result:expr) => {{
        const $neo: bool = $is_neo;
        const $viscous: bool = $is_viscous;
        $result
    }};
}
pub(super) use with_law;

/// A pass over tetrahedra of one law.
pub struct OfLaw<'a, P, const NEO: bool, const VISCOUS: bool>(pub &'a P);

/// `F`, the tissue, and what it answers to `F`.
#[inline(always)]
pub fn respond<S: Real, L: Lanes<Real = S>, const NEO: bool, const VISCOUS: bool>(
    tets: &Block<'_, S>,
    x: &[Point<S>],
    start_strain: &[[Eight<S>; 6]],
    dt: f64,
) -> (Mat3<L>, Tissue<L>, Response<L>) {
    let f = deformation_gradient(&tets.corners::<L>(x).x, &tets.shape());
    let law =
        if NEO { MaterialModel::StableNeoHookean } else { MaterialModel::SaintVenantKirchhoff };
    let tissue = Tissue::new(law, &tets.material(), dt);
    let response = if VISCOUS && tets.is_viscous() {
        let start: Voigt<L> = load_rows(start_strain[tets.index].as_flattened(), tets.lane);
        tissue.respond(&f, Some(&start))
    } else {
        tissue.respond(&f, None)
    };
    (f, tissue, response)
}
