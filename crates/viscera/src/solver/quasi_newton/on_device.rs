//! What a device has to know of the method.

use super::choice::{Choice, choose_by_part};
use super::preconditioner::tables::{Header, Tables};
use super::sdirk2::SHARE;
use super::stage::Solve;
use super::{most_pairs, passes_of};
use crate::layout::Layout;
use crate::settings::{Integrator, Method, SolverSettings};
use crate::solver::inputs::Inputs;

/// Whether kernels of the method are there.
pub const IS_THERE: bool = cfg!(feature = "gpu-solves");

/// The share of a step that a solve takes.
pub fn share(settings: &SolverSettings) -> f64 {
    match settings.integrator {
        Integrator::Sdirk2 => SHARE,
        Integrator::ImplicitEuler => 1.0,
    }
}

/// How far ahead of the start of a step the preconditioner turns to, as a share of it.
pub fn ahead(settings: &SolverSettings) -> f64 {
    if settings.integrator == Integrator::Sdirk2 { 0.5 } else { 1.0 }
}

/// The first solve of a step.
pub fn first_solve(settings: &SolverSettings) -> Solve {
    match settings.integrator {
        Integrator::Sdirk2 => Solve::First,
        Integrator::ImplicitEuler => Solve::Euler,
    }
}

/// What a device knows of the preconditioner, and for which vertices.
#[derive(Clone, Debug)]
pub struct DeviceLevels {
    choices: Vec<Choice>,
    free: Vec<bool>,
    pub header: Header,
    /// Words of the table, numbers beside it, and pairs that each part has room for.
    pub words: u64,
    pub numbers: u64,
    pub history: u32,
}

impl DeviceLevels {
    /// With all vertices free; returns the table as well. Nothing for other methods.
    pub fn new(layout: &Layout<f32>, settings: &SolverSettings) -> Option<(Self, Vec<u32>)> {
        if !IS_THERE || settings.method != Method::QuasiNewton {
            return None;
        }
        let mut choices = choose_by_part(settings, layout);
        let history = most_pairs(&choices).max(1) as u32;
        let solve = first_solve(settings);
        for choice in &mut choices {
            choice.passes = passes_of(solve, settings, choice.passes);
        }
        let free = vec![true; layout.vertex_count()];
        let Tables { header, words, numbers } = Tables::new(layout, &free, &choices);
        let all = Self { choices, free, header, words: words.len() as u64, numbers, history };
        Some((all, words))
    }

    /// The table for the vertices that are free in a step, where that are others than before: never longer than with all.
    pub fn fit(&mut self, layout: &Layout<f32>, inputs: &Inputs<f32>) -> Option<Vec<u32>> {
        if !IS_THERE {
            return None;
        }
        let mut free = vec![true; self.free.len()];
        for pin in &inputs.pins {
            free[layout.numbering.of(pin.vertex)] = false;
        }
        if free == self.free {
            return None;
        }
        self.free = free;
        let Tables { header, words, .. } = Tables::new(layout, &self.free, &self.choices);
        self.header = header;
        Some(words)
    }
}
