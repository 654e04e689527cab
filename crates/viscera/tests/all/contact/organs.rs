//! Two organs that are pressed together and opened again, a bar that is folded and shut: the shipped scenes.

use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};

use super::{inside, methods_or};

const PRESSED: &str = include_str!("../../../../../scenes/organs_pressed.toml");
const FOLD: &str = include_str!("../../../../../scenes/fold.toml");

fn simulation(text: &str, settings: &[(&str, &str)]) -> Simulation<f64> {
    let scene = Scene::parse("a scene", text, settings).expect("a legal scene");
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("meshes");
    Simulation::new(scene, assembly).expect("a simulation")
}

fn run_until(simulation: &mut Simulation<f64>, time: f64) {
    while simulation.time() < time - 1e-9 {
        simulation.advance_frame().expect("a frame");
    }
}

fn force(simulation: &Simulation<f64>, name: &str) -> Vec3<f64> {
    let patches = simulation.report().patches;
    let patch = patches.iter().find(|patch| patch.name == name).expect("a patch");
    Vec3::from_f64(patch.force)
}

/// The holder goes so far beyond the first touch [m].
const INDENTATION: f64 = 0.015;

/// Presses until a time [s], at which forces are in balance to a share of their size, and opens.
fn press(method: &str, settings: &[(&str, &str)], [pressed, end]: [f64; 2], balance: f64) {
    let settings: Vec<(&str, &str)> =
        settings.iter().copied().chain([("solver.method", method)]).collect();
    let mut simulation = simulation(PRESSED, &settings);
    run_until(&mut simulation, pressed);
    let [bed, holder] = ["bed", "holder"].map(|name| force(&simulation, name));
    let (off, inside) = ((bed + holder).length() / holder.length(), inside::count(&simulation));
    let pairs = simulation.state().contact.pairs.len();
    let judged = simulation.rest().is_some() || simulation.mesh_error().is_some();
    run_until(&mut simulation, end);
    let rest = simulation.assembly().builder.positions();
    let away = simulation.state().positions.iter().zip(rest).map(|(x, rest)| (*x - *rest).length());
    let away = away.fold(0.0, f64::max);
    println!(
        "{method}: {:.4} N on {pairs} pairs, off by {off:.1e}, {inside} inside; {:.2e} m from rest when open, {} rejected",
        holder.z,
        away,
        simulation.rejected_steps()
    );
    assert!(!judged, "{method}: the way to rest knows nothing of contact");
    assert!(holder.z < -0.3 && pairs > 10, "{method}: {holder:?}, {pairs} pairs");
    assert!(off < balance, "{method}: {bed:?} and {holder:?}, off by {off}");
    assert_eq!(inside, 0, "{method}");
    assert!(simulation.state().contact.pairs.is_empty(), "{method}: still in touch");
    assert!(away < 0.01 * INDENTATION, "{method}: {away} m from rest");
}

/// The same scene coarser, from nearer and in less time.
const FAST: [(&str, &str); 11] = [
    ("body.spleen.spacing", "18 mm"),
    ("body.kidney.spacing", "16 mm"),
    ("body.kidney.position", "[\"5 mm\", \"3 mm\", \"54 mm\"]"),
    ("motion.holder.half_space.point", "[0, 0, \"67 mm\"]"),
    ("motion.holder.keys.1.translation", "[0, 0, \"-23 mm\"]"),
    ("motion.holder.keys.2.translation", "[0, 0, \"-23 mm\"]"),
    ("motion.holder.keys.1.time", "0.2 s"),
    ("motion.holder.keys.2.time", "1.1 s"),
    ("motion.holder.keys.3.time", "1.3 s"),
    ("time.velocity_factor", "0.8"),
    ("time.duration", "2 s"),
];

#[test]
fn organs_that_are_pressed_together_push_alike_and_open_again() {
    press("quasi_newton", &FAST, [1.1, 1.8], 1e-3);
}

#[test]
#[ignore = "slow: the whole scene by two methods; explicit steps take a quarter of an hour"]
fn organs_that_are_pressed_together_push_alike_and_open_again_at_length() {
    for method in methods_or(&["quasi_newton", "xpbd"]) {
        press(method, &[], [4.5, 8.0], 1e-5);
    }
}

/// The upper half's force [N] on its holder, and samples inside, at a time [s] after it has been shut.
fn fold(method: &str, settings: &[(&str, &str)], time: f64) {
    let settings: Vec<(&str, &str)> =
        settings.iter().copied().chain([("solver.method", method)]).collect();
    let mut simulation = simulation(FOLD, &settings);
    run_until(&mut simulation, time);
    let (lid, inside) = (force(&simulation, "lid"), inside::count(&simulation));
    println!("{method}: {lid:?}, {inside} inside");
    assert!(lid.z < -0.5, "{method}: {lid:?}");
    assert_eq!(inside, 0, "{method}");
}

#[test]
fn a_bar_that_is_folded_and_shut_does_not_enter_itself() {
    fold("quasi_newton", &[("body.bar.cells_across", "2")], 2.1);
}

#[test]
#[ignore = "slow: the whole scene by two methods; explicit steps take five minutes"]
fn a_bar_that_is_folded_and_shut_does_not_enter_itself_at_length() {
    for method in methods_or(&["quasi_newton", "xpbd"]) {
        fold(method, &[], 3.0);
    }
}
