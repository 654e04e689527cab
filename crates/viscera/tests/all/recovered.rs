//! Recovered-gradient tetrahedra in explicit steps and in the quasi-Newton method: what a body of them is, and what
//! refuses them.

use crate::common::{Random, SNH, STVK, block, material, single_body};
use viscera::layout::{Domains, Smoothing};
use viscera::material::Material;
use viscera::measure::measure_tets;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::rest::WayToRest;
use viscera::scalar::lanes::Instructions;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::scene::Scene;
use viscera::settings::{Count, DeviceRequest, Elements, Method, SolverSettings, Threads};
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::balance::ForceBalance;
use viscera::solver::recovered::Recovered;
use viscera::solver::{Inputs, Pin, Solver, StepError};
use viscera::state::State;

const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

/// The methods that have them.
const METHODS: [Method; 2] = [Method::Explicit, Method::QuasiNewton];

fn explicit(elements: Elements) -> SolverSettings {
    by(Method::Explicit, elements)
}

fn by(method: Method, elements: Elements) -> SolverSettings {
    SolverSettings { method, elements, ..SolverSettings::default() }
}

/// Held where `x = 0`.
fn held<S: Real>(model: &Model<S>) -> Inputs<S> {
    let rest = (0u32..).zip(&model.rest_positions);
    let at_wall = rest.filter(|(_, x)| x.x.to_f64() < 1e-9);
    let pins = at_wall.map(|(vertex, &target)| Pin { vertex, target }).collect();
    Inputs { pins, ..Inputs::default() }
}

/// Over a second of swinging the energy, that of the element's definition, stays in a band: forces are its derivatives, in
/// the middle of large motion, of a body of two materials that meet.
#[test]
fn energy_stays_in_a_band() {
    let mesh = block([0.06, 0.02, 0.02], [6, 2, 2], 0.1);
    let regions = (0..mesh.tets().len()).map(|tet| {
        let [a, b, c, d] = mesh.corners(tet);
        u32::from((a + b + c + d).x > 0.12) + 1
    });
    let (vertices, tets) = (mesh.vertices().to_vec(), mesh.tets().to_vec());
    let mesh = TetMesh::new(vertices, tets, regions.collect()).expect("the same mesh").0;
    let mut builder = ModelBuilder::new();
    let body = builder.add_body(&mesh, &material(SNH, 4e3, 0.45)).expect("a body");
    builder.set_region_material(body, 2, &material(SNH, 2e3, 0.3)).expect("a region");
    let model = builder.build::<f64>().expect("a model");
    let mut state = State::at_rest(&model);
    for (v, x) in state.velocities.iter_mut().zip(&model.rest_positions) {
        *v = vec3(3.0 * x.x, -20.0 * x.x * x.x, 4.0 * x.x);
    }
    let domains = Domains::new(&model, Smoothing::RECOVERED);
    let mut elastic = Recovered::new(&domains);
    let settings = SolverSettings { explicit_safety: 0.5, ..explicit(Elements::Recovered) };
    let mut solver = Solver::new(&model, &settings);
    let (mut low, mut high, mut most) = (f64::INFINITY, 0.0f64, 0.0f64);
    for _ in 0..60 {
        solver.step(&model, &mut state, &Inputs::default(), 1.0 / 60.0).expect("a legal step");
        elastic.evaluate(&domains, &model.materials, &state.positions);
        let stored = elastic.energy(&domains, &model.materials);
        let terms = state.velocities.iter().zip(&model.masses);
        let kinetic: f64 = terms.map(|(v, mass)| 0.5 * mass * v.length_squared()).sum();
        (low, high) = (low.min(kinetic + stored), high.max(kinetic + stored));
        most = most.max(stored);
    }
    // Against what is stored at times: the rest is that of free flight and says nothing of the element's forces.
    println!("{low} to {high} J, {most} J stored");
    assert!(most > 0.1 * high, "{most} of {high} J");
    assert!(high - low < 0.02 * most, "{low} to {high} J, {most} J stored");
}

