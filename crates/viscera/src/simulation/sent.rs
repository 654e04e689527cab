//! Frames: sent to what computes them, and taken over when they are there. Between the two nobody has to wait, which
//! browsers forbid.

use super::error::FrameError;
use super::shadowed::{ON_DEVICE, Shadowed, touch_nothing};
use super::{Simulation, substep_dt};
use crate::scalar::Real;
use crate::solver::{FrameReading, Inputs};
use crate::state::State;

impl<S: Real> Simulation<S> {
    /// Begins a frame: a device is sent all of it, the CPU computes it at once. [`Simulation::take_frame`] takes it over.
    /// `reading`: what of it will be asked for, [`FrameReading::Balance`] for [`Simulation::measure`]. What is done by hand in
    /// between takes the frame back: it is best done before.
    ///
    /// ```text
    /// advance()                        send, wait, take over
    /// send_frame(); take_frame()?      the same without waiting: false while the frame is under way
    /// ```
    pub fn send_frame(&mut self, reading: FrameReading) -> Result<(), FrameError> {
        self.submit_frame()?;
        let asked = self.backend.ask_for_frame(self.at_least(reading));
        self.or_on_the_cpu(asked)
    }

    /// As [`Simulation::advance`]. Where a device computes and `reading` is [`FrameReading::Forces`], what moves stays there, to be
    /// drawn: [`Simulation::state`] and all that is measured of it are of the frame that was read last, until
    /// [`Simulation::read_state`]. Tools, time and what is sent to the device are of this one.
    pub fn advance_reading(&mut self, reading: FrameReading) -> Result<(), FrameError> {
        self.submit_frame()?;
        let reading = self.at_least(reading);
        let wait = |simulation: &mut Self| {
            let Self { backend, model, state, .. } = simulation;
            backend.read_frame(reading, model, state).map(|()| Some(reading))
        };
        self.finish_frame(wait).map(|_| ())
    }

    /// Takes over the frame that was sent; false while it is under way, or where none was.
    pub fn take_frame(&mut self) -> Result<bool, FrameError> {
        let asked = self.backend.asked;
        let take = |simulation: &mut Self| {
            let Self { backend, model, state, .. } = simulation;
            Ok(backend.take_frame(model, state)?.then_some(asked))
        };
        self.finish_frame(take)
    }

    /// Whether a frame was sent and not taken over yet.
    pub fn is_under_way(&self) -> bool {
        self.under_way
    }

    /// Sends the steps of a frame.
    pub(super) fn submit_frame(&mut self) -> Result<(), FrameError> {
        self.begin_frame().map_err(Box::new)?;
        if self.unread == 0 {
            self.before.copy_from_slice(&self.state.positions);
            self.frames_since_before = 0;
        }
        self.under_way = true;
        let sent = self.send_steps();
        self.or_on_the_cpu(sent)
    }

    /// The CPU computes the frame where the device was lost in it, and that is wanted.
    fn or_on_the_cpu(&mut self, computed: Result<(), FrameError>) -> Result<(), FrameError> {
        match computed {
            Err(lost) if self.backend.gives_way_after(&lost) => {
                // Positions are still those that were read last; the multipliers are gone with the device.
                let (time, dt) = (self.time(), self.substep_dt());
                self.backend.give_way(&self.model, &self.solver, time, &lost);
                let inputs = self.inputs_at(time);
                self.state.multipliers.clear();
                self.backend.restart(&self.model, &mut self.state, &inputs, dt)?;
                self.send_steps()
            }
            Err(error) => {
                self.under_way = false;
                Err(error)
            }
            Ok(()) => Ok(()),
        }
    }

