//! Forces of all elements, in one pass without colours.
//!
//! ```text
//! load_i += h^2 f_i(x),   E_start = E(x)      viscosity acts against the change of the Green strain E since the last pass
//! bound_i += h^2 rho(K_e) B(F)/B(I)           of the stiffness, see `present`
//! ```
#![allow(unsafe_code)]

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use crate::elements::law::{LAWS, Law};
use crate::elements::{deformation_gradient, green_strain, internal_forces};
use crate::layout::{Layout, Moments, PIECE_BLOCKS, Part};
use crate::material::MaterialModel;
use crate::scalar::Real;
use crate::scalar::lanes::{Eight, Lanes, Point};
use crate::solver::cpu::tets::{Block, TetPass, load_rows};
use crate::solver::cpu::threads::Shared;
use crate::solver::step::data::{Step, StepConstants};
use crate::solver::step::gradient::add_elements;
use crate::solver::step::law::{OfLaw, with_tissue};
use crate::solver::step::recovered::load_recovered;
use crate::solver::step::strain::is_recovered;
use crate::solver::step::tissue::Tissue;

use super::present::AtRest;

/// The blocks of each part, law by law, in the pieces of the layout: a thread does all of a piece.
#[derive(Clone, Debug)]
pub struct Pieces(Vec<Vec<(usize, Range<usize>)>>);

impl Pieces {
    /// Of a layout in pieces.
    pub fn new<S: Real>(layout: &Layout<S>) -> Self {
        let of_part = |part: &Part| {
            let of_law = |law: usize| {
                let pieces = part.blocks(law).flat_map(|blocks| {
                    let end = blocks.end;
                    let starts = blocks.step_by(PIECE_BLOCKS);
                    starts.map(move |start| start..(start + PIECE_BLOCKS).min(end))
                });
                pieces.map(move |blocks| (law, blocks))
            };
            (0..LAWS).flat_map(of_law).collect()
        };
        Self(layout.parts.iter().map(of_part).collect())
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.0.iter().map(|pieces| size_of_val(&pieces[..]) + size_of_val(pieces)).sum()
    }

    /// Per copy of a part `h^2` times the force of its elements, `h` the step's, and the bound of their stiffness where
    /// `looks`; viscous tissue goes on from `x`. Returns whether a tetrahedron is inside out.
    pub fn load<S: Real>(
        &self,
        constants: &mut StepConstants<S>,
        step: &Step<'_, S>,
        moments: &Moments<'_, S>,
        (number, looks): (usize, bool),
        (x, at_rest): (&[Point<S>], &AtRest<S>),
        loads: &mut [Point<S>],
    ) -> bool {
        let (layout, pieces) = (step.layout, &self.0[number]);
        let part = &layout.parts[number];
        loads[part.copies.clone()].fill(Point::default());
        let workers = &constants.workers;
        let inverted = &AtomicBool::new(false);
        let shared = Shared::new(loads);
        let strains = constants.start_strain.each_mut().map(|strains| Shared::new(strains));
        workers.each(pieces.len(), 1, |range| {
            for (law, blocks) in &pieces[range] {
                let set = &layout.tet_sets[*law];
                if is_recovered(layout, set) {
                    continue;
                }
                let at_rest = &at_rest.tets[*law];
                let (strains, loads, dt) = (strains[*law], &shared, step.dt);
                let forces = Forces { x, at_rest, strains, dt, loads, inverted, looks };
                with_tissue!(set, L, VISCOUS => {
                    let pass = OfLaw::<_, L, VISCOUS>::new(&forces);
                    workers.piece(layout, set, blocks.clone(), &pass);
                });
            }
        });
        let at_rest = looks.then_some(&at_rest.tets[MaterialModel::StableNeoHookean as usize][..]);
        let of_recovered = load_recovered(constants, step, number, x, (true, at_rest), loads);
        add_elements(layout, moments, part, x, loads);
        of_recovered || inverted.load(Relaxed)
    }
}

struct Forces<'a, S> {
    x: &'a [Point<S>],
    at_rest: &'a [Eight<S>],
    strains: Shared<'a, [Eight<S>; 6]>,
    dt: f64,
    loads: &'a Shared<'a, Point<S>>,
    inverted: &'a AtomicBool,
    looks: bool,
}

impl<S: Real, W: Law, const VISCOUS: bool> TetPass<S> for OfLaw<'_, Forces<'_, S>, W, VISCOUS> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let Forces { x, at_rest, strains, dt, loads, inverted, looks } = *self.pass;
        let shape = tets.shape::<L>();
        let f = deformation_gradient(&tets.corners::<L>(x).x, &shape);
        let tissue = Tissue::new(W::MODEL, &tets.material(), dt);
        let piola = if VISCOUS && tets.is_viscous() {
            // SAFETY: every block has a place of its own and is worked on once.
            let place = unsafe { strains.at(tets.index) };
            let start = load_rows(place.as_flattened(), tets.lane);
            for (p, strain) in green_strain::strain(&f).into_iter().enumerate() {
                strain.store(&mut place[p], tets.lane);
            }
            tissue.respond_by::<W>(&f, Some(&start)).piola
        } else {
            tissue.respond_by::<W>(&f, None).piola
        };
        let squared = L::from_f64(dt * dt);
        let forces = internal_forces(&piola, &shape, tets.volume::<L>() * squared);
        if !L::all(L::ZERO.less(f.determinant())) {
            inverted.store(true, Relaxed);
        }
        let mut bound = L::ZERO;
        if looks {
            let stiffness = W::stiffness(&f, tissue.lame_lambda, tissue.lame_mu);
            bound = L::load(&at_rest[tets.index], tets.lane) * stiffness * squared;
        }
        // SAFETY: the piece has copies of its own, and one thread does all of it.
        unsafe { tets.add_bound_in_order(loads, &forces, bound) };
    }
}
