//! A run that is recorded: the first simulation with all that hands do to it, in a file that `viscera replay` takes. It is
//! written as it grows, so that of a window that is killed all but the last half second is there.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use viscera::record::RecordedFile;
use viscera_resources::MeshFiles;
use viscera_stage::Run;

/// A recording in the making.
pub struct RunRecording {
    path: PathBuf,
    file: File,
    /// Frames so far.
    frames: u64,
}

impl RunRecording {
    /// Begins where the simulation is.
    pub fn begin(path: PathBuf, mesh_files: &MeshFiles, run: &mut dyn Run) -> Result<Self, String> {
        let mut files = Vec::new();
        for name in run.scene().files() {
            files.push(RecordedFile::new(name, &mesh_files.load(name)?));
        }
        let fail = |error: std::io::Error| format!("cannot record to {}: {error}", path.display());
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(fail)?;
        }
        let file = File::create(&path).map_err(fail)?;
        let bytes = run.begin_recording(files);
        let mut recording = Self { path, file, frames: 0 };
        recording.write(&bytes)?;
        Ok(recording)
    }

    /// After a frame, before hands do anything.
    pub fn frame(&mut self, run: &mut dyn Run) -> Result<(), String> {
        self.frames += 1;
        let bytes = run.recorded();
        self.write(&bytes)
    }

    /// What is left to write; where the recording is, and how many frames it has.
    pub fn end(mut self, run: &mut dyn Run) -> Result<(PathBuf, u64), String> {
        let bytes = run.end_recording();
        self.write(&bytes)?;
        Ok((self.path, self.frames))
    }

    /// Where it is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.file.write_all(bytes).map_err(|error| {
            format!("the recording {} ended here: {error}; is the disk full?", self.path.display())
        })
    }
}
