//! The two precisions, each compiled once, in this library: kernels in lanes are large, and whoever
//! uses the generic solver would compile them all again.

use std::any::Any;
use std::ops::ControlFlow;

use super::memory::Memory;
use crate::scalar::{Real, Vec3};
use crate::solver::oscillations::Oscillations;
use crate::solver::plan::{Flag, Plan, Stage, StepStage, Visitor};
use crate::solver::step::data::Step;
use crate::state::{ContactState, Learned, State};

/// A request to a solver.
pub enum Task<'a> {
    /// The stages of a step of so many small steps; of these stages the first so many.
    Step(&'a Plan, u32, usize),
    /// The stages of a step of so many small steps, one of several in a row.
    Within(&'a Plan, u32, Within),
    /// Gives positions and velocities back after one of several steps.
    Write,
    /// The stages of a step of so many small steps, with an observer callback.
    Watched(&'a Plan, u32, &'a mut Watch<'a>),
    /// Multipliers from positions.
    Restart,
    /// The oscillations of what is held.
    Oscillations(&'a mut Oscillations),
}

/// Where a step stands among steps in a row: between them positions and velocities stay in the solver's order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Within {
    pub is_first: bool,
    pub is_last: bool,
}

impl Within {
    /// A step by itself.
    const ALONE: Self = Self { is_first: true, is_last: true };

    /// Whether a stage is left out: what it would read or write is where it is needed.
    fn leaves_out(self, stage: &Stage) -> bool {
        match stage {
            Stage::Step(StepStage::ReadState) => !self.is_first,
            Stage::Step(StepStage::WriteState) => !self.is_last,
            _ => false,
        }
    }
}

/// Observer callback: gets the number of passes through loops so far, 0 where the first loop begins, and the
/// positions of all vertices [m], the user's order.
pub type Watch<'a> = dyn FnMut(u32, &[Vec3<f64>]) + Send + 'a;

/// See [`crate::solver::Solver::oscillations`].
pub fn oscillations<S: Real>(memory: &mut Memory<S>, step: &Step<'_, S>) -> Oscillations {
    let mut oscillations = Oscillations::default();
    let mut nothing = State {
        positions: Vec::new(),
        velocities: Vec::new(),
        multipliers: Vec::new(),
        multiplier_dt: 0.0,
        learned: Learned::default(),
        contact: ContactState::default(),
    };
    carry_out(Task::Oscillations(&mut oscillations), memory, step, &mut nothing);
    oscillations
}

/// Carries a request out in one precision.
pub fn carry_out<S: Real>(
    task: Task<'_>,
    memory: &mut Memory<S>,
    step: &Step<'_, S>,
    state: &mut State<S>,
) {
    let (memory, state): (&mut dyn Any, &mut dyn Any) = (memory, state);
    let (model, inputs): (&dyn Any, &dyn Any) = (step.layout, step.inputs);
    macro_rules! in_precision {
        ($real:ty, $carry_out:ident) => {
            if let (Some(memory), Some(state), Some(model), Some(inputs)) = (
                memory.downcast_mut::<Memory<$real>>(),
                state.downcast_mut::<State<$real>>(),
                model.downcast_ref(),
                inputs.downcast_ref(),
            ) {
                let Step { dt, settings, .. } = *step;
                let step = Step { layout: model, inputs, dt, settings };
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
        Task::Step(plan, small_steps, count) => {
            let (within, observer) = (Within::ALONE, None);
            let left = count;
            plan.walk(small_steps, &mut Execution { memory, step, state, within, left, observer });
        }
        Task::Within(plan, small_steps, within) => {
            let (left, observer) = (usize::MAX, None);
            plan.walk(small_steps, &mut Execution { memory, step, state, within, left, observer });
        }
        Task::Write => memory.run(&StepStage::WriteState.into(), step, state),
        Task::Watched(plan, small_steps, watch) => {
            let places = vec![Vec3::ZERO; step.layout.vertex_count()];
            let observer = Some(Observer { watch, places, next: 0 });
            let (within, left) = (Within::ALONE, usize::MAX);
            plan.walk(small_steps, &mut Execution { memory, step, state, within, left, observer });
        }
        Task::Restart => memory.restart(step, state),
        Task::Oscillations(all) => *all = memory.oscillations(step),
    });
}

/// A step under way.
struct Execution<'a, 'm, 'w, S> {
    memory: &'a mut Memory<S>,
    step: &'a Step<'m, S>,
    state: &'a mut State<S>,
    within: Within,
    /// Stages that are still to be run.
    left: usize,
    observer: Option<Observer<'w>>,
}

/// The observer of a step.
struct Observer<'w> {
    watch: &'w mut Watch<'w>,
    /// Memory for what it is shown: positions [m], the user's order.
    places: Vec<Vec3<f64>>,
    /// The number of passes that the callback gets next.
    next: u32,
}

impl<S: Real> Execution<'_, '_, '_, S> {
    /// Shows the observer the positions.
    fn show(&mut self) {
        let Some(Observer { watch, places, next }) = &mut self.observer else { return };
        for (point, &user) in self.memory.data.points.iter().zip(&self.step.layout.numbering.order)
        {
            places[user as usize] = point.vec3().cast();
        }
        watch(*next, places);
        *next += 1;
    }
}

