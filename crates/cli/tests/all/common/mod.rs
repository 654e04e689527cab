//! Running the built program in a folder of its own.

use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// A bar of ten tetrahedra, held at one end and drawn to one and a half times its length.
pub const TINY: &str = r#"
title = "Tiny"
time = { duration = "0.2 s", velocity_factor = 0.9 }

[[body]]
name = "bar"
shape = "block"
size = ["40 mm", "20 mm", "20 mm"]
cells = [2, 1, 1]
material = { young = "10 kPa", poisson = 0.45, density = "1000 kg/m^3" }

[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[motion]]
name = "grip"
body = "bar"
half_space = { point = ["40 mm", 0, 0], normal = [1, 0, 0] }
keys = [{ time = "0.1 s", translation = ["20 mm", 0, 0] }]

[output]
picture_size = [160, 120]
"#;

/// A folder with a scene file and room for results; it vanishes with the test.
pub struct Bench {
    folder: TempDir,
}

impl Bench {
    pub fn new(scene: &str) -> Self {
        let bench = Self { folder: TempDir::new().expect("a folder for the test") };
        bench.write("scene.toml", scene.as_bytes());
        bench
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).expect("a file for the test");
    }

    /// `viscera` in the folder, blind to the data folder of whoever runs the tests.
    pub fn viscera(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viscera"));
        command.current_dir(self.folder.path()).env_remove("VISCERA_DATA").args(arguments);
        // Drivers complain where it is unset.
        command.env("XDG_RUNTIME_DIR", self.folder.path());
        command
    }

    /// Runs `viscera` to its end.
    pub fn end_of(&self, arguments: &[&str]) -> End {
        let output = self.viscera(arguments).output().expect("viscera starts");
        End::of(&output)
    }

    /// Runs the scene with further arguments; the results are in `out`.
    pub fn run(&self, arguments: &[&str]) -> End {
        self.end_of(&[&["run", "scene.toml", "--out", "out"], arguments].concat())
    }

    /// Runs the scene, which must succeed, and reads its summary.
    pub fn summary_of(&self, arguments: &[&str]) -> Value {
        let end = self.run(arguments);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        self.summary("out")
    }

    pub fn summary(&self, out: &str) -> Value {
        let text = self.read(&format!("{out}/summary.json"));
        serde_json::from_slice(&text).expect("summary.json is JSON")
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Names of all files in a folder and below, sorted; none where there is no such folder.
    pub fn files(&self, folder: &str) -> BTreeSet<String> {
        let mut files = BTreeSet::new();
        collect_files(&self.path(folder), "", &mut files);
        files
    }

    /// The files that a PVD series names, in its order.
    pub fn listed(&self, series: &str) -> Vec<String> {
        let text = String::from_utf8(self.read(series)).expect("a PVD file is text");
        let names = text.split("file=\"").skip(1);
        names.map(|rest| rest.split('"').next().unwrap_or("").to_owned()).collect()
    }

    /// Asserts that a series names each of its frames once and in order, and that they are whole.
    pub fn assert_series_is_whole(&self, out: &str) {
        let listed = self.listed(&format!("{out}/tissue.pvd"));
        let files = self.files(&format!("{out}/frames"));
        let files: Vec<String> = files.iter().map(|name| format!("frames/{name}")).collect();
        assert_eq!(listed, files);
        for name in listed {
            let bytes = self.read(&format!("{out}/{name}"));
            viscera::mesh::io::read_tet_mesh(&name, &bytes, 1.0).expect("a whole mesh");
        }
    }

    /// Width and height of a PNG [pixels], and its bytes decoded.
    pub fn decode_png(&self, name: &str) -> ([u32; 2], Vec<u8>) {
        let bytes = self.read(name);
        let decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        let mut reader = decoder.read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("a picture that fits")];
        let info = reader.next_frame(&mut pixels).expect("a whole PNG");
        ([info.width, info.height], pixels)
    }

    /// How long a GIF plays [s]; all of it is decoded.
    pub fn gif_seconds(&self, name: &str) -> f64 {
        let bytes = self.read(name);
        let mut decoder = gif::DecodeOptions::new().read_info(&bytes[..]).expect("a GIF");
        let mut hundredths = 0;
        while let Some(frame) = decoder.read_next_frame().expect("a whole GIF") {
            hundredths += u32::from(frame.delay);
        }
        f64::from(hundredths) / 100.0
    }

    /// Holds that `motion.gif` takes as long as the frames that a summary reports, its last one held [s].
    pub fn assert_gif_keeps_time(&self, folder: &str, summary: &Value) {
        let frames = summary["frames"].as_array().expect("frames");
        let times = [frames.first(), frames.last()]
            .map(|frame| frame.and_then(|frame| frame["time"].as_f64()).expect("a time"));
        let wanted = times[1] - times[0] + 1.5;
        let played = self.gif_seconds(&format!("{folder}/motion.gif"));
        assert!((played - wanted).abs() < 0.01, "{played} s for {wanted} s");
    }
}

fn collect_files(folder: &Path, prefix: &str, files: &mut BTreeSet<String>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            collect_files(&entry.path(), &format!("{name}/"), files);
        } else {
            files.insert(name);
        }
    }
}

/// How the program ended and what it said.
pub struct End {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl End {
    pub fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("output is UTF-8");
        let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
        Self { code: output.status.code(), stdout, stderr }
    }

    /// The one line that says why the program refused.
    pub fn error(&self) -> &str {
        let mut errors = self.stderr.lines().filter(|line| line.starts_with("error:"));
        let error = errors.next().unwrap_or_else(|| panic!("no error: {:?}", self.stderr));
        assert!(matches!(self.code, Some(1 | 2)), "{:?}: {error}", self.code);
        assert_eq!(errors.next(), None, "a second error after {error}");
        error.trim_start_matches("error: ")
    }
}

/// Numbers of a JSON list.
pub fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().expect("a list");
    list.iter().map(|number| number.as_f64().expect("a number")).collect()
}

/// The last frame of a summary.
pub fn last_frame(summary: &Value) -> &Value {
    summary["frames"].as_array().and_then(|frames| frames.last()).expect("a frame")
}

/// Force [N] on a patch in a frame of a summary.
pub fn patch_force(frame: &Value, name: &str) -> Vec<f64> {
    let patches = frame["patches"].as_array().expect("patches");
    let patch = patches.iter().find(|patch| patch["name"] == name).expect("the patch");
    numbers(&patch["force"])
}
