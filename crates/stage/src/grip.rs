//! How an instrument in a hand is led: poses from what pointers, keys and controllers say.
//!
//! ```text
//! right, up, towards the viewer     axes of the picture
//! moved      x -> x + right a + up b + towards c
//! turned     about the working end, by a rotation vector in these axes
//! ```

use viscera::scalar::rigid::{RigidTransform, rotation_matrix, rotation_vector};
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera::scene::{Instrument, Part};
use viscera_render::Orbit;

/// A hand moves an instrument no faster than this [m/s], as a surgeon's does: where the pointer jumps, it follows. Much
/// faster, and a frame would take as many substeps as there is time for none.
pub const FASTEST: f64 = 0.4;

/// And turns it no faster than this [rad/s].
pub const FASTEST_TURN: f64 = 6.0;

/// And opens jaws no faster than this [rad/s].
pub const FASTEST_JAWS: f64 = 2.0;

/// An instrument stays within so many times the size of things of their middle.
const REACH: f64 = 3.0;

/// How far above the tissue an instrument that is taken from the tray begins, and how far beside the one before it, as shares
/// of the size of things.
const ABOVE: f64 = 0.08;
const BESIDE: f64 = 0.28;

/// How far the shaft leans towards the viewer, per height.
const LEAN: f64 = 0.68;

/// Where an instrument of the tray begins: above the highest place of the tissue, with its shaft up and towards the viewer.
/// `place` counts instruments that are in hands already, which it keeps clear of; `extent` is the size of things [m].
pub fn first_pose(
    instrument: &Instrument,
    orbit: &Orbit,
    top: Vec3<f64>,
    extent: f64,
    place: usize,
) -> RigidTransform {
    // How far it goes below its working end: jaws do so by their length.
    let below = |part: &Part| match part.opens {
        0.0 => 0.0,
        _ => part.shape.reach() + part.place.translation.length(),
    };
    let reach = instrument.parts.iter().map(below).fold(0.0, f64::max);
    let reach = reach + instrument.thinnest().min(extent);
    let [right, _, backward] = orbit.axes();
    // Upright in the world, whatever the viewer's height.
    let level = vec3(backward.x, backward.y, 0.0);
    let level =
        if level.length() > 1e-6 { level * (1.0 / level.length()) } else { vec3(0.0, -1.0, 0.0) };
    let up = vec3(0.0, 0.0, 1.0);
    let shaft = up + level * LEAN;
    let shaft = shaft * (1.0 / shaft.length());
    let side = [0.0, 1.0, -1.0, 2.0, -2.0].get(place).copied().unwrap_or(place as f64);
    let translation = top + up * (reach + ABOVE * extent) + right * (BESIDE * extent * side);
    let rotation = match instrument.jaws {
        // They open where one sees it: from side to side.
        Some(_) => Mat3::from_columns(right.cross(shaft), right, shaft),
        // Hooks point away from the viewer; blades are seen from their flat side.
        None => Mat3::from_columns(right, shaft.cross(right), shaft),
    };
    RigidTransform { rotation, translation }
}

/// Moved by so much [m]; nothing where that is no number.
pub fn moved(pose: &RigidTransform, by: Vec3<f64>) -> Option<RigidTransform> {
    let translation = pose.translation + by;
    translation.is_finite().then_some(RigidTransform { translation, ..*pose })
}

/// Turned about its working end by a rotation vector [rad] of the world; nothing where that is no number.
pub fn turned(pose: &RigidTransform, by: Vec3<f64>) -> Option<RigidTransform> {
    by.is_finite().then(|| {
        let rotation = rotation_matrix(by) * pose.rotation;
        // Many small turns leave round-off behind, which this takes away.
        RigidTransform { rotation: rotation_matrix(rotation_vector(&rotation)), ..*pose }
    })
}

/// Kept within reach of a middle [m] of things of this size [m].
pub fn within_reach(pose: &RigidTransform, middle: Vec3<f64>, extent: f64) -> RigidTransform {
    let away = pose.translation - middle;
    let (length, most) = (away.length(), REACH * extent);
    if length > most {
        RigidTransform { translation: middle + away * (most / length), ..*pose }
    } else {
        *pose
    }
}

