//! Files in memory, by their paths; a folder is written whole.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// Content by path; `/` between folder and file on every system.
pub type Files = BTreeMap<String, Vec<u8>>;

/// Says that a folder was written by this program, so that it may be replaced.
pub const MARK: &str = ".viscera-bundle";

/// All files below a folder. Names that begin with a dot are left out: editors and systems leave such.
pub fn read(folder: &Path) -> Result<Files> {
    let mut files = Files::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(place) = folders.pop() {
        let entries = fs::read_dir(&place);
        let entries = entries.with_context(|| format!("{}: cannot be listed", place.display()))?;
        for entry in entries {
            let entry = entry.with_context(|| place.display().to_string())?;
            if entry.file_name().to_string_lossy().starts_with('.') {
                continue;
            }
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let content = fs::read(&path);
            let content = content.with_context(|| format!("{}: cannot be read", path.display()))?;
            let name = path.strip_prefix(folder).unwrap_or(&path);
            files.insert(name.to_string_lossy().replace('\\', "/"), content);
        }
    }
    Ok(files)
}

/// Text of a file that people or browsers read as such.
pub fn text<'a>(files: &'a Files, path: &str) -> Result<&'a str> {
    let Some(bytes) = files.get(path) else { bail!("{path}: there is no such file") };
    std::str::from_utf8(bytes).with_context(|| format!("{path}: save it as UTF-8"))
}

/// Writes a folder that has these files and no others. Whoever looks sees the old folder or the new one. What
/// another program wrote is never replaced.
pub fn write(folder: &Path, files: &Files) -> Result<()> {
    let is_foreign = folder.exists()
        && !folder.join(MARK).exists()
        && fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_some());
    if is_foreign {
        let place = folder.display();
        bail!("{place}: the folder has files that are not of a page; name another, or remove it");
    }
    let (new, old) = (beside(folder, "new"), beside(folder, "old"));
    for (path, content) in files {
        write_one(&new.join(path), content)?;
    }
    write_one(&new.join(MARK), b"Written by viscera-bundle, which replaces this folder.\n")?;
    if folder.exists() {
        fs::rename(folder, &old).with_context(|| format!("{}: in use", folder.display()))?;
    }
    let renamed = fs::rename(&new, folder);
    renamed.with_context(|| format!("{}: cannot be put in place", folder.display()))?;
    if old.exists() {
        let removed = fs::remove_dir_all(&old);
        removed.with_context(|| format!("{}: cannot be removed", old.display()))?;
    }
    Ok(())
}

fn write_one(path: &Path, content: &[u8]) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, content))
        .with_context(|| format!("{}: cannot be written", path.display()))
}

/// A name beside the folder, on the same disk, that nobody else uses.
fn beside(folder: &Path, what: &str) -> PathBuf {
    let mut name = folder.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{what}-{}", std::process::id()));
    folder.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(list: &[(&str, &str)]) -> Files {
        list.iter().map(|(path, text)| ((*path).to_owned(), text.as_bytes().to_vec())).collect()
    }

    #[test]
    fn a_folder_has_what_was_written_and_no_more() {
        let place = tempfile::tempdir().expect("a folder");
        let folder = place.path().join("site");
        write(&folder, &files(&[("a.js", "1"), ("deep/er/b.js", "2")])).expect("written");
        let newer = files(&[("a.js", "3"), ("c/d.js", "4")]);
        write(&folder, &newer).expect("written again");
        assert_eq!(read(&folder).expect("read"), newer);
        let around = fs::read_dir(place.path()).expect("a list").count();
        assert_eq!(around, 1, "nothing is left beside the folder");
    }

    #[test]
    fn what_another_program_wrote_stays() {
        let place = tempfile::tempdir().expect("a folder");
        fs::write(place.path().join("thesis.txt"), "years of work").expect("written");
        let error = write(place.path(), &files(&[("a.js", "1")])).expect_err("refused");
        assert!(error.to_string().contains("not of a page"), "{error}");
        assert_eq!(fs::read_dir(place.path()).expect("a list").count(), 1);
    }
}
