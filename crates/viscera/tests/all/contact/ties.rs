//! Ties between surfaces, and what a scene may not ask of bodies that meet.

use crate::common::tied::{TIED, held};
use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};

fn assembled(text: &str, settings: &[(&str, &str)]) -> Result<(Scene, Assembly), String> {
    let scene = Scene::parse("tied.toml", text, settings).map_err(|error| error.to_string())?;
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    assembly.map(|assembly| (scene, assembly)).map_err(|error| error.to_string())
}

/// The pull [N] on the hand after so many frames, how many ties are torn and how many there are.
fn pulled(settings: &[(&str, &str)], frames: u32) -> (f64, usize, usize) {
    pulled_in(TIED, settings, frames)
}

fn pulled_in(text: &str, settings: &[(&str, &str)], frames: u32) -> (f64, usize, usize) {
    let (scene, assembly) = assembled(text, settings).expect("a scene");
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

/// Where both sides are held as a whole, ties are stretched by the way of one: they tear where `k w` is more than the strength,
/// and pull with `k w A` before. The report says so.
#[test]
fn ties_tear_at_their_strength_and_reports_say_so() {
    for (strength, tears) in [("4.02 kPa", false), ("3.98 kPa", true)] {
        let settings = [("tie.bed.strength", strength)];
        let (scene, assembly) = assembled(&held(), &settings).expect("a scene");
        let mut simulation = Simulation::<f64>::new(scene, assembly).expect("a simulation");
        let at_rest = Vec3::<f64>::from_f64(simulation.tie_forces()[0].force).length();
        assert!(at_rest < 1e-12, "{at_rest} N at rest");
        (0..50).for_each(|_| simulation.advance_frame().expect("a frame"));
        let report = simulation.report();
        let torn = &simulation.state().contact.torn;
        let tie = &report.ties[0];
        assert_eq!((tie.name.as_str(), tie.points), ("bed", torn.len()));
        assert_eq!(torn.iter().filter(|torn| **torn).count(), if tears { torn.len() } else { 0 });
        assert_eq!(tie.torn, if tears { tie.points } else { 0 });
        // On the plate's lower face.
        let expected = if tears { 0.0 } else { 4e-4 * 4e3 };
        let hand = report.patches.iter().find(|patch| patch.name == "hand").expect("a hand");
        let [pulled, pulls] = [hand.force[2], -tie.force[2]];
        assert!((pulled - expected).abs() < 1e-6, "{strength}: {pulled} of {expected}");
        assert!((pulls - expected).abs() < 1e-6, "{strength}: {pulls} of {expected}");
    }
}

/// Samples of a plate that is wider than what it is tied to hang on its border, askew: at rest they pull nowhere.
#[test]
fn ties_to_a_border_do_not_pull_at_rest() {
    let wide = TIED
        .replace(
            "size = [\"20 mm\", \"20 mm\", \"4 mm\"]",
            "size = [\"24 mm\", \"22 mm\", \"4 mm\"]",
        )
        .replace("distance = \"2 mm\"", "distance = \"5 mm\"");
    let (force, torn, count) = pulled_in(&wide, &[], 5);
    assert!(count > 0 && torn == 0 && force.abs() < 1e-9, "{force} {torn} {count}");
    let (scene, assembly) = assembled(&wide, &[]).expect("a scene");
    let mut simulation = Simulation::<f64>::new(scene, assembly).expect("a simulation");
    (0..5).for_each(|_| simulation.advance_frame().expect("a frame"));
    let moved = simulation.state().positions.iter().zip(&simulation.model().rest_positions);
    let far = moved.map(|(x, rest)| (*x - *rest).length()).fold(0.0, f64::max);
    assert!(far < 1e-12, "{far}");
}

/// Surfaces come closer by two thicknesses of contact at most in a step: a frame in which they would meet is divided.
#[test]
fn frames_in_which_bodies_would_meet_are_divided() {
    let (rest, _) = TIED.split_once("[[tie]]").expect("a tie");
    let falls = rest
        .replace("point = [0, 0, \"13.5 mm\"]", "point = [0, 0, \"9 mm\"]")
        .replace("\"9.5 mm\"", "\"62.5 mm\"")
        .replace(
            "{ time = \"0.5 s\", translation = [0, 0, \"2 mm\"] }",
            "{ time = \"0.2 s\", translation = [0, 0, \"-54 mm\"] }",
        );
    let settings = [("solver.substeps", "1"), ("contact.bodies", "true")];
    let (scene, assembly) = assembled(&falls, &settings).expect("a scene");
    let mut simulation = Simulation::<f64>::new(scene, assembly).expect("a simulation");
    // The plate over the block, whose upper face is at 8 mm [m].
    let gap = |simulation: &Simulation<f64>| {
        let range = simulation.assembly().bodies[1].vertices.clone();
        let heights = simulation.state().positions[range].iter().map(|x| x.z);
        heights.fold(f64::MAX, f64::min) - 0.008
    };
    let mut most = 0;
    for _ in 0..14 {
        let before = gap(&simulation);
        simulation.advance_frame().expect("a frame");
        let after = gap(&simulation);
        let way = before - after;
        let steps = if after < 1e-3 { (way / 2e-3).ceil().max(1.0) as u32 } else { 1 };
        assert_eq!(simulation.report().divided, steps, "from {before} to {after}");
        most = most.max(steps);
    }
    assert!(most > 2, "{most}");
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
