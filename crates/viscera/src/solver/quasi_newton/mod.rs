//! The quasi-Newton method: every step is the minimum of an incremental potential, found in a dozen passes.
//!
//! ```text
//! Phi(x) = 1/2 |x - xt|_M^2 + he^2 V(x),   d = -H grad Phi,   x += a d
//! H: limited-memory BFGS about an additive multilevel preconditioner;  a = 1 unless the potential rises
//! ```
//!
//! Liu, Bouaziz, Kavan, "Quasi-Newton methods for real-time simulation of hyperelastic materials", TOG 2017, for the
//! idea; what starts the recursion here is a preconditioner of all scales ([`preconditioner`]), so that the number of
//! iterations does not depend on the mesh. Time is integrated by SDIRK2 (`time.rs`). Pairs of steps and gradients are
//! kept from solve to solve, and from step to step: they are part of the state.
//!
//! An iteration is `Evaluate` (gradient and change of `Phi` at a trial), `Judge` (take it, or come nearer),
//! `Precondition`, `ChooseDirection`, `Advance` (the next trial). Every connected part has its own directions, step
//! lengths and verdicts.
#![allow(unsafe_code)]

mod choice;
mod direction;
mod evaluate;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(feature = "gpu")]
pub mod on_device;
mod oscillations;
mod parts;
mod preconditioner;
#[cfg(feature = "gpu")]
pub mod progress;
mod sdirk2;
pub mod stage;
mod time;
mod vectors;

use std::ops::Range;

use crate::layout::{Before, Layout, Moments};
use crate::material::MaterialConstants;
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};
use crate::settings::{Count, Integrator, SolverSettings};
use crate::solver::cpu::threads::Shared;
use crate::solver::plan::{Flag, Node, Plan, Repeat, Times};
use crate::solver::report::StepReport;
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::descent::{SHORTEN, SUFFICIENT};
use crate::solver::step::energy::{Energies, Ledger};
use crate::solver::step::potential::Evaluator;
use crate::solver::step::stage::StepStage;
use crate::state::{Learned, State};
use choice::{Choice, choose_by_part};
pub use choice::{choose, expected_motion_error, substeps_for};
use evaluate::{Change, Evaluation, Way};
use parts::{Phase, Progress};
use preconditioner::Preconditioner;
#[cfg(feature = "gpu")]
pub use preconditioner::tables;
use stage::{QuasiNewtonStage, Solve};

/// Round-off of a change of the potential: so many units of the precision of the sum of its terms' magnitudes.
const ROUNDED: f64 = 4.0;

/// After so many rejected trials in a row the pairs are forgotten.
const MOST_FAILURES: u32 = 2;

/// A step of implicit Euler that takes the place of another has so many iterations more.
const MORE_ITERATIONS: u32 = 4;

/// The passes of a solve; `automatic` where the settings leave their number to the method.
fn passes_of(solve: Solve, settings: &SolverSettings, automatic: u32) -> u32 {
    let chosen = match settings.iterations {
        Count::Of(count) => count,
        Count::Auto => automatic,
    };
    match (solve, settings.integrator) {
        (Solve::First | Solve::Second, _) => chosen,
        (Solve::Euler, Integrator::Sdirk2) => chosen + MORE_ITERATIONS,
        // Its last direction is never taken unchecked, so that the first pass alone would move nothing.
        (Solve::Euler, Integrator::ImplicitEuler) => chosen + 1,
    }
}

/// The stages of a step. `takes_again`: whether a step of SDIRK2 that stores too much is taken again by implicit Euler.
pub fn plan<S: Real>(
    settings: &SolverSettings,
    materials: &[MaterialConstants<S>],
    takes_again: bool,
) -> Plan {
    // Of the part that has most: every part stops by itself after its own.
    let chosen = choose(settings, materials).passes;
    let solve = |solve: Solve| {
        use QuasiNewtonStage::{
            Advance, ChooseDirection, EndSolve, Evaluate, Judge, Precondition, StartSolve,
        };
        let body = [Evaluate, Judge, Precondition, ChooseDirection, Advance];
        let body = body.map(|stage| Node::Run(stage.into())).to_vec();
        let most = passes_of(solve, settings, chosen);
        let until = Some(Flag::AllDone);
        let repeat = Repeat { most: Times::Count(most), until, is_watched: true, body };
        [
            Node::Run(StartSolve(solve).into()),
            Node::Repeat(repeat),
            Node::Run(EndSolve(solve).into()),
        ]
    };
    let mut nodes: Vec<Node> = vec![
        StepStage::ReadState.into(),
        StepStage::FindContacts.into(),
        QuasiNewtonStage::Begin.into(),
    ];
    match settings.integrator {
        Integrator::Sdirk2 => {
            nodes.extend(solve(Solve::First));
            nodes.extend(solve(Solve::Second));
            if takes_again {
                nodes.push(Node::Run(QuasiNewtonStage::CheckEnergy.into()));
                nodes.extend(solve(Solve::Euler));
            }
        }
        Integrator::ImplicitEuler => nodes.extend(solve(Solve::Euler)),
    }
    nodes.push(Node::Run(QuasiNewtonStage::LimitEnergy.into()));
    nodes.push(StepStage::EndContacts.into());
    nodes.push(StepStage::WriteState.into());
    Plan { nodes }
}

