//! Files in and out: messages that name the place, and writing that leaves no half of a file.

use anyhow::{Context, Result, bail};
use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// No mesh that fits into memory is larger [B]: some hundred million tetrahedra.
const LARGEST: u64 = 16 << 30;

/// The bytes of a file, or a message with the next move.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    read_at_most(path, LARGEST)
}

fn read_at_most(path: &Path, most: u64) -> Result<Vec<u8>> {
    let shown = path.display();
    let explain = |error: std::io::Error| match error.kind() {
        ErrorKind::NotFound => anyhow::anyhow!("{shown}: there is no such file; check the name"),
        ErrorKind::PermissionDenied => anyhow::anyhow!("{shown}: no permission to read it"),
        _ => anyhow::anyhow!("{shown}: {error}"),
    };
    let kind = fs::metadata(path).map_err(explain)?;
    if kind.is_dir() {
        bail!("{shown} is a folder; name a file in it");
    }
    // Before it is opened: a pipe waits for its writer, and a device may never end.
    if !kind.is_file() {
        bail!(
            "{shown} is a device or a pipe, not a file; copy what it gives into a file and name that"
        );
    }
    let mut bytes = Vec::new();
    let file = fs::File::open(path).map_err(explain)?;
    // Whatever its length was said to be: files grow, and those of the system have none.
    file.take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(explain)?;
    if bytes.len() as u64 > most {
        bail!("{shown} is larger than {most} bytes; is it what it is said to be?");
    }
    Ok(bytes)
}

/// Prints text; a reader that has seen enough (`| head`) is no error.
pub fn print(text: &str) -> Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot print the result")
        }
        _ => Ok(()),
    }
}

/// Where a scene's mesh files are looked for: beside the scene, then in the data folder.
#[derive(Clone, Debug)]
pub struct Library {
    folders: Vec<PathBuf>,
}

impl Library {
    /// For a scene file and the folder that `--data` names.
    pub fn new(scene: &Path, data: Option<&Path>) -> Self {
        let beside = scene.parent().unwrap_or(Path::new(".")).to_owned();
        Self { folders: std::iter::once(beside).chain(data.map(Path::to_owned)).collect() }
    }

    /// The bytes of a file as a scene names it, or a message with the next move.
    pub fn load(&self, name: &str) -> Result<Vec<u8>, String> {
        let path = self.folders.iter().map(|folder| folder.join(name)).find(|path| path.exists());
        match path {
            Some(path) => read(&path).map_err(|error| error.to_string()),
            None => {
                let folders: Vec<String> =
                    self.folders.iter().map(|folder| shown_folder(folder)).collect();
                Err(format!(
                    "{name}: there is no such file in {}; put it there, or name its folder with \
                     --data",
                    folders.join(" or ")
                ))
            }
        }
    }
}

fn shown_folder(folder: &Path) -> String {
    if folder.as_os_str().is_empty() { "this folder".into() } else { folder.display().to_string() }
}

/// Writes a file aside and renames it, so that no reader ever meets a part of it.
pub fn write_whole(target: &Path, bytes: &[u8]) -> Result<()> {
    let mut part = target.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let write = || -> std::io::Result<()> {
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder)?;
        }
        let mut file = fs::File::create(&part)?;
        file.write_all(bytes)?;
        file.sync_data()?;
        fs::rename(&part, target)
    };
    write().map_err(|error| {
        // Nothing half-written stays behind; the first error is the one to report.
        let _ = fs::remove_file(&part);
        anyhow::anyhow!("cannot write {}: {error}", target.display())
    })
}

/// The folder a run writes to.
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

    /// As [`write_whole`].
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        write_whole(&self.path.join(name), bytes)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_longer_than_the_limit_is_not_read_to_its_end() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("long");
        fs::write(&path, [7; 100]).expect("a file");
        assert_eq!(read_at_most(&path, 100).expect("it fits"), [7; 100]);
        let error = read_at_most(&path, 99).expect_err("too long").to_string();
        assert!(error.contains("long is larger than 99 bytes"), "{error}");
    }
}
