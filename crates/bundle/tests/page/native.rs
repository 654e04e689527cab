//! The browser computes what the library computes elsewhere.

use viscera::scalar::{Real, Vec3};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::gpu::Adapter;
use viscera_resources::BUILT_IN;
use viscera_web::catalog::mesh_settings;

use crate::browser::{Kind, Tab};
use crate::page::{numbers, open};

/// A built-in scene with settings laid over it, as the page's link has them.
fn assembled(name: &str, mesh: f64, settings: &[(&str, &str)]) -> (Scene, Assembly) {
    let scene = BUILT_IN.iter().find(|scene| scene.name == name).expect("a built-in scene");
    let plain = Scene::parse(name, scene.text, settings).expect("a legal scene");
    // As the page does: 1 leaves what is written alone.
    let sizes = if mesh == 1.0 { Vec::new() } else { mesh_settings(&plain, mesh) };
    let sizes = sizes.iter().map(|(key, value)| (key.as_str(), value.as_str()));
    let all: Vec<(&str, &str)> = settings.iter().copied().chain(sizes).collect();
    let scene = Scene::parse(name, scene.text, &all).expect("a legal scene");
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("meshes");
    (scene, assembly)
}

fn advanced<S: Real>(mut simulation: Simulation<S>, frames: u32) -> Vec<f64> {
    (0..frames).for_each(|_| simulation.advance().expect("a frame"));
    let places = &simulation.state().positions;
    places.iter().flat_map(|x: &Vec3<S>| x.cast::<f64>().to_array()).collect()
}

fn link(name: &str, mesh: f64, settings: &[(&str, &str)]) -> String {
    let settings: String = settings.iter().map(|(key, value)| format!("&{key}={value}")).collect();
    format!("#scene={name}&mesh={mesh}{settings}")
}

/// The tetrahedra's vertices [m] after so many frames from rest in the browser.
fn in_browser(tab: &Tab, frames: u32) -> Vec<f64> {
    tab.evaluate("viscera.pause()");
    tab.evaluate("viscera.worker.post('reset')");
    tab.evaluate(&format!("viscera.step({frames})"));
    numbers(tab, "viscera.vertices(0)")
}

fn compare_bits(scenes: &[&str], mesh: f64, frames: u32) {
    for name in scenes {
        let settings = [("solver.device", "cpu"), ("solver.accuracy", "standard")];
        let Some(tab) = open(Kind::Plain, &link(name, mesh, &settings)) else { return };
        let found = in_browser(&tab, frames);
        let (scene, assembly) = assembled(name, mesh, &settings);
        let simulation = Simulation::<f32>::new(scene, assembly).expect("a simulation");
        let expected = advanced(simulation, frames);
        assert_eq!(found.len(), expected.len(), "{name}");
        // Single precision on both sides; the last digit of a double is lost in the text between them.
        let pairs = found.iter().map(|x| *x as f32).zip(expected.iter().map(|x| *x as f32));
        let apart: Vec<_> = pairs.enumerate().filter(|(_, (a, b))| a != b).collect();
        let first = &apart[..apart.len().min(3)];
        assert!(apart.is_empty(), "{name}: {} of {} differ: {first:?}", apart.len(), found.len());
    }
}

const THREE: [&str; 3] = ["cantilever", "liver_lifted", "grab"];

/// Quasi-Newton steps of recovered-gradient tetrahedra, and explicit ones: SIMD128 gives the bits of AVX2.
#[test]
fn the_cpu_gives_the_same_bits() {
    compare_bits(&THREE, 1.6, 60);
}

#[test]
#[ignore = "slow: 600 frames of three scenes, twice"]
fn the_cpu_gives_the_same_bits_at_length() {
    compare_bits(&THREE, 1.0, 600);
}

/// Both are compared with double precision: the browser's device may be twice as far from it as the native one.
#[test]
fn the_device_is_as_near_to_double_precision_as_a_native_one() {
    for (name, mesh) in [("cantilever", 1.6), ("grab", 2.0)] {
        let settings = [("solver.method", "xpbd"), ("solver.device", "gpu")];
        let Some(tab) = open(Kind::Gpu, &link(name, mesh, &settings)) else { return };
        // Of ten steps each: software needs seconds for a frame.
        let found = in_browser(&tab, 6);
        assert_eq!(tab.evaluate("viscera.state().report.runs[0].substeps"), 10);
        let on_gpu = tab.evaluate("viscera.state().report.runs[0].onGpu");
        assert_eq!(on_gpu, true, "a device computes");
        let (scene, assembly) = assembled(name, mesh, &settings);
        let device = Adapter::find(None).and_then(|adapter| adapter.open()).expect("a device");
        let native = Simulation::<f32>::on_device(scene, assembly, &device).expect("a simulation");
        let native = advanced(native, 6);
        let on_cpu =
            [("solver.method", "xpbd"), ("solver.device", "cpu"), ("solver.precision", "f64")];
        let (scene, assembly) = assembled(name, mesh, &on_cpu);
        let truth = advanced(Simulation::<f64>::new(scene, assembly).expect("a simulation"), 6);
        let distance = |other: &[f64]| crate::page::farthest(&truth, other);
        let (browser, native) = (distance(&found), distance(&native));
        println!("{name}: {browser:.2e} m in the browser, {native:.2e} m natively");
        assert!(browser <= 2.0 * native, "{name}: {browser} m in the browser, {native} m natively");
    }
}

