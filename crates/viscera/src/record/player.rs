//! Reads a recording, and plays it once more.

use super::checks::{Quantity, difference, hash_of};
use super::chunk::{self, FORMAT, Kind, Next, Prefix};
use super::content::{Choices, Frame, Header, RecordedFile, Snapshot};
use super::recorder::choices;
use crate::scalar::Real;
use crate::scene::{Scene, SceneError};
use crate::simulation::{
    FrameError, LiveError, ResumeError, SavedDifference, Simulation, difference_of_saved,
};

/// Why a file is no recording that can be played.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// It does not begin like one.
    #[error(
        "this is no recording; give a file that `viscera run --record` or the window has written"
    )]
    NotRecording,
    /// It was written by another version.
    #[error(
        "it was recorded by viscera {version} in format {format}, and this program, {}, reads format {FORMAT}; replay it \
         with that version", env!("CARGO_PKG_VERSION")
    )]
    Format {
        /// The format found.
        format: u32,
        /// The version that wrote it.
        version: String,
    },
    /// It ends before anything can be played.
    #[error(
        "it was cut off at byte {at}, before its first frame; there is nothing to replay, record it again"
    )]
    Empty {
        /// Where it ends.
        at: usize,
    },
    /// It was changed before anything can be played.
    #[error(
        "it is damaged at byte {at}, before its first frame; there is nothing to replay, take another copy of it"
    )]
    Damaged {
        /// Where the damaged chunk begins.
        at: usize,
    },
    /// Its scene is none, with what was laid over it.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A file is another one.
    #[error(
        "file `{name}` is not the one that was recorded: it has {found} bytes or others than the {length} of that one; find that one"
    )]
    File {
        /// The file.
        name: String,
        /// The length recorded.
        length: u64,
        /// The length found.
        found: u64,
    },
    /// Another choice than the recorded one.
    #[error(
        "it was recorded with {what} {recorded} ({device}), and here it would be {here}: results have other bits; {cure}"
    )]
    Choice {
        /// What was chosen.
        what: &'static str,
        /// In the recording.
        recorded: String,
        /// Here.
        here: String,
        /// What computed the recording.
        device: String,
        /// What to do.
        cure: &'static str,
    },
    /// The state at which it begins is none of this program.
    #[error(transparent)]
    Resume(#[from] ResumeError),
    /// What hands had done by then cannot be.
    #[error(transparent)]
    Live(#[from] LiveError),
}

/// How a recording ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// With its end.
    Complete,
    /// It was cut off, at this byte: frames behind the last complete chunk are lost.
    Cut {
        /// The length of the file.
        at: usize,
    },
    /// It was changed: what is behind is not to be trusted.
    Damaged {
        /// Where the damaged chunk begins.
        at: usize,
    },
}

/// Why a replay ends early.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// Something has other bits.
    #[error(
        "frame {frame} of the recording, at {time:.4} s: {quantity} differ from the recorded ones{hint}"
    )]
    Differs {
        /// From 1 on.
        frame: u64,
        /// Since the recording began [s].
        time: f64,
        /// The first that differs.
        quantity: Box<Quantity>,
        /// What may have caused it.
        hint: String,
    },
    /// What hands did cannot be done again.
    #[error(
        "frame {frame} of the recording: what was done before it cannot be done again: {error}"
    )]
    Act {
        /// From 1 on.
        frame: u64,
        /// Why not.
        error: Box<LiveError>,
    },
    /// A frame cannot be computed.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A snapshot on the way cannot be read.
    #[error(transparent)]
    Resume(#[from] ResumeError),
}

/// A recording that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    version: String,
    header: Header,
    frames: Vec<Frame>,
    /// At least one.
    snapshots: Vec<Snapshot>,
    ending: Ending,
}

