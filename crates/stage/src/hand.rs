//! Instruments in hands: each goes to where it is led at a hand's speed, frame by frame.

use viscera::scalar::Real;
use viscera::scalar::rigid::RigidTransform;
use viscera::scene::{Instrument, SceneError, read_tray};
use viscera::simulation::{AssembleError, LiveError, Simulation};

use crate::grip::{follow, opened};
use crate::legend::millimetres;

/// The caller's number for a hand with an instrument.
pub type HandId = u64;

/// Something that a hand does with an instrument.
#[derive(Clone, Debug)]
pub enum ToolAct {
    /// Takes one that is not in the scene yet.
    Take {
        /// The hand.
        hand: HandId,
        /// What it takes.
        instrument: Box<Instrument>,
        /// Where that comes into the scene.
        pose: RigidTransform,
    },
    /// Takes a tool of the scene, where it is.
    Hold {
        /// The hand.
        hand: HandId,
        /// The tool's name.
        name: String,
    },
    /// Leads it to a pose: it goes there as fast as a hand does.
    Lead {
        /// The hand.
        hand: HandId,
        /// Where to.
        pose: RigidTransform,
    },
    /// Opens or closes its jaws.
    Jaws {
        /// The hand.
        hand: HandId,
        /// To this angle [rad].
        angle: f64,
    },
    /// Locks its jaws, or unlocks them.
    Lock {
        /// The hand.
        hand: HandId,
        /// Whether they are locked.
        locked: bool,
    },
    /// Puts it away: what it held is free.
    PutAway {
        /// The hand.
        hand: HandId,
    },
}

impl ToolAct {
    /// Whose act it is.
    pub fn hand(&self) -> HandId {
        match *self {
            Self::Take { hand, .. }
            | Self::Hold { hand, .. }
            | Self::Lead { hand, .. }
            | Self::Jaws { hand, .. }
            | Self::Lock { hand, .. }
            | Self::PutAway { hand } => hand,
        }
    }

    /// Whether an instrument comes into a hand.
    pub fn is_taking(&self) -> bool {
        matches!(self, Self::Take { .. } | Self::Hold { .. })
    }
}

/// The instruments that lie ready, in the order of the tray.
pub fn tray() -> Result<Vec<Instrument>, SceneError> {
    read_tray("the tray", TRAY)
}

const TRAY: &str = include_str!("tray.toml");

/// An instrument is made so much thicker than a coarse mesh asks for, and so many times as large at most: beyond, it is
/// another instrument.
const LARGER: f64 = 1.02;
const LARGEST: f64 = 3.0;

/// The same instruments, of so many times the size.
fn larger_tray(factor: f64) -> Result<Vec<Instrument>, SceneError> {
    let scaled = |text: &str| {
        let length = text.strip_suffix(" mm")?.parse::<f64>().ok()?;
        Some(format!("{} mm", factor * length))
    };
    // What is in quotes is every second piece.
    let pieces = TRAY.split('"').map(|text| scaled(text).unwrap_or_else(|| text.to_owned()));
    read_tray("the tray", &pieces.collect::<Vec<_>>().join("\""))
}

/// A hand, and where its instrument is on the way to where it is led.
#[derive(Clone, Copy, Debug)]
struct ToolHand {
    id: HandId,
    /// The tool's number in the simulation.
    tool: usize,
    now: RigidTransform,
    target: RigidTransform,
    /// Opening angles of jaws, where any were asked for: now, and where they are to be [rad].
    jaws: Option<[f64; 2]>,
}

/// The hands on one simulation's tools.
#[derive(Clone, Debug, Default)]
pub(crate) struct ToolHands {
    list: Vec<ToolHand>,
    /// Why an instrument stays where it is, or is another one.
    told: Option<String>,
}

impl ToolHands {
    /// The hand that has a tool.
    pub fn of(&self, tool: usize) -> Option<HandId> {
        self.list.iter().find(|hand| hand.tool == tool).map(|hand| hand.id)
    }

    /// Everything begins anew.
    pub fn clear(&mut self) {
        self.list.clear();
    }