/// A soft block on a table, and a ball that is pressed into it and dragged aside. A device that is named has the quasi-Newton
/// method, its elements and its tools; software needs seconds for a frame of it.
const PRESSED: &str = r#"
world = { gravity = 0 }
solver = { device = "gpu" }

[[body]]
name = "block"
shape = "block"
size = ["30 mm", "30 mm", "15 mm"]
cells = [3, 3, 2]
material = { young = "10 kPa", poisson = 0.4 }

[[fixing]]
name = "table"
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }

[[tool]]
name = "ball"
kind = "sphere"
radius = "6 mm"
friction = 0.5
position = ["15 mm", "15 mm", "21 mm"]
keys = [{ time = "0.05 s", translation = ["0.5 mm", 0, "-2 mm"] }]
"#;

/// Frames until the ball is where it goes.
const PRESSED_FRAMES: u32 = 3;

fn pressed(settings: &[(&str, &str)]) -> (Scene, Assembly) {
    let scene = Scene::parse("pressed.toml", PRESSED, settings).expect("a legal scene");
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("meshes");
    (scene, assembly)
}

/// Where vertices are [m], and the force on the tissue [N].
fn pressed_by<S: Real>(mut simulation: Simulation<S>) -> (Vec<f64>, [f64; 3]) {
    (0..PRESSED_FRAMES).for_each(|_| simulation.advance().expect("a frame"));
    let force = simulation.tool_forces()[0].force.map(|component| -component);
    (advanced(simulation, 0), force)
}

#[test]
fn tools_on_the_device_press_as_they_do_natively() {
    let Some(tab) = open(Kind::Gpu, crate::page::BAR) else { return };
    let scene = serde_json::json!({ "name": "pressed.toml", "text": PRESSED, "files": {} });
    let order = serde_json::json!({ "own": scene, "settings": [], "mesh": 1, "measure": false });
    tab.evaluate("viscera.pause()");
    tab.evaluate(&format!("viscera.worker.post('load', {order})"));
    let found = in_browser(&tab, PRESSED_FRAMES);
    let report = tab.evaluate("viscera.state().report.runs[0]");
    let in_force = ["onGpu", "method", "elements"].map(|key| report[key].to_string());
    assert_eq!(in_force, ["true", "\"quasi_newton\"", "\"recovered\""], "{report}");
    let force = &report["tools"][0]["force"];
    let force: [f64; 3] = std::array::from_fn(|axis| force[axis].as_f64().expect("a force"));

    let (scene, assembly) = pressed(&[]);
    let device = Adapter::find(None).and_then(|adapter| adapter.open()).expect("a device");
    let native = Simulation::<f32>::on_device(scene, assembly, &device).expect("a simulation");
    let (native, native_force) = pressed_by(native);
    let (scene, assembly) = pressed(&[("solver.device", "cpu"), ("solver.precision", "f64")]);
    let truth = pressed_by(Simulation::<f64>::new(scene, assembly).expect("a simulation"));

    let distance = |other: &[f64]| crate::page::farthest(&truth.0, other);
    let (browser, native) = (distance(&found), distance(&native));
    println!("{browser:.2e} m in the browser, {native:.2e} m natively");
    assert!(browser <= 2.0 * native, "{browser} m in the browser, {native} m natively");
    let size =
        |force: [f64; 3]| force.map(|component| component * component).iter().sum::<f64>().sqrt();
    let between = size(std::array::from_fn(|axis| force[axis] - native_force[axis]));
    println!("{force:?} N in the browser, {native_force:?} N natively, {:?} N", truth.1);
    assert!(size(native_force) > 0.1, "the ball presses: {native_force:?} N");
    assert!(between < 0.03 * size(native_force), "{force:?} N, natively {native_force:?} N");
}
