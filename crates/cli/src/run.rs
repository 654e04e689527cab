//! `viscera run`.

use crate::film::Film;
use crate::hold::Hold;
use crate::import;
use crate::output::OutputFolder;
use crate::progress;
use crate::recording_file::RecordingFile;
use crate::series::Series;
use crate::summary::{FrameLine, ROW_HEADS, Summary, frame_row};
use crate::tool_table::ToolTable;
use crate::words::{Words, heading, json, last_words};
use anyhow::{Context, Result, bail};
use clap::Args;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::{register, register_conditional_shutdown};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use viscera::record::RecordedFile;
use viscera::scalar::Real;
use viscera::scene::Scene;
use viscera::settings::{DeviceRequest, Precision};
use viscera::simulation::{Assembly, MeshReport, RestReport, Simulation, advice};
use viscera_resources::{Memory, MeshFiles, files, memory, scene_text};

/// Simulate a scene; write meshes, a picture, an animation and the numbers
///
/// Writes to the output folder: tissue.pvd (open it in ParaView: displacement, velocity, J,
/// principal stretches, von Mises stress, energy density, region), surface.pvd, final.vtu,
/// final_surface.obj, picture.png, motion.gif and summary.json; of a scene with tools also tools.csv, the force on
/// each tool in each frame. Ctrl-C and SIGTERM end a run cleanly: what
/// is finished is kept, summary.json says so, and the exit code is 130. Of more than 2,000 frames
/// summary.json has every second, fourth ... and the last.
#[derive(Args, Clone)]
pub struct RunArguments {
    /// The scene file, or the name of one that `viscera scene list` prints; or a mesh, a surface or a segmented scan, of which
    /// a scene is made first (`viscera scene new`)
    scene: PathBuf,
    /// Folder for the results [default: out/NAME-OF-THE-SCENE]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Compute so many frames instead of the scene's duration
    #[arg(long, value_name = "N", value_parser = from_one::<u64>, allow_negative_numbers = true)]
    frames: Option<u64>,
    /// Write every K-th frame; the same as --set output.every=K
    #[arg(long, value_name = "K", value_parser = from_one::<u32>, allow_negative_numbers = true)]
    every: Option<u32>,
    /// Change a setting: KEY=VALUE, as in `solver.iterations=20` or
    /// `body.liver.material.young="8 kPa"`; may be repeated. `viscera scene describe` lists keys
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Folder where mesh files are looked for that are not beside the scene
    #[arg(long, value_name = "DIR", env = "VISCERA_DATA")]
    data: Option<PathBuf>,
    /// Memory that may be used [default: what is free]
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Save the simulation after its last frame, also where it is interrupted, to go on later with --resume
    #[arg(long, value_name = "FILE")]
    save: Option<PathBuf>,
    /// Go on from a file that --save wrote, with the same scene and settings: to the bit as if it had never
    /// stopped. Frames count from the scene's beginning, those of the results from where it goes on
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Record the run, to have it once more with `viscera replay`
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Print a line for every frame, as it is computed
    #[arg(long, short)]
    verbose: bool,
    /// Print what summary.json has, in place of everything else
    #[arg(long, conflicts_with = "verbose")]
    json: bool,
    #[command(flatten)]
    of_import: import::OfSceneNew,
}

/// Counts from one on; the error says that, not the largest number there is.
pub fn from_one<T: TryFrom<u64>>(text: &str) -> Result<T, String> {
    let count = text.trim().parse::<u64>().ok().filter(|&count| count > 0);
    let count = count.and_then(|count| T::try_from(count).ok());
    count.ok_or_else(|| "write a whole number from 1 on".to_owned())
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything was computed and written.
    Finished,
    /// Ctrl-C or SIGTERM ended it; what was finished is written.
    Interrupted,
}

