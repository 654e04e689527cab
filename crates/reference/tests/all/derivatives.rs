//! Derivatives of states of rest against what they must be: each other, finite differences, and homogeneity.

use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::Pin;
use viscera_reference::sensitivity::{Change, Dependence};
use viscera_reference::{Course, DEFAULT_MEMORY, Reference, RestState};

/// A bar on a spring bed that is drawn out, bends under its weight and is pressed by a ball.
const SCENE: &str = r#"
[world]
gravity = "9.81 m/s^2"

[[body]]
name = "bar"
shape = "block"
size = ["60 mm", "30 mm", "20 mm"]
cells = [6, 3, 2]
material = { young = "5 kPa", poisson = 0.44, density = "1000 kg/m^3", model = "LAW" }

[[fixing]]
name = "bed"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
stiffness = "400 N/m"

[[motion]]
name = "grip"
body = "bar"
half_space = { point = ["60 mm", 0, 0], normal = [1, 0, 0] }
keys = [{ time = "1 s", translation = ["9 mm", 0, "4 mm"] }]

[[tool]]
name = "ball"
kind = "probe"
radius = "8 mm"
length = "60 mm"
position = ["30 mm", "15 mm", "32 mm"]
keys = [{ time = "1 s", translation = [0, 0, "-9 mm"] }]

[[motion]]
name = "hook"
body = "bar"
box = { min = ["39 mm", "-1 mm", "-1 mm"], max = ["41 mm", "31 mm", "1 mm"] }
stiffness = "20 N/m"
keys = [{ time = "1 s", translation = [0, "6 mm", "-5 mm"] }]

[[force]]
name = "thread"
body = "bar"
box = { min = ["19 mm", "-1 mm", "-1 mm"], max = ["21 mm", "1 mm", "21 mm"] }
force = ["0.1 N", "-0.2 N", 0]

[solver]
elements = "ELEMENTS"
"#;

/// Weight of the bar [N].
const WEIGHT: f64 = 1000.0 * 0.06 * 0.03 * 0.02 * 9.81;

const KEYS: [(&str, f64); 4] = [
    ("body.bar.material.young", 5e3),
    ("body.bar.material.poisson", 0.44),
    ("body.bar.material.density", 1e3),
    ("fixing.bed.stiffness", 400.0),
];

fn text(law: &str, elements: &str) -> String {
    SCENE.replace("LAW", law).replace("ELEMENTS", elements)
}

/// The scene with a number at a key.
fn simulation(text: &str, key: &str, value: f64) -> Simulation<f64> {
    let unit = match key.rsplit_once('.').expect("a dotted key").1 {
        "young" => " Pa",
        "density" => " kg/m^3",
        "stiffness" => " N/m",
        _ => "",
    };
    let quoted =
        if unit.is_empty() { format!("{value:?}") } else { format!("\"{value:?}{unit}\"") };
    let scene = Scene::parse("bar.toml", text, &[(key, &quoted)]).expect("a legal scene");
    let assembly = Assembly::new(&scene, &mut |_| Err("no files".to_owned())).expect("meshes");
    Simulation::new(scene, assembly).expect("a simulation")
}

fn rest(course: &mut Course<'_>, near: Option<&RestState>) -> RestState {
    let zero;
    let start = match near {
        Some(state) => (1.0, &state.positions[..]),
        None => {
            zero = course.rest().to_vec();
            (0.0, &zero[..])
        }
    };
    course.go(start, 1.0).expect("a state of rest")
}

fn change(text: &str, simulation: &Simulation<f64>, (key, value): (&str, f64)) -> Change {
    let dependence = Dependence::of_key(key).expect("a key with derivatives");
    let other = self::simulation(text, key, dependence.other(value));
    dependence.change(simulation.model(), other.model(), value)
}

/// What a state of rest says: positions, then all forces.
fn all(course: &Course<'_>, state: &RestState) -> (Vec<Vec3<f64>>, Vec<Vec3<f64>>) {
    (state.positions.clone(), vectors(course.forces(state)))
}

fn vectors(forces: Vec<(String, Vec3<f64>)>) -> Vec<Vec3<f64>> {
    let names: Vec<_> = forces.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["bed", "grip", "hook", "thread", "ball"]);
    forces.into_iter().map(|(_, force)| force).collect()
}

fn norm(of: &[Vec3<f64>]) -> f64 {
    of.iter().map(|x| x.length_squared()).sum::<f64>().sqrt()
}

