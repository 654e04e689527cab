//! A step: its data, and the stages that all methods share.

pub mod balance;
pub mod contacts;
pub mod control;
pub mod data;
pub mod descent;
pub mod energy;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod gradient;
pub mod groups;
pub mod guard;
pub mod law;
#[cfg(feature = "gpu")]
pub mod modes;
pub mod momentum;
pub mod potential;
pub mod predict;
pub mod recovered;
pub mod stage;
pub mod strain;
pub mod tethers;
pub mod tissue;

use crate::layout::Layout;
use crate::scalar::Real;
use crate::state::State;
use data::{Step, StepConstants, StepData};
use guard::Guard;
use momentum::keep_spin;
use stage::StepStage;
use strain::measure_strain;

/// Carries a stage out. What it does for the guard is left out where there is none.
pub fn run<S: Real>(
    stage: StepStage,
    step: &Step<'_, S>,
    data: &mut StepData<S>,
    guard: Option<&mut Guard<S>>,
    state: &mut State<S>,
) {
    match stage {
        StepStage::ReadState => read_state(step.layout, data, state),
        StepStage::FindContacts => {
            let StepData { constants, points, velocities, .. } = data;
            let StepConstants { contacts, groups, workers, .. } = constants;
            let by = (&*workers, groups);
            contacts.find(&step.contact(), points, velocities, &state.contact, by);
        }
        StepStage::EndContacts => {
            let StepData {
                constants: StepConstants { contacts, inverse_masses, .. }, points, ..
            } = data;
            let is_pinned = |v: usize| inverse_masses[v] == S::ZERO;
            contacts.end(&step.contact(), points, is_pinned, &mut state.contact);
        }
        StepStage::MeasureStrain => {
            let constants = &mut data.constants;
            let (workers, strains) = (&constants.workers, &mut constants.start_strain);
            measure_strain(workers, step.layout, None, &data.points, strains);
        }
        StepStage::Predict { start, is_kept } => {
            data.predict(step, start);
            if let (true, Some(guard)) = (is_kept, guard) {
                guard.keep_start(&data.points);
            }
        }
        StepStage::UpdateVelocities => update_velocities(step, data),
        StepStage::LimitEnergy => {
            update_velocities(step, data);
            if let Some(guard) = guard {
                guard.limit_energy(step, data);
            }
        }
        StepStage::WriteState => {
            for (v, &user) in step.layout.numbering.order.iter().enumerate() {
                state.positions[user as usize] = data.points[v].vec3();
                state.velocities[user as usize] = data.velocities[v];
            }
        }
    }
}

fn update_velocities<S: Real>(step: &Step<'_, S>, data: &mut StepData<S>) {
    let rate = S::from_f64(1.0 / step.dt);
    let StepData { constants, points, velocities, .. } = data;
    // The step has begun with the velocities that are still there; those of its end take the place of the starts.
    for (v, velocity) in velocities.iter_mut().enumerate() {
        let after = (points[v].vec3() - constants.previous[v].vec3()) * rate;
        constants.before[v] = std::mem::replace(velocity, after);
    }
    keep_spin(step, constants, points, &constants.before, velocities);
}

fn read_state<S: Real>(layout: &Layout<S>, data: &mut StepData<S>, state: &State<S>) {
    data.read_positions(layout, &state.positions);
    for (velocity, &user) in data.velocities.iter_mut().zip(&layout.numbering.order) {
        *velocity = state.velocities[user as usize];
    }
}
