//! Scenes whose bodies rest under gravity as they were given.

use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::simulation::{AssembleError, Assembly, Balance, BalanceError, Simulation};

/// A bar that would sag by 30 mm.
const BAR: &str = r#"
[[body]]
name = "bar"
shape = "beam"
length = "100 mm"
width = "30 mm"
height = "30 mm"
cells_across = 3
balanced = true
material = { young = "15 kPa", poisson = 0.45, density = "1050 kg/m^3" }

[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
"#;

/// A block that hangs below another one, which is held at its top.
const HANGING: &str = r#"
[[body]]
name = "upper"
shape = "block"
size = ["60 mm", "40 mm", "40 mm"]
cells = [3, 2, 2]
balanced = true
material = { young = "8 kPa", density = "1000 kg/m^3" }

[[body]]
name = "lower"
shape = "block"
size = ["30 mm", "30 mm", "20 mm"]
cells = [3, 3, 2]
position = ["20 mm", "5 mm", "-20.2 mm"]
balanced = true
material = { young = "8 kPa", density = "1000 kg/m^3" }

[[fixing]]
name = "top"
body = "upper"
half_space = { point = [0, 0, "39.9 mm"], normal = [0, 0, 1] }

[[tie]]
name = "stalk"
from = { body = "lower", half_space = { point = [0, 0, "-0.3 mm"], normal = [0, 0, 1] } }
to = { body = "upper", half_space = { point = [0, 0, "0.1 mm"], normal = [0, 0, -1] } }
distance = "1 mm"
"#;

fn assemble(text: &str, settings: &[(&str, &str)]) -> Result<(Scene, Assembly), AssembleError> {
    let scene = Scene::parse("scene.toml", text, settings).expect("a legal scene");
    let assembly = Assembly::new(&scene, &mut |_| Err("no files".to_owned()))?;
    Ok((scene, assembly))
}

fn simulation(text: &str, settings: &[(&str, &str)]) -> Simulation<f32> {
    let (scene, assembly) = assemble(text, settings).expect("an assembly");
    Simulation::new(scene, assembly).expect("a simulation")
}

/// The farthest that a vertex is from its place in the scene after so many frames [m].
fn drift(simulation: &mut Simulation<f32>, frames: u32) -> f32 {
    let start = simulation.model().rest_positions.clone();
    let mut drift: f32 = 0.0;
    for _ in 0..frames {
        simulation.advance_frame().expect("a frame");
        let moved = simulation.state().positions.iter().zip(&start);
        drift = moved.map(|(x, start)| (*x - *start).length()).fold(drift, f32::max);
    }
    drift
}

fn force_on(simulation: &Simulation<f32>, name: &str) -> Vec3<f64> {
    let report = simulation.report();
    let patch = report.patches.iter().find(|patch| patch.name == name).expect("a patch");
    Vec3::from_f64(patch.force)
}

/// Single precision holds places to 1e-8 m here and forces to 1e-6 of themselves: what moves by a thousandth of what it
/// would sag is not balanced.
#[test]
fn a_balanced_body_stays_where_it_is_by_every_method() {
    for settings in [
        [("solver.method", "explicit"), ("solver.elements", "recovered")],
        [("solver.method", "quasi_newton"), ("solver.elements", "recovered")],
        [("solver.method", "quasi_newton"), ("solver.elements", "plain")],
        [("solver.method", "xpbd"), ("solver.elements", "plain")],
        [("solver.method", "auto"), ("solver.elements", "auto")],
    ] {
        let mut bar = simulation(BAR, &settings);
        let drift = drift(&mut bar, 60);
        assert!(drift < 1e-5, "{settings:?}: {drift:e} m");
        // 0.0945 kg.
        let weight = 1050.0 * 0.1 * 0.03 * 0.03 * 9.81;
        let held = force_on(&bar, "wall");
        assert!((held.z - weight).abs() < 2e-3 * weight, "{settings:?}: {held:?} of {weight} N");
    }
    let mut sags = simulation(BAR, &[("body.bar.balanced", "false")]);
    assert!(drift(&mut sags, 30) > 0.01);
}

/// Its stress is there: the report of a bar that does not move knows of strain.
#[test]
fn what_carries_weight_is_strained() {
    let bar = simulation(BAR, &[]);
    let largest = bar.tets().iter().map(|tet| tet.stretches[0]).fold(0.0, f64::max);
    assert!(largest > 1.05, "{largest}");
    let note = bar.assembly().notes.iter().find(|note| note.contains("`bar` rests under gravity"));
    assert!(note.is_some_and(|note| note.contains("mm elsewhere")), "{:?}", bar.assembly().notes);
}

/// Reports tell that it rests. Its mesh is off by as much as without gravity where it is pulled, and by nothing where it
/// is not.
#[test]
fn reports_know_of_the_shape_without_load() {
    let mut bar = simulation(BAR, &[]);
    drift(&mut bar, 30);
    let rest = bar.rest().expect("it is held");
    assert!(rest.error < 1e-3 && rest.stable, "{rest:?}");
    assert_eq!(bar.mesh_error(), None);
    let pull = "[[force]]\nbody = \"bar\"\nhalf_space = { point = [\"100 mm\", 0, 0], normal = [1, 0, 0] }\nforce = [0, 0, \"0.01 N\"]\n";
    let pulled = |gravity: &str| {
        // Far from where it buckles, a bar gives way as without weight.
        let settings = [("body.bar.material.young", "60 kPa"), ("world.gravity", gravity)];
        let mut bar = simulation(&format!("{BAR}\n{pull}"), &settings);
        drift(&mut bar, 60);
        bar.mesh_error().expect("an estimate").displacement
    };
    let (balanced, weightless) = (pulled("9.81 m/s^2"), pulled("0 m/s^2"));
    let ratio = balanced / weightless;
    assert!((0.9..1.1).contains(&ratio), "{balanced} and {weightless}");
}

/// What a motion holds from the beginning is held.
#[test]
fn motions_hold_before_they_move() {
    let motion = "[[motion]]\nname = \"wall\"\nbody = \"bar\"\nhalf_space = { point = [0, 0, 0], normal = [-1, 0, 0] }\nkeys = [{ time = \"1 s\", translation = [0, 0, 0] }, { time = \"2 s\", translation = [0, 0, \"10 mm\"] }]\n";
    let (body, _) = BAR.split_once("[[fixing]]").expect("a fixing");
    let mut bar = simulation(&format!("{body}{motion}"), &[]);
    let drift = drift(&mut bar, 40);
    assert!(drift < 1e-5, "{drift:e} m");
}

#[test]
fn finer_meshes_are_balanced_as_well() {
    let mut fine = simulation(BAR, &[("body.bar.refine", "1"), ("body.bar.cells_across", "2")]);
    let drift = drift(&mut fine, 20);
    assert!(drift < 1e-5, "{drift:e} m");
}

/// Springs that hold it are under tension, and hold the weight.
#[test]
fn elastic_fixings_carry_what_they_hold() {
    let mut bar = simulation(&format!("{BAR}stiffness = \"2 N/mm\"\n"), &[]);
    let weight = 1050.0 * 0.1 * 0.03 * 0.03 * 9.81;
    let drift = drift(&mut bar, 40);
    assert!(drift < 1e-5, "{drift:e} m");
    let held = force_on(&bar, "wall");
    assert!((held.z - weight).abs() < 2e-3 * weight, "{held:?} of {weight} N");
}

/// The tie pulls with the weight of what hangs on it, and what it hangs on carries both.
#[test]
fn ties_carry_what_nothing_else_holds() {
    let mut blocks = simulation(HANGING, &[]);
    let lower = 1000.0 * 0.03 * 0.03 * 0.02 * 9.81;
    let upper = 1000.0 * 0.06 * 0.04 * 0.04 * 9.81;
    let drift = drift(&mut blocks, 60);
    assert!(drift < 2e-5, "{drift:e} m");
    let tie = blocks.tie_forces()[0].force;
    assert!((tie[2] - lower).abs() < 5e-3 * lower, "{tie:?} of {lower} N");
    let top = force_on(&blocks, "top");
    assert!((top.z - lower - upper).abs() < 5e-3 * upper, "{top:?} of {} N", lower + upper);
    let mut sags = simulation(HANGING, &[("body.lower.balanced", "false")]);
    assert!(self::drift(&mut sags, 30) > 1e-4);
}

/// The shape without load depends on the elements: a scene that changes them is balanced anew.
#[test]
fn other_elements_are_balanced_anew() {
    let change = "[[change]]\ntime = \"0.2 s\"\nset = [\"solver.elements = plain\"]\n";
    let settings = [("solver.method", "quasi_newton")];
    let mut bar = simulation(&format!("{BAR}\n{change}"), &settings);
    let drift = drift(&mut bar, 40);
    assert!(drift < 1e-5, "{drift:e} m");
}

/// Tissue that is softened while the scene runs sags: what it was made of carried it.
/// What was found once need not be found again, elsewhere or in a program that cannot.
#[test]
fn a_balance_is_taken_over_by_the_scene_that_it_is_of_and_by_no_other() {
    let stress_free = |assembly: &Assembly| {
        assembly.builder.build::<f64>().expect("a model").stress_free().to_vec()
    };
    let with = |text: &str, settings: &[(&str, &str)], balance: &Balance| {
        let scene = Scene::parse("scene.toml", text, settings).expect("a legal scene");
        let mut none = |_: &str| Err("no files".to_owned());
        Assembly::with_balance(&scene, &mut none, Some(balance.clone())).expect("an assembly")
    };
    let (_, found) = assemble(HANGING, &[]).expect("an assembly");
    assert!(!found.sags());
    let balance = found.balance().expect("a balance").clone();
    assert_eq!(Balance::from_bytes(&balance.to_bytes()), Some(balance.clone()));
    assert_eq!(Balance::from_bytes(b"no balance"), None);
    let revision =
        |assembly: &Assembly| assembly.builder.build::<f64>().expect("a model").revision();
    let again = with(HANGING, &[], &balance);
    assert_eq!(revision(&again), revision(&found), "shapes, anchors and ties");
    assert_eq!(again.notes, found.notes);

    // Shapes that are marked show whether they were used.
    let mut marked = serde_json::to_value(&balance).expect("numbers");
    let marks = [0, 1].map(|body: usize| {
        let number = &mut marked["bodies"][body]["shape"][0][0];
        let moved = number.as_f64().expect("a number") - 1e-6;
        *number = moved.into();
        moved
    });
    let marked: Balance = serde_json::from_value(marked).expect("a balance");
    assert_eq!(stress_free(&with(HANGING, &[], &marked))[0].x, marks[0]);
    let of_lower = |assembly: &Assembly| stress_free(assembly)[assembly.bodies[1].vertices.start].x;
    for (other, keeps_lower) in [
        (("body.upper.material.young", "9 kPa"), true),
        (("fixing.top.half_space.point", "[0, 0, \"19.9 mm\"]"), true),
        (("body.upper.balanced", "false"), true),
        (("world.gravity", "[0, 0, \"-9 m/s^2\"]"), false),
        (("body.lower.material.density", "900 kg/m^3"), false),
        (("solver.elements", "plain"), false),
    ] {
        let (_, plain) = assemble(HANGING, &[other]).expect("an assembly");
        let given = with(HANGING, &[other], &marked);
        // The upper one has other tissue, or carries another load.
        assert_eq!(stress_free(&given)[0], stress_free(&plain)[0], "{other:?}");
        assert_eq!(of_lower(&given) == marks[1], keeps_lower, "{other:?}");
        assert_eq!(of_lower(&given) == of_lower(&plain), !keeps_lower, "{other:?}");
    }
}

/// Every body that cannot be balanced is named, and the others are solved for.
#[test]
fn all_that_cannot_rest_are_named_at_once() {
    let settings = [
        ("body.upper.material.young", "0.1 kPa"),
        ("body.lower.balanced", "false"),
        ("contact.bodies", "false"),
    ];
    let text =
        format!("{HANGING}\n{}", BAR.replace("\"bar\"", "\"soft\"").replace("15 kPa", "1 kPa"));
    let text = format!("{text}\n{}", BAR.replace("\"wall\"", "\"other_wall\""));
    let scene = Scene::parse("scene.toml", &text, &settings).expect("a legal scene");
    let mut none = |_: &str| Err("no files".to_owned());
    let (balance, errors) = Assembly::try_balance(&scene, &mut none, None).expect("meshes");
    let named = |error: &BalanceError| match error {
        BalanceError::TooSoft { body, .. } => body.clone(),
        other => panic!("{other}"),
    };
    assert_eq!(errors.iter().map(named).collect::<Vec<_>>(), ["upper", "soft"]);
    let notes: Vec<&String> = balance.notes().collect();
    assert!(notes.len() == 1 && notes[0].contains("`bar`"), "{notes:?}");
}

#[test]
fn softened_tissue_sags() {
    let change = "[[change]]\ntime = \"0.1 s\"\nset = [\"body.bar.material.young = 8 kPa\"]\n";
    let mut bar = simulation(&format!("{BAR}\n{change}"), &[]);
    assert!(drift(&mut bar, 5) < 1e-5);
    assert!(drift(&mut bar, 40) > 5e-3);
}

#[test]
fn without_gravity_there_is_nothing_to_balance() {
    let mut bar = simulation(BAR, &[("world.gravity", "0 m/s^2")]);
    let positions = bar.model().rest_positions.clone();
    let free: Vec<Vec3<f32>> = bar.model().stress_free().iter().map(|x| x.cast()).collect();
    assert_eq!(positions, free);
    assert_eq!(drift(&mut bar, 5), 0.0);
}

fn complaint(text: &str, settings: &[(&str, &str)]) -> String {
    let error = assemble(text, settings).expect_err("an error");
    assert!(matches!(error, AssembleError::Balance(_)), "{error:?}");
    error.to_string()
}

/// The density and the stiffness that errors name work.
#[test]
fn what_cannot_be_balanced_is_told_with_what_can() {
    let soft = [("body.bar.material.young", "600 Pa")];
    let error = complaint(BAR, &soft);
    assert!(error.contains("body `bar` cannot rest under gravity as it was given"), "{error}");
    assert!(error.contains("rho g L/E is 1.72"), "{error}");
    let after = |text: &str| {
        let rest = &error[error.find(text).expect("a number") + text.len()..];
        rest[..rest.find(' ').expect("a unit")].to_owned()
    };
    let density = format!("{} kg/m^3", after("a density up to "));
    let young = format!("{} kPa", after("or `young` from "));
    assert!(
        assemble(BAR, &[soft[0], ("body.bar.material.density", &density)]).is_ok(),
        "{density}"
    );
    assert!(assemble(BAR, &[("body.bar.material.young", &young)]).is_ok(), "{young}");

    let loose = BAR.split("[[fixing]]").next().expect("a body");
    assert!(complaint(loose, &[]).contains("no fixing holds it"));
}
