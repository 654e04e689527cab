//! The loop of a device: read, feel, exert; with the simulation within, or beside it.

use super::Summary;
use super::latest::Latest;
use super::pace::Pace;
use anyhow::Result;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use viscera::haptics::{DeviceError, HapticDevice, Rendering, Seen, Stylus};
use viscera::scalar::rigid::{RigidTransform, rotation_matrix, rotation_vector};
use viscera::scalar::{Real, Vec3};
use viscera::simulation::Simulation;

/// The strongest force that is sent to a device [N].
const STRONGEST: f64 = 8.0;

/// How long [s] a device may say nothing until its force is taken away, and until the loop ends.
const PATIENCE: [f64; 2] = [0.05, 2.0];

/// What is asked of a loop.
pub struct Session {
    /// The tool that the device moves, and where it begins.
    pub tool: usize,
    pub begin: RigidTransform,
    /// Of its spring [N/m].
    pub stiffness: f64,
    pub ticks: u64,
    /// [s].
    pub tick: f64,
    pub interrupted: Arc<AtomicBool>,
}

/// What was felt.
pub struct Felt {
    pub summary: Summary,
    /// Time [s], place of the stylus [m] and force on the hand [N] at each tick.
    pub rows: Vec<[f64; 7]>,
    /// Why it ended before its time.
    pub failed: Option<String>,
}

/// Ticks of one session.
struct Ticks<'a> {
    session: &'a Session,
    device: &'a mut (dyn HapticDevice + Send),
    rendering: Rendering,
    pace: Pace,
    /// Where the device was first: the tool begins there.
    first: Option<RigidTransform>,
    last: Option<Stylus>,
    /// How long it has not answered [s].
    silent: f64,
    rows: Vec<[f64; 7]>,
    strongest: f64,
    done: u64,
}

impl<'a> Ticks<'a> {
    fn new(session: &'a Session, device: &'a mut (dyn HapticDevice + Send)) -> Self {
        Self {
            session,
            device,
            rendering: Rendering::new(session.stiffness, STRONGEST),
            pace: Pace::new(session.tick, session.ticks),
            first: None,
            last: None,
            silent: 0.0,
            rows: Vec::with_capacity(session.ticks.min(10_000_000) as usize),
            strongest: 0.0,
            done: 0,
        }
    }

    fn is_over(&self) -> bool {
        self.done >= self.session.ticks || self.session.interrupted.load(Ordering::Relaxed)
    }

    /// Reads, feels and exerts. Returns where the hand has the tool; what is seen of it came before.
    fn felt(&mut self, seen: &Seen) -> Result<RigidTransform, DeviceError> {
        let session = self.session;
        match self.device.read() {
            Ok(stylus) => (self.last, self.silent) = (Some(stylus), 0.0),
            Err(DeviceError::Silent { .. }) if self.silent + session.tick < PATIENCE[1] => {
                self.silent += session.tick;
            }
            Err(error) => return Err(error),
        }
        let Some(stylus) = self.last else { return Ok(session.begin) };
        let first = *self.first.get_or_insert(stylus.pose);
        let hand = RigidTransform {
            rotation: stylus.pose.rotation * first.rotation.transpose() * session.begin.rotation,
            translation: session.begin.translation + stylus.pose.translation - first.translation,
        };
        let force = if self.silent > PATIENCE[0] {
            self.rendering.let_go();
            Vec3::ZERO
        } else {
            self.rendering.tick(hand.translation, seen, session.tick)
        };
        self.device.exert(force, Vec3::ZERO)?;
        self.strongest = self.strongest.max(force.length());
        let (time, at) = (self.done as f64 * session.tick, hand.translation);
        self.rows.push([time, at.x, at.y, at.z, force.x, force.y, force.z]);
        Ok(hand)
    }

    /// The force is taken away, whatever has ended the loop.
    fn end(self, scene: String, frames: u64, failed: Option<String>) -> Felt {
        // A device that is gone cannot be told, and needs not be.
        let _ = self.device.exert(Vec3::ZERO, Vec3::ZERO);
        let summary = Summary {
            scene,
            seconds: self.done as f64 * self.session.tick,
            finished: self.done >= self.session.ticks,
            ticks: self.done,
            missed_ticks: self.pace.missed(),
            frames,
            work: self.pace.work(),
            late: self.pace.late(),
            strongest_force: self.strongest,
            largest_change: self.rendering.most_change(),
            least_energy: self.rendering.observer().least,
        };
        Felt { summary, rows: self.rows, failed }
    }
}

