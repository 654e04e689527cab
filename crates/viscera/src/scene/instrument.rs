//! Instruments: tools and fixed obstacles, each of one or more shapes that tissue meets, moved along a path.
//!
//! ```text
//! instrument in the world   x -> R(r) R_0 x + t_0 + t          pose of its own (R_0, t_0), key (r, t) in axes of the world
//! part in the instrument    rigid, but for jaws: turned by +- angle/2 about the instrument's x axis
//! ```
//!
//! Working ends are at the origin and shafts along +z, so that a path is one of the working end. A grasper's jaws reach
//! along -z from a hinge at the origin, and open along y.

use super::Written;
use super::common::Interpolation;
use super::hand::Hand;
use super::keys::{JawKey, MotionKey, between, mix};
use super::solid::Solid;
use crate::contact::{ContactLaw, Held, Shape, Spring, Tool};
use crate::scalar::Vec3;
use crate::scalar::rigid::{RigidTransform, rotation_matrix};
use crate::settings::{Place, choices};

choices! {
    /// Kinds of tools and obstacles.
    pub enum ToolKind {
        /// Solid below the plane z = 0 of its own frame: a table, a wall.
        HalfSpace = "half_space",
        /// `radius`, around the origin.
        Sphere = "sphere",
        /// `radius`, and `length` between the middles of its round ends, from the origin along +z.
        Capsule = "capsule",
        /// `size`, centred at the origin, edges rounded by `rounding`.
        Box = "box",
        /// `radius` and `length`: a round tip at the origin, its shaft along +z.
        Probe = "probe",
        /// A retractor, `size` = [width, thickness, length]: from the middle of its lower edge at the origin along +z.
        Blade = "blade",
        /// `radius` and `length` of a shaft along +z, and `tip_length` of a tip from the origin at `tip_angle` to the
        /// shaft, towards +y.
        Hook = "hook",
        /// Two jaws of `jaw_size` = [width, thickness, length], along -z from a hinge at the origin; they open along
        /// y. In place of `jaw_size` a closed surface in a file, `jaw_mesh`.
        Grasper = "grasper",
        /// Any closed surface, in a file: `mesh`.
        Mesh = "mesh",
        /// A grasper whose jaws have ridges across, on a shaft of `radius` and `length`.
        AtraumaticGrasper = "atraumatic_grasper",
        /// `fingers` of `size` = [width, thickness, length], spread by `spread` in the plane of x and z; the middle of
        /// their ends is the origin, the hinge above it, and a shaft of `radius` and `length` goes on along +z.
        FanRetractor = "fan_retractor",
        /// A tube of `radius`, `inner_radius` and `length`, open at the origin. It draws nothing in.
        SuctionTip = "suction_tip",
    }
}

/// A tool or a fixed obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Instrument {
    /// The name, or "tool 0" and so on.
    pub name: String,
    /// What it is.
    pub kind: ToolKind,
    /// What tissue meets of it, but for the solids: at least one of both.
    pub parts: Vec<Part>,
    /// Parts of which the distances are not computed yet; none in an assembly.
    pub solids: Vec<Solid>,
    /// Its own pose: from its frame to the world, where no key moves it.
    pub placement: RigidTransform,
    /// How it moves.
    pub course: Course,
    /// How tissue meets it.
    pub law: ContactLaw,
    /// How a spring holds it in the hand that keys stand for; rigidly where there is none.
    pub spring: Option<Spring>,
    /// Of a grasper.
    pub jaws: Option<Jaws>,
    /// When it comes into the scene [s].
    pub begin: f64,
    /// When it leaves [s], where no hand has it.
    pub end: Option<f64>,
    /// Hands that take it, by their times: from each on, what was to move it before no longer does.
    pub hands: Vec<Hand>,
    /// Where the scene has it.
    pub place: Place,
    /// What was written.
    pub(super) table: Written,
}

/// One shape of an instrument.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// In its own frame.
    pub shape: Shape,
    /// From its own frame to the instrument's, jaws at angle zero.
    pub place: RigidTransform,
    /// How it turns about the instrument's x axis as jaws open: 1 or -1; 0 for what is no jaw.
    pub opens: f64,
}

/// How an instrument moves.
#[derive(Clone, Debug, PartialEq)]
pub enum Course {
    /// Along keys, relative to its own pose; it stands still where there are none.
    Keys {
        /// Times ascending.
        keys: Vec<MotionKey>,
        /// Between keys.
        interpolation: Interpolation,
    },
    /// Along a path in a file, which is keys once it is read ([`super::read_path`]).
    File {
        /// As the scene names it.
        path: String,
    },
}

/// What moves a grasper's jaws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JawDrive {
    /// Keys are opening angles [rad].
    Angle,
    /// Keys are closing forces [N], each jaw's, at the middle of its length; below zero they open.
    Force,
}

