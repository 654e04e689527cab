//! The warm-start reset: multipliers from positions alone.
//!
//! ```text
//! l_j = -C_j(x)/a~_j: the residual of every constraint is zero, and J^T l = dt^2 f(x)
//! ```
//!
//! Kept multipliers carry the forces of the last step. Where those mean nothing any more, because the
//! caller has put vertices elsewhere or multipliers of a connected part are NaN, these take their place.
//! After a rejected step they must not: see [`crate::solver::step::guard`].
//!
//! Pins that are let go keep the history, however hard they pulled. Forgetting it then (all
//! multipliers zero) was measured over 20 frames against 100 to 200 sweeps per step, a block of 324
//! tetrahedra: at 10 x 2 and 4 x 5 the error of the motion after a large release falls by 1 to 10 %
//! of itself, and after the release of one settled pin it grows to 4 to 9 times itself.

#![allow(unsafe_code)]

use std::marker::PhantomData;

use crate::elements::forms::{Form, pass_by_form, with_form};
use crate::elements::kinds::{Kind, XpbdBlock};
use crate::elements::{deformation_gradient, green_strain};
use crate::layout::Part;
use crate::layout::{ElementSet, Moments};
use crate::model::for_each_kind;
use crate::scalar::Real;
use crate::scalar::lanes::{Eight, Lanes, Point};
use crate::solver::cpu::tets::{Block, TetPass, load_rows};
use crate::solver::cpu::threads::Shared;
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::strain::measure_strain;
use crate::state::State;

/// Takes the multipliers from the positions, as if the tissue had long been there: what is
/// viscous has relaxed.
pub fn restart<S: Real>(step: &Step<'_, S>, data: &mut StepData<S>, state: &mut State<S>) {
    data.read_positions(step.layout, &state.positions);
    let constants = &mut data.constants;
    // Tissue has long been there: nothing has moved in the step before.
    constants.previous.copy_from_slice(&data.points);
    let (workers, strains) = (&constants.workers, &mut constants.start_strain);
    measure_strain(workers, step.layout, None, &data.points, strains);
    for part in step.layout.parts.iter() {
        constitutive_multipliers(step, data, part, &mut state.multipliers);
    }
    state.multiplier_dt = step.dt;
}

/// [`super::stage::XpbdStage::RepairMultipliers`].
pub fn repair_multipliers<S: Real>(step: &Step<'_, S>, data: &StepData<S>, multipliers: &mut [S]) {
    for part in step.layout.parts.iter() {
        let mut of_part = part.multipliers.iter().map(|range| &multipliers[range.clone()]);
        if !of_part.all(|range| range.iter().all(|l| l.is_finite())) {
            constitutive_multipliers(step, data, part, multipliers);
        }
    }
}

fn constitutive_multipliers<S: Real>(
    step: &Step<'_, S>,
    data: &StepData<S>,
    part: &Part,
    l: &mut [S],
) {
    let model = step.layout;
    let x = &data.points;
    let shared = Shared::new(l);
    for (kind, set) in model.tet_sets.iter().enumerate() {
        let start_strain = &data.constants.start_strain[kind];
        with_form!(set.form, F => {
            let form = PhantomData::<F>;
            let pass = Constitutive { x, start_strain, dt: step.dt, l: &shared, form };
            for blocks in part.blocks(kind) {
                data.constants.workers.pass(model, set, blocks, &pass);
            }
        });
    }
    let moments = data.constants.moments(step);
    for_each_kind!(model, set => constitutive_elements(set, &moments, part, x, l));
    // The stress of a tetrahedron too large for the number format is unknown.
    for range in &part.multipliers {
        for l in l[range.clone()].iter_mut().filter(|l| !l.is_finite()) {
            *l = S::ZERO;
        }
    }
}

/// Of a part's elements of one kind.
fn constitutive_elements<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    moments: &Moments<'_, S>,
    part: &Part,
    x: &[Point<S>],
    l: &mut [S],
) {
    let squared = S::from_f64(moments.dt * moments.dt);
    for i in set.of_part(part) {
        let element = set.element::<S>(i, moments);
        let places = set.places(i, x);
        let pulls = element.constitutive(&places, element.compliance(squared));
        l[set.multipliers(i)].copy_from_slice(&pulls);
    }
}

