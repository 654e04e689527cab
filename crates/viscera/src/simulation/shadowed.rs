//! The run beside a simulation that tells how far forces on its tools are off.

use std::thread;

use super::error::FrameError;
use crate::contact::Wrench;
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use crate::settings::{SolverSettings, Threads};
use crate::solver::{Inputs, Shadow};
use crate::state::{ContactState, State};

/// A second run, and what it is given.
#[derive(Debug)]
pub(super) struct Shadowed<S> {
    shadow: Shadow<S>,
    inputs: Inputs<S>,
    /// Steps of the run beside it in the last frame.
    of_run: u32,
    /// Whether it runs by a thread of its own.
    has_thread: bool,
    /// It has failed, and there is nothing to compare with.
    is_lost: bool,
}

impl<S: Real> Shadowed<S> {
    /// Beside a run with these settings that is in this state.
    pub fn new(
        model: &Model<S>,
        solver: &SolverSettings,
        state: &State<S>,
        inputs: &Inputs<S>,
    ) -> Self {
        let processors = thread::available_parallelism().map_or(1, usize::from);
        Self {
            shadow: Shadow::new(model, solver, state),
            inputs: inputs.clone(),
            of_run: 1,
            has_thread: processors > 1 && solver.threads != Threads::Count(1),
            is_lost: false,
        }
    }

    /// Goes on from where the run beside it is, where nothing touches anything in either.
    pub fn follow(&mut self, state: &State<S>) {
        if self.is_lost || self.shadow.state_mut().contact.touches.is_empty() {
            self.shadow.follow(state);
            self.is_lost = false;
        }
    }

    /// What it has touched.
    pub fn contact_mut(&mut self) -> &mut ContactState {
        &mut self.shadow.state_mut().contact
    }

    /// A frame [s] of both: `run` is the other's, of so many substeps; `act` puts what acts in one of so many into inputs.
    pub fn beside(
        &mut self,
        model: &Model<S>,
        substeps: u32,
        frame: f64,
        act: impl Fn(u32, u32, &mut Inputs<S>) + Sync,
        run: impl FnOnce() -> Result<(), FrameError>,
    ) -> Result<(), FrameError> {
        let Self { shadow, inputs, has_thread, is_lost, of_run } = self;
        *of_run = substeps;
        let count = Shadow::<S>::count(substeps);
        let dt = frame / f64::from(count);
        let mut follow = || {
            let act = |substep, inputs: &mut Inputs<S>| act(substep, count, inputs);
            let followed = shadow.steps(model, inputs, dt, count, act);
            followed.is_err() || !shadow.state_mut().is_finite()
        };
        if *is_lost {
            return run();
        }
        let (ran, lost) = if *has_thread {
            thread::scope(|scope| {
                let beside = scope.spawn(&mut follow);
                let ran = run();
                // A thread that panicked has told why.
                (ran, beside.join().unwrap_or(true))
            })
        } else {
            (run(), follow())
        };
        *is_lost = lost;
        ran
    }

    /// What the frame's end leaves of all velocities.
    pub fn slow_down(&mut self, factor: f64) {
        for velocity in &mut self.shadow.state_mut().velocities {
            *velocity = *velocity * S::from_f64(factor);
        }
    }

    /// At the end of the last frame; nothing where it has run away.
    pub fn wrenches(&self) -> Option<&[Wrench]> {
        (!self.is_lost).then(|| self.shadow.wrenches())
    }

    /// See [`Shadow::error`].
    pub fn error(&self, force: Vec3<f64>, other: Vec3<f64>) -> f64 {
        Shadow::<S>::error(self.of_run, force, other)
    }
}
