//! What is in the chunks of a recording.

use super::checks::hash_of;
use crate::scene::Change;
use crate::simulation::Act;

/// A file that the scene needs.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct RecordedFile {
    /// As the scene names it.
    pub name: String,
    /// In bytes.
    pub length: u64,
    /// Of its bytes; tells files apart, and is no protection against forgery.
    pub hash: u64,
    /// Its bytes, where they are few enough.
    pub content: Option<Vec<u8>>,
}

/// Files up to so many bytes are in the recording.
const SMALL: usize = 4 << 20;

impl RecordedFile {
    /// Of a file that was read.
    pub fn new(name: &str, bytes: &[u8]) -> Self {
        Self {
            name: name.to_owned(),
            length: bytes.len() as u64,
            hash: hash_of(bytes),
            content: (bytes.len() <= SMALL).then(|| bytes.to_vec()),
        }
    }
}

/// What was chosen where the scene left it open, or by what computes it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Choices {
    /// The method in force.
    pub method: String,
    /// The tetrahedra in force.
    pub elements: String,
    /// Substeps per frame.
    pub substeps: u32,
    /// Whether a graphics processor computes.
    pub on_device: bool,
    /// What computes the steps, and why.
    pub device: String,
}

/// The beginning of a recording.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Header {
    /// What the scene is called in messages.
    pub name: String,
    /// The scene with everything laid over it.
    pub scene: String,
    /// What it needs.
    pub files: Vec<RecordedFile>,
    /// As the recording begins.
    pub choices: Choices,
}

/// A frame.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Frame {
    /// What hands did before it.
    pub acts: Vec<Act>,
    /// Of the state after it: see [`super::checks`].
    pub checks: Vec<u8>,
}

/// A simulation between two frames.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Snapshot {
    /// How many frames of the recording are before it.
    pub after: u64,
    /// What hands have done until then, to be put behind the scene.
    pub live: String,
    /// Changes of settings in that, which the scene does not have: their times [s], keys and values.
    pub changes: Vec<(f64, Vec<(String, String)>)>,
    /// See [`crate::simulation::Simulation::save`].
    pub saved: Vec<u8>,
}

impl Snapshot {
    /// The changes of settings.
    pub fn changes(&self) -> Vec<Change> {
        let change = |(time, settings): &(f64, Vec<(String, String)>)| Change {
            time: *time,
            settings: settings.clone(),
        };
        self.changes.iter().map(change).collect()
    }
}
