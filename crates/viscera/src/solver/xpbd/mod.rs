//! XPBD: multipliers of constraints, solved constraint by constraint.

mod accelerate;
pub mod acceleration;
#[cfg(feature = "gpu")]
mod gpu;
pub mod history;
pub mod iterates;
pub mod loads;
mod memory;
mod mixtures;
pub mod rebase;
pub mod stage;
mod sweep;

use crate::layout::Layout;
use crate::model::for_each_kind;
use crate::scalar::Real;
use crate::settings::{Acceleration, AndersonGuard, AndersonOn, SolverSettings, Start};
use crate::solver::plan::{Flag, Node, Plan, Repeat, Times};
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::guard::{DESCENTS, Guard};
use crate::solver::step::stage::{GuardStage, StepStage};
use crate::state::State;
use history::repair_multipliers;
use loads::load_multipliers;
pub use memory::{Memory, needs_loads};
use rebase::{rebase, recompute_positions};
use stage::{IterateStage, Mix, XpbdStage};
use sweep::solve_color;

/// The stages of a step.
pub fn plan<S: Real>(layout: &Layout<S>, settings: &SolverSettings) -> Plan {
    let mut nodes: Vec<Node> = vec![StepStage::ReadState.into(), StepStage::FindContacts.into()];
    if layout.is_viscous() {
        nodes.push(StepStage::MeasureStrain.into());
    }
    // A kept multiplier already carries gravity: adding it to the start counts it twice, where anything holds
    // the part.
    let start = match (settings.start, settings.keep_multipliers) {
        (Start::Auto, true) => Start::Auto,
        (Start::Auto, false) => Start::Predicted,
        (chosen, _) => chosen,
    };
    let is_guarded = settings.guards_steps();
    nodes.push(StepStage::Predict { start, is_kept: is_guarded }.into());
    nodes.push(match settings.keep_multipliers {
        true => XpbdStage::RescaleMultipliers.into(),
        false => XpbdStage::ResetMultipliers.into(),
    });

    // Where no iterates are guarded the best start is needed at the end only, and found there.
    let chooses_first = is_guarded && guards_mixtures(settings);
    if chooses_first {
        nodes.push(GuardStage::ChooseStart.into());
    }
    if is_accelerated(settings) && mixes_remember(settings) {
        nodes.push(XpbdStage::RememberIterate.into());
    }

    let body = body(layout, settings);
    let most = Times::Count(settings.iterations());
    nodes.push(Node::Repeat(Repeat { most, until: None, is_watched: true, body }));

    if is_guarded {
        nodes.extend(judged(!chooses_first));
    }
    if settings.keep_multipliers {
        nodes.push(XpbdStage::RepairMultipliers.into());
    }
    nodes.push(match is_guarded {
        true => StepStage::LimitEnergy.into(),
        false => StepStage::UpdateVelocities.into(),
    });
    nodes.push(StepStage::EndContacts.into());
    nodes.push(StepStage::WriteState.into());
    Plan { nodes }
}

/// The stages by which the guard ends a step; `chooses`: `x_s` is still to be chosen.
fn judged(chooses: bool) -> Vec<Node> {
    let again =
        vec![GuardStage::TakeLength.into(), GuardStage::TryLengths { after_shares: false }.into()];
    vec![
        GuardStage::EvaluateStep { with_starts: chooses }.into(),
        GuardStage::JudgeStep { chooses }.into(),
        GuardStage::TryLengths { after_shares: true }.into(),
        Node::Repeat(Repeat {
            most: Times::Count(DESCENTS - 1),
            until: Some(Flag::NothingDescends),
            is_watched: false,
            body: again,
        }),
        GuardStage::MoveRejected.into(),
    ]
}

/// The stages of an iteration.
fn body<S: Real>(layout: &Layout<S>, settings: &SolverSettings) -> Vec<Node> {
    let mut body = sweep(layout, settings);
    if guards_mixtures(settings) {
        use IterateStage::{Evaluate, EvaluatePlain, Judge, JudgePlain, TakeDescent};
        let judged = [Evaluate, Judge, EvaluatePlain, JudgePlain];
        body.extend(judged.map(|stage| XpbdStage::GuardIterate(stage).into()));
        body.push(GuardStage::TryLengths { after_shares: false }.into());
        body.push(XpbdStage::GuardIterate(TakeDescent).into());
    }
    body
}

