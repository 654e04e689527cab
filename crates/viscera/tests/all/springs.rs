//! Tools of a scene on springs: where they are, what they are felt by, and that they go on to the bit.

use viscera::contact::Spring;
use viscera::scalar::rigid::{RigidTransform, rotation_matrix};
use viscera::scalar::{Vec3, vec3};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};

use crate::hands::BLOCK;

/// Beside a tool that stands still, a ball that its spring presses on the block.
const BALL: &str = r#"
[[tool]]
name = "post"
kind = "sphere"
radius = "4 mm"
position = ["60 mm", 0, 0]

[[tool]]
name = "ball"
kind = "sphere"
radius = "8 mm"
position = ["15 mm", "15 mm", "24 mm"]
friction = 0.2
spring = "300 N/m"
mass = "50 g"
keys = [{ time = "0.3 s", translation = ["2 mm", 0, "-5 mm"], rotation_angle = "20 deg" }]
"#;

/// Jaws on a spring that press on the block, turned and half open.
const JAWS: &str = r#"
[[tool]]
name = "pliers"
kind = "grasper"
jaw_size = ["8 mm", "3 mm", "14 mm"]
jaw_gap = "2 mm"
position = ["15 mm", "15 mm", "33 mm"]
friction = 0.8
spring = "400 N/m"
jaw = [{ time = 0, angle = "30 deg" }]
keys = [{ time = "0.4 s", translation = ["2 mm", 0, "-7 mm"], rotation_angle = "20 deg" }]
"#;

fn simulation(text: &str, settings: &[(&str, &str)]) -> Simulation<f32> {
    let scene = Scene::parse("springs", text, settings).expect("a scene");
    let assembly = Assembly::new(&scene, &mut |name| panic!("{name}")).expect("an assembly");
    Simulation::new(scene, assembly).expect("a simulation")
}

fn advance(simulation: &mut Simulation<f32>, end: u64) {
    while simulation.frame() < end {
        simulation.advance_frame().expect("a frame");
    }
}

#[test]
fn a_tool_on_a_spring_is_felt_as_its_spring_and_its_tissue() {
    let mut simulation = simulation(&format!("{BLOCK}{BALL}"), &[]);
    let begun = simulation.held(1).and_then(|held| held.poses).expect("it is somewhere");
    assert_eq!(begun[0], begun[1]);
    advance(&mut simulation, 110);
    assert_eq!(simulation.held(0), None);
    let held = simulation.held(1).expect("it has moved");
    let [pose, hand] = held.poses.expect("it is somewhere");
    // The hand is where the keys say.
    let keys = vec3(0.017, 0.015, 0.019);
    assert!((hand.translation - keys).length() < 1e-12);
    let stretch = (pose.translation - keys) * 300.0;
    let force = Vec3::from_f64(simulation.tool_forces()[1].force);
    assert!(force.z > 0.1, "{force:?}");
    assert!((held.force - stretch).length() < 1e-4 * force.length(), "{held:?} {stretch:?}");
    assert!((force - stretch).length() < 2e-3 * force.length(), "{force:?} {stretch:?}");
    let torque = Vec3::from_f64(simulation.tool_forces()[1].torque);
    assert!((torque - held.torque).length() < 1e-5, "{torque:?} {:?}", held.torque);
    // What is drawn is the body, not the hand.
    let parts = simulation.tool_parts();
    assert!((parts[1].pose.translation - pose.translation).length() < 1e-12);
    assert!((simulation.tools()[1].pose.translation - keys).length() < 1e-12);
}

