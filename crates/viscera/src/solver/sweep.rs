//! One colour of a sweep: loads a constraint's corners, solves it, stores what has changed.

use super::Inputs;
use super::cpu::Step;
use crate::elements::{TetForm, attachment, green_strain, neo_hookean_pair};
use crate::elements::{neo_hookean_stretch, spring};
use crate::model::{Model, TetSet};
use crate::scalar::{Real, Vec3};
use crate::settings::{RelaxationForm, SolverSettings};

/// How far a solve is over-relaxed: the multipliers by one factor, the positions by another.
#[derive(Clone, Copy)]
pub(super) struct Relaxation<S> {
    multipliers: S,
    positions: S,
}

impl<S: Real> Relaxation<S> {
    /// From the settings.
    pub fn new(settings: &SolverSettings) -> Self {
        let omega = S::from_f64(settings.relaxation);
        match settings.relaxation_form {
            RelaxationForm::Consistent => Self { multipliers: omega, positions: omega },
            RelaxationForm::Published => Self { multipliers: S::ONE, positions: omega },
        }
    }
}

/// One colour's solves.
pub(super) struct Sweep<'a, S> {
    /// Copies, or positions where nothing is split.
    pub points: &'a mut [Vec3<S>],
    pub multipliers: &'a mut [S],
    pub weights: &'a [S],
    pub dt: f64,
    pub relaxation: Relaxation<S>,
}

impl<S: Real> Sweep<'_, S> {
    /// Solves the colour's constraints one after the other.
    pub fn solve(
        mut self,
        step: &Step<'_, S>,
        start_strain: &[Vec<green_strain::Voigt<S>>; 2],
        color: usize,
    ) {
        let model = step.model;
        for (set, strains) in model.tet_sets().into_iter().zip(start_strain) {
            let range = set.color_offsets[color]..set.color_offsets[color + 1];
            for tet in range {
                self.solve_tet(model, set, strains, tet as usize);
            }
        }
        self.solve_springs(model, color);
        self.solve_attachments(model, step.inputs, color);
    }

    #[inline]
    fn solve_tet(
        &mut self,
        model: &Model<S>,
        set: &TetSet<S>,
        start_strain: &[green_strain::Voigt<S>],
        tet: usize,
    ) {
        let copies = set.copies[tet];
        let [a, b, c, d] = set.vertices[tet];
        let weight = |v: u32| self.weights[v as usize];
        let w = [weight(a), weight(b), weight(c), weight(d)];
        let shape = &set.inverse_rest_shape[tet];
        let material = &model.materials[set.material[tet] as usize];
        let step_volume = set.rest_volume[tet] * S::from_f64(self.dt * self.dt);
        let x = corners(self.points, copies);
        let at = set.multiplier_offset + set.form.multiplier_count() * tet;
        let (lambda, mu) = (material.lame_lambda, material.lame_mu);
        match set.form {
            TetForm::GreenStrain => {
                let l = read(self.multipliers, at);
                let (compliance, scale) = (&material.compliance, S::ONE / step_volume);
                let rest = [S::ZERO; 6];
                let change = green_strain::solve(&x, &w, shape, &l, &rest, compliance, scale);
                self.apply(at, &copies, &change.multipliers, &change.positions);
            }
            TetForm::NeoHookeanPair => {
                let l = read(self.multipliers, at);
                let change = neo_hookean_pair::solve(&x, &w, shape, &l, lambda, mu, step_volume);
                self.apply(at, &copies, &change.multipliers, &change.positions);
            }
            TetForm::NeoHookeanStretch => {
                let l = read(self.multipliers, at);
                let change = neo_hookean_stretch::solve(&x, &w, shape, &l, lambda, mu, step_volume);
                self.apply(at, &copies, &change.multipliers, &change.positions);
            }
        }
        let Some(viscous_offset) = set.viscous_offset else { return };
        if material.viscosity > S::ZERO {
            // Kelvin-Voigt as an energy: eta V |C - C_n|_D^2 / (2 dt), so a~ = D^-1/(V eta dt).
            let at = viscous_offset + 6 * tet;
            let l = read(self.multipliers, at);
            let x = corners(self.points, copies);
            let scale = S::ONE / (set.rest_volume[tet] * material.viscosity * S::from_f64(self.dt));
            let (target, compliance) = (&start_strain[tet], &material.compliance);
            let change = green_strain::solve(&x, &w, shape, &l, target, compliance, scale);
            self.apply(at, &copies, &change.multipliers, &change.positions);
        }
    }

    fn solve_springs(&mut self, model: &Model<S>, color: usize) {
        let springs = &model.springs;
        for i in springs.color_offsets[color] as usize..springs.color_offsets[color + 1] as usize {
            let copies = springs.copies[i];
            let x = copies.map(|copy| self.points[copy as usize]);
            let w = springs.vertices[i].map(|v| self.weights[v as usize]);
            let at = springs.multiplier_offset + i;
            let compliance_tilde = S::ONE / (springs.stiffness[i] * S::from_f64(self.dt * self.dt));
            let rest_length = springs.rest_length[i];
            let l = self.multipliers[at];
            let (change, moves) = spring::solve(&x, &w, rest_length, l, compliance_tilde);
            self.apply(at, &copies, &[change], &moves);
        }
    }

    fn solve_attachments(&mut self, model: &Model<S>, inputs: &Inputs<S>, color: usize) {
        let set = &model.attachments;
        let anchors = inputs.anchors_of(model);
        for i in set.color_offsets[color] as usize..set.color_offsets[color + 1] as usize {
            let copy = set.copies[i];
            let x = self.points[copy as usize];
            let w = self.weights[set.vertices[i] as usize];
            let at = set.multiplier_offset + 3 * i;
            let compliance_tilde = S::ONE / (set.stiffness[i] * S::from_f64(self.dt * self.dt));
            let anchor = anchors[set.order[i] as usize];
            let l = read_vec3(self.multipliers, at);
            let (change, moved) = attachment::solve(x, w, anchor, l, compliance_tilde);
            self.apply(at, &[copy], &change.to_array(), &[moved]);
        }
    }

    #[inline(always)]
    fn apply<const N: usize, const M: usize>(
        &mut self,
        at: usize,
        copies: &[u32; N],
        multipliers: &[S; M],
        moves: &[Vec3<S>; N],
    ) {
        for (l, change) in self.multipliers[at..at + M].iter_mut().zip(multipliers) {
            *l += self.relaxation.multipliers * *change;
        }
        for (copy, change) in copies.iter().zip(moves) {
            self.points[*copy as usize] += *change * self.relaxation.positions;
        }
    }
}

#[inline(always)]
pub(super) fn read<S: Real, const N: usize>(values: &[S], at: usize) -> [S; N] {
    let mut numbers = [S::ZERO; N];
    numbers.copy_from_slice(&values[at..at + N]);
    numbers
}

/// Positions of a tetrahedron's corners.
#[inline(always)]
pub(super) fn corners<S: Real>(points: &[Vec3<S>], [a, b, c, d]: [u32; 4]) -> [Vec3<S>; 4] {
    [points[a as usize], points[b as usize], points[c as usize], points[d as usize]]
}

#[inline(always)]
pub(super) fn read_vec3<S: Copy>(values: &[S], at: usize) -> Vec3<S> {
    Vec3 { x: values[at], y: values[at + 1], z: values[at + 2] }
}
