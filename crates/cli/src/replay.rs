//! `viscera replay`.

use crate::progress;
use crate::run::{Outcome, Plan, from_one, listen, simulate};
use crate::words::Words;
use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use viscera::record::{Ending, Player, Recording};
use viscera::scalar::Real;
use viscera::scene::Scene;
use viscera::settings::Precision;
use viscera::simulation::{Assembly, Simulation};
use viscera_resources::{Memory, MeshFiles, files, memory};

/// Have a recorded run once more, and see whether it has the same bits
///
/// Does in each frame what hands did, and compares the state with the recorded one. The first frame and quantity with
/// other bits end it with an error. A recording that was cut off is replayed up to there; of one that was changed all
/// before that place is, and then it says where it is. With --out it writes what `viscera run` writes.
#[derive(Args)]
#[command(after_help = "\
Examples:
  viscera run palpation --record out/palpation.replay
  viscera replay out/palpation.replay --threads 1
  viscera replay out/palpation.replay --until 0.5 --out out/again")]
pub struct ReplayArguments {
    /// A file that `viscera run --record` or the window has written
    recording: PathBuf,
    /// Threads that compute; every number gives the same bits [default: as recorded]
    #[arg(long, value_name = "N", value_parser = from_one::<u32>, allow_negative_numbers = true)]
    threads: Option<u32>,
    /// Begin with the last snapshot before this time of the recording [s]
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    from: Option<f64>,
    /// End at this time of the recording [s]
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    until: Option<f64>,
    /// Folder for results; none are written where it is left out
    #[arg(long, alias = "output", value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder where mesh files are looked for that are neither in the recording nor beside it
    #[arg(long, value_name = "DIR", env = "VISCERA_DATA")]
    data: Option<PathBuf>,
    /// Memory that may be used [default: what is free]
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
}

fn seconds(text: &str) -> Result<f64, String> {
    let text = text.trim().trim_end_matches('s').trim();
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..1e9).contains(seconds));
    seconds.ok_or_else(|| "write seconds, such as 2.5".to_owned())
}

/// Carries out `viscera replay`.
pub fn execute(arguments: &ReplayArguments) -> Result<Outcome> {
    let name = arguments.recording.display().to_string();
    let recording = Recording::read(&files::read(&arguments.recording)?);
    let recording = recording.with_context(|| name.clone())?;
    let threads = arguments.threads.map(|threads| threads.to_string());
    let settings: Vec<_> = threads.iter().map(|t| ("solver.threads", t.as_str())).collect();
    let frame = recording.scene(0, &settings).with_context(|| name.clone())?.time.frame;
    let from = (arguments.from.unwrap_or(0.0) / frame).round() as u64;
    let scene = recording.scene(from, &settings).with_context(|| name.clone())?;
    let there = recording.frame_count();
    let end = arguments.until.map_or(there, |until| there.min((until / frame).round() as u64));
    if let Ending::Cut { at } = recording.ending() {
        eprintln!(
            "note: {name} was cut off at byte {at}; it has {there} frames, {:.2} s, before that",
            there as f64 * frame
        );
    }
    let damaged = match recording.ending() {
        Ending::Damaged { at } => Some(at),
        Ending::Complete | Ending::Cut { .. } => None,
    };
    if let Some(at) = damaged.filter(|_| there == 0) {
        bail!("{name} is damaged at byte {at}, before its first frame; take another copy of it");
    }
    let meshes = MeshFiles::new(&arguments.recording, arguments.data.as_deref());
    let mut load = |name: &str| meshes.load(name);
    let assembly = Assembly::new(&scene, &mut |name| recording.file(name, &mut load))?;
    let tets = assembly.bodies.iter().map(|body| body.tets.len()).sum();
    let what = format!("{}: a simulation of {tets} tetrahedra", scene.name);
    let needed = memory::of_run(tets, &scene.solver);
    memory::check(&what, needed, arguments.memory, "replay it on a machine that has it")?;
    let replay = Replay { recording: &recording, from, end, settings, name: &name };
    let outcome = match scene.solver.precision {
        Precision::F32 => replay.play::<f32>(scene, assembly, arguments)?,
        Precision::F64 => replay.play::<f64>(scene, assembly, arguments)?,
    };
    match damaged {
        Some(at) if end == there => {
            bail!(
                "{name} is damaged at byte {at}, behind frame {there}; take another copy of it for the rest"
            )
        }
        _ => Ok(outcome),
    }
}

/// What of a recording is to be played.
struct Replay<'a> {
    recording: &'a Recording,
    /// Frames of the recording.
    from: u64,
    end: u64,
    settings: Vec<(&'a str, &'a str)>,
    name: &'a str,
}

impl Replay<'_> {
    fn play<S: Real>(
        &self,
        scene: Scene,
        assembly: Assembly,
        arguments: &ReplayArguments,
    ) -> Result<Outcome> {
        let Self { recording, from, end, ref settings, name } = *self;
        let simulation = Simulation::<S>::new(scene, assembly)?;
        let started = recording.start(from, simulation, settings);
        let (simulation, mut player) = started.with_context(|| name.to_owned())?;
        let first = player.played();
        if end <= first {
            bail!("{name} has no frames from {first} to {end}: give another --from or --until");
        }
        let frame = simulation.scene().time.frame;
        let outcome = match &arguments.out {
            Some(folder) => {
                let plan = Plan {
                    overrides: Vec::new(),
                    folder: folder.clone(),
                    frames: simulation.frame() + (end - first),
                    interrupted: listen()?,
                    save: None,
                    words: Words::Table,
                };
                let mut step = |simulation: &mut Simulation<S>| {
                    player.step(simulation).map(|_| ()).with_context(|| name.to_owned())
                };
                simulate(simulation, plan, &mut step)?
            }
            None => self.compare(simulation, &mut player)?,
        };
        if outcome == Outcome::Finished {
            let (count, seconds) = (end - first, (end - first) as f64 * frame);
            files::print(&format!(
                "{name}: replayed {count} frames, {seconds:.2} s: all with the recorded bits\n"
            ))?;
        }
        Ok(outcome)
    }

    /// Writes nothing.
    fn compare<S: Real>(
        &self,
        mut simulation: Simulation<S>,
        player: &mut Player<'_>,
    ) -> Result<Outcome> {
        let interrupted = listen()?;
        let bar = progress::bar(self.end, "replaying", "{pos} of {len} frames");
        while player.played() < self.end && !interrupted.load(Ordering::Relaxed) {
            player.step(&mut simulation).with_context(|| self.name.to_owned())?;
            bar.set_position(player.played());
        }
        bar.finish_and_clear();
        let is_done = player.played() == self.end;
        Ok(if is_done { Outcome::Finished } else { Outcome::Interrupted })
    }
}
