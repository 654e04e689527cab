//! Instruments in a person's hands: which, where each is led, and how pointer, keys and a controller lead them.

use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Vec3, vec3};
use viscera::scene::Instrument;
use viscera_render::Orbit;

use crate::grip::{first_pose, moved, turned, within_reach};
use crate::hand::{HandId, ToolAct};
use crate::lens::Lens;
use crate::pick::meet_plane;
use crate::tools::ToolSnapshot;

/// The scene as instruments see it: what they are led around.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// From where it is seen: its axes are those of pointers, keys and sticks.
    pub orbit: Orbit,
    /// The middle of things [m].
    pub middle: Vec3<f64>,
    /// Above it, as high as the highest tissue [m].
    pub top: Vec3<f64>,
    /// Their size [m].
    pub extent: f64,
}

/// An instrument in a hand.
#[derive(Clone, Debug)]
pub struct InHand {
    /// The hand's number, which the simulations know it by.
    pub id: HandId,
    /// What it is called.
    pub name: String,
    /// Where it is led.
    pub pose: RigidTransform,
    /// Of jaws: the opening angle that is asked for, the least and the widest [rad].
    pub jaws: Option<[f64; 3]>,
    /// Whether its jaws are locked.
    pub is_locked: bool,
}

/// What moves an instrument, in axes of the picture: to the right, up, towards the viewer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nudge {
    /// By so much [m].
    pub way: [f64; 3],
    /// Turned about its working end, so that its handle goes to the right and up [rad].
    pub tilt: [f64; 2],
    /// Turned about its shaft [rad].
    pub roll: f64,
    /// Jaws open by so much [rad].
    pub opening: f64,
}

/// The widest that jaws of instruments from the scene open, where the scene does not say [rad].
const WIDEST: f64 = std::f64::consts::FRAC_PI_3;

/// What a drag does to an instrument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drag {
    /// Moves it in the plane of the picture: what was pressed stays under the pointer.
    Across,
    /// Moves it away and nearer.
    Depth,
    /// Turns it about its working end: its handle follows.
    Tilt,
    /// Turns it about its shaft.
    Roll,
}

/// Angle that an instrument turns by for a drag across the picture's height [rad].
const TURN: f64 = 3.5;

/// How far a drag across the picture's height leads in depth, as a share of the size of things.
const DEPTH: f64 = 1.5;

impl InHand {
    /// What a drag from one place of a picture to another asks of it, where things are of this size [m]. Where the picture
    /// says nothing of a place it is no number.
    pub fn dragged(
        &self,
        drag: Drag,
        lens: &Lens,
        [from, to]: [[f64; 2]; 2],
        extent: f64,
    ) -> Nudge {
        let height = lens.area.height.max(1.0);
        let [x, y] = [(to[0] - from[0]) / height, (from[1] - to[1]) / height];
        match drag {
            _ if from == to => Nudge::default(),
            Drag::Roll => Nudge { roll: TURN * x, ..Nudge::default() },
            Drag::Tilt => Nudge { tilt: [TURN * x, TURN * y], ..Nudge::default() },
            Drag::Depth => Nudge { way: [0.0, 0.0, -DEPTH * extent * y], ..Nudge::default() },
            Drag::Across => {
                let [right, up, normal] = lens.orbit.axes();
                let eye = lens.orbit.position();
                let at = |place| meet_plane(eye, lens.ray(place), self.pose.translation, normal);
                let way =
                    at(from).zip(at(to)).map_or(Vec3::splat(f64::NAN), |(from, to)| to - from);
                Nudge { way: [way.dot(right), way.dot(up), 0.0], ..Nudge::default() }
            }
        }
    }
}

/// All that are in hands.
#[derive(Debug, Default)]
pub struct Instruments {
    list: Vec<InHand>,
    active: usize,
    taken_so_far: HandId,
    /// The one that the pointer drags.
    dragged: Option<HandId>,
}