impl<S: Real> Visitor for Execution<'_, '_, '_, S> {
    fn run(&mut self, stage: &Stage) -> ControlFlow<()> {
        if self.left == 0 {
            return ControlFlow::Break(());
        }
        self.left -= 1;
        if !self.within.leaves_out(stage) {
            self.memory.run(stage, self.step, self.state);
        }
        ControlFlow::Continue(())
    }

    fn is_set(&self, flag: Flag) -> bool {
        self.memory.is_set(flag)
    }

    fn begin_repeat(&mut self) {
        // Where later loops begin has been shown: once is enough.
        if self.observer.as_ref().is_some_and(|observer| observer.next == 0) {
            self.show();
        }
    }

    fn end_pass(&mut self) {
        self.show();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Layout;
    use crate::material::MaterialModel;
    use crate::settings::{Count, SolverSettings};
    use crate::solver::Inputs;
    use crate::solver::plan::{Node, Repeat, Times};
    use crate::solver::probe::{everything, quiet};

    /// A step of a plan from rest with initial velocities; the positions where it ends, and all that is shown.
    fn watched(
        plan: &Plan,
        layout: &Layout<f64>,
        settings: &SolverSettings,
    ) -> (Vec<Vec3<f64>>, Vec<Vec<Vec3<f64>>>) {
        let inputs = Inputs::default();
        let step = quiet(layout, &inputs, settings, 1e-2);
        let places = &layout.rest_positions;
        let mut state = State {
            positions: places.clone(),
            velocities: places.iter().map(|x| Vec3 { x: -x.y, y: x.z, z: x.x } * 20.0).collect(),
            multipliers: vec![0.0; layout.multiplier_count],
            multiplier_dt: 0.0,
            learned: Default::default(),
            contact: Default::default(),
        };
        let mut seen = Vec::new();
        let mut watch = |passes: u32, x: &[Vec3<f64>]| {
            assert_eq!(passes as usize, seen.len());
            seen.push(x.to_vec());
        };
        let task = Task::Watched(plan, 1, &mut watch);
        carry_out(task, &mut Memory::new(layout, settings), &step, &mut state);
        (state.positions, seen)
    }

    /// Loops one after the other and within each other are iterations like those of one loop, to the bit. Passes are
    /// counted on from loop to loop.
    #[test]
    fn loops_of_loops_are_iterations() {
        let settings = SolverSettings { iterations: Count::Of(4), ..SolverSettings::xpbd() };
        let law = MaterialModel::SaintVenantKirchhoff;
        let model = everything(&settings, [law, law], 0.3);
        let plan = Plan::new(&model, &settings);
        let (expected, iterates) = watched(&plan, &model, &settings);
        assert_eq!(iterates.len(), 5);
        assert!(iterates.windows(2).all(|pair| pair[0] != pair[1]));

        let is_loop = |node: &Node| matches!(node, Node::Repeat(_));
        let place = plan.nodes.iter().position(is_loop).expect("an iteration");
        let body = plan.iteration().expect("an iteration").body.clone();
        let twice = |body| {
            let most = Times::Count(2);
            Node::Repeat(Repeat { most, until: None, is_watched: true, body })
        };
        let with = |loops: Vec<Node>| {
            let mut plan = plan.clone();
            plan.nodes.splice(place..=place, loops);
            watched(&plan, &model, &settings)
        };
        let one_by_one = with(vec![twice(body.clone()), twice(body.clone())]);
        assert_eq!(one_by_one, (expected.clone(), iterates.clone()));
        // Where an inner loop ends with a pass of the outer one, both are shown.
        let both = [0, 1, 2, 2, 3, 4, 4].map(|i: usize| iterates[i].clone());
        assert_eq!(with(vec![twice(vec![twice(body)])]), (expected, both.to_vec()));
    }
}
