//! Memory of the CPU backend, and the dispatch of stages to their families.

use std::sync::Arc;

use crate::elements::law::LAWS;
use crate::model::{Model, Part};
use crate::scalar::Real;
use crate::settings::{Method, SolverSettings};
use crate::solver::error::StepError;
use crate::solver::inputs::Inputs;
use crate::solver::plan::{Plan, Stage};
use crate::solver::step::data::{Step, StepData};
use crate::solver::step::guard::Guard;
use crate::solver::{explicit, step, xpbd};
use crate::state::State;

/// Everything that a step needs beside model and state.
#[derive(Clone, Debug)]
pub struct Memory<S> {
    /// [`sizes`] of the model that this is for.
    sizes: [usize; SIZES],
    /// The connected parts of that model.
    parts: Arc<[Part]>,
    pub data: StepData<S>,
    /// Nothing where steps are not guarded.
    pub guard: Option<Guard<S>>,
    pub method: MethodMemory<S>,
}

/// The method's own memory.
#[derive(Clone, Debug)]
pub enum MethodMemory<S> {
    Xpbd(xpbd::Memory<S>),
    Explicit(explicit::Memory<S>),
}

impl<S: Real> Memory<S> {
    /// Memory for the steps of a model.
    pub fn new(model: &Model<S>, settings: &SolverSettings) -> Self {
        let (method, needs_loads) = match settings.method {
            Method::Xpbd => {
                let memory = xpbd::Memory::new(model, settings);
                (MethodMemory::Xpbd(memory), xpbd::needs_loads(settings))
            }
            Method::Explicit => {
                (MethodMemory::Explicit(explicit::Memory::new(model, settings)), true)
            }
        };
        Self {
            sizes: sizes(model).map(|(_, size)| size),
            parts: Arc::clone(&model.parts),
            data: StepData::new(model, settings, needs_loads),
            guard: settings.guards_steps().then(|| Guard::new(model)),
            method,
        }
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        let of_method = match &self.method {
            MethodMemory::Xpbd(memory) => memory.bytes(),
            MethodMemory::Explicit(memory) => memory.bytes(),
        };
        self.data.bytes() + self.guard.as_ref().map_or(0, Guard::bytes) + of_method
    }

    /// The largest small step [s] of the explicit method; infinite for others.
    pub fn stable_step(&self) -> f64 {
        match &self.method {
            MethodMemory::Explicit(memory) => memory.stability.step,
            MethodMemory::Xpbd(_) => f64::INFINITY,
        }
    }

    /// How often the body of the plan is run in a step of `dt` [s].
    pub fn repeats(
        &mut self,
        plan: &Plan,
        model: &Model<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> Result<u32, StepError> {
        match &mut self.method {
            MethodMemory::Xpbd(_) => Ok(plan.repeat),
            MethodMemory::Explicit(memory) => {
                memory.count_small_steps(model, inputs, &mut self.data, dt)
            }
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
            (Stage::Xpbd(stage), MethodMemory::Xpbd(memory)) => {
                memory.run(stage, step, data, guard.as_mut(), state);
            }
            (Stage::Explicit(stage), MethodMemory::Explicit(memory)) => {
                memory.run(stage, step, data, state);
            }
            (stage, _) => unreachable!("{stage:?} is not of the method that the memory is for"),
        }
    }

    /// The model is one of the same shape as that for which the memory was taken, and its elements
    /// stay within that memory.
    pub fn check(&self, model: &Model<S>) -> Result<(), StepError> {
        for (given, (what, expected)) in self.sizes.into_iter().zip(sizes(model)) {
            if given != expected {
                return Err(StepError::Mismatch { what, given, expected });
            }
        }
        if !Arc::ptr_eq(&self.parts, &model.parts) && self.parts != model.parts {
            return Err(StepError::OtherParts);
        }
        // Of what decides where passes read and write, callers can change the number of vertices and
        // the form of a set. A set without copies of its own goes by vertices among copies as well.
        let vertices = model.vertex_count().min(model.copy_count());
        for set in &model.tet_sets {
            let [elastic, viscous] = set.multiplier_counts();
            for (what, given, expected) in [
                ("model's list of vertices", vertices, set.bounds[0]),
                ("model's list of copies", model.copy_count(), set.bounds[1]),
                // Both kinds are written side by side: neither reaches into the other's places.
                ("model's multipliers", set.viscous_offset, set.multiplier_offset + elastic),
                ("model's multipliers", model.multiplier_count, set.viscous_offset + viscous),
            ] {
                if given < expected {
                    return Err(StepError::Mismatch { what, given, expected });
                }
            }
        }
        Ok(())
    }
}

/// Everything in a model that decides how much memory a step needs and which stages it has.
pub fn sizes<S: Real>(model: &Model<S>) -> [(&'static str, usize); SIZES] {
    let mut sizes = [("", 0); SIZES];
    sizes[..5].copy_from_slice(&[
        ("solver's list of vertices", model.vertex_count()),
        ("solver's list of multipliers", model.multiplier_count),
        ("solver's list of parts", model.part_count()),
        ("solver's list of colors", model.color_count),
        ("solver's list of copies", model.copy_count()),
    ]);
    for (three, set) in sizes[5..].chunks_exact_mut(3).zip(&model.tet_sets) {
        three.copy_from_slice(&[
            ("solver's list of tetrahedra of one law", set.len()),
            ("solver's blocks of tetrahedra of one law", set.block_count()),
            ("solver's list of viscous tetrahedra", if set.viscous { set.len() } else { 0 }),
        ]);
    }
    sizes
}

/// How many there are.
pub const SIZES: usize = 5 + 3 * LAWS;
