//! What a run says of its own rest and of its solver: nothing where there is nothing to say.

use viscera::scalar::Real;
use viscera::scene::Scene;
use viscera::simulation::{Assembly, FrameReport, Simulation, Standing, advice};

/// A bar whose end is led 0.4 m away and stands there from half a second on.
const LED: &str = r#"
[time]
duration = "1 s"
velocity_factor = 0.9
[world]
gravity = 0
[[body]]
name = "bar"
shape = "beam"
length = "60 mm"
width = "20 mm"
height = "20 mm"
cells_across = 2
material = { young = "20 kPa", poisson = 0.45 }
[[motion]]
name = "hand"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
keys = [{ time = "0 s" }, { time = "0.5 s", translation = ["0.4 m", "0.2 m", 0], rotation_angle = "0 deg" }]
"#;

fn scene(text: &str, overrides: &[(&str, &str)]) -> Scene {
    Scene::parse("bar.toml", text, overrides).unwrap_or_else(|e| panic!("{e}"))
}

fn run<S: Real>(scene: &Scene, seconds: f64) -> (Simulation<S>, Vec<FrameReport>) {
    let assembly = Assembly::new(scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    let mut simulation = Simulation::new(scene.clone(), assembly).unwrap_or_else(|e| panic!("{e}"));
    let mut reports = Vec::new();
    for _ in 0..(60.0 * seconds).round() as u32 {
        simulation.advance_frame().unwrap_or_else(|e| panic!("{e}"));
        reports.push(simulation.report());
    }
    (simulation, reports)
}

/// Once it stands, all strain is what rounding makes of places half a metre away; work of rounding through half a
/// metre is a thousand times the energy of it.
fn is_quiet_when_led_away<S: Real>(precision: &str) {
    let scene = scene(LED, &[("solver.precision", precision), ("solver.method", "quasi_newton")]);
    let (simulation, reports) = run::<S>(&scene, 3.0);
    if let Some(report) = reports.last() {
        assert_eq!(report.stiffness_error, 0.0, "{precision}: {report:?}");
    }
    let rest = simulation.rest().expect("nothing moves any more");
    assert_eq!(rest.warning(&scene, 3.0), None, "{precision}: {rest:?}");
}

#[test]
fn unstressed_tissue_that_was_led_away_raises_no_alarm() {
    is_quiet_when_led_away::<f32>("f32");
    is_quiet_when_led_away::<f64>("f64");
}

#[test]
fn what_still_moves_by_a_path_or_falls_has_no_state_of_rest() {
    let moving = run::<f32>(&scene(LED, &[]), 0.25).0;
    assert_eq!(moving.rest(), None);
    // Nothing holds it; all of its strain is rounding.
    let text = &LED[..LED.find("[[motion]]").unwrap_or(0)];
    for gravity in ["0", "9.81 m/s^2"] {
        let falling = scene(text, &[("world.gravity", gravity)]);
        let (simulation, reports) = run::<f32>(&falling, 0.3);
        assert_eq!(simulation.rest(), None);
        assert!(reports.iter().all(|report| report.stiffness_error == 0.0), "{gravity}");
    }
}

/// A bar on a wall that nothing but its weight moves.
fn falling(overrides: &[(&str, &str)]) -> Scene {
    let text = LED.replace("gravity = 0", "gravity = \"9.81 m/s^2\"").replace("0.9", "1");
    let text = &text[..text.find("keys").unwrap_or(0)];
    scene(&format!("{text}keys = [{{ time = \"0 s\" }}]\n"), overrides)
}

/// It is far from rest and hardly moves yet: no fault of the solver's, whose steps are solved.
#[test]
fn a_bar_that_has_begun_to_fall_is_not_at_rest_yet() {
    for method in ["quasi_newton", "explicit"] {
        let falling = falling(&[("solver.method", method), ("body.bar.material.young", "3 kPa")]);
        let (simulation, _) = run::<f32>(&falling, 2.0 / 60.0);
        let rest = simulation.rest().expect("its loads are constant");
        assert!(rest.error > 0.5 && rest.residual < 0.1, "{rest:?}");
        assert_eq!(rest.standing(2.0 / 60.0), Standing::Swinging, "{rest:?}");
        let warning = rest.warning(&falling, 2.0 / 60.0).expect("a warning");
        assert!(warning.starts_with("not at rest yet"), "{warning}");
    }
}

/// As published, it stands still where another tissue would rest: that is the solver's fault, and known by the forces
/// that are out of balance there.
#[test]
fn what_stands_still_far_from_rest_is_the_solvers_fault() {
    let scene = falling(&[
        ("solver.method", "xpbd"),
        ("solver.rebase", "false"),
        ("solver.keep_multipliers", "false"),
        ("solver.substeps", "10"),
        ("solver.iterations", "20"),
        ("time.velocity_factor", "0.8"),
        ("body.bar.material.young", "300 kPa"),
        ("body.bar.material.poisson", "0.3"),
        ("body.bar.material.model", "saint_venant_kirchhoff"),
    ]);
    let (simulation, _) = run::<f32>(&scene, 4.0);
    let rest = simulation.rest().expect("its loads are constant");
    assert!(rest.error > 0.05 && rest.residual > rest.error, "{rest:?}");
    assert_eq!(rest.standing(4.0), Standing::Elsewhere, "{rest:?}");
    let warning = rest.warning(&scene, 4.0).expect("a warning");
    assert!(warning.starts_with("the solver falls short"), "{warning}");
}

#[test]
fn a_bar_that_has_just_been_let_fall_swings() {
    let falling = falling(&[]);
    let (simulation, _) = run::<f32>(&falling, 0.2);
    let rest = simulation.rest().expect("its loads are constant");
    assert_eq!(rest.standing(0.2), Standing::Swinging, "{rest:?}");
    let warning = rest.warning(&falling, 0.2).expect("a warning");
    assert!(warning.contains("time.velocity_factor = 0.9"), "{warning}");
}

/// What advice depends on is in the settings and the materials in force.
#[test]
fn advice_can_be_followed() {
    let with = |overrides: &[(&str, &str)]| scene(LED, overrides);
    let green = ("body.bar.material.model", "saint_venant_kirchhoff");
    let explicit = ("solver.method", "explicit");
    assert!(advice::inverted(&with(&[green])).contains("stable_neo_hookean"));
    assert!(!advice::inverted(&with(&[])).contains("stable_neo_hookean"));

    let recovered = ("solver.elements", "recovered");
    let plain = advice::plain_elements(&with(&[recovered, green])).expect("advice");
    assert!(plain.contains("bar") && plain.contains("stable_neo_hookean"), "{plain}");
    assert_eq!(advice::plain_elements(&with(&[recovered])), None);
    assert_eq!(advice::plain_elements(&with(&[green])), None);

    let diverged = advice::diverged(&with(&[explicit]));
    assert!(diverged.contains("solver.explicit_safety below 0.8"), "{diverged}");
    assert!(!diverged.contains("relaxation") && !diverged.contains("acceleration"), "{diverged}");
    let diverged = advice::diverged(&with(&[]));
    assert_eq!(diverged, "raise solver.substeps");
    let xpbd = ("solver.method", "xpbd");
    let diverged = advice::diverged(&with(&[
        xpbd,
        ("solver.relaxation", "1.5"),
        ("solver.acceleration", "chebyshev"),
        ("solver.step_guard", "false"),
    ]));
    for part in ["relaxation to 1", "acceleration = \"none\"", "step_guard = true"] {
        assert!(diverged.contains(part), "{diverged}");
    }

    assert_eq!(advice::budget(&with(&[])), "raise solver.iterations or solver.substeps");
    let published = [xpbd, ("solver.rebase", "false"), ("solver.keep_multipliers", "false")];
    let budget = advice::budget(&with(&published));
    assert!(budget.contains("solver.rebase = true and solver.keep_multipliers = true"), "{budget}");
    // Every setting that is named is one.
    for named in [&diverged, &budget] {
        for word in named.split([' ', ',', '"']).filter(|word| word.starts_with("solver.")) {
            let known = with(&[]).solver.values();
            let key = word.trim_start_matches("solver.");
            assert!(known.iter().any(|(name, _)| *name == key), "{word}");
        }
    }
}
