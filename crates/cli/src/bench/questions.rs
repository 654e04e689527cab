//! What was asked of the GPU backend before it was built.

use super::measurement::Measurement;
use super::solvers::{SOLVERS, SolverEntry};
use anyhow::{Context, Result};
use serde::Serialize;

/// One question.
pub struct Question {
    pub what: &'static str,
    /// Of [`SOLVERS`].
    solver: &'static str,
    /// About how many tetrahedra.
    pub tets: usize,
    /// Sweeps of the step that is asked for, and of a longer one to tell a sweep by.
    sweeps: [u32; 2],
    /// A step should take this long at most [s].
    pub aim_seconds: f64,
    /// A sweep should use at least this fraction of the memory bandwidth.
    pub aim_bandwidth: Option<f64>,
}

/// All of them.
pub const QUESTIONS: [Question; 3] = [
    Question {
        what: "one Jacobi substep",
        solver: "jacobi-green",
        tets: 1_000_000,
        sweeps: [1, 9],
        aim_seconds: 0.25e-3,
        aim_bandwidth: Some(0.5),
    },
    Question {
        what: "20 coloured iterations",
        solver: "green",
        tets: 100_000,
        sweeps: [20, 28],
        aim_seconds: 4e-3,
        aim_bandwidth: None,
    },
    Question {
        what: "20 Jacobi + Anderson iterations",
        solver: "jacobi-anderson",
        tets: 100_000,
        sweeps: [20, 28],
        aim_seconds: 1e-3,
        aim_bandwidth: None,
    },
];

impl Question {
    /// The solver, with as many sweeps as are asked for.
    pub fn entry(&self) -> Result<SolverEntry> {
        let entry = SOLVERS.iter().find(|entry| entry.name == self.solver).cloned();
        let mut entry = entry.with_context(|| format!("`{}` is no solver now", self.solver))?;
        entry.sweeps = Some(self.sweeps);
        Ok(entry)
    }

    /// What was found, beside what was asked for.
    pub fn answer(&self, found: &Measurement) -> Answer {
        Answer {
            question: self.what,
            asked_tets: self.tets,
            tets: found.tets,
            solver: found.solver,
            device: found.device,
            threads: found.threads,
            aim_seconds: self.aim_seconds,
            step_seconds: found.step_seconds(),
            wall_seconds: found.step_seconds_min,
            dispatches: found.dispatches,
            aim_bandwidth_fraction: self.aim_bandwidth,
            bandwidth_fraction: found.bandwidth_fraction,
        }
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
    pub aim_seconds: f64,
    /// By the device's clock where it has one.
    pub step_seconds: f64,
    pub wall_seconds: f64,
    pub dispatches: Option<usize>,
    pub aim_bandwidth_fraction: Option<f64>,
    pub bandwidth_fraction: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_question_has_its_solver() {
        for question in &QUESTIONS {
            let entry = question.entry().unwrap_or_else(|error| panic!("{error}"));
            assert!(entry.sweeps.is_some_and(|[few, more]| few < more), "{}", question.what);
        }
    }
}