    /// The run beside this one goes on from where this one is where it does not exist yet, or where nothing touched anything
    /// in either: what the past has left is gone then.
    fn call_shadow(&mut self) -> Result<(), FrameError> {
        let on_device = self.is_on_device();
        let is_wanted = self.scene.output.force_error.unwrap_or(!on_device)
            && !self.assembly.tools.is_empty()
            && (!on_device || ON_DEVICE.is_some());
        if !is_wanted {
            self.shadow = None;
            return Ok(());
        }
        let device = self.backend.device();
        let is_free = match device {
            Some(device) => touch_nothing(device.wrenches()),
            None => self.state.contact.touches.is_empty(),
        };
        let is_beside = |shadow: &&mut Shadowed<S>| shadow.is_on_device() == on_device;
        if let Some(shadow) = self.shadow.as_mut().filter(is_beside) {
            if !is_free {
                return Ok(());
            }
            if !shadow.is_gone() {
                shadow.follow(&self.state, device);
                return Ok(());
            }
        }
        let (model, inputs) = (&self.model, &self.inputs);
        self.shadow = Some(match (device, ON_DEVICE) {
            (Some(device), Some(possible)) => {
                Shadowed::on_device(possible, device, model, self.whole_state(), inputs)?
            }
            _ => Shadowed::new(model, &self.solver, &self.state, inputs),
        });
        Ok(())
    }

    /// The substeps of a frame.
    fn send_steps(&mut self) -> Result<(), FrameError> {
        // The end of the frame is a time of its own: that of the keys by which holds are led.
        let (start, end) = (self.time(), (self.frame + 1) as f64 * self.scene.time.frame);
        let Self { instruments, assembly, substeps, .. } = self;
        let substeps = instruments.substeps(&assembly.tools, [start, end], *substeps);
        let Self { scene, assembly, taken, state, inputs, backend, .. } = self;
        taken.act(scene, assembly, end, inputs);
        let of_frame = (scene.time.frame, substeps);
        let substeps = substeps * backend.times_for_contact(state, inputs, of_frame);
        let dt = substep_dt(&self.scene, substeps);
        self.divided = substeps;
        self.call_shadow()?;
        let Self { scene, assembly, taken, instruments, model, state, inputs, backend, .. } = self;
        self.rejected_before = backend.rejected_steps();
        let act = |substep: u32, count: u32, inputs: &mut Inputs<S>| {
            let share = f64::from(substep) * substep_dt(scene, count);
            let time = if substep == count { end } else { start + share };
            taken.act(scene, assembly, time, inputs);
            instruments.act(&assembly.tools, time, inputs);
        };
        let mut run = |state: &mut State<S>| {
            let in_run = |substep, inputs: &mut Inputs<S>| act(substep, substeps, inputs);
            backend.steps(model, state, inputs, dt, substeps, in_run)
        };
        match &mut self.shadow {
            Some(shadow) => shadow.beside(model, substeps, scene.time.frame, act, || run(state)),
            None => run(state),
        }
    }

    /// What is left of a frame once it is there: `take` gets what was to be read of it, and says what that is, or that it is
    /// under way.
    fn finish_frame(
        &mut self,
        take: impl FnOnce(&mut Self) -> Result<Option<FrameReading>, FrameError>,
    ) -> Result<bool, FrameError> {
        if !self.under_way {
            return Ok(false);
        }
        let taken = take(self);
        let is_unread = match taken {
            Ok(None) => return Ok(false),
            Ok(Some(reading)) => reading == FrameReading::Forces && self.is_on_device(),
            Err(lost) => {
                self.or_on_the_cpu(Err(lost))?;
                false
            }
        };
        self.unread = if is_unread { self.unread + 1 } else { 0 };
        self.frames_since_before += 1;
        self.under_way = false;
        self.rejected_substeps = self.backend.rejected_steps() - self.rejected_before;
        self.frame += 1;
        self.stepped = true;
        self.wrenches = None;
        if let Some(shadow) = &mut self.shadow {
            shadow.arrive();
        }
        self.lead_jaws();
        if !self.state.is_finite() || self.backend.is_beyond_numbers() {
            return Err(self.diverged());
        }
        let factor = self.scene.time.velocity_factor;
        if factor != 1.0 {
            for velocity in &mut self.state.velocities {
                *velocity = *velocity * S::from_f64(factor);
            }
            if let Some(shadow) = &mut self.shadow {
                shadow.slow_down(&self.model, factor);
            }
            if let Some(device) = self.backend.device_mut() {
                device.write_velocities(&self.state.velocities);
            }
        }
        Ok(true)
    }
}