fn away(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    let apart: Vec<_> = a.iter().zip(b).map(|(a, b)| *a - *b).collect();
    norm(&apart)
}

const KINDS: [(&str, &str); 3] = [
    ("stable_neo_hookean", "recovered"),
    ("stable_neo_hookean", "plain"),
    ("saint_venant_kirchhoff", "plain"),
];

/// Fourth-order differences, `(8 (y(h) - y(-h)) - (y(2h) - y(-2h)))/(12 h)`.
#[test]
fn tangents_are_what_finite_differences_say() {
    for (law, elements) in KINDS {
        let text = text(law, elements);
        for (key, value) in KEYS {
            let here = simulation(&text, key, value);
            let mut course = Course::new(&here, DEFAULT_MEMORY);
            let state = rest(&mut course, None);
            assert!(state.wrenches[0].touches > 3, "{:?}", state.wrenches);
            let sum = all(&course, &state).1.into_iter().fold(Vec3::ZERO, |sum, force| sum + force);
            let missing = (sum - Vec3::from_f64([0.0, 0.0, WEIGHT])).length();
            assert!(missing < 1e-9 * WEIGHT, "forces carry the bar's weight: {sum:?} N");
            let change = change(&text, &here, (key, value));
            let tangent =
                course.tangents(&state, std::slice::from_ref(&change)).expect("tangents").remove(0);
            // No sample begins or ends to touch within so little.
            let h = 3e-5 * value;
            let at = |times: f64| {
                let there = simulation(&text, key, value + times * h);
                let mut course = Course::new(&there, DEFAULT_MEMORY);
                let state = rest(&mut course, Some(&state));
                all(&course, &state)
            };
            let ([a, b, c, d], weights) = ([-2.0, -1.0, 1.0, 2.0].map(at), [1.0, -8.0, 8.0, -1.0]);
            let slope = |y: [&Vec<Vec3<f64>>; 4]| -> Vec<Vec3<f64>> {
                let of = |v: usize| {
                    let terms = y.iter().zip(weights).map(|(y, weight)| y[v] * weight);
                    terms.fold(Vec3::ZERO, |sum, term| sum + term) * (1.0 / (12.0 * h))
                };
                (0..y[0].len()).map(of).collect()
            };
            let positions = slope([&a.0, &b.0, &c.0, &d.0]);
            let forces = slope([&a.1, &b.1, &c.1, &d.1]);
            let exact = vectors(course.forces_along(&state, &tangent, key));
            let errors = [
                away(&positions, &tangent.positions) / norm(&positions),
                away(&forces, &exact) / norm(&forces),
            ];
            println!("{law} {elements} {key}: {errors:?}");
            assert!(errors.iter().all(|error| *error < 1e-7), "{law} {elements} {key}: {errors:?}");
        }
    }
}

/// `<w, dx/dp> = dL/dp` for `L = w . x`: one by a solve for the number, one by a solve for the function.
#[test]
fn adjoints_are_tangents_turned_round() {
    for (law, elements) in KINDS {
        let text = text(law, elements);
        let (key, value) = KEYS[0];
        let here = simulation(&text, key, value);
        let mut course = Course::new(&here, DEFAULT_MEMORY);
        let state = rest(&mut course, None);
        let changes = KEYS.map(|(key, value)| change(&text, &here, (key, value)));
        let tangents = course.tangents(&state, &changes).expect("tangents");
        let by_positions: Vec<_> = (0..state.positions.len())
            .map(|v| {
                Vec3::from_f64([0.37, 0.71, 0.13].map(|s: f64| (v as f64 * s + s).fract() - 0.5))
            })
            .collect();
        let pulled = course.pull_back(&state, &by_positions, &changes).expect("an adjoint");
        for ((tangent, pulled), (key, _)) in tangents.iter().zip(pulled).zip(KEYS) {
            let terms = by_positions.iter().zip(&tangent.positions).map(|(w, x)| w.dot(*x));
            let (sum, size) =
                terms.fold((0.0, 0.0), |(sum, size), term| (sum + term, size + term.abs()));
            assert!(
                (sum - pulled).abs() < 1e-12 * size,
                "{law} {elements} {key}: {sum} {pulled} of {size}"
            );
        }
    }
}

