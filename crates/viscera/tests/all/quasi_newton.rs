//! The quasi-Newton method: what a converged step solves, where it comes to rest, how closely it follows motion.

use crate::common::{Random, Run, SNH, STVK, block, exact, material, single_body};
use viscera::material::MaterialModel;
use viscera::measure::measure_tets;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Mat3, Real, Vec3, vec3};
use viscera::settings::{Count, Integrator, Method, SolverSettings};
use viscera::solver::balance::ForceBalance;
use viscera::solver::oscillations::Oscillation;
use viscera::solver::{Inputs, Pin, Solver, Tether};
use viscera::state::State;

const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

/// `c` of SDIRK2.
const SHARE: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

fn settings(integrator: Integrator, iterations: u32) -> SolverSettings {
    SolverSettings {
        method: Method::QuasiNewton,
        integrator,
        iterations: Count::Of(iterations),
        substeps: Count::Of(1),
        ..SolverSettings::xpbd()
    }
}

/// Both laws, viscous and not, springs and attachments: three bodies in two connected parts.
fn bodies<S: Real>() -> Model<S> {
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let mut builder = ModelBuilder::new();
    let viscous = material(SNH, 1e4, 0.4).with_viscosity(0.02).expect("legal");
    builder.add_body(&mesh, &material(STVK, 2e4, 0.3)).expect("a body");
    // Beside the first: a spring without length has no direction.
    let place = |x: &Vec3<f64>| *x + vec3(0.0, 0.0, 0.008);
    let beside = mesh.vertices().iter().map(place).collect();
    let beside = TetMesh::new(beside, mesh.tets().to_vec(), mesh.regions().to_vec());
    let (beside, _) = beside.expect("a legal mesh");
    builder.add_body(&beside, &viscous).expect("a body");
    let alone = material(STVK, 1e4, 0.35).with_viscosity(0.02).expect("legal");
    builder.add_body(&block([0.05, 0.02, 0.02], [3, 1, 2], 0.0), &alone).expect("a body");
    let half = mesh.vertices().len() as u32;
    for v in (0..half).step_by(3) {
        builder.add_spring([v, half + v], 40.0, Some(0.01)).expect("a spring");
        let anchor = beside.vertices()[v as usize];
        builder.add_attachment(half + v, anchor, 30.0).expect("an attachment");
    }
    let model = builder.build().expect("a model");
    assert_eq!(model.part_count(), 2);
    model
}

/// Everything that can act on them, all of it moving.
fn acting<S: Real>(model: &Model<S>, step: u32) -> Inputs<S> {
    let way = f64::from(step);
    let rest = |v: u32| model.rest_positions[v as usize].cast::<f64>();
    let pinned = [0, 5, 17, 73, 78, 80];
    let pin = |vertex: u32| {
        let target = rest(vertex) + vec3(-2e-4, 1e-4, 3e-4) * way;
        Pin { vertex, target: target.cast() }
    };
    let tether = |vertex: u32| {
        let target = rest(vertex) + vec3(0.0, 4e-4 * way, 5e-3);
        Tether { vertex, target: target.cast(), stiffness: S::from_f64(20.0 + f64::from(vertex)) }
    };
    let anchor = |x: &Vec3<S>| *x + vec3(1e-4 * way, 0.0, -2e-4 * way).cast();
    Inputs {
        gravity: GRAVITY.cast(),
        pins: pinned.map(pin).to_vec(),
        tethers: [11, 40, 40, 90].map(tether).to_vec(),
        anchors: model.rest_anchors.iter().map(anchor).collect(),
        forces: vec![(30, vec3(0.02, 0.0, 0.01).cast()), (85, vec3(0.0, -0.01, 0.0).cast())],
        tools: Vec::new(),
    }
}

const DT: f64 = 1.0 / 120.0;

