//! Frames: computed one after the other, measured now and then, shown.

use std::time::{Duration, Instant};
use viscera::solver::FrameReading;
use viscera_stage::Coloring;

use super::{LOOKED_AT, MEASURED_EVERY, MOST_LATE, Worker};
use crate::engine::{Cure, Event, Failure};

impl Worker {
    /// What is read of a frame. A picture of one simulation alone may need no positions: two are compared by theirs.
    fn reading(&self) -> FrameReading {
        let runs = self.running.as_ref().map_or(&[][..], |running| &running.runs);
        let is_looked_at = self.looked.is_some_and(|since| since.elapsed() < LOOKED_AT);
        match (runs, &self.device) {
            ([run], Some(device))
                if !is_looked_at && run.is_drawn_unread(device, self.coloring) =>
            {
                FrameReading::Forces
            }
            _ => FrameReading::State,
        }
    }

    /// Computes a frame of each simulation, one after the other: they stay at one time.
    pub(super) fn advance(&mut self) {
        let reading = self.reading();
        let Some(running) = &mut self.running else { return };
        let mut failed = None;
        for (run, wall) in running.runs.iter_mut().zip(&mut running.walls) {
            let start = Instant::now();
            failed = failed.or(run.advance(reading).err());
            *wall = start.elapsed().as_secs_f64();
        }
        self.record_frame();
        let Some(running) = &mut self.running else { return };
        let told = running.runs.iter_mut().find_map(|run| run.told());
        running.number += 1;
        self.steps = self.steps.saturating_sub(1);
        let frame = Duration::try_from_secs_f64(running.setup.scene.time.frame / self.speed);
        self.due += frame.unwrap_or_default();
        // What is lost is not caught up with: tissue would jump.
        if let Some(earliest) = Instant::now().checked_sub(MOST_LATE) {
            self.due = self.due.max(earliest);
        }
        told.into_iter().for_each(|message| self.warn_once(message));
        match failed {
            None => self.publish(),
            // The last frame stays to be seen; Reset begins anew.
            Some(message) => self.stop(message),
        }
    }

    /// Stops where a simulation has failed.
    pub(super) fn stop(&mut self, message: String) {
        self.end_record(Some("the simulation has stopped".to_owned()));
        (self.playing, self.steps) = (false, 0);
        self.tell(Event::Failed(Failure { message, cure: Cure::Reset }));
    }

    /// Whether this frame is to be measured: colours need it, or the last time was long ago. What is held
    /// rigidly has its force from there.
    fn is_measured(&mut self) -> bool {
        let colors = matches!(self.coloring, Coloring::Strain | Coloring::Stress)
            && self.reading() != FrameReading::Forces;
        let long_ago = self.measured.is_none_or(|since| since.elapsed() > MEASURED_EVERY);
        // Of frames that take longer than that, every other one.
        let is_due = long_ago && !self.was_due || !self.playing;
        self.was_due = is_due;
        if is_due {
            self.measured = Some(Instant::now());
        }
        colors || is_due
    }

    pub(super) fn publish(&mut self) {
        let measured = self.is_measured();
        let Some(running) = &mut self.running else { return };
        let mut failed = None;
        let mut snapshot = self.exchange.blank();
        snapshot.generation = running.setup.generation;
        snapshot.number = running.number;
        snapshot.time = running.number as f64 * running.setup.scene.time.frame;
        snapshot.coloring = self.coloring;
        snapshot.runs.resize_with(running.runs.len(), Default::default);
        for ((filled, run), wall) in
            snapshot.runs.iter_mut().zip(&mut running.runs).zip(&running.walls)
        {
            if measured && let Err(message) = run.measure() {
                failed = Some(message);
            }
            run.fill(self.coloring, self.device.as_ref(), filled);
            filled.wall = *wall;
        }
        self.exchange.publish(snapshot);
        (self.wake)();
        match failed {
            None if measured => {
                self.tell_devices();
                self.probe();
            }
            None => {}
            Some(message) => self.stop(message),
        }
    }
}
