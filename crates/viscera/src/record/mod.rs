//! Recordings: a run with all that hands did to it in one file, and the same run once more.
//!
//! ```text
//! prefix   header   snapshot   frames  frames  ...  snapshot  frames  ...  end
//! header: scene, files, choices      frames: what hands did, checksums of the state      snapshot: a saved simulation
//! ```
//!
//! A [`Recorder`] gives the bytes of such a file as the run goes on; [`Recording::read`] reads as much of one as is there and
//! unchanged. A [`Player`] does what hands did, and compares every frame with the recorded one: on the same kind of processor
//! it has the same bits, at any number of threads, or says what is the first that has not. `docs/recordings.md` has the
//! format.

mod checks;
mod chunk;
mod content;
mod player;
mod recorder;

pub use checks::Quantity;
pub use content::{Choices, RecordedFile};
pub use player::{Ending, Player, RecordError, Recording, ReplayError};
pub use recorder::Recorder;