#[test]
fn jaws_on_a_spring_are_one_body() {
    let mut simulation = simulation(&format!("{BLOCK}{JAWS}"), &[]);
    advance(&mut simulation, 100);
    let held = simulation.held(0).expect("it has moved");
    let [pose, hand] = held.poses.expect("it is somewhere");
    let parts = simulation.tool_parts();
    assert_eq!(parts.len(), 2);
    // Both jaws are turned about the body's hinge by half of one angle each.
    let angle = simulation.jaw_angle(0).expect("jaws");
    assert!((angle - 30f64.to_radians()).abs() < 1e-12, "{angle}");
    let away = parts.iter().map(|part| pose.undo(part.pose.translation));
    let [a, b]: [Vec3<f64>; 2] = away.collect::<Vec<_>>().try_into().expect("two");
    assert!((a.z - b.z).abs() < 1e-12 && (a.y + b.y).abs() < 1e-12, "{a:?} {b:?}");
    // What pushes them up stretches the spring.
    let force = Vec3::from_f64(simulation.tool_forces()[0].force);
    assert!(force.z > 0.05, "{force:?}");
    let stretch = (pose.translation - hand.translation) * 400.0;
    assert!((force - stretch).length() < 5e-3 * force.length(), "{force:?} {stretch:?}");
    let torque = Vec3::from_f64(simulation.tool_forces()[0].torque);
    assert!((torque - held.torque).length() < 1e-5, "{torque:?} {:?}", held.torque);
}

#[test]
fn a_saved_tool_on_a_spring_goes_on_to_the_bit() {
    for (tools, middle) in [(BALL, 12), (JAWS, 40)] {
        let text = format!("{BLOCK}{tools}");
        for force_error in ["false", "true"] {
            let settings = [("output.force_error", force_error)];
            let mut whole = simulation(&text, &settings);
            advance(&mut whole, middle);
            let saved = whole.save();
            let mut resumed = simulation(&text, &settings).resume(&saved).expect("its own");
            assert_eq!(resumed.tool_parts(), whole.tool_parts());
            for simulation in [&mut whole, &mut resumed] {
                advance(simulation, middle + 20);
            }
            assert!(whole.state() == resumed.state(), "{tools}");
            assert_eq!(whole.held(0), resumed.held(0));
            assert!(whole.save() == resumed.save());
        }
    }
}

/// A hand takes a tool on a spring over, and later it is put away; another comes.
#[test]
fn hands_lead_tools_on_springs() {
    let text = format!("{BLOCK}{BALL}");
    let mut simulation = simulation(&text, &[]);
    advance(&mut simulation, 10);
    let place = vec3(0.012, 0.014, 0.0215);
    let pose =
        RigidTransform { rotation: rotation_matrix(vec3(0.1, 0.0, 0.0)), translation: place };
    simulation.move_tool(1, pose).expect("moved");
    advance(&mut simulation, 70);
    let held = simulation.held(1).expect("held");
    let [at, hand] = held.poses.expect("somewhere");
    assert!((hand.translation - place).length() < 1e-12);
    assert!(at.translation.z > place.z + 1e-4, "{at:?}");
    // The post goes: the ball stays what it is, under another number of parts.
    simulation.put_away(0).expect("put away");
    advance(&mut simulation, 90);
    let later = simulation.held(1).expect("still held");
    let apart = later.poses.expect("somewhere")[0].translation - at.translation;
    assert!(apart.length() < 1e-5, "{apart:?}");
    simulation.put_away(1).expect("put away");
    advance(&mut simulation, 92);
    assert_eq!(simulation.held(1), None);
    assert!(simulation.state().contact.held.is_empty());
}

#[test]
fn what_is_no_spring_is_told() {
    let wrong = |from: &str, to: &str| {
        let text = format!("{BLOCK}{BALL}").replace(from, to);
        Scene::parse("springs", &text, &[]).map(|_| ()).expect_err("wrong").to_string()
    };
    let error = wrong("spring = \"300 N/m\"\n", "");
    assert!(error.contains("`mass` means nothing without `spring`"), "{error}");
    assert!(wrong("300 N/m", "-3 N/m").contains("spring"));
    assert!(wrong("300 N/m", "3 kPa").contains("a pressure where a stiffness is needed"));
    assert!(wrong("50 g", "50 mm").contains("a length where a mass is needed"));
    assert!(Spring { stiffness: f64::INFINITY, mass: 0.1 }.complaint().is_some());
}
