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
use crate::solver::plan::{Node, Plan, Repeat, Times};
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::guard::Guard;
use crate::solver::step::stage::StepStage;
use crate::state::State;
use history::repair_multipliers;
use loads::load_multipliers;
pub use memory::{Memory, needs_loads};
use rebase::{rebase, recompute_positions};
use stage::{Mix, XpbdStage};
use sweep::solve_color;

/// The stages of a step.
pub fn plan<S: Real>(layout: &Layout<S>, settings: &SolverSettings) -> Plan {
    let mut nodes: Vec<Node> = vec![StepStage::ReadState.into()];
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
    nodes.push(StepStage::Predict(start).into());
    nodes.push(match settings.keep_multipliers {
        true => XpbdStage::RescaleMultipliers.into(),
        false => XpbdStage::ResetMultipliers.into(),
    });

    if settings.guards_steps() {
        nodes.push(StepStage::ChooseStart.into());
    }
    if is_accelerated(settings) && mixes_remember(settings) {
        nodes.push(XpbdStage::RememberIterate.into());
    }

    let body = body(layout, settings).into_iter().map(Node::from).collect();
    let most = Times::Count(settings.iterations());
    nodes.push(Node::Repeat(Repeat { most, until: None, body }));

    if settings.guards_steps() {
        nodes.push(StepStage::GuardStep.into());
    }
    if settings.keep_multipliers {
        nodes.push(XpbdStage::RepairMultipliers.into());
    }
    nodes.push(match settings.guards_steps() {
        true => StepStage::LimitEnergy.into(),
        false => StepStage::UpdateVelocities.into(),
    });
    nodes.push(StepStage::WriteState.into());
    Plan { nodes }
}

/// The stages of an iteration.
fn body<S: Real>(layout: &Layout<S>, settings: &SolverSettings) -> Vec<XpbdStage> {
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
            if guards_mixtures(settings) {
                body.push(XpbdStage::GuardIterate);
            }
        }
    }
    body
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
            XpbdStage::GuardIterate => {
                if let Some(guard) = guard {
                    self.guard_iterate(step, data, guard, &mut state.multipliers);
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
