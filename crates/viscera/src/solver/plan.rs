//! The algorithm as data: the list of stages that make one step.
//!
//! A backend matches on the stages of each family exhaustively, so a stage that one backend lacks does not
//! compile. What a stage does is documented at the stage; how, in the backend.

pub use super::explicit::stage::ExplicitStage;
pub use super::step::stage::StepStage;
pub use super::xpbd::stage::XpbdStage;

/// One stage of a step, by the family that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Shared by all methods.
    Step(StepStage),
    /// Of XPBD.
    Xpbd(XpbdStage),
    /// Of the explicit method.
    Explicit(ExplicitStage),
}

impl Stage {
    /// The stage's name, without what it is given.
    pub fn name(&self) -> String {
        let text = match self {
            Self::Step(stage) => format!("{stage:?}"),
            Self::Xpbd(stage) => format!("{stage:?}"),
            Self::Explicit(stage) => format!("{stage:?}"),
        };
        text.split(['(', ' ']).next().unwrap_or_default().to_owned()
    }
}

impl From<StepStage> for Stage {
    fn from(stage: StepStage) -> Self {
        Self::Step(stage)
    }
}

impl From<XpbdStage> for Stage {
    fn from(stage: XpbdStage) -> Self {
        Self::Xpbd(stage)
    }
}

impl From<ExplicitStage> for Stage {
    fn from(stage: ExplicitStage) -> Self {
        Self::Explicit(stage)
    }
}

/// The stages of one step: `prologue`, then `repeat` times `body`, then `epilogue`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Once, first.
    pub prologue: Vec<Stage>,
    /// Number of iterations; an explicit method's small steps are counted by the step.
    pub repeat: u32,
    /// One iteration.
    pub body: Vec<Stage>,
    /// Once, last.
    pub epilogue: Vec<Stage>,
}

impl Plan {
    /// All stages in the order in which they are run.
    pub fn stages(&self, repeat: u32) -> impl Iterator<Item = &Stage> {
        let body = (0..repeat).flat_map(|_| &self.body);
        self.prologue.iter().chain(body).chain(&self.epilogue)
    }
}
