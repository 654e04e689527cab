//! From stages to dispatches: what the device is asked to do in every step, written down once.

use std::ops::Range;

use super::record::{Dispatch, Recorder};
use crate::solver::plan::{Plan, QuasiNewtonStage, Split, Stage, XpbdStage};
use crate::solver::quasi_newton::on_device::first_solve;

/// The dispatches of one stage among those of its part of the step.
#[derive(Clone, Debug, PartialEq)]
pub struct StageRange {
    pub stage: Stage,
    pub dispatches: Range<usize>,
}

/// The dispatches of a step: once, in each pass through the iteration, once.
#[derive(Clone, Debug, Default)]
pub struct Record {
    pub prologue: Vec<Dispatch>,
    pub body: Vec<Dispatch>,
    pub epilogue: Vec<Dispatch>,
    /// Which of them belong to which stage, in these three lists; stages that need none are left out,
    /// and the colours of a sweep are one.
    pub stages: [Vec<StageRange>; 3],
    /// Where the dispatches of each stage of prologue and body begin, and where those of the last end.
    pub stage_starts: [Vec<usize>; 2],
    /// Of a new history, instead of a step.
    pub restart: Vec<Dispatch>,
}

impl Recorder<'_> {
    pub fn record(&self, plan: &Plan) -> Record {
        let Split { prologue, body, epilogue } = plan.split();
        let [prologue, body, epilogue] =
            [prologue, body, epilogue].map(|stages| self.list(&stages));
        Record {
            prologue: prologue.0,
            body: body.0,
            epilogue: epilogue.0,
            stages: [prologue.1, body.1, epilogue.1],
            stage_starts: [prologue.2, body.2],
            // The quasi-Newton method has no multipliers.
            restart: if self.levels.is_some() { Vec::new() } else { self.restart_stages() },
        }
    }

    fn list(&self, stages: &[Stage]) -> (Vec<Dispatch>, Vec<StageRange>, Vec<usize>) {
        let (mut dispatches, mut ranges) = (Vec::new(), Vec::<StageRange>::new());
        // The solve that is under way: lists begin with the first one's stages.
        let mut solve = first_solve(self.settings);
        let mut starts = Vec::new();
        for stage in stages {
            starts.push(dispatches.len());
            let first = dispatches.len();
            match *stage {
                Stage::Step(stage) => self.step_stage(stage, &mut dispatches),
                Stage::Guard(stage) => self.guard_stage(stage, &mut dispatches),
                Stage::Xpbd(stage) => self.xpbd_stage(stage, &mut dispatches),
                Stage::Explicit(stage) => self.explicit_stage(stage, &mut dispatches),
                Stage::QuasiNewton(stage) => {
                    if let QuasiNewtonStage::StartSolve(which) = stage {
                        solve = which;
                    }
                    self.quasi_newton_stage(stage, solve, &mut dispatches);
                }
            }
            let added = first..dispatches.len();
            match (stage, ranges.last_mut()) {
                _ if added.is_empty() => {}
                (
                    Stage::Xpbd(XpbdStage::SolveColor(_)),
                    Some(StageRange { stage: Stage::Xpbd(XpbdStage::SolveColor(_)), dispatches }),
                ) => dispatches.end = added.end,
                _ => ranges.push(StageRange { stage: *stage, dispatches: added }),
            }
        }
        starts.push(dispatches.len());
        (dispatches, ranges, starts)
    }
}
