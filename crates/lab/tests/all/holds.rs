//! A point that is held by springs pulls with the force that Newton's method finds.

use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::simulation::{Assembly, PatchForce, PatchKind, Simulation};
use viscera_reference::Reference;

/// A liver in its ligaments, a point of whose lower edge is lifted, as a hand in a window does.
const LIVER: &str = r#"
[time]
duration = "6 s"
velocity_factor = 0.95

[[body]]
name = "liver"
shape = "liver"
material = { preset = "liver" }

[[fixing]]
name = "ligament"
body = "liver"
half_space = { point = [0, 0, "52 mm"], normal = [0.2, 0.4, 1] }

[[motion]]
name = "hand"
body = "liver"
nearest = { point = ["-45 mm", "-40 mm", "-62 mm"], count = 8 }
stiffness = "200 N/m"
interpolation = "linear"
keys = [{ time = "0.5 s", translation = [0, "-10 mm", "30 mm"] }]
"#;

fn hand(forces: &[PatchForce]) -> Vec3<f64> {
    let hand = forces.iter().find(|patch| patch.kind == PatchKind::Motion).expect("the hand");
    Vec3::from_f64(hand.force)
}

#[test]
fn a_held_point_pulls_with_the_force_of_the_reference() {
    let scene = Scene::parse("liver.toml", LIVER, &[]).expect("a scene");
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    let frames = scene.frame_count();
    let mut simulation = Simulation::<f32>::new(scene.clone(), assembly.clone()).expect("a model");
    for _ in 0..frames {
        simulation.advance().expect("a frame");
    }
    simulation.measure().expect("measures");
    let found = hand(&simulation.report().patches);

    let exact = Simulation::<f64>::new(scene, assembly).expect("a model");
    let time = simulation.time();
    let inputs = exact.inputs_at(time);
    let mut reference = Reference::with_elements(exact.model(), exact.solver().elements);
    let near: Vec<Vec3<f64>> = simulation.state().positions.iter().map(|x| x.cast()).collect();
    let rest = reference.settle(&near, &inputs).expect("a state of rest").positions;
    let none = vec![Vec3::ZERO; rest.len()];
    let expected = hand(&exact.patch_forces_at(time, &rest, &none));
    let away = (found - expected).length() / expected.length();
    println!("the hand pulls with {found:?} N; at rest with {expected:?} N; {away:.1e} apart");
    assert!(expected.length() > 0.5 && away < 0.01, "{found:?} N, not {expected:?} N");
}
