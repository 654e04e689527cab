//! Simulations saved and resumed: to the bit as if they had never stopped, by any threads and instructions, and
//! on a graphics processor; and bytes that are not those of the scene.

use crate::common::device::device;
use proptest::prelude::*;
use viscera::scalar::Real;
use viscera::scalar::lanes::Instructions::{Avx2, Portable};
use viscera::scene::Scene;
use viscera::settings::Method;
use viscera::simulation::{Assembly, ResumeError, Simulation};

/// A bar in an elastic bed, beside another that hangs from it; one is taken hold of on the way by springs, and
/// settings change twice, once before frame 37.
const SCENE: &str = r#"
time = { duration = "1 s", velocity_factor = 0.97 }

[contact]
bodies = false

[[body]]
name = "bar"
shape = "block"
size = ["40 mm", "20 mm", "20 mm"]
cells = [4, 2, 2]
material = { young = "8 kPa", poisson = 0.45, density = "1000 kg/m^3", viscosity = "20 ms" }

[[body]]
name = "weight"
shape = "block"
size = ["20 mm", "20 mm", "20 mm"]
cells = [2, 2, 2]
position = ["50 mm", 0, 0]
material = { young = "20 kPa", poisson = 0.3, density = "1000 kg/m^3", model = "saint_venant_kirchhoff" }

[[fixing]]
name = "bed"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
stiffness = "400 N/m"

[[motion]]
name = "grip"
body = "bar"
nearest = { point = ["40 mm", 0, "20 mm"], count = 3 }
start = "0.4 s"
stiffness = "60 N/m"
keys = [{ time = "0.4 s", translation = [0, 0, 0] }, { time = "0.9 s", translation = [0, "8 mm", "15 mm"] }]

[[spring]]
name = "tie"
stiffness = "50 N/m"
from = { body = "bar", nearest = { point = ["40 mm", 0, 0], count = 1 } }
to = { body = "weight", nearest = { point = ["50 mm", 0, 0], count = 1 } }

[[change]]
time = "0.3 s"
set = ['body.bar.material.young = "12 kPa"']

[[change]]
time = "0.8 s"
set = ['solver.iterations = 3']

[solver]
substeps = 3
"#;

/// The frame after which it is saved, and how many there are.
const SAVED: u64 = 37;
const FRAMES: u64 = 56;

fn scene(settings: &[(&str, &str)]) -> (Scene, Assembly) {
    let scene = Scene::parse("saved.toml", SCENE, settings);
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    let assembly = Assembly::new(&scene, &mut |name| Err(format!("no file {name}")));
    (scene, assembly.unwrap_or_else(|error| panic!("{error}")))
}

fn cpu<S: Real>(settings: &[(&str, &str)]) -> Simulation<S> {
    let settings = [&[("solver.device", "cpu")], settings].concat();
    let (scene, assembly) = scene(&settings);
    Simulation::new(scene, assembly).expect("a model")
}

fn advance<S: Real>(simulation: &mut Simulation<S>, end: u64) {
    while simulation.frame() < end {
        simulation.advance_frame().expect("a frame");
    }
}

/// All that is kept, the multipliers among it, and the report of the last frame.
fn bits<S: Real>(simulation: &Simulation<S>) -> (Vec<u8>, String) {
    let report = serde_json::to_string(&simulation.report()).expect("a report");
    (simulation.save(), report)
}

fn resumes_to_the_bit<S: Real>(settings: &[(&str, &str)], others: &[&str]) {
    let mut whole = cpu::<S>(settings);
    advance(&mut whole, SAVED);
    let saved = whole.save();
    advance(&mut whole, FRAMES);
    let expected = bits(&whole);
    for threads in others {
        for instructions in [Avx2, Portable] {
            let settings = [settings, &[("solver.threads", *threads)]].concat();
            let mut resumed = cpu::<S>(&settings).resume(&saved).expect("the same scene");
            resumed.use_instructions(instructions);
            assert_eq!(resumed.frame(), SAVED);
            advance(&mut resumed, FRAMES);
            assert!(bits(&resumed) == expected, "{settings:?}, {instructions:?}");
        }
    }
    // What was saved has moved, and goes on moving.
    let resumed = cpu::<S>(settings).resume(&saved).expect("the same scene");
    assert!(resumed.save() == saved && resumed.state().positions != whole.state().positions);
    assert!(resumed.state().positions != resumed.model().rest_positions);
}

