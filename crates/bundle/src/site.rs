//! The page's folder: every file is named after its content, and what refers to it says that name.
//!
//! So a browser can keep what it has for ever, and files of two builds are never mixed. Pages (HTML), the
//! service worker and a web manifest keep their names: people and browsers know them by those.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result, bail};
use crc::{CRC_64_XZ, Crc};

use crate::files::{self, Files};
use crate::references;

/// The service worker. It has two lines that [`build`] fills in.
pub const SERVICE_WORKER: &str = "offline.js";
const BUILD_LINE: &str = "const BUILD = \"\";";
const FILES_LINE: &str = "const FILES = [];";

/// How many hexadecimal digits of a name are its content's.
const DIGITS: usize = 16;

/// A page that is ready to be served.
pub struct Site {
    /// By their final paths.
    pub files: Files,
    /// Names the build: another where any file is another.
    pub build: String,
}

/// Code without lines that are comments and without indentation, a quarter of what travels. Texts between backticks stay as
/// they are.
fn without_comments(code: &str) -> String {
    let (mut lean, mut is_text, mut is_comment) = (String::new(), false, false);
    for line in code.lines() {
        let trimmed = line.trim();
        if !is_text {
            if is_comment || trimmed.starts_with("/*") {
                is_comment = !trimmed.ends_with("*/");
                continue;
            }
            if trimmed.is_empty() || trimmed.starts_with("//") {
                continue;
            }
        }
        lean.push_str(if is_text { line } else { trimmed });
        lean.push('\n');
        is_text ^= line.matches('`').count() % 2 == 1;
    }
    lean
}

/// Names, rewrites and fills in. `sources` are the page's own files, `generated` those of wasm-bindgen, which
/// lie beside them.
pub fn build(sources: &Files, generated: &Files) -> Result<Site> {
    let mut all = sources.clone();
    for (path, content) in generated {
        if all.insert(path.clone(), content.clone()).is_some() {
            bail!(
                "{path}: wasm-bindgen writes a file of that name; name the page's file otherwise"
            );
        }
    }
    if !all.contains_key("index.html") {
        bail!("index.html: the page has none");
    }
    let targets = targets(&all, sources)?;
    let names: BTreeMap<&str, String> =
        all.keys().map(|path| (path.as_str(), name_of(path, &all, &targets))).collect();
    let build = hash(all.iter().flat_map(|(path, content)| [path.as_bytes(), content.as_slice()]));

    let mut site = Files::new();
    for (path, content) in &all {
        let content = match is_text(path) {
            true => {
                let text = rewritten(path, files::text(&all, path)?, &names);
                let is_code = path.ends_with(".js") || path.ends_with(".css");
                if is_code { without_comments(&text) } else { text }.into_bytes()
            }
            false => content.clone(),
        };
        let content = match path.ends_with(".html") {
            true => marked(path, &String::from_utf8_lossy(&content), &build)?.into_bytes(),
            false => content,
        };
        site.insert(names[path.as_str()].clone(), content);
    }
    if all.contains_key(SERVICE_WORKER) {
        let list = site.keys().filter(|path| *path != SERVICE_WORKER);
        let list: Vec<String> = list.map(|path| format!("  \"./{path}\",\n")).collect();
        let text = files::text(&site, SERVICE_WORKER)?;
        let text = filled(text, BUILD_LINE, &format!("const BUILD = \"{build}\";"))?;
        let text = filled(&text, FILES_LINE, &format!("const FILES = [\n{}];", list.concat()))?;
        site.insert(SERVICE_WORKER.into(), text.into_bytes());
    }
    Ok(Site { files: site, build })
}

/// Whether a name says what is in the file, so that it can be kept for ever.
pub fn is_named_after_content(path: &str) -> bool {
    let last = path.rsplit('/').next().unwrap_or("");
    let mut parts = last.rsplit('.');
    let _extension = parts.next();
    let digits = parts.next().unwrap_or("");
    digits.len() == DIGITS
        && digits.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
        && parts.next().is_some()
}

/// Known by its name.
fn keeps_name(path: &str) -> bool {
    let last = path.rsplit('/').next().unwrap_or("");
    let known = [SERVICE_WORKER, "manifest.json", "favicon.ico", "robots.txt"];
    known.contains(&last) || last.ends_with(".html") || last.ends_with(".webmanifest")
}

