//! The run beside a simulation that tells how far forces on its tools are off.

use std::thread;

use super::device::DeviceSolver;
use super::error::FrameError;
use crate::contact::Wrench;
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use crate::settings::{SolverSettings, Threads};
use crate::solver::{Inputs, Shadow};
use crate::state::{ContactState, State};

/// What a run on a device needs to have one: nothing. Pages leave it out, whose size is limited: there no such value exists, and
/// no code that needs one.
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
pub(super) type Possible = ();
#[cfg(not(all(feature = "gpu", not(target_arch = "wasm32"))))]
pub(super) type Possible = std::convert::Infallible;

#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
pub(super) const ON_DEVICE: Option<Possible> = Some(());
#[cfg(not(all(feature = "gpu", not(target_arch = "wasm32"))))]
pub(super) const ON_DEVICE: Option<Possible> = None;

/// A second run, and what it is given.
#[derive(Debug)]
pub(super) struct Shadowed<S> {
    runner: Runner<S>,
    inputs: Inputs<S>,
    /// Steps of the run beside it in the last frame.
    of_run: u32,
    /// It has failed, and there is nothing to compare with.
    is_lost: bool,
}

/// Where it is computed: where the run beside it is.
#[derive(Debug)]
enum Runner<S> {
    Cpu {
        shadow: Box<Shadow<S>>,
        /// Whether it runs by a thread of its own.
        has_thread: bool,
    },
    Device {
        solver: Box<dyn DeviceSolver<S>>,
        /// What moves, where it has to be read.
        state: Box<State<S>>,
        _possible: Possible,
    },
}

impl<S: Real> Shadowed<S> {
    /// Beside a run of the CPU with these settings that is in this state.
    pub fn new(
        model: &Model<S>,
        solver: &SolverSettings,
        state: &State<S>,
        inputs: &Inputs<S>,
    ) -> Self {
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let has_thread = processors > 1 && solver.threads != Threads::Count(1);
        let shadow = Box::new(Shadow::new(model, solver, state));
        Self::by(Runner::Cpu { shadow, has_thread }, inputs)
    }

    /// Beside a run of a device that is in this state.
    pub fn on_device(
        possible: Possible,
        device: &dyn DeviceSolver<S>,
        model: &Model<S>,
        state: State<S>,
        inputs: &Inputs<S>,
    ) -> Result<Self, FrameError> {
        let solver = device.second(model, &state)?;
        Ok(Self::by(Runner::Device { solver, state: Box::new(state), _possible: possible }, inputs))
    }

    fn by(runner: Runner<S>, inputs: &Inputs<S>) -> Self {
        Self { runner, inputs: inputs.clone(), of_run: 1, is_lost: false }
    }

    /// Whether a device computes it.
    pub fn is_on_device(&self) -> bool {
        matches!(self.runner, Runner::Device { .. })
    }

    /// Whether it has failed on a device, where it does not begin again by itself.
    pub fn is_gone(&self) -> bool {
        self.is_lost && self.is_on_device()
    }

    /// Goes on from where the run beside it is, where nothing touches anything in either: from this state, or from that of a
    /// device.
    pub fn follow(&mut self, state: &State<S>, device: Option<&dyn DeviceSolver<S>>) {
        match (&mut self.runner, device) {
            (Runner::Cpu { shadow, .. }, None) => {
                if self.is_lost || shadow.state_mut().contact.touches.is_empty() {
                    shadow.follow(state);
                    self.is_lost = false;
                }
            }
            (Runner::Device { solver, .. }, Some(device)) => {
                if touch_nothing(solver.wrenches()) {
                    solver.follow(device);
                }
            }
            _ => debug_assert!(false, "both runs are computed by one kind"),
        }
    }

