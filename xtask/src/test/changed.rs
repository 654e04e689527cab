//! Which parts are concerned by what was changed: some have libraries that take long to build.

use std::process::Command;

use crate::root;

/// What the window is made of, and what decides how it is built.
pub const WINDOW: [&str; 4] = ["crates/view/", "crates/render/", "Cargo.lock", "Cargo.toml"];

/// What the page's files are made of.
pub const PAGE: [&str; 2] = ["crates/bundle/", "crates/web/"];

/// Whether a file in one of these places differs from the branch that the work started from, or is new. True
/// where git does not answer.
pub fn concerns(places: &[&str]) -> bool {
    changed_files().is_none_or(|files| {
        files.lines().any(|file| places.iter().any(|place| file.starts_with(place)))
    })
}

/// Paths of the files changed since the merge base with the upstream branch, committed or not.
fn changed_files() -> Option<String> {
    let upstream = ["@{upstream}", "origin/HEAD", "origin/main"];
    let base = upstream.iter().find_map(|branch| git(&["merge-base", "HEAD", branch]));
    let base = base.unwrap_or_else(|| "HEAD".into());
    let changed = git(&["diff", "--name-only", base.trim()])?;
    Some(changed + &git(&["ls-files", "--others", "--exclude-standard"])?)
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).current_dir(root()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}
