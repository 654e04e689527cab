//! Paths over time: poses of moved patches, shares of forces.
//!
//! A pose turns by the rotation vector `r` (axis times angle) about a point `c`, then moves by `t`:
//! `x -> c + R(r) (x - c) + t`, with Rodrigues' formula `R = I + sin(a) K + (1 - cos(a)) K^2`,
//! `a = |r|`, `K` the cross product with `r/a`. Between keys `r` and `t` are interpolated.

use super::common::Interpolation;
use super::keys::{MotionKey, between, mix};
use super::selector::Patch;
use crate::scalar::Vec3;
use crate::scalar::rigid::RigidTransform;

/// A patch that is held and moved along a path.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// The name, or "motion 0" and so on.
    pub name: String,
    /// The patch that is held.
    pub patch: Patch,
    /// At least one, times ascending, the first at `start`.
    pub keys: Vec<MotionKey>,
    /// Between keys.
    pub interpolation: Interpolation,
    /// The point [m] that rotations turn about.
    pub about: Vec3<f64>,
    /// When the patch is taken hold of [s]: poses are relative to where it is then.
    pub start: f64,
    /// Total stiffness [N/m] of springs that pull it along; `None` holds rigidly.
    pub stiffness: Option<f64>,
    /// When the patch is let go [s].
    pub release: Option<f64>,
}

impl Motion {
    /// Where the patch is at a time [s], relative to where it was taken hold of.
    pub fn pose(&self, time: f64) -> RigidTransform {
        let (before, after, share) = between(&self.keys, |key| key.time, time);
        let Some((a, b)) = before.zip(after) else { return RigidTransform::IDENTITY };
        let share = self.interpolation.shape(share);
        RigidTransform::about(
            self.about,
            mix(a.rotation, b.rotation, share),
            mix(a.translation, b.translation, share),
        )
    }

    /// Whether the patch is held at a time [s].
    pub fn is_held(&self, time: f64) -> bool {
        time >= self.start && self.release.is_none_or(|release| time < release)
    }
}

/// The share of a force at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceKey {
    /// [s].
    pub time: f64,
    /// The share of the full force.
    pub factor: f64,
}

/// A patch that is pulled with a force, shared equally among its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Force {
    /// The name, or "force 0" and so on.
    pub name: String,
    /// The patch that is pulled.
    pub patch: Patch,
    /// The full force on the whole patch [N].
    pub force: Vec3<f64>,
    /// Its share over time, times ascending; empty for the full force throughout.
    pub keys: Vec<ForceKey>,
    /// Between keys.
    pub interpolation: Interpolation,
}

impl Force {
    /// The force [N] on the whole patch at a time [s].
    pub fn at(&self, time: f64) -> Vec3<f64> {
        let (before, after, share) = between(&self.keys, |key| key.time, time);
        let Some((a, b)) = before.zip(after) else { return self.force };
        let share = self.interpolation.shape(share);
        self.force * (a.factor * (1.0 - share) + b.factor * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::{Mat3, vec3};
    use crate::scene::selector::Selector;
    use crate::settings::Place;
    use std::f64::consts::PI;

    fn motion(interpolation: Interpolation, keys: Vec<MotionKey>) -> Motion {
        let place = Place::Override { key: "test".into() };
        let selector = Selector::Region(0);
        Motion {
            name: "pull".into(),
            patch: Patch { body: 0, selector, purpose: "motion `pull`".into(), place },
            keys,
            interpolation,
            about: vec3(0.1, 0.2, 0.3),
            start: 0.0,
            stiffness: None,
            release: Some(1.5),
        }
    }

    fn key(time: f64, translation: [f64; 3], rotation: [f64; 3]) -> MotionKey {
        MotionKey {
            time,
            translation: Vec3::from_f64(translation),
            rotation: Vec3::from_f64(rotation),
        }
    }

    #[test]
    fn a_motion_starts_exactly_at_rest_and_ends_at_its_last_key() {
        let end = [0.01, -0.02, 0.04];
        let pull = motion(
            Interpolation::Smooth,
            vec![key(0.0, [0.0; 3], [0.0; 3]), key(1.0, end, [0.0; 3])],
        );
        assert_eq!(pull.pose(0.0), RigidTransform::IDENTITY);
        assert_eq!(pull.pose(7.0).translation, Vec3::from_f64(end));
        assert_eq!(pull.pose(0.5).translation, Vec3::from_f64(end) * 0.5);
        // Smooth: the first hundredth of the time covers 3 s^2 of the way, to order s^3.
        assert!(pull.pose(0.01).translation.z < 0.04 * 3.0 * 0.01 * 0.01);
        assert!(pull.is_held(1.49) && !pull.is_held(1.5));
    }

    #[test]
    fn a_rotation_keeps_lengths_and_its_centre() {
        let turn = motion(
            Interpolation::Linear,
            vec![key(0.0, [0.0; 3], [0.0; 3]), key(1.0, [0.0; 3], [0.0, 0.0, 2.0 * PI])],
        );
        let quarter = turn.pose(0.25);
        let close = |a: Vec3<f64>, b: Vec3<f64>| (a - b).length() <= 16.0 * f64::EPSILON;
        assert!(close(quarter.apply(turn.about), turn.about));
        assert!(close(quarter.apply(vec3(1.1, 0.2, 0.3)), vec3(0.1, 1.2, 0.3)));
        for step in 0..50 {
            let rotation = turn.pose(0.02 * f64::from(step)).rotation;
            let defect = rotation * rotation.transpose() - Mat3::IDENTITY;
            assert!(defect.norm_squared().sqrt() <= 16.0 * f64::EPSILON);
            assert!((rotation.determinant() - 1.0).abs() <= 16.0 * f64::EPSILON);
        }
    }

    #[test]
    fn a_force_follows_its_keys_and_is_full_without() {
        let full = vec3(0.0, 0.0, 2.0);
        let patch = motion(Interpolation::Linear, Vec::new()).patch;
        let keys = vec![ForceKey { time: 1.0, factor: 0.0 }, ForceKey { time: 2.0, factor: 1.0 }];
        let interpolation = Interpolation::Linear;
        let mut force = Force { name: "weight".into(), patch, force: full, keys, interpolation };
        assert_eq!([0.5, 1.5, 9.0].map(|time| force.at(time).z), [0.0, 1.0, 2.0]);
        force.keys.clear();
        assert_eq!(force.at(0.0), full);
    }
}
