//! `viscera haptics`.

#[cfg(feature = "haply")]
mod haply;
mod latest;
mod pace;
mod session;

use crate::run::{Outcome, listen, parse_scene, settings};
use anyhow::{Context, Result, bail};
use clap::Args;
use serde::Serialize;
use session::{Felt, Session};
use std::path::PathBuf;
use viscera::contact::Spring;
use viscera::haptics::{HapticDevice, Path, VirtualDevice};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};
use viscera_resources::{MeshFiles, files};

/// Feel tissue with a haptic device, or with a simulated hand
///
/// The device moves a tool of the scene through a spring, and the spring's force goes back to the hand a thousand times a
/// second: what the hand feels is the spring and the tissue in a row. At 1000 frames a second the simulation is a part of
/// every tick; at a lower --rate it has a thread of its own, for which the device never waits. In the end it tells how long
/// ticks took and how late they began, how much the force changed from tick to tick, and the energy that the hand got
/// back beyond what it had put in.
#[derive(Args)]
#[command(after_help = "\
Examples:
  viscera haptics haptic_palpation
  viscera haptics haptic_palpation --rate 240 --seconds 60
  viscera haptics scenes/palpation.toml --tool probe --out out/felt")]
pub struct HapticsArguments {
    /// The scene file, or the name of one that `viscera scene list` prints
    scene: PathBuf,
    /// The tool that the device moves [default: the scene's first]
    #[arg(long, value_name = "NAME")]
    tool: Option<String>,
    /// `virtual`, a simulated hand that presses and slides; with the feature \"haply\" also `haply`
    #[arg(long, value_name = "DEVICE", default_value = "virtual")]
    device: String,
    /// For how long [s]
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "10", allow_negative_numbers = true)]
    seconds: f64,
    /// Frames a second of the simulation
    #[arg(long, value_name = "HZ", value_parser = rate, default_value = "1000", allow_negative_numbers = true)]
    rate: u32,
    /// Number of the path of the simulated hand
    #[arg(long, value_name = "N", default_value = "0")]
    seed: u64,
    /// How deep the simulated hand goes from where the tool begins [mm]
    #[arg(long, value_name = "MM", default_value = "12", value_parser = millimetres, allow_negative_numbers = true)]
    depth: f64,
    /// Change a setting: KEY=VALUE, as in `viscera run`; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Folder for haptics.json and haptics.csv, the force at each tick; none are written where it is left out
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder where mesh files are looked for that are not beside the scene
    #[arg(long, value_name = "DIR", env = "VISCERA_DATA")]
    data: Option<PathBuf>,
}

/// Ticks of the device [s].
const TICK: f64 = 1e-3;

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.trim().trim_end_matches('s').trim().parse::<f64>().ok();
    let seconds = seconds.filter(|seconds| (0.01..=86_400.0).contains(seconds));
    seconds.ok_or_else(|| "write seconds from 0.01 to 86400, such as 60".to_owned())
}

fn rate(text: &str) -> Result<u32, String> {
    let rate = text.trim().parse::<u32>().ok().filter(|rate| (30..=1000).contains(rate));
    rate.ok_or_else(|| "write frames a second from 30 to 1000, such as 240".to_owned())
}

fn millimetres(text: &str) -> Result<f64, String> {
    let depth = text.trim().trim_end_matches("mm").trim().parse::<f64>().ok();
    let depth = depth.filter(|depth| (0.0..=200.0).contains(depth));
    depth.ok_or_else(|| "write millimetres from 0 to 200, such as 12".to_owned())
}

/// Carries out `viscera haptics`.
pub fn execute(arguments: &HapticsArguments) -> Result<Outcome> {
    let (scene, tool) = prepared(arguments)?;
    let name = scene.tools[tool].name.clone();
    let begin = scene.tools[tool].pose(0.0);
    let stiffness = scene.tools[tool].spring.unwrap_or_default().stiffness;
    let mut device = device(arguments, begin.translation)?;
    let meshes = MeshFiles::new(&arguments.scene, arguments.data.as_deref());
    let assembly = Assembly::new(&scene, &mut |name| meshes.load(name))?;
    for note in &assembly.notes {
        eprintln!("note: {note}");
    }
    if let Some(out) = &arguments.out {
        std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    }
    let simulation = Simulation::<f32>::new(scene, assembly)?;
    let tets: usize = simulation.assembly().bodies.iter().map(|body| body.tets.len()).sum();
    files::print(&format!(
        "{}: {tets} tetrahedra, {} method, {} frames a second; tool `{name}` on a spring of {stiffness} N/m, device `{}`\n",
        simulation.scene().name,
        simulation.solver().method,
        arguments.rate,
        device.name(),
    ))?;
    let session = Session {
        tool,
        begin,
        stiffness,
        ticks: (arguments.seconds / TICK).round() as u64,
        tick: TICK,
        interrupted: listen()?,
    };
    let is_inline = arguments.rate == 1000;
    let felt = if is_inline {
        session.in_ticks(simulation, &mut *device)?
    } else {
        session.beside(simulation, &mut *device)?
    };
    files::print(&felt.table())?;
    if let Some(out) = &arguments.out {
        let json = serde_json::to_vec_pretty(&felt.summary)?;
        files::write_atomic(&out.join("haptics.json"), &json)?;
        files::write_atomic(&out.join("haptics.csv"), felt.csv().as_bytes())?;
        files::print(&format!("results: {}\n", out.display()))?;
    }
    if let Some(error) = felt.failed {
        bail!("{error} (after {:.1} s; its force was taken away)", felt.summary.seconds);
    }
    Ok(if felt.summary.finished { Outcome::Finished } else { Outcome::Interrupted })
}

