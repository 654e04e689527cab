//! What the guards decide: one record for each connected part of the model, the same on the processor and on a device;
//! its twin is control.wgsl.
//!
//! A stage writes a record's words, later stages read them. What one stage both reads and changes has two words, because
//! on a device all workgroups of a part decide the same and none may read what another has written.

use crate::solver::report::StepReport;

/// The decisions of the guards on one part, in numbers of the backend's precision; `PartGuard` of control.wgsl.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub struct PartGuard<F> {
    /// `Phi_limit` [J s^2]; on a device all potentials are differences to the start of the step with its pins moved.
    pub limit: F,
    /// Whether the step was rejected.
    pub was_rejected: u32,
    /// The share of a rejected step that is taken; zero for none, from which descents follow.
    pub share: F,
    /// Whether descents are on their way.
    pub descends: u32,
    /// `Phi` [J s^2] where the step ended, and the part of it that round-off can pretend.
    pub potential: F,
    pub noise: F,
    /// The share of its velocities that the energy limit left to the part.
    pub kept_speed: F,
    /// Of accelerated iterates: `Phi` [J s^2] of the best so far and plain sweeps in a row that have ended above it, after
    /// a plain sweep was judged.
    pub best_value: F,
    pub failures: u32,
    /// The same after the accelerated iterate was judged, and whether that passed.
    pub mixture_best: F,
    pub mixture_failures: u32,
    pub is_good: u32,
}

impl<F: Copy + Into<f64>> PartGuard<F> {
    /// How the step ended for the part.
    pub fn report(&self) -> StepReport {
        StepReport {
            potential: self.potential.into(),
            limit: self.limit.into(),
            noise: self.noise.into(),
            rejected: self.was_rejected != 0,
            kept_speed: self.kept_speed.into(),
        }
    }
}
