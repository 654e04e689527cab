//! The stages of XPBD: sweeps over constraints, and what accelerates them.

use crate::settings::AndersonOn;

/// A stage of XPBD. `x` are positions, `l` multipliers, `w` inverse masses of the sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum XpbdStage {
    /// `l = 0`.
    ResetMultipliers,
    /// `l *= (dt/dt_last)^2`: multipliers are forces times the squared step.
    RescaleMultipliers,
    /// NaN multipliers reset the warm start: all of the part are taken from the positions.
    RepairMultipliers,
    /// Remembers `(x, l)` before the first sweep, or before each where no acceleration does so, for the
    /// acceleration.
    RememberIterate,
    /// `J^T l` and the bound of its geometric stiffness, per corner.
    LoadCorners,
    /// `r = M (x - xt) - J^T l`, `mh = m + share of the bounds`, `x -= theta r/mh`, `w = 1/mh`.
    Rebase,
    /// `x = xt + M^-1 J^T l`.
    RecomputePositions,
    /// Gives every copy its vertex's position.
    SplitCopies,
    /// Solves all constraints of one colour; they share no copy, but within a cluster.
    SolveColor(u32),
    /// `SplitCopies` and `SolveColor(0)` in one, where every copy has one constraint.
    SplitAndSolve,
    /// `x` becomes the mean of its copies.
    JoinCopies,
    /// Chebyshev semi-iterative step on `(x, l)`, which is remembered for the next sweep.
    Chebyshev,
    /// Anderson mixing.
    Anderson(Mix),
    /// Guards the accelerated iterate: takes one back that raises the incremental potential, in favour of the plain sweep;
    /// where that fails twice in a row as well, goes on from a step of descent.
    GuardIterate(IterateStage),
}

/// A stage of the guard of accelerated iterates; between the last two `GuardStage::TryLengths` is run. `Phi` is the
/// incremental potential, `x_s` the best iterate so far, or the best start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IterateStage {
    /// `Phi` of the accelerated iterate.
    Evaluate,
    /// Remembers an iterate that lowers `Phi` as `x_s`; replaces one that does not pass by the plain sweep.
    Judge,
    /// `Phi` of the plain sweeps that have replaced an iterate.
    EvaluatePlain,
    /// Judges these alike; of a part that fails for the second time finds the forces at `x_s`, from which it descends.
    JudgePlain,
    /// Goes on from where the descent has led, without the history of the acceleration.
    TakeDescent,
}

/// One mixing, with what is done in the same pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mix {
    /// The unknowns that are mixed.
    pub on: AndersonOn,
    /// Whether `x` first becomes the mean of its copies.
    pub joins: bool,
    /// Whether the accelerated iterate is remembered for the next sweep: not where another stage still changes it.
    pub remembers: bool,
}