/// The greatest residual of the equations of the last solve after each of some steps, as a share of all loads, and of
/// what rounding of positions makes.
fn residuals<S: Real>(integrator: Integrator, iterations: u32) -> [f64; 2] {
    let model = bodies::<S>();
    let mut solver = Solver::new(&model, &settings(integrator, iterations));
    let mut state = State::at_rest(&model);
    let (mut of_loads, mut of_rounding) = (0.0f64, 0.0f64);
    for step in 1..=6 {
        let inputs = acting(&model, step);
        solver.step(&model, &mut state, &inputs, DT).expect("a legal step");
        let mut balance = ForceBalance::default();
        solver.force_balance(&model, &state, &inputs, &mut balance).expect("a balance");
        assert!(balance.load > 1.0, "{} N of loads", balance.load);
        of_loads = of_loads.max(balance.unbalanced / balance.load);
        // Each of a tetrahedron's corners is off by half a unit of the precision and loads all four; and inertia, by a
        // position and the place that it is a difference to.
        let he = state.multiplier_dt;
        let inertia = |(x, m): (&Vec3<S>, &S)| m.to_f64() * x.cast::<f64>().length() / (he * he);
        let inertia: f64 = state.positions.iter().zip(&model.masses).map(inertia).sum();
        let rounding = 8.0 * balance.rounding + S::EPSILON * inertia;
        of_rounding = of_rounding.max(balance.unbalanced / rounding);
    }
    println!(
        "{integrator:?}, {}, {iterations} passes: {of_loads:.1e} of the loads, {of_rounding:.1e} of rounding",
        S::NAME
    );
    [of_loads, of_rounding]
}

/// The gradient of the incremental potential vanishes: `m' (x - xt)/dt^2 = f(x)` on every free vertex.
#[test]
fn the_equations_of_a_converged_step_hold() {
    for integrator in [Integrator::ImplicitEuler, Integrator::Sdirk2] {
        let [of_loads, _] = residuals::<f64>(integrator, 200);
        assert!(of_loads < 1e-8, "{integrator:?}: {of_loads:e} of the loads");
        let [_, of_rounding] = residuals::<f32>(integrator, 200);
        assert!(of_rounding < 1.0, "{integrator:?}: {of_rounding} of what rounding makes");
    }
}

fn largest(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}

/// XPBD, exact at rest, converges to implicit Euler as well, by another way and with its own prediction.
#[test]
fn a_step_of_implicit_euler_ends_where_xpbd_does() {
    let model = bodies::<f64>();
    let mut solver = Solver::new(&model, &settings(Integrator::ImplicitEuler, 200));
    let unguarded = SolverSettings { step_guard: false, ..exact(600) };
    let mut state = State::at_rest(&model);
    for step in 1..=3 {
        let inputs = acting(&model, step);
        let mut oracle = State { multipliers: Vec::new(), ..state.clone() };
        let mut xpbd = Solver::new(&model, &unguarded);
        xpbd.step(&model, &mut oracle, &inputs, DT).expect("a legal step");
        let before = state.positions.clone();
        solver.step(&model, &mut state, &inputs, DT).expect("a legal step");
        let [apart, moved] = [&oracle.positions, &before].map(|x| largest(&state.positions, x));
        // What the sweeps leave, measured by their own equations.
        let mut balance = ForceBalance::default();
        xpbd.force_balance(&model, &oracle, &inputs, &mut balance).expect("a balance");
        let left = balance.unbalanced / balance.load;
        println!("step {step}: {apart:.1e} m apart, {moved:.1e} m moved, sweeps leave {left:.1e}");
        assert!(left < 1e-8 && apart < 1e-7 * moved, "step {step}: {apart:e} of {moved:e} m");
    }
}

