//! `cargo xtask web`: the page and the package for other pages, from the sources to a folder that any server of
//! static files can host.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use crate::{cargo, root, setup};

/// What `cargo xtask web --help` prints.
pub const HELP: &str = "\
Build the page: the same simulation in a browser, as static files.

Usage: cargo xtask web [--serve [PORT]]

  target/web/site    the page: a folder for any server of static files, under https
  target/web/npm     the package for other people's pages

  --serve [PORT]     serve the page on this machine afterwards, until Ctrl-C [default: 8080; 0: any free port]

It takes a compiler for wasm32-unknown-unknown and installs one where it is missing, as rustup's target or, where
rustup cannot, as Debian's packages; it says so first, and in a terminal it asks.
docs/web.md says how to host and embed the page.";

const TARGET: &str = "wasm32-unknown-unknown";
const DEFAULT_PORT: &str = "8080";

/// The profile of the workspace's manifest that the module is built with.
const PROFILE: &str = "web";

/// A folder of its own: two compilers in one would build everything anew in turn.
const FOLDER: &str = "target/web";

/// Debian's compiler for browsers, with the sources of the standard library that it is built with.
const PACKAGES: [&str; 3] = ["rustc-web", "cargo-web", "rust-web-src"];

/// `cargo xtask web`.
pub fn web(options: &[&str]) -> ExitCode {
    let port = match options {
        [] => None,
        ["--serve"] => Some(DEFAULT_PORT),
        ["--serve", port] if port.parse::<u16>().is_ok() => Some(*port),
        ["--serve", other] => {
            eprintln!("`{other}` is no port; a number from 0 to 65535 is");
            return ExitCode::from(2);
        }
        [other, ..] => {
            eprintln!("unknown option `{other}` of `cargo xtask web`; there is --serve [PORT]");
            return ExitCode::from(2);
        }
    };
    match build().and_then(|()| port.map_or(Ok(()), serve)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(sentence) => {
            eprintln!("{sentence}");
            ExitCode::FAILURE
        }
    }
}

/// Kernels are inlined by attributes, and their loops have lengths that the compiler knows; what else is inlined or unrolled makes
/// the module larger by a tenth and no faster.
const SMALL: &str = "target.wasm32-unknown-unknown.rustflags=[\"-Cllvm-args=-inline-threshold=0 -unroll-runtime=false\"]";

/// Whether the page has been built, here and at some time.
pub fn is_built() -> bool {
    root().join(FOLDER).join("site/index.html").exists()
}

/// Builds page and package; on failure what to do.
pub fn build() -> Result<(), String> {
    let compiler = Compiler::provide()?;
    // One after the other: together they would have the same features of the library.
    let wasm = compiler.build("viscera-web", &["--config", SMALL])?;
    let files = compiler.build("viscera-web-files", &[])?;
    let mut bundle = cargo(&["run", "--quiet", "--package", "viscera-bundle", "--", "build"]);
    bundle.arg("--wasm").arg(wasm).arg("--files").arg(files);
    bundle.args(["--web", "crates/web", "--out", FOLDER]);
    run(bundle, "The page was not made; follow what is said above.")
}

fn serve(port: &str) -> Result<(), String> {
    let mut command = cargo(&["run", "--quiet", "--package", "viscera-bundle", "--", "serve"]);
    command.args(["target/web/site", port]);
    run(command, "Name another port: `cargo xtask web --serve 0` takes any free one.")
}

fn run(mut command: Command, next_move: &str) -> Result<(), String> {
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err(next_move.into()),
        Err(e) => Err(format!("{} could not be started: {e}", command.get_program().display())),
    }
}

/// What compiles for browsers.
enum Compiler {
    /// The project's own, with the target's standard library.
    Own,
    /// Debian's, which builds the standard library along. It is another version of Rust than the project's.
    Debian { linker: PathBuf },
}

impl Compiler {
    /// Finds one, or installs it.
    fn provide() -> Result<Self, String> {
        if has_own_library() {
            return Ok(Self::Own);
        }
        if setup::has_rustup() {
            let commands = vec![setup::words(&["rustup", "target", "add", TARGET])];
            setup::install(&format!("compiler for {TARGET}"), commands);
            if has_own_library() {
                return Ok(Self::Own);
            }
        }
        if !has_debian() {
            let Some(commands) = setup::packages(&PACKAGES) else { return Err(advice()) };
            setup::install(&format!("compiler for {TARGET} by rustup"), commands);
        }
        match linker() {
            Some(linker) if has_debian() => Ok(Self::Debian { linker }),
            _ => Err(advice()),
        }
    }

    /// Builds the module of a package; its file.
    fn build(&self, package: &str, options: &[&str]) -> Result<PathBuf, String> {
        let folder = match self {
            Self::Own => FOLDER.to_owned(),
            Self::Debian { .. } => format!("{FOLDER}-fallback"),
        };
        let arguments = ["build", "--package", package, "--lib", "--profile", PROFILE];
        let mut command = match self {
            Self::Own => cargo(&arguments),
            Self::Debian { linker } => debian(&arguments, linker),
        };
        command.args(["--target", TARGET, "--target-dir", &folder]).args(options);
        println!("== module: {}", shown(&command));
        run(command, "The module was not built; follow the first message of the compiler above.")?;
        Ok(Path::new(&folder)
            .join(TARGET)
            .join(PROFILE)
            .join(format!("{}.wasm", package.replace('-', "_"))))
    }
}

/// Debian's cargo with Debian's compiler, and the standard library from its sources.
fn debian(arguments: &[&str], linker: &Path) -> Command {
    let mut command = Command::new("/usr/bin/cargo");
    command.args(arguments).arg("-Zbuild-std=std,panic_abort").current_dir(root());
    // Unstable options need leave; what the project's own compiler was told does not hold for this one.
    command.env("RUSTC_BOOTSTRAP", "1").env("RUSTC", "/usr/bin/rustc");
    command.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", linker);
    for variable in ["RUSTUP_TOOLCHAIN", "CARGO", "RUSTDOC"] {
        command.env_remove(variable);
    }
    command
}

/// The standard library of the project's compiler for browsers.
fn has_own_library() -> bool {
    library(&["--print", "target-libdir", "--target", TARGET]).is_some_and(|folder| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.into_iter().any(|e| e.file_name().to_string_lossy().starts_with("libstd-"))
    })
}

fn has_debian() -> bool {
    let compiler = Path::new("/usr/bin/rustc").exists() && Path::new("/usr/bin/cargo").exists();
    compiler && Path::new("/usr/lib/rustlib/src/rust/library/std").exists()
}

/// A linker for wasm, which every toolchain of rustup brings along.
fn linker() -> Option<PathBuf> {
    let libraries = library(&["--print", "target-libdir"])?;
    Some(libraries.parent()?.join("bin/rust-lld")).filter(|file| file.exists())
}

/// What the project's compiler prints, as a path.
fn library(arguments: &[&str]) -> Option<PathBuf> {
    let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(compiler).args(arguments).current_dir(root()).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().into())
}

fn advice() -> String {
    format!(
        "There is no compiler for {TARGET}. Install it: `rustup target add {TARGET}`, or on Debian `apt-get \
         install {}` beside a toolchain of rustup.",
        PACKAGES.join(" ")
    )
}

fn shown(command: &Command) -> String {
    let program = command.get_program().to_string_lossy();
    let program = Path::new(program.as_ref()).file_name().unwrap_or_default().to_string_lossy();
    let arguments = command.get_args().map(|a| a.to_string_lossy().into_owned());
    std::iter::once(program.into_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}
