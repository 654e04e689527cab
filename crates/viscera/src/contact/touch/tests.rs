use super::*;
use crate::contact::ContactLaw;
use crate::scalar::vec3;

const FOUNDATION: Foundation = Foundation { area: 4e-6, stiffness: 1e7, thickness: 1e-3 };

fn ball(radius: f64) -> Tool {
    Tool {
        pose: RigidTransform::about(Vec3::ZERO, vec3(0.1, 0.4, -0.2), vec3(0.01, 0.02, 0.03)),
        law: ContactLaw { friction: 0.5, ..ContactLaw::default() },
        ..Tool::new(Shape::Sphere { radius })
    }
}

fn find(
    tool: &Tool,
    start: &RigidTransform,
    moved: Moved,
    kept: Option<&Touch>,
) -> Option<Touching> {
    Touching::find((7, FOUNDATION), (0, tool), start, &moved, kept)
}

fn feel(touching: &Touching, tool: &Tool, place: Vec3<f64>) -> Felt {
    touching.feel(Placed { shape: &tool.shape, pose: &tool.pose }, place)
}

/// A touch of a ball that rests at a place [m] of the world and presses with 0.02 N.
fn rested(tool: &Tool, place: Vec3<f64>) -> Touch {
    let local = tool.pose.undo(place);
    let (normal, offset) = tool.shape.tangent(local, &tool.shape.distance(local));
    Touch {
        sample: 7,
        tool: 0,
        anchor: tool.pose.undo(place + vec3(1e-5, 2e-5, -1e-5)),
        normal,
        offset,
        pressed: 0.02,
        force: Vec3::ZERO,
        place,
        is_tied: false,
    }
}

#[test]
fn forces_are_slopes_and_curvatures_cover_their_change() {
    let tool = ball(5e-3);
    let center = tool.pose.translation;
    let out = vec3(0.36, 0.48, 0.8);
    for depth in [-0.2e-3, 0.3e-3, 0.7e-3] {
        let place = center + out * (5e-3 + depth);
        let still = Moved { from: place, to: place };
        let touch = rested(&tool, place);
        let planes = find(&tool, &tool.pose, still, Some(&touch)).expect("in contact");
        let live = Touching { side: Side::Live, friction: None, ..planes };
        let tied = Touching { is_tied: true, ..planes };
        for touching in [planes, live, tied] {
            let felt = feel(&touching, &tool, place);
            let h = 1e-9;
            let moved = |axis: usize, sign: f64| {
                let mut step = Vec3::ZERO;
                step[axis] = sign * h;
                feel(&touching, &tool, place + step)
            };
            let bound = felt.curvature() + Mat3::IDENTITY * felt.turning;
            for axis in 0..3 {
                let [a, b] = [1.0, -1.0].map(|sign| moved(axis, sign));
                let slope = (b.energy - a.energy) / (2.0 * h);
                assert!((slope - felt.force[axis]).abs() < 1e-6, "{slope} {:?}", felt.force);
                let second = (b.force - a.force) * (0.5 / h);
                // What the bound leaves of the true second derivative is not negative along the axis.
                let along = bound.columns[axis][axis] - second[axis];
                assert!(along > -1e-4 * bound.norm_squared().sqrt(), "{axis}: {along}");
            }
        }
    }
}

#[test]
fn at_rest_a_plane_is_the_distance() {
    let tool = ball(5e-3);
    let place = tool.pose.translation + vec3(0.0, 0.0, 5.4e-3);
    let touching = find(&tool, &tool.pose, Moved { from: place, to: place }, None).expect("near");
    let live = Touching { side: Side::Live, ..touching };
    let [plane, live] = [touching, live].map(|touching| feel(&touching, &tool, place));
    assert!(matches!(touching.side, Side::Plane { .. }));
    assert!((plane.distance - 0.4e-3).abs() < 1e-12);
    assert!((plane.force - live.force).length() < 1e-12);
    assert!(plane.force.z > 0.0);
}

#[test]
fn a_thin_tool_that_jumps_past_leaves_its_plane_on_the_side_it_came_from() {
    let mut tool = ball(1e-3);
    let start = tool.pose;
    // Straight through the sample, which lies 20 mm above, and on.
    let place = start.translation + vec3(0.0, 0.0, 0.02);
    tool.pose.translation += vec3(0.0, 0.0, 0.05);
    let touching = find(&tool, &start, Moved { from: place, to: place }, None).expect("met");
    let felt = feel(&touching, &tool, place);
    assert!(felt.distance < -0.02 && felt.force.z > 0.0, "{felt:?}");
    // Beside the path there is no wall.
    let beside = place + vec3(3e-3, 0.0, 0.0);
    let touching = find(&tool, &start, Moved { from: beside, to: beside }, None).expect("near");
    assert_eq!(touching.side, Side::Live);
    assert_eq!(feel(&touching, &tool, beside).energy, 0.0);
}