/// How a bar two cells thick swings that was let go with the velocities of its first oscillation: frequency [1/s], and the
/// share of the amplitude that is left from one turn to the next.
fn swinging(settings: &SolverSettings, tissue: &Material) -> (f64, f64) {
    let mesh = block([0.12, 0.02, 0.02], [12, 2, 2], 0.0);
    let model = single_body::<f64>(&mesh, tissue);
    let inputs = held(&model);
    let mut state = State::at_rest(&model);
    for (v, x) in state.velocities.iter_mut().zip(&model.rest_positions) {
        *v = vec3(0.0, 0.0, 1.0) * (x.x / 0.12).powi(2) * 0.01;
    }
    let mut solver = Solver::new(&model, settings);
    let dt = 1e-3;
    let tip = (0..model.vertex_count()).max_by(|&a, &b| {
        let at = |v: usize| model.rest_positions[v].x;
        at(a).total_cmp(&at(b))
    });
    let tip = tip.expect("a vertex");
    let height = |state: &State<f64>| state.positions[tip].z - model.rest_positions[tip].z;
    let (mut crossings, mut turns) = (Vec::new(), Vec::new());
    let (mut largest, mut before) = (0.0f64, 0.0f64);
    for step in 1..1000 {
        solver.step(&model, &mut state, &inputs, dt).expect("a legal step");
        let now = height(&state);
        if before * now < 0.0 {
            crossings.push(dt * (f64::from(step) - now / (now - before)));
            turns.push(largest);
            largest = 0.0;
        }
        largest = largest.max(now.abs());
        before = now;
    }
    let count = crossings.len() - 1;
    let frequency = 0.5 * count as f64 / (crossings[count] - crossings[0]);
    let left = (turns[count] / turns[1]).powf(1.0 / (count - 1) as f64);
    (frequency, left)
}

/// A coarse slender bar bends as a beam does (Euler and Bernoulli, less 3 % for shear and rotary inertia at this slenderness),
/// and as a Kelvin-Voigt body loses of its amplitude: `exp(-pi tau w/2)` from turn to turn. Linear tetrahedra do not.
#[test]
fn a_coarse_bar_swings_as_a_beam_does() {
    let (young, viscosity) = (5e4, 2e-3);
    let tissue = material(SNH, young, 0.0).with_viscosity(viscosity).expect("legal");
    let stiffness = young * 0.02 * 0.02 / 12.0 / 1000.0;
    let omega = 0.97 * 1.875_f64.powi(2) / 0.12_f64.powi(2) * stiffness.sqrt();
    let expected = omega / (2.0 * std::f64::consts::PI);
    let (plain, _) = swinging(&explicit(Elements::Plain), &tissue);
    assert!(plain > 1.1 * expected, "{plain} of {expected}");
    for method in METHODS {
        let (frequency, left) = swinging(&by(method, Elements::Recovered), &tissue);
        println!("{method}: {frequency} 1/s, linear {plain}, a beam {expected}; {left} left");
        assert!((frequency / expected - 1.0).abs() < 0.03, "{frequency} of {expected}");
        let damped = libm::exp(-0.5 * std::f64::consts::PI * viscosity * omega);
        let lost = (1.0 - left) / (1.0 - damped);
        assert!((lost - 1.0).abs() < 0.05, "{method}: {left} left, {damped} expected");
    }
}

/// A viscous bar under its weight, after a second and a half.
fn settled<S: Real>(method: Method) -> (Model<S>, State<S>, Inputs<S>, Solver<S>) {
    let mesh = block([0.08, 0.02, 0.02], [8, 2, 2], 0.1);
    let tissue = material(SNH, 2e4, 0.45).with_viscosity(0.05).expect("legal");
    let model = single_body::<S>(&mesh, &tissue);
    let inputs = Inputs { gravity: GRAVITY.cast(), ..held(&model) };
    let mut state = State::at_rest(&model);
    let mut solver = Solver::new(&model, &by(method, Elements::Recovered));
    for _ in 0..90 {
        solver.step(&model, &mut state, &inputs, 1.0 / 60.0).expect("a legal step");
    }
    (model, state, inputs, solver)
}

