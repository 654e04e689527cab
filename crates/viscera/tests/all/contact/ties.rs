//! Ties between surfaces, and what a scene may not ask of bodies that meet.

use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};

/// A plate over a block, 1.5 mm apart and tied; the plate's upper face is led.
const TIED: &str = r#"
[time]
duration = "1 s"
velocity_factor = 0.9
[world]
gravity = 0
[[body]]
name = "block"
shape = "block"
size = ["20 mm", "20 mm", "8 mm"]
cells = [4, 4, 2]
material = { young = "10 kPa", poisson = 0.4, viscosity = "5 ms" }
[[body]]
name = "plate"
shape = "block"
size = ["20 mm", "20 mm", "4 mm"]
cells = [4, 4, 1]
position = [0, 0, "9.5 mm"]
material = { young = "10 kPa", poisson = 0.4, viscosity = "5 ms" }
[[fixing]]
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
[[motion]]
name = "hand"
body = "plate"
half_space = { point = [0, 0, "13.5 mm"], normal = [0, 0, 1] }
keys = [{ time = "0.1 s" }, { time = "0.5 s", translation = [0, 0, "2 mm"] }]
[[tie]]
name = "bed"
from = { body = "plate", half_space = { point = [0, 0, "9.5 mm"], normal = [0, 0, -1] } }
to = { body = "block", half_space = { point = [0, 0, "8 mm"], normal = [0, 0, 1] } }
distance = "2 mm"
stiffness = "2 kPa/mm"
strength = "3 kPa"
"#;

fn assembled(text: &str, settings: &[(&str, &str)]) -> Result<(Scene, Assembly), String> {
    let scene = Scene::parse("tied.toml", text, settings).map_err(|error| error.to_string())?;
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    assembly.map(|assembly| (scene, assembly)).map_err(|error| error.to_string())
}

/// The pull [N] on the hand after so many frames, how many ties are torn and how many there are.
fn pulled(settings: &[(&str, &str)], frames: u32) -> (f64, usize, usize) {
    let (scene, assembly) = assembled(TIED, settings).expect("a scene");
    let mut simulation = Simulation::<f64>::new(scene, assembly).expect("a simulation");
    (0..frames).for_each(|_| simulation.advance_frame().expect("a frame"));
    let torn = &simulation.state().contact.torn;
    let patches = simulation.report().patches;
    let hand = patches.iter().find(|patch| patch.name == "hand").expect("a force on the hand");
    (hand.force[2], torn.iter().filter(|torn| **torn).count(), torn.len())
}

/// A tie of `k` per area on an area `A`, in a row with two layers of tissue: `F = A w/(1/k + 12 mm/E)` for a way `w`, if the sides
/// did not draw in.
#[test]
fn ties_pull_as_stiff_as_they_are_said_to_be() {
    for method in ["quasi_newton", "xpbd", "explicit"] {
        let (still, torn, count) = pulled(&[("solver.method", method)], 5);
        assert!(still.abs() < 1e-6 && torn == 0 && count > 0, "{method}: {still} N without a pull");
        let (force, torn, _) = pulled(&[("solver.method", method)], 50);
        let row = 1.0 / 2e6 + 0.012 / 1e4;
        let expected = 4e-4 * 2e-3 / row;
        println!("{method}: {force} N, {expected} N of free columns, {torn} of {count} torn");
        assert_eq!(torn, 0, "{method}");
        // Tissue that is held at both ends is up to a third stiffer than free columns.
        assert!((1.0..1.35).contains(&(force / expected)), "{method}: {force} and {expected}");
    }
}

#[test]
fn ties_tear_and_then_let_go() {
    let (force, torn, count) = pulled(&[("tie.bed.strength", "0.5 kPa")], 50);
    assert_eq!(torn, count);
    assert!(force.abs() < 1e-4, "{force}");
    let (force, torn, _) = pulled(&[("tie.bed.strength", "1 MPa")], 50);
    assert!(torn == 0 && force > 0.3, "{force} {torn}");
}

#[test]
fn what_cannot_be_tied_or_overlaps_is_told() {
    // The hand takes the upper face wherever it is.
    let lower = TIED.replace("point = [0, 0, \"13.5 mm\"]", "point = [0, 0, \"9 mm\"]");
    let moved = |from: &str, to: &str| assembled(&lower.replace(from, to), &[]);
    let wrong = |from: &str, to: &str| moved(from, to).expect_err("an error");
    let same = wrong("to = { body = \"block\"", "to = { body = \"plate\"");
    assert!(same.contains("ties body `plate` to itself"), "{same}");
    let far = wrong("distance = \"2 mm\"", "distance = \"0.5 mm\"");
    assert!(far.contains("within 0.500 mm") && far.contains("1.5"), "{far}");
    let place = "position = [0, 0, \"9.5 mm\"]";
    let deep = wrong(place, "position = [0, 0, \"6 mm\"]");
    assert!(deep.contains("overlap by 2.") && deep.contains("contact.bodies"), "{deep}");
    let notes = moved(place, "position = [0, 0, \"7.6 mm\"]").expect("a scene").1.notes;
    assert!(notes.iter().any(|note| note.contains("overlap by up to 0.40 mm")), "{notes:?}");
}
