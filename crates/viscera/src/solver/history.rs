//! The start of a new history: multipliers from positions alone.
//!
//! ```text
//! l_j = -C_j(x)/a~_j: the residual of every constraint is zero, and J^T l = dt^2 f(x)
//! ```
//!
//! Kept multipliers tell where the body comes from. Where that means nothing any more, because the
//! caller has put vertices elsewhere or the multipliers are no numbers, these take their place.
//! After a rejected step they must not: see [`super::guard`].
//!
//! Pins that are let go keep the history, however hard they pulled. Forgetting it then (all
//! multipliers zero) was measured over 20 frames against 100 to 200 sweeps per step, a block of 324
//! tetrahedra: at 10 x 2 and 4 x 5 the error of the motion after a large release falls by 1 to 10 %
//! of itself, and after the release of one settled pin it grows to 4 to 9 times itself.

use super::cpu::{Step, Workspace};
use super::sweep::corners;
use crate::elements::{
    TetForm, attachment, deformation_gradient, green_strain, neo_hookean_pair, neo_hookean_stretch,
    spring,
};
use crate::model::TetSet;
use crate::scalar::Real;
use crate::state::State;

impl<S: Real> Workspace<S> {
    /// Takes the multipliers from the positions, as if the tissue had long been there: what is
    /// viscous has relaxed.
    pub(super) fn restart(&mut self, step: &Step<'_, S>, state: &mut State<S>) {
        self.measure_strain(step, state);
        self.constitutive_multipliers(step, state);
        state.multiplier_dt = step.dt;
    }

    /// [`super::plan::Stage::RepairMultipliers`].
    pub(super) fn repair_multipliers(&self, step: &Step<'_, S>, state: &mut State<S>) {
        if !state.multipliers.iter().all(|l| l.is_finite()) {
            self.constitutive_multipliers(step, state);
        }
    }

    fn constitutive_multipliers(&self, step: &Step<'_, S>, state: &mut State<S>) {
        let model = step.model;
        for (set, strains) in model.tet_sets().into_iter().zip(&self.start_strain) {
            for tet in 0..set.len() {
                tet_multipliers(step, set, strains, tet, state);
            }
        }
        let (x, l) = (&state.positions, &mut state.multipliers);
        let squared = S::from_f64(step.dt * step.dt);
        let springs = &model.springs;
        for (i, ends) in springs.vertices.iter().enumerate() {
            let ends = ends.map(|v| x[v as usize]);
            let compliance_tilde = S::ONE / (springs.stiffness[i] * squared);
            l[springs.multiplier_offset + i] =
                spring::constitutive_multiplier(&ends, springs.rest_length[i], compliance_tilde);
        }
        let attachments = &model.attachments;
        let anchors = step.inputs.anchors_of(model);
        for (i, &v) in attachments.vertices.iter().enumerate() {
            let anchor = anchors[attachments.order[i] as usize];
            let compliance_tilde = S::ONE / (attachments.stiffness[i] * squared);
            let at = attachments.multiplier_offset + 3 * i;
            let pull =
                attachment::constitutive_multipliers(x[v as usize], anchor, compliance_tilde);
            l[at..at + 3].copy_from_slice(&pull.to_array());
        }
        // Of a tetrahedron too large for the number format nothing can be told.
        for l in l.iter_mut().filter(|l| !l.is_finite()) {
            *l = S::ZERO;
        }
    }
}

fn tet_multipliers<S: Real>(
    step: &Step<'_, S>,
    set: &TetSet<S>,
    start_strain: &[green_strain::Voigt<S>],
    tet: usize,
    state: &mut State<S>,
) {
    let material = &step.model.materials[set.material[tet] as usize];
    let (lambda, mu) = (material.lame_lambda, material.lame_mu);
    let step_volume = set.rest_volume[tet] * S::from_f64(step.dt * step.dt);
    let x = corners(&state.positions, set.vertices[tet]);
    let f = deformation_gradient(&x, &set.inverse_rest_shape[tet]);
    let count = set.form.multiplier_count();
    let at = set.multiplier_offset + count * tet;
    let l = &mut state.multipliers[at..at + count];
    match set.form {
        TetForm::GreenStrain => {
            let strain = green_strain::strain(&f);
            let values = green_strain::constitutive_multipliers(&strain, lambda, mu, step_volume);
            l.copy_from_slice(&values);
        }
        TetForm::NeoHookeanPair => l.copy_from_slice(&neo_hookean_pair::constitutive_multipliers(
            &f,
            lambda,
            mu,
            step_volume,
        )),
        TetForm::NeoHookeanStretch => l.copy_from_slice(
            &neo_hookean_stretch::constitutive_multipliers(&f, lambda, mu, step_volume),
        ),
    }
    let Some(viscous_offset) = set.viscous_offset else { return };
    let mut change = green_strain::strain(&f);
    for p in 0..6 {
        change[p] -= start_strain[tet][p];
    }
    // Kelvin-Voigt: V eta dt takes the place of V dt^2.
    let scale = set.rest_volume[tet] * material.viscosity * S::from_f64(step.dt);
    let values = green_strain::constitutive_multipliers(&change, lambda, mu, scale);
    let at = viscous_offset + 6 * tet;
    state.multipliers[at..at + 6].copy_from_slice(&values);
}
