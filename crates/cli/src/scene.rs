//! `viscera scene`.

use anyhow::Result;
use clap::Subcommand;
use viscera::scene::{Scene, describe_markdown, describe_text};
use viscera_report::Table;
use viscera_resources::{BUILT_IN, BuiltInScene, files};

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

/// Carries out a `viscera scene` command.
pub fn execute(command: &SceneCommand) -> Result<()> {
    let text = match command {
        SceneCommand::Describe { markdown: true } => describe_markdown(),
        SceneCommand::Describe { markdown: false } => describe_text(),
        SceneCommand::List => list()?,
    };
    files::print(&text)
}

fn list() -> Result<String> {
    let mut table = Table::new(["name", "what it shows"]);
    for BuiltInScene { name, text } in &BUILT_IN {
        let scene = Scene::parse(name, text, &[])?;
        table.row([*name, scene.description.trim()]);
    }
    Ok(table.to_text())
}