struct Constitutive<'a, S, F> {
    x: &'a [Point<S>],
    start_strain: &'a [[Eight<S>; 6]],
    dt: f64,
    l: &'a Shared<'a, S>,
    form: PhantomData<F>,
}

impl<S: Real, F> Constitutive<'_, S, F> {
    #[inline(always)]
    fn store<L: Lanes<Real = S>, const N: usize>(&self, tets: &Block<'_, S>)
    where
        F: Form<N>,
    {
        let (corners, shape) = (tets.corners::<L>(self.x), tets.shape());
        let (material, volume) = (tets.material::<L>(), tets.volume::<L>());
        let step_volume = volume * L::from_f64(self.dt * self.dt);
        let elastic: [L; N] = F::constitutive(&corners.x, &shape, &material, step_volume);
        // SAFETY: every block has multipliers of its own and is worked on once.
        unsafe { tets.store_multipliers(tets.set.multiplier_offset, self.l, elastic) };
        if tets.is_viscous() {
            let mut change = green_strain::strain(&deformation_gradient(&corners.x, &shape));
            let start: [L; 6] = load_rows(self.start_strain[tets.index].as_flattened(), tets.lane);
            for p in 0..6 {
                change[p] -= start[p];
            }
            // Kelvin-Voigt: V eta dt takes the place of V dt^2.
            let scale = volume * material.viscosity * L::from_f64(self.dt);
            let (lambda, mu) = (material.lame_lambda, material.lame_mu);
            let viscous = green_strain::constitutive_multipliers(&change, lambda, mu, scale);
            // SAFETY: as above.
            unsafe { tets.store_multipliers(tets.set.viscous_offset, self.l, viscous) };
        }
    }
}

pass_by_form!(Constitutive store);

#[cfg(test)]
mod tests {
    use super::super::loads::load_multipliers;
    use super::repair_multipliers;
    use crate::material::MaterialModel::{SaintVenantKirchhoff, StableNeoHookean};
    use crate::settings::{NeoHookean, SolverSettings};
    use crate::solver::Inputs;
    use crate::solver::probe::{begun, everything, quiet, shake};
    use crate::solver::step::gradient::load_forces;

    /// In the middle of a motion, so that viscous tissue resists: `J^T l = dt^2 f(x)`, every form, springs
    /// and attachments, where one multiplier has been NaN.
    #[test]
    fn repaired_multipliers_are_the_forces_of_the_elements() {
        for neo_hookean in [NeoHookean::Stretch, NeoHookean::Pair] {
            let settings = SolverSettings { neo_hookean, ..SolverSettings::xpbd() };
            let model = everything(&settings, [SaintVenantKirchhoff, StableNeoHookean], 0.4);
            let inputs = Inputs::default();
            let step = quiet(&model, &inputs, &settings, 1e-2);
            let mut data = begun(&step, &model.rest_positions).data;
            shake(&mut data.points);
            let mut multipliers = vec![0.0; model.multiplier_count];
            multipliers[3] = f64::NAN;
            repair_multipliers(&step, &data, &mut multipliers);
            let [mut given, mut expected] = [(); 2].map(|()| data.loads.clone());
            let (constants, x) = (&data.constants, &data.points);
            load_multipliers(constants, &step, x, &multipliers, &mut given);
            let moments = constants.moments(&step);
            load_forces::<_, false>(constants, &step, &moments, 0, x, &mut expected);
            let largest = expected.iter().map(|load| load.vec3().length()).fold(0.0, f64::max);
            for (given, expected) in given.iter().zip(&expected) {
                let apart = (given.vec3() - expected.vec3()).length();
                // A hundred roundings of stresses that may cancel.
                assert!(apart < 1e-12 * largest, "{neo_hookean:?}: {apart:e} of {largest:e}");
            }
            // Viscosity is no small part of it.
            assert!(model.tet_sets.iter().all(|set| set.viscous));
        }
    }
}
