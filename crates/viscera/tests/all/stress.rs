//! Rough handling: violent grabs, and calls that make no sense. Tissue may crumple, a caller may be
//! wrong; neither may end in numbers that are none, or in a panic.

use crate::common::potential::Outside;
use crate::common::{Random, Run, SNH, STVK, block, exact, material, single_body};
use viscera::elements::attachment::Attachments;
use viscera::elements::spring::Springs;
use viscera::layout::Layout;
use viscera::measure::measure_tets;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder, ModelError};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Acceleration, AndersonGuard, AndersonOn, Colors, Count, SolverSettings};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver, StepError};
use viscera::state::State;

/// Tetrahedra turned inside out, and the largest displacement [m].
fn damage<S: Real>(model: &Model<S>, state: &State<S>) -> (usize, f64) {
    let mut tets = Vec::new();
    measure_tets(model, &state.positions, &mut tets);
    let inverted = tets.iter().filter(|tet| tet.volume_ratio <= 0.0).count();
    let pairs = state.positions.iter().zip(&model.rest_positions);
    let farthest = pairs.map(|(x, rest)| (*x - *rest).length().to_f64()).fold(0.0, f64::max);
    (inverted, farthest)
}

/// Of so many seeds every step is watched; of the others those that the solver says it took back.
const WATCHED_SEEDS: u64 = 3;

/// Vertices jump at once to places up to one body length away, stay for ten frames, are let go.
/// The step guard takes back what such a jump does to the sweeps, whatever colours and acceleration:
/// no step ends at a higher incremental potential than the best of the places it could have started from, and none of a body that nothing holds with more
/// mechanical energy than it was let go with. Both are computed here, whatever the solver says of itself.
#[test]
fn violent_grabs_end_in_numbers() {
    let size = [0.08, 0.04, 0.04];
    let mesh = block(size, [6, 3, 3], 0.2);
    let (frames, held) = (60u64, 10);
    let mut taken_back = Vec::new();
    for (seeds, colors, acceleration) in [
        (20, Colors::Unlimited, Acceleration::None),
        (5, Colors::Limited(4), Acceleration::None),
        (5, Colors::Limited(1), Acceleration::None),
        (5, Colors::Unlimited, Acceleration::Anderson),
    ] {
        let settings = SolverSettings { colors, acceleration, ..SolverSettings::xpbd() };
        let model = single_body::<f32>(&mesh, &material(SNH, 1e4, 0.45));
        let (mut grabbed, mut ended, mut worst_end, mut farthest) = (0, 0, 0, 0.0f64);
        let outside = Outside::new::<f32>(&mesh, 1e4, 0.45, 1000.0);
        let (mut rejected, mut above, mut gained) = (0, 0, 0);
        for seed in 0..seeds {
            let mut random = Random(seed);
            let mut inputs = Inputs::default();
            for _ in 0..2 + random.next() % 6 {
                let vertex = (random.next() % mesh.vertices().len() as u64) as u32;
                let target = mesh.vertices()[vertex as usize] + random.vector(size[0]);
                inputs.pins.push(Pin { vertex, target: target.cast() });
            }
            let mut run = Run::new(&model, &settings);
            let (mut watched, mut let_go) = (0, None);
            for frame in 0..frames {
                if frame == held {
                    grabbed += damage(&model, &run.state).0;
                    inputs.pins.clear();
                }
                for _ in 0..settings.substeps() {
                    let before = run.state.clone();
                    run.step(&inputs);
                    let seen = run.solver.rejected_steps();
                    if seed < WATCHED_SEEDS || seen > watched {
                        watched = seen;
                        let [start, end] =
                            outside.incremental(&before, &run.state, &inputs, run.dt);
                        above += usize::from(end.is_above(start));
                    }
                    if seed < WATCHED_SEEDS && inputs.pins.is_empty() {
                        let first = *let_go.get_or_insert(outside.mechanical(&before, run.dt));
                        let now = outside.mechanical(&run.state, run.dt);
                        gained += usize::from(now.is_above(first));
                    }
                }
            }
            assert!(run.state.is_finite(), "seed {seed}, {colors:?}, {acceleration:?}: no number");
            rejected += run.solver.rejected_steps();
            let (inverted, far) = damage(&model, &run.state);
            (ended, worst_end) = (ended + inverted, worst_end.max(inverted));
            farthest = farthest.max(far);
        }
        println!(
            "{colors:?}, {acceleration:?}: of {seeds} x {} tets {grabbed} inverted while held, {ended} \
             at the end (at most {worst_end} in one run); farthest vertex {farthest:.2} m; \
             {rejected} of {} steps taken back",
            mesh.tets().len(),
            seeds * frames * u64::from(settings.substeps())
        );
        assert_eq!(above, 0, "{colors:?}, {acceleration:?}: steps that raise the potential");
        assert_eq!(gained, 0, "{colors:?}, {acceleration:?}: energy above that at release");
        taken_back.push(rejected);
    }
    // Without any the guard would not have been asked.
    assert!(taken_back.iter().all(|&count| count > 0), "{taken_back:?}");
}