/// A step is two of implicit Euler with the step `c h`: from where it begins, and from where SDIRK2 says.
#[test]
fn a_step_of_sdirk2_is_two_stages_of_implicit_euler() {
    let model = bodies::<f64>();
    let mut solver = Solver::new(&model, &settings(Integrator::Sdirk2, 200));
    let mut state = State::at_rest(&model);
    let (he, d) = (SHARE * DT, (1.0 - SHARE) * DT);
    for step in 1..=4 {
        let inputs = acting(&model, step);
        let stage = |state: &State<f64>, inputs: &Inputs<f64>| {
            let mut euler = Solver::new(&model, &settings(Integrator::ImplicitEuler, 200));
            let mut end = State { learned: Default::default(), ..state.clone() };
            euler.step(&model, &mut end, inputs, he).expect("a legal step");
            let pairs = end.positions.iter().zip(&state.positions);
            // Of the way that it went, whatever the energy limit has left of it.
            end.velocities = pairs.map(|(end, start)| (*end - *start) * (1.0 / he)).collect();
            end
        };
        let mut on_the_way = inputs.clone();
        for pin in &mut on_the_way.pins {
            let x = state.positions[pin.vertex as usize];
            pin.target = x + (pin.target - x) * SHARE;
        }
        let first = stage(&state, &on_the_way);
        let mut second = state.clone();
        for v in 0..model.vertex_count() {
            let acceleration = (first.velocities[v] - state.velocities[v]) * (1.0 / he);
            second.positions[v] += first.velocities[v] * d;
            second.velocities[v] += acceleration * d;
        }
        let expected = stage(&second, &inputs);
        let before = state.positions.clone();
        solver.step(&model, &mut state, &inputs, DT).expect("a legal step");
        let [apart, moved] = [&expected.positions, &before].map(|x| largest(&state.positions, x));
        let faster = largest(&state.velocities, &expected.velocities);
        let speed = largest(&expected.velocities, &vec![Vec3::ZERO; model.vertex_count()]);
        println!(
            "step {step}: {apart:.1e} m of {moved:.1e} m, {faster:.1e} m/s of {speed:.1e} m/s"
        );
        assert!(apart < 1e-8 * moved, "step {step}: {apart:e} of {moved:e} m");
    }
    assert_eq!(solver.rejected_steps(), 0);
}

fn bar<S: Real>(law: MaterialModel, young: f64, poisson: f64, cells: [usize; 3]) -> Model<S> {
    single_body(&block([0.06, 0.02, 0.02], cells, 0.1), &material(law, young, poisson))
}

/// Held where `x = 0`.
fn hanging<S: Real>(model: &Model<S>) -> Inputs<S> {
    let rest = (0u32..).zip(&model.rest_positions);
    let pins = rest.filter(|(_, x)| x.x.to_f64() < 1e-9);
    let pins = pins.map(|(vertex, &target)| Pin { vertex, target }).collect();
    Inputs { gravity: GRAVITY.cast(), pins, ..Inputs::default() }
}

/// Three seconds, four fifths of all velocities kept a frame: what swings has 1e-8 of it left.
fn settle<'a, S: Real>(model: &'a Model<S>, settings: &SolverSettings) -> Run<'a, S> {
    let mut run = Run::new(model, settings);
    let inputs = hanging(model);
    for _ in 0..180 {
        run.frame(&inputs, 0.8);
    }
    run
}

fn sag<S: Real>(run: &Run<'_, S>) -> (Vec<Vec3<f64>>, f64) {
    let pairs = run.state.positions.iter().zip(&run.model.rest_positions);
    let moved: Vec<Vec3<f64>> = pairs.map(|(x, rest)| x.cast() - rest.cast()).collect();
    let size = moved.iter().map(|u| u.length()).fold(0.0, f64::max);
    (moved, size)
}

/// Where it comes to rest is the tissue's: neither passes, substeps nor the integrator change the apparent stiffness.
fn rests_where_xpbd_does(passes: &[u32], substeps: &[u32]) {
    for (law, poisson) in [(STVK, 0.3), (SNH, 0.45)] {
        let model = bar::<f64>(law, 2e4, poisson, [4, 2, 2]);
        let oracle = settle(&model, &exact(40));
        let (expected, size) = sag(&oracle);
        let work = expected.iter().zip(&model.masses).map(|(u, m)| m * u.z).sum::<f64>();
        for &iterations in passes {
            for &substeps in substeps {
                for integrator in [Integrator::Sdirk2, Integrator::ImplicitEuler] {
                    let substeps = Count::Of(substeps);
                    let settings = SolverSettings { substeps, ..settings(integrator, iterations) };
                    let (moved, _) = sag(&settle(&model, &settings));
                    let apart = largest(&moved, &expected) / size;
                    let given = moved.iter().zip(&model.masses).map(|(u, m)| m * u.z).sum::<f64>();
                    let what = format!("{law:?}, {integrator:?}, {iterations}, {substeps:?}");
                    println!(
                        "{what}: {apart:.1e} of {size:.1e} m, stiffness {:.1e}",
                        work / given - 1.0
                    );
                    assert!(apart < 1e-4, "{what}: {apart:e} of {size:e} m");
                    assert!((work / given - 1.0).abs() < 1e-3, "{what}");
                }
            }
        }
    }
}

