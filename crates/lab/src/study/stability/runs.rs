//! Test cases (tissue, solver, rough handling) and observables.

use std::fmt;

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::{AndersonGuard, AndersonOn, Count, SolverSettings};

use super::Context;
use crate::load_cases::Size;
use crate::settling::{AfterStep, compare, settle_with, truth};
use crate::stress::{self, FRAMES, Kind, ROUND_OFF, Run, SIZE};
use crate::study::methods::{COLORED, NamedSettings, anderson, exact, published};
use viscera_reference::Reference;

/// Young's modulus [Pa] and Poisson's ratio of the bar in trouble.
pub(super) const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.45;
/// Of the bars that show which solver settles: stiff ones, of which steps are rejected.
pub(super) const SETTLING_YOUNG: f64 = 1e5;
const SETTLING_POISSON: [f64; 2] = [0.45, 0.49];
/// A body this many times as long as at rest has blown up.
const BLOWN: f64 = 10.0;

/// What happens to the multipliers after a rejected step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AfterRejection {
    Keep,
    Recompute,
    Zero,
}

/// A way to solve.
pub(super) struct Way {
    pub method: NamedSettings,
    pub after: AfterRejection,
    /// One of those that all runs are made of; the others are compared on a few.
    pub is_main: bool,
}

/// Anderson's method, window 5, on both unknowns, with coloured sweeps.
pub(super) fn ways() -> Vec<Way> {
    use AfterRejection::{Keep, Recompute, Zero};
    use AndersonGuard::{Energy, None, Residual};
    let accelerated = |settings, anderson_guard| SolverSettings {
        anderson_guard,
        iterations: Count::Of(5),
        ..anderson(settings, AndersonOn::Both)
    };
    let free = || SolverSettings { step_guard: false, ..exact(COLORED) };
    let way = |name: &str, settings, after, is_main| Way {
        method: NamedSettings::new(name, settings),
        after,
        is_main,
    };
    vec![
        way("published", accelerated(published(COLORED), None), Keep, true),
        way("published, residual guard", accelerated(published(COLORED), Residual), Keep, false),
        way("rebase", accelerated(free(), None), Keep, false),
        way("rebase, residual guard", accelerated(free(), Residual), Keep, false),
        way("step guard, zeroed", accelerated(exact(COLORED), Residual), Zero, false),
        way("step guard, recomputed", accelerated(exact(COLORED), Residual), Recompute, false),
        way("step guard, iterates judged", accelerated(exact(COLORED), Energy), Keep, false),
        way("step guard", accelerated(exact(COLORED), Residual), Keep, true),
    ]
}

/// The way without any safeguard, and the one that is recommended.
pub(super) const UNGUARDED: usize = 0;
pub(super) const SAFE: usize = 7;

/// Treats the multipliers after a rejected step by the way's rule.
fn treat_multipliers(
    after: AfterRejection,
    rejected: &mut u64,
    step: &mut AfterStep<'_, f64>,
) -> Result<()> {
    let so_far = step.solver.rejected_steps();
    if std::mem::replace(rejected, so_far) == so_far {
        return Ok(());
    }
    match after {
        AfterRejection::Keep => {}
        AfterRejection::Recompute => {
            step.solver.restart(step.model, step.state, step.inputs, step.dt)?;
        }
        AfterRejection::Zero => step.state.multipliers.fill(0.0),
    }
    Ok(())
}

#[derive(Clone, Copy)]
pub(super) struct Case {
    pub model: MaterialModel,
    pub way: usize,
    pub kind: Kind,
    pub seed: u64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = &ways()[self.way].method.name;
        write!(f, "{} {}, {:?}, {name}", self.kind, self.seed, self.model)
    }
}

/// Materials, ways, kinds, seeds: the last runs fastest.
pub(super) fn cases(quick: bool) -> Vec<Case> {
    let (many, few) = if quick { (3, 1) } else { (200, 25) };
    let mut cases = Vec::new();
    for model in MODELS {
        for (index, way) in ways().iter().enumerate() {
            let count = if way.is_main { many } else { few };
            for kind in [Kind::Grab, Kind::Scramble] {
                cases.extend((0..count).map(|seed| Case { model, way: index, kind, seed }));
            }
        }
    }
    cases
}