impl Session {
    fn seen<S: Real>(&self, simulation: &Simulation<S>) -> Seen {
        let held = simulation.held(self.tool);
        let pose = held.and_then(|held| held.poses).map_or(self.begin, |[pose, _]| pose);
        let touches = held.is_some_and(|held| held.touches > 0);
        Seen { pose, touches, time: simulation.time() }
    }

    /// With a frame of the simulation in every tick.
    pub fn in_ticks<S: Real>(
        &self,
        mut simulation: Simulation<S>,
        device: &mut (dyn HapticDevice + Send),
    ) -> Result<Felt> {
        let mut ticks = Ticks::new(self, device);
        let mut failed = None;
        while !ticks.is_over() {
            ticks.pace.wait();
            match ticks.felt(&self.seen(&simulation)) {
                Ok(hand) => {
                    simulation.move_tool(self.tool, hand)?;
                    if let Err(error) = simulation.advance() {
                        failed = Some(error.to_string());
                        break;
                    }
                }
                Err(error) => {
                    failed = Some(error.to_string());
                    break;
                }
            }
            ticks.pace.done();
            ticks.done += 1;
        }
        Ok(ticks.end(simulation.scene().name.clone(), simulation.frame(), failed))
    }

    /// With the simulation in a thread of its own. Neither waits for the other.
    pub fn beside<S: Real>(
        &self,
        mut simulation: Simulation<S>,
        device: &mut (dyn HapticDevice + Send),
    ) -> Result<Felt> {
        let (of_hand, of_tool) = (Latest::<6>::new(), Latest::<8>::new());
        let is_over = AtomicBool::new(false);
        let name = simulation.scene().name.clone();
        std::thread::scope(|scope| {
            let simulate = || self.simulate(&mut simulation, &is_over, (&of_hand, &of_tool));
            let beside = scope.spawn(simulate);
            let mut ticks = Ticks::new(self, device);
            let mut failed = None;
            let mut seen = Seen { pose: self.begin, touches: false, time: 0.0 };
            while !ticks.is_over() && failed.is_none() && !beside.is_finished() {
                ticks.pace.wait();
                if let Some([x, y, z, a, b, c, touches, time]) = of_tool.read() {
                    let pose = posed([x, y, z, a, b, c]);
                    seen = Seen { pose, touches: touches > 0.0, time };
                }
                match ticks.felt(&seen) {
                    Ok(hand) => of_hand.write(&numbers(&hand)),
                    Err(error) => failed = Some(error.to_string()),
                }
                ticks.pace.done();
                ticks.done += u64::from(failed.is_none());
            }
            is_over.store(true, Ordering::Relaxed);
            let simulated = beside.join().unwrap_or_else(|_| Ok(0));
            let (frames, stopped) = match simulated {
                Ok(frames) => (frames, None),
                Err(error) => (0, Some(error.to_string())),
            };
            Ok(ticks.end(name, frames, failed.or(stopped)))
        })
    }

    /// The simulation's thread; returns how many frames it computed.
    fn simulate<S: Real>(
        &self,
        simulation: &mut Simulation<S>,
        is_over: &AtomicBool,
        (of_hand, of_tool): (&Latest<6>, &Latest<8>),
    ) -> Result<u64> {
        let frame = simulation.scene().time.frame;
        let mut pace = Pace::new(frame, 0);
        while !is_over.load(Ordering::Relaxed) {
            pace.wait();
            let Some(hand) = of_hand.read() else {
                std::thread::sleep(Duration::from_micros(200));
                continue;
            };
            simulation.move_tool(self.tool, posed(hand))?;
            simulation.advance()?;
            let Seen { pose, touches, time } = self.seen(simulation);
            let [x, y, z, a, b, c] = numbers(&pose);
            of_tool.write(&[x, y, z, a, b, c, f64::from(u8::from(touches)), time]);
            pace.done();
        }
        Ok(simulation.frame())
    }
}

fn numbers(pose: &RigidTransform) -> [f64; 6] {
    let turn = rotation_vector(&pose.rotation);
    let at = pose.translation;
    [at.x, at.y, at.z, turn.x, turn.y, turn.z]
}