#[test]
fn what_is_far_away_is_left_out() {
    let tool = ball(5e-3);
    let far = tool.pose.translation + vec3(0.02, 0.0, 0.0);
    assert_eq!(find(&tool, &tool.pose, Moved { from: far, to: far }, None), None);
}

#[test]
fn a_deep_sample_keeps_the_side_that_it_came_from() {
    let tool = ball(4e-3);
    // Just past the middle, seen from where it came.
    let place = tool.pose.translation + vec3(0.0, 0.0, -0.5e-3);
    let mut touch = rested(&tool, place);
    (touch.normal, touch.offset) = (tool.pose.turn_back(vec3(0.0, 0.0, 1.0)), 4e-3);
    let still = Moved { from: place, to: place };
    let felt = feel(&find(&tool, &tool.pose, still, Some(&touch)).expect("deep"), &tool, place);
    assert!(felt.force.z > 0.0 && (felt.distance + 4.5e-3).abs() < 1e-12, "{felt:?}");
    let forgotten = feel(&find(&tool, &tool.pose, still, None).expect("deep"), &tool, place);
    assert!(forgotten.force.z < 0.0);
}

#[test]
fn an_anchor_follows_only_as_far_as_friction_gives_way() {
    let tool = ball(5e-3);
    let place = tool.pose.translation + vec3(0.0, 0.0, 5.5e-3);
    let still = Moved { from: place, to: place };
    let touch = rested(&tool, place);
    let touching = find(&tool, &tool.pose, still, Some(&touch)).expect("in contact");
    let felt = feel(&touching, &tool, place);
    let kept = touching.keep(&tool, place, &felt).expect("pressed");
    // A small slip stays to the bit of round-off: nothing creeps.
    let slip = |touch: &Touch, at: Vec3<f64>| {
        tangential(at - tool.pose.apply(touch.anchor), felt.normal).length()
    };
    assert!((slip(&kept, place) - slip(&touch, place)).abs() < 1e-15);
    // A large one is cut to what the smaller of both normal forces holds.
    let far = place + vec3(2e-3, 0.0, 0.0);
    let felt = feel(&touching, &tool, far);
    let kept = touching.keep(&tool, far, &felt).expect("pressed");
    let stiffness = touching.friction.expect("kept").stiffness;
    let most = 0.5 * felt.pressed.min(0.02);
    assert!((stiffness * slip(&kept, far) - most).abs() < 1e-9 * most);
    // What has left is forgotten.
    let away = place + vec3(0.0, 0.0, 1e-3);
    assert_eq!(touching.keep(&tool, away, &feel(&touching, &tool, away)), None);
}

#[test]
fn in_explicit_motion_friction_is_that_of_the_present_normal_force() {
    let tool = ball(5e-3);
    let placed = Placed { shape: &tool.shape, pose: &tool.pose };
    let place = tool.pose.translation + vec3(0.0, 0.0, 5.5e-3);
    let still = Moved { from: place, to: place };
    let mut touching = find(&tool, &tool.pose, still, None).expect("in contact");
    // A contact that has just begun holds from then on.
    assert_eq!(touching.slip(&tool, placed, place), feel(&touching, &tool, place));
    let stiffness = touching.friction.expect("pressed").stiffness;
    let aside = |way: f64| place + vec3(way, 0.0, 0.0);
    let friction = |felt: &Felt| felt.force - felt.normal * felt.pressed;
    let held = touching.slip(&tool, placed, aside(1e-6));
    assert!((friction(&held).length() - stiffness * 1e-6).abs() < 1e-6 * stiffness * 1e-6);
    // It slides at mu times what presses now, and its anchor comes after.
    let slid = touching.slip(&tool, placed, aside(1e-3));
    assert!(slid.pressed > 0.0 && friction(&slid).x < 0.0);
    assert!((friction(&slid).length() / (0.5 * slid.pressed) - 1.0).abs() < 1e-12);
    // On the way back it lets go of that before it pulls the other way.
    let back = touching.slip(&tool, placed, aside(1e-3 - 1e-6));
    assert!(friction(&back).x < 0.0);
    assert!((friction(&slid) - friction(&back)).length() > 0.9e-6 * stiffness);
    // What leaves forgets where it was.
    let away = place + vec3(0.0, 0.0, 1e-3);
    assert_eq!(touching.slip(&tool, placed, away).force, Vec3::ZERO);
    assert_eq!(touching.friction, None);
}

#[test]
fn a_lock_ties_what_is_pressed_and_lets_all_go_at_once() {
    let mut tool = ball(5e-3);
    tool.is_locked = true;
    let place = tool.pose.translation + vec3(0.0, 0.0, 5.5e-3);
    let still = Moved { from: place, to: place };
    let touching = find(&tool, &tool.pose, still, None).expect("in contact");
    let tied = touching.keep(&tool, place, &feel(&touching, &tool, place)).expect("pressed");
    assert!(tied.is_tied);
    // Pulled off by 2 mm it is held back, however weak the pressure was.
    let off = place + vec3(0.0, 0.0, 2e-3);
    let held = find(&tool, &tool.pose, Moved { from: off, to: off }, Some(&tied)).expect("tied");
    let felt = feel(&held, &tool, off);
    assert!(felt.force.z < 0.0 && felt.pressed == 0.0);
    let still_tied = held.keep(&tool, off, &felt).expect("tied");
    assert_eq!(still_tied.anchor, tied.anchor);
    tool.is_locked = false;
    assert_eq!(held.keep(&tool, off, &felt), None);
}