/// `|x(p + h) - x(p) - h dx/dp|` goes with the square of `h`.
#[test]
fn what_tangents_leave_over_is_of_second_order() {
    for (law, elements) in KINDS {
        let text = text(law, elements);
        for (key, value) in KEYS {
            let here = simulation(&text, key, value);
            let mut course = Course::new(&here, DEFAULT_MEMORY);
            let state = rest(&mut course, None);
            let change = change(&text, &here, (key, value));
            let tangent = course.tangents(&state, &[change]).expect("a tangent").remove(0);
            let left_over = |share: f64| {
                let there = simulation(&text, key, value * (1.0 + share));
                let near = rest(&mut Course::new(&there, DEFAULT_MEMORY), Some(&state));
                let first = state.positions.iter().zip(&tangent.positions);
                let expected: Vec<_> = first.map(|(x, d)| *x + *d * (share * value)).collect();
                away(&near.positions, &expected)
            };
            // Poisson's ratio lies between two corners of the recovered element's bulk, 0.4 and 0.5.
            let slope = (left_over(2e-4) / left_over(1e-4)).log2();
            assert!((slope - 2.0).abs() < 0.05, "{law} {elements} {key}: {slope}");
        }
    }
}

/// Where displacements alone act, all forces are proportional to Young's modulus, and nothing moves.
#[test]
fn forces_of_displacements_are_proportional_to_stiffness() {
    for (law, elements) in KINDS {
        let text = text(law, elements)
            .replace("9.81 m/s^2", "0 m/s^2")
            .replace("stiffness = \"400 N/m\"\n", "");
        let text = text.split("[[tool]]").next().expect("some text").to_owned()
            + &format!("[solver]\nelements = \"{elements}\"\n");
        let (key, value) = KEYS[0];
        let here = simulation(&text, key, value);
        let mut course = Course::new(&here, DEFAULT_MEMORY);
        let state = rest(&mut course, None);
        let change = change(&text, &here, (key, value));
        let tangent = course.tangents(&state, &[change]).expect("a tangent").remove(0);
        let (forces, along) = (course.forces(&state), course.forces_along(&state, &tangent, key));
        for ((name, force), (_, along)) in forces.iter().zip(along) {
            assert!(force.length() > 0.1, "{name}: {force:?}");
            let error = (along * value - *force).length() / force.length();
            assert!(error < 1e-10, "{law} {elements} {name}: {error:e}");
        }
    }
}

/// Keys by which nothing is differentiated have none.
#[test]
fn other_keys_have_no_derivatives() {
    for key in
        ["young", "body.bar.material.viscosity", "motion.grip.stiffness", "solver.substeps", ""]
    {
        assert_eq!(Dependence::of_key(key), None, "{key}");
    }
}

/// The gradient is linear in Young's modulus, density and the stiffness of springs wherever tissue is, also where it is crushed
/// below its volume floor; all vertices are pinned, so that reactions are the gradient.
#[test]
fn slopes_are_differences_of_gradients_anywhere() {
    let mut random = (1..).map(|n: i32| (f64::from(n) * 0.754_877_666_2).fract() - 0.5);
    for (law, elements) in KINDS {
        let text = text(law, elements);
        for (key, value) in [KEYS[0], KEYS[2], KEYS[3]] {
            let here = simulation(&text, key, value);
            let there = simulation(&text, key, 2.0 * value);
            let kind = here.solver().elements;
            let mut inputs = here.inputs_at(1.0);
            let mut places = here.model().rest_positions.clone();
            for place in &mut places {
                let moved = [0; 3].map(|_| 8e-3 * random.next().unwrap_or_default());
                *place += Vec3::from_f64(moved);
            }
            let pins = (0..).zip(&places).map(|(vertex, target)| Pin { vertex, target: *target });
            inputs.pins = pins.collect();
            let change = Change::linear(here.model(), there.model(), value);
            let [a, b] = [&here, &there].map(|simulation| {
                let reference = Reference::with_elements(simulation.model(), kind);
                reference.reactions(&places, &inputs).expect("reactions")
            });
            let reference = Reference::with_elements(here.model(), kind);
            let slope = reference.slope((here.model(), kind), (&places, &inputs), &change);
            let expected: Vec<_> =
                a.iter().zip(&b).map(|(a, b)| (*b - *a) * (1.0 / value)).collect();
            let error = away(&slope, &expected) / norm(&expected);
            assert!(error < 1e-12, "{law} {elements} {key}: {error:e}");
        }
    }
}

#[test]
fn regions_have_the_derivatives_of_materials() {
    assert_eq!(Dependence::of_key("body.bar.region.0.young"), Some(Dependence::Linear));
    assert_eq!(Dependence::of_key("body.bar.region.lump.poisson"), Some(Dependence::Poisson));
}