/// Two jaws on a hinge.
#[derive(Clone, Debug, PartialEq)]
pub struct Jaws {
    /// Of each jaw, from the hinge [m]; zero until a file with the jaw is read.
    pub length: f64,
    /// Between the jaws at angle zero [m].
    pub gap: f64,
    /// What keys are.
    pub drive: JawDrive,
    /// At least one, times ascending: before the first the first, after the last the last.
    pub keys: Vec<JawKey>,
    /// Between keys.
    pub interpolation: Interpolation,
    /// Of jaws that a force drives: the angle at the beginning, and the widest [rad].
    pub open: f64,
    /// The same: the time [s] in which jaws that nothing holds close from there to angle zero.
    pub closing_time: f64,
    /// Begin and end of the times at which jaws are locked [s].
    pub locks: Vec<[f64; 2]>,
}

impl Jaws {
    /// The value of the keys at a time [s]: an angle [rad] or a force [N].
    pub fn at(&self, time: f64) -> f64 {
        let (before, after, share) = between(&self.keys, |key| key.time, time);
        let Some((a, b)) = before.zip(after) else { return 0.0 };
        let share = self.interpolation.shape(share);
        if a.value == b.value { a.value } else { a.value * (1.0 - share) + b.value * share }
    }

    /// The smallest angle [rad] at which the jaws do not overlap.
    pub fn least_angle(&self) -> f64 {
        -2.0 * libm::atan2(0.5 * self.gap, self.length)
    }

    /// Whether what the jaws press on is tied to them at a time [s].
    pub fn are_locked(&self, time: f64) -> bool {
        self.locks.iter().any(|&[from, to]| (from..to).contains(&time))
    }

    /// Whether the angle follows a force.
    pub fn follow_force(&self) -> bool {
        self.drive == JawDrive::Force
    }
}

impl Instrument {
    /// Where its keys have it at a time [s].
    pub(super) fn pose_by_keys(&self, time: f64) -> RigidTransform {
        let Course::Keys { keys, interpolation } = &self.course else { return self.placement };
        let (before, after, share) = between(keys, |key| key.time, time);
        let Some((a, b)) = before.zip(after) else { return self.placement };
        let share = interpolation.shape(share);
        RigidTransform {
            rotation: rotation_matrix(mix(a.rotation, b.rotation, share)) * self.placement.rotation,
            translation: self.placement.translation + mix(a.translation, b.translation, share),
        }
    }

    /// Adds its parts, where they are at a time [s] with its jaws at an angle [rad].
    pub fn parts_at(&self, time: f64, angle: f64, tools: &mut Vec<Tool>) {
        let pose = self.pose(time);
        let is_locked = self.is_locked(time);
        let body = tools.len() as u32;
        let held = self.spring.map(|spring| Held { spring, hand: pose, body });
        tools.extend(self.parts.iter().map(|part| Tool {
            shape: part.shape.clone(),
            pose: pose.after(&part.placed(angle)),
            law: self.law,
            is_locked,
            held,
        }));
    }

    /// Whether nothing ever moves it, but hands.
    pub fn stands_still(&self) -> bool {
        let is_held = |keys: &[MotionKey]| {
            keys.windows(2).all(|two| {
                two[0].translation == two[1].translation && two[0].rotation == two[1].rotation
            })
        };
        let keys_hold = match &self.course {
            Course::Keys { keys, .. } => is_held(keys),
            Course::File { .. } => false,
        };
        let jaws_hold = self.jaws.as_ref().is_none_or(|jaws| {
            !jaws.follow_force() && jaws.keys.windows(2).all(|two| two[0].value == two[1].value)
        });
        keys_hold && jaws_hold
    }

    /// Half of the breadth of its narrowest part [m]; infinite for a half-space.
    pub fn breadth(&self) -> f64 {
        self.parts.iter().map(|part| part.shape.breadth()).fold(f64::INFINITY, f64::min)
    }

    /// The radius of its thinnest part [m]; infinite for a half-space.
    pub fn thinnest(&self) -> f64 {
        self.parts.iter().map(|part| part.shape.thinnest()).fold(f64::INFINITY, f64::min)
    }
}