impl Recording {
    /// Reads as much of a recording as is there and unchanged.
    pub fn read(bytes: &[u8]) -> Result<Self, RecordError> {
        let (version, mut chunks) = match chunk::prefix(bytes) {
            Prefix::Foreign => return Err(RecordError::NotRecording),
            Prefix::Cut => return Err(RecordError::Empty { at: bytes.len() }),
            Prefix::Other { format, version } => {
                return Err(RecordError::Format { format, version });
            }
            Prefix::Known { version, chunks } => (version, chunks),
        };
        let (mut header, mut frames, mut snapshots) = (None, Vec::<Frame>::new(), Vec::new());
        let ending = loop {
            let at = chunks.at();
            let damaged = Ending::Damaged { at };
            let is_read = match chunks.next() {
                Next::Nothing | Next::Cut => break Ending::Cut { at: bytes.len() },
                Next::Damaged => break damaged,
                Next::Chunk(Kind::Header, content) => {
                    header = postcard::from_bytes::<Header>(content).ok();
                    header.is_some()
                }
                Next::Chunk(Kind::Frames, content) => {
                    let read = postcard::from_bytes::<Vec<Frame>>(content);
                    read.map(|read| frames.extend(read)).is_ok()
                }
                Next::Chunk(Kind::Snapshot, content) => {
                    let read = postcard::from_bytes::<Snapshot>(content);
                    let read = read.ok().filter(|read| read.after == frames.len() as u64);
                    let is_read = read.is_some();
                    snapshots.extend(read);
                    is_read
                }
                Next::Chunk(Kind::End, _) => {
                    // Nothing is behind the end.
                    break match chunks.next() {
                        Next::Nothing => Ending::Complete,
                        _ => Ending::Damaged { at: chunks.at() },
                    };
                }
            };
            if !is_read {
                break damaged;
            }
        };
        match (header.filter(|_| !snapshots.is_empty()), ending) {
            (Some(header), ending) => Ok(Self { version, header, frames, snapshots, ending }),
            (None, Ending::Damaged { at }) => Err(RecordError::Damaged { at }),
            (None, _) => Err(RecordError::Empty { at: bytes.len() }),
        }
    }

    /// The version of the program that has recorded it.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// How it ends.
    pub fn ending(&self) -> Ending {
        self.ending
    }

    /// Frames that can be played.
    pub fn frame_count(&self) -> u64 {
        self.frames.len() as u64
    }

    /// What was chosen for it.
    pub fn choices(&self) -> &Choices {
        &self.header.choices
    }

    /// Files that the scene needs.
    pub fn files(&self) -> &[RecordedFile] {
        &self.header.files
    }

    /// Of the bytes of a file as the scene names it: those recorded, or those that `load` finds, where they are the same.
    pub fn file(
        &self,
        name: &str,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Vec<u8>, String> {
        let recorded = self.header.files.iter().find(|file| file.name == name);
        if let Some(content) = recorded.and_then(|file| file.content.clone()) {
            return Ok(content);
        }
        let bytes = load(name)?;
        match recorded.filter(|file| hash_of(&bytes) != file.hash) {
            Some(&RecordedFile { length, .. }) => {
                let (name, found) = (name.to_owned(), bytes.len() as u64);
                Err(RecordError::File { name, length, found }.to_string())
            }
            None => Ok(bytes),
        }
    }

    /// The scene from a frame of the recording on, zero at its beginning, with what hands had done by the last snapshot
    /// before it, and settings laid over it: `solver.threads` leaves every bit as it is.
    pub fn scene(&self, from: u64, settings: &[(&str, &str)]) -> Result<Scene, RecordError> {
        let text = format!("{}{}", self.header.scene, self.snapshot(from).live);
        Ok(Scene::parse(&self.header.name, &text, settings)?)
    }

    /// A simulation of [`Recording::scene`] where the recording has the last snapshot before a frame, and what plays it
    /// from there.
    pub fn start<S: Real>(
        &self,
        from: u64,
        simulation: Simulation<S>,
        settings: &[(&str, &str)],
    ) -> Result<(Simulation<S>, Player<'_>), RecordError> {
        let snapshot = self.snapshot(from);
        let mut simulation = simulation.resume(&snapshot.saved)?;
        let written = Scene::parse(&self.header.name, &self.header.scene, settings)?;
        simulation.came_by_hand(written, snapshot.changes())?;
        if snapshot.after == 0 {
            self.check_choices(&choices(&simulation))?;
        }
        let hint = match simulation.device_choice() {
            here if here == self.header.choices.device => String::new(),
            here => {
                format!("; it was recorded on {}, and this is {here}", self.header.choices.device)
            }
        };
        Ok((simulation, Player { recording: self, next: snapshot.after, hint }))
    }

    /// The last one before a frame.
    fn snapshot(&self, from: u64) -> &Snapshot {
        let later = self.snapshots.partition_point(|snapshot| snapshot.after <= from);
        &self.snapshots[later.saturating_sub(1)]
    }

    fn check_choices(&self, here: &Choices) -> Result<(), RecordError> {
        let recorded = &self.header.choices;
        let kind = |on_device: bool| if on_device { "graphics processor" } else { "CPU" };
        let pairs = [
            ("a", kind(recorded.on_device).to_owned(), kind(here.on_device).to_owned()),
            ("method", recorded.method.clone(), here.method.clone()),
            ("tetrahedra", recorded.elements.clone(), here.elements.clone()),
            ("substeps", recorded.substeps.to_string(), here.substeps.to_string()),
        ];
        let cure = match recorded.on_device {
            true => "replay it where there is such a graphics processor",
            false => "replay it with the version and the settings that recorded it",
        };
        match pairs.into_iter().find(|(_, recorded, here)| recorded != here) {
            Some((what, recorded, here)) => {
                let device = self.header.choices.device.clone();
                Err(RecordError::Choice { what, recorded, here, device, cure })
            }
            None => Ok(()),
        }
    }
}

/// Plays a recording frame by frame.
#[derive(Clone, Debug)]
pub struct Player<'a> {
    recording: &'a Recording,
    /// The frame to come.
    next: u64,
    hint: String,
}

