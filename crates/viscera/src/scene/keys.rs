//! Values at times, and between them.

use super::common::Interpolation;
use crate::scalar::Vec3;

/// A pose at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionKey {
    /// [s].
    pub time: f64,
    /// Displacement from rest [m].
    pub translation: Vec3<f64>,
    /// Axis times angle [rad].
    pub rotation: Vec3<f64>,
}

/// A value at a time: an opening angle [rad], a closing force [N].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JawKey {
    /// [s].
    pub time: f64,
    /// [rad] or [N].
    pub value: f64,
}

impl Interpolation {
    /// How far values have passed, of how far time has (0 to 1).
    pub(super) fn shape(self, share: f64) -> f64 {
        match self {
            Self::Linear => share,
            Self::Smooth => share * share * (3.0 - 2.0 * share),
        }
    }
}

/// Exact at both ends, and where they are the same: a hold that stood still stands still once it is read
/// from a file, which tells of the end of that as well.
pub(super) fn mix(a: Vec3<f64>, b: Vec3<f64>, share: f64) -> Vec3<f64> {
    if a == b { a } else { a * (1.0 - share) + b * share }
}

/// The keys before and after a time, and how far it is from one to the other (0 to 1).
pub(super) fn between<K>(
    keys: &[K],
    time_of: impl Fn(&K) -> f64,
    time: f64,
) -> (Option<&K>, Option<&K>, f64) {
    let next = keys.partition_point(|key| time_of(key) <= time);
    match (next.checked_sub(1).and_then(|last| keys.get(last)), keys.get(next)) {
        (Some(a), Some(b)) => (Some(a), Some(b), (time - time_of(a)) / (time_of(b) - time_of(a))),
        (Some(last), None) => (Some(last), Some(last), 0.0),
        (None, first) => (first, first, 0.0),
    }
}