#[test]
fn a_resumed_simulation_goes_on_to_the_bit() {
    resumes_to_the_bit::<f32>(&[], &["1", "3", "8"]);
    let anderson = [("solver.acceleration", "anderson"), ("solver.iterations", "6")];
    resumes_to_the_bit::<f32>(&anderson, &["3"]);
    // Its first sweeps know of no iterate of the step before.
    let chebyshev = [
        ("solver.acceleration", "chebyshev"),
        ("solver.chebyshev_damping", "0.8"),
        ("solver.iterations", "6"),
        ("solver.chebyshev_delay", "2"),
    ];
    resumes_to_the_bit::<f32>(&chebyshev, &["1"]);
    resumes_to_the_bit::<f32>(&[("solver.method", "explicit")], &["1"]);
    let quasi_newton = ("solver.method", "quasi_newton");
    resumes_to_the_bit::<f32>(&[quasi_newton, ("solver.history", "5")], &["3"]);
    let double =
        [quasi_newton, ("solver.integrator", "implicit_euler"), ("solver.precision", "f64")];
    resumes_to_the_bit::<f64>(&double, &["1"]);
    resumes_to_the_bit::<f64>(&[("solver.precision", "f64"), ("solver.colors", "1")], &["1"]);
}

/// Pairs that were kept with another number of them are found where they stand, and no more of them are used than asked
/// for; a part that has fewer than another has its own.
#[test]
fn a_simulation_goes_on_with_another_number_of_pairs() {
    let method = [
        ("solver.method", "quasi_newton"),
        ("body.bar.material.poisson", "0.3"),
        ("body.weight.material.poisson", "0.45"),
    ];
    let with = |history: Option<&'static str>| {
        let more = history.map(|history| ("solver.history", history));
        method.into_iter().chain(more).collect::<Vec<_>>()
    };
    for [kept, now] in [[Some("10"), None], [None, Some("10")], [Some("10"), Some("2")]] {
        let mut before = cpu::<f32>(&with(kept));
        advance(&mut before, SAVED);
        let mut usual = cpu::<f32>(&with(kept)).resume(&before.save()).expect("the same scene");
        let mut resumed = cpu::<f32>(&with(now)).resume(&before.save()).expect("the same scene");
        advance(&mut usual, FRAMES);
        advance(&mut resumed, FRAMES);
        let places = |simulation: &Simulation<f32>| simulation.state().positions.clone();
        let pairs = places(&usual).into_iter().zip(places(&resumed));
        let far = pairs.map(|(a, b)| (a - b).length()).fold(0.0, f32::max);
        assert!(far < 1e-3, "{kept:?} and then {now:?}: {far} m apart");
    }
}

/// Where "auto" was another method, as on a device, the CPU goes on with that one.
#[test]
fn automatic_goes_on_with_the_method_that_was_saved() {
    for method in ["xpbd", "explicit"] {
        let mut whole = cpu::<f32>(&[("solver.method", method)]);
        advance(&mut whole, SAVED);
        let saved = whole.save();
        advance(&mut whole, FRAMES);
        let here = cpu::<f32>(&[("solver.method", "auto")]);
        assert_eq!(here.solver().method, Method::QuasiNewton);
        let mut resumed = here.resume(&saved).expect("the same scene");
        assert_eq!((resumed.solver().method, resumed.substeps()), (whole.solver().method, 3));
        advance(&mut resumed, FRAMES);
        assert!(bits(&resumed) == bits(&whole), "{method}");
    }
}

#[test]
fn a_method_that_cannot_go_on_says_which_can() {
    let error = |saved: &'static str, here: &'static str| {
        let saved = cpu::<f32>(&[("solver.method", saved)]).save();
        let resumed = cpu::<f32>(&[("solver.method", here)]).resume(&saved);
        resumed.expect_err("another method").to_string()
    };
    let text = error("quasi_newton", "xpbd");
    let cure = "set `solver.method = \"quasi_newton\"` and `solver.device = \"cpu\"`";
    assert!(text.contains(cure), "{text}");
    let text = error("explicit", "quasi_newton");
    assert!(text.ends_with("set `solver.method = \"explicit\"`"), "{text}");
}

