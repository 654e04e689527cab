//! The solver: advances a [`State`] by one step of a [`Model`].
//!
//! ```text
//! minimise  1/2 |x - xt|_M^2 + dt^2 V(x),   xt = x_n + dt v_n + dt^2 M^-1 f_ext      implicit Euler
//! XPBD: sweep over constraints, [J M^-1 J^T + a~] dl = -C - a~ l,  x += M^-1 J^T dl,  l += dl
//! ```
//!
//! What one step does is a list of stages ([`plan`]); a backend carries them out ([`cpu`]).

pub mod acceleration;
pub mod balance;
pub mod cpu;
mod energy;
mod explicit;
mod forms;
#[cfg(feature = "gpu")]
pub mod gpu;
mod guard;
mod history;
mod iterates;
mod loads;
pub mod plan;
mod potential;
mod precision;
#[cfg(test)]
mod probe;
mod products;
mod rebase;
mod sweep;
mod team;
mod tethers;
mod tets;
mod threads;
mod tissue;

use crate::model::Model;
use crate::scalar::lanes::Instructions;
use crate::scalar::{Real, Vec3};
use crate::settings::{Method, SolverSettings};
use crate::state::State;
pub use guard::StepReport;
use plan::Plan;
use precision::{Task, carry_out};
#[cfg(feature = "gpu")]
#[doc(hidden)]
pub use tissue::{TISSUE_WGSL, Tissue};

/// A vertex that is moved, not simulated, during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pin<S> {
    /// The vertex.
    pub vertex: u32,
    /// Where it is at the end of the step [m].
    pub target: Vec3<S>,
}

/// A spring without length from a vertex to a place, for the time of a step: how a tool holds tissue that
/// gives way. On a pinned vertex it does nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tether<S> {
    /// The vertex.
    pub vertex: u32,
    /// Where it is pulled to, throughout the step [m].
    pub target: Vec3<S>,
    /// [N/m], zero or more.
    pub stiffness: S,
}

/// What acts on the model from outside during one step.
#[derive(Clone, Debug, PartialEq)]
pub struct Inputs<S> {
    /// Acceleration of gravity [m/s^2].
    pub gravity: Vec3<S>,
    /// Pinned vertices. The set may change from step to step.
    pub pins: Vec<Pin<S>>,
    /// Springs to places outside. The set may change from step to step; several on one vertex add up.
    pub tethers: Vec<Tether<S>>,
    /// Where each attachment's anchor is at the end of the step [m], the user's order. Empty:
    /// all anchors at rest.
    pub anchors: Vec<Vec3<S>>,
    /// External forces [N] on single vertices; several on one vertex add up.
    pub forces: Vec<(u32, Vec3<S>)>,
}

impl<S: Real> Default for Inputs<S> {
    fn default() -> Self {
        Self {
            gravity: Vec3::ZERO,
            pins: Vec::new(),
            tethers: Vec::new(),
            anchors: Vec::new(),
            forces: Vec::new(),
        }
    }
}

impl<S: Real> Inputs<S> {
    /// The same in another precision.
    pub fn cast<T: Real>(&self) -> Inputs<T> {
        let pin = |pin: &Pin<S>| Pin { vertex: pin.vertex, target: pin.target.cast() };
        let tether = |tether: &Tether<S>| Tether {
            vertex: tether.vertex,
            target: tether.target.cast(),
            stiffness: T::from_f64(tether.stiffness.to_f64()),
        };
        Inputs {
            gravity: self.gravity.cast(),
            pins: self.pins.iter().map(pin).collect(),
            tethers: self.tethers.iter().map(tether).collect(),
            anchors: self.anchors.iter().map(|anchor| anchor.cast()).collect(),
            forces: self.forces.iter().map(|&(vertex, force)| (vertex, force.cast())).collect(),
        }
    }

    /// Where the anchors of a model's attachments are, the user's order.
    pub fn anchors_of<'a>(&'a self, model: &'a Model<S>) -> &'a [Vec3<S>] {
        if self.anchors.is_empty() { &model.rest_anchors } else { &self.anchors }
    }
}