/// May refer to other files.
fn is_text(path: &str) -> bool {
    let endings = [".html", ".css", ".js", ".mjs", ".json", ".webmanifest", ".svg"];
    endings.iter().any(|ending| path.ends_with(ending))
}

/// Which files each file refers to. What the page's own sources refer to must be there.
fn targets<'a>(all: &'a Files, sources: &Files) -> Result<BTreeMap<&'a str, BTreeSet<&'a str>>> {
    let mut targets = BTreeMap::new();
    for path in all.keys().filter(|path| is_text(path)) {
        let text = files::text(all, path)?;
        let own: &mut BTreeSet<&str> = targets.entry(path.as_str()).or_default();
        for reference in references::find(text, path) {
            if let Some((target, _)) = all.get_key_value(&reference.path) {
                own.insert(target);
            } else if reference.is_certain && sources.contains_key(path) {
                let line = text[..reference.place.start].matches('\n').count() + 1;
                let literal = &text[reference.place.clone()];
                bail!("{path}, line {line}: it refers to `{literal}`, and there is no such file");
            }
        }
    }
    Ok(targets)
}

/// The final path. It says what is in the file and in all files that it leads to: these are named in it, and
/// files may lead to each other in circles.
fn name_of(path: &str, all: &Files, targets: &BTreeMap<&str, BTreeSet<&str>>) -> String {
    if keeps_name(path) {
        return path.to_owned();
    }
    let mut reached = BTreeSet::from([path]);
    let mut open = vec![path];
    while let Some(next) = open.pop() {
        let further = targets.get(next).into_iter().flatten();
        // A name that stays says nothing about content.
        for target in further.filter(|target| !keeps_name(target)) {
            if reached.insert(target) {
                open.push(target);
            }
        }
    }
    let parts = reached.iter().flat_map(|path| [path.as_bytes(), all[*path].as_slice()]);
    let hash = hash(std::iter::once(path.as_bytes()).chain(parts));
    let at = path.rfind('.').filter(|at| !path[*at..].contains('/')).unwrap_or(path.len());
    format!("{}.{hash}{}", &path[..at], &path[at..])
}

fn hash<'a>(parts: impl Iterator<Item = &'a [u8]>) -> String {
    const SUM: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);
    let mut digest = SUM.digest();
    for part in parts {
        digest.update(&(part.len() as u64).to_le_bytes());
        digest.update(part);
    }
    format!("{:0DIGITS$x}", digest.finalize())
}

/// The text with final names in its references.
fn rewritten(path: &str, text: &str, names: &BTreeMap<&str, String>) -> String {
    let mut result = String::with_capacity(text.len());
    let mut done = 0;
    for reference in references::find(text, path) {
        let Some(name) = names.get(reference.path.as_str()) else { continue };
        // Folders stay as they are; only the last part of a path changes.
        let last = name.rsplit('/').next().unwrap_or(name);
        let literal = &text[reference.place.clone()];
        let folders = literal.rfind('/').map_or("", |at| &literal[..=at]);
        result.push_str(&text[done..reference.place.start]);
        result.push_str(folders);
        result.push_str(last);
        done = reference.place.end;
    }
    result.push_str(&text[done..]);
    result
}

/// A page says of which build it is; the service worker keeps no page of another.
fn marked(path: &str, text: &str, build: &str) -> Result<String> {
    let head = text.find("<head>").map(|at| at + "<head>".len());
    let head = head.with_context(|| format!("{path}: write out its <head>"))?;
    let (before, after) = text.split_at(head);
    Ok(format!("{before}\n<meta name=\"viscera-build\" content=\"{build}\">{after}"))
}

fn filled(text: &str, line: &str, with: &str) -> Result<String> {
    if text.matches(line).count() != 1 {
        bail!("{SERVICE_WORKER}: it must have the line `{line}` once, to be filled in");
    }
    Ok(text.replace(line, with))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_loses_comments_and_indentation_and_keeps_texts() {
        let code = "/** What.\n * it */\nconst a = `\n  // text\n`;\n  // Why.\n  f(a); // here\n\n/* one */\n.b {\n  top: 0;\n}\n";
        assert_eq!(
            without_comments(code),
            "const a = `\n  // text\n`;\nf(a); // here\n.b {\ntop: 0;\n}\n"
        );
    }
}
