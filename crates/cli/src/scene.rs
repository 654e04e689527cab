//! `viscera scene`.

use crate::import::{self, ImportArguments};
use anyhow::Result;
use clap::Subcommand;
use std::path::{Path, PathBuf};
use viscera::scene::{Scene, describe_markdown, describe_text};
use viscera_import::{Replace, folder_of, title_of, write};
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
    /// Make a scene of a mesh, a surface or a segmented scan
    ///
    /// Reads tetrahedra and surfaces (formats: `viscera mesh inspect --help`) and label maps (NIfTI, NRRD, of TotalSegmentator or
    /// 3D Slicer). Surfaces and labels are filled with tetrahedra; every organ gets a material, a hold and its fine surface. The scene file
    /// is written with comments, to be changed by hand.
    New {
        /// The mesh, surface or label map
        file: PathBuf,
        /// The folder for the scene; `out/NAME/scene` where there is none
        #[arg(long, short)]
        out: Option<PathBuf>,
        /// Replace a scene that is there, also one that was changed by hand or made of another file
        #[arg(long)]
        force: bool,
        #[command(flatten)]
        import: ImportArguments,
    },
}

/// Carries out a `viscera scene` command.
pub fn execute(command: &SceneCommand) -> Result<()> {
    let text = match command {
        SceneCommand::Describe { markdown: true } => describe_markdown(),
        SceneCommand::Describe { markdown: false } => describe_text(),
        SceneCommand::List => list()?,
        SceneCommand::New { file, out, force, import } => {
            new(file, out.as_deref(), *force, import)?
        }
    };
    files::print(&text)
}

/// Makes a scene, and says what it is and what to do next.
fn new(
    file: &Path,
    out: Option<&Path>,
    is_forced: bool,
    arguments: &ImportArguments,
) -> Result<String> {
    let title = title_of(file);
    let folder = match out {
        Some(folder) => folder.to_owned(),
        None => folder_of(file).join("scene"),
    };
    let made = import::import(file, arguments)?;
    let replace = if is_forced { Replace::Always } else { Replace::Unchanged };
    let written = write(&made, &title, &folder, replace)?;
    let shown = written.scene.display();
    Ok(format!(
        "{}{}next:  viscera run {shown}   or   viscera view {shown}\n",
        made.describe(),
        written.text()
    ))
}

fn list() -> Result<String> {
    let mut table = Table::new(["name", "what it shows"]);
    for BuiltInScene { name, text } in &BUILT_IN {
        let scene = Scene::parse(name, text, &[])?;
        table.row([*name, scene.description.trim()]);
    }
    Ok(table.to_text())
}
