//! One colour of a sweep: loads a constraint's corners, solves it, stores what has changed.
#![allow(unsafe_code)]

use std::marker::PhantomData;

use crate::elements::forms::{Form, pass_by_form, with_form};
use crate::elements::green_strain;
use crate::elements::kinds::{Kind, XpbdBlock};
use crate::layout::{ElementSet, Moments};
use crate::model::for_each_kind;
use crate::scalar::lanes::{Lanes, Point};
use crate::scalar::{Real, Vec3};
use crate::settings::{RelaxationForm, SolverSettings};
use crate::solver::cpu::tets::{Block, TetPass, load_rows};
use crate::solver::cpu::threads::Shared;
use crate::solver::step::data::{Step, StepConstants};

/// How far a solve is over-relaxed: the multipliers by one factor, the positions by another.
#[derive(Clone, Copy)]
struct Relaxation<S> {
    multipliers: S,
    positions: S,
}

impl<S: Real> Relaxation<S> {
    fn new(settings: &SolverSettings) -> Self {
        let omega = S::from_f64(settings.relaxation);
        match settings.relaxation_form {
            RelaxationForm::Consistent => Self { multipliers: omega, positions: omega },
            RelaxationForm::Published => Self { multipliers: S::ONE, positions: omega },
        }
    }

    /// The result of a correction: multipliers and positions after it.
    #[inline(always)]
    fn apply<L: Lanes<Real = S>, const N: usize>(
        self,
        (l, x): (&[L; N], &[Vec3<L>; 4]),
        (dl, dx): (&[L; N], &[Vec3<L>; 4]),
    ) -> ([L; N], [Vec3<L>; 4]) {
        let (mut l, mut x) = (*l, *x);
        let [of_l, of_x] = [L::splat(self.multipliers), L::splat(self.positions)];
        for p in 0..N {
            l[p] += of_l * dl[p];
        }
        for corner in 0..4 {
            x[corner] += dx[corner] * of_x;
        }
        (l, x)
    }
}

/// Data that all solves of a colour share.
struct Sweep<'a, S> {
    /// Copies, or vertices where nothing is split; each carries its inverse mass.
    points: Shared<'a, Point<S>>,
    multipliers: Shared<'a, S>,
    dt: f64,
    relaxation: Relaxation<S>,
}

/// Solves all constraints of one colour; they share no copy, those of one cluster excepted, which are solved in their order.
pub fn solve_color<S: Real>(
    constants: &StepConstants<S>,
    step: &Step<'_, S>,
    points: &mut [Point<S>],
    multipliers: &mut [S],
    color: usize,
) {
    let model = step.layout;
    let mut sweep = Sweep {
        points: Shared::new(points),
        multipliers: Shared::new(multipliers),
        dt: step.dt,
        relaxation: Relaxation::new(step.settings),
    };
    let workers = &constants.workers;
    for (set, strains) in model.tet_sets.iter().zip(&constants.start_strain) {
        let viscous = Viscous { sweep: &sweep, start: strains };
        with_form!(set.form, F => {
            let elastic = Elastic { sweep: &sweep, form: PhantomData::<F> };
            match &set.clusters {
                // Within a cluster a tetrahedron has both its constraints solved before the next begins, as on a device.
                Some(clusters) if set.viscous => workers.each_cluster(clusters, color, |blocks| {
                    for block in blocks {
                        workers.piece(model, set, block..block + 1, &elastic);
                        workers.piece(model, set, block..block + 1, &viscous);
                    }
                }),
                _ => workers.color_pass(model, set, color, &elastic),
            }
        });
        if set.viscous && set.clusters.is_none() {
            workers.pass(model, set, set.color(color), &viscous);
        }
    }
    let moments = constants.moments(step);
    for_each_kind!(model, set => sweep.solve_elements(set, &moments, color));
}

struct Elastic<'a, S, F> {
    sweep: &'a Sweep<'a, S>,
    form: PhantomData<F>,
}