/// A fork whose prongs are 4 mm thick and 8 mm apart, on both sides of the plane x = 0.
fn fork() -> Tool {
    let surface = crate::contact::distance_grid::tests::fork();
    let grid = crate::contact::DistanceGrid::new(&surface, 1e-3).expect("a fork");
    Tool::new(Shape::Mesh(std::sync::Arc::new(grid)))
}

/// The plane that a sample has met is the one that it keeps: the outermost plane of that normal is another prong's.
#[test]
fn a_deep_sample_of_a_fork_keeps_the_plane_that_it_has_met() {
    let tool = fork();
    let met = vec3(4.2e-3, 0.0, -0.01);
    let still = Moved { from: met, to: met };
    let touching = find(&tool, &tool.pose, still, None).expect("in contact");
    let kept = touching.keep(&tool, met, &feel(&touching, &tool, met)).expect("pressed");
    assert!((kept.normal - vec3(-1.0, 0.0, 0.0)).length() < 1e-3);
    assert!((kept.offset + 4e-3).abs() < 1e-5, "{}", kept.offset);
    let deep = vec3(4.9e-3, 0.0, -0.01);
    let touching =
        find(&tool, &tool.pose, Moved { from: deep, to: deep }, Some(&kept)).expect("deep");
    let felt = feel(&touching, &tool, deep);
    assert!((felt.distance + 0.9e-3).abs() < 1e-5 && felt.force.x < 0.0, "{felt:?}");
}

#[test]
fn what_goes_between_the_prongs_of_a_fork_meets_nothing() {
    let mut tool = fork();
    let start = tool.pose;
    for (aside, place) in [(0.0, -0.03), (2.6e-3, -0.03), (-2.6e-3, -0.04), (2.6e-3, -0.02)] {
        // Up by 20 mm in the step, with the fork coming down by as much.
        tool.pose.translation = vec3(0.0, 0.0, -0.01);
        let from = vec3(aside, 0.0, place);
        let moved = Moved { from, to: from + vec3(0.0, 0.0, 0.01) };
        if let Some(touching) = find(&tool, &start, moved, None) {
            assert_eq!(touching.side, Side::Live, "{aside} {place}");
            assert_eq!(feel(&touching, &tool, moved.to).energy, 0.0);
        }
    }
    // Below a prong there is one.
    let from = vec3(6e-3, 0.0, -0.03);
    let moved = Moved { from, to: from + vec3(0.0, 0.0, 0.01) };
    let felt = feel(&find(&tool, &start, moved, None).expect("met"), &tool, moved.to);
    assert!(felt.force.z < 0.0 && felt.distance < 0.0, "{felt:?}");
}

/// Of a distance that is interpolated: force and stiffness have the gradient's length.
#[test]
fn forces_at_a_mesh_are_slopes_of_its_energy() {
    let tool = fork();
    let mut bent = 0;
    for i in 1..200 {
        let at = |step: f64| (f64::from(i) * step) % 1.0;
        let place = vec3(8.1e-3 + 0.7e-3 * at(0.61), 2e-3 * at(0.75) - 1e-3, 4e-3 * at(0.57));
        let touching = Touching {
            sample: 0,
            tool: 0,
            foundation: FOUNDATION,
            side: Side::Live,
            friction: None,
            is_tied: false,
        };
        let felt = feel(&touching, &tool, place);
        let h = 1e-9;
        let mut slope = Vec3::ZERO;
        let mut jumps = false;
        for axis in 0..3 {
            let mut step = Vec3::ZERO;
            step[axis] = h;
            let [a, b] = [1.0, -1.0].map(|sign| feel(&touching, &tool, place + step * sign));
            slope[axis] = (b.energy - a.energy) / (2.0 * h);
            jumps |= (a.normal - b.normal).length() > 1e-4;
            let second = (b.force - a.force)[axis] / (2.0 * h);
            let bound = felt.curvature().columns[axis][axis] + felt.turning;
            assert!(jumps || second <= bound + 1e-3 * felt.stiffness, "{second} {bound}");
        }
        assert!(jumps || (slope - felt.force).length() < 1e-6, "{slope:?} {felt:?}");
        let distance = tool.distance(place);
        let wanted = FOUNDATION.squeeze(felt.distance).force * distance.slope;
        assert!((felt.pressed - wanted).abs() < 1e-15);
        bent += u32::from((distance.slope - 1.0).abs() > 1e-3 && felt.pressed > 0.0);
    }
    assert!(bent > 20, "{bent}");
}