#[test]
fn it_rests_where_xpbd_does() {
    rests_where_xpbd_does(&[5], &[1]);
}

/// A single pass per solve leads there as well, if slowly: with implicit Euler, whose last direction is never taken
/// unchecked, it is not spent on the start alone.
#[test]
fn one_pass_moves_what_hangs() {
    let model = bar::<f64>(SNH, 2e4, 0.3, [4, 2, 2]);
    let (_, expected) = sag(&settle(&model, &settings(Integrator::Sdirk2, 20)));
    for integrator in [Integrator::Sdirk2, Integrator::ImplicitEuler] {
        let (_, found) = sag(&settle(&model, &settings(integrator, 1)));
        let off = (found / expected - 1.0).abs();
        assert!(off < 0.01, "{integrator:?}: {found:e} m of {expected:e} m");
    }
}

/// The slowest oscillation of a slender bar is that of a clamped beam (Euler and Bernoulli), `1.875^2/L^2 sqrt(E I/rho A)`.
/// A beam of this slenderness swings 3 % more slowly by its shear and its rotary inertia, and this mesh 8 % faster,
/// because linear tetrahedra are too stiff in bending. Its second is 6.27 times faster and takes part by
/// `0.434/(0.783 6.27^2)` of it; that along the bar, `pi/2L sqrt(E/rho)`, by `0.900/(0.783 9.28^2)`.
#[test]
fn oscillations_are_those_of_a_clamped_beam() {
    for young in [5e4, 5e5] {
        let mesh = block([0.12, 0.02, 0.02], [36, 6, 6], 0.0);
        let tissue = material(SNH, young, 0.0).with_viscosity(0.5).expect("legal");
        let model = single_body::<f32>(&mesh, &tissue);
        let mut solver = Solver::new(&model, &settings(Integrator::Sdirk2, 8));
        let oscillations = solver.oscillations(&hanging(&model));
        let period = oscillations.slowest_period();
        let stiffness = young * 0.02 * 0.02 / 12.0 / 1000.0;
        let omega = 1.875_f64.powi(2) / 0.12_f64.powi(2) * stiffness.sqrt();
        let beam = 2.0 * std::f64::consts::PI / omega;
        assert!((period / beam - 1.0).abs() < 0.1, "{period} s, a beam's {beam} s");
        // Diagonals of the mesh part the two directions in which it bends; a load along either excites both.
        let [all] = oscillations.parts() else { panic!("one part: {oscillations:?}") };
        let about = |times: f64| {
            let is_there = |one: &&Oscillation| (period / one.period / times - 1.0).abs() < 0.1;
            all.iter().filter(is_there).map(|one| one.weight).sum::<f64>()
        };
        let [slowest, second, along] = [1.0, 6.27, 9.28].map(about);
        // Of two directions; shear makes the second slower and lets more of it take part.
        let expected = (0.434_f64 / 0.783 / 6.27_f64.powi(2)).powi(2);
        let share = second / slowest / expected;
        assert!((1.0..2.0).contains(&share), "{share}");
        let expected = (0.900_f64 / 0.783 / 9.28_f64.powi(2)).powi(2) / 2.0;
        let share = along / slowest / expected;
        assert!((share - 1.0).abs() < 0.2, "{share}");
        let loose = Inputs { pins: Vec::new(), ..hanging(&model) };
        assert_eq!(solver.oscillations(&loose).slowest_period(), f64::INFINITY);
    }
}

/// A body of twice the size gives way to its weight four times as far, whatever it weighs; what is four times as stiff by a quarter.
#[test]
fn parts_are_compared_by_how_far_they_move() {
    let mut builder = ModelBuilder::new();
    for (size, young) in [(1.0, 5e4), (2.0, 5e4), (1.0, 2e5)] {
        let mesh = block([0.06, 0.02, 0.02].map(|x| x * size), [6, 2, 2], 0.0);
        builder.add_body(&mesh, &material(SNH, young, 0.3)).expect("a body");
    }
    let model = builder.build::<f32>().expect("a model");
    let mut solver = Solver::new(&model, &settings(Integrator::Sdirk2, 8));
    let oscillations = solver.oscillations(&hanging(&model));
    let moved = |part: &Vec<Oscillation>| part.iter().map(|one| one.weight).sum::<f64>().sqrt();
    let moved: Vec<f64> = oscillations.parts().iter().map(moved).collect();
    let [one, large, stiff] = moved[..] else { panic!("three parts: {moved:?}") };
    // Systems are solved to 3 %.
    assert!((large / one / 4.0 - 1.0).abs() < 0.03, "{large} of {one}");
    assert!((stiff / one / 0.25 - 1.0).abs() < 0.03, "{stiff} of {one}");
}

