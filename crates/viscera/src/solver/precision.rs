//! The two precisions, each compiled once, in this library: kernels in lanes are large, and whoever
//! uses the generic solver would compile them all again.

use std::any::Any;

use super::cpu::{Step, Workspace};
use super::plan::Plan;
use crate::scalar::{Real, Vec3};
use crate::state::State;

/// What a solver is asked to do.
pub(super) enum Task<'a> {
    /// The stages of a step, the body of the plan so many times; of these stages the first so many.
    Step(&'a Plan, u32, usize),
    /// The stages of a step, the body of the plan so many times, under somebody's eyes.
    Watched(&'a Plan, u32, &'a mut Watch<'a>),
    /// Multipliers from positions.
    Restart,
}

/// Who looks at the places of all vertices [m], the user's order, after so many iterations.
pub(super) type Watch<'a> = dyn FnMut(u32, &[Vec3<f64>]) + Send + 'a;

/// Does it in the precision at hand.
pub(super) fn carry_out<S: Real>(
    task: Task<'_>,
    work: &mut Workspace<S>,
    step: &Step<'_, S>,
    state: &mut State<S>,
) {
    let (work, state): (&mut dyn Any, &mut dyn Any) = (work, state);
    let (model, inputs): (&dyn Any, &dyn Any) = (step.model, step.inputs);
    macro_rules! in_precision {
        ($real:ty, $carry_out:ident) => {
            if let (Some(work), Some(state), Some(model), Some(inputs)) = (
                work.downcast_mut::<Workspace<$real>>(),
                state.downcast_mut::<State<$real>>(),
                model.downcast_ref(),
                inputs.downcast_ref(),
            ) {
                let Step { dt, settings, .. } = *step;
                let step = Step { model, inputs, dt, settings };
                return $carry_out(task, work, &step, state);
            }
        };
    }
    in_precision!(f32, carry_out_f32);
    in_precision!(f64, carry_out_f64);
    unreachable!("`Real` is sealed: there are two");
}

#[inline(never)]
fn carry_out_f32(
    task: Task<'_>,
    work: &mut Workspace<f32>,
    step: &Step<'_, f32>,
    state: &mut State<f32>,
) {
    generic(task, work, step, state);
}

#[inline(never)]
fn carry_out_f64(
    task: Task<'_>,
    work: &mut Workspace<f64>,
    step: &Step<'_, f64>,
    state: &mut State<f64>,
) {
    generic(task, work, step, state);
}

fn generic<S: Real>(
    task: Task<'_>,
    work: &mut Workspace<S>,
    step: &Step<'_, S>,
    state: &mut State<S>,
) {
    let entrance = work.ground.workers.entrance();
    entrance.enter(|| match task {
        Task::Step(plan, repeat, count) => {
            for stage in plan.stages(repeat).take(count) {
                work.run(stage, step, state);
            }
        }
        Task::Watched(plan, repeat, watch) => {
            let mut places = vec![Vec3::ZERO; step.model.vertex_count()];
            let mut show = |work: &Workspace<S>, iteration| {
                for (point, &user) in work.points.iter().zip(&step.model.numbering.order) {
                    places[user as usize] = point.vec3().cast();
                }
                watch(iteration, &places);
            };
            plan.prologue.iter().for_each(|stage| work.run(stage, step, state));
            show(work, 0);
            for iteration in 1..=repeat {
                plan.body.iter().for_each(|stage| work.run(stage, step, state));
                show(work, iteration);
            }
            plan.epilogue.iter().for_each(|stage| work.run(stage, step, state));
        }
        Task::Restart => work.restart(step, state),
    });
}
