//! A tool in a hand: poses, opening angles of jaws and locks from a time on, in place of what was to move it.
//!
//! ```text
//! key (r, t)      x -> R(r) R_0 x + t_0 + t      pose of the tool's own (R_0, t_0)
//! between keys    origins on a straight line, rotations about one axis, both at constant speed
//! ```

use super::keys::{JawKey, MotionKey, between};
use crate::scalar::Vec3;
use crate::scalar::rigid::{RigidTransform, rotation_matrix, rotation_vector};

/// A hand that has taken a tool.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hand {
    /// When it takes the tool [s], which stops there.
    pub from: f64,
    /// Where the tool is, relative to its own pose, times ascending. The first says where it is then.
    pub keys: Vec<MotionKey>,
    /// Opening angles [rad] of its jaws, times ascending; until the first they stay as they were, and a force on them.
    pub jaw: Vec<JawKey>,
    /// Begin and end of the times at which its jaws are locked [s]; infinite where nothing unlocks them.
    pub locks: Vec<[f64; 2]>,
    /// When it is put away [s].
    pub end: Option<f64>,
}

impl Hand {
    /// That takes a tool at a time [s].
    pub fn new(from: f64) -> Self {
        Self { from, ..Self::default() }
    }

    /// Where a tool with this pose of its own is at a time [s]; nothing up to the first key.
    pub(super) fn pose(&self, own: &RigidTransform, time: f64) -> Option<RigidTransform> {
        self.keys.first().filter(|first| time > first.time)?;
        let (before, after, share) = between(&self.keys, |key| key.time, time);
        let (a, b) = before.zip(after)?;
        Some(posed(own, a).towards(&posed(own, b), share))
    }

    /// The opening angle [rad] of the jaws at a time [s]; nothing up to the first key.
    pub(super) fn jaw_angle(&self, time: f64) -> Option<f64> {
        self.jaw.first().filter(|first| time > first.time)?;
        let (before, after, share) = between(&self.jaw, |key| key.time, time);
        let (a, b) = before.zip(after)?;
        Some(if a.value == b.value { a.value } else { a.value * (1.0 - share) + b.value * share })
    }

    /// Whether the jaws are locked at a time [s]. What a hand does acts behind the moment at which it does it.
    pub(super) fn is_locked(&self, time: f64) -> bool {
        self.locks.iter().any(|&[from, to]| time > from && time <= to)
    }
}

/// A pose as a key of a tool with a pose of its own.
pub(crate) fn key_of(own: &RigidTransform, pose: &RigidTransform, time: f64) -> MotionKey {
    MotionKey {
        time,
        translation: pose.translation - own.translation,
        rotation: rotation_vector(&(pose.rotation * own.rotation.transpose())),
    }
}

fn posed(own: &RigidTransform, key: &MotionKey) -> RigidTransform {
    let turned = if key.rotation == Vec3::ZERO {
        own.rotation
    } else {
        rotation_matrix(key.rotation) * own.rotation
    };
    RigidTransform { rotation: turned, translation: own.translation + key.translation }
}
