//! The simulation on a thread of its own. The window sends [`Command`]s, hears [`Event`]s, and takes the
//! newest [`Snapshot`] when it likes; it never waits.

mod setup;
mod snapshot;
mod worker;

pub use setup::{BuildRequest, Setup};
pub use snapshot::{Snapshot, SnapshotExchange};

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use viscera::scalar::Vec3;
use viscera::solver::gpu::Device;
use viscera_stage::{Coloring, HandId, HoldId, ToolAct};

use viscera_resources::MeshFiles;

use crate::choices::Settings;
use crate::probe::{Curve, SolverVariant};

/// How long the window waits for the thread to end when it is closed.
const PATIENCE: Duration = Duration::from_millis(300);

/// What the window asks for.
#[derive(Debug)]
pub enum Command {
    /// Builds these simulations and starts them from rest.
    Load(Box<BuildRequest>),
    /// Makes the scene of a mesh, a surface or a scan, in the second, a folder.
    Make(PathBuf, PathBuf),
    /// Puts these simulations beside the first one, which goes on: they begin where it is.
    Accompany(Box<BuildRequest>),
    /// Goes on with a mesh that was said to be large.
    Proceed,
    /// Runs, or pauses.
    Play(bool),
    /// Computes one frame and pauses.
    Step,
    /// Starts from rest again.
    Reset,
    /// Simulated seconds per second of the clock; faster where it is infinite.
    Speed(f64),
    /// Takes hold of vertices.
    Take {
        /// The caller's number for what it takes hold of.
        hold: HoldId,
        /// Position of the body in the scene.
        body: usize,
        /// Where at rest [m].
        rest: Vec3<f64>,
        /// How many vertices.
        count: u32,
        /// Total stiffness [N/m] of the springs; rigidly where there is none.
        stiffness: Option<f64>,
    },
    /// Moves what is held to so far from where it was taken [m].
    Lead(HoldId, Vec3<f64>),
    /// Lets go.
    LetGo(HoldId),
    /// Does something with an instrument.
    Tool(ToolAct),
    /// Changes settings of one of the simulations.
    Change(usize, Settings),
    /// Records the first simulation and all that hands do to it into a file that `viscera replay` takes.
    Record(PathBuf, MeshFiles),
    /// Ends that.
    EndRecord,
    /// Asks for what was done by hand, to be saved there.
    Save(PathBuf),
    /// Repeats steps of the first simulation by these solvers, to compare how they converge.
    Probe(Vec<SolverVariant>),
    /// What colours show.
    Color(Coloring),
    /// Asks for positions that are those of a frame, where tissue is drawn from where the device has it.
    Look,
    /// Ends the thread.
    Quit,
}

/// What the thread answers.
#[derive(Debug)]
pub enum Event {
    /// Something that takes a while has begun.
    Busy(String),
    /// What is being done to make a scene.
    Making(String),
    /// The scene of a file was made, or why not.
    Made(PathBuf, Result<MadeScene, String>),
    /// It is large: [`Command::Proceed`] goes on, another [`Command::Load`] does not.
    Expect(String),
    /// Everything is built and at rest; frames follow.
    Ready(Arc<Setup>),
    /// Settings whose change took a while are in force.
    Changed,
    /// Others are beside the first simulation now, or no longer.
    Accompanied(Arc<Setup>),
    /// What computes each of the simulations has changed or been built again: its device, and why.
    Devices(Vec<String>),
    /// What was done by hand to the first simulation, as text for its scene file, and its time [s].
    Done {
        /// Where it is to be saved.
        path: PathBuf,
        /// For the end of the scene file.
        text: String,
        /// Simulated time [s].
        time: f64,
    },
    /// A setting was refused: this is the value that a simulation goes on with.
    Kept {
        /// Which simulation.
        run: usize,
        /// The setting.
        key: String,
        /// As one would write it.
        value: String,
    },
    /// Nothing could be put beside the first simulation, which goes on alone, and why.
    Alone(String),
    /// How the methods asked for converge in one step.
    Curves(Vec<Curve>),
    /// Something was refused, and nothing has changed.
    Refused(String),
    /// A recording of the first simulation has ended, and why where it was not asked to: its file, and its frames.
    Recorded(PathBuf, u64, Option<String>),
    /// A hand could not take an instrument, and why.
    NotTaken(HandId, String),
    /// The simulation has stopped.
    Failed(Failure),
}

/// A scene that was made of another file.
#[derive(Clone, Debug)]
pub struct MadeScene {
    /// The scene file.
    pub scene: PathBuf,
    /// How many bodies it has.
    pub bodies: usize,
    /// Tetrahedra of all of them.
    pub tets: usize,
    /// What is probably not as it was meant, a line each.
    pub warnings: Vec<String>,
    /// What was found and what was assumed, a line each.
    pub notes: Vec<String>,
    /// The same of single bodies.
    pub of_bodies: Vec<String>,
    /// All of it at length, as for a terminal.
    pub text: String,
}

impl MadeScene {
    /// What it is, in short.
    pub fn title(&self) -> String {
        let bodies = match self.bodies {
            1 => "1 body".to_owned(),
            count => format!("{count} bodies"),
        };
        format!("made {}: {bodies}, {} tetrahedra", self.scene.display(), self.tets)
    }
}

/// Why a simulation has stopped, and what one can do.
#[derive(Clone, Debug)]
pub struct Failure {
    /// What happened.
    pub message: String,
    /// The next move.
    pub cure: Cure,
}

/// What one can do about a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cure {
    /// Start from rest again.
    Reset,
    /// Compute on the CPU.
    Cpu,
    /// Another scene.
    Open,
}

/// The thread, seen from the window.
#[derive(Debug)]
pub struct Engine {
    commands: Sender<Command>,
    events: Receiver<Event>,
    exchange: Arc<SnapshotExchange>,
    thread: Option<JoinHandle<()>>,
}

impl Engine {
    /// Starts the thread. It calls `wake` when there is something to see or hear. `device` is for simulations that ask for one,
    /// where they share that of the pictures.
    pub fn start(
        device: Option<Device>,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> std::io::Result<Self> {
        let (commands, receive) = channel();
        let (send, events) = channel();
        let exchange = Arc::new(SnapshotExchange::default());
        let worker =
            worker::Worker::new(receive, send, Arc::clone(&exchange), Box::new(wake), device);
        let thread = std::thread::Builder::new()
            .name("simulation".to_owned())
            .spawn(move || worker.run())?;
        Ok(Self { commands, events, exchange, thread: Some(thread) })
    }

    /// Asks for something.
    pub fn send(&self, command: Command) {
        // A thread that has ended hears nothing; `hear` tells so.
        let _ = self.commands.send(command);
    }

    /// What has happened since it was last asked.
    pub fn hear(&mut self) -> Vec<Event> {
        let mut heard: Vec<Event> = self.events.try_iter().collect();
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            self.thread = None;
            heard.push(Event::Failed(Failure {
                message: "the simulation's thread has ended; save the scene and start again".into(),
                cure: Cure::Open,
            }));
        }
        heard
    }

    /// The newest snapshot, where there is one newer than `shown`; that one's memory is used again.
    pub fn newest(&self, shown: &mut Option<Box<Snapshot>>) -> bool {
        self.exchange.take(shown)
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.send(Command::Quit);
        // It may be in the middle of a long frame, or of making a large mesh; nobody waits for that.
        let start = Instant::now();
        while let Some(thread) = &self.thread
            && !thread.is_finished()
            && start.elapsed() < PATIENCE
        {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