#[test]
#[ignore = "slow: many passes and substeps"]
fn it_rests_where_xpbd_does_at_length() {
    rests_where_xpbd_does(&[5, 10, 200], &[1, 2, 4]);
}

/// Places [m] after a fifth of a second of swinging in so many steps.
fn swung(model: &Model<f64>, settings: &SolverSettings, steps: u32) -> Vec<Vec3<f64>> {
    let inputs = hanging(model);
    let mut state = State::at_rest(model);
    let mut solver = Solver::new(model, settings);
    for _ in 0..steps {
        solver.step(model, &mut state, &inputs, 0.2 / f64::from(steps)).expect("a legal step");
    }
    assert_eq!(solver.rejected_steps(), 0);
    state.positions
}

/// Twice the steps, a fourth of the error for SDIRK2, and half of it for implicit Euler.
fn follows_motion(tissues: &[(MaterialModel, f64)], steps: &[u32]) {
    let explicit = SolverSettings { method: Method::Explicit, ..SolverSettings::xpbd() };
    for &(law, poisson) in tissues {
        let model = bar::<f64>(law, 2e4, poisson, [3, 1, 1]);
        // One small step each. Of first order: what is left of it after extrapolation is of second, in steps a
        // hundred times smaller.
        let [coarse, fine] = [4000, 8000].map(|steps| swung(&model, &explicit, steps));
        let truth: Vec<_> = fine.iter().zip(&coarse).map(|(a, b)| *a * 2.0 - *b).collect();
        let size = largest(&truth, &model.rest_positions);
        for (integrator, order) in [(Integrator::Sdirk2, 2), (Integrator::ImplicitEuler, 1)] {
            let error = |&steps: &u32| {
                largest(&swung(&model, &settings(integrator, 100), steps), &truth) / size
            };
            let errors: Vec<f64> = steps.iter().map(error).collect();
            println!("{law:?}, {poisson}, {integrator:?}: {errors:?} of {size:.1e} m");
            for pair in errors.windows(2) {
                let ratio = pair[0] / pair[1];
                let expected = f64::from(1 << order);
                // The next term of the error, a fifth of the first.
                let bounds = 0.8 * expected..1.25 * expected;
                assert!(bounds.contains(&ratio), "{law:?}, {integrator:?}: {ratio}");
            }
        }
    }
}

#[test]
fn motion_is_followed_to_second_order() {
    follows_motion(&[(SNH, 0.4)], &[64, 128]);
}

#[test]
#[ignore = "slow: more steps and tissues"]
fn motion_is_followed_to_second_order_at_length() {
    follows_motion(&[(STVK, 0.3), (SNH, 0.4), (SNH, 0.45)], &[128, 256, 512]);
}

/// The largest distance [m] between two states of one model.
fn moved<S: Real>(a: &State<S>, b: &State<S>) -> f64 {
    let pairs = a.positions.iter().zip(&b.positions);
    pairs.map(|(a, b)| (a.cast::<f64>() - b.cast()).length()).fold(0.0, f64::max)
}

fn stays_at_rest<S: Real>(frames: u32) {
    for (law, poisson) in [(STVK, 0.3), (SNH, 0.45)] {
        let model = bar::<S>(law, 2e4, poisson, [4, 2, 2]);
        let inputs = hanging(&model);
        for integrator in [Integrator::Sdirk2, Integrator::ImplicitEuler] {
            let mut settled = settle(&model, &settings(integrator, 10));
            let rest = settled.state.clone();
            let mut after = 0.0f64;
            for _ in 0..frames {
                settled.frame(&inputs, 1.0);
                after = after.max(moved(&settled.state, &rest) / 0.06);
            }
            // One pass a frame moves it as little.
            let mut few = Run::new(&model, &settings(integrator, 1));
            few.state = State { learned: Default::default(), ..rest.clone() };
            let mut most = 0.0f64;
            for _ in 0..frames {
                few.frame(&inputs, 1.0);
                most = most.max(moved(&few.state, &rest) / 0.06);
            }
            let what = format!("{law:?}, {integrator:?}, {}", S::NAME);
            println!("{what}: {after:.1e} of its size; {most:.1e} with one pass");
            assert!(after < 1e-6, "{what}: moves by {after:e} of its size");
            assert!(most < 1e-5, "{what}: one pass moves it by {most:e} of its size");
        }
    }
}

