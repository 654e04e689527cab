//! What the tests need beside Rust: graphics drivers (software ones where a machine has no other), rustfmt
//! and clippy. Nothing is installed before it is announced, or asked for where a person sits at the terminal.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use crate::{cargo, wheel};

/// What `cargo xtask setup --help` prints.
pub const HELP: &str = "\
Install what the tests lack. It says what, and how, before it does so; at a terminal it asks.

Usage: cargo xtask setup [--all]

  a graphics driver      Debian's mesa-vulkan-drivers and libvulkan1: a software driver where there is no
                         graphics processor. Without one the tests of the GPU backend are left out
  rustfmt, clippy        by rustup
  --all                  what `cargo xtask test --all` needs as well: a second, stricter software driver,
                         which Debian's chromium brings along, and that browser for the page; Python from 3.10 on
                         for the Python package

Packages come by apt-get, as root or by sudo; other systems are told what to install.";

/// Where Vulkan's loader looks for drivers on Linux.
const DRIVER_FOLDERS: [&str; 3] =
    ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];

/// What names a driver to the loader without a folder.
const DRIVER_VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// What gives a Debian system a software driver.
const PACKAGES: [&str; 2] = ["mesa-vulkan-drivers", "libvulkan1"];

/// The second software driver, stricter and without anything beyond the baseline; it comes with the
/// browser.
const SECOND: &str = "/usr/lib/chromium/vk_swiftshader_icd.json";
const SECOND_PACKAGE: &str = "chromium";

/// The browser itself, in which the page is tried.
const BROWSER: &str = "/usr/bin/chromium";

/// One thing that a test command may need.
struct Need {
    /// As in "no graphics driver".
    name: &'static str,
    is_there: fn() -> bool,
    source: Source,
}

enum Source {
    /// Debian's packages.
    Packages(&'static [&'static str]),
    /// A component of the toolchain.
    Component(&'static str),
}

const FAST: &[Need] = &[
    Need { name: "graphics driver", is_there: has_driver, source: Source::Packages(&PACKAGES) },
    Need { name: "rustfmt", is_there: has_rustfmt, source: Source::Component("rustfmt") },
    Need { name: "clippy", is_there: has_clippy, source: Source::Component("clippy") },
];

const SECOND_DRIVER: Need = Need {
    name: "second graphics driver",
    is_there: has_second_driver,
    source: Source::Packages(&[SECOND_PACKAGE]),
};

const PYTHON: Need = Need {
    name: "Python from 3.10 on, with venv",
    is_there: wheel::has_python,
    source: Source::Packages(&["python3", "python3-venv"]),
};

/// `cargo xtask setup`.
pub fn setup(options: &[&str]) -> ExitCode {
    let all = match options {
        [] => false,
        ["--all"] => true,
        [other, ..] => {
            eprintln!("unknown option `{other}` of `cargo xtask setup`; the only one is --all");
            return ExitCode::from(2);
        }
    };
    let lacking = provide(all);
    for sentence in &lacking {
        eprintln!("{sentence}");
    }
    if lacking.is_empty() {
        println!("Everything that the tests need is there.");
        return ExitCode::SUCCESS;
    }
    ExitCode::FAILURE
}

/// Installs what is not there, where that is possible and wanted; what is lacking then, a sentence each with
/// what to do.
pub fn provide(all: bool) -> Vec<String> {
    for need in needs(all).filter(|need| !(need.is_there)()) {
        match need.source.command() {
            Some(commands) => install(need.name, commands),
            None => println!("No {}, and no way to install it from here.", need.name),
        }
    }
    lacking(all)
}

/// What is not there, a sentence each with what to do.
pub fn lacking(all: bool) -> Vec<String> {
    let lacking = needs(all).filter(|need| !(need.is_there)());
    lacking.map(|need| format!("There is no {}. {}", need.name, need.source.advice())).collect()
}

fn needs(all: bool) -> impl Iterator<Item = &'static Need> {
    const ALL: &[Need] = &[SECOND_DRIVER, PYTHON];
    // Elsewhere drivers come with the system.
    let linux = cfg!(target_os = "linux");
    let second = if all { ALL } else { &[] };
    let is_driver = |need: &Need| matches!(need.source, Source::Packages(_));
    FAST.iter().chain(second).filter(move |need| linux || !is_driver(need))
}