    /// Does what is asked for; nothing where the hand has nothing, or no longer.
    pub fn act<S: Real>(
        &mut self,
        simulation: &mut Simulation<S>,
        act: &ToolAct,
    ) -> Result<(), String> {
        let text = |error: LiveError| error.to_string();
        match act {
            ToolAct::Take { hand, instrument, pose } => {
                let tool = self.take(simulation, instrument, pose)?;
                self.add(*hand, tool, *pose);
            }
            ToolAct::Hold { hand, name } => {
                let found = simulation.tools().into_iter().enumerate();
                let found =
                    found.filter(|(_, tool)| tool.is_there).find(|(_, tool)| tool.name == *name);
                let Some((tool, state)) = found else {
                    return Err(format!("the {name} is no longer there to be taken"));
                };
                // From the hand's first move on the scene would lead it on.
                simulation.move_tool(tool, state.pose).map_err(text)?;
                self.add(*hand, tool, state.pose);
            }
            ToolAct::Lead { hand, pose } => {
                if let Some(led) = self.hand(*hand) {
                    led.target = *pose;
                }
            }
            ToolAct::Jaws { hand, angle } => {
                if let Some(led) = self.hand(*hand) {
                    let now = led.jaws.map(|[now, _]| now).or(simulation.jaw_angle(led.tool));
                    led.jaws = now.map(|now| [now, *angle]);
                }
            }
            ToolAct::Lock { hand, locked } => {
                if let Some(led) = self.hand(*hand) {
                    simulation.lock_jaws(led.tool, *locked).map_err(text)?;
                }
            }
            ToolAct::PutAway { hand } => {
                if let Some(led) = self.hand(*hand) {
                    let tool = led.tool;
                    self.list.retain(|other| other.id != *hand);
                    simulation.put_away(tool).map_err(text)?;
                }
            }
        }
        Ok(())
    }

    /// Takes an instrument at a pose; a larger one where the mesh is too coarse for it, and a message says so.
    fn take<S: Real>(
        &mut self,
        simulation: &mut Simulation<S>,
        instrument: &Instrument,
        pose: &RigidTransform,
    ) -> Result<usize, String> {
        let mut placed = instrument.clone();
        placed.placement = *pose;
        let thin = match simulation.take_tool(placed) {
            Ok(tool) => return Ok(tool),
            Err(LiveError::Patch(thin @ AssembleError::ThinTool { .. })) => thin,
            Err(error) => return Err(error.to_string()),
        };
        let AssembleError::ThinTool { body, radius, spacing, .. } = &thin else {
            return Err(thin.to_string());
        };
        let factor = (10.0 * LARGER * spacing / radius).ceil() / 10.0;
        let larger = larger_tray(factor).ok().filter(|_| factor <= LARGEST);
        let larger = larger.into_iter().flatten().find(|other| other.name == instrument.name);
        let Some(mut larger) = larger else { return Err(thin.to_string()) };
        larger.placement = *pose;
        let tool = simulation.take_tool(larger).map_err(|error| error.to_string())?;
        self.told = Some(format!(
            "the {} is {factor} times its size: the mesh of `{body}` is touched at points about {} apart",
            instrument.name,
            millimetres(*spacing)
        ));
        Ok(tool)
    }

    fn add(&mut self, id: HandId, tool: usize, pose: RigidTransform) {
        self.list.retain(|hand| hand.id != id && hand.tool != tool);
        self.list.push(ToolHand { id, tool, now: pose, target: pose, jaws: None });
    }

    fn hand(&mut self, id: HandId) -> Option<&mut ToolHand> {
        self.list.iter_mut().find(|hand| hand.id == id)
    }

    /// What a person should know since it was last asked.
    pub fn told(&mut self) -> Option<String> {
        self.told.take()
    }

