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
