//! Writes a recording while a simulation runs.

use super::checks::checks;
use super::chunk::{Kind, Writer};
use super::content::{Choices, Frame, Header, RecordedFile, Snapshot};
use crate::scalar::Real;
use crate::simulation::Simulation;

/// A chunk of frames has about so many seconds of the scene: what a crash loses.
const CHUNK: f64 = 0.5;

/// From snapshot to snapshot [s].
const BETWEEN_SNAPSHOTS: f64 = 10.0;

/// Records a simulation.
///
/// ```text
/// let (mut recorder, bytes) = Recorder::begin(&mut simulation, files);    a file begins with these bytes
/// simulation.advance_frame()?; file.write_all(&recorder.frame(&mut simulation))?;      after each frame, before hands act
/// file.write_all(&recorder.end())?;
/// ```
#[derive(Clone, Debug)]
pub struct Recorder {
    writer: Writer,
    /// Those that are not written yet.
    frames: Vec<Frame>,
    /// All that were recorded.
    count: u64,
    /// In frames.
    chunk: u64,
    between_snapshots: u64,
}

impl Recorder {
    /// Begins between two frames, of a scene that needed these files. Returns the first bytes.
    pub fn begin<S: Real>(
        simulation: &mut Simulation<S>,
        files: Vec<RecordedFile>,
    ) -> (Self, Vec<u8>) {
        simulation.remember_acts();
        let frames =
            |seconds: f64| (seconds / simulation.scene().time.frame).round().max(1.0) as u64;
        let (chunk, between_snapshots) = (frames(CHUNK), frames(BETWEEN_SNAPSHOTS));
        let header = Header {
            name: simulation.scene().name.clone(),
            scene: simulation.written().text(),
            files,
            choices: choices(simulation),
        };
        let (mut writer, mut bytes) = Writer::begin();
        bytes.extend(writer.chunk(Kind::Header, &written(&header)));
        let mut recorder = Self { writer, frames: Vec::new(), count: 0, chunk, between_snapshots };
        bytes.extend(recorder.snapshot(simulation));
        (recorder, bytes)
    }

    /// After each frame, before hands do anything. Returns the bytes to write next, mostly none.
    pub fn frame<S: Real>(&mut self, simulation: &mut Simulation<S>) -> Vec<u8> {
        // Of a device that is lost now the next frame reports.
        let _ = simulation.read_state();
        let acts = simulation.take_acts();
        self.frames.push(Frame { acts, checks: checks(simulation) });
        self.count += 1;
        let mut bytes = Vec::new();
        let is_due = self.count.is_multiple_of(self.between_snapshots);
        if is_due || self.count.is_multiple_of(self.chunk) {
            bytes.extend(self.flush());
        }
        if is_due {
            bytes.extend(self.snapshot(simulation));
        }
        bytes
    }

    /// The last bytes: of a recording that ended as it was meant to, or with the failure of a frame.
    pub fn end(mut self) -> Vec<u8> {
        let mut bytes = self.flush();
        bytes.extend(self.writer.chunk(Kind::End, &written(&self.count)));
        bytes
    }

    fn flush(&mut self) -> Vec<u8> {
        let frames = std::mem::take(&mut self.frames);
        if frames.is_empty() {
            return Vec::new();
        }
        self.writer.chunk(Kind::Frames, &written(&frames))
    }

    fn snapshot<S: Real>(&mut self, simulation: &Simulation<S>) -> Vec<u8> {
        let live = simulation.live();
        let snapshot = Snapshot {
            after: self.count,
            live: live.text(simulation.scene()),
            changes: live.changes.into_iter().map(|c| (c.time, c.settings)).collect(),
            saved: simulation.save(),
        };
        self.writer.chunk(Kind::Snapshot, &written(&snapshot))
    }
}

/// What a simulation has chosen.
pub(super) fn choices<S: Real>(simulation: &Simulation<S>) -> Choices {
    Choices {
        method: simulation.solver().method.to_string(),
        elements: format!("{:?}", simulation.solver().elements).to_lowercase(),
        substeps: simulation.substeps(),
        on_device: simulation.is_on_device(),
        device: simulation.device_choice().to_owned(),
    }
}

fn written(content: &impl serde::Serialize) -> Vec<u8> {
    postcard::to_allocvec(content).expect("memory is all that it needs")
}