/// Mixtures that raise the incremental potential are taken back one by one, and so early that the
/// step as a whole need not be.
#[test]
fn guarded_mixtures_leave_the_step_guard_nothing_to_do() {
    let mesh = block([0.08, 0.04, 0.04], [4, 2, 2], 0.2);
    let taken_back = |anderson_guard| {
        let acceleration = Acceleration::Anderson;
        let settings = SolverSettings { acceleration, anderson_guard, ..exact(20) };
        let model = single_body::<f64>(&mesh, &material(SNH, 1e4, 0.45));
        let mut rejected = 0;
        for seed in 0..10 {
            let mut random = Random(seed);
            let mut inputs = Inputs::default();
            for _ in 0..5 {
                let vertex = (random.next() % mesh.vertices().len() as u64) as u32;
                let target = mesh.vertices()[vertex as usize] + random.vector(0.08);
                inputs.pins.push(Pin { vertex, target });
            }
            let mut run = Run::new(&model, &settings);
            for _ in 0..10 {
                run.step(&inputs);
                assert!(run.solver.last_step().expect("a guarded step").keeps_limit());
            }
            rejected += run.solver.rejected_steps();
        }
        rejected
    };
    let [none, residual, energy] =
        [AndersonGuard::None, AndersonGuard::Residual, AndersonGuard::Energy].map(taken_back);
    println!("of 100 steps taken back: no guard {none}, residual {residual}, energy {energy}");
    assert!(energy == 0 && residual > 0 && none > 0);
}

/// A small body of both kinds of constraint, its state, and a solver.
fn workbench() -> (Model<f32>, State<f32>, Solver<f32>) {
    let mesh = block([0.02, 0.02, 0.02], [1, 1, 1], 0.0);
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &material(SNH, 1e4, 0.4)).expect("a body");
    builder.add_attachment(0, mesh.vertices()[0], 10.0).expect("an attachment");
    builder.add_attachment(1, mesh.vertices()[1], 10.0).expect("an attachment");
    let model = builder.build().expect("a model");
    let solver = Solver::new(&model, &SolverSettings::xpbd());
    let state = solver.state_at_rest();
    (model, state, solver)
}

#[test]
fn a_step_that_is_no_time_is_refused() {
    let (model, mut state, mut solver) = workbench();
    let before = state.clone();
    // The square of the last two is beyond single precision.
    let steps = [0.0, -0.0, -0.01, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-30, 1e30];
    for dt in steps {
        let error = solver.step(&model, &mut state, &Inputs::default(), dt).expect_err("no step");
        assert!(matches!(error, StepError::BadStep { .. }), "{dt}: {error}");
        assert_eq!(state, before, "{dt}");
    }
}