impl<S: Real, F> Elastic<'_, S, F> {
    #[inline(always)]
    fn solve<L: Lanes<Real = S>, const N: usize>(&self, tets: &Block<'_, S>)
    where
        F: Form<N>,
    {
        let sweep = self.sweep;
        let material = tets.material::<L>();
        let step_volume = tets.volume::<L>() * L::from_f64(sweep.dt * sweep.dt);
        // SAFETY: constraints of one colour share no copy, or but with others of their cluster, which one thread works on; every
        // block is worked on once.
        let corners = unsafe { tets.copies::<L>(&sweep.points) };
        // SAFETY: every block has multipliers of its own.
        let l: [L; N] =
            unsafe { tets.shared_multipliers(tets.set.multiplier_offset, &sweep.multipliers) };
        let (x, w) = (&corners.x, &corners.w);
        let change = F::solve(x, w, &tets.shape(), &l, &material, step_volume);
        let (dl, dx) = (&change.multipliers, &change.positions);
        let (l, x) = sweep.relaxation.apply((&l, x), (dl, dx));
        // SAFETY: as above.
        unsafe {
            tets.store(&sweep.points, &x, w);
            tets.store_multipliers(tets.set.multiplier_offset, &sweep.multipliers, l);
        }
    }
}
pass_by_form!(Elastic solve);

/// Kelvin-Voigt as an energy: `eta V |C - C_n|_D^2/(2 dt)`, so `a~ = D^-1/(V eta dt)`.
struct Viscous<'a, S> {
    sweep: &'a Sweep<'a, S>,
    start: &'a [[crate::scalar::lanes::Eight<S>; 6]],
}

impl<S: Real> TetPass<S> for Viscous<'_, S> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        if !tets.is_viscous() {
            return;
        }
        let material = tets.material::<L>();
        // SAFETY: constraints of one colour share no copy, or but with others of their cluster, which one thread works on; every
        // block is worked on once.
        let corners = unsafe { tets.copies::<L>(&self.sweep.points) };
        let target: [L; 6] = load_rows(self.start[tets.index].as_flattened(), tets.lane);
        let dt = L::from_f64(self.sweep.dt);
        let scale = L::ONE / (tets.volume::<L>() * material.viscosity * dt);
        let compliance = material.compliance.scaled(scale);
        let is_viscous = L::ZERO.less(material.viscosity);
        // SAFETY: every block has multipliers of its own.
        let l: [L; 6] =
            unsafe { tets.shared_multipliers(tets.set.viscous_offset, &self.sweep.multipliers) };
        let (x, w) = (&corners.x, &corners.w);
        let change = green_strain::solve(x, w, &tets.shape(), &l, Some(&target), &compliance);
        let (mut dl, mut dx) = (change.multipliers, change.positions);
        for p in 0..6 {
            dl[p] = L::select(is_viscous, dl[p], L::ZERO);
        }
        for corner in 0..4 {
            for axis in 0..3 {
                dx[corner][axis] = L::select(is_viscous, dx[corner][axis], L::ZERO);
            }
        }
        let (l, x) = self.sweep.relaxation.apply((&l, x), (&dl, &dx));
        // SAFETY: as above.
        unsafe {
            tets.store(&self.sweep.points, &x, w);
            tets.store_multipliers(tets.set.viscous_offset, &self.sweep.multipliers, l);
        }
    }
}

impl<S: Real> Sweep<'_, S> {
    /// Elements of one kind, one by one.
    fn solve_elements<K: Kind<N, M>, const N: usize, const M: usize>(
        &mut self,
        set: &ElementSet<S, K, N, M>,
        moments: &Moments<'_, S>,
        color: usize,
    ) {
        let squared = S::from_f64(self.dt * self.dt);
        for i in set.color(color) {
            let element = set.element::<S>(i, moments);
            let copies = set.copies[i];
            // SAFETY: no other thread works on the points now.
            let ends = copies.map(|copy| unsafe { *self.points.at(copy as usize) });
            // SAFETY: nor on the multipliers.
            let l = unsafe { self.multipliers.range(set.multipliers(i)) };
            let now: [S; M] = std::array::from_fn(|p| l[p]);
            let (x, w) = (ends.map(Point::vec3), ends.map(|end| end.w));
            let compliance = element.compliance(squared);
            let (changes, moves) = element.solve(&x, &w, &now, compliance);
            for (l, change) in l.iter_mut().zip(changes) {
                *l += self.relaxation.multipliers * change;
            }
            for (copy, moved) in copies.into_iter().zip(moves) {
                self.move_copy(copy, moved);
            }
        }
    }

    fn move_copy(&mut self, copy: u32, change: Vec3<S>) {
        // SAFETY: no other thread works on the points now.
        let point = unsafe { self.points.at(copy as usize) };
        point.set_vec3(point.vec3() + change * self.relaxation.positions);
    }
}

#[inline(always)]
pub fn read_vec3<S: Copy>(values: &[S], at: usize) -> Vec3<S> {
    Vec3 { x: values[at], y: values[at + 1], z: values[at + 2] }
}
