//! What moves, where a device computes: read when it is asked for, and not before.
//!
//! ```text
//! advance_reading(Forces)     what moves stays on the device: `state` is of an earlier frame, `unread` frames ago
//! read_state                  it is here; whoever changes it between frames asks for it first
//! whole_state                 a copy of all of it, for who cannot change the simulation: to save it, to fork it
//! ```

use std::borrow::Cow;

use super::Simulation;
use super::error::FrameError;
use crate::contact::Touch;
use crate::scalar::Real;
use crate::solver::{FrameReading, Solver};
use crate::state::{ContactState, State};

impl<S: Real> Simulation<S> {
    /// What has to be read of a frame at least: velocities that are slowed down between frames are known here.
    pub(super) fn at_least(&self, reading: FrameReading) -> FrameReading {
        let is_slowed = self.scene.time.velocity_factor != 1.0;
        if is_slowed { reading.max(FrameReading::State) } else { reading }
    }

    /// Frames since the one whose positions and velocities [`Simulation::state`] has; above zero only where a device computes and
    /// frames were asked for without them.
    pub fn unread_frames(&self) -> u64 {
        self.unread
    }

    /// Waits for positions and velocities of the last frame, where they are not here yet.
    pub fn read_state(&mut self) -> Result<(), FrameError> {
        if self.unread > 0 {
            let Self { backend, model, state, .. } = self;
            backend.read_frame(FrameReading::State, model, state)?;
            self.unread = 0;
            if !self.state.is_finite() {
                return Err(self.diverged());
            }
        }
        Ok(())
    }

    /// As [`Simulation::read_state`], for what goes on with whatever is known: of a device that is lost that is the frame that was
    /// read last.
    pub(super) fn refresh_state(&mut self) {
        let _ = self.read_state();
        self.unread = 0;
    }

    /// What moves, the multipliers included, wherever they are. Where a device is lost they are what the tissue
    /// answers to its places.
    pub(super) fn whole_state(&self) -> State<S> {
        let mut state = self.current_state().into_owned();
        state.contact = self.contact_of(&state);
        let Some(device) = self.backend.device() else { return state };
        match device.multipliers(&self.model) {
            Ok(multipliers) => state.multipliers = multipliers,
            Err(_) => {
                let (inputs, dt) = (self.inputs_at(self.time()), self.substep_dt());
                let mut solver = Solver::new(&self.model, &self.solver);
                let restarted = solver.restart(&self.model, &mut state, &inputs, dt);
                debug_assert!(restarted.is_ok(), "{restarted:?}");
            }
        }
        state
    }

    /// Positions and velocities of the last frame; of a device that is lost, those that were read last.
    pub(super) fn current_state(&self) -> Cow<'_, State<S>> {
        let mut state = Cow::Borrowed(&self.state);
        if self.unread > 0
            && let Some(device) = self.backend.device()
        {
            let _ = device.read(&self.model, state.to_mut());
        }
        state
    }

    /// What tools touch in [`Simulation::state`]: of a device, for which this waits where the frame was not sent with
    /// [`FrameReading::Balance`].
    pub fn touches(&self) -> Cow<'_, [Touch]> {
        let touches = &self.state.contact.touches;
        match touches.is_empty() && self.unread == 0 && self.is_on_device() {
            true => Cow::Owned(self.contact_of(&self.state).touches),
            false => Cow::Borrowed(touches),
        }
    }

    /// What is kept of contact in a state that is the last frame's; where a device is lost, where its tools were.
    pub(super) fn contact_of(&self, state: &State<S>) -> ContactState {
        let read = self.backend.device().map(|device| device.contact(&self.model, state));
        read.and_then(Result::ok).unwrap_or_else(|| state.contact.clone())
    }
}