impl Player<'_> {
    /// How many frames of the recording were played, those before its beginning among them.
    pub fn played(&self) -> u64 {
        self.next
    }

    /// Does what hands did, computes the next frame and compares it. False at the end of the recording.
    pub fn step<S: Real>(&mut self, simulation: &mut Simulation<S>) -> Result<bool, ReplayError> {
        let Some(recorded) = self.recording.frames.get(self.next as usize) else {
            return Ok(false);
        };
        self.next += 1;
        for act in &recorded.acts {
            simulation.act(act).map_err(|error| {
                let error = Box::new(error);
                ReplayError::Act { frame: self.next, error }
            })?;
        }
        simulation.advance_frame()?;
        let differs = difference(simulation, &recorded.checks);
        match differs {
            Some(quantity) => Err(self.differs(simulation, quantity)),
            None => self.compare_snapshot(simulation).map(|()| true),
        }
    }

    /// All that is kept, where the recording has that here.
    fn compare_snapshot<S: Real>(&self, simulation: &Simulation<S>) -> Result<(), ReplayError> {
        let here = self.recording.snapshots.iter().find(|snapshot| snapshot.after == self.next);
        let Some(snapshot) = here else { return Ok(()) };
        let of_vertex = |vertex: usize| {
            let bodies = &simulation.assembly().bodies;
            let body = bodies.iter().find(|body| body.vertices.contains(&vertex));
            body.map_or((String::new(), vertex), |body| {
                (body.name.clone(), vertex - body.vertices.start)
            })
        };
        let quantity = match difference_of_saved(&snapshot.saved, &simulation.save())? {
            None => return Ok(()),
            Some(SavedDifference::Position(vertex)) => {
                let (body, vertex) = of_vertex(vertex);
                Quantity::Positions { body, vertices: vertex..vertex + 1 }
            }
            Some(SavedDifference::Velocity(vertex)) => {
                let (body, vertex) = of_vertex(vertex);
                Quantity::Velocity { body, vertex }
            }
            Some(SavedDifference::Kept) => Quantity::Kept,
        };
        Err(self.differs(simulation, quantity))
    }

    fn differs<S: Real>(&self, simulation: &Simulation<S>, quantity: Quantity) -> ReplayError {
        ReplayError::Differs {
            frame: self.next,
            time: self.next as f64 * simulation.scene().time.frame,
            quantity: Box::new(quantity),
            hint: self.hint.clone(),
        }
    }
}