/// Carries out `viscera run`.
pub fn run(arguments: &RunArguments) -> Result<Outcome> {
    arguments.of_import.refuse(&arguments.scene)?;
    let folder = arguments.out.clone().unwrap_or_else(|| folder_of(&arguments.scene));
    let made;
    let mut balance = None;
    let mut arguments = arguments;
    if viscera_import::is_foreign(&arguments.scene) {
        // A mesh or a scan: its scene is made first, and stays beside the results to be changed.
        let (scene, found) = import::scene_of(&arguments.scene, &folder, arguments.json)?;
        balance = found;
        made = RunArguments { scene, ..arguments.clone() };
        arguments = &made;
    }
    let (scene, overrides) = read_scene(arguments)?;
    let meshes = MeshFiles::new(&arguments.scene, arguments.data.as_deref());
    let mut loaded = Vec::new();
    let mut load = |name: &str| {
        let bytes = meshes.load(name)?;
        if arguments.record.is_some() {
            loaded.push(RecordedFile::new(name, &bytes));
        }
        Ok(bytes)
    };
    let assembly = Assembly::with_balance(&scene, &mut load, balance)?;
    let tets = assembly.bodies.iter().map(|body| body.tets.len()).sum();
    let what = format!("{}: a simulation of {tets} tetrahedra", scene.name);
    let needed = memory::of_run(tets, &scene.solver);
    memory::check(&what, needed, arguments.memory, "take a coarser mesh")?;
    let frames = arguments.frames.unwrap_or_else(|| scene.frame_count());
    if let Some(file) = &arguments.save {
        files::prepare_file(file, "--save")?;
    }
    let interrupted = listen()?;
    let words = match (arguments.json, arguments.verbose) {
        (true, _) => Words::Json,
        (_, true) => Words::EveryFrame,
        _ => Words::Table,
    };
    let save = arguments.save.as_deref();
    let plan = Plan { overrides, folder, frames, interrupted, save, words };
    match scene.solver.precision {
        Precision::F32 => {
            start(build::<f32>(scene, assembly, arguments, frames)?, plan, loaded, arguments)
        }
        Precision::F64 => {
            start(build::<f64>(scene, assembly, arguments, frames)?, plan, loaded, arguments)
        }
    }
}

/// The folder for the results of a scene or a file from elsewhere.
fn folder_of(scene: &Path) -> PathBuf {
    match viscera_import::is_foreign(scene) {
        true => viscera_import::folder_of(scene),
        false => Path::new("out").join(scene.file_stem().unwrap_or(scene.as_os_str())),
    }
}

/// What a run is to do, and where its results go.
pub struct Plan<'a> {
    pub overrides: Overrides,
    pub folder: PathBuf,
    /// The number of the last one, of runs that nothing sets back.
    pub frames: u64,
    pub interrupted: Arc<AtomicBool>,
    pub save: Option<&'a Path>,
    pub words: Words,
}

/// Whether Ctrl-C or SIGTERM have come, from now on.
pub fn listen() -> Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // The second one ends the program at once, as one would expect of the first elsewhere: what is
        // registered first looks at the flag before the other sets it.
        register_conditional_shutdown(signal, crate::INTERRUPTED.into(), Arc::clone(&interrupted))
            .and_then(|_| register(signal, Arc::clone(&interrupted)))
            .context("cannot listen for Ctrl-C")?;
    }
    Ok(interrupted)
}

/// Runs, and records where that is asked for.
fn start<S: Real>(
    mut simulation: Simulation<S>,
    plan: Plan<'_>,
    loaded: Vec<RecordedFile>,
    arguments: &RunArguments,
) -> Result<Outcome> {
    let Some(file) = &arguments.record else {
        return simulate(simulation, plan, &mut |simulation| Ok(simulation.advance_frame()?));
    };
    let mut recording = RecordingFile::create(file, &mut simulation, loaded)?;
    let outcome = simulate(simulation, plan, &mut |simulation| {
        simulation.advance_frame()?;
        recording.frame(simulation)
    });
    recording.end()?;
    outcome
}

/// Goes on by a frame.
pub type Step<'a, S> = &'a mut dyn FnMut(&mut Simulation<S>) -> Result<()>;

/// Keys and values that the command line puts over those of the scene file.
pub type Overrides = Vec<(String, String)>;

fn read_scene(arguments: &RunArguments) -> Result<(Scene, Overrides)> {
    let every = arguments.every.map(|every| every.to_string());
    let mut overrides = settings(&arguments.settings)?;
    if let Some(every) = &every {
        overrides.push(("output.every", every));
    }
    let scene = parse_scene(&arguments.scene, &overrides)?;
    let owned = overrides.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
    Ok((scene, owned.collect()))
}