/// The next pose on the way to where an instrument is led, after a time [s]: no faster than a hand.
pub fn follow(from: &RigidTransform, to: &RigidTransform, time: f64) -> RigidTransform {
    let way = (to.translation - from.translation).length() / (FASTEST * time);
    let turn = rotation_vector(&(to.rotation * from.rotation.transpose())).length()
        / (FASTEST_TURN * time);
    let slowest = way.max(turn);
    if slowest > 1.0 { from.towards(to, 1.0 / slowest) } else { *to }
}

/// The next angle of jaws on the way to another, after a time [s].
pub fn opened(now: f64, to: f64, time: f64) -> f64 {
    let most = FASTEST_JAWS * time;
    if (to - now).abs() > most { now + most * (to - now).signum() } else { to }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn off(a: &RigidTransform, b: &RigidTransform) -> f64 {
        (a.translation - b.translation).length()
            + rotation_vector(&(a.rotation * b.rotation.transpose())).length()
    }

    #[test]
    fn an_instrument_begins_upright_before_the_viewer_and_beside_those_before_it() {
        let mut orbit = Orbit::framing(&[vec3(0.0, 0.0, 0.0), vec3(0.2, 0.1, 0.1)]);
        for _ in 0..12 {
            orbit.turn(31.0, 13.0);
            let top = vec3(0.1, 0.05, 0.1);
            let probe = &crate::hand::tray().expect("a legal tray")[0];
            let pose = first_pose(probe, &orbit, top, 0.2, 0);
            assert!(pose.translation.z > 0.115 && pose.is_rigid());
            let shaft = pose.turn(vec3(0.0, 0.0, 1.0));
            assert!(shaft.z > 0.8 && shaft.dot(orbit.axes()[2]) > 0.3, "{shaft:?}");
            let turn = rotation_vector(&pose.rotation);
            assert!((rotation_matrix(turn) * vec3(0.0, 0.0, 1.0) - shaft).length() < 1e-9);
            let second = first_pose(probe, &orbit, top, 0.2, 1);
            assert!((second.translation - pose.translation).length() > 0.05);
        }
    }

    #[test]
    fn a_hand_follows_at_its_own_speed_and_arrives() {
        let from = RigidTransform::IDENTITY;
        let to = RigidTransform::about(Vec3::ZERO, vec3(0.0, 0.3, 0.0), vec3(0.1, 0.0, 0.0));
        let first = follow(&from, &to, 0.01);
        assert!((first.translation.length() - 0.01 * FASTEST).abs() < 1e-12);
        let mut pose = from;
        for _ in 0..26 {
            pose = follow(&pose, &to, 0.01);
        }
        assert!(off(&pose, &to) < 1e-9, "{}", off(&pose, &to));
        // A quick turn on the spot as well.
        let turned = RigidTransform::about(Vec3::ZERO, vec3(0.0, 0.0, 3.0), Vec3::ZERO);
        let next = rotation_vector(&follow(&from, &turned, 0.01).rotation);
        assert!((next.length() - 0.01 * FASTEST_TURN).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_number_moves_nothing_and_what_is_far_stays_in_reach() {
        let pose = RigidTransform::IDENTITY;
        assert!(moved(&pose, vec3(f64::NAN, 0.0, 0.0)).is_none());
        assert!(moved(&pose, vec3(f64::INFINITY, 0.0, 0.0)).is_none());
        assert!(turned(&pose, vec3(0.0, f64::NAN, 0.0)).is_none());
        let far = moved(&pose, vec3(7.0, 0.0, 0.0)).expect("a number");
        let kept = within_reach(&far, vec3(1.0, 0.0, 0.0), 0.1);
        assert!((kept.translation - vec3(1.3, 0.0, 0.0)).length() < 1e-12);
        assert_eq!(within_reach(&pose, Vec3::ZERO, 0.1), pose);
    }

    #[test]
    fn many_turns_leave_a_rotation() {
        let mut pose = RigidTransform::IDENTITY;
        for _ in 0..2000 {
            pose = turned(&pose, vec3(0.01, 0.02, -0.015)).expect("a number");
        }
        let product = pose.rotation * pose.rotation.transpose();
        let off = (product * vec3(1.0, 1.0, 1.0) - vec3(1.0, 1.0, 1.0)).length();
        assert!(off < 1e-12, "{off}");
    }
}