    /// Changes what it has touched.
    pub fn change_contact(&mut self, model: &Model<S>, change: impl FnOnce(&mut ContactState)) {
        match &mut self.runner {
            Runner::Cpu { shadow, .. } => change(&mut shadow.state_mut().contact),
            Runner::Device { solver, state, .. } => {
                let mut read = || {
                    solver.read(model, state)?;
                    solver.contact(model, state)
                };
                match read() {
                    Ok(contact) => {
                        state.contact = contact;
                        change(&mut state.contact);
                        solver.write(model, state);
                    }
                    Err(_) => self.is_lost = true,
                }
            }
        }
    }

    /// A frame [s] of both: `run` is the other's, of so many substeps; `act` puts what acts in one of so many into inputs. What
    /// a device computes is sent first: when the other's frame is there it is there as well.
    pub fn beside(
        &mut self,
        model: &Model<S>,
        substeps: u32,
        frame: f64,
        act: impl Fn(u32, u32, &mut Inputs<S>) + Sync,
        run: impl FnOnce() -> Result<(), FrameError>,
    ) -> Result<(), FrameError> {
        let Self { runner, inputs, is_lost, of_run } = self;
        *of_run = substeps;
        let count = Shadow::<S>::count(substeps);
        let dt = frame / f64::from(count);
        let mut act = |substep, inputs: &mut Inputs<S>| act(substep, count, inputs);
        if *is_lost {
            return run();
        }
        let (ran, lost) = match runner {
            Runner::Device { solver, .. } => {
                let lost = solver.steps(model, inputs, dt, count, &mut act).is_err();
                (run(), lost)
            }
            Runner::Cpu { shadow, has_thread } => {
                let mut follow = || {
                    let followed = shadow.steps(model, inputs, dt, count, &mut act);
                    followed.is_err() || !shadow.state_mut().is_finite()
                };
                if *has_thread {
                    thread::scope(|scope| {
                        let beside = scope.spawn(&mut follow);
                        let ran = run();
                        // A thread that panicked has told why.
                        (ran, beside.join().unwrap_or(true))
                    })
                } else {
                    (run(), follow())
                }
            }
        };
        *is_lost = lost;
        ran
    }

    /// Reads the forces of the frame whose other run is there.
    pub fn arrive(&mut self) {
        if let Runner::Device { solver, .. } = &mut self.runner
            && !self.is_lost
        {
            let is_finite = |wrench: &Wrench| (wrench.force + wrench.torque).length().is_finite();
            let is_read = solver.read_forces().is_ok();
            self.is_lost = !is_read || !solver.wrenches().iter().all(is_finite);
        }
    }

    /// What the frame's end leaves of all velocities.
    pub fn slow_down(&mut self, model: &Model<S>, factor: f64) {
        let slow = |velocities: &mut [Vec3<S>]| {
            for velocity in velocities {
                *velocity = *velocity * S::from_f64(factor);
            }
        };
        match &mut self.runner {
            Runner::Cpu { shadow, .. } => slow(&mut shadow.state_mut().velocities),
            Runner::Device { solver, state, .. } => {
                self.is_lost |= solver.read(model, state).is_err();
                slow(&mut state.velocities);
                solver.write_velocities(&state.velocities);
            }
        }
    }

    /// At the end of the last frame; nothing where it has run away.
    pub fn wrenches(&self) -> Option<&[Wrench]> {
        let wrenches = match &self.runner {
            Runner::Cpu { shadow, .. } => shadow.wrenches(),
            Runner::Device { solver, .. } => solver.wrenches(),
        };
        (!self.is_lost).then_some(wrenches)
    }

    /// See [`Shadow::error`].
    pub fn error(&self, force: Vec3<f64>, other: Vec3<f64>) -> f64 {
        Shadow::<S>::error(self.of_run, force, other)
    }
}

/// Whether no tool touches tissue at the end of a step.
pub(super) fn touch_nothing(wrenches: &[Wrench]) -> bool {
    wrenches.iter().all(|wrench| wrench.touches == 0)
}
