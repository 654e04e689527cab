//! The program `viscera`.

mod bench;
mod bench_plot;
mod bench_scene;
mod devices;
mod film;
mod haptics;
mod hold;
mod import;
mod in_order;
mod labels;
mod mesh;
mod mesh_files;
mod output;
mod progress;
mod quality;
mod recording_file;
mod repair;
mod replay;
mod run;
mod scene;
mod series;
mod summary;
mod tool_table;
mod view;
mod words;

use clap::{CommandFactory, Parser, Subcommand};
use std::process::ExitCode;

/// Real-time soft-tissue simulation for surgical applications.
#[derive(Parser)]
#[command(name = "viscera", version, arg_required_else_help = true, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  viscera run liver_retraction
  viscera run scenes/cantilever.toml --set body.bar.material.young=\"10 kPa\" --out out/soft
  viscera run palpation --record out/palpation.replay
  viscera replay out/palpation.replay --threads 1
  viscera haptics haptic_palpation --seconds 10
  viscera run liver.stl
  viscera scene new abdomen_labels.nii.gz --labels liver,stomach --out out/abdomen
  viscera mesh inspect liver.msh --unit \"32 mm\"
  viscera scene describe
  viscera view grab
  viscera bench --quick";

const COMPLETIONS: &str = "\
Examples:
  viscera completions bash > ~/.local/share/bash-completion/completions/viscera
  viscera completions zsh > ~/.zfunc/_viscera       # with `fpath+=~/.zfunc` before `compinit`
  viscera completions fish > ~/.config/fish/completions/viscera.fish";

#[derive(Subcommand)]
enum Command {
    /// Simulate a scene; write meshes, a picture, an animation and the numbers
    Run(run::RunArguments),
    /// Have a recorded run once more, and see whether it has the same bits
    Replay(replay::ReplayArguments),
    /// Feel tissue with a haptic device, or with a simulated hand
    Haptics(haptics::HapticsArguments),
    /// Look at mesh files and segmented scans, fill surfaces, convert formats
    #[command(subcommand)]
    Mesh(mesh::MeshCommand),
    /// What a scene file can say, and which scenes need none
    #[command(subcommand)]
    Scene(scene::SceneCommand),
    /// Measure what the solvers cost on this machine
    Bench(bench::BenchArguments),
    /// Open a window: pull on the tissue and see it answer
    View(view::ViewArguments),
    /// List what there is to compute on, and how fast it is
    Devices(devices::DevicesArguments),
    /// Print a script by which a shell completes commands and options
    #[command(after_help = COMPLETIONS)]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    // For a program, not for a person.
    #[command(hide = true)]
    BenchScene(bench_scene::BenchSceneArguments),
    #[command(hide = true)]
    BenchPlot(bench_plot::BenchPlotArguments),
}

/// Exit code of a run that Ctrl-C ended, as shells report it.
const INTERRUPTED: u8 = 130;

/// Carries out what the command line asks for.
fn main() -> ExitCode {
    quiet_drivers();
    let result = match Arguments::parse().command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Replay(arguments) => replay::execute(&arguments),
        Command::Haptics(arguments) => haptics::execute(&arguments),
        Command::Mesh(command) => mesh::execute(&command).map(|()| run::Outcome::Finished),
        Command::Scene(command) => scene::execute(&command).map(|()| run::Outcome::Finished),
        Command::Bench(arguments) => bench::execute(&arguments).map(|()| run::Outcome::Finished),
        Command::View(arguments) => return view::execute(&arguments),
        Command::Devices(arguments) => {
            devices::execute(&arguments).map(|()| run::Outcome::Finished)
        }
        Command::Completions { shell } => completions(shell).map(|()| run::Outcome::Finished),
        Command::BenchScene(arguments) => {
            bench_scene::execute(&arguments).map(|()| run::Outcome::Finished)
        }
        Command::BenchPlot(arguments) => {
            bench_plot::execute(&arguments).map(|()| run::Outcome::Finished)
        }
    };
    match result {
        Ok(run::Outcome::Finished) => ExitCode::SUCCESS,
        Ok(run::Outcome::Interrupted) => ExitCode::from(INTERRUPTED),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Prints a shell's script.
fn completions(shell: clap_complete::Shell) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "viscera", &mut script);
    viscera_resources::files::print(&String::from_utf8_lossy(&script))
}

/// Graphics drivers look for a display below `XDG_RUNTIME_DIR` and complain on our standard error where it is unset
/// or no absolute path, as in containers and jobs. There is no display then, wherever they look.
#[allow(unsafe_code)]
fn quiet_drivers() {
    const FOLDER: &str = "XDG_RUNTIME_DIR";
    let is_folder = |path: std::ffi::OsString| std::path::Path::new(&path).is_absolute();
    if cfg!(target_os = "linux") && !std::env::var_os(FOLDER).is_some_and(is_folder) {
        // SAFETY: the first statement of the program; there is no other thread that reads the environment.
        unsafe { std::env::set_var(FOLDER, std::env::temp_dir()) };
    }
}
