//! Where instruments are at a time, and whether they are there: by their keys, or by the hands that have taken them.

use super::hand::Hand;
use super::instrument::{Instrument, Jaws};
use crate::scalar::rigid::RigidTransform;

impl Instrument {
    /// From its frame to the world at a time [s].
    pub fn pose(&self, time: f64) -> RigidTransform {
        self.pose_by(&self.hands, time)
    }

    fn pose_by(&self, hands: &[Hand], time: f64) -> RigidTransform {
        match in_force(hands, time) {
            Some((hand, earlier)) => {
                hand.pose(&self.placement, time).unwrap_or_else(|| self.pose_by(earlier, hand.from))
            }
            None => self.pose_by_keys(time),
        }
    }

    /// The opening angle of its jaws at a time [s]; `now` [rad] where they follow a force, zero where it has none.
    pub fn jaw_angle(&self, time: f64, now: f64) -> f64 {
        self.jaws.as_ref().map_or(0.0, |jaws| jaw_angle_by(jaws, &self.hands, time, now))
    }

    /// The closing force of jaws that follow one at a time [s]: in a hand they keep the one they had [N].
    pub fn closing_force(&self, time: f64) -> f64 {
        let until = self.hands.first().map_or(time, |hand| time.min(hand.from));
        self.jaws.as_ref().filter(|jaws| jaws.follow_force()).map_or(0.0, |jaws| jaws.at(until))
    }

    /// Whether what its jaws press on is tied to them at a time [s].
    pub fn is_locked(&self, time: f64) -> bool {
        match in_force(&self.hands, time) {
            Some((hand, _)) => hand.is_locked(time),
            None => self.jaws.as_ref().is_some_and(|jaws| jaws.are_locked(time)),
        }
    }

    /// When it leaves the scene [s]. A hand that takes it before keeps it.
    pub fn leaves(&self) -> Option<f64> {
        self.hands.iter().fold(self.end, |end, hand| match end {
            Some(end) if hand.from >= end => Some(end),
            _ => hand.end,
        })
    }

    /// Whether it is in the scene in a frame that begins at a time [s], which may be so much too early [s].
    pub fn is_there(&self, time: f64, tolerance: f64) -> bool {
        let now = time + tolerance;
        self.begin <= now && self.leaves().is_none_or(|end| end > now)
    }
}

/// The last of the hands that have taken a tool before a time [s], and those before it.
fn in_force(hands: &[Hand], time: f64) -> Option<(&Hand, &[Hand])> {
    let count = hands.iter().rposition(|hand| time > hand.from)? + 1;
    let (last, earlier) = hands.get(..count)?.split_last()?;
    Some((last, earlier))
}

fn jaw_angle_by(jaws: &Jaws, hands: &[Hand], time: f64, now: f64) -> f64 {
    match in_force(hands, time) {
        Some((hand, earlier)) => {
            hand.jaw_angle(time).unwrap_or_else(|| jaw_angle_by(jaws, earlier, hand.from, now))
        }
        None if jaws.follow_force() => now,
        None => jaws.at(time),
    }
}
