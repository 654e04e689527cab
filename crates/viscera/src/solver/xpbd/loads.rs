//! The loads of constraints on vertices: `J^T l` and the bound of its geometric stiffness, or the forces
//! of the elements and the bound of their curvature.
//!
//! Every copy of a vertex gathers what its constraints put on it, colour by colour, so that no two
//! threads meet and the order of the sum is always the same; the vertex is the sum of its copies.
#![allow(unsafe_code)]

use std::marker::PhantomData;

use crate::elements::forms::{Form, pass_by_form, with_form};
use crate::elements::green_strain;
use crate::elements::kinds::{Kind, XpbdBlock};
use crate::layout::{ElementSet, Moments};
use crate::model::for_each_kind;
use crate::scalar::Real;
use crate::scalar::lanes::{Lanes, Point};
use crate::solver::cpu::tets::{Block, TetPass};
use crate::solver::cpu::threads::Shared;
use crate::solver::step::data::{Step, StepConstants};
use crate::solver::step::gradient::{add_load, points};

/// `J^T l` at the vertices' positions `x`, into one place per copy.
pub fn load_multipliers<S: Real>(
    constants: &StepConstants<S>,
    step: &Step<'_, S>,
    x: &[Point<S>],
    multipliers: &[S],
    loads: &mut [Point<S>],
) {
    let model = step.layout;
    loads.fill(Point::default());
    for color in 0..model.color_count {
        let shared = Shared::new(loads);
        for set in &model.tet_sets {
            with_form!(set.form, F => {
                let pass = Loads { x, multipliers, loads: &shared, form: PhantomData::<F> };
                constants.workers.color_pass(model, set, color, &pass);
            });
        }
    }
    let moments = constants.moments(step);
    for_each_kind!(model, set => add_loads(set, &moments, x, multipliers, loads));
}

fn add_loads<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    moments: &Moments<'_, S>,
    x: &[Point<S>],
    multipliers: &[S],
    loads: &mut [Point<S>],
) {
    let squared = S::from_f64(moments.dt * moments.dt);
    for i in 0..set.len() {
        let (places, l) = (set.places(i, x), set.read(i, multipliers));
        let on_vertices = set.element::<S>(i, moments).loads(&places, &l, squared);
        for (copy, load) in set.copies[i].into_iter().zip(&on_vertices) {
            add_load(loads, copy, load);
        }
    }
}

struct Loads<'a, S, F> {
    x: &'a [Point<S>],
    multipliers: &'a [S],
    loads: &'a Shared<'a, Point<S>>,
    form: PhantomData<F>,
}

impl<S: Real, F> Loads<'_, S, F> {
    #[inline(always)]
    fn load<L: Lanes<Real = S>, const N: usize>(&self, tets: &Block<'_, S>)
    where
        F: Form<N>,
    {
        let set = tets.set;
        let (corners, shape) = (tets.corners::<L>(self.x), tets.shape());
        let l = tets.multipliers::<L, N>(set.multiplier_offset, self.multipliers);
        let mut loads = F::corner_loads(&corners.x, &shape, &l);
        if tets.is_viscous() {
            let l = tets.multipliers::<L, 6>(set.viscous_offset, self.multipliers);
            let more = green_strain::corner_loads(&corners.x, &shape, &l);
            for corner in 0..4 {
                loads[corner].impulse += more[corner].impulse;
                loads[corner].mass_bound += more[corner].mass_bound;
            }
        }
        // SAFETY: constraints of one colour share no copy, or but with others of their cluster, which one thread works on; every
        // block is worked on once.
        unsafe { tets.add(self.loads, &points(&loads)) };
    }
}

pass_by_form!(Loads load);
