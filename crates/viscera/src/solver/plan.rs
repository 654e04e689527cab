//! The algorithm as data: the list of stages that make one step.
//!
//! A backend matches on [`Stage`] exhaustively, so a stage that one backend lacks does not
//! compile. What a stage does is told here once; how, in the backend.

use crate::model::Model;
use crate::scalar::Real;
use crate::settings::{Acceleration, AndersonGuard, AndersonOn, Method, SolverSettings, Start};

/// One stage of a step. `x` are positions, `l` multipliers, `w` inverse masses of the sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Takes positions and velocities over, in the solver's numbering.
    ReadState,
    /// Remembers the Green strain of viscous tetrahedra at the start of the step.
    MeasureStrain,
    /// `xt = x + dt v + dt^2 M^-1 f_ext`; `x` becomes the start of the iteration, pins move to
    /// their targets; `w = 1/m`. `Start::Auto` is `Start::Inertial`, but for parts that nothing holds.
    Predict(Start),
    /// `l = 0`.
    ResetMultipliers,
    /// `l *= (dt/dt_last)^2`: multipliers are forces times the squared step.
    RescaleMultipliers,
    /// Remembers the best of three starts, whose incremental potential bounds the step, and the
    /// mechanical energy.
    ChooseStart,
    /// Takes a step back whose incremental potential exceeds that bound, for each connected part by itself.
    GuardStep,
    /// NaN multipliers reset the warm start: all of the part are taken from the positions.
    RepairMultipliers,
    /// Remembers `(x, l)` before a sweep, for the acceleration.
    RememberIterate,
    /// `J^T l` and the bound of its geometric stiffness, per corner.
    LoadCorners,
    /// `r = M (x - xt) - J^T l`, `mh = m + share of the bounds`, `x -= theta r/mh`, `w = 1/mh`.
    Rebase,
    /// `x = xt + M^-1 J^T l`.
    RecomputePositions,
    /// Gives every copy its vertex's position.
    SplitCopies,
    /// Solves all constraints of one colour; they share no copy.
    SolveColor(u32),
    /// `x` becomes the mean of its copies.
    JoinCopies,
    /// Chebyshev semi-iterative step on `(x, l)`.
    Chebyshev,
    /// Anderson mixing.
    Anderson(AndersonOn),
    /// Takes a mixture back that raises the incremental potential, in favour of the plain sweep;
    /// where that fails twice in a row as well, goes on from a step of descent.
    GuardIterate,
    /// `v = (x - x_n)/dt`.
    UpdateVelocities,
    /// Scales velocities down where the step would end with more mechanical energy than it had.
    LimitEnergy,
    /// Masses and fixings of an explicit step; where tissue is viscous, its strain one small step ago.
    BeginExplicit,
    /// Forces of all elements, per copy.
    LoadForces,
    /// `v += h (g + M^-1 f)`, `x += h v` with the small step `h` of the part, until its last is done; pins move
    /// by their share.
    AdvanceExplicit,
    /// The prediction that a force balance of the mean acceleration needs.
    EndExplicit,
    /// Gives positions and velocities back, in the user's numbering.
    WriteState,
}

/// The stages of one step: `prologue`, then `repeat` times `body`, then `epilogue`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Once, first.
    pub prologue: Vec<Stage>,
    /// Number of iterations; an explicit method's small steps are counted by the step.
    pub repeat: u32,
    /// One iteration.
    pub body: Vec<Stage>,
    /// Once, last.
    pub epilogue: Vec<Stage>,
}

impl Plan {
    /// All stages in the order in which they are run.
    pub fn stages(&self, repeat: u32) -> impl Iterator<Item = &Stage> {
        let body = (0..repeat).flat_map(|_| &self.body);
        self.prologue.iter().chain(body).chain(&self.epilogue)
    }

    /// The stages that the settings ask for.
    pub fn new<S: Real>(model: &Model<S>, settings: &SolverSettings) -> Self {
        match settings.method {
            Method::Xpbd => Self::xpbd(model, settings),
            Method::Explicit => Self {
                prologue: vec![Stage::ReadState, Stage::BeginExplicit],
                repeat: 1,
                body: vec![Stage::LoadForces, Stage::AdvanceExplicit],
                epilogue: vec![Stage::EndExplicit, Stage::WriteState],
            },
        }
    }

    /// The XPBD family.
    fn xpbd<S: Real>(model: &Model<S>, settings: &SolverSettings) -> Self {
        let mut prologue = vec![Stage::ReadState];
        if model.tet_sets().iter().any(|set| set.viscous) {
            prologue.push(Stage::MeasureStrain);
        }
        // A kept multiplier already carries gravity: adding it to the start counts it twice, where anything holds
        // the part.
        let start = match (settings.start, settings.keep_multipliers) {
            (Start::Auto, true) => Start::Auto,
            (Start::Auto, false) => Start::Predicted,
            (chosen, _) => chosen,
        };
        prologue.push(Stage::Predict(start));
        prologue.push(if settings.keep_multipliers {
            Stage::RescaleMultipliers
        } else {
            Stage::ResetMultipliers
        });

        if settings.guards_steps() {
            prologue.push(Stage::ChooseStart);
        }

        let mut body = Vec::new();
        if settings.acceleration != Acceleration::None {
            body.push(Stage::RememberIterate);
        }
        if settings.rebase {
            body.extend([Stage::LoadCorners, Stage::Rebase]);
        }
        if model.is_split() {
            body.push(Stage::SplitCopies);
        }
        body.extend((0..model.color_count as u32).map(Stage::SolveColor));
        if model.is_split() {
            body.push(Stage::JoinCopies);
        }
        match (settings.acceleration, settings.anderson_on) {
            (Acceleration::None, _) => {}
            (Acceleration::Chebyshev, _) => body.push(Stage::Chebyshev),
            (Acceleration::Anderson, on) => {
                body.push(Stage::Anderson(on));
                if on == AndersonOn::Multipliers {
                    body.extend([Stage::LoadCorners, Stage::RecomputePositions]);
                }
                if settings.guard_of_mixtures() == AndersonGuard::Energy {
                    body.push(Stage::GuardIterate);
                }
            }
        }
        let mut epilogue = Vec::new();
        if settings.guards_steps() {
            epilogue.push(Stage::GuardStep);
        }
        if settings.keep_multipliers {
            epilogue.push(Stage::RepairMultipliers);
        }
        epilogue.push(Stage::UpdateVelocities);
        if settings.guards_steps() {
            epilogue.push(Stage::LimitEnergy);
        }
        epilogue.push(Stage::WriteState);
        Self { prologue, repeat: settings.iterations, body, epilogue }
    }
}