#[test]
fn inputs_that_do_not_fit_are_refused_and_nothing_moves() {
    let (model, mut state, mut solver) = workbench();
    let before = state.clone();
    let vertex_count = model.vertex_count();
    let pin = |vertex, target| Inputs { pins: vec![Pin { vertex, target }], ..Inputs::default() };
    let nan = vec3(0.0, f32::NAN, 0.0);
    let unknown = |what| StepError::UnknownVertex { what, vertex: 8, vertex_count };
    let cases = [
        (pin(8, Vec3::ZERO), unknown("pin")),
        (pin(0, nan), StepError::NotFinite { what: "pin targets" }),
        (Inputs { forces: vec![(8, Vec3::ZERO)], ..Inputs::default() }, unknown("force")),
        (
            Inputs { forces: vec![(0, nan)], ..Inputs::default() },
            StepError::NotFinite { what: "forces" },
        ),
        (
            Inputs { gravity: vec3(f32::INFINITY, 0.0, 0.0), ..Inputs::default() },
            StepError::NotFinite { what: "gravity" },
        ),
        (
            Inputs { anchors: vec![Vec3::ZERO; 3], ..Inputs::default() },
            StepError::AnchorCount { given: 3, expected: 2 },
        ),
        (
            Inputs { anchors: vec![Vec3::ZERO, nan], ..Inputs::default() },
            StepError::NotFinite { what: "anchors" },
        ),
    ];
    let mut balance = ForceBalance::default();
    for (inputs, expected) in cases {
        assert_eq!(solver.step(&model, &mut state, &inputs, 0.01), Err(expected.clone()));
        assert_eq!(state, before);
        let measured = solver.force_balance(&model, &state, &inputs, &mut balance);
        assert_eq!(measured, Err(expected.clone()));
        assert_eq!(solver.restart(&model, &mut state, &inputs, 0.01), Err(expected));
        assert_eq!(state, before);
    }
}

#[test]
fn a_state_of_another_model_is_refused() {
    let (model, state, mut solver) = workbench();
    let mut balance = ForceBalance::default();
    let inputs = Inputs::default();
    let (positions, velocities) = (state.positions.clone(), state.velocities.clone());
    let multipliers = state.multipliers.clone();
    for mut wrong in [
        State { positions: positions[1..].to_vec(), ..state.clone() },
        State { velocities: [velocities.clone(), velocities].concat(), ..state.clone() },
        State { multipliers: multipliers[1..].to_vec(), ..state.clone() },
        State { positions: Vec::new(), velocities: Vec::new(), ..state.clone() },
    ] {
        let before = wrong.clone();
        let error = solver.step(&model, &mut wrong, &inputs, 0.01).expect_err("no step");
        assert!(matches!(error, StepError::Mismatch { .. }), "{error}");
        assert_eq!(wrong, before);
        assert!(solver.force_balance(&model, &wrong, &inputs, &mut balance).is_err());
    }
}

/// All of these have the vertices of the first model, and only that in common.
#[test]
fn a_solver_made_for_another_model_is_refused() {
    let mesh = block([0.02, 0.02, 0.02], [2, 2, 2], 0.0);
    let build = |tissue, viscosity, springs: &[[u32; 2]]| -> Model<f64> {
        let tissue = material(tissue, 1e4, 0.4).with_viscosity(viscosity).expect("legal");
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &tissue).expect("a body");
        for &ends in springs {
            builder.add_spring(ends, 10.0, None).expect("a spring");
        }
        builder.build().expect("a model")
    };
    let models = [
        build(SNH, 0.0, &[]),
        build(STVK, 0.0, &[]),
        build(SNH, 0.1, &[]),
        build(SNH, 0.0, &[[0, 1]]),
        build(SNH, 0.0, &[[0, 2]]),
    ];
    for acceleration in [Acceleration::None, Acceleration::Chebyshev, Acceleration::Anderson] {
        let settings = SolverSettings { acceleration, ..SolverSettings::xpbd() };
        for (i, made_for) in models.iter().enumerate() {
            let mut solver = Solver::new(made_for, &settings);
            for (j, model) in models.iter().enumerate() {
                let mut state = State::at_rest(model);
                let inputs = Inputs::default();
                let result = solver.step(model, &mut state, &inputs, 0.01);
                let mut balance = ForceBalance::default();
                let measured = solver.force_balance(model, &state, &inputs, &mut balance);
                if i == j {
                    assert_eq!((result, measured), (Ok(()), Ok(())), "{i} on {j}");
                } else {
                    let error = result.expect_err("another model");
                    assert_eq!(error, StepError::OtherModel, "{i} on {j}");
                    assert_eq!(measured, Err(error));
                }
            }
        }
    }
}