/// At rest forces are in balance, the wall carries the weight, and all that measures a way to rest knows of the element:
/// to linear tetrahedra the way would be long.
#[test]
fn what_is_at_rest_is_known_to_be() {
    for method in METHODS {
        let (model, state, inputs, mut solver) = settled::<f64>(method);
        let mut balance = ForceBalance::default();
        solver.force_balance(&model, &state, &inputs, &mut balance).expect("a balance");
        let residual = balance.relative_residual();
        assert!(residual < 1e-6, "{residual:e}");
        let holding = inputs.pins.iter().map(|pin| balance.residual[pin.vertex as usize].z);
        let holding: f64 = holding.sum();
        let weight = 9.81 * model.masses.iter().sum::<f64>();
        assert!((holding / weight - 1.0).abs() < 1e-3, "{holding} N hold {weight} N");
        assert!(balance.stiffness_error().abs() < 1e-3, "{}", balance.stiffness_error());
        let velocities = vec![Vec3::ZERO; model.vertex_count()];
        let way = |elements| {
            let way = WayToRest::measure(&model, &state.positions, &velocities, &inputs, elements);
            way.expect("something is held").error()
        };
        let (own, linear) = (way(Elements::Recovered), way(Elements::Plain));
        assert!(own < 2e-3 && linear > 0.1, "{own:e}, {linear:e}");
    }
}

/// Any number of threads, any instructions; viscous tissue of both laws, two bodies.
#[test]
fn bits_do_not_depend_on_threads_and_instructions() {
    let places = |method: Method, threads: u32, instructions: Instructions| {
        let mut builder = ModelBuilder::new();
        for law in [SNH, STVK] {
            let tissue = material(law, 5e3, 0.4).with_viscosity(0.01).expect("legal");
            let mesh = block([0.08, 0.04, 0.04], [16, 8, 8], 0.1);
            builder.add_body(&mesh, &tissue).expect("a body");
        }
        let model = builder.build::<f32>().expect("a model");
        let inputs = Inputs { gravity: GRAVITY.cast(), ..held(&model) };
        let mut state = State::at_rest(&model);
        let threads = Threads::Count(threads);
        let settings = SolverSettings { threads, ..by(method, Elements::Recovered) };
        let mut solver = Solver::new(&model, &settings);
        solver.use_instructions(instructions);
        for _ in 0..3 {
            solver.step(&model, &mut state, &inputs, 1.0 / 60.0).expect("a legal step");
        }
        (state.positions, state.velocities)
    };
    for method in METHODS {
        let first = places(method, 1, Instructions::Avx2);
        assert!(first == places(method, 3, Instructions::Avx2), "{method}: threads");
        assert!(first == places(method, 1, Instructions::Portable), "{method}: instructions");
    }
}

const SCENE: &str = r#"
[[body]]
name = "bar"
shape = "block"
size = ["80 mm", "20 mm", "20 mm"]
cells = [4, 1, 1]
material = { young = "20 kPa", poisson = 0.45, density = "1000 kg/m^3" }
[[fixing]]
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
[solver]
elements = "recovered"
"#;

fn simulation(overrides: &[(&str, &str)]) -> Result<Simulation<f32>, String> {
    let scene = Scene::parse("bar.toml", SCENE, overrides).map_err(|error| error.to_string())?;
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    Simulation::new(scene, assembly).map_err(|error| error.to_string())
}

