//! Project chores: `cargo xtask test`, `cargo xtask setup`, `cargo xtask web`, `cargo xtask wheel`, `cargo xtask peers`.

mod peers;
mod setup;
mod test;
mod web;
mod wheel;

use std::path::Path;
use std::process::{Command, ExitCode};

const HELP: &str = "\
Project chores.

Usage: cargo xtask <COMMAND>

Commands:
  test          What everyone runs before a change is proposed, in minutes: format, lints, fast tests
  test --all    What must hold before a change is merged: all tests with real data, a second graphics
                driver, documentation, the main job in a release build
  setup         Install what the tests lack: a software graphics driver, rustfmt, clippy
  web           Build the page, the same simulation in a browser, as a folder of static files
  web --serve   And serve it on this machine
  wheel         Build the Python package; with --test also try it
  peers         Compare with other simulators and write docs/peers.md; `cargo xtask peers --help`
  help          Print this text

Each of them explains itself with --help.
While working, `cargo test -p viscera <name>` runs the tests whose name contains <name>.";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let wants_help = arguments.iter().any(|a| ["-h", "--help"].contains(a));
    match arguments.as_slice() {
        [] | ["help"] => println!("{HELP}"),
        ["peers", ..] if wants_help => println!("{}", peers::HELP),
        ["peers", options @ ..] => return peers::peers(options),
        ["test", ..] if wants_help => println!("{}", test::HELP),
        ["test", options @ ..] => return test::test(options),
        ["setup", ..] if wants_help => println!("{}", setup::HELP),
        ["setup", options @ ..] => return setup::setup(options),
        ["web", ..] if wants_help => println!("{}", web::HELP),
        ["web", options @ ..] => return web::web(options),
        ["wheel", ..] if wants_help => println!("{}", wheel::HELP),
        ["wheel", options @ ..] => return wheel::wheel(options),
        _ if wants_help => println!("{HELP}"),
        [other, ..] => {
            eprintln!("unknown command `{other}`; `cargo xtask help` lists what there is");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}

/// The folder of the workspace.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}

/// The cargo that runs this program, in the workspace's folder: the toolchain is the same throughout.
fn cargo(arguments: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(arguments).current_dir(root());
    command
}