/// Callers can change what they see of a model: a solver that is made for it then refuses every step, and touches nothing.
#[test]
fn a_model_changed_behind_its_back_is_refused() {
    let (model, ..) = workbench();
    let settings = SolverSettings::xpbd();
    let changes: [fn(&mut Model<f32>); 7] = [
        |model| model.rest_positions.truncate(3),
        |model| model.masses.truncate(3),
        |model| model.materials.clear(),
        |model| model.materials[0].compliance.shear *= 2.0,
        |model| model.rest_anchors[0] = vec3(1.0, 0.0, 0.0),
        |model| model.elements.attachments.constants[0][0] = 2.0,
        |model| model.masses[5] = 0.0,
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let mut changed = model.clone();
        change(&mut changed);
        let mut solver = Solver::new(&changed, &settings);
        let mut state = State::at_rest(&model);
        let result = solver.step(&changed, &mut state, &Inputs::default(), 0.01);
        assert_eq!(result, Err(StepError::OtherModel), "change {i}");
    }
}

#[test]
fn elements_that_cannot_be_are_refused() {
    let mut builder = ModelBuilder::new();
    assert_eq!(builder.build::<f64>(), Err(ModelError::Empty));
    assert!(matches!(builder.body(0), Err(ModelError::UnknownBody { .. })));
    let tissue = material(SNH, 1e4, 0.4);
    assert!(builder.set_region_material(0, 0, &tissue).is_err());
    assert!(builder.add_spring([0, 1], 1.0, None).is_err());
    assert!(builder.add_attachment(0, Vec3::ZERO, 1.0).is_err());

    let mesh = block([0.02, 0.02, 0.02], [1, 1, 1], 0.0);
    builder.add_body(&mesh, &tissue).expect("a body");
    assert_eq!(builder.set_region_material(0, 7, &tissue), Ok(0));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(builder.add_spring([0, 1], bad, None).is_err(), "stiffness {bad}");
        assert!(builder.add_attachment(0, Vec3::ZERO, bad).is_err(), "stiffness {bad}");
        if bad != 0.0 {
            assert!(builder.add_spring([0, 1], 1.0, Some(bad)).is_err(), "length {bad}");
            let anchor = vec3(0.0, 0.0, if bad < 0.0 { -2e9 } else { bad });
            assert!(builder.add_attachment(0, anchor, 1.0).is_err(), "anchor {anchor:?}");
        }
    }
    assert!(builder.add_spring([0, 8], 1.0, None).is_err());
    assert!(builder.add_attachment(8, Vec3::ZERO, 1.0).is_err());
    let model = builder.build::<f64>().expect("a legal model");
    assert_eq!(model.tet_count(), mesh.tets().len());
    let none = SolverSettings { colors: Colors::Limited(0), ..SolverSettings::xpbd() };
    assert_eq!(Layout::new(&model, &none).color_count, 1, "zero colours mean one");
    let mut add = |ends, constants: &[f64], anchor| {
        builder.add_element::<Springs, 2, 1>(ends, constants, anchor).is_err()
    };
    assert!(add([2, 2], &[0.1, 1.0], None), "one vertex twice");
    assert!(add([1, 2], &[0.1], None), "a constant too few");
    assert!(add([1, 2], &[0.1, 1.0, 1.0], None), "one too many");
    assert!(add([1, 2], &[0.1, 1.0], Some(Vec3::ZERO)), "an anchor too many");
    assert!(!add([1, 2], &[0.1, 1.0], None));
    assert!(builder.add_element::<Attachments, 1, 3>([1], &[1.0], None).is_err(), "no anchor");
}