/// The scene at the rate that was asked for, and the number of the tool.
fn prepared(arguments: &HapticsArguments) -> Result<(Scene, usize)> {
    let frame = format!("1/{} s", arguments.rate);
    let mut overrides = vec![("time.frame", frame.as_str()), ("output.force_error", "false")];
    // A step of a thousandth of a second is small already.
    if arguments.rate == 1000 {
        overrides.extend([("solver.method", "explicit"), ("solver.threads", "1")]);
    }
    overrides.extend(settings(&arguments.settings)?);
    let mut scene = parse_scene(&arguments.scene, &overrides)?;
    let names: Vec<_> = scene.tools.iter().map(|tool| format!("`{}`", tool.name)).collect();
    if names.is_empty() {
        bail!("{} has no tool that a device could move; add a [[tool]]", arguments.scene.display());
    }
    let tool = match &arguments.tool {
        None => 0,
        Some(name) => match scene.tools.iter().position(|tool| tool.name == *name) {
            Some(tool) => tool,
            None => bail!("there is no tool `{name}`; there are {}", names.join(", ")),
        },
    };
    scene.tools[tool].spring.get_or_insert(Spring::default());
    Ok((scene, tool))
}

/// The device of a name.
fn device(
    arguments: &HapticsArguments,
    begin: viscera::scalar::Vec3<f64>,
) -> Result<Box<dyn HapticDevice + Send>> {
    match arguments.device.as_str() {
        "virtual" => {
            let path = Path::palpation(begin, 1e-3 * arguments.depth, arguments.seed);
            Ok(Box::new(VirtualDevice::new(path, TICK)))
        }
        #[cfg(feature = "haply")]
        name if name == "haply" || name.starts_with("ws://") => {
            Ok(Box::new(haply::Haply::connect(name)?))
        }
        #[cfg(not(feature = "haply"))]
        name if name == "haply" || name.starts_with("ws://") => {
            bail!(
                "this program was built without devices of Haply; build it with `--features haply`"
            )
        }
        name => bail!("there is no haptic device `{name}`; there are `virtual` and `haply`"),
    }
}

/// What haptics.json has.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// The scene.
    pub scene: String,
    /// [s].
    pub seconds: f64,
    /// Whether it was not ended before.
    pub finished: bool,
    /// Of the device.
    pub ticks: u64,
    /// Not done when the next tick was due.
    pub missed_ticks: u64,
    /// Of the simulation.
    pub frames: u64,
    /// The processor's time of a tick [ms].
    pub work: pace::Spread,
    /// How late ticks began [ms].
    pub late: pace::Spread,
    /// On the hand [N].
    pub strongest_force: f64,
    /// From tick to tick [N].
    pub largest_change: f64,
    /// The least that the hand had put in at any moment, less what it got back [J].
    pub least_energy: f64,
}

impl Felt {
    fn table(&self) -> String {
        let Summary { work, late, .. } = &self.summary;
        let of = |spread: &pace::Spread| {
            format!(
                "{:.3} ms median, {:.3} ms in 99 %, {:.3} ms in 99.9 %, {:.3} ms at most",
                spread.median, spread.p99, spread.p999, spread.most
            )
        };
        let summary = &self.summary;
        let share = 100.0 * summary.missed_ticks as f64 / summary.ticks.max(1) as f64;
        format!(
            "ticks            {} in {:.1} s, {} not done in time ({share:.2} %)\n\
             processor time   {}\n\
             begun late by    {}\n\
             simulation       {} frames\n\
             force            up to {:.2} N, changes by {:.4} N a tick at most\n\
             energy           the hand had put in {:.1e} J at least, at every moment\n",
            summary.ticks,
            summary.seconds,
            summary.missed_ticks,
            of(work),
            of(late),
            summary.frames,
            summary.strongest_force,
            summary.largest_change,
            summary.least_energy,
        )
    }

    fn csv(&self) -> String {
        let mut text = "time [s],x [m],y [m],z [m],fx [N],fy [N],fz [N]\n".to_owned();
        for [time, x, y, z, fx, fy, fz] in &self.rows {
            text.push_str(&format!(
                "{time:.4},{x:.6e},{y:.6e},{z:.6e},{fx:.5e},{fy:.5e},{fz:.5e}\n"
            ));
        }
        text
    }
}