/// The memory of the method beside the data of a step, whose positions are the trial.
#[derive(Clone, Debug)]
pub struct Memory<S> {
    evaluation: Evaluation<S>,
    preconditioner: Preconditioner<S>,
    evaluator: Evaluator,
    energies: Energies,
    /// Of each part.
    choices: Vec<Choice>,
    parts: Vec<Progress>,
    /// Whether the step that was just accepted left a pair.
    has_new_pair: Vec<bool>,
    pinned: Vec<bool>,
    /// `x`: the iterate [m].
    base: Vec<Point<S>>,
    /// Gradient [N s^2] at the iterate, and at the trial.
    gradient: Vec<Vec3<S>>,
    trial_gradient: Vec<Vec3<S>>,
    /// `M` times the gradient at the iterate [m], and at the one to come.
    z: Vec<Vec3<S>>,
    trial_z: Vec<Vec3<S>>,
    direction: Vec<Vec3<S>>,
    /// The direction as points, for passes over elements.
    direction_points: Vec<Point<S>>,
    /// `M y` of each pair.
    images: Vec<Vec3<S>>,
    /// `xs` [m] and `vs` [m/s], from which a solve goes on.
    stage_start: Vec<Point<S>>,
    stage_velocities: Vec<Vec3<S>>,
    /// Velocities [m/s] at the start of the step, and after the first stage.
    start_velocities: Vec<Vec3<S>>,
    first_velocities: Vec<Vec3<S>>,
    /// `he` of the solve at hand [s].
    solve_dt: f64,
    /// Steps so far in which a part took a step of implicit Euler instead.
    pub rejected: u64,
    /// How the last step ended, of each part; empty before the first.
    pub reports: Vec<StepReport>,
}

/// Where a pair of a part stands.
struct Pair {
    /// Of [`Learned::pairs`].
    s: Range<usize>,
    y: Range<usize>,
    /// Of [`Memory::images`].
    image: Range<usize>,
}

impl Pair {
    fn places(slot: usize, vertices: usize, part: &Range<usize>) -> Self {
        let from = |first: usize| first + part.start..first + part.end;
        Self {
            s: from(2 * slot * vertices),
            y: from((2 * slot + 1) * vertices),
            image: from(slot * vertices),
        }
    }
}

impl<S: Real> Memory<S> {
    /// Memory for the steps of a model.
    pub fn new(layout: &Layout<S>, settings: &SolverSettings) -> Self {
        let (vertices, parts) = (layout.vertex_count(), layout.part_count());
        let choices = choose_by_part(settings, layout);
        let history = most_pairs(&choices);
        let vectors = || vec![Vec3::ZERO; vertices];
        let points = || vec![Point::default(); vertices];
        Self {
            evaluation: Evaluation::new(layout),
            preconditioner: Preconditioner::new(layout),
            evaluator: Evaluator::new(layout),
            energies: Energies::new(parts),
            choices,
            parts: vec![Progress::default(); parts],
            has_new_pair: vec![false; parts],
            pinned: vec![false; vertices],
            base: points(),
            gradient: vectors(),
            trial_gradient: vectors(),
            z: vectors(),
            trial_z: vectors(),
            direction: vectors(),
            direction_points: points(),
            images: vec![Vec3::ZERO; history * vertices],
            stage_start: points(),
            stage_velocities: vectors(),
            start_velocities: vectors(),
            first_velocities: vectors(),
            solve_dt: 0.0,
            rejected: 0,
            reports: Vec::with_capacity(parts),
        }
    }

    /// What tools have put into tissue.
    pub fn ledger(&self) -> Ledger {
        self.energies.ledger()
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        let vectors = [
            &self.gradient,
            &self.trial_gradient,
            &self.z,
            &self.trial_z,
            &self.direction,
            &self.images,
            &self.stage_velocities,
            &self.start_velocities,
            &self.first_velocities,
        ];
        let points = [&self.base, &self.direction_points, &self.stage_start];
        vectors.into_iter().map(|v| size_of_val(&v[..])).sum::<usize>()
            + points.into_iter().map(|p| size_of_val(&p[..])).sum::<usize>()
            + size_of_val(&self.parts[..])
            + size_of_val(&self.choices[..])
            + size_of_val(&self.has_new_pair[..])
            + self.reports.capacity() * size_of::<StepReport>()
            + size_of_val(&self.pinned[..])
            + self.evaluation.bytes()
            + self.preconditioner.bytes()
            + self.evaluator.bytes()
            + self.energies.bytes()
    }

    /// Pairs of a part at most.
    pub fn history(&self) -> usize {
        most_pairs(&self.choices)
    }

    /// Whether no part has anything left to do in the solve at hand.
    pub fn is_all_done(&self) -> bool {
        !self.parts.iter().any(Progress::acts)
    }

