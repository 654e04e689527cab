//! Where the benchmark runs: a copy of it, a Python environment, the programs that it starts.

use super::plan::{METHODS, Method};
use super::{Options, finish};
use crate::cargo;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folders and programs of a run.
pub struct Environment {
    /// The repository; none there on a machine to which only programs were carried.
    pub root: PathBuf,
    /// The benchmark as it was given; none where only the document is written.
    given: Option<PathBuf>,
    /// Everything that this chore makes.
    folder: PathBuf,
    /// `viscera`, in release.
    pub program: PathBuf,
    /// Of an environment of its own, or the one that was named.
    python: PathBuf,
    /// Whether programs are built and installed here.
    builds: [bool; 2],
}

/// Environment variables by which libraries are told how many threads they may use.
const THREAD_VARIABLES: [&str; 5] = [
    "OMP_NUM_THREADS",
    "TBB_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "RAYON_NUM_THREADS",
];

impl Environment {
    /// Says what is missing before anything is done.
    pub fn find(options: &Options) -> Result<Self, String> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
        let given = match (&options.bench, options.again) {
            (_, true) => None,
            (None, _) => {
                return Err("where is the benchmark? Give its folder with --bench DIR or in the \
                            environment variable VISCERA_BENCH"
                    .into());
            }
            (Some(folder), _) if !folder.join("run_bench.py").is_file() => {
                return Err(format!(
                    "{}: no run_bench.py there; --bench names the folder that holds it",
                    folder.display()
                ));
            }
            (Some(folder), _) => Some(folder.clone()),
        };
        // This program is target/debug/xtask, wherever target may be.
        let this = std::env::current_exe().map_err(|error| format!("where am I? {error}"))?;
        let target = this.ancestors().nth(2).ok_or("no target folder above this program")?;
        let name = format!("viscera{}", std::env::consts::EXE_SUFFIX);
        let folder = options.folder.clone().unwrap_or_else(|| target.join("peers"));
        let whole = |path: &Path| {
            std::path::absolute(path).map_err(|error| format!("{}: {error}", path.display()))
        };
        let folder = whole(&folder)?;
        let builds = [options.viscera.is_none(), options.python.is_none()];
        let program = options.viscera.clone().unwrap_or_else(|| target.join("release").join(name));
        // A bare name is looked for by the system.
        let python = match &options.python {
            None => folder.join("venv/bin/python"),
            Some(python) if python.components().count() == 1 => python.clone(),
            Some(python) => whole(python)?,
        };
        let program = whole(&program)?;
        Ok(Self { root: root.to_owned(), given, folder, program, python, builds })
    }

    /// The copy of the benchmark: its programs write beside themselves, and the original stays
    /// as it is.
    pub fn bench(&self) -> PathBuf {
        self.folder.join("bench")
    }

    /// Where result lines are kept.
    pub fn results(&self) -> PathBuf {
        self.folder.join("results")
    }

    /// Rapier's peer.
    pub fn rapier(&self) -> PathBuf {
        self.bench().join("peers/rapier/target/release/rapier_peer")
    }

    /// What starts a program of the benchmark with more sizes than it has.
    pub fn runner(&self) -> PathBuf {
        self.folder.join("runner.py")
    }

    /// References and meshes, which are kept.
    pub fn cache(&self) -> PathBuf {
        self.folder.join("cache")
    }

    /// Simulators that were asked for and are not installed, by the names that `--peers` has for them.
    pub fn missing(&self, options: &Options) -> Result<Vec<String>, String> {
        let mut missing = Vec::new();
        for name in METHODS.iter().map(|method| method.program.name()) {
            let is_asked =
                options.peers.as_ref().is_none_or(|peers| peers.iter().any(|p| p == name));
            if name == "viscera" || missing.iter().any(|known| known == name) {
                continue;
            }
            let code = format!("import importlib.util as u; exit(u.find_spec('{name}') is None)");
            let is_there = match name {
                _ if !is_asked => false,
                "rapier" => self.rapier().is_file(),
                _ => {
                    self.python().args(["-c", &code]).status().is_ok_and(|status| status.success())
                }
            };
            if !is_there {
                missing.push(name.to_owned());
            }
        }
        Ok(missing)
    }

    /// Methods that can be run here, ours among them.
    pub fn installed(&self, options: &Options) -> Result<Vec<&'static Method>, String> {
        let missing = self.missing(options)?;
        let is_there = |method: &&Method| missing.iter().all(|name| name != method.program.name());
        Ok(METHODS.iter().filter(is_there).collect())
    }

    /// The environment's Python, in the benchmark's folder.
    pub fn python(&self) -> Command {
        let mut command = Command::new(&self.python);
        command
            .current_dir(self.bench())
            .env("SOFTBENCH_CACHE", self.cache())
            .env("VISCERA", &self.program)
            .env("PYTHONUNBUFFERED", "1");
        command
    }

    /// Python on one thread of the last core; the benchmark's own rounds are run so too.
    pub fn pinned_python(&self) -> Command {
        const PIN: &str = "import os, sys; \
            os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-1:]); \
            os.execv(sys.executable, [sys.executable] + sys.argv[1:])";
        let mut command = self.python();
        THREAD_VARIABLES.iter().for_each(|name| {
            command.env(name, "1");
        });
        command.args(["-c", PIN]);
        command
    }

    /// Makes everything that a run needs; what is there already is kept.
    pub fn prepare(&self) -> Result<(), String> {
        let Some(given) = &self.given else { return Ok(()) };
        copy_folder(given, &self.bench())?;
        for folder in [self.results(), self.cache()] {
            fs::create_dir_all(folder).map_err(|error| format!("cannot make a folder: {error}"))?;
        }
        super::write_whole(&self.runner(), include_str!("runner.py"))?;
        let [builds, installs] = self.builds;
        if installs {
            self.install()?;
            finish(
                "build Rapier's peer",
                cargo(&["build", "--release"]).current_dir(self.bench().join("peers/rapier")),
                "its first build needs the network",
            )?;
        }
        if !builds {
            return Ok(());
        }
        const PACKAGES: [&str; 6] =
            ["build", "--release", "--package", "viscera-cli", "--package", "viscera-lab"];
        finish("build viscera", cargo(&PACKAGES).current_dir(&self.root), "mend the errors above")?;
        finish(
            "write the organs",
            Command::new(self.lab()).args(["organs", "--out"]).arg(self.cache()),
            "mend the errors above",
        )
    }

    /// Makes the unstructured bars and what is known of the continuum, unless they are there: of each law the tip's sag
    /// and its error [m].
    pub fn bars(&self) -> Result<BTreeMap<String, [f64; 2]>, String> {
        let file = self.cache().join("continuum.json");
        if !file.is_file() && self.builds[0] {
            finish(
                "write the bars and find the continuum's sag, some minutes, once",
                Command::new(self.lab()).args(["bars", "--out"]).arg(self.cache()),
                "mend the errors above",
            )?;
        }
        let text = fs::read_to_string(&file)
            .map_err(|error| format!("{}: {error}; carry the folder cache here", file.display()))?;
        serde_json::from_str(&text).map_err(|error| format!("{}: {error}", file.display()))
    }

    /// The studies' program, beside `viscera`.
    pub fn lab(&self) -> PathBuf {
        self.program.with_file_name(format!("viscera-lab{}", std::env::consts::EXE_SUFFIX))
    }

    /// Makes what contact needs beside the rest: meshes and truths, MuJoCo's program, and Rapier's, which is built with
    /// the dependencies of the benchmark's. The paths of the two programs.
    pub fn prepare_contact(&self) -> Result<[PathBuf; 2], String> {
        let script = self.folder.join("contact_peer.py");
        super::write_whole(&script, include_str!("contact_peer.py"))?;
        let crate_folder = self.folder.join("rapier-contact");
        let make = |folder: &Path| {
            fs::create_dir_all(folder)
                .map_err(|error| format!("cannot make {}: {error}", folder.display()))
        };
        make(&crate_folder.join("src"))?;
        make(&self.cache())?;
        let list = self.bench().join("peers/rapier/Cargo.toml");
        let list = fs::read_to_string(&list)
            .map_err(|error| format!("{}: {error}; is this the benchmark?", list.display()))?;
        super::write_whole(&crate_folder.join("Cargo.toml"), &list)?;
        let source = include_str!("rapier_contact/main.rs");
        super::write_whole(&crate_folder.join("src/main.rs"), source)?;
        if self.builds[0] {
            finish(
                "build Rapier's program for contact",
                cargo(&["build", "--release"]).current_dir(&crate_folder),
                "its first build needs the network",
            )?;
            finish(
                "write meshes and truths of contact, a minute",
                Command::new(self.lab()).args(["contact-scenes", "--out"]).arg(self.cache()),
                "mend the errors above",
            )?;
        }
        Ok([script, crate_folder.join("target/release/rapier_peer")])
    }

    /// A Python environment with the benchmark's requirements; a mark tells that it is complete.
    fn install(&self) -> Result<(), String> {
        let (venv, list) = (self.folder.join("venv"), self.bench().join("requirements.txt"));
        let mark = venv.join("installed.txt");
        let wanted = fs::read_to_string(&list)
            .map_err(|error| format!("{}: {error}; is this the benchmark?", list.display()))?;
        if fs::read_to_string(&mark).is_ok_and(|installed| installed == wanted) {
            return Ok(());
        }
        let python = find_python()?;
        finish(
            "make a Python environment",
            Command::new(python).args(["-m", "venv"]).arg(&venv),
            "where Python's module venv is missing, install it (Debian: python3.11-venv)",
        )?;
        finish(
            "install the peers (about 1.5 GB)",
            self.python().args(["-m", "pip", "install", "-r", "requirements.txt"]),
            "it needs the network and CPython 3.11",
        )?;
        fs::write(&mark, wanted).map_err(|error| format!("{}: {error}", mark.display()))
    }
}