#[test]
fn a_simulation_on_a_device_resumes_to_the_bit() {
    for settings in [[("solver.method", "xpbd")], [("solver.method", "explicit")]] {
        let new = || {
            let (scene, assembly) = scene(&settings);
            Simulation::<f32>::on_device(scene, assembly, device()).expect("a device")
        };
        let mut whole = new();
        advance(&mut whole, SAVED);
        let saved = whole.save();
        advance(&mut whole, FRAMES);
        let mut resumed = new().resume(&saved).expect("the same scene");
        advance(&mut resumed, FRAMES);
        assert!(bits(&resumed) == bits(&whole), "{settings:?}");
        assert!(resumed.is_on_device());
    }
}

#[test]
fn bytes_of_something_else_are_refused() {
    // Of the methods this one keeps most that depends on settings: colours order its multipliers.
    let xpbd =
        |settings: &[(&str, &str)]| cpu::<f32>(&[&[("solver.method", "xpbd")], settings].concat());
    let mut simulation = xpbd(&[]);
    advance(&mut simulation, 2);
    let saved = simulation.save();
    let resume = |settings: &[(&str, &str)], bytes: &[u8]| {
        let error = xpbd(settings).resume(bytes).map(|_| ()).expect_err("another scene");
        println!("{error}");
        error
    };
    assert_eq!(resume(&[], b"solver = 3"), ResumeError::NotSaved);
    assert_eq!(resume(&[], &saved[..saved.len() / 2]), ResumeError::Damaged);
    let mut newer = saved.clone();
    newer[8] = 200;
    assert_eq!(resume(&[], &newer), ResumeError::Format { found: 200 });
    let colors = [("solver.colors", "1")];
    assert!(matches!(resume(&colors, &saved), ResumeError::OtherScene { .. }));
    let finer = [("body.bar.cells", "[5, 2, 2]")];
    assert_eq!(resume(&finer, &saved), ResumeError::OtherScene { what: "vertices" });
    let softer = [("body.weight.material.young", "19 kPa")];
    let of_materials = ResumeError::OtherScene { what: "meshes, materials or solver settings" };
    assert_eq!(resume(&softer, &saved), of_materials);
    let stiffer = [("fixing.bed.stiffness", "500 N/m")];
    assert_eq!(resume(&stiffer, &saved), of_materials);
    let shorter = resume(&[("time.frame", "10 ms")], &saved);
    assert!(shorter.to_string().contains("`time.frame`"), "{shorter}");
    let double = cpu::<f64>(&[("solver.precision", "f64")]).resume(&saved).map(|_| ());
    assert_eq!(double, Err(ResumeError::Precision { saved: "f32" }));
    // A change that was made belongs to the scene.
    advance(&mut simulation, 30);
    let (before, rest) = SCENE.split_once("[[change]]").expect("changes");
    let (_, after) = rest.split_once("[solver]").expect("settings");
    let without = format!("{before}[solver]{after}");
    let settings = [("solver.device", "cpu"), ("solver.method", "xpbd")];
    let scene = Scene::parse("saved.toml", &without, &settings).expect("a scene");
    let assembly = Assembly::new(&scene, &mut |name| Err(name.into())).expect("meshes");
    let other = Simulation::<f32>::new(scene, assembly).expect("a model");
    let refused = other.resume(&simulation.save()).map(|_| ());
    assert_eq!(refused, Err(ResumeError::OtherScene { what: "changes of settings" }));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Any byte that has changed, and any that is missing, is noticed.
    #[test]
    fn damage_is_noticed(place in any::<prop::sample::Index>(), change in 1u8.., cut in any::<bool>()) {
        static SAVED: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
        let mut bytes = SAVED.get_or_init(|| cpu::<f32>(&[]).save()).clone();
        let place = place.index(bytes.len());
        if cut {
            bytes.truncate(place);
        } else {
            bytes[place] ^= change;
        }
        prop_assert!(cpu::<f32>(&[]).resume(&bytes).is_err());
    }
}
