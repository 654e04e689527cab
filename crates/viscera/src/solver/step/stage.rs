//! The stages that every method of solution shares.

use crate::settings::Start;

/// A stage of a step that does not depend on how the step is solved. `x` are positions, `w` inverse masses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepStage {
    /// Takes positions and velocities over, in the solver's numbering.
    ReadState,
    /// Moves tools to where they are at the end of the step, and finds what samples of tissue meet.
    FindContacts,
    /// Remembers the Green strain of viscous tetrahedra at the start of the step.
    MeasureStrain,
    /// `xt = x + dt v + dt^2 M^-1 f_ext`; `x` becomes the start of the iteration, pins move to their targets;
    /// `w = 1/m`. With `is_kept` the start is remembered, for the guard.
    Predict {
        /// `Start::Auto` is `Start::Inertial`, but for parts that nothing holds.
        start: Start,
        /// Whether the start is remembered.
        is_kept: bool,
    },
    /// `v = (x - x_n)/dt`.
    UpdateVelocities,
    /// `UpdateVelocities`, scaled down where the step would end with more mechanical energy than it had.
    LimitEnergy,
    /// Forces of tools, and what is kept of their contact.
    EndContacts,
    /// Gives positions and velocities back, in the user's numbering.
    WriteState,
}

/// A stage of the step guard. `x_s` is the place that rejected steps are counted from, `Phi` the incremental potential.
/// Every connected part is judged by itself; what is decided is in its record, `PartGuard`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuardStage {
    /// `x_s`: the best of three starts, whose incremental potential bounds the step; remembers the mechanical energy.
    /// Before the iteration only where that needs it.
    ChooseStart,
    /// `Phi` where the iteration has ended; `with_starts` at the three starts as well, with the mechanical energy there.
    EvaluateStep {
        /// Whether `Phi` of the starts is not known yet.
        with_starts: bool,
    },
    /// Rejects the step of every part whose `Phi` has ended above its limit. Of a rejected step tries shares, counted from
    /// `x_s`, and where none passes finds the forces at `x_s`.
    JudgeStep {
        /// Whether `x_s` is still to be chosen, from what `EvaluateStep` has found.
        chooses: bool,
    },
    /// Tries lengths along the direction of descent, for the parts that descend.
    TryLengths {
        /// Whether shares were tried before: the parts descend of whose rejected step no share has passed.
        after_shares: bool,
    },
    /// Goes the first length that brings enough, and finds the forces there.
    TakeLength,
    /// Moves the parts whose step was rejected to the place that was found instead; `Phi` there.
    MoveRejected,
}