fn posed([x, y, z, a, b, c]: [f64; 6]) -> RigidTransform {
    RigidTransform {
        rotation: rotation_matrix(Vec3::from_f64([a, b, c])),
        translation: Vec3::from_f64([x, y, z]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;
    use viscera::scene::Scene;
    use viscera::simulation::Assembly;

    const SCENE: &str = r#"
time = { frame = "1 ms" }
[world]
gravity = 0
[[body]]
name = "block"
shape = "block"
size = ["20 mm", "20 mm", "20 mm"]
cells = [2, 2, 2]
material = { young = "5 kPa", poisson = 0.4 }
[[fixing]]
name = "table"
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
[[tool]]
kind = "sphere"
radius = "10 mm"
position = ["10 mm", "10 mm", "31 mm"]
spring = "400 N/m"
"#;

    /// A hand that goes down 3 mm in 30 ticks, stays, and answers only as it likes.
    struct Whimsical {
        ticks: u64,
        answers: fn(u64) -> Result<(), DeviceError>,
        forces: Vec<f64>,
    }

    impl HapticDevice for Whimsical {
        fn name(&self) -> String {
            "whimsical".into()
        }

        fn read(&mut self) -> Result<Stylus, DeviceError> {
            self.ticks += 1;
            (self.answers)(self.ticks)?;
            let depth = 1e-4 * self.ticks.min(30) as f64;
            let translation = vec3(0.3, -0.2, -depth);
            Ok(Stylus {
                pose: RigidTransform { translation, ..RigidTransform::IDENTITY },
                is_pressed: false,
            })
        }

        fn exert(&mut self, force: Vec3<f64>, _: Vec3<f64>) -> Result<(), DeviceError> {
            self.forces.push(force.z);
            Ok(())
        }
    }

    fn session(ticks: u64, answers: fn(u64) -> Result<(), DeviceError>) -> (Felt, Vec<f64>) {
        let scene = Scene::parse("test", SCENE, &[]).expect("a scene");
        let begin = scene.tools[0].pose(0.0);
        let assembly = Assembly::new(&scene, &mut |name| panic!("{name}")).expect("an assembly");
        let simulation = Simulation::<f32>::new(scene, assembly).expect("a simulation");
        let interrupted = Arc::new(AtomicBool::new(false));
        let session = Session { tool: 0, begin, stiffness: 400.0, ticks, tick: 1e-3, interrupted };
        let mut device = Whimsical { ticks: 0, answers, forces: Vec::new() };
        let felt = session.in_ticks(simulation, &mut device).expect("a session");
        (felt, device.forces)
    }

    fn silent() -> DeviceError {
        DeviceError::Silent { device: "whimsical".into(), seconds: 0.1 }
    }

    #[test]
    fn a_device_that_says_nothing_loses_its_force_and_gets_it_back() {
        let (felt, forces) =
            session(400, |tick| if (200..300).contains(&tick) { Err(silent()) } else { Ok(()) });
        assert!(felt.summary.finished && felt.failed.is_none(), "{:?}", felt.failed);
        assert!(forces[190] > 1e-3, "{}", forces[190]);
        // The place where the device was first is that of the tool.
        let [_, x, y, z, ..] = felt.rows[0];
        assert!((vec3(x, y, z) - vec3(0.01, 0.01, 0.031)).length() < 1e-12);
        // For 50 ms the hand is where it was last; then there is no force.
        assert!(forces[240] > 1e-3 && forces[260] == 0.0 && forces[298] == 0.0, "{forces:?}");
        assert!(forces[399] > 1e-3, "{}", forces[399]);
        assert_eq!(forces.last(), Some(&0.0));
    }

    #[test]
    fn a_device_that_is_gone_or_stays_silent_ends_the_session() {
        let (felt, forces) = session(5000, |tick| if tick > 100 { Err(silent()) } else { Ok(()) });
        let told = felt.failed.expect("it ended");
        assert!(told.contains("has not answered for 100 ms"), "{told}");
        assert!((2095..2105).contains(&felt.summary.ticks), "{}", felt.summary.ticks);
        assert!(!felt.summary.finished && forces.last() == Some(&0.0));
        let (felt, _) = session(5000, |tick| match tick {
            0..50 => Ok(()),
            _ => Err(DeviceError::Gone { device: "whimsical".into(), reason: "unplugged".into() }),
        });
        assert_eq!(felt.summary.ticks, 49);
        assert!(felt.failed.is_some_and(|told| told.contains("is gone: unplugged")));
    }
}
