//! Files in and out: error messages that name the place, and atomic writes, checked up front.

use anyhow::{Context, Result, bail};
use std::fs;
use std::io::{BufWriter, ErrorKind, Read, Write};
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

/// A path as one word of a command that a message shows.
pub fn word(path: &str) -> String {
    match path.contains([' ', '\'', '(', ')', '&', ';']) {
        true => format!("\"{path}\""),
        false => path.to_owned(),
    }
}

/// Where a scene's mesh files are looked for: beside the scene, then in the data folder.
#[derive(Clone, Debug)]
pub struct MeshFiles {
    folders: Vec<PathBuf>,
}

impl MeshFiles {
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

/// Writes a file aside and renames it, so that no reader ever meets a part of it; makes its folder.
pub fn write_atomic(target: &Path, bytes: &[u8]) -> Result<()> {
    write_parts_atomic(target, &[bytes])
}

/// As [`write_atomic`], of bytes that come in parts.
pub fn write_parts_atomic(target: &Path, parts: &[impl AsRef<[u8]>]) -> Result<()> {
    let mut part = target.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let write = || -> std::io::Result<()> {
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder)?;
        }
        let mut file = BufWriter::new(fs::File::create(&part)?);
        parts.iter().try_for_each(|bytes| file.write_all(bytes.as_ref()))?;
        file.flush()?;
        file.get_ref().sync_data()?;
        fs::rename(&part, target)
    };
    write().map_err(|error| {
        // Nothing half-written stays behind; the first error is the one to report.
        let _ = fs::remove_file(&part);
        anyhow::anyhow!("cannot write {}: {error}", target.display())
    })
}

/// Makes the folder of a single file, which `option` of the program names, and makes sure that it can
/// be written to.
pub fn prepare_file(file: &Path, option: &str) -> Result<()> {
    if file.is_dir() {
        bail!("{} is a folder; name a file in it with {option}", file.display());
    }
    prepare_folder(folder_of(file), option)
}

/// The folder that a file is in; `.` where its path names none.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Makes a folder of files that `option` of the program names, and makes sure that it can be written to.
pub fn prepare_folder(folder: &Path, option: &str) -> Result<()> {
    let probe = folder.join(".probe.part");
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(&probe, b""))
        .and_then(|()| fs::remove_file(&probe))
        .map_err(|error| {
            let place = folder.display();
            anyhow::anyhow!("cannot write to {place}: {error}; choose another file with {option}")
        })
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
