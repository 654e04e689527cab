//! Project chores: `cargo xtask test`, `cargo xtask peers`.

mod drivers;
mod peers;

use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

const HELP: &str = "\
Project chores.

Usage: cargo xtask <COMMAND>

Commands:
  test    Run everything that must pass before a change is merged, in this order, stopping at
          the first failure:
            format          cargo fmt --all --check
            lints           cargo clippy --workspace --all-targets -- -D warnings
            documentation   cargo doc --workspace --no-deps, warnings are errors
            tests           cargo test --workspace, on a graphics driver; installs a software one
                            where there is none and apt-get may
            second driver   the tests of kernels once more, on a stricter software driver, where
                            there is one
            main job        the `viscera` program runs a scene for two frames and draws it
  peers   Compare with other simulators and write docs/peers.md; `cargo xtask peers --help`
  help    Print this text

Options of `test`:
  --required    Optional parts become mandatory: tests that need real data fail, instead of
                being skipped, when VISCERA_DATA is not set, and the second driver is installed.
                Sets VISCERA_REQUIRE=1

Real data is found through the environment variable VISCERA_DATA, a folder.
While working, `cargo test -p viscera <name>` runs the tests whose name contains <name>.";

/// The scene of the main job's step.
const MAIN_JOB_SCENE: &str = "scenes/liver_retraction.toml";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let wants_help = arguments.iter().any(|a| ["-h", "--help"].contains(a));
    match arguments.as_slice() {
        [] | ["help"] => println!("{HELP}"),
        ["peers", ..] if wants_help => println!("{}", peers::HELP),
        ["peers", options @ ..] => return peers::peers(options),
        _ if wants_help => println!("{HELP}"),
        ["test"] => return test(false),
        ["test", "--required"] => return test(true),
        ["test", other, ..] => {
            eprintln!("unknown option `{other}` of `cargo xtask test`; the only one is --required");
            return ExitCode::from(2);
        }
        [other, ..] => {
            eprintln!("unknown command `{other}`; `cargo xtask help` lists what there is");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}

/// One step of `test`.
struct Step {
    title: &'static str,
    command: Command,
    /// What to do when it fails.
    next_move: &'static str,
    /// The rustup component without which it cannot run.
    component: Option<&'static str>,
}

fn test(required: bool) -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let output = std::env::temp_dir().join(format!("viscera-main-job-{}", std::process::id()));
    let mut times: Vec<(&str, Duration)> = Vec::new();
    let mut failure = None;
    let second = match drivers::ensure().and_then(|()| drivers::second(required)) {
        Ok(second) => second,
        Err(next_move) => {
            eprintln!("\nno graphics driver for the tests: {next_move}");
            return ExitCode::FAILURE;
        }
    };
    if second.is_none() {
        println!("The second graphics driver is not installed: the first one has to do.");
    }
    for mut step in steps(&output, second.as_deref()) {
        println!("\n== {}: {}", step.title, shown(&step.command));
        if let Some(component) = step.component
            && !has_component(component)
        {
            failure = Some((step.title, missing_component(component)));
            break;
        }
        step.command.current_dir(root);
        if required {
            step.command.env("VISCERA_REQUIRE", "1");
        }
        let started = Instant::now();
        let status = step.command.status();
        times.push((step.title, started.elapsed()));
        match status {
            Ok(status) if status.success() => {}
            Ok(_) => failure = Some((step.title, step.next_move.into())),
            Err(e) => failure = Some((step.title, format!("cargo could not be started: {e}"))),
        }
        if failure.is_some() {
            break;
        }
    }
    // Nothing may be there; then there is nothing to tidy up.
    let _ = std::fs::remove_dir_all(&output);

    println!();
    for (title, time) in &times {
        println!("{title:<15}{:>8.1} s", time.as_secs_f64());
    }
    match failure {
        None => {
            println!("\nAll steps passed.");
            ExitCode::SUCCESS
        }
        Some((title, next_move)) => {
            eprintln!("\n{title} failed. {next_move}");
            ExitCode::FAILURE
        }
    }
}

fn steps(output: &Path, second_driver: Option<&Path>) -> Vec<Step> {
    let mut documentation = cargo(&["doc", "--workspace", "--no-deps"]);
    documentation.env("RUSTDOCFLAGS", "-Dwarnings");
    let mut steps = vec![
        Step {
            title: "format",
            command: cargo(&["fmt", "--all", "--check"]),
            next_move: "Run `cargo fmt --all`.",
            component: Some("rustfmt"),
        },
        Step {
            title: "lints",
            command: cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]),
            next_move: "Follow the first hint above; `cargo clippy --fix` can apply most of them.",
            component: Some("clippy"),
        },
        Step {
            title: "documentation",
            command: documentation,
            next_move: "Mend the comments named above; links in them must lead somewhere.",
            component: None,
        },
        Step {
            title: "tests",
            command: cargo(&["test", "--workspace"]),
            next_move: "Run the first failed test alone: `cargo test -p <package> <name>`.",
            component: None,
        },
    ];
    if let Some(driver) = second_driver {
        let mut command = cargo(&["test", "--workspace"]);
        for test in
            ["twins", "gpu", "gpu_guard", "gpu_history", "gpu_explicit", "gpu_surface", "tethers"]
        {
            command.args(["--test", test]);
        }
        command.args(["--", "device_errs", "nasty", "portable"]);
        for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            command.env(variable, driver);
        }
        steps.push(Step {
            title: "second driver",
            command,
            next_move: "Run the command above with VK_DRIVER_FILES set to that driver's file.",
            component: None,
        });
    }
    let mut main_job = cargo(&["run", "--release", "--", "run", MAIN_JOB_SCENE]);
    main_job.args(["--frames", "2", "--out"]).arg(output);
    steps.push(Step {
        title: "main job",
        command: main_job,
        next_move: "Run the command above with an --out folder of your own and look at it.",
        component: None,
    });
    steps
}

fn cargo(arguments: &[&str]) -> Command {
    // The cargo that runs this program, so that the toolchain is the same throughout.
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(arguments);
    command
}

/// A command as one would type it.
fn shown(command: &Command) -> String {
    let arguments = command.get_args().map(|a| a.to_string_lossy().into_owned());
    std::iter::once("cargo".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

fn has_component(component: &str) -> bool {
    let subcommand = if component == "rustfmt" { "fmt" } else { component };
    cargo(&[subcommand, "--version"]).output().is_ok_and(|o| o.status.success())
}

fn missing_component(component: &str) -> String {
    format!(
        "`{component}` is not installed: `rustup component add {component}`, or the package of \
         that name where Rust comes from the system."
    )
}
