//! Files written whole or not at all.

use super::chart::SIGNATURE;
use anyhow::{Context, Result, bail};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A Markdown file, and the folder beside it that holds its figures and has its name.
pub(super) struct Output {
    document: PathBuf,
    folder: PathBuf,
    /// The folder's last part, as links in the document write it.
    folder_name: String,
}

impl Output {
    /// Makes the folders and makes sure that they can be written to.
    pub fn prepare(document: &Path) -> Result<Self> {
        let shown = document.display();
        if document.is_dir() {
            bail!("{shown} is a folder; name a file in it, for example validation.md");
        }
        let stem = document.file_stem().and_then(|stem| stem.to_str());
        let (Some(stem), true) = (stem, document.extension().is_some_and(|e| e == "md")) else {
            bail!("{shown}: the report is Markdown; give it a name that ends in .md");
        };
        let folder = document.with_extension("");
        fs::create_dir_all(&folder).map_err(|error| refused(&folder, &error, "--out"))?;
        for place in [folder_of(document), &folder] {
            probe(place, "--out")?;
        }
        let folder_name = stem.to_owned();
        Ok(Self { document: document.to_owned(), folder, folder_name })
    }

    /// The Markdown file.
    pub fn document(&self) -> &Path {
        &self.document
    }

    /// The address of a file in the folder as seen from the document.
    pub fn link(&self, file: &str) -> String {
        let address = format!("{}/{file}", self.folder_name);
        let plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
        if address.chars().all(plain) { address } else { format!("<{address}>") }
    }

    /// Writes the files of the folder, then the text that shows them, and removes plots that an
    /// earlier report left and this one does not show.
    pub fn write(&self, text: &str, files: &[(String, Vec<u8>)]) -> Result<()> {
        for (name, bytes) in files {
            write_whole(&self.folder.join(name), bytes)?;
        }
        write_whole(&self.document, text.as_bytes())?;
        let is_shown = |path: &Path| {
            let shown = path.file_name().and_then(|name| name.to_str());
            files.iter().any(|(name, _)| Some(name.as_str()) == shown)
        };
        let Ok(entries) = fs::read_dir(&self.folder) else { return Ok(()) };
        for path in entries.flatten().map(|entry| entry.path()) {
            let is_old = path.extension().is_some_and(|e| e == "svg") && !is_shown(&path);
            // The folder may hold pictures of somebody else.
            if is_old && fs::read_to_string(&path).is_ok_and(|svg| svg.contains(SIGNATURE)) {
                fs::remove_file(&path)
                    .with_context(|| format!("cannot remove the old {}", path.display()))?;
            }
        }
        Ok(())
    }
}

/// Makes the folder of a single file, which `option` of the program names, and makes sure that it can
/// be written to.
pub fn prepare_file(file: &Path, option: &str) -> Result<()> {
    if file.is_dir() {
        bail!("{} is a folder; name a file in it with {option}", file.display());
    }
    let folder = folder_of(file);
    fs::create_dir_all(folder).map_err(|error| refused(folder, &error, option))?;
    probe(folder, option)
}

fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn probe(folder: &Path, option: &str) -> Result<()> {
    let probe = folder.join(".probe.part");
    fs::write(&probe, b"")
        .and_then(|()| fs::remove_file(&probe))
        .map_err(|error| refused(folder, &error, option))
}

fn refused(place: &Path, error: &std::io::Error, option: &str) -> anyhow::Error {
    let place = place.display();
    anyhow::anyhow!("cannot write to {place}: {error}; choose another file with {option}")
}

/// Writes aside and renames, so that no reader ever meets a part of a file.
pub fn write_whole(target: &Path, bytes: &[u8]) -> Result<()> {
    let mut part = target.as_os_str().to_owned();
    part.push(".part");
    let write = || -> std::io::Result<()> {
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