/// A mesh of nothing is a legal default; nothing comes of it.
#[test]
fn a_body_without_vertices_does_nothing() {
    let model = single_body::<f32>(&TetMesh::default(), &material(SNH, 1e4, 0.4));
    for acceleration in [Acceleration::None, Acceleration::Chebyshev, Acceleration::Anderson] {
        let settings = SolverSettings { acceleration, ..SolverSettings::xpbd() };
        Run::new(&model, &settings).frame(&Inputs::default(), 1.0);
    }
}

fn one_tet() -> TetMesh {
    let vertices = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]];
    let vertices = vertices.map(Vec3::from_f64).to_vec();
    TetMesh::new(vertices, vec![[0, 1, 2, 3]], vec![0]).expect("a tetrahedron").0
}

/// Settings at the ends of their ranges, and beyond where the type allows it.
fn odd_settings() -> Vec<SolverSettings> {
    let default = SolverSettings::xpbd();
    let anderson = SolverSettings {
        acceleration: Acceleration::Anderson,
        iterations: Count::Of(30),
        ..default.clone()
    };
    let chebyshev = SolverSettings {
        acceleration: Acceleration::Chebyshev,
        iterations: Count::Of(30),
        ..default.clone()
    };
    vec![
        SolverSettings { iterations: Count::Of(0), ..default.clone() },
        SolverSettings { relaxation: 0.0, ..default.clone() },
        SolverSettings { rebase_factor: 1.0, ..default.clone() },
        SolverSettings { anderson_window: 0, ..anderson.clone() },
        SolverSettings { anderson_window: 1, ..anderson.clone() },
        SolverSettings { anderson_window: u32::MAX, ..anderson.clone() },
        SolverSettings { anderson_on: AndersonOn::Multipliers, ..anderson.clone() },
        SolverSettings { anderson_guard: AndersonGuard::None, ..anderson.clone() },
        SolverSettings { anderson_guard: AndersonGuard::Energy, ..anderson },
        SolverSettings { chebyshev_delay: 0, ..chebyshev.clone() },
        SolverSettings { chebyshev_delay: u32::MAX, ..chebyshev.clone() },
        SolverSettings { chebyshev_radius: 0.5, ..chebyshev },
        default,
    ]
}

/// Fall [m] of a body by n steps of implicit Euler, from rest: g dt^2 (1 + 2 + ... + n).
fn implicit_fall(gravity: f64, dt: f64, steps: u32) -> f64 {
    gravity * dt * dt * f64::from(steps * (steps + 1) / 2)
}

/// Free fall is a rigid motion: without stress no Green strain has anything to say, whatever the
/// settings.
#[test]
fn a_single_tetrahedron_falls_under_all_settings() {
    let mesh = one_tet();
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -10.0), ..Inputs::default() };
    let (dt, steps) = (0.01, 10);
    let fall = implicit_fall(10.0, dt, steps);
    for colors in [Colors::Unlimited, Colors::Limited(1)] {
        let model = single_body::<f64>(&mesh, &material(STVK, 1e4, 0.4));
        for settings in odd_settings() {
            let settings = SolverSettings { keep_multipliers: false, colors, ..settings };
            let mut run = Run::new(&model, &settings);
            for _ in 0..steps {
                let stepped = run.solver.step(&model, &mut run.state, &inputs, dt);
                stepped.expect("a legal step");
            }
            for (x, rest) in run.state.positions.iter().zip(mesh.vertices()) {
                let error = (*x - *rest + vec3(0.0, 0.0, fall)).length();
                // Ten steps each round positions and velocities of this size a few times; the
                // strain of that round-off is answered by as much again.
                assert!(error < 1e3 * f64::EPSILON * fall, "{settings:?}: off by {error:e} m");
            }
        }
    }
}