/// A step of the quasi-Newton method takes about as many passes as of linear tetrahedra, though its preconditioner is that of
/// these: no more to a hundredth of the step's error, and at most 1.3 times as many to a thousandth.
#[test]
fn a_step_takes_as_many_passes() {
    for poisson in [0.3, 0.45, 0.49] {
        let passes = |elements: Elements| {
            let mesh = block([0.08, 0.02, 0.02], [16, 4, 4], 0.1);
            let model = single_body::<f64>(&mesh, &material(SNH, 5e4, poisson));
            let inputs = Inputs { gravity: GRAVITY, ..held(&model) };
            let of = |passes: u32| SolverSettings {
                iterations: Count::Of(passes),
                history: 10,
                ..by(Method::QuasiNewton, elements)
            };
            let mut before = State::at_rest(&model);
            let mut solver = Solver::new(&model, &of(80));
            for _ in 0..6 {
                solver.step(&model, &mut before, &inputs, 1.0 / 60.0).expect("a legal step");
            }
            let after = |passes: u32| {
                let mut state = before.clone();
                let mut solver = Solver::new(&model, &of(passes));
                solver.step(&model, &mut state, &inputs, 1.0 / 60.0).expect("a legal step");
                state.positions
            };
            let truth = after(300);
            let error = |places: &[Vec3<f64>]| {
                let squares = places.iter().zip(&truth).map(|(a, b)| (*a - *b).length_squared());
                squares.sum::<f64>().sqrt()
            };
            let whole = error(&before.positions);
            let for_share = |share| (1..100).find(|&passes| error(&after(passes)) < share * whole);
            [1e-2, 1e-3].map(|share| for_share(share).expect("it converges"))
        };
        let (plain, recovered) = (passes(Elements::Plain), passes(Elements::Recovered));
        println!("nu {poisson}: {recovered:?} passes, linear {plain:?}");
        assert!(
            recovered[0] <= plain[0],
            "{poisson}: {} of {} to a hundredth",
            recovered[0],
            plain[0]
        );
        for (recovered, plain) in recovered.into_iter().zip(plain) {
            assert!(
                f64::from(recovered) <= 1.3 * f64::from(plain),
                "{poisson}: {recovered} of {plain}"
            );
        }
    }
}

/// "auto" chooses between those that have them, also where the setting comes later; the other says which have.
#[test]
fn methods_without_them_say_which_has() {
    let mut automatic = simulation(&[]).expect("a simulation");
    assert!(METHODS.contains(&automatic.solver().method), "{}", automatic.solver().method);
    automatic.advance_frame().expect("a frame");
    let stiff = [("body.bar.material.young", "5 MPa"), ("body.bar.material.poisson", "0.499")];
    let method = |elements: &'static str| {
        let overrides = [&stiff[..], &[("solver.elements", elements)]].concat();
        simulation(&overrides).expect("a simulation").solver().method
    };
    assert_eq!([method("plain"), method("recovered")], [Method::QuasiNewton; 2]);
    let changed = |elements: &str| [("solver.elements".to_owned(), elements.to_owned())];
    automatic.change(&changed("plain")).expect("other elements");
    automatic.advance_frame().expect("a frame");
    automatic.change(&changed("recovered")).expect("other elements");
    automatic.advance_frame().expect("a frame");
    let method = "xpbd";
    let refused = simulation(&[("solver.method", method)]).expect_err("linear ones only");
    assert!(refused.contains("\"quasi_newton\" and \"explicit\""), "{refused}");
    assert!(refused.contains("`elements = \"plain\"`"), "{refused}");
    let named = [("solver.method".to_owned(), method.to_owned())];
    let refused = automatic.change(&named).expect_err("linear ones only").to_string();
    assert!(refused.contains(method), "{refused}");
    // Nothing of what was refused has been done.
    automatic.advance_frame().expect("a frame");
    let model = single_body::<f32>(&block([0.02; 3], [1; 3], 0.0), &material(SNH, 1e4, 0.3));
    let settings = SolverSettings { method: Method::Xpbd, ..explicit(Elements::Recovered) };
    let settings = SolverSettings { device: DeviceRequest::Cpu, ..settings };
    let mut state = State::at_rest(&model);
    let step = Solver::new(&model, &settings).step(&model, &mut state, &Inputs::default(), 1e-3);
    assert_eq!(step, Err(StepError::Elements { method: Method::Xpbd }));
}

