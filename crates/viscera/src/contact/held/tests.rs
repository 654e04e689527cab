//! Held tools: forces, what they learn, where they rest.

use super::*;
use crate::scalar::vec3;

const FOUNDATION: Foundation = Foundation { area: 2e-5, stiffness: 1e7, thickness: 1e-3 };
/// `A E/h` of tissue for which contact has ten times its stiffness [N/m].
const PLAIN: f64 = 20.0;

/// A sample below a tool whose lower side is at `z` [m], with the force that contact has there.
fn pressing(z: f64) -> Pressing {
    let squeezed = FOUNDATION.squeeze(z);
    Pressing {
        arm: vec3(2e-3, -1e-3, -5e-3),
        normal: vec3(0.0, 0.0, -1.0),
        pressed: squeezed.force,
        drag: vec3(3e-3, 0.0, 0.0),
        limit: 1e-2,
        foundation: FOUNDATION,
        kappa: YIELD * PLAIN,
        overlap: FOUNDATION.thickness - z,
    }
}

#[test]
fn a_tool_that_stays_feels_what_the_step_before_has_left() {
    for z in [0.9e-3, 0.6e-3, 0.3e-3, -0.5e-3] {
        let at = pressing(z);
        for firm in [1.0, 7.0] {
            let (force, _) = at.force([Vec3::ZERO; 2], firm);
            let left = at.normal * at.pressed + at.drag;
            assert!((force - left).length() < 1e-14 + 1e-12 * left.length(), "{z} {firm}");
        }
    }
}

/// The matrix is what makes the force change: in the normal direction exactly, across it where friction holds.
#[test]
fn stiffness_is_the_slope_of_the_force() {
    let h = 1e-9;
    for z in [0.9e-3, 0.3e-3] {
        let at = pressing(z);
        let way = [vec3(1e-5, 2e-5, -3e-5), vec3(1e-3, -2e-3, 5e-4)];
        let (_, [along, across]) = at.force(way, 2.0);
        let (mut residual, mut matrix) = ([Vec3::ZERO; 2], [[0.0; 6]; 6]);
        add_contact(&at, &way, 2.0, &mut residual, &mut matrix);
        assert!(along > 0.0 && across > 0.0);
        for (k, row) in matrix.iter().enumerate() {
            let moved = |size: f64| {
                let mut moved = way;
                moved[k / 3][k % 3] += size;
                let (mut residual, mut unused) = ([Vec3::ZERO; 2], [[0.0; 6]; 6]);
                add_contact(&at, &moved, 2.0, &mut residual, &mut unused);
                residual
            };
            let [plus, minus] = [moved(h), moved(-h)];
            for (i, entry) in row.iter().enumerate() {
                let slope = (minus[i / 3][i % 3] - plus[i / 3][i % 3]) / (2.0 * h);
                assert!((slope - entry).abs() < 1e-5 * along, "{z} {k} {i}: {slope} {entry}");
            }
        }
    }
}

#[test]
fn friction_gives_way_at_its_limit_and_what_is_tied_does_not() {
    let at = pressing(0.5e-3);
    let far = [vec3(-5e-2, 0.0, 0.0), Vec3::ZERO];
    let (force, _) = at.force(far, 1.0);
    let drag = force - at.normal * force.dot(at.normal);
    assert!((drag.length() - at.limit).abs() < 1e-15, "{drag:?}");
    let tied = Pressing { limit: f64::INFINITY, ..at };
    let up = [vec3(0.0, 0.0, 5e-3), Vec3::ZERO];
    assert_eq!(at.force(up, 1.0).0.z, 0.0);
    // It is drawn along.
    assert!(tied.force(up, 1.0).0.z > 0.1, "{:?}", tied.force(up, 1.0));
}

/// Ten samples of a wall under a tool whose hand goes 4 mm into it and stays: the force in every step [N].
fn on_bone(dt: f64, steps: usize, learns: bool) -> Vec<f64> {
    let spring = Spring::default();
    let mut motion = HeldMotion::default();
    let start = RigidTransform { translation: vec3(0.0, 0.0, 1.5e-3), ..RigidTransform::IDENTITY };
    let hand = RigidTransform { translation: vec3(0.0, 0.0, -4e-3), ..start };
    motion.put(&start);
    let mut forces = Vec::new();
    for _ in 0..steps {
        let z = motion.poses.expect("it is somewhere")[0].translation.z;
        if !learns {
            motion.learned = Firmness::default();
        }
        motion.step(&spring, &hand, dt, |act| {
            for k in 0..10 {
                let angle = 0.628 * f64::from(k);
                let arm = vec3(2e-3 * libm::cos(angle), 2e-3 * libm::sin(angle), 0.0);
                let at = Pressing { arm, drag: Vec3::ZERO, limit: 0.0, ..pressing(z) };
                if at.pressed > 0.0 {
                    act(&at);
                }
            }
        });
        forces.push(motion.force.z);
    }
    forces
}

/// On what does not yield at all contact is 2.5 times as firm as expected, and 25 times where it is deep: without what it has
/// learned the tool would swing for ever.
#[test]
fn a_tool_on_bone_learns_how_firm_it_is() {
    for dt in [1.0 / 60.0, 1.0 / 120.0, 1.0 / 240.0, 1e-3] {
        let swing = |learns: bool| {
            let forces = on_bone(dt, 400, learns);
            let last = &forces[300..];
            let [low, high] =
                [f64::min, f64::max].map(|pick| last.iter().copied().reduce(pick).expect("some"));
            (high - low, last[0])
        };
        let (left, force) = swing(true);
        // Where 2000 N/m times what is within 1 mm and 18000 N/m times what is within 0.5 mm are the spring's force.
        let exact = 400.0 * (9.4 / 20_400.0 + 4e-3);
        // What it has learned it forgets slowly, until it swings by so little that it learns again.
        assert!(left < 1e-4 && (force - exact).abs() < 1e-4, "{dt}: {left} {force} {exact}");
        if dt > 1e-2 {
            assert!(swing(false).0 > 1e-2, "{dt}: {:?}", swing(false));
        }
    }
}

#[test]
fn poses_stay_rotations_and_springs_are_checked() {
    let mut motion = HeldMotion::default();
    motion.put(&RigidTransform::IDENTITY);
    for step in 0..5000 {
        let turn = vec3(0.0, 0.02 * f64::from(step), 0.3);
        let hand = RigidTransform::about(Vec3::ZERO, turn, Vec3::ZERO);
        motion.step(&Spring::default(), &hand, 1e-3, |_| {});
    }
    let [pose, _] = motion.poses.expect("it is somewhere");
    let excess = pose.rotation.transpose() * pose.rotation - Mat3::IDENTITY;
    assert!(excess.norm_squared() < 1e-30, "{excess:?}");
    assert_eq!(Spring::default().complaint(), None);
    for (stiffness, mass) in [(0.0, 0.03), (f64::NAN, 0.03), (400.0, 0.0), (400.0, 1e9)] {
        assert!(Spring { stiffness, mass }.complaint().is_some(), "{stiffness} {mass}");
    }
}
