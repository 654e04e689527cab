//! Test programs: built by cargo, run so that no core waits.
//!
//! Programs are run one after the other, each on all cores; the next one starts as soon as the one before has
//! begun its last tests. What happens in them is read from the test harness' own record of events, which has the
//! time of each test. That record is not stable yet, so the harness is told to take this for a nightly
//! build; nothing is compiled differently.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::{cargo, setup};

/// What a test says that finds no graphics device: the library's `NoAdapter`, in words or as a value.
const NO_DEVICE: [&str; 2] = ["no graphics adapter was found", "NoAdapter"];

/// Which tests are wanted.
pub struct Selection<'a> {
    /// Cargo's arguments that choose packages.
    pub packages: &'a [&'a str],
    /// Those marked as slow too.
    pub slow: bool,
    /// Tests that need real data fail without it.
    pub required: bool,
}

/// One test program.
#[derive(Clone, Debug)]
pub struct Program {
    package: String,
    /// "all" of the integration tests, "lib" or the name of a binary for tests inside.
    target: String,
    kind: String,
    file: PathBuf,
    folder: PathBuf,
    driver: Option<PathBuf>,
}

/// A test that failed.
#[derive(Debug)]
pub struct Failed {
    pub name: String,
    /// What runs it alone.
    pub command: String,
}

/// What came of the tests.
#[derive(Debug, Default)]
pub struct Outcome {
    pub passed: usize,
    pub failures: Vec<Failed>,
    /// Marked as slow, and not asked for.
    pub slow: usize,
    /// They need a graphics device, and there is none.
    pub without_device: usize,
    /// Name and time of each test.
    pub tests: Vec<(String, Duration)>,
    /// Name, number of tests and time of each program.
    pub programs: Vec<(String, usize, Duration)>,
}

impl Outcome {
    pub fn add(&mut self, other: Self) {
        self.passed += other.passed;
        self.slow += other.slow;
        self.without_device += other.without_device;
        self.failures.extend(other.failures);
        self.tests.extend(other.tests);
        self.programs.extend(other.programs);
    }
}

impl Program {
    fn title(&self) -> String {
        let place = self.driver.as_ref().map_or("", |_| ", second driver");
        format!("{} {}{place}", self.package, self.target)
    }

    pub fn is_integration_of(&self, package: &str) -> bool {
        self.package == package && self.kind == "test"
    }

    pub fn is_target(&self, package: &str, target: &str) -> bool {
        self.package == package && self.target == target
    }

    /// The same with one driver only.
    pub fn on_driver(mut self, file: &Path) -> Self {
        self.driver = Some(file.to_owned());
        self
    }

    fn command_of(&self, test: &str) -> String {
        let target = match self.kind.as_str() {
            "test" => format!("--test {}", self.target),
            "lib" => "--lib".into(),
            other => format!("--{other} {}", self.target),
        };
        let driver =
            self.driver.as_ref().map(|file| format!("VK_DRIVER_FILES={} ", file.display()));
        let driver = driver.unwrap_or_default();
        format!("{driver}cargo test -p {} {target} {test} -- --include-ignored", self.package)
    }
}

/// Builds the test programs of the packages; on failure what to do.
pub fn build(selection: &Selection<'_>) -> Result<Vec<Program>, String> {
    // Without the examples, which lints check and which take as long to link as tests.
    let before: &[&str] = &[
        "test",
        "--no-run",
        "--lib",
        "--bins",
        "--tests",
        "--message-format=json-render-diagnostics",
    ];
    let mut command = cargo(&[before, selection.packages, &super::SWITCHED_ON].concat());
    let child = command.stdout(Stdio::piped()).spawn();
    let mut child = child.map_err(|e| format!("cargo could not be started: {e}"))?;
    let mut programs = Vec::new();
    for line in BufReader::new(child.stdout.take().ok_or("cargo says nothing")?).lines() {
        let line = line.map_err(|e| format!("cargo's output could not be read: {e}"))?;
        let Ok(message) = serde_json::from_str::<Value>(&line) else { continue };
        let Some(file) = message["executable"].as_str() else { continue };
        let target = &message["target"];
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let kind = text(&target["kind"][0]);
        let manifest = PathBuf::from(text(&message["manifest_path"]));
        let folder = manifest.parent().unwrap_or(Path::new(".")).to_owned();
        if message["profile"]["test"] != true {
            continue;
        }
        programs.push(Program {
            package: package_of(&text(&message["package_id"])),
            target: if kind == "lib" { "lib".into() } else { text(&target["name"]) },
            kind,
            file: file.into(),
            folder,
            driver: None,
        });
    }
    if !child.wait().is_ok_and(|status| status.success()) {
        return Err("Mend what the compiler names above.".into());
    }
    // What takes longest first: the library's tests of whole simulations, then those of programs.
    programs.sort_by_key(|p| {
        (p.kind != "test", p.package != "viscera", p.package.clone(), p.target.clone())
    });
    Ok(programs)
}

/// The name in a package's identifier: `path+file:///a/viscera#0.1.0`, `path+file:///a/cli#viscera-cli@0.1.0`.
fn package_of(identifier: &str) -> String {
    let (folder, rest) = identifier.split_once('#').unwrap_or((identifier, ""));
    let name = match rest.split_once('@') {
        Some((name, _)) => name,
        None => folder.rsplit('/').next().unwrap_or(folder),
    };
    name.to_owned()
}

/// What the program of a number tells.
enum Message {
    /// Nothing of it waits for a core any more.
    Draining(usize),
    Ended(usize, Outcome),
}

