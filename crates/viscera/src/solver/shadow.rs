//! How far forces on tools are off: the same motion once more, in half as many steps.
//!
//! ```text
//! F_n  force of a run with n steps in a frame,   F = F_n + e_n,   e_n ~ n^-p,  p = 1 or more
//! |F_n - F_(n/2)| = |e_(n/2) - e_n| >= (2^p - 1) |e_n|;      estimate  2 |F_n - F_(n/2)| + |F_n|/1000
//! ```
//!
//! What a force is off by when a hand has come to rest was left by the motion: friction holds tissue where too long steps
//! have let it. Nothing at that moment shows it, not even a force balance that is perfect. A second run has gone the same
//! way and has a memory of its own (Hairer, Nørsett, Wanner, "Solving Ordinary Differential Equations I", 1993, section II.4,
//! on step doubling; here of whole runs). It covers what depends on the length of steps: time, sweeps that are not done,
//! friction that trails behind. It does not know what both runs have in common: the mesh, samples, and contact's own
//! stiffness.

use super::{Inputs, Solver, StepError};
use crate::contact::Wrench;
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use crate::settings::{SolverSettings, Threads};
use crate::state::State;

/// By how much the difference of both runs is widened, and where the second run has twice the steps instead.
const WIDENED: f64 = 2.0;
const WIDENED_FROM_FINER: f64 = 4.0;

/// No force is said to be known better, as a share of it: to three digits.
const DIGITS: f64 = 1e-3;

/// A second run of a model beside another.
///
/// ```text
/// let mut shadow = Shadow::new(&model, solver.settings(), &state);
/// // every frame: n steps of the solver, Shadow::count(n) of the shadow, to the same places of tools
/// let off = Shadow::error(n, solver.wrenches()[0].force, shadow.wrenches()[0].force);
/// ```
#[derive(Clone, Debug)]
pub struct Shadow<S> {
    solver: Solver<S>,
    state: State<S>,
}

impl<S: Real> Shadow<S> {
    /// Beside a run with these settings that is in this state; it works with one thread.
    pub fn new(model: &Model<S>, settings: &SolverSettings, state: &State<S>) -> Self {
        let settings = SolverSettings { threads: Threads::Count(1), ..settings.clone() };
        Self { solver: Solver::new(model, &settings), state: state.clone() }
    }

    /// Its steps in a time in which the run beside it takes so many: half, or two where that takes one.
    pub fn count(of_run: u32) -> u32 {
        if of_run > 1 { of_run / 2 } else { 2 }
    }

    /// What a force (or a torque) of a run with so many steps may be off by, with the force of its shadow [the same unit].
    pub fn error(of_run: u32, force: Vec3<f64>, shadow: Vec3<f64>) -> f64 {
        let widened = if of_run > 1 { WIDENED } else { WIDENED_FROM_FINER };
        widened * (force - shadow).length() + DIGITS * force.length()
    }

    /// As [`Solver::steps`].
    pub fn steps(
        &mut self,
        model: &Model<S>,
        inputs: &mut Inputs<S>,
        dt: f64,
        count: u32,
        act: impl FnMut(u32, &mut Inputs<S>),
    ) -> Result<(), StepError> {
        self.solver.steps(model, &mut self.state, inputs, dt, count, act)
    }

    /// What moves.
    pub fn state_mut(&mut self) -> &mut State<S> {
        &mut self.state
    }

    /// Goes on from where the run beside it is.
    pub fn follow(&mut self, state: &State<S>) {
        self.state.clone_from(state);
    }

    /// Force and torque at the end of its last step, see [`Solver::wrenches`]. No number where it ran away.
    pub fn wrenches(&self) -> &[Wrench] {
        self.solver.wrenches()
    }
}