impl Part {
    /// From its own frame to the instrument's, with jaws at an angle [rad].
    pub fn placed(&self, angle: f64) -> RigidTransform {
        if self.opens == 0.0 {
            return self.place;
        }
        let turn = Vec3 { x: 0.5 * self.opens * angle, y: 0.0, z: 0.0 };
        RigidTransform::about(Vec3::ZERO, turn, Vec3::ZERO).after(&self.place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;
    use std::f64::consts::PI;

    fn instrument(parts: Vec<Part>, keys: Vec<MotionKey>, jaws: Option<Jaws>) -> Instrument {
        Instrument {
            name: "tool".into(),
            kind: ToolKind::Grasper,
            parts,
            solids: Vec::new(),
            placement: RigidTransform::about(
                Vec3::ZERO,
                vec3(0.0, 0.0, 0.5 * PI),
                vec3(0.1, 0.0, 0.0),
            ),
            course: Course::Keys { keys, interpolation: Interpolation::Linear },
            law: ContactLaw::default(),
            spring: None,
            jaws,
            begin: 0.0,
            end: None,
            hands: Vec::new(),
            place: Place::Override { key: "test".into() },
            table: Written::default(),
        }
    }

    fn jaws(gap: f64) -> Jaws {
        let key = |time, value| JawKey { time, value };
        Jaws {
            length: 0.02,
            gap,
            drive: JawDrive::Angle,
            keys: vec![key(0.0, 0.5), key(1.0, 0.0)],
            interpolation: Interpolation::Linear,
            open: 0.5,
            closing_time: 0.5,
            locks: vec![[1.0, 2.0]],
        }
    }

    fn jaw(opens: f64) -> Part {
        let half = vec3(0.004, 0.001, 0.01);
        let place = vec3(0.0, opens * half.y, -half.z);
        Part {
            shape: Shape::RoundedBox { half, radius: 5e-4 },
            place: RigidTransform::about(Vec3::ZERO, Vec3::ZERO, place),
            opens,
        }
    }

    #[test]
    fn keys_move_in_axes_of_the_world_and_turn_about_the_origin() {
        let key = |time, x, turn| MotionKey {
            time,
            translation: vec3(x, 0.0, 0.0),
            rotation: vec3(0.0, 0.0, turn),
        };
        let ball = Part {
            shape: Shape::Sphere { radius: 0.001 },
            place: RigidTransform::about(Vec3::ZERO, Vec3::ZERO, vec3(0.01, 0.0, 0.0)),
            opens: 0.0,
        };
        let keys = vec![key(0.0, 0.0, 0.0), key(1.0, 0.2, 0.5 * PI)];
        let tool = instrument(vec![ball.clone()], keys, None);
        let mut parts = Vec::new();
        for time in [0.0, 0.5, 1.0] {
            tool.parts_at(time, 0.0, &mut parts);
        }
        // A quarter of a turn of its own, and another one of its keys.
        let half = 0.01 * libm::sqrt(0.5);
        let places = [vec3(0.1, 0.01, 0.0), vec3(0.2 - half, half, 0.0), vec3(0.29, 0.0, 0.0)];
        for (part, place) in parts.iter().zip(places) {
            assert!((part.pose.translation - place).length() < 1e-15, "{part:?}");
        }
        assert!(!tool.stands_still() && instrument(vec![ball], Vec::new(), None).stands_still());
    }

    #[test]
    fn jaws_open_along_y_and_lock_at_their_times() {
        let mut grasper = instrument(vec![jaw(1.0), jaw(-1.0)], Vec::new(), Some(jaws(0.0)));
        grasper.placement = RigidTransform::IDENTITY;
        let mut parts = Vec::new();
        grasper.parts_at(0.0, grasper.jaw_angle(0.0, 9.0), &mut parts);
        // The inner edges of the jaws' ends, a half of 0.5 rad to each side.
        let end = vec3(0.0, 0.02 * libm::sin(0.25), -0.02 * libm::cos(0.25));
        for (part, side) in parts.iter().zip([1.0, -1.0]) {
            let place = vec3(0.0, side * end.y, end.z);
            let corner = part.pose.undo(place);
            assert!((corner - vec3(0.0, -side * 1e-3, -0.01)).length() < 1e-15, "{corner:?}");
            assert!(!part.is_locked);
        }
        parts.clear();
        grasper.parts_at(1.5, grasper.jaw_angle(1.5, 9.0), &mut parts);
        assert!(parts.iter().all(|part| part.is_locked));
        // Closed, they meet in the plane of the hinge.
        assert!((parts[0].pose.translation - vec3(0.0, 1e-3, -0.01)).length() < 1e-15);
        assert!((parts[0].distance(vec3(0.0, 0.0, -0.01)).value).abs() < 1e-15);
    }

    #[test]
    fn jaws_with_a_gap_may_close_further() {
        assert_eq!(jaws(0.0).least_angle(), 0.0);
        let least = jaws(0.004).least_angle();
        let part = |angle: f64| {
            Part {
                place: RigidTransform::about(Vec3::ZERO, Vec3::ZERO, vec3(0.0, 0.003, -0.01)),
                ..jaw(1.0)
            }
            .placed(angle)
        };
        // The end of the inner face then lies in the plane between the jaws.
        let end = part(least).apply(vec3(0.0, -0.001, -0.01));
        assert!(end.y.abs() < 1e-15 && end.z < -0.019, "{end:?}");
        assert!(part(least - 0.01).apply(vec3(0.0, -0.001, -0.01)).y < -1e-5);
    }
}