/// A sweep, and its acceleration.
fn sweep<S: Real>(layout: &Layout<S>, settings: &SolverSettings) -> Vec<Node> {
    let mut body = Vec::new();
    if is_accelerated(settings) && !mixes_remember(settings) {
        body.push(XpbdStage::RememberIterate);
    }
    if settings.rebase {
        body.extend([XpbdStage::LoadCorners, XpbdStage::Rebase]);
    }
    let is_split = layout.is_split();
    if is_split && is_jacobi(layout) {
        body.push(XpbdStage::SplitAndSolve);
    } else {
        if is_split {
            body.push(XpbdStage::SplitCopies);
        }
        body.extend((0..layout.color_count as u32).map(XpbdStage::SolveColor));
    }
    match settings.acceleration {
        Acceleration::None if is_split => body.push(XpbdStage::JoinCopies),
        Acceleration::None => {}
        Acceleration::Chebyshev => {
            if is_split {
                body.push(XpbdStage::JoinCopies);
            }
            body.push(XpbdStage::Chebyshev);
        }
        Acceleration::Anderson => {
            let (on, remembers) = (settings.anderson_on, mixes_remember(settings));
            body.push(XpbdStage::Anderson(Mix { on, joins: is_split, remembers }));
            if on == AndersonOn::Multipliers {
                body.extend([XpbdStage::LoadCorners, XpbdStage::RecomputePositions]);
            }
        }
    }
    body.into_iter().map(Node::from).collect()
}

fn is_accelerated(settings: &SolverSettings) -> bool {
    settings.acceleration != Acceleration::None
}

/// Whether Anderson's accelerated iterates are guarded one by one.
pub fn guards_mixtures(settings: &SolverSettings) -> bool {
    settings.acceleration == Acceleration::Anderson
        && settings.guard_of_mixtures() == AndersonGuard::Energy
}

/// Whether what an acceleration leaves is where the next sweep starts, so that it is remembered in the same
/// pass.
fn mixes_remember(settings: &SolverSettings) -> bool {
    let recomputes = settings.acceleration == Acceleration::Anderson
        && settings.anderson_on == AndersonOn::Multipliers;
    !recomputes && !guards_mixtures(settings)
}

/// Whether every copy has one constraint, and all are of one colour.
pub fn is_jacobi<S: Real>(layout: &Layout<S>) -> bool {
    let mut corners = 4 * layout.tet_count();
    for_each_kind!(layout, set => corners += set.vertices.as_flattened().len());
    layout.color_count == 1 && layout.copy_count() == corners
}

impl<S: Real> Memory<S> {
    /// Carries a stage out.
    pub fn run(
        &mut self,
        stage: XpbdStage,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        guard: Option<&mut Guard<S>>,
        state: &mut State<S>,
    ) {
        let model = step.layout;
        match stage {
            XpbdStage::ResetMultipliers => {
                state.multipliers.fill(S::ZERO);
                state.multiplier_dt = step.dt;
                self.start_acceleration(step, &data.constants.masses);
            }
            XpbdStage::RescaleMultipliers => {
                if state.multiplier_dt > 0.0 && state.multiplier_dt != step.dt {
                    let ratio = step.dt / state.multiplier_dt;
                    let factor = S::from_f64(ratio * ratio);
                    state.multipliers.iter_mut().for_each(|l| *l *= factor);
                }
                state.multiplier_dt = step.dt;
                self.start_acceleration(step, &data.constants.masses);
            }
            XpbdStage::RepairMultipliers => {
                repair_multipliers(step, data, &mut state.multipliers);
            }
            XpbdStage::RememberIterate => self.remember_iterate(&data.points, &state.multipliers),
            XpbdStage::LoadCorners => {
                let StepData { constants, points, loads, .. } = data;
                load_multipliers(constants, step, points, &state.multipliers, loads);
                constants.contacts.load_vertices(&step.contact(), points, loads);
            }
            XpbdStage::Rebase => rebase(step, data),
            XpbdStage::RecomputePositions => recompute_positions(model, data),
            XpbdStage::SplitCopies => self.split_copies(model, data),
            XpbdStage::SolveColor(color) => self.solve_color(color as usize, step, data, state),
            XpbdStage::SplitAndSolve => {
                self.split_copies(model, data);
                self.solve_color(0, step, data, state);
            }
            XpbdStage::JoinCopies => self.join_copies(model, data),
            XpbdStage::Chebyshev => {
                self.chebyshev(step, data, &mut state.multipliers);
                self.iterate.swap(0, 1);
                self.remember_iterate(&data.points, &state.multipliers);
            }
            XpbdStage::Anderson(mix) => {
                if mix.joins {
                    self.join_copies(model, data);
                }
                self.anderson(step, data, &mut state.multipliers, mix.on);
                if mix.remembers {
                    self.remember_iterate(&data.points, &state.multipliers);
                }
            }
            XpbdStage::GuardIterate(stage) => {
                if let Some(guard) = guard {
                    self.guard_iterate(stage, step, data, guard, &mut state.multipliers);
                }
            }
        }
    }

    fn solve_color(
        &mut self,
        color: usize,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        state: &mut State<S>,
    ) {
        let split = step.layout.is_split();
        let points = if split { &mut self.copies } else { &mut data.points };
        let constants = &data.constants;
        solve_color(constants, step, points, &mut state.multipliers, color);
    }
}