    /// Carries a stage out.
    pub fn run(
        &mut self,
        stage: QuasiNewtonStage,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        state: &mut State<S>,
    ) {
        let solve = Step { dt: self.solve_dt, ..*step };
        let learned = &mut state.learned;
        match stage {
            QuasiNewtonStage::Begin => self.begin(step, data, state),
            QuasiNewtonStage::StartSolve(which) => self.start_solve(which, step, data, learned),
            QuasiNewtonStage::Evaluate => self.evaluate(&solve, data, learned),
            QuasiNewtonStage::Judge => self.judge(&solve, data, learned),
            QuasiNewtonStage::Precondition => self.precondition(&solve, data, learned),
            QuasiNewtonStage::ChooseDirection => self.choose_directions(&solve, data, learned),
            QuasiNewtonStage::Advance => self.advance(&solve, data),
            QuasiNewtonStage::EndSolve(which) => self.end_solve(which, step, data, state),
            QuasiNewtonStage::CheckEnergy => self.check_energy(step, data, learned),
            QuasiNewtonStage::LimitEnergy => self.limit_energy(step, data),
        }
    }

    /// [`QuasiNewtonStage::Evaluate`].
    fn evaluate(&mut self, solve: &Step<'_, S>, data: &mut StepData<S>, learned: &Learned<S>) {
        let Self { evaluation, parts, base, stage_start, trial_gradient, .. } = self;
        let StepData { constants, points, loads, .. } = data;
        let moments = moments(solve, stage_start);
        let way = Way { from: base, to: points, moments };
        let acts = |part: usize| parts[part].acts();
        evaluation.gradient(constants, solve, &way, acts, loads, trial_gradient);
        // Of parts that do not act nothing is read; those of a group act together.
        constants.groups.pool(&mut evaluation.slopes, |a, b| a + b);
        for (number, progress) in parts.iter_mut().enumerate().filter(|(_, part)| part.acts()) {
            let slope = evaluation.slopes[number];
            progress.settled = progress.is_settled_by(slope, learned.parts[number].calm);
            if !progress.settled {
                evaluation.change(constants, solve, &way, number);
            }
        }
        constants.groups.pool(&mut evaluation.changes, Change::plus);
    }

    /// [`QuasiNewtonStage::Judge`].
    fn judge(&mut self, solve: &Step<'_, S>, data: &mut StepData<S>, learned: &mut Learned<S>) {
        let vertices = solve.layout.vertex_count();
        for (number, part) in solve.layout.parts.iter().enumerate() {
            let change = self.evaluation.changes[number];
            let progress = &mut self.parts[number];
            self.has_new_pair[number] = false;
            if !progress.acts() {
                continue;
            }
            let round_off = ROUNDED * S::EPSILON * change.size;
            progress.accepted = match progress.phase {
                Phase::Done => continue,
                _ if progress.settled => true,
                Phase::Starting => change.potential <= round_off,
                Phase::FromReference => true,
                Phase::Iterating => progress.suffices(change.potential, change.size, S::EPSILON),
            };
            let range = part.vertices.clone();
            if !progress.accepted {
                self.reject(number, range, data);
                continue;
            }
            self.take_over(vertices, number, part, data, learned);
            let progress = &mut self.parts[number];
            (progress.phase, progress.failures, progress.ahead) = (Phase::Iterating, 0, false);
        }
    }

    /// Comes nearer to the iterate, or back to the reference where a start was no better.
    fn reject(&mut self, number: usize, range: Range<usize>, data: &mut StepData<S>) {
        let progress = &mut self.parts[number];
        if progress.phase == Phase::Starting {
            progress.phase = Phase::FromReference;
            data.points[range.clone()].copy_from_slice(&self.base[range]);
            return;
        }
        progress.failures += 1;
        progress.rejections += 1;
        progress.length *= SHORTEN;
    }

    /// [`QuasiNewtonStage::Advance`].
    fn advance(&mut self, solve: &Step<'_, S>, data: &mut StepData<S>) {
        for (number, part) in solve.layout.parts.iter().enumerate() {
            let progress = &mut self.parts[number];
            if !progress.acts() {
                continue;
            }
            progress.passes_left -= 1;
            if progress.phase == Phase::Iterating {
                progress.ahead = true;
                let length = S::from_f64(progress.length);
                let range = part.vertices.clone();
                let (x, d) = (&self.base[range.clone()], &self.direction[range.clone()]);
                let points = Shared::new(&mut data.points[range.clone()]);
                vectors::each_piece(&data.constants.workers, range.len(), |range| {
                    for v in range {
                        // SAFETY: pieces do not overlap.
                        unsafe { points.at(v) }.set_vec3(x[v].vec3() + d[v] * length);
                    }
                });
            }
        }
    }
}

fn most_pairs(choices: &[Choice]) -> usize {
    choices.iter().map(|choice| choice.history).max().unwrap_or(0)
}

/// What elements depend on in a solve.
fn moments<'a, S: Real>(solve: &Step<'a, S>, start: &'a [Point<S>]) -> Moments<'a, S> {
    Moments {
        anchors: solve.inputs.anchors_of(&solve.layout.rest_anchors),
        start: Before::Places(start),
        dt: solve.dt,
    }
}
