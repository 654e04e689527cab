//! The file that `viscera run --record` writes.

use anyhow::{Context, Result};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use viscera::record::{RecordedFile, Recorder};
use viscera::scalar::Real;
use viscera::simulation::Simulation;
use viscera_resources::files;

/// A recording in the making. It is written as it grows: of a run that is killed all but the last half second is there.
pub struct RecordingFile {
    path: PathBuf,
    file: File,
    recorder: Recorder,
}

impl RecordingFile {
    /// Begins where the simulation is.
    pub fn create<S: Real>(
        path: &Path,
        simulation: &mut Simulation<S>,
        loaded: Vec<RecordedFile>,
    ) -> Result<Self> {
        files::prepare_file(path, "--record")?;
        let file =
            File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
        let (recorder, bytes) = Recorder::begin(simulation, loaded);
        let mut recording = Self { path: path.to_owned(), file, recorder };
        recording.write(&bytes)?;
        Ok(recording)
    }

    /// After a frame.
    pub fn frame<S: Real>(&mut self, simulation: &mut Simulation<S>) -> Result<()> {
        let bytes = self.recorder.frame(simulation);
        self.write(&bytes)
    }

    /// What is left to write.
    pub fn end(self) -> Result<()> {
        let Self { path, mut file, recorder } = self;
        write(&mut file, &path, &recorder.end())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        write(&mut self.file, &self.path, bytes)
    }
}

fn write(file: &mut File, path: &Path, bytes: &[u8]) -> Result<()> {
    let written = file.write_all(bytes);
    written.with_context(|| format!("cannot write {}; is the disk full?", path.display()))
}
