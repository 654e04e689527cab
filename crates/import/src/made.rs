//! Scenes that are made of other files, and the folders where they lie.
//!
//! Beside its scene an import leaves a list of what it wrote, with checksums: `liver.made` beside `liver.toml`. A later import
//! replaces and removes only what is on the list and what nobody has changed since; anything else is refused, with the reason.

use anyhow::{Result, bail};
use std::path::{Path, PathBuf};
use viscera_resources::files;

use crate::{Import, name_of};

/// What becomes of a scene that is there already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replace {
    /// It stays, unless the new one is the same.
    Never,
    /// It is replaced where it was made of the same file, and nobody has changed it.
    Unchanged,
    /// It is replaced, whatever it is.
    Always,
}

/// A written scene.
pub struct Made {
    /// The scene file.
    pub scene: PathBuf,
    /// What became of files of an earlier import, a line each.
    pub notes: Vec<String>,
}

impl Made {
    /// For people.
    pub fn text(&self) -> String {
        let notes: String = self.notes.iter().map(|note| format!("note: {note}\n")).collect();
        format!("{notes}scene: {}\n", self.scene.display())
    }
}

/// What an import wrote.
#[derive(Debug, Default, PartialEq)]
struct List {
    /// The file that it was made of.
    from: Source,
    /// Checksums and names.
    files: Vec<(u64, String)>,
}

/// The file that a scene was made of.
#[derive(Clone, Debug, Default, PartialEq)]
struct Source {
    /// Without its folder.
    name: String,
    hash: u64,
}

const FROM: &str = "from ";

impl List {
    /// Of a file; nothing where it is not there, or no such list.
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let mut list = Self::default();
        for line in text.lines() {
            let (is_source, line) = match line.strip_prefix(FROM) {
                Some(rest) => (true, rest),
                None => (false, line),
            };
            let Some((hash, name)) = line.split_once(' ') else { continue };
            let Ok(hash) = u64::from_str_radix(hash, 16) else { continue };
            // Beside the list, and nowhere else.
            match name.contains(['/', '\\']) {
                false if is_source => list.from = Source { name: name.to_owned(), hash },
                false => list.files.push((hash, name.to_owned())),
                true => {}
            }
        }
        list
    }

    fn text(&self) -> String {
        let lines = self.files.iter().map(|(hash, name)| format!("{hash:016x} {name}\n"));
        let lines: String = lines.collect();
        format!(
            "# What viscera made, with checksums: a later import replaces and removes these files where nobody has changed them.\n\
             {FROM}{:016x} {}\n{lines}",
            self.from.hash, self.from.name
        )
    }

    /// Whether a file is as it was written.
    fn has(&self, name: &str, bytes: &[u8]) -> bool {
        self.files.iter().any(|(hash, known)| known == name && *hash == hash_of(bytes))
    }
}

