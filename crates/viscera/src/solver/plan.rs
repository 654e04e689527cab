//! The algorithm as data: the tree of stages and loops that make one step.
//!
//! A backend matches on the stages of each family exhaustively, so a stage that one backend lacks does not
//! compile. What a stage does is documented at the stage; how, in the backend.

use std::ops::ControlFlow;

pub use super::explicit::stage::ExplicitStage;
pub use super::quasi_newton::stage::{QuasiNewtonStage, Solve};
pub use super::step::stage::{GuardStage, StepStage};
pub use super::xpbd::stage::{IterateStage, XpbdStage};

/// One stage of a step, by the family that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Shared by all methods.
    Step(StepStage),
    /// Of the step guard.
    Guard(GuardStage),
    /// Of XPBD.
    Xpbd(XpbdStage),
    /// Of the explicit method.
    Explicit(ExplicitStage),
    /// Of the quasi-Newton method.
    QuasiNewton(QuasiNewtonStage),
}

impl Stage {
    /// The stage's name, without what it is given.
    pub fn name(&self) -> String {
        let text = match self {
            Self::Step(stage) => format!("{stage:?}"),
            Self::Guard(stage) => format!("{stage:?}"),
            Self::Xpbd(stage) => format!("{stage:?}"),
            Self::Explicit(stage) => format!("{stage:?}"),
            Self::QuasiNewton(stage) => format!("{stage:?}"),
        };
        text.split(['(', ' ']).next().unwrap_or_default().to_owned()
    }
}

impl From<StepStage> for Stage {
    fn from(stage: StepStage) -> Self {
        Self::Step(stage)
    }
}

impl From<GuardStage> for Stage {
    fn from(stage: GuardStage) -> Self {
        Self::Guard(stage)
    }
}

impl From<XpbdStage> for Stage {
    fn from(stage: XpbdStage) -> Self {
        Self::Xpbd(stage)
    }
}

impl From<QuasiNewtonStage> for Stage {
    fn from(stage: QuasiNewtonStage) -> Self {
        Self::QuasiNewton(stage)
    }
}

impl From<ExplicitStage> for Stage {
    fn from(stage: ExplicitStage) -> Self {
        Self::Explicit(stage)
    }
}

/// The stages of one step, in the order in which they are run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Stages and loops, one after the other.
    pub nodes: Vec<Node>,
}

/// A part of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Node {
    /// One stage.
    Run(Stage),
    /// Its nodes again and again.
    Repeat(Repeat),
}

impl<T: Into<Stage>> From<T> for Node {
    fn from(stage: T) -> Self {
        Self::Run(stage.into())
    }
}

/// A loop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Repeat {
    /// The largest number of passes through the body.
    pub most: Times,
    /// Ends the loop before the first pass that finds it set.
    pub until: Option<Flag>,
    /// Whether its passes are iterations or small steps, which an observer of the step is shown.
    pub is_watched: bool,
    /// One pass.
    pub body: Vec<Node>,
}

/// How often at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Times {
    /// So many times.
    Count(u32),
    /// As many as the method's small steps take: counted by the step.
    SmallSteps,
}

impl Times {
    /// The number in a step of so many small steps.
    pub fn count(self, small_steps: u32) -> u32 {
        match self {
            Self::Count(count) => count,
            Self::SmallSteps => small_steps,
        }
    }
}

/// Something that a method's memory knows: a CPU leaves the loop when it is set; a device predicates the stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flag {
    /// Every part of the model has converged.
    AllDone,
    /// The step guard lets no part descend.
    NothingDescends,
}

/// Carries the stages of a plan out.
pub trait Visitor {
    /// Carries a stage out; breaks to end the walk.
    fn run(&mut self, stage: &Stage) -> ControlFlow<()>;

    /// Whether the flag is set. Asked before each pass through a body that has a flag.
    fn is_set(&self, flag: Flag) -> bool;

    /// A loop that is watched begins.
    fn begin_repeat(&mut self) {}

    /// A pass through the body of a loop that is watched has ended.
    fn end_pass(&mut self) {}
}

