//! The `viscera-view` program.

use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use viscera_view::app::default_pictures;
use viscera_view::choices::Settings;
use viscera_view::{FIRST_SCENE, Options, window};

/// Pull on tissue and see it answer.
///
/// Press on the tissue and drag: a spring pulls it, its force is written beside the arrow. Instruments lie on a tray. Material and
/// solver can be changed while the tissue moves; F1 shows what keys and mouse do. "Save scene" writes a
/// scene file that `viscera run` takes.
#[derive(Parser)]
#[command(name = "viscera-view", version, after_help = EXAMPLES)]
struct Arguments {
    /// The scene file, the name of one that `viscera scene list` prints, or a mesh, a surface or a segmented scan: its scene is
    /// made in out/NAME/scene
    #[arg(default_value = FIRST_SCENE)]
    scene: PathBuf,
    /// Change a setting: KEY=VALUE, as in `solver.iterations=20` or
    /// `body.liver.material.young="8 kPa"`; may be repeated. `viscera scene describe` lists keys
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = read_setting)]
    settings: Vec<(String, String)>,
    /// Begin with A | B: a second solver beside the first one, with this setting changed: KEY=VALUE, as in
    /// `solver.elements=plain`; may be repeated
    #[arg(long = "beside", value_name = "KEY=VALUE", value_parser = read_setting)]
    beside: Vec<(String, String)>,
    /// Folder where mesh files are looked for that are not beside the scene
    #[arg(long, value_name = "DIR", env = "VISCERA_DATA")]
    data: Option<PathBuf>,
    /// Folder for pictures and recordings
    #[arg(long, value_name = "DIR", default_value_os_t = default_pictures())]
    pictures: PathBuf,
}

const EXAMPLES: &str = "\
Examples:
  viscera-view
  viscera-view grab
  viscera-view liver.stl
  viscera-view scenes/cantilever.toml --set body.bar.material.young=\"10 kPa\"
  viscera-view coarse_bar --beside solver.elements=plain

Without a display, `viscera run SCENE` computes the same and writes pictures.";

fn read_setting(text: &str) -> Result<(String, String), String> {
    let (key, value) =
        text.split_once('=').ok_or("write KEY=VALUE, for example --set solver.iterations=20")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

fn main() -> ExitCode {
    let Arguments { scene, settings, beside, data, pictures } = Arguments::parse();
    let settings: Settings = settings;
    let options = Options { scene, settings, beside, data, pictures, ..Options::default() };
    match window::open(options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