#[test]
fn what_has_settled_stays() {
    stays_at_rest::<f32>(30);
}

#[test]
#[ignore = "slow: ten minutes in both precisions"]
fn what_has_settled_stays_at_length() {
    stays_at_rest::<f32>(36_000);
    stays_at_rest::<f64>(36_000);
}

/// A rigid motion strains nothing: every vertex goes as far as the integrator takes a point. SDIRK2 is exact for a
/// constant acceleration; implicit Euler adds `n(n + 1)/2` steps of `g dt^2`.
#[test]
fn what_nothing_holds_falls_as_a_point_does() {
    let frames = 60;
    for law in [STVK, SNH] {
        for (integrator, iterations) in
            [(Integrator::Sdirk2, 2), (Integrator::Sdirk2, 10), (Integrator::ImplicitEuler, 10)]
        {
            let model = bar::<f64>(law, 1e4, 0.45, [3, 2, 2]);
            let mut run = Run::new(&model, &settings(integrator, iterations));
            let thrown = vec3(1.0, -2.0, 5.0);
            run.state.velocities.fill(thrown);
            let inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
            for _ in 0..frames {
                run.frame(&inputs, 1.0);
            }
            let steps = f64::from(frames);
            let doubled = match integrator {
                Integrator::Sdirk2 => steps * steps,
                Integrator::ImplicitEuler => steps * (steps + 1.0),
            };
            let fall = thrown * (steps * run.dt) + GRAVITY * (0.5 * doubled * run.dt * run.dt);
            let place = |x: &Vec3<f64>| *x + fall;
            let expected: Vec<_> = model.rest_positions.iter().map(place).collect();
            let apart = largest(&run.state.positions, &expected);
            let mut tets = Vec::new();
            measure_tets(&model, &run.state.positions, &mut tets);
            let strain = tets.iter().flat_map(|t| t.stretches).map(|s| (s - 1.0).abs());
            let strain = strain.fold(0.0, f64::max);
            println!("{law:?}, {integrator:?}, {iterations}: {apart:.1e} m, strain {strain:.1e}");
            // Sixty steps of two stages, some ten roundings of places of metres in each, and of cells of a centimetre.
            let rounding = steps * 20.0 * f64::EPSILON * fall.length();
            assert!(apart < rounding && strain < rounding / 0.01, "{apart:e} m, strain {strain:e}");
            assert_eq!(run.solver.rejected_steps(), 0);
        }
    }
}

/// A body that is turned as a whole, with all that acts on it, does the same, however few passes there are: the
/// curvature that steps are made with turns with the tissue.
#[test]
fn a_body_that_is_turned_moves_alike() {
    for (law, poisson) in [(STVK, 0.3), (SNH, 0.45)] {
        let model = bar::<f64>(law, 1e4, poisson, [4, 2, 2]);
        let turned = Random(3).rotation();
        let run = |turn: Mat3<f64>| {
            let mut run = Run::new(&model, &settings(Integrator::Sdirk2, 5));
            run.state.positions.iter_mut().for_each(|x| *x = turn * *x);
            let mut inputs = hanging(&model);
            inputs.gravity = turn * inputs.gravity;
            inputs.pins.iter_mut().for_each(|pin| pin.target = turn * pin.target);
            (0..12).for_each(|_| run.frame(&inputs, 1.0));
            run.state.positions
        };
        let expected: Vec<_> = run(Mat3::IDENTITY).into_iter().map(|x| turned * x).collect();
        let apart = largest(&run(turned), &expected);
        println!("{law:?}: {apart:.1e} m apart");
        // Centimetres of motion; passes that stop early let round-off of 1e-17 m grow from frame to frame.
        assert!(apart < 1e-8, "{law:?}: {apart:e} m apart");
    }
}