/// Keys and values of `--set`.
pub fn settings(given: &[String]) -> Result<Vec<(&str, &str)>> {
    let pair = |setting: &'_ String| match setting.split_once('=') {
        Some(_) => Ok(()),
        None => bail!("--set {setting}: write KEY=VALUE, for example --set solver.iterations=20"),
    };
    given.iter().try_for_each(pair)?;
    let pairs = given.iter().filter_map(|setting| setting.split_once('='));
    Ok(pairs.map(|(key, value)| (key.trim(), value.trim())).collect())
}

/// A scene of a file, or one that is built in, with settings over its own.
pub fn parse_scene(scene: &Path, overrides: &[(&str, &str)]) -> Result<Scene> {
    let name = scene.display().to_string();
    let text = scene_text(scene)?;
    Ok(Scene::parse(&name, &text, overrides)?)
}

/// Runs a simulation to its last frame, by `step` from frame to frame, and writes what it gives.
pub fn simulate<S: Real>(
    mut simulation: Simulation<S>,
    plan: Plan<'_>,
    step: Step<'_, S>,
) -> Result<Outcome> {
    let Plan { overrides, folder, frames, interrupted, save, words } = plan;
    // Where the device is refused no folder stays behind.
    let out = &OutputFolder::create(&folder)?;
    let summary = Summary::new(&simulation, overrides);
    if words != Words::Json {
        files::print(&heading(&simulation, &summary, frames))?;
    }
    let draws = simulation.scene().output.picture;
    let mut recording = Recording {
        film: draws.then(|| Film::new(&simulation, frames)).transpose()?,
        series: Series::create(out, &simulation)?,
        tools: ToolTable::default(),
        hold: Hold::new(&simulation, frames),
        summary,
        words,
    };
    let ended = recording.compute(&mut simulation, frames, &interrupted, step);
    let Recording { film, series, tools, hold, mut summary, .. } = recording;
    let (mut series, written) = series.end();
    let ended = ended.and_then(|complete| written.map(|()| complete));
    let complete = matches!(ended, Ok(true));
    let ended = ended.map(|_| ());
    summary.finished = complete && ended.is_ok();
    summary.stopped = match &ended {
        Err(error) => Some(error.to_string()),
        Ok(()) if complete => None,
        Ok(()) => Some("interrupted".into()),
    };
    // What failed has no state to judge.
    let (rest, mesh) = if ended.is_ok() { judged(&simulation) } else { (None, None) };
    if let Some(file) = save.filter(|_| ended.is_ok()) {
        files::write_atomic(file, &simulation.save())?;
    }
    summary.judge(&simulation, rest, mesh);
    summary.hold = hold.end(&simulation).filter(|_| summary.finished);
    summary.device = simulation.device_choice().to_owned();
    summary.warnings.extend(simulation.device_warning().map(String::from));
    // Numbers before meshes and pictures: those take a while, and may be what failed.
    write_summary(out, &summary)?;
    tools.write(out)?;
    // Positions that are NaN are no mesh; the frames before them are.
    match &ended {
        Ok(()) => series.finish(&simulation)?,
        Err(_) => series.write_lists()?,
    }
    let mut drawn = true;
    if let Some(film) = &film {
        let bar = progress::bar(film.picture_count(), "drawing", "{pos} of {len} pictures");
        // A run that was interrupted still shows what it has; the next Ctrl-C ends the drawing.
        interrupted.store(false, Ordering::Relaxed);
        drawn = film.develop(out, &bar, &interrupted)?;
        bar.finish_and_clear();
    }
    if let Err(error) = ended {
        let kept = summary.frames.computed();
        bail!("{error:#} ({kept} frames before that are in {})", out.path().display());
    }
    files::print(&last_words(&summary, words, out)?)?;
    match (summary.finished, drawn) {
        (true, true) => return Ok(Outcome::Finished),
        (true, false) => eprintln!("interrupted while drawing; meshes and numbers are complete"),
        (false, _) => eprintln!("interrupted after {} of {frames} frames", simulation.frame()),
    }
    Ok(Outcome::Interrupted)
}

/// How far the end is from rest, and the mesh from the body.
fn judged<S: Real>(simulation: &Simulation<S>) -> (Option<RestReport>, Option<MeshReport>) {
    let spinner = progress::spinner("estimating the errors of the end and of the mesh".to_owned());
    let found = (simulation.rest(), simulation.mesh_error());
    spinner.finish_and_clear();
    found
}