impl Instruments {
    /// In the order in which they were taken.
    pub fn list(&self) -> &[InHand] {
        &self.list
    }

    /// The one that pointer and keys lead.
    pub fn active(&self) -> Option<&InHand> {
        self.list.get(self.active)
    }

    /// Of two and more the one that other keys and a controller lead: the next.
    pub fn other(&self) -> Option<&InHand> {
        let next = (self.active + 1) % self.list.len().max(1);
        self.list.get(next).filter(|_| next != self.active)
    }

    /// Takes an instrument from the tray; it becomes the active one.
    pub fn take(&mut self, instrument: &Instrument, around: &Surroundings) -> ToolAct {
        let Surroundings { orbit, top, extent, .. } = around;
        let pose = first_pose(instrument, orbit, *top, *extent, self.list.len());
        let hand = self.add(
            instrument.name.clone(),
            pose,
            instrument.jaws.as_ref().map(|jaws| {
                [jaws.at(0.0).clamp(jaws.least_angle(), WIDEST), jaws.least_angle(), WIDEST]
            }),
        );
        ToolAct::Take { hand, instrument: Box::new(instrument.clone()), pose }
    }

    /// Takes a tool of the scene in hand where it is; it becomes the active one.
    pub fn hold(&mut self, tool: &ToolSnapshot, scene_tool: Option<&Instrument>) -> ToolAct {
        let jaws = tool.jaw_angle.map(|angle| {
            let of_scene = scene_tool.and_then(|tool| tool.jaws.as_ref());
            let least = of_scene.map_or(0.0, viscera::scene::Jaws::least_angle);
            [angle, least, of_scene.map_or(WIDEST, |jaws| jaws.open.max(angle))]
        });
        let hand = self.add(tool.met.name.clone(), tool.pose, jaws);
        ToolAct::Hold { hand, name: tool.met.name.clone() }
    }

    fn add(&mut self, name: String, pose: RigidTransform, jaws: Option<[f64; 3]>) -> HandId {
        self.taken_so_far += 1;
        let id = self.taken_so_far;
        self.list.push(InHand { id, name, pose, jaws, is_locked: false });
        self.active = self.list.len() - 1;
        id
    }

    /// Makes the one of this number active.
    pub fn activate(&mut self, id: HandId) -> bool {
        let place = self.list.iter().position(|held| held.id == id);
        self.active = place.unwrap_or(self.active);
        place.is_some()
    }

    /// The pointer begins to drag one, which becomes the active one.
    pub fn drag(&mut self, id: HandId) -> bool {
        self.dragged = self.activate(id).then_some(id);
        self.dragged.is_some()
    }

    /// The one that the pointer drags.
    pub fn dragged(&self) -> Option<&InHand> {
        self.list.iter().find(|held| self.dragged == Some(held.id))
    }

    /// The pointer drags nothing any more; true where it did.
    pub fn drop_dragged(&mut self) -> bool {
        self.dragged.take().is_some()
    }

    /// Makes the next one active.
    pub fn next(&mut self) {
        self.active = (self.active + 1) % self.list.len().max(1);
    }

    /// Leads one; nothing where it is to go is no place, which the error says.
    pub fn nudge(
        &mut self,
        id: HandId,
        nudge: &Nudge,
        around: &Surroundings,
    ) -> Result<Vec<ToolAct>, String> {
        let Some(held) = self.list.iter_mut().find(|held| held.id == id) else {
            return Ok(Vec::new());
        };
        let [right, up, backward] = around.orbit.axes();
        let [x, y, z] = nudge.way;
        let shaft = held.pose.turn(vec3(0.0, 0.0, 1.0));
        let tilt = shaft.cross(right * nudge.tilt[0] + up * nudge.tilt[1]);
        let next = turned(&held.pose, tilt + shaft * nudge.roll)
            .and_then(|pose| moved(&pose, right * x + up * y + backward * z))
            .map(|pose| within_reach(&pose, around.middle, around.extent));
        let Some(next) = next.filter(RigidTransform::is_finite) else {
            return Err(format!(
                "the {} stays where it is: seen from here, the pointer is nowhere; look at everything (fit the view) and try \
                 again",
                held.name
            ));
        };
        let mut commands = Vec::new();
        if next != held.pose {
            held.pose = next;
            commands.push(ToolAct::Lead { hand: id, pose: next });
        }
        if nudge.opening != 0.0
            && let Some([angle, ..]) = held.jaws
        {
            commands.extend(self.open(id, angle + nudge.opening));
        }
        Ok(commands)
    }

