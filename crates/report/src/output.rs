//! A report's files: written atomically, old ones of its own removed.

use anyhow::{Context, Result, bail};
use std::ffi::OsStr;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use viscera_resources::files::{folder_of, prepare_folder, write_atomic};

/// Lies in the folder and names the files that the report put there, one per line. The next report
/// removes those that it does not show, and no others: the folder may hold files of somebody else.
const MANIFEST: &str = ".viscera-report";

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
        for place in [folder.as_path(), folder_of(document)] {
            prepare_folder(place, "--out")?;
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

    /// Writes the files of the folder, then the text that shows them, and removes files that the
    /// report before this one left and this one does not show.
    pub fn write(&self, text: &str, files: &[(String, Vec<u8>)]) -> Result<()> {
        for (name, bytes) in files {
            write_atomic(&self.folder.join(name), bytes)?;
        }
        write_atomic(&self.document, text.as_bytes())?;
        let manifest = self.folder.join(MANIFEST);
        for name in names_in(&manifest)? {
            if files.iter().all(|(shown, _)| *shown != name) {
                remove(&self.folder.join(name))?;
            }
        }
        let names: String = files.iter().map(|(name, _)| format!("{name}\n")).collect();
        write_atomic(&manifest, names.as_bytes())
    }
}

/// The names in a manifest, none where there is no manifest.
fn names_in(manifest: &Path) -> Result<Vec<String>> {
    let text = match fs::read_to_string(manifest) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.with_context(|| {
            let folder = folder_of(manifest).display();
            format!("cannot read {}; remove it, and old files in {folder}", manifest.display())
        })?,
    };
    // Whatever was written into it, nothing outside of its folder is touched.
    let is_plain = |name: &&str| Path::new(name).file_name() == Some(OsStr::new(name));
    Ok(text.lines().filter(is_plain).map(str::to_owned).collect())
}

/// Removes a file of an earlier report, which somebody may have removed already.
fn remove(old: &Path) -> Result<()> {
    match fs::remove_file(old) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error)
            .with_context(|| format!("cannot remove the old {}; remove it by hand", old.display())),
        _ => Ok(()),
    }
}