/// Why a step cannot be made. The state is unchanged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// The step is not a positive, finite time, or too extreme for the precision in use.
    #[error("the step must be above zero and finite, and so must its square; {dt} s is not")]
    BadStep {
        /// The step given [s].
        dt: f64,
    },
    /// The explicit method would need more small steps than anybody waits for.
    #[error(
        "explicit steps are stable up to {stable:e} s, far below the {dt} s asked for; use \
         `method = \"xpbd\"`, softer tissue, or larger tetrahedra of better shape"
    )]
    TooStiff {
        /// The step given [s].
        dt: f64,
        /// The largest stable one [s].
        stable: f64,
    },
    /// An input names no vertex.
    #[error("a {what} names vertex {vertex}; the model has {vertex_count}")]
    UnknownVertex {
        /// "pin", "tether" or "force".
        what: &'static str,
        /// The index given.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// The list of anchors is neither empty nor complete.
    #[error("{given} anchors for {expected} attachments; give all of them or none")]
    AnchorCount {
        /// How many were given.
        given: usize,
        /// How many there are.
        expected: usize,
    },
    /// An input is infinite or not a number.
    #[error(
        "the {what} of a step must be finite in the solver's precision; look for a slip of the unit"
    )]
    NotFinite {
        /// The input concerned.
        what: &'static str,
    },
    /// The solver was built for a model that hangs together otherwise.
    #[error(
        "the model's connected parts are not those that the solver was built for; build another solver"
    )]
    OtherParts,
    /// State, model and solver do not belong together.
    #[error("the {what} has {given} entries; the model needs {expected}")]
    Mismatch {
        /// The array concerned.
        what: &'static str,
        /// Its length.
        given: usize,
        /// The length that fits.
        expected: usize,
    },
}

/// A solver for one model. All memory is taken when it is built; a step allocates nothing, but for
/// every 63rd step of several threads, which exchanges a block of the queue that leads to them.
#[derive(Clone, Debug)]
pub struct Solver<S> {
    settings: SolverSettings,
    plan: Plan,
    work: cpu::Workspace<S>,
}

impl<S: Real> Solver<S> {
    /// Plans the steps and takes the memory for them.
    pub fn new(model: &Model<S>, settings: &SolverSettings) -> Self {
        Self {
            settings: settings.clone(),
            plan: Plan::new(model, settings),
            work: cpu::Workspace::new(model, settings),
        }
    }

    /// The settings in force.
    pub fn settings(&self) -> &SolverSettings {
        &self.settings
    }

    /// The stages of a step.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Advances the state by one step of `dt` [s].
    ///
    /// On an error nothing has moved. A frame of a scene is `substeps` such steps.
    pub fn step(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.step_first(usize::MAX, model, state, inputs, dt)
    }

    /// As [`Solver::step`]; shows the positions [m] of all vertices, the user's order, where the iteration
    /// starts (0) and after each iteration: for plots of convergence. What ends the step, such as its
    /// guard, comes after the last. Takes memory for the positions. An explicit method, which has no
    /// iterations, is watched after each of its small steps.
    pub fn step_watched(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
        mut watch: impl FnMut(u32, &[Vec3<f64>]) + Send,
    ) -> Result<(), StepError> {
        self.check(model, state, inputs, dt)?;
        let Self { settings, plan, work } = self;
        let repeat = repeats(settings, plan, work, model, inputs, dt)?;
        let step = cpu::Step { model, inputs, dt, settings };
        carry_out(Task::Watched(plan, repeat, &mut watch), work, &step, state);
        Ok(())
    }

    /// Iterations of the steps to come, at least one; neither stages nor memory depend on them.
    pub fn set_iterations(&mut self, count: u32) {
        self.settings.iterations = count.max(1);
        if self.settings.method == Method::Xpbd {
            self.plan.repeat = self.settings.iterations;
        }
    }

    /// As [`Solver::step`], the first so many stages of it.
    fn step_first(
        &mut self,
        count: usize,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.check(model, state, inputs, dt)?;
        let Self { settings, plan, work } = self;
        let repeat = repeats(settings, plan, work, model, inputs, dt)?;
        let step = cpu::Step { model, inputs, dt, settings };
        carry_out(Task::Step(plan, repeat, count), work, &step, state);
        Ok(())
    }

    /// Starts a new history, for a caller who has put vertices elsewhere in `state.positions`: the
    /// multipliers no longer tell where the body comes from, but what its elements answer to the
    /// places the vertices are at now. Positions and velocities stay as they are.
    ///
    /// `inputs` and `dt` are those of the next step; of the inputs the anchors matter.
    pub fn restart(
        &mut self,
        model: &Model<S>,
        state: &mut State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.check(model, state, inputs, dt)?;
        let step = cpu::Step { model, inputs, dt, settings: &self.settings };
        carry_out(Task::Restart, &mut self.work, &step, state);
        Ok(())
    }

