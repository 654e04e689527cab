//! The gradient of the incremental potential without inertia, and the bound of its curvature.
#![allow(unsafe_code)]

use super::contacts::Bound;
use super::data::{Step, StepConstants};
use super::law::{OfLaw, respond, with_tissue};
use crate::elements::kinds::{Energy, Kind};
use crate::elements::law::Law;
use crate::elements::{CornerLoad, internal_forces, shape_gradients};
use crate::layout::Part;
use crate::layout::{ElementSet, Layout, Moments};
use crate::model::for_each_kind;
use crate::scalar::lanes::{Eight, Lanes, Point};
use crate::scalar::{Real, Scalar};
use crate::solver::cpu::tets::{Block, TetPass};
use crate::solver::cpu::threads::Shared;

/// Per copy of a part `dt^2` times the force of its elements, and the bound of their curvature: the gradient of
/// `Phi` without inertia, in the places that the rebase uses as well. Without `BOUND` the bounds are
/// zero.
pub fn load_forces<S: Real, const BOUND: bool>(
    constants: &StepConstants<S>,
    step: &Step<'_, S>,
    moments: &Moments<'_, S>,
    number: usize,
    x: &[Point<S>],
    loads: &mut [Point<S>],
) {
    let model = step.layout;
    let part = &model.parts[number];
    loads[part.copies.clone()].fill(Point::default());
    for color in &part.colors {
        let shared = Shared::new(loads);
        for (kind, set) in model.tet_sets.iter().enumerate() {
            let blocks = color.blocks[kind].start as usize..color.blocks[kind].end as usize;
            let start_strain = &constants.start_strain[kind];
            let forces = Forces::<_, BOUND> { x, start_strain, dt: step.dt, loads: &shared };
            with_tissue!(set, L, VISCOUS => {
                let pass = OfLaw::<_, L, VISCOUS>::new(&forces);
                constants.workers.pass(model, set, blocks, &pass);
            });
        }
    }
    add_elements(model, moments, part, x, loads);
    let bound = if BOUND { Bound::Here } else { Bound::Without };
    constants.contacts.add_forces(&step.contact(), number, x, bound, loads);
}

/// Of a part's elements that are no tetrahedra.
pub fn add_elements<S: Real>(
    layout: &Layout<S>,
    moments: &Moments<'_, S>,
    part: &Part,
    x: &[Point<S>],
    loads: &mut [Point<S>],
) {
    for_each_kind!(layout, set => add_forces(set, moments, part, x, loads));
}

/// Of a part's elements of one kind.
fn add_forces<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    moments: &Moments<'_, S>,
    part: &Part,
    x: &[Point<S>],
    loads: &mut [Point<S>],
) {
    let squared = S::from_f64(moments.dt * moments.dt);
    for i in set.of_part(part) {
        let element = set.element::<S>(i, moments);
        let forces = element.forces(&set.places(i, x));
        let mass_bound = squared * element.curvature();
        for (copy, force) in set.copies[i].into_iter().zip(forces) {
            add_load(loads, copy, &CornerLoad { impulse: force * squared, mass_bound });
        }
    }
}

struct Forces<'a, S, const BOUND: bool> {
    x: &'a [Point<S>],
    start_strain: &'a [[Eight<S>; 6]],
    dt: f64,
    loads: &'a Shared<'a, Point<S>>,
}

impl<S: Real, W: Law, const BOUND: bool, const VISCOUS: bool> TetPass<S>
    for OfLaw<'_, Forces<'_, S, BOUND>, W, VISCOUS>
{
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let Forces { x, start_strain, dt, loads: into } = *self.pass;
        let (f, tissue, response) = respond::<S, L, W, VISCOUS>(tets, x, start_strain, dt);
        let shape = tets.shape::<L>();
        let volume = tets.volume::<L>() * L::from_f64(dt * dt);
        let forces = internal_forces(&response.piola, &shape, volume);
        let g = shape_gradients(&shape);
        let mut loads = [CornerLoad::default(); 4];
        for corner in 0..4 {
            let mass_bound =
                if BOUND { volume * tissue.curvature_of::<W>(&f, g[corner]) } else { L::ZERO };
            loads[corner] = CornerLoad { impulse: forces[corner], mass_bound };
        }
        // SAFETY: constraints of one colour share no copy, and every block is worked on once.
        unsafe { tets.add(into, &points(&loads)) };
    }
}

/// A load as a point: impulse [N s^2] and bound [kg].
#[inline(always)]
pub fn as_point<L: Scalar>(load: &CornerLoad<L>) -> Point<L> {
    Point::new(load.impulse, load.mass_bound)
}

/// Adds to a copy what acts on it.
pub fn add_load<S: Real>(loads: &mut [Point<S>], copy: u32, load: &CornerLoad<S>) {
    loads[copy as usize].add(as_point(load));
}

#[inline(always)]
pub fn points<L: Scalar>(loads: &[CornerLoad<L>; 4]) -> [Point<L>; 4] {
    [as_point(&loads[0]), as_point(&loads[1]), as_point(&loads[2]), as_point(&loads[3])]
}