/// FNV-1a: tells files apart, and is no protection against forgery.
fn hash_of(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Writes a scene and its meshes into a folder.
pub fn write(import: &Import, title: &str, folder: &Path, replace: Replace) -> Result<Made> {
    files::prepare_folder(folder, "--out")?;
    let written = import.scene(title).files;
    // The scene file comes first.
    let scene_name = written.first().map(|(name, _)| name.clone()).unwrap_or_default();
    let scene = folder.join(&scene_name);
    let list_file = scene.with_extension("made");
    let known = List::read(&list_file);
    let source = Path::new(&import.file);
    let from = Source {
        name: source.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        hash: std::fs::read(source).map_or(0, |bytes| hash_of(&bytes)),
    };
    if replace != Replace::Always
        && let Some(why) = obstacle(&known, &written, &from, &scene, replace)
    {
        // A folder that differs from that of a file of the same name by the ending.
        let elsewhere = format!("out/{}/scene", name_of(&from.name));
        let file = files::word(&import.file);
        bail!(
            "{why}; name another folder (viscera scene new {file} --out {elsewhere}), or replace what is there \
             (viscera scene new {file} --out {} --force)",
            files::word(&folder.display().to_string())
        );
    }
    let files = written.iter().map(|(name, bytes)| (hash_of(bytes), name.clone())).collect();
    let list = List { from, files };
    // What is written from here on is on a list, also where it is not written to its end: the earlier one has the rest.
    let mut both = List { from: list.from.clone(), files: list.files.clone() };
    both.files.extend(known.files.iter().cloned());
    files::write_atomic(&list_file, both.text().as_bytes())?;
    // The scene comes last: where it is, its meshes are.
    for (name, bytes) in written.iter().rev() {
        files::write_atomic(&folder.join(name), bytes)?;
    }
    let notes = remove_stale(folder, &known, &list);
    files::write_atomic(&list_file, list.text().as_bytes())?;
    Ok(Made { scene, notes })
}

/// Why the files of a scene cannot be written over those that are there.
fn obstacle(
    known: &List,
    written: &[(String, Vec<u8>)],
    from: &Source,
    scene: &Path,
    replace: Replace,
) -> Option<String> {
    let folder = files::folder_of(scene);
    let there = |name: &str| std::fs::read(folder.join(name)).ok();
    let others: Vec<_> = written
        .iter()
        .filter_map(|(name, bytes)| Some((name, there(name)?)).filter(|(_, old)| old != bytes))
        .collect();
    let is_changed = |(name, old): &&(&String, Vec<u8>)| !known.has(name, old);
    let changed = others.iter().find(is_changed);
    let shown = scene.display();
    match changed {
        _ if others.is_empty() => None,
        _ if !known.from.name.is_empty() && known.from != *from => {
            let (old, new) = (&known.from.name, &from.name);
            let other = if old == new { format!("another {old}") } else { old.clone() };
            Some(format!("{shown} was made of {other}, and this is {new}"))
        }
        Some((name, _)) if folder.join(name) != scene => Some(format!(
            "{}: there is another file of that name, which no earlier import of {} wrote, or which was changed since",
            folder.join(name).display(),
            from.name
        )),
        None if replace == Replace::Unchanged => None,
        _ => Some(format!(
            "{shown}: there is another scene, made with other options or changed by hand; use that one (viscera run {shown}, viscera view {shown})"
        )),
    }
}

/// Removes what an earlier import wrote and this one did not, where nobody has changed it.
fn remove_stale(folder: &Path, known: &List, list: &List) -> Vec<String> {
    let (mut removed, mut kept) = (Vec::new(), Vec::new());
    for (_, name) in &known.files {
        let path = folder.join(name);
        let is_new = list.files.iter().any(|(_, other)| other == name);
        // Nothing to remove where it is gone.
        let Ok(bytes) = std::fs::read(&path) else { continue };
        if is_new {
            continue;
        }
        match known.has(name, &bytes) && std::fs::remove_file(&path).is_ok() {
            true => removed.push(name.as_str()),
            false => kept.push(name.as_str()),
        }
    }
    let told = |what: &str, names: &[&str]| {
        (!names.is_empty()).then(|| format!("{what}: {}", names.join(", ")))
    };
    let removed = told("removed, of the scene that was here before", &removed);
    let kept = told("kept, of the scene that was here before, since it was changed", &kept);
    removed.into_iter().chain(kept).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.made");
        let files = vec![(hash_of(b"1"), "a b.toml".to_owned()), (0, "liver.vtu".to_owned())];
        let from = Source { name: "from here.msh".into(), hash: 7 };
        let list = List { from, files };
        std::fs::write(&path, list.text()).expect("a file");
        assert_eq!(List::read(&path), list);
        assert!(list.has("a b.toml", b"1") && !list.has("a b.toml", b"2"));
        // A list that names files of other folders is not believed.
        std::fs::write(&path, "from x\n0000000000000000 ../x\n").expect("a file");
        assert_eq!(List::read(&path).files, []);
        assert_eq!(List::read(folder.path()), List::default());
    }
}