/// Prints the commands, and asks first in a terminal.
pub fn install(name: &str, commands: Vec<Vec<String>>) {
    let lines: Vec<String> = commands.iter().map(|words| words.join(" ")).collect();
    println!("There is no {name}. To install it:\n    {}", lines.join("\n    "));
    if std::env::var_os("CI").is_none() && std::io::stdin().is_terminal() && !agreed() {
        return;
    }
    for words in commands {
        let mut command = Command::new(&words[0]);
        command.args(&words[1..]).env("DEBIAN_FRONTEND", "noninteractive");
        if !command.status().is_ok_and(|status| status.success()) {
            println!("`{}` failed.", words.join(" "));
            return;
        }
    }
}

fn agreed() -> bool {
    print!("Do that now? [Y/n] ");
    // A terminal that takes no text gives no answer either, which is a no.
    let _ = std::io::stdout().flush();
    let mut answer = String::new();
    let read = std::io::stdin().read_line(&mut answer);
    read.is_ok_and(|length| length > 0)
        && ["", "y", "yes"].contains(&answer.trim().to_lowercase().as_str())
}

impl Source {
    /// The commands that install it, in order; nothing where none would succeed.
    fn command(&self) -> Option<Vec<Vec<String>>> {
        match self {
            Self::Component(name) => {
                has_rustup().then(|| vec![words(&["rustup", "component", "add", name])])
            }
            Self::Packages(names) => packages(names),
        }
    }

    fn advice(&self) -> String {
        match self {
            Self::Packages(packages) => format!(
                "Install it: `apt-get install {}` on Debian and Ubuntu, the package of the same driver \
                 elsewhere.",
                packages.join(" ")
            ),
            Self::Component(name) => format!(
                "Install it: `rustup component add {name}`, or the package of that name where Rust comes \
                 from the system."
            ),
        }
    }
}

/// The commands that install Debian's packages; nothing where they would not succeed.
pub fn packages(names: &[&str]) -> Option<Vec<Vec<String>>> {
    let before: &[&str] = match (is_root(), std::io::stdin().is_terminal()) {
        (true, _) => &[],
        // A password may be asked for.
        (false, true) if Path::new("/usr/bin/sudo").exists() => &["sudo"],
        (false, _) => return None,
    };
    let with = |rest: &[&str]| words(&[before, &["apt-get"], rest].concat());
    let install = [&["install", "-y", "--no-install-recommends"], names].concat();
    let has_apt = Path::new("/usr/bin/apt-get").exists();
    has_apt.then(|| vec![with(&["update"]), with(&install)])
}

/// A command by its words.
pub fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// Rust came by rustup.
pub fn has_rustup() -> bool {
    Command::new("rustup").arg("--version").output().is_ok()
}

fn is_root() -> bool {
    let id = Command::new("id").arg("-u").output();
    id.is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

/// A driver for the tests of the GPU backend is there.
pub fn has_driver() -> bool {
    let named = DRIVER_VARIABLES.iter().find_map(std::env::var_os);
    if let Some(files) = named.filter(|files| !files.is_empty()) {
        return std::env::split_paths(&files).any(|file| file.exists());
    }
    !cfg!(target_os = "linux")
        || DRIVER_FOLDERS.iter().any(|folder| {
            let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
            entries.into_iter().any(|entry| entry.path().extension().is_some_and(|e| e == "json"))
        })
}

/// The second driver's file; nothing where it is missing.
pub fn second_driver() -> Option<PathBuf> {
    has_second_driver().then(|| SECOND.into())
}

/// Makes a program use one driver only.
pub fn use_driver(command: &mut Command, file: &Path) {
    for variable in DRIVER_VARIABLES {
        command.env(variable, file);
    }
}

fn has_second_driver() -> bool {
    cfg!(target_os = "linux") && Path::new(SECOND).exists()
}

/// A browser for the page's tests is there.
pub fn has_browser() -> bool {
    let named = std::env::var_os("VISCERA_BROWSER").map(PathBuf::from);
    named.unwrap_or_else(|| BROWSER.into()).exists()
}

fn has_rustfmt() -> bool {
    has_subcommand("fmt")
}

fn has_clippy() -> bool {
    has_subcommand("clippy")
}

fn has_subcommand(name: &str) -> bool {
    cargo(&[name, "--version"]).output().is_ok_and(|output| output.status.success())
}
