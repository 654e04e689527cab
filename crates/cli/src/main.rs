//! The `viscera` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    viscera_cli::main()
}