pub(super) const MODELS: [MaterialModel; 2] =
    [MaterialModel::StableNeoHookean, MaterialModel::SaintVenantKirchhoff];

/// A bar that settles by one of the ways.
pub(super) struct Rest {
    pub model: MaterialModel,
    pub way: usize,
}

impl fmt::Display for Rest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cantilever, {:?}, {}", self.model, ways()[self.way].method.name)
    }
}

pub(super) fn rests() -> Vec<Rest> {
    let of = |model| (0..ways().len()).map(move |way| Rest { model, way });
    MODELS.into_iter().flat_map(of).collect()
}

/// One run.
#[derive(Clone, Debug, Default)]
pub(super) struct Outcome {
    /// Steps that end at a higher incremental potential than they began with.
    pub above: u32,
    /// The largest ratio of the two.
    pub factor: f64,
    /// NaN, or a body of many times its length.
    pub is_blown: bool,
    /// Tetrahedra inside out at the end.
    pub inverted: usize,
    pub tets: usize,
    pub rejected: u64,
    /// Mechanical energy [J] at the start of the time in which nothing acts on the body, and then at the
    /// end of every frame.
    pub energies: Vec<f64>,
}

impl Outcome {
    /// The highest mechanical energy of the free body over what it was let go with.
    pub fn gain(&self) -> f64 {
        let highest = self.energies.iter().copied().fold(0.0, f64::max);
        self.energies.first().map_or(0.0, |first| highest / first)
    }
}

fn is_blown(run: &Run<'_>) -> bool {
    let x = &run.state.positions;
    let first = x[0];
    !run.state.is_finite() || x.iter().any(|x| (*x - first).length() >= BLOWN * SIZE[0])
}

/// Watches one run. `Phi` is computed outside the solver, whatever that believes.
pub(super) fn outcome(context: &Context, case: &Case) -> Result<Outcome> {
    let tissue = context.changes.tissue(case.model, YOUNG, POISSON)?;
    let load_case = stress::bar(tissue)?;
    let way = &ways()[case.way];
    let mut run = Run::new(&load_case, case.kind, case.seed, &way.method.settings)?;
    let reference = Reference::new(&run.model);
    let mut outcome = Outcome { tets: load_case.mesh.tets().len(), ..Outcome::default() };
    let mut rejected = 0;
    for _ in 0..FRAMES {
        if run.is_free() && outcome.energies.is_empty() {
            outcome.energies.push(run.mechanical_energy(&reference)?);
        }
        let factor = run.step_watched(&reference)?;
        outcome.above += u32::from(factor > 1.0 + ROUND_OFF);
        outcome.factor = outcome.factor.max(factor);
        outcome.is_blown |= is_blown(&run);
        if !outcome.energies.is_empty() {
            outcome.energies.push(run.mechanical_energy(&reference)?);
        }
        if !run.state.is_finite() {
            break;
        }
        treat_multipliers(way.after, &mut rejected, &mut run.after_step())?;
    }
    outcome.rejected = run.solver.rejected_steps();
    outcome.inverted = run.inverted();
    Ok(outcome)
}

/// One, where the user wants it.
pub(super) fn settling_poissons(context: &Context) -> Vec<f64> {
    context.changes.poisson.map_or(SETTLING_POISSON.to_vec(), |poisson| vec![poisson])
}

/// The apparent stiffness of cantilevers of the same settings.
pub(super) fn apparent_stiffness(context: &Context, rest: &Rest) -> Result<Vec<f64>> {
    settling_poissons(context).into_iter().map(|poisson| settled(context, rest, poisson)).collect()
}

fn settled(context: &Context, rest: &Rest, poisson: f64) -> Result<f64> {
    let size = if context.quick { Size::Tiny } else { Size::Small };
    let tissue = context.changes.tissue(rest.model, SETTLING_YOUNG, poisson)?;
    let load_case = context.changes.load_case("cantilever", size, tissue)?;
    let way = &ways()[rest.way];
    let mut rejected = 0;
    let settled = settle_with::<f64>(&load_case, &way.method.settings, |step| {
        treat_multipliers(way.after, &mut rejected, step)
    })?;
    Ok(compare(&load_case, &truth(&load_case)?, &settled.positions)?.stiffness)
}
