//! The folder that a run writes to.

use anyhow::{Context, Result};
use std::borrow::Cow;
use std::fs;
use std::io::ErrorKind;
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

    /// Removes what an earlier run left in a sub-folder: files of these kinds, nothing else.
    pub fn clear(&self, folder: &str, prefixes: &[&str], extension: &str) -> Result<()> {
        let Ok(entries) = fs::read_dir(self.path.join(folder)) else { return Ok(()) };
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_ours = prefixes.iter().any(|prefix| name.starts_with(prefix));
            // A run that was killed leaves the file it was writing.
            if is_ours && name.trim_end_matches(".part").ends_with(extension) {
                self.remove(&format!("{folder}/{name}"))?;
            }
        }
        Ok(())
    }
}
