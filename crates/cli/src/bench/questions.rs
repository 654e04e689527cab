//! What was asked of the GPU backend.

use super::measurement::Measurement;
use super::solvers::{SOLVERS, SolverEntry};
use super::task::{DT, Length, ReadBack, Task};
use anyhow::{Context, Result};
use serde::Serialize;
use viscera::settings::Method;

/// One question.
#[derive(Clone, Copy)]
pub struct Question {
    pub what: &'static str,
    /// Of [`SOLVERS`].
    solver: &'static str,
    /// About how many tetrahedra.
    pub tets: usize,
    /// Sweeps of the step that is asked for, and of a longer one to tell a sweep by: one pass of each solve of the quasi-Newton
    /// method. None where the method chooses its passes.
    sweeps: Option<[u32; 2]>,
    task: Task,
    aims: Aims,
}

/// What is hoped for; nothing of solvers that stand beside others.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Aims {
    /// What is asked for takes this long at most [s].
    pub seconds: Option<f64>,
    /// A sweep uses at least this fraction of the memory bandwidth.
    pub bandwidth_fraction: Option<f64>,
    /// Dispatches of what is asked for, and of one of its passes, at most.
    pub dispatches: Option<usize>,
    pub pass_dispatches: Option<usize>,
    /// A step leaves at most this share of the error of inertia alone.
    pub left: Option<f64>,
}

const NO_AIMS: Aims = Aims {
    seconds: None,
    bandwidth_fraction: None,
    dispatches: None,
    pass_dispatches: None,
    left: None,
};

const K100: usize = 100_000;
const M1: usize = 1_000_000;

/// Soft tissue, of which the quasi-Newton method has the fewest passes.
const SOFT: f64 = 0.3;
const OF_FRAME: Task = Task { length: Length::Frame, read_back: ReadBack::Nothing, poisson: SOFT };
const OF_MILLISECOND: Task = Task { length: Length::Step(1e-3), ..OF_FRAME };

/// Passes of a step of 1/1000 s: nine leave an error of 1.8 % of 30,000 tetrahedra, twelve 0.5 %.
const PASSES_OF_MILLISECOND: u32 = 12;

const fn published(
    what: &'static str,
    solver: &'static str,
    tets: usize,
    sweeps: [u32; 2],
    aims: Aims,
) -> Question {
    Question { what, solver, tets, sweeps: Some(sweeps), task: Task::USUAL, aims }
}

const fn frame(solver: &'static str, tets: usize, aims: Aims) -> Question {
    let what = "a frame of 1/60 s, settled to 1 %";
    Question { what, solver, tets, sweeps: None, task: OF_FRAME, aims }
}

/// Of the quasi-Newton method.
const fn solved(
    what: &'static str,
    tets: usize,
    sweeps: Option<[u32; 2]>,
    task: Task,
    aims: Aims,
) -> Question {
    Question { what, solver: "quasi-newton", tets, sweeps, task, aims }
}

const fn read_back(what: &'static str, read_back: ReadBack) -> Question {
    let task = Task { read_back, ..OF_MILLISECOND };
    solved(what, K100, None, task, Aims { seconds: Some(0.3e-3), ..NO_AIMS })
}

const fn within(seconds: f64) -> Aims {
    Aims { seconds: Some(seconds), ..NO_AIMS }
}

/// All of them.
pub const QUESTIONS: [Question; 17] = [
    published(
        "one Jacobi substep",
        "jacobi-green",
        M1,
        [1, 9],
        Aims { bandwidth_fraction: Some(0.5), ..within(0.25e-3) },
    ),
    published("20 coloured iterations", "green", K100, [20, 28], within(4e-3)),
    published("20 Jacobi + Anderson iterations", "jacobi-anderson", K100, [20, 28], within(1e-3)),
    frame("quasi-newton", K100, Aims { dispatches: Some(120), left: Some(0.01), ..within(1e-3) }),
    frame(
        "quasi-newton-recovered",
        K100,
        Aims { dispatches: Some(180), left: Some(0.01), ..within(1e-3) },
    ),
    frame("exact", K100, NO_AIMS),
    frame("clusters", K100, Aims { dispatches: Some(280), ..NO_AIMS }),
    frame("explicit", K100, Aims { pass_dispatches: Some(2), ..NO_AIMS }),
    frame("explicit-recovered", K100, Aims { pass_dispatches: Some(6), ..NO_AIMS }),
    read_back("a step of 1/1000 s, positions read back, no tool", ReadBack::Positions),
    read_back("a step of 1/1000 s, forces read back, no tool", ReadBack::Forces),
    read_back("a step of 1/1000 s with a tool, its force read back", ReadBack::Tool),
    frame("quasi-newton", M1, Aims { dispatches: Some(120), left: Some(0.01), ..within(3e-3) }),
    frame("exact", M1, NO_AIMS),
    frame("explicit", M1, NO_AIMS),
    solved(
        "a step of 1/1000 s, solved to 1 %",
        M1,
        Some([PASSES_OF_MILLISECOND, PASSES_OF_MILLISECOND + 8]),
        OF_MILLISECOND,
        Aims { left: Some(0.01), ..within(0.7e-3) },
    ),
    solved(
        "passes of frames",
        M1,
        Some([8, 16]),
        OF_FRAME,
        Aims { bandwidth_fraction: Some(0.5), ..NO_AIMS },
    ),
];