/// Runs programs; with `names`, the tests whose names contain one of them.
pub fn run(programs: &[Program], selection: &Selection<'_>, names: &[&str]) -> Outcome {
    let (sender, receiver) = mpsc::channel();
    let mut outcome = Outcome::default();
    std::thread::scope(|scope| {
        let mut running = 0;
        for (number, program) in programs.iter().enumerate() {
            let sender = sender.clone();
            running += 1;
            scope.spawn(move || {
                let drains = || {
                    // The receiver waits for every program's end.
                    let _ = sender.send(Message::Draining(number));
                };
                let ended = run_program(program, selection, names, drains);
                let _ = sender.send(Message::Ended(number, ended));
            });
            // The next one may start.
            while let Ok(message) = receiver.recv() {
                let (Message::Draining(from) | Message::Ended(from, _)) = message;
                if let Message::Ended(_, ended) = message {
                    running -= 1;
                    outcome.add(ended);
                }
                if from == number {
                    break;
                }
            }
        }
        while running > 0 {
            if let Ok(Message::Ended(_, ended)) = receiver.recv() {
                running -= 1;
                outcome.add(ended);
            }
        }
    });
    outcome
}

/// The events of one program.
struct Events<'a> {
    program: &'a Program,
    outcome: Outcome,
    count: usize,
    begun: usize,
    under_way: BTreeSet<String>,
    has_driver: bool,
}

fn run_program(
    program: &Program,
    selection: &Selection<'_>,
    names: &[&str],
    drains: impl Fn(),
) -> Outcome {
    let started = Instant::now();
    let mut command = Command::new(&program.file);
    command.current_dir(&program.folder).args(names);
    command.args(["-Z", "unstable-options", "--format", "json", "--report-time"]);
    command.env("RUSTC_BOOTSTRAP", "1").env("CARGO_MANIFEST_DIR", &program.folder);
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // Drivers complain where it is unset.
        command.env("XDG_RUNTIME_DIR", std::env::temp_dir());
    }
    if selection.slow {
        command.arg("--include-ignored");
    }
    if selection.required {
        command.env("VISCERA_REQUIRE", "1");
    }
    if let Some(driver) = &program.driver {
        setup::use_driver(&mut command, driver);
    }
    let mut events = Events {
        program,
        outcome: Outcome::default(),
        count: usize::MAX,
        begun: 0,
        under_way: BTreeSet::new(),
        has_driver: program.driver.is_some() || setup::has_driver(),
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let ended = command.stdout(Stdio::piped()).spawn().and_then(|mut child| {
        let mut has_drained = false;
        let output = child.stdout.take().map(BufReader::new);
        for line in output.into_iter().flat_map(BufReader::lines) {
            events.take(&line?);
            let has_idle_core = events.begun >= events.count && events.under_way.len() < cores;
            if has_idle_core && !has_drained {
                has_drained = true;
                drains();
            }
        }
        child.wait()
    });
    let good = ended.as_ref().is_ok_and(|status| status.success());
    let mut outcome = events.outcome;
    if !good && outcome.failures.is_empty() && outcome.without_device == 0 {
        let during: Vec<&str> = events.under_way.iter().map(String::as_str).collect();
        let during = during.join(", ");
        println!("{} ended early: {ended:?}; running: {during}", program.title());
        let name = format!("{} as a whole", program.title());
        let command = program.command_of(&during);
        outcome.failures.push(Failed { name, command });
    }
    let time = started.elapsed();
    let count = outcome.tests.len();
    if count > 0 {
        println!("{:<32}{count:>5} tests {:>8.1} s", program.title(), time.as_secs_f64());
        outcome.programs.push((program.title(), count, time));
    }
    outcome
}

impl Events<'_> {
    /// One line of the record.
    fn take(&mut self, line: &str) {
        let Ok(event) = serde_json::from_str::<Value>(line) else {
            // A test that prints past the harness.
            println!("{line}");
            return;
        };
        let name = event["name"].as_str().unwrap_or_default();
        match (event["type"].as_str(), event["event"].as_str()) {
            (Some("suite"), Some("started")) => {
                self.count = event["test_count"].as_u64().unwrap_or(0) as usize;
            }
            (Some("test"), Some("started")) => {
                self.begun += 1;
                self.under_way.insert(name.to_owned());
            }
            (Some("test"), Some(what)) => self.end(name, what, &event),
            _ => {}
        }
        self.show_progress();
    }

    fn end(&mut self, name: &str, what: &str, event: &Value) {
        self.under_way.remove(name);
        let said = event["stdout"].as_str().unwrap_or_default();
        match what {
            "ok" => self.outcome.passed += 1,
            "ignored" => self.outcome.slow += 1,
            "failed" if !self.has_driver && NO_DEVICE.iter().any(|words| said.contains(words)) => {
                self.outcome.without_device += 1;
            }
            "failed" => {
                println!("\n-- {} {name} failed\n{said}", self.program.title());
                let command = self.program.command_of(name);
                self.outcome.failures.push(Failed { name: name.to_owned(), command });
            }
            // A test that takes its time is told of, and goes on.
            _ => {
                self.under_way.insert(name.to_owned());
                return;
            }
        }
        if what != "ignored" {
            let time = Duration::from_secs_f64(event["exec_time"].as_f64().unwrap_or(0.0));
            let title = format!("{} {name}", self.program.title());
            self.outcome.tests.push((title, time));
        }
    }

    /// A line that is written over.
    fn show_progress(&self) {
        if std::io::stdout().is_terminal() && self.count != usize::MAX {
            let ended = self.begun - self.under_way.len();
            print!("{} {ended} of {}\r", self.program.title(), self.count);
            // A terminal that takes no more text shows no progress.
            let _ = std::io::stdout().flush();
        }
    }
}