/// Vertices of a bar are led away by up to three of its lengths within five frames at most and let go, or all of them are put
/// anywhere. The most energy that the body has then at the end of a step, over what it had when it was let go, and the
/// tetrahedra that are inside out a second later.
fn let_go(method: Method, poisson: f64, seed: u64, scrambles: bool) -> (f64, usize) {
    let length = 0.06;
    let mesh = block([length, 0.02, 0.02], [6, 2, 2], 0.2);
    let model = single_body::<f32>(&mesh, &material(SNH, 5e3, poisson));
    let exact = single_body::<f64>(&mesh, &material(SNH, 5e3, poisson));
    let wall = held(&model);
    let mut solver = Solver::new(&model, &by(method, Elements::Recovered));
    let (mut state, mut random) = (State::at_rest(&model), Random(seed));
    let rest = mesh.vertices();
    if scrambles {
        let size = random.uniform(0.1, 1.0) * length;
        for (x, rest) in state.positions.iter_mut().zip(rest) {
            *x = (*rest + random.vector(size)).cast();
        }
    } else {
        let free: Vec<u32> = (0..).zip(rest).filter(|(_, x)| x.x > 1e-9).map(|(v, _)| v).collect();
        let led: Vec<(u32, Vec3<f64>)> = (0..1 + random.next() % 7)
            .map(|_| {
                let way = random.vector(1.0);
                let way = way * (random.uniform(0.0, 3.0 * length) / way.length());
                (free[random.next() as usize % free.len()], way)
            })
            .collect();
        let steps = 2 * (1 + random.next() % 5);
        for step in 1..=steps {
            let share = step as f64 / steps as f64;
            let led = led.iter().map(|&(vertex, way)| Pin {
                vertex,
                target: (rest[vertex as usize] + way * share).cast(),
            });
            let pins = wall.pins.iter().copied().chain(led).collect();
            let inputs = Inputs { pins, ..Inputs::default() };
            solver.step(&model, &mut state, &inputs, 1.0 / 120.0).expect("a legal step");
        }
    }
    let domains = Domains::new(&exact, Smoothing::RECOVERED);
    let mut elastic = Recovered::new(&domains);
    let mut energy = |state: &State<f32>| {
        assert!(state.is_finite(), "{method}, seed {seed}: not finite");
        let places: Vec<Vec3<f64>> = state.positions.iter().map(|x| x.cast()).collect();
        elastic.evaluate(&domains, &exact.materials, &places);
        let terms = state.velocities.iter().zip(&exact.masses);
        let kinetic: f64 =
            terms.map(|(v, mass)| 0.5 * mass * v.cast::<f64>().length_squared()).sum();
        kinetic + elastic.energy(&domains, &exact.materials)
    };
    // The wall holds its vertices where they are at rest: what was put elsewhere there goes back in the first step.
    if scrambles {
        for pin in &wall.pins {
            state.positions[pin.vertex as usize] = pin.target;
        }
    }
    let had = energy(&state);
    let mut most = 0.0f64;
    for _ in 0..120 {
        solver.step(&model, &mut state, &wall, 1.0 / 120.0).expect("a legal step");
        most = most.max(energy(&state));
    }
    let mut tets = Vec::new();
    measure_tets(&model, &state.positions, &mut tets);
    (most / had, tets.iter().filter(|tet| tet.is_inverted()).count())
}

/// No step gains energy but for the rounding of single precision, which is that of strains: places over a cell; and at
/// most one tetrahedron in 300 ends inside out.
fn all_let_go(seeds: std::ops::Range<u64>, scrambles: bool) {
    for method in METHODS {
        let (mut gained, mut inverted, mut bodies) = (0.0f64, 0, 0);
        for seed in seeds.clone() {
            for poisson in [0.3, 0.45] {
                let (most, inside_out) = let_go(method, poisson, seed, scrambles);
                gained = gained.max(most);
                inverted += inside_out;
                bodies += 1;
            }
        }
        println!("{method}: at most {gained}, {inverted} inside out of {bodies} bodies");
        assert!(gained < 1.0 + 64.0 * f64::from(f32::EPSILON), "{method}: {gained}");
        // Without the volume floor one in 120, by the explicit method. A bar has 120 tetrahedra.
        assert!(inverted * 300 <= bodies * 120, "{method}: {inverted} of {bodies} bodies");
    }
}

#[test]
fn what_is_let_go_gains_no_energy() {
    all_let_go(0..3, false);
    all_let_go(0..3, true);
}

#[test]
#[ignore = "slow: many seeds by both methods"]
fn what_is_let_go_gains_no_energy_at_length() {
    all_let_go(0..100, false);
    all_let_go(0..100, true);
}