/// Some drivers compile kernels for seconds, here or with the first frame.
fn build<S: Real>(
    scene: Scene,
    assembly: Assembly,
    arguments: &RunArguments,
    frames: u64,
) -> Result<Simulation<S>> {
    for note in &assembly.notes {
        eprintln!("note: {note}");
    }
    let device = &scene.solver.device;
    // What "auto" comes to is not known yet, and it is mostly the CPU.
    let waiting = (!matches!(device, DeviceRequest::Cpu | DeviceRequest::Auto))
        .then(|| progress::spinner(format!("compiling kernels for device \"{device}\"")));
    let simulation = Simulation::new(scene, assembly);
    if let Some(spinner) = waiting {
        spinner.finish_and_clear();
    }
    if let Ok(simulation) = &simulation {
        if let Some(advice) = advice::stiff_contact(&simulation.scene_in_force()) {
            eprintln!("note: {advice}");
        }
        let unused: Vec<_> =
            simulation.solver().unused().iter().map(|key| format!("solver.{key}")).collect();
        if !unused.is_empty() {
            let (keys, method) = (unused.join(", "), simulation.solver().method);
            eprintln!(
                "note: {keys}: without effect with method \"{method}\"; set solver.method = \"xpbd\" to use them"
            );
        }
    }
    let Some(file) = &arguments.resume else { return Ok(simulation?) };
    let resumed = simulation?.resume(&files::read(file)?);
    let resumed = resumed.with_context(|| file.display().to_string())?;
    if resumed.frame() >= frames {
        let there = resumed.frame();
        bail!("{} is at frame {there}; compute more than that with --frames", file.display());
    }
    Ok(resumed)
}

/// What a run keeps of its frames.
struct Recording<S: Real> {
    film: Option<Film>,
    series: Series<S>,
    tools: ToolTable,
    hold: Hold<S>,
    summary: Summary,
    words: Words,
}

impl<S: Real> Recording<S> {
    /// Computes frames and records them until they are all there, Ctrl-C is pressed, or something
    /// fails. What fails to be written says so at the end of the series. Returns whether they are all there.
    fn compute(
        &mut self,
        simulation: &mut Simulation<S>,
        frames: u64,
        interrupted: &AtomicBool,
        step: Step<'_, S>,
    ) -> Result<bool> {
        let mut is_written = self.series.push(simulation);
        let every = u64::from(simulation.scene().output.every);
        let bar = progress::bar(frames, "simulating", "{msg}");
        let (mut wall_total, begin) = (0.0, simulation.time());
        let frame = simulation.scene().time.frame;
        let mut stop = interrupted.load(Ordering::Relaxed);
        if simulation.is_on_device() {
            bar.set_message("the driver may still be compiling kernels");
        }
        if self.words == Words::EveryFrame {
            files::print(ROW_HEADS)?;
        }
        // Of a replay hands may set the simulation back.
        let mut left = frames.saturating_sub(simulation.frame());
        while left > 0 && !stop && is_written {
            let start = Instant::now();
            step(simulation)?;
            left -= 1;
            let wall_seconds = start.elapsed().as_secs_f64();
            wall_total += wall_seconds;
            let report = simulation.report();
            // Asked once, so that series and film end with the same frame.
            stop = interrupted.load(Ordering::Relaxed);
            let last = stop || left == 0;
            if last || simulation.frame().is_multiple_of(every) {
                is_written = self.series.push(simulation);
            }
            if let Some(film) = &mut self.film {
                film.push(simulation, &report, last);
            }
            if self.words == Words::EveryFrame {
                bar.suspend(|| files::print(&frame_row(&report)))?;
            }
            self.tools.push(&report);
            self.hold.look(simulation);
            self.summary.frames.push(FrameLine { report, wall_seconds });
            let speed = ((frames - left) as f64 * frame - begin) / wall_total;
            bar.set_position(frames - left);
            bar.set_message(format!("t = {:.2} s, {speed:.2} x real time", simulation.time()));
        }
        bar.finish_and_clear();
        Ok(left == 0)
    }
}

fn write_summary(out: &OutputFolder, summary: &Summary) -> Result<()> {
    out.write("summary.json", json(summary)?.as_bytes())
}
