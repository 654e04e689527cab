//! The two precisions, each compiled once, in this library: kernels in lanes are large, and whoever
//! uses the generic solver would compile them all again.

use std::any::Any;

use super::memory::Memory;
use crate::scalar::{Real, Vec3};
use crate::solver::plan::Plan;
use crate::solver::step::data::Step;
use crate::solver::xpbd::history::restart;
use crate::state::State;

/// A request to a solver.
pub enum Task<'a> {
    /// The stages of a step, the body of the plan so many times; of these stages the first so many.
    Step(&'a Plan, u32, usize),
    /// The stages of a step, the body of the plan so many times, with an observer callback.
    Watched(&'a Plan, u32, &'a mut Watch<'a>),
    /// Multipliers from positions.
    Restart,
}

/// Observer callback: gets the number of iterations and the positions of all vertices [m], the user's order.
pub type Watch<'a> = dyn FnMut(u32, &[Vec3<f64>]) + Send + 'a;

/// Carries a request out in one precision.
pub fn carry_out<S: Real>(
    task: Task<'_>,
    memory: &mut Memory<S>,
    step: &Step<'_, S>,
    state: &mut State<S>,
) {
    let (memory, state): (&mut dyn Any, &mut dyn Any) = (memory, state);
    let (model, inputs): (&dyn Any, &dyn Any) = (step.model, step.inputs);
    macro_rules! in_precision {
        ($real:ty, $carry_out:ident) => {
            if let (Some(memory), Some(state), Some(model), Some(inputs)) = (
                memory.downcast_mut::<Memory<$real>>(),
                state.downcast_mut::<State<$real>>(),
                model.downcast_ref(),
                inputs.downcast_ref(),
            ) {
                let Step { dt, settings, .. } = *step;
                let step = Step { model, inputs, dt, settings };
                return $carry_out(task, memory, &step, state);
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
    memory: &mut Memory<f32>,
    step: &Step<'_, f32>,
    state: &mut State<f32>,
) {
    generic(task, memory, step, state);
}

#[inline(never)]
fn carry_out_f64(
    task: Task<'_>,
    memory: &mut Memory<f64>,
    step: &Step<'_, f64>,
    state: &mut State<f64>,
) {
    generic(task, memory, step, state);
}

fn generic<S: Real>(
    task: Task<'_>,
    memory: &mut Memory<S>,
    step: &Step<'_, S>,
    state: &mut State<S>,
) {
    let entrance = memory.data.constants.workers.entrance();
    entrance.enter(|| match task {
        Task::Step(plan, repeat, count) => {
            for stage in plan.stages(repeat).take(count) {
                memory.run(stage, step, state);
            }
        }
        Task::Watched(plan, repeat, watch) => {
            let mut places = vec![Vec3::ZERO; step.model.vertex_count()];
            let mut show = |memory: &Memory<S>, iteration| {
                for (point, &user) in memory.data.points.iter().zip(&step.model.numbering.order) {
                    places[user as usize] = point.vec3().cast();
                }
                watch(iteration, &places);
            };
            plan.prologue.iter().for_each(|stage| memory.run(stage, step, state));
            show(memory, 0);
            for iteration in 1..=repeat {
                plan.body.iter().for_each(|stage| memory.run(stage, step, state));
                show(memory, iteration);
            }
            plan.epilogue.iter().for_each(|stage| memory.run(stage, step, state));
        }
        Task::Restart => restart(step, &mut memory.data, state),
    });
}