/// The peers' packages are built for one version of Python.
fn find_python() -> Result<&'static str, String> {
    const NAMES: [&str; 3] = ["python3.11", "python3", "python"];
    let fits = |name: &&&str| {
        let output = Command::new(**name).arg("--version").output();
        output.is_ok_and(|o| o.stdout.starts_with(b"Python 3.11"))
    };
    NAMES
        .iter()
        .find(fits)
        .copied()
        .ok_or_else(|| format!("no CPython 3.11 under the names {}; install it", NAMES.join(", ")))
}

/// Copies what differs, so that nothing is built again without need. Leaves out hidden files and
/// what programs have built.
fn copy_folder(from: &Path, to: &Path) -> Result<(), String> {
    let failed = |error: std::io::Error| format!("cannot copy {}: {error}", from.display());
    fs::create_dir_all(to).map_err(failed)?;
    for entry in fs::read_dir(from).map_err(failed)?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') || ["target", "__pycache__", "results"].contains(&name.as_str()) {
            continue;
        }
        let (source, copy) = (entry.path(), to.join(&name));
        if source.is_dir() {
            copy_folder(&source, &copy)?;
            continue;
        }
        let bytes = fs::read(&source).map_err(failed)?;
        if !fs::read(&copy).is_ok_and(|old| old == bytes) {
            fs::write(&copy, bytes).map_err(failed)?;
        }
    }
    Ok(())
}
