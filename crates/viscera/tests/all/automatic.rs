//! The method that a scene gets where it names none, and the error that a run foretells.

use viscera::scalar::{Real, Vec3};
use viscera::scene::Scene;
use viscera::settings::Method;
use viscera::simulation::{Assembly, Simulation};

const BAR: &str = r#"
time = { duration = "0.5 s" }
[[body]]
name = "bar"
shape = "block"
size = ["80 mm", "20 mm", "20 mm"]
cells = [8, 2, 2]
material = { young = "20 kPa", poisson = 0.45, density = "1000 kg/m^3" }
[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
"#;

fn simulation<S: Real>(overrides: &[(&str, &str)]) -> Simulation<S> {
    let scene = Scene::parse("bar.toml", BAR, overrides).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    Simulation::new(scene, assembly).unwrap_or_else(|e| panic!("{e}"))
}

fn method(overrides: &[(&str, &str)]) -> Method {
    simulation::<f32>(overrides).solver().method
}

/// What costs less, at every accuracy: many small steps of soft tissue in large cells, large steps of what is stiff and
/// nearly incompressible. What is named is taken.
#[test]
fn the_cheapest_method_is_chosen_that_is_as_accurate_as_asked() {
    let (young, poisson) = ("body.bar.material.young", "body.bar.material.poisson");
    let fine = ("solver.accuracy", "fine");
    for accuracy in ["draft", "standard", "0.01", "fine"] {
        let asked = ("solver.accuracy", accuracy);
        let soft = [asked, ("body.bar.cells", "[16, 4, 4]"), (young, "5 kPa"), (poisson, "0.3")];
        assert_eq!(method(&soft), Method::Explicit, "{accuracy}");
        let cells = ("body.bar.cells", "[24, 6, 6]");
        let stiff = [asked, cells, (young, "5 MPa"), (poisson, "0.499")];
        assert_eq!(method(&stiff), Method::QuasiNewton, "{accuracy}");
    }
    for (name, named) in [("xpbd", Method::Xpbd), ("quasi_newton", Method::QuasiNewton)] {
        assert_eq!(method(&[fine, ("solver.method", name)]), named);
    }
    // The scene goes on saying what it said.
    assert_eq!(simulation::<f32>(&[]).scene().solver.method, Method::Auto);
}

/// A scene that was written for XPBD and names no method hears which of its settings have no effect.
#[test]
fn settings_of_another_method_are_named() {
    let unused = |overrides: &[(&str, &str)]| simulation::<f32>(overrides).solver().unused();
    let published = [("solver.rebase", "false"), ("solver.colors", "1"), ("solver.substeps", "3")];
    assert_eq!(unused(&published), ["colors", "rebase"]);
    assert_eq!(unused(&[&published[..], &[("solver.method", "xpbd")]].concat()), [""; 0]);
    assert_eq!(unused(&[]), [""; 0]);
}

/// Less error takes more substeps, of soft tissue too, which falls far.
#[test]
fn less_error_takes_more_substeps() {
    let substeps = |accuracy: &str, young: &str| {
        let settings = [
            ("solver.method", "quasi_newton"),
            ("solver.accuracy", accuracy),
            ("body.bar.material.young", young),
        ];
        simulation::<f32>(&settings).substeps()
    };
    let of =
        |young: &str| ["draft", "standard", "0.02", "fine"].map(|share| substeps(share, young));
    assert_eq!(of("0.5 kPa"), [1, 1, 2, 4]);
    let stiff = of("200 kPa");
    assert!(stiff.windows(2).all(|pair| pair[0] < pair[1]), "{stiff:?}");
}

/// Fewer passes than the method would take leave an error that nobody foretells; as many or more do not.
#[test]
fn of_fewer_passes_no_error_is_foretold() {
    let motion = |iterations: &str| {
        let named = ("solver.method", "quasi_newton");
        simulation::<f32>(&[named, ("solver.iterations", iterations)]).expected_errors().motion
    };
    assert_eq!((motion("9"), motion("10")), (None, Some(0.045)));
}

/// A changed material may ask for another method, and other substeps.
#[test]
fn a_changed_material_is_chosen_for_anew() {
    let cells = ("body.bar.cells", "[24, 6, 6]");
    let mut changed = simulation::<f32>(&[("solver.accuracy", "fine"), cells]);
    assert_eq!(changed.solver().method, Method::Explicit);
    let settings = [("body.bar.material.poisson", "0.499"), ("body.bar.material.young", "5 MPa")];
    let owned = settings.map(|(key, value)| (key.to_owned(), value.to_owned()));
    changed.change(&owned).expect("another tissue");
    assert_eq!(changed.solver().method, Method::QuasiNewton);
    assert!(changed.substeps() > 5, "{}", changed.substeps());
    changed.advance_frame().expect("a frame");
}

fn places<S: Real>(overrides: &[(&str, &str)]) -> (Vec<Vec<Vec3<f64>>>, f64, u32) {
    let mut simulation = simulation::<S>(overrides);
    let foretold = simulation.expected_errors().motion.unwrap_or(f64::NAN);
    let mut places = vec![];
    for _ in 0..simulation.scene().frame_count() {
        simulation.advance().expect("a frame");
        places.push(simulation.state().positions.iter().map(|x| x.cast::<f64>()).collect());
    }
    (places, foretold, simulation.substeps())
}

/// Of a bar that swings for half a second, beside smaller explicit steps: the error of a method that is found, and what it
/// foretells.
fn found_and_foretold(young: &str, poisson: &str, method: &str) -> (f64, f64) {
    let tissue = [("body.bar.material.young", young), ("body.bar.material.poisson", poisson)];
    let truth = [("solver.method", "explicit"), ("solver.explicit_safety", "0.125")];
    let precision = ("solver.precision", "f64");
    let (exact, ..) = places::<f64>(&[&tissue[..], &truth, &[precision]].concat());
    let (ours, foretold, substeps) =
        places::<f32>(&[&tissue[..], &[("solver.method", method)]].concat());
    let rest = simulation::<f64>(&[precision]).model().rest_positions.clone();
    let (mut error, mut moved) = (0.0, 0.0);
    for (ours, exact) in ours.iter().zip(&exact) {
        for ((x, y), rest) in ours.iter().zip(exact).zip(&rest) {
            error += (*x - *y).length_squared();
            moved += (*y - *rest).length_squared();
        }
    }
    let found = (error / moved).sqrt();
    println!("{method}, {young}, {poisson}: {substeps} substeps, {found:e}, {foretold:e} foretold");
    (found, foretold)
}

const TISSUES: [(&str, &str); 3] = [("5 kPa", "0.45"), ("20 kPa", "0.45"), ("100 kPa", "0.3")];

/// What is foretold is no less than what is found and at most four times as much, and what is found is no more than what is
/// asked.
#[test]
fn the_error_of_motion_is_foretold() {
    for (young, poisson) in TISSUES {
        let (found, foretold) = found_and_foretold(young, poisson, "quasi_newton");
        assert!(found < 0.05 && found <= foretold && foretold <= 4.0 * found);
    }
}

/// No less than what is found, and little.
#[test]
fn the_error_of_explicit_steps_is_foretold() {
    for (young, poisson) in TISSUES {
        let (found, foretold) = found_and_foretold(young, poisson, "explicit");
        assert!(found <= foretold && foretold <= 5e-3, "{young}: {found:e} of {foretold:e}");
    }
}