#[test]
fn extreme_steps_and_loads_never_panic() {
    let mesh = block([0.02, 0.02, 0.02], [2, 2, 2], 0.1);
    let inputs = |x: f32| Inputs {
        gravity: vec3(0.0, 0.0, -9.81),
        forces: vec![(3, vec3(x, 0.0, 0.0))],
        pins: vec![Pin { vertex: 0, target: vec3(x, x, x) }],
        ..Inputs::default()
    };
    let mut finite = 0;
    let mut runs = 0;
    for tissue in [STVK, SNH] {
        for colors in [Colors::Unlimited, Colors::Limited(1)] {
            for settings in odd_settings() {
                let settings = SolverSettings { colors, ..settings };
                let model = single_body::<f32>(&mesh, &material(tissue, 1e4, 0.4));
                for (dt, load) in [(1e18, 0.0), (1e-18, 0.0), (10.0, 0.01), (0.01, 1e30)] {
                    let mut run = Run::new(&model, &settings);
                    for _ in 0..3 {
                        let stepped = run.solver.step(&model, &mut run.state, &inputs(load), dt);
                        stepped.expect("a legal step");
                    }
                    runs += 1;
                    finite += usize::from(run.state.is_finite());
                }
            }
        }
    }
    println!("{finite} of {runs} runs ended in numbers");
}

#[test]
fn a_body_pinned_everywhere_goes_where_it_is_put() {
    let mesh = block([0.02, 0.02, 0.02], [2, 2, 2], 0.1);
    let mut random = Random(9);
    let place = |x: &Vec3<f64>, shift: Vec3<f64>| (*x + shift).cast::<f32>();
    for tissue in [STVK, SNH] {
        for colors in [Colors::Unlimited, Colors::Limited(4), Colors::Limited(1)] {
            for settings in odd_settings() {
                let settings = SolverSettings { colors, ..settings };
                let model = single_body::<f32>(&mesh, &material(tissue, 1e4, 0.4));
                let mut run = Run::new(&model, &settings);
                let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
                for _ in 0..3 {
                    inputs.pins.clear();
                    for (v, x) in mesh.vertices().iter().enumerate() {
                        let target = place(x, random.vector(0.02));
                        inputs.pins.push(Pin { vertex: v as u32, target });
                    }
                    run.frame(&inputs, 1.0);
                    for (pin, x) in inputs.pins.iter().zip(&run.state.positions) {
                        assert_eq!(pin.target, *x, "{tissue:?} {settings:?}");
                    }
                }
            }
        }
    }
}

/// Tests of motion and loads above use small numbers; the laws keep together over the sizes of
/// anatomy in single precision: a body of a millimetre and one of ten metres hang alike.
#[test]
fn a_tissue_of_any_size_stays_finite() {
    for scale in [1e-3, 1e-1, 10.0] {
        for tissue in [STVK, SNH] {
            let mesh = block([2.0 * scale, scale, scale], [4, 2, 2], 0.1);
            let model = single_body::<f32>(&mesh, &material(tissue, 1e5, 0.45));
            let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
            for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x == 0.0) {
                inputs.pins.push(Pin { vertex: v as u32, target: x.cast() });
            }
            let mut run = Run::new(&model, &SolverSettings::xpbd());
            for _ in 0..30 {
                run.frame(&inputs, 1.0);
            }
            assert!(run.state.is_finite(), "{tissue:?}, {scale} m");
        }
    }
}