impl Plan {
    /// Visits the stages of a step of so many small steps, until the visitor breaks.
    pub fn walk(&self, small_steps: u32, visitor: &mut impl Visitor) {
        // Who breaks knows why: there is nothing to tell.
        let _ = walk(&self.nodes, small_steps, visitor);
    }

    /// The iteration: the first loop that is in no other loop.
    pub fn iteration(&self) -> Option<&Repeat> {
        self.nodes.iter().find_map(|node| match node {
            Node::Repeat(repeat) => Some(repeat),
            Node::Run(_) => None,
        })
    }

    /// As [`Plan::iteration`].
    pub fn iteration_mut(&mut self) -> Option<&mut Repeat> {
        self.nodes.iter_mut().find_map(|node| match node {
            Node::Repeat(repeat) => Some(repeat),
            Node::Run(_) => None,
        })
    }

    /// The largest number of passes through the iteration in a step of so many small steps.
    pub fn passes(&self, small_steps: u32) -> u32 {
        self.iteration().map_or(0, |iteration| iteration.most.count(small_steps))
    }

    /// The stages before, in and after the iteration: what a device is sent, which has no other loops.
    ///
    /// All other loops are unrolled, so that their counts are fixed when the plan is recorded. Flags are left out:
    /// a device makes every pass, and stages whose flag is set do nothing. A plan without a loop is all prologue.
    ///
    /// # Panics
    /// Where another loop than the iteration is counted by the step.
    pub fn split(&self) -> Split {
        let is_loop = |node: &Node| matches!(node, Node::Repeat(_));
        let first = self.nodes.iter().position(is_loop).unwrap_or(self.nodes.len());
        let body = self.iteration().map_or(&[][..], |iteration| &iteration.body);
        Split {
            prologue: unrolled(&self.nodes[..first]),
            body: unrolled(body),
            epilogue: unrolled(self.nodes.get(first + 1..).unwrap_or_default()),
        }
    }
}

/// The stages of a plan around its iteration, see [`Plan::split`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Once, before the iteration.
    pub prologue: Vec<Stage>,
    /// One pass through the iteration.
    pub body: Vec<Stage>,
    /// Once, after the iteration.
    pub epilogue: Vec<Stage>,
}

impl Split {
    /// The stages up to the end of the first pass.
    pub fn first_pass(&self) -> impl Iterator<Item = &Stage> {
        self.prologue.iter().chain(&self.body)
    }
}

fn walk(nodes: &[Node], small_steps: u32, visitor: &mut impl Visitor) -> ControlFlow<()> {
    for node in nodes {
        match node {
            Node::Run(stage) => visitor.run(stage)?,
            Node::Repeat(Repeat { most, until, is_watched, body }) => {
                if *is_watched {
                    visitor.begin_repeat();
                }
                for _ in 0..most.count(small_steps) {
                    if until.is_some_and(|flag| visitor.is_set(flag)) {
                        break;
                    }
                    walk(body, small_steps, visitor)?;
                    if *is_watched {
                        visitor.end_pass();
                    }
                }
            }
        }
    }
    ControlFlow::Continue(())
}

