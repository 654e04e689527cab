//! The stages that every method of solution shares.

use crate::settings::Start;

/// A stage of a step that does not depend on how the step is solved. `x` are positions, `w` inverse masses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepStage {
    /// Takes positions and velocities over, in the solver's numbering.
    ReadState,
    /// Remembers the Green strain of viscous tetrahedra at the start of the step.
    MeasureStrain,
    /// `xt = x + dt v + dt^2 M^-1 f_ext`; `x` becomes the start of the iteration, pins move to
    /// their targets; `w = 1/m`. `Start::Auto` is `Start::Inertial`, but for parts that nothing holds.
    Predict(Start),
    /// Remembers the best of three starts, whose incremental potential bounds the step, and the
    /// mechanical energy.
    ChooseStart,
    /// Rejects a step whose incremental potential exceeds that bound, for each connected part by itself.
    GuardStep,
    /// `v = (x - x_n)/dt`.
    UpdateVelocities,
    /// `UpdateVelocities`, scaled down where the step would end with more mechanical energy than it had.
    LimitEnergy,
    /// Gives positions and velocities back, in the user's numbering.
    WriteState,
}
