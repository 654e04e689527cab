//! Memory of the CPU backend, and the dispatch of stages to their families.

use crate::layout::Layout;
use crate::scalar::Real;
use crate::settings::{Method, SolverSettings};
use crate::solver::error::StepError;
use crate::solver::inputs::Inputs;
use crate::solver::oscillations::Oscillations;
use crate::solver::plan::{Flag, Stage};
use crate::solver::report::StepReport;
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::energy::Ledger;
use crate::solver::step::guard::Guard;
use crate::solver::{explicit, quasi_newton, step, xpbd};
use crate::state::{Learned, State};

/// Everything that a step needs beside model and state.
#[derive(Clone, Debug)]
pub struct Memory<S> {
    pub data: StepData<S>,
    /// Nothing where steps are not guarded.
    pub guard: Option<Guard<S>>,
    pub method: MethodMemory<S>,
}

/// The method's own memory.
#[derive(Clone, Debug)]
pub enum MethodMemory<S> {
    Xpbd(Box<xpbd::Memory<S>>),
    Explicit(Box<explicit::Memory<S>>),
    QuasiNewton(Box<quasi_newton::Memory<S>>),
}

impl<S: Real> Memory<S> {
    /// Memory for the steps of a model.
    pub fn new(layout: &Layout<S>, settings: &SolverSettings) -> Self {
        let (method, needs_loads) = match settings.method {
            Method::Xpbd => {
                let memory = xpbd::Memory::new(layout, settings);
                (MethodMemory::Xpbd(Box::new(memory)), xpbd::needs_loads(settings))
            }
            Method::Explicit => {
                (MethodMemory::Explicit(Box::new(explicit::Memory::new(layout, settings))), true)
            }
            Method::Auto | Method::QuasiNewton => {
                let memory = quasi_newton::Memory::new(layout, settings);
                (MethodMemory::QuasiNewton(Box::new(memory)), true)
            }
        };
        Self {
            data: StepData::new(layout, settings, needs_loads),
            guard: settings.guards_steps().then(|| Guard::new(layout)),
            method,
        }
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        let of_method = match &self.method {
            MethodMemory::Xpbd(memory) => memory.bytes(),
            MethodMemory::Explicit(memory) => memory.bytes(),
            MethodMemory::QuasiNewton(memory) => memory.bytes(),
        };
        self.data.bytes() + self.guard.as_ref().map_or(0, Guard::bytes) + of_method
    }

    /// Steps that were rejected for at least one part.
    pub fn rejected_steps(&self) -> u64 {
        match &self.method {
            MethodMemory::QuasiNewton(memory) => memory.rejected,
            _ => self.guard.as_ref().map_or(0, |guard| guard.rejected),
        }
    }

    /// How the last step ended for each part; empty before the first, and where steps are not judged.
    pub fn part_reports(&self) -> &[StepReport] {
        match &self.method {
            MethodMemory::QuasiNewton(memory) => &memory.reports,
            _ => self.guard.as_ref().map_or(&[], |guard| guard.part_reports()),
        }
    }

    /// See [`crate::solver::Solver::ledger`].
    pub fn ledger(&self) -> Ledger {
        match &self.method {
            MethodMemory::Xpbd(_) => {
                self.guard.as_ref().map_or(Ledger::default(), |guard| guard.ledger())
            }
            MethodMemory::Explicit(memory) => memory.ledger(),
            MethodMemory::QuasiNewton(memory) => memory.ledger(),
        }
    }

    /// The largest small step [s] of the explicit method; infinite for others.
    pub fn stable_step(&self) -> f64 {
        match &self.method {
            MethodMemory::Explicit(memory) => memory.stability.step,
            MethodMemory::Xpbd(_) | MethodMemory::QuasiNewton(_) => f64::INFINITY,
        }
    }

    /// The most small steps that a step of `dt` [s] has: what [`Times::SmallSteps`] stands for. One where the method
    /// has none.
    ///
    /// [`Times::SmallSteps`]: crate::solver::plan::Times::SmallSteps
    pub fn repeats(
        &mut self,
        layout: &Layout<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<u32, StepError> {
        match &mut self.method {
            MethodMemory::Xpbd(_) | MethodMemory::QuasiNewton(_) => Ok(1),
            MethodMemory::Explicit(memory) => {
                memory.count_small_steps(layout, inputs, &mut self.data, dt)
            }
        }
    }

    /// Whether a loop that waits for the flag ends.
    pub fn is_set(&self, flag: Flag) -> bool {
        match (flag, &self.method) {
            // It makes all the passes that it is given.
            (Flag::AllDone, MethodMemory::Xpbd(_)) => false,
            (Flag::AllDone, MethodMemory::Explicit(memory)) => memory.is_all_done(),
            (Flag::AllDone, MethodMemory::QuasiNewton(memory)) => memory.is_all_done(),
            (Flag::NothingDescends, _) => self.guard.as_ref().is_none_or(Guard::nothing_descends),
        }
    }

    /// Room for what the method learns.
    pub fn nothing_learned(&self, layout: &Layout<S>) -> Learned<S> {
        let mut learned = Learned::default();
        let history = match &self.method {
            MethodMemory::Xpbd(_) => return learned,
            MethodMemory::Explicit(_) => 0,
            MethodMemory::QuasiNewton(memory) => memory.history(),
        };
        learned.clear(history, layout.vertex_count(), layout.part_count());
        learned
    }

    /// See [`crate::solver::Solver::oscillations`].
    pub fn oscillations(&mut self, step: &Step<'_, S>) -> Oscillations {
        match &mut self.method {
            MethodMemory::QuasiNewton(memory) => {
                // Of what fixings hold: tools come and go.
                self.data.constants.contacts.clear();
                memory.oscillations(step, &mut self.data)
            }
            _ => Oscillations::default(),
        }
    }

    /// Starts a new history: what was learned is forgotten, multipliers follow from positions.
    pub fn restart(&mut self, step: &Step<'_, S>, state: &mut State<S>) {
        state.learned = Learned::default();
        if !matches!(self.method, MethodMemory::QuasiNewton(_)) {
            xpbd::history::restart(step, &mut self.data, state);
        }
    }

    /// Carries a stage out.
    ///
    /// # Panics
    /// Where the stage is of another method than the memory.
    pub fn run(&mut self, stage: &Stage, step: &Step<'_, S>, state: &mut State<S>) {
        let Self { data, guard, method, .. } = self;
        match (*stage, method) {
            (Stage::Step(stage), _) => step::run(stage, step, data, guard.as_mut(), state),
            (Stage::Guard(stage), _) => {
                if let Some(guard) = guard {
                    guard.run(stage, step, data);
                }
            }
            (Stage::Xpbd(stage), MethodMemory::Xpbd(memory)) => {
                memory.run(stage, step, data, guard.as_mut(), state);
            }
            (Stage::Explicit(stage), MethodMemory::Explicit(memory)) => {
                memory.run(stage, step, data, state);
            }
            (Stage::QuasiNewton(stage), MethodMemory::QuasiNewton(memory)) => {
                memory.run(stage, step, data, state);
            }
            (stage, _) => unreachable!("{stage:?} is not of the method that the memory is for"),
        }
    }
}
