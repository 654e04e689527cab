//! `viscera scene`.

use anyhow::Result;
use clap::Subcommand;
use viscera::scene::{describe_markdown, describe_text};

/// What a scene file can say
#[derive(Subcommand)]
pub enum SceneCommand {
    /// Print every key with its unit, range, default and meaning
    Describe {
        /// Print Markdown, as in docs/scene.md
        #[arg(long)]
        markdown: bool,
    },
}

/// Carries out a `viscera scene` command.
pub fn execute(command: &SceneCommand) -> Result<()> {
    let SceneCommand::Describe { markdown } = command;
    let text = if *markdown { describe_markdown() } else { describe_text() };
    crate::files::print(&text)
}