    fn check(
        &self,
        model: &Model<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<(), StepError> {
        check_step(dt, model, inputs)?;
        check_state(model, state)?;
        self.work.check(model)
    }

    /// Works with these instructions from now on, or with what the processor has of them. The bits of
    /// all results are the same; this is for tests of that, and for measurements.
    pub fn use_instructions(&mut self, instructions: Instructions) {
        self.work.ground.workers.instructions = instructions.or_detect();
    }

    /// The instructions that kernels are run with.
    pub fn instructions(&self) -> Instructions {
        self.work.ground.workers.instructions
    }

    /// The largest small step [s] of the explicit method in the stiffest part of the model, its margin
    /// included; infinite for others.
    pub fn stable_step(&self) -> f64 {
        self.work.stability.step
    }

    /// Bytes of the memory taken, model and state not included.
    pub fn bytes(&self) -> usize {
        self.work.bytes()
    }

    /// How many threads a step is done by.
    pub fn thread_count(&self) -> usize {
        self.work.ground.workers.count()
    }

    /// How many steps have been taken back for at least one connected part of the model since the solver was
    /// built.
    pub fn rejected_steps(&self) -> u64 {
        self.work.guard.rejected
    }

    /// How the last step ended, for all parts of the model together; nothing before the first, and where
    /// steps are not guarded.
    pub fn last_step(&self) -> Option<StepReport> {
        self.work.guard.report()
    }

    /// How the last step ended for each connected part of the model, see [`Model::part_of`]; empty before the
    /// first, and where steps are not guarded.
    pub fn part_reports(&self) -> &[StepReport] {
        self.work.guard.part_reports()
    }

    /// The force balance at the end of the last step, see [`balance::ForceBalance`]. `inputs` are
    /// those of that step.
    pub fn force_balance(
        &self,
        model: &Model<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        balance: &mut balance::ForceBalance,
    ) -> Result<(), StepError> {
        check_state(model, state)?;
        check_inputs(model, inputs)?;
        self.work.check(model)?;
        balance.measure(model, state, inputs, &self.work);
        Ok(())
    }
}

/// How often the body of the plan is run in a step of `dt` [s].
fn repeats<S: Real>(
    settings: &SolverSettings,
    plan: &Plan,
    work: &mut cpu::Workspace<S>,
    model: &Model<S>,
    inputs: &Inputs<S>,
    dt: f64,
) -> Result<u32, StepError> {
    match settings.method {
        Method::Xpbd => Ok(plan.repeat),
        Method::Explicit => {
            tethers::bundle(model, inputs, &mut work.ground.tethers);
            work.count_small_steps(model, dt)
        }
    }
}

/// A step can be made with these inputs.
fn check_step<S: Real>(dt: f64, model: &Model<S>, inputs: &Inputs<S>) -> Result<(), StepError> {
    // Multipliers are forces times the squared step, so that the square must be a number too.
    let squared = S::from_f64(dt * dt);
    if !(dt > 0.0 && squared > S::ZERO && squared.is_finite()) {
        return Err(StepError::BadStep { dt });
    }
    check_inputs(model, inputs)
}

fn is_legal<S: Real>(tether: &Tether<S>) -> bool {
    tether.target.is_finite() && tether.stiffness >= S::ZERO && tether.stiffness.is_finite()
}

/// The state fits the model.
fn check_state<S: Real>(model: &Model<S>, state: &State<S>) -> Result<(), StepError> {
    let vertex_count = model.vertex_count();
    let lengths = [
        ("list of positions", state.positions.len(), vertex_count),
        ("list of velocities", state.velocities.len(), vertex_count),
        ("list of multipliers", state.multipliers.len(), model.multiplier_count),
    ];
    for (what, given, expected) in lengths {
        if given != expected {
            return Err(StepError::Mismatch { what, given, expected });
        }
    }
    Ok(())
}

/// The inputs fit the model.
fn check_inputs<S: Real>(model: &Model<S>, inputs: &Inputs<S>) -> Result<(), StepError> {
    let vertex_count = model.vertex_count();
    let expected = model.rest_anchors.len();
    if !inputs.anchors.is_empty() && inputs.anchors.len() != expected {
        return Err(StepError::AnchorCount { given: inputs.anchors.len(), expected });
    }
    let vertices = (inputs.pins.iter().map(|pin| ("pin", pin.vertex)))
        .chain(inputs.tethers.iter().map(|tether| ("tether", tether.vertex)))
        .chain(inputs.forces.iter().map(|&(vertex, _)| ("force", vertex)));
    for (what, vertex) in vertices {
        if vertex as usize >= vertex_count {
            return Err(StepError::UnknownVertex { what, vertex, vertex_count });
        }
    }
    let finite = [
        ("gravity", inputs.gravity.is_finite()),
        ("pin targets", inputs.pins.iter().all(|pin| pin.target.is_finite())),
        ("tethers", inputs.tethers.iter().all(is_legal)),
        ("anchors", inputs.anchors.iter().all(|anchor| anchor.is_finite())),
        ("forces", inputs.forces.iter().all(|(_, force)| force.is_finite())),
    ];
    match finite.into_iter().find(|(_, finite)| !finite) {
        Some((what, _)) => Err(StepError::NotFinite { what }),
        None => Ok(()),
    }
}
