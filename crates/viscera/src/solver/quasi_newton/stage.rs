//! The stages of the quasi-Newton method.

/// What is solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solve {
    /// The first stage of SDIRK2.
    First,
    /// Its second stage.
    Second,
    /// A step of implicit Euler, of the parts that are to take one.
    Euler,
}

/// A stage of the quasi-Newton method, of all connected parts that it concerns; `x` is the iterate, `y` the trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuasiNewtonStage {
    /// Masses and pins of the step, its energy, and the preconditioner at its start.
    Begin,
    /// `xt` of a solve; `y` becomes its start, `x` the reference that it is judged against.
    StartSolve(Solve),
    /// Gradient and change of the incremental potential from `x` to `y`.
    Evaluate,
    /// Accepts `y` where the potential has fallen enough, or shortens the way to it.
    Judge,
    /// `z = M g`, and from the step that was accepted a pair `s`, `y`, `M y`.
    Precondition,
    /// `d = -H g` from `z` and the pairs; without pairs `-z`, as long as the curvature along it says.
    ChooseDirection,
    /// `y = x + a d`.
    Advance,
    /// Velocities and accelerations of a solve; the last direction is taken unchecked where all was calm.
    EndSolve(Solve),
    /// Finds the parts that store more energy than they had: they take a step of implicit Euler instead.
    CheckEnergy,
    /// No part ends with more mechanical energy than it began with and was given.
    LimitEnergy,
}
