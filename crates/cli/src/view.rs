//! `viscera view`: starts the window, which is a program of its own so that this one builds quickly.

use clap::Args;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Open a window: pull on the tissue and see it answer
///
/// Starts `viscera-view`, which lies beside this program.
#[derive(Args)]
pub struct ViewArguments {
    /// A scene, or a mesh or segmented scan of which one is made, and options, as `viscera-view --help` lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "SCENE")]
    arguments: Vec<OsString>,
}

/// Starts the window and waits until it is closed; its exit code is this one's.
pub fn execute(arguments: &ViewArguments) -> ExitCode {
    let program = std::env::current_exe().map(|this| beside(&this));
    let passed = &arguments.arguments;
    let started = program.and_then(|program| Command::new(program).args(passed).status());
    match started {
        Ok(status) => match u8::try_from(status.code().unwrap_or(1)) {
            Ok(code) => ExitCode::from(code),
            Err(_) => ExitCode::FAILURE,
        },
        Err(error) => {
            eprintln!(
                "error: cannot start the window: {error}; build it with `cargo build --release -p \
                 viscera-view` and put `viscera-view` beside this program, or start it with `cargo \
                 run --release -p viscera-view`"
            );
            ExitCode::FAILURE
        }
    }
}

/// The window's program in the folder of this one.
fn beside(this: &Path) -> PathBuf {
    this.with_file_name(format!("viscera-view{}", std::env::consts::EXE_SUFFIX))
}
