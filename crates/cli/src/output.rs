//! The folder that a run writes to.

use anyhow::{Context, Result};
use std::borrow::Cow;
use std::fs;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use viscera_resources::files::{write_atomic, write_parts_atomic};

/// The folder a run writes to.
#[derive(Clone)]
pub struct OutputFolder {
    path: PathBuf,
}

impl OutputFolder {
    /// Makes the folder and makes sure that it can be written to, before anything is computed.
    pub fn create(path: &Path) -> Result<Self> {
        let probe = path.join(".probe.part");
        fs::create_dir_all(path)
            .and_then(|()| fs::write(&probe, b""))
            .and_then(|()| fs::remove_file(&probe))
            .map_err(|error| {
                anyhow::anyhow!(
                    "cannot write to {}: {error}; choose another folder with --out",
                    path.display()
                )
            })?;
        Ok(Self { path: path.to_owned() })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// As [`write_atomic`].
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        write_atomic(&self.path.join(name), bytes)
    }

    /// As [`write_parts_atomic`].
    pub fn write_parts(&self, name: &str, parts: &[Cow<[u8]>]) -> Result<()> {
        write_parts_atomic(&self.path.join(name), parts)
    }

    /// Removes a file that an earlier run may have left.
    pub fn remove(&self, name: &str) -> Result<()> {
        let path = self.path.join(name);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(error).with_context(|| format!("cannot remove the old {}", path.display()))
            }
            _ => Ok(()),
        }
    }

    /// Names of files in a sub-folder; none where there is no such folder.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.path.join(folder)) else { return Vec::new() };
        let name = |entry: fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
        let mut names: Vec<String> = entries.flatten().map(name).collect();
        names.sort();
        names
    }

    /// The first bytes of a file, as many as there are up to a number; none where it cannot be read.
    pub fn start_of(&self, name: &str, most: u64) -> Vec<u8> {
        let mut bytes = Vec::new();
        if let Ok(file) = fs::File::open(self.path.join(name)) {
            // What cannot be read is not known as a result, and stays.
            let _ = file.take(most).read_to_end(&mut bytes);
        }
        bytes
    }
}
