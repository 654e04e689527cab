//! `viscera scene`.

use anyhow::Result;
use clap::Subcommand;
use std::path::Path;
use viscera::scene::{Scene, describe_markdown, describe_text};
use viscera_report::Table;

/// What a scene file can say
#[derive(Subcommand)]
pub enum SceneCommand {
    /// Print every key with its unit, range, default and meaning
    Describe {
        /// Print Markdown, as in docs/scene.md
        #[arg(long)]
        markdown: bool,
    },
    /// List the scenes that need no file: `viscera run NAME`
    List,
}

/// A scene that is part of the program.
pub struct BuiltIn {
    /// As `viscera run` takes it.
    pub name: &'static str,
    /// The scene file.
    pub text: &'static str,
}

macro_rules! built_in {
    ($($name:literal)*) => {
        [$(BuiltIn { name: $name, text: include_str!(concat!("../../../scenes/", $name, ".toml")) }),*]
    };
}

/// All of them; `scenes/` holds no others that need no mesh file.
pub const BUILT_IN: [BuiltIn; 5] =
    built_in!["cantilever" "grab" "liver_retraction" "stretch" "twist"];

impl BuiltIn {
    /// The one that is meant where there is no such file.
    pub fn find(path: &Path) -> Option<&'static Self> {
        let named = |scene: &&Self| path.as_os_str() == scene.name && !path.exists();
        BUILT_IN.iter().find(named)
    }
}

/// Carries out a `viscera scene` command.
pub fn execute(command: &SceneCommand) -> Result<()> {
    let text = match command {
        SceneCommand::Describe { markdown: true } => describe_markdown(),
        SceneCommand::Describe { markdown: false } => describe_text(),
        SceneCommand::List => list()?,
    };
    crate::files::print(&text)
}

fn list() -> Result<String> {
    let mut table = Table::new(["name", "what it shows"]);
    for BuiltIn { name, text } in &BUILT_IN {
        let scene = Scene::parse(name, text, &[])?;
        table.row([*name, scene.description.trim()]);
    }
    Ok(table.to_text())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_without_a_mesh_file_is_built_in() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let files = std::fs::read_dir(&folder).expect("the folder of scenes").flatten();
        let paths = files.map(|file| file.path());
        let mut names: Vec<String> = paths
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
            .collect();
        names.sort();
        assert_eq!(names, BUILT_IN.map(|scene| scene.name));
    }
}