    /// Opens or closes jaws to an angle [rad], as far as they go; locked jaws stay.
    pub fn open(&mut self, id: HandId, angle: f64) -> Option<ToolAct> {
        let held = self.list.iter_mut().find(|held| held.id == id)?;
        let [now, least, widest] = held.jaws.as_mut()?;
        if held.is_locked || !angle.is_finite() {
            return None;
        }
        let angle = angle.max(*least).min(*widest);
        if angle == *now {
            return None;
        }
        *now = angle;
        Some(ToolAct::Jaws { hand: id, angle })
    }

    /// Locks jaws, or unlocks them; nothing where it has none.
    pub fn lock(&mut self, id: HandId) -> Option<ToolAct> {
        let held = self.list.iter_mut().find(|held| held.id == id && held.jaws.is_some())?;
        held.is_locked = !held.is_locked;
        Some(ToolAct::Lock { hand: id, locked: held.is_locked })
    }

    /// Puts one away.
    pub fn put_away(&mut self, id: HandId) -> Option<ToolAct> {
        self.forget(id).then_some(ToolAct::PutAway { hand: id })
    }

    /// One is in no hand: it was refused.
    pub fn forget(&mut self, id: HandId) -> bool {
        let Some(place) = self.list.iter().position(|held| held.id == id) else { return false };
        self.list.remove(place);
        if self.active > place || self.active >= self.list.len() {
            self.active = self.active.saturating_sub(1);
        }
        true
    }