impl Question {
    /// The solver, with as many sweeps as are asked for.
    pub fn entry(&self) -> Result<SolverEntry> {
        let entry = SOLVERS.iter().find(|entry| entry.name == self.solver).cloned();
        let mut entry = entry.with_context(|| format!("`{}` is no solver now", self.solver))?;
        (entry.sweeps, entry.task) = (self.sweeps, self.task);
        Ok(entry)
    }

    /// Whether the error of the step is wanted.
    pub fn asks_for_error(&self, entry: &SolverEntry) -> bool {
        entry.settings().method == Method::QuasiNewton && self.aims.left.is_some()
    }

    /// What was found, beside what was asked for, of so many steps.
    pub fn answer(&self, found: &Measurement, steps: u32) -> Answer {
        let times = f64::from(steps);
        let reads = self.task.read_back != ReadBack::Nothing;
        let step = if reads { found.step_seconds_median } else { found.step_seconds() };
        let wall = if reads { found.step_seconds_median } else { found.step_seconds_min };
        let mut answer = Answer {
            question: self.what,
            asked_tets: self.tets,
            tets: found.tets,
            solver: found.solver,
            device: found.device,
            threads: found.threads,
            poisson: self.task.poisson,
            steps,
            dt: found.dt.unwrap_or(DT),
            passes: found.passes,
            unused_passes: found.unused_passes,
            read_back: self.task.read_back,
            seconds: times * step,
            wall_seconds: times * wall,
            dispatches: found.dispatches.map(|count| steps as usize * count),
            pass_dispatches: found.pass_dispatches,
            bandwidth_fraction: found.bandwidth_fraction,
            left: found.left,
            aims: self.aims,
            is_met: None,
        };
        answer.is_met = answer.judge();
        answer
    }
}

/// The answer of one device, in `bench.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    pub question: &'static str,
    /// What was asked for [tetrahedra], and what it was measured on.
    pub asked_tets: usize,
    pub tets: usize,
    pub solver: &'static str,
    pub device: &'static str,
    pub threads: Option<usize>,
    /// Poisson's ratio of the tissue.
    pub poisson: f64,
    /// Steps that the times and dispatches are of, and the length of one [s].
    pub steps: u32,
    pub dt: f64,
    /// Iterations of a solve or sweeps of a step, or its small steps; and how many of the last solve nothing had a use for.
    pub passes: u32,
    pub unused_passes: Option<u32>,
    pub read_back: ReadBack,
    /// By the device's clock where it has one; by the host's, the median, where the host reads something after every step.
    pub seconds: f64,
    pub wall_seconds: f64,
    pub dispatches: Option<usize>,
    pub pass_dispatches: Option<usize>,
    pub bandwidth_fraction: Option<f64>,
    /// Of the error of inertia alone.
    pub left: Option<f64>,
    pub aims: Aims,
    /// Whether all aims are met; none on other meshes or devices than they are for, and where there are none.
    pub is_met: Option<bool>,
}

impl Answer {
    /// Whether it was measured on about as many tetrahedra as were asked for.
    pub fn is_asked_size(&self) -> bool {
        (self.tets as f64 / self.asked_tets as f64 - 1.0).abs() < 0.1
    }

    fn judge(&self) -> Option<bool> {
        if self.device != "GPU" || !self.is_asked_size() {
            return None;
        }
        let count = |count: Option<usize>| count.map(|count| count as f64);
        let Aims { seconds, bandwidth_fraction, dispatches, pass_dispatches, left } = self.aims;
        let limits = [
            (seconds, Some(self.seconds)),
            (count(dispatches), count(self.dispatches)),
            (count(pass_dispatches), count(self.pass_dispatches)),
            (left, self.left),
            // The one that is to be large.
            (bandwidth_fraction.map(|f| -f), self.bandwidth_fraction.map(|f| -f)),
        ];
        let asked: Vec<_> =
            limits.into_iter().filter_map(|(aim, found)| Some((aim?, found))).collect();
        // What could not be measured is not met.
        let is_met = |(aim, found): &(f64, Option<f64>)| found.is_some_and(|found| found <= *aim);
        (!asked.is_empty()).then(|| asked.iter().all(is_met))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_question_has_its_solver() {
        for question in &QUESTIONS {
            let entry = question.entry().unwrap_or_else(|error| panic!("{error}"));
            assert!(entry.sweeps.is_none_or(|[few, more]| few < more), "{}", question.what);
        }
    }
}