    /// Before a frame: all go on to where they are led. What is refused stays where it is.
    pub fn lead<S: Real>(&mut self, simulation: &mut Simulation<S>) {
        let frame = simulation.scene().time.frame;
        let told = &mut self.told;
        for hand in &mut self.list {
            if hand.now != hand.target {
                let next = follow(&hand.now, &hand.target, frame);
                match simulation.move_tool(hand.tool, next) {
                    Ok(()) => hand.now = next,
                    Err(error) => {
                        hand.target = hand.now;
                        *told = Some(error.to_string());
                    }
                }
            }
            if let Some([now, target]) = &mut hand.jaws
                && now != target
            {
                let next = opened(*now, *target, frame);
                match simulation.open_jaws(hand.tool, next) {
                    Ok(()) => *now = next,
                    Err(error) => {
                        *target = *now;
                        *told = Some(error.to_string());
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grip::{FASTEST, moved};
    use crate::run::{Run, build};
    use crate::snapshot::{Coloring, RunSnapshot};
    use viscera::scalar::{Vec3, vec3};
    use viscera::scene::Scene;
    use viscera::simulation::Assembly;
    use viscera::solver::FrameReading;

    fn slab(cells: &str) -> Box<dyn Run> {
        let text = r#"
            [[body]]
            name = "slab"
            shape = "block"
            size = ["60 mm", "60 mm", "20 mm"]
            cells = CELLS
            material = { young = "10 kPa" }
            [[fixing]]
            body = "slab"
            half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
        "#;
        let text = text.replace("CELLS", cells);
        let scene = Scene::parse("slab.toml", &text, &[]).expect("a legal scene");
        let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("a slab");
        build(scene, assembly, None).expect("a simulation")
    }

    fn seen(run: &mut dyn Run) -> RunSnapshot {
        let mut snapshot = RunSnapshot::default();
        run.fill(Coloring::Plain, None, &mut snapshot);
        snapshot
    }

    fn above(height: f64) -> RigidTransform {
        RigidTransform::about(Vec3::ZERO, Vec3::ZERO, vec3(0.03, 0.03, height))
    }

    #[test]
    fn an_instrument_is_made_larger_where_the_mesh_is_coarse_and_that_is_told() {
        let mut run = slab("[3, 3, 1]");
        let all = tray().expect("a legal tray");
        let grasper = all.iter().find(|tool| tool.name == "grasper").expect("a grasper");
        let instrument = Box::new(grasper.clone());
        run.act(&ToolAct::Take { hand: 1, instrument, pose: above(0.09) }).expect("a larger one");
        let told = run.told().expect("a word");
        assert!(
            told.contains("grasper") && told.contains("slab") && told.contains("times"),
            "{told}"
        );
        assert!(run.told().is_none());
        run.advance(FrameReading::State).expect("a frame");
        let thinnest = seen(&mut *run).tools[0].parts[0].shape.thinnest();
        assert!(thinnest > 1.1 * grasper.thinnest() && thinnest < LARGEST * grasper.thinnest());
        let jaws = larger_tray(2.0).expect("a legal tray")[1].jaws.clone().expect("jaws");
        assert_eq!(jaws.length, 2.0 * grasper.jaws.as_ref().expect("jaws").length);
    }

    #[test]
    fn every_instrument_of_the_tray_is_taken_led_and_put_away() {
        let mut run = slab("[6, 6, 2]");
        for (hand, instrument) in (1..).zip(tray().expect("a legal tray")) {
            let name = instrument.name.clone();
            let pose = above(0.08);
            let take = ToolAct::Take { hand, instrument: Box::new(instrument), pose };
            run.act(&take).unwrap_or_else(|error| panic!("{name}: {error}"));
            run.advance(FrameReading::State).expect("a frame");
            let tools = seen(&mut *run).tools;
            assert_eq!(tools.len(), 1, "{name}");
            assert_eq!((tools[0].hand, tools[0].met.name.as_str()), (Some(hand), name.as_str()));
            let to = moved(&pose, vec3(0.02, 0.0, 0.0)).expect("a place");
            run.act(&ToolAct::Lead { hand, pose: to }).expect("led");
            run.advance(FrameReading::State).expect("a frame");
            let way = (seen(&mut *run).tools[0].pose.translation - pose.translation).length();
            assert!((way - FASTEST / 60.0).abs() < 1e-9, "{name}: {way} m");
            run.act(&ToolAct::PutAway { hand }).expect("put away");
            run.advance(FrameReading::State).expect("a frame");
            assert!(seen(&mut *run).tools.is_empty(), "{name}");
        }
    }
}