fn unrolled(nodes: &[Node]) -> Vec<Stage> {
    let mut stages = Vec::new();
    for node in nodes {
        match node {
            Node::Run(stage) => stages.push(*stage),
            Node::Repeat(Repeat { most: Times::Count(count), body, .. }) => {
                stages.extend(unrolled(body).repeat(*count as usize));
            }
            Node::Repeat(Repeat { most: Times::SmallSteps, .. }) => {
                unreachable!("a plan has its small steps in its iteration")
            }
        }
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes down what happens: colours by their numbers, `[` where a loop begins, `)` where a pass ends.
    #[derive(Default)]
    struct Log {
        text: String,
        /// Stages until the walk is ended.
        left: usize,
        /// The flag is set once so many stages are run.
        done_after: usize,
        run: usize,
    }

    impl Log {
        fn of(plan: &Plan, left: usize, done_after: usize) -> String {
            let mut log = Self { left, done_after, ..Self::default() };
            plan.walk(3, &mut log);
            log.text
        }
    }

    impl Visitor for Log {
        fn run(&mut self, stage: &Stage) -> ControlFlow<()> {
            if self.run == self.left {
                return ControlFlow::Break(());
            }
            self.run += 1;
            self.text += &number(stage).to_string();
            ControlFlow::Continue(())
        }

        fn is_set(&self, flag: Flag) -> bool {
            flag == Flag::AllDone && self.run >= self.done_after
        }

        fn begin_repeat(&mut self) {
            self.text.push('[');
        }

        fn end_pass(&mut self) {
            self.text.push(')');
        }
    }

    fn number(stage: &Stage) -> u32 {
        let Stage::Xpbd(XpbdStage::SolveColor(color)) = stage else { panic!("{stage:?}") };
        *color
    }

    fn run(color: u32) -> Node {
        XpbdStage::SolveColor(color).into()
    }

    fn repeat(most: Times, until: Option<Flag>, body: Vec<Node>) -> Node {
        Node::Repeat(Repeat { most, until, is_watched: true, body })
    }

    /// Loops one after the other and within each other.
    fn nested(until: Option<Flag>) -> Plan {
        let inner = repeat(Times::Count(2), until, vec![run(2), run(3)]);
        let outer = repeat(Times::SmallSteps, until, vec![run(1), inner, run(4)]);
        let last = repeat(Times::Count(2), None, vec![run(6)]);
        Plan { nodes: vec![run(0), outer, run(5), last, run(7)] }
    }

    #[test]
    fn stages_are_run_in_order() {
        let all = Log::of(&nested(None), usize::MAX, 0);
        assert_eq!(all, "0[1[23)23)4)1[23)23)4)1[23)23)4)5[6)6)7");
        assert_eq!(Log::of(&Plan::default(), usize::MAX, 0), "");
    }

    #[test]
    fn a_walk_ends_after_any_stage() {
        let all = Log::of(&nested(None), usize::MAX, 0);
        let count = all.matches(char::is_numeric).count();
        for left in 0..=count {
            let first = Log::of(&nested(None), left, 0);
            assert!(all.starts_with(&first), "{left}: {first}");
            assert_eq!(first.matches(char::is_numeric).count(), left);
        }
    }

    #[test]
    fn a_flag_ends_its_loop_before_a_pass() {
        let plan = nested(Some(Flag::AllDone));
        assert_eq!(Log::of(&plan, usize::MAX, 100), Log::of(&nested(None), usize::MAX, 0));
        // Before the first pass of all.
        assert_eq!(Log::of(&plan, usize::MAX, 0), "0[5[6)6)7");
        // In the middle of a pass, which is not cut short.
        assert_eq!(Log::of(&plan, usize::MAX, 3), "0[1[23)4)5[6)6)7");
        // Before the inner loop of the second outer pass.
        assert_eq!(Log::of(&plan, usize::MAX, 8), "0[1[23)23)4)1[4)5[6)6)7");
    }

    #[test]
    fn only_loops_that_are_watched_are_shown() {
        let mut plan = nested(None);
        let Node::Repeat(outer) = &mut plan.nodes[1] else { panic!("a loop") };
        let Node::Repeat(inner) = &mut outer.body[1] else { panic!("a loop") };
        inner.is_watched = false;
        assert_eq!(Log::of(&plan, usize::MAX, 0), "0[123234)123234)123234)5[6)6)7");
    }

    #[test]
    fn a_plan_is_split_around_its_first_loop() {
        let numbers = |stages: &[Stage]| -> Vec<u32> { stages.iter().map(number).collect() };
        let plan = nested(Some(Flag::AllDone));
        let split = plan.split();
        assert_eq!(numbers(&split.prologue), [0]);
        assert_eq!(numbers(&split.body), [1, 2, 3, 2, 3, 4]);
        assert_eq!(numbers(&split.epilogue), [5, 6, 6, 7]);
        assert_eq!(split.first_pass().count(), 7);
        assert_eq!((plan.passes(3), plan.passes(0)), (3, 0));

        let flat = Plan { nodes: vec![run(0), run(1)] };
        assert_eq!(numbers(&flat.split().prologue), [0, 1]);
        assert!(flat.split().body.is_empty() && flat.split().epilogue.is_empty());
        assert_eq!(flat.passes(3), 0);
    }
}