    /// Forgets everything: the simulations have begun anew.
    pub fn clear(&mut self) {
        self.list.clear();
        (self.active, self.dragged) = (0, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::tray;

    fn around() -> Surroundings {
        let orbit = Orbit::framing(&[Vec3::ZERO, vec3(0.1, 0.1, 0.1)]);
        Surroundings { orbit, middle: orbit.target, top: orbit.target, extent: 0.1 }
    }

    fn named(name: &str) -> Instrument {
        let tools = tray().expect("a legal tray");
        tools.into_iter().find(|tool| tool.name == name).expect("an instrument")
    }

    #[test]
    fn two_are_in_hands_and_tab_goes_from_one_to_the_other() {
        let mut hands = Instruments::default();
        assert!(hands.active().is_none() && hands.other().is_none());
        hands.take(&named("probe"), &around());
        assert!(hands.other().is_none());
        hands.take(&named("grasper"), &around());
        let names = |hands: &Instruments| {
            [hands.active(), hands.other()].map(|held| held.map(|held| held.name.clone()))
        };
        assert_eq!(names(&hands), [Some("grasper".into()), Some("probe".into())]);
        hands.next();
        assert_eq!(names(&hands), [Some("probe".into()), Some("grasper".into())]);
        // The active one is put away: the other one is active.
        assert!(matches!(hands.put_away(1), Some(ToolAct::PutAway { hand: 1 })));
        assert_eq!(names(&hands), [Some("grasper".into()), None]);
        assert!(hands.put_away(1).is_none());
        hands.clear();
        assert!(hands.active().is_none());
    }

    #[test]
    fn nudges_go_along_the_picture_and_nowhere_is_told() {
        let mut hands = Instruments::default();
        hands.take(&named("probe"), &around());
        let before = hands.list()[0].pose;
        let nudge = Nudge { way: [0.01, 0.0, 0.0], ..Nudge::default() };
        let commands = hands.nudge(1, &nudge, &around()).expect("a place");
        assert!(matches!(&commands[..], [ToolAct::Lead { hand: 1, .. }]));
        let moved = hands.list()[0].pose.translation - before.translation;
        let [right, ..] = around().orbit.axes();
        assert!((moved - right * 0.01).length() < 1e-12);
        // The handle goes where it is tilted to, and the working end stays.
        let handle = |hands: &Instruments| hands.list()[0].pose.turn(vec3(0.0, 0.0, 1.0));
        let (end, old) = (hands.list()[0].pose.translation, handle(&hands));
        let tilt = Nudge { tilt: [0.1, 0.0], ..Nudge::default() };
        hands.nudge(1, &tilt, &around()).expect("a place");
        assert!((handle(&hands) - old).dot(right) > 0.05);
        assert_eq!(hands.list()[0].pose.translation, end);
        let lost = Nudge { way: [f64::NAN, 0.0, 0.0], ..Nudge::default() };
        let error = hands.nudge(1, &lost, &around()).expect_err("nowhere");
        assert!(error.contains("probe") && error.contains("fit the view"), "{error}");
        assert!(hands.nudge(1, &Nudge::default(), &around()).expect("here").is_empty());
    }

    #[test]
    fn what_is_dragged_stays_under_the_pointer() {
        let mut hands = Instruments::default();
        hands.take(&named("probe"), &around());
        let area = crate::lens::Area { left: 10.0, top: 20.0, width: 640.0, height: 480.0 };
        let lens = Lens::new(&around().orbit, area, 0.0);
        let at = |hands: &Instruments| lens.place(hands.list()[0].pose.translation).expect("seen");
        let from = at(&hands);
        let to = [from[0] + 37.0, from[1] - 21.0];
        let nudge = hands.list()[0].dragged(Drag::Across, &lens, [from, to], 0.1);
        hands.nudge(1, &nudge, &around()).expect("a place");
        let [x, y] = at(&hands);
        assert!((x - to[0]).abs() < 1e-6 && (y - to[1]).abs() < 1e-6, "{x} {y}");
        // A picture without a height, or a camera that is nowhere, leads nowhere.
        let lost = Lens::new(&around().orbit, crate::lens::Area { width: f64::NAN, ..area }, 0.0);
        let nudge = hands.list()[0].dragged(Drag::Across, &lost, [from, to], 0.1);
        assert!(hands.nudge(1, &nudge, &around()).is_err());
        let depth = hands.list()[0].dragged(Drag::Depth, &lens, [from, to], 0.1);
        assert!(depth.way[2] < 0.0 && depth.way[0] == 0.0);
    }

    #[test]
    fn jaws_open_as_far_as_they_go_and_not_while_they_are_locked() {
        let mut hands = Instruments::default();
        hands.take(&named("grasper"), &around());
        let angle = |hands: &Instruments| hands.list()[0].jaws.expect("jaws");
        let [begin, least, widest] = angle(&hands);
        assert!(least < 0.0 && begin > 0.5 && widest > begin);
        assert!(hands.open(1, 9.0).is_some() && angle(&hands)[0] == widest);
        assert!(hands.open(1, 9.0).is_none() && hands.open(1, f64::NAN).is_none());
        let close = Nudge { opening: -9.0, ..Nudge::default() };
        hands.nudge(1, &close, &around()).expect("closed");
        assert_eq!(angle(&hands)[0], least);
        assert!(hands.lock(1).is_some() && hands.open(1, 0.5).is_none());
        assert!(hands.lock(1).is_some() && hands.open(1, 0.5).is_some());
        // A probe has none.
        hands.take(&named("probe"), &around());
        assert!(hands.open(2, 0.5).is_none() && hands.lock(2).is_none());
    }
}
