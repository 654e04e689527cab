//! The same bits, whoever does the work: any number of threads, any instructions; and the same numbers
//! on every machine. What a caller sees is in the caller's order.

use crate::common::{Random, SNH, STVK, block, colored, everything, material, single_body};
use viscera::layout::Layout;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::lanes::Instructions::{self, Avx2, Portable};
use viscera::scalar::{Vec3, vec3};
use viscera::scene::Scene;
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Colors, Count, Method, NeoHookean, SolverSettings,
    Threads,
};
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const STEPS: u32 = 20;

/// The bits of everything that moves.
fn bits(state: &State<f32>) -> Vec<u32> {
    let vectors = state.positions.iter().chain(&state.velocities).flat_map(|v| v.to_array());
    vectors.chain(state.multipliers.iter().copied()).map(f32::to_bits).collect()
}

/// Steps of 1/600 s from rest, and how many were taken back.
fn run(
    model: &Model<f32>,
    settings: &SolverSettings,
    (threads, instructions): (u32, Instructions),
    inputs_at: &impl Fn(u32) -> Inputs<f32>,
) -> (State<f32>, u64) {
    let settings = SolverSettings { threads: Threads::Count(threads), ..settings.clone() };
    let mut solver = Solver::new(model, &settings);
    solver.use_instructions(instructions);
    assert_eq!(solver.thread_count(), threads as usize);
    let mut state = State::at_rest(model);
    for step in 0..STEPS {
        solver.step(model, &mut state, &inputs_at(step), 1.0 / 600.0).expect("a legal step");
    }
    (state, solver.rejected_steps())
}

/// Runs with one thread and with others, and compares; returns how many steps were taken back.
fn same_bits(
    model: &Model<f32>,
    settings: &SolverSettings,
    others: &[(u32, Instructions)],
    inputs_at: impl Fn(u32) -> Inputs<f32>,
) -> u64 {
    let (state, rejected) = run(model, settings, (1, Avx2), &inputs_at);
    assert!(state.is_finite());
    assert_ne!(state.positions, model.rest_positions, "nothing moves");
    let expected = bits(&state);
    for &workers in others {
        let (state, again) = run(model, settings, workers, &inputs_at);
        let differing = bits(&state).iter().zip(&expected).filter(|(a, b)| a != b).count();
        assert_eq!(
            (differing, again),
            (0, rejected),
            "numbers that differ, steps taken back; {workers:?}, {settings:?}"
        );
    }
    rejected
}

/// A moving wall, and from the tenth step on vertices that have jumped.
fn wall_and_jumps(mesh: &TetMesh, step: u32) -> Inputs<f32> {
    let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
    let away = vec3(0.0, 0.0, 2e-4 * f64::from(step));
    for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
        inputs.pins.push(Pin { vertex: v as u32, target: (*x + away).cast() });
    }
    if step >= STEPS / 2 {
        let mut random = Random(3);
        for _ in 0..4 {
            let vertex = (random.next() % mesh.vertices().len() as u64) as u32;
            let target = mesh.vertices()[vertex as usize] + random.vector(0.05);
            inputs.pins.push(Pin { vertex, target: target.cast() });
        }
    }
    inputs
}

/// More than 64 blocks, which is what one thread does at a time, in most colours, and sums of many pieces:
/// threads share every stage. The jumps make steps that are taken back.
#[test]
fn threads_and_instructions_leave_every_bit_of_a_large_body() {
    let others = [(2, Avx2), (8, Avx2), (2, Portable)];
    for (method, colors, cells, tissue, viscosity) in [
        (Method::Xpbd, Colors::Unlimited, 14, SNH, 0.01),
        (Method::Xpbd, Colors::Limited(4), 10, STVK, 0.01),
        (Method::Xpbd, Colors::Limited(1), 10, SNH, 0.0),
        (Method::QuasiNewton, Colors::Limited(1), 10, SNH, 0.01),
    ] {
        let mesh = block([0.08, 0.08, 0.08], [cells; 3], 0.2);
        let settings = SolverSettings { method, ..colored(colors) };
        let tissue = material(tissue, 1e4, 0.45).with_viscosity(viscosity).expect("legal");
        let model = single_body::<f32>(&mesh, &tissue);
        let count = Layout::new(&model, &settings).color_count;
        let shared = model.tet_count() / count / 8;
        println!("{colors:?}: {count} colours of about {shared} blocks");
        assert!(shared > 64, "{shared} blocks in a colour leave nothing to share");
        let rejected = same_bits(&model, &settings, &others, |step| wall_and_jumps(&mesh, step));
        assert!(
            rejected > 0 || method != Method::Xpbd,
            "{colors:?}: the guard has had nothing to do"
        );
    }
}

/// Both materials, viscous and not, springs, attachments, pins that move, several connected parts: the
/// energies of single tetrahedra then count one by one.
fn several_parts() -> Model<f32> {
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let half = mesh.vertices().len() as u32;
    let mut builder = ModelBuilder::new();
    let viscous = material(SNH, 1e4, 0.4).with_viscosity(0.05).expect("legal");
    let body = builder.add_body(&mesh, &material(STVK, 2e4, 0.3)).expect("a body");
    for tissue in [viscous, material(SNH, 3e4, 0.45), viscous] {
        builder.add_body(&mesh, &tissue).expect("a body");
    }
    // Two materials within a block of eight.
    builder.set_region_material(body, 0, &material(STVK, 2e4, 0.3)).expect("a region");
    for v in (0..half).step_by(3) {
        builder.add_spring([v, half + v], 40.0, Some(0.01)).expect("a spring");
        let anchor = mesh.vertices()[v as usize];
        builder.add_attachment(2 * half + v, anchor, 30.0).expect("an attachment");
    }
    let model = builder.build().expect("a model");
    assert_eq!(model.part_count(), 3);
    model
}

fn moving_pins(model: &Model<f32>, step: u32) -> Inputs<f32> {
    let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
    let jump = if step >= STEPS / 2 { 0.03 } else { 0.0 };
    for v in (0..model.vertex_count()).step_by(11) {
        let away = vec3(jump, 2e-4 * step as f32, -jump);
        inputs.pins.push(Pin { vertex: v as u32, target: model.rest_positions[v] + away });
    }
    inputs.forces.push((5, vec3(0.1, 0.0, 0.0)));
    inputs.anchors = model.rest_anchors.iter().map(|a| *a + vec3(0.0, 0.0, 1e-3)).collect();
    inputs
}

#[test]
fn threads_and_instructions_leave_every_bit_of_several_parts() {
    let others = [(2, Avx2), (8, Avx2), (1, Portable), (8, Portable)];
    let plain = SolverSettings::xpbd();
    let anderson = |anderson_on, anderson_guard| SolverSettings {
        acceleration: Acceleration::Anderson,
        anderson_on,
        anderson_guard,
        iterations: Count::Of(8),
        ..plain.clone()
    };
    let chebyshev = SolverSettings {
        acceleration: Acceleration::Chebyshev,
        chebyshev_delay: 2,
        chebyshev_damping: 0.8,
        iterations: Count::Of(6),
        ..plain.clone()
    };
    let mut rejected = 0;
    for settings in [
        plain.clone(),
        SolverSettings { neo_hookean: NeoHookean::Pair, ..plain.clone() },
        SolverSettings { rebase: false, keep_multipliers: false, ..plain.clone() },
        chebyshev,
        anderson(AndersonOn::Both, AndersonGuard::Residual),
        anderson(AndersonOn::Both, AndersonGuard::Energy),
        anderson(AndersonOn::Multipliers, AndersonGuard::Residual),
        SolverSettings { method: Method::QuasiNewton, ..plain.clone() },
    ] {
        for colors in [Colors::Unlimited, Colors::Limited(4), Colors::Limited(1)] {
            let settings = SolverSettings { colors, ..settings.clone() };
            let model = several_parts();
            rejected += same_bits(&model, &settings, &others, |step| moving_pins(&model, step));
        }
    }
    println!("{rejected} steps taken back");
    assert!(rejected > 0, "the guard has had nothing to do");
}

/// Fewer than fill a block, and fewer than there are threads.
#[test]
fn three_tetrahedra_run_with_any_number_of_threads() {
    let corners =
        [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3], [2.0, 1.0, 1.0]];
    let vertices = corners.map(|x| Vec3::from_f64(x) * 0.02).to_vec();
    let tets = vec![[0, 1, 2, 3], [1, 2, 3, 4], [1, 4, 3, 5]];
    let mesh = TetMesh::new(vertices, tets, vec![0; 3]).expect("a legal mesh").0;
    for colors in [Colors::Unlimited, Colors::Limited(1)] {
        for tissue in [STVK, SNH] {
            let settings = colored(colors);
            let model = single_body::<f32>(&mesh, &material(tissue, 1e4, 0.4));
            same_bits(&model, &settings, &[(2, Avx2), (8, Avx2), (8, Portable)], |_| Inputs {
                gravity: vec3(0.0, 0.0, -9.81),
                pins: vec![Pin { vertex: 0, target: model.rest_positions[0] }],
                ..Inputs::default()
            });
        }
    }
}

/// FNV-1a over the bytes of positions and velocities, single precision, after some frames of a shipped
/// scene.
fn hash(name: &str, scene: &str, frames: u32) -> u64 {
    // Graphics processors agree to round-off only.
    let scene = Scene::parse(name, scene, &[("solver.device", "cpu")]);
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    let assembly = Assembly::new(&scene, &mut |name| Err(format!("no file {name}")));
    let assembly = assembly.unwrap_or_else(|error| panic!("{error}"));
    let mut simulation = Simulation::<f32>::new(scene, assembly).expect("a model");
    for _ in 0..frames {
        simulation.advance_frame().expect("a frame");
    }
    let state = simulation.state();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for v in state.positions.iter().chain(&state.velocities) {
        for byte in v.to_array().into_iter().flat_map(f32::to_le_bytes) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    hash
}

/// Every machine computes these bits. They may change with a change that is meant to change results: of a
/// default, of a kernel's arithmetic, of the order of a sum or a sweep, of a mesh or one of these scenes;
/// say so in its description. They must not change with threads, instructions, the compiler, the layout
/// of memory or whatever else is only meant to be faster; a machine that gets others has found a bug.
#[test]
fn shipped_scenes_have_the_same_bits_on_every_machine() {
    let shipped = [
        (
            "cantilever.toml",
            include_str!("../../../../scenes/cantilever.toml"),
            0x9d1b_f62e_075b_9e68,
        ),
        ("grab.toml", include_str!("../../../../scenes/grab.toml"), 0xc001_5a5b_9718_e279),
        (
            "liver_lifted.toml",
            include_str!("../../../../scenes/liver_lifted.toml"),
            0x0ddb_49b9_5466_6dab,
        ),
    ];
    let hashes = shipped.map(|(name, scene, _)| (name, hash(name, scene, 4)));
    for ((name, hash), (.., expected)) in hashes.into_iter().zip(shipped) {
        println!("{name}: {hash:#018x}");
        assert!(hash == expected, "{hashes:#x?}");
    }
}

/// The solver numbers vertices by their places, so that the caller's numbers are only names: where no two
/// vertices share a cell of the curve there is not even round-off.
#[test]
fn the_order_of_vertices_changes_nothing() {
    let mesh = block([0.06, 0.03, 0.03], [6, 3, 3], 0.2);
    let count = mesh.vertices().len();
    let mut order: Vec<usize> = (0..count).collect();
    let mut random = Random(8);
    for i in (1..count).rev() {
        order.swap(i, (random.next() % (i as u64 + 1)) as usize);
    }
    let mut new_number = vec![0; count];
    for (new, &old) in order.iter().enumerate() {
        new_number[old] = new as u32;
    }
    let vertices = order.iter().map(|&old| mesh.vertices()[old]).collect();
    let tets = mesh.tets().iter().map(|tet| tet.map(|v| new_number[v as usize])).collect();
    let shuffled = TetMesh::new(vertices, tets, mesh.regions().to_vec()).expect("legal").0;

    let settings = SolverSettings::xpbd();
    let tissue = material(SNH, 1e4, 0.45).with_viscosity(0.01).expect("legal");
    let run = |mesh: &TetMesh| {
        let model = single_body::<f32>(mesh, &tissue);
        run(&model, &settings, (1, Avx2), &|step| {
            let mut inputs = wall_and_jumps(mesh, 0);
            inputs.pins.retain(|pin| pin.target.y > 1e-3);
            inputs.pins.sort_by(|a, b| {
                a.target.to_array().partial_cmp(&b.target.to_array()).expect("numbers")
            });
            inputs.gravity.x = 0.1 * step as f32;
            inputs
        })
        .0
    };
    let (expected, given) = (run(&mesh), run(&shuffled));
    for old in 0..count {
        let new = new_number[old] as usize;
        assert_eq!(given.positions[new], expected.positions[old], "vertex {old}");
        assert_eq!(given.velocities[new], expected.velocities[old], "vertex {old}");
    }
}

/// Rest positions, tetrahedra, pins, forces, anchors, positions and residuals go by the numbers that
/// the caller gave.
#[test]
fn everything_seen_is_in_the_callers_order() {
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let count = mesh.vertices().len();
    let settings = SolverSettings::xpbd();
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &material(SNH, 1e4, 0.4)).expect("a body");
    let held = [34u32, 3, 17];
    for v in held {
        builder.add_attachment(v, mesh.vertices()[v as usize], 1e4).expect("an attachment");
    }
    let model: Model<f32> = builder.build().expect("a model");
    let rest: Vec<Vec3<f32>> = mesh.vertices().iter().map(|x| x.cast()).collect();
    assert_eq!(model.rest_positions, rest);
    assert!(model.tets().map(|tet| tet.vertices).eq(mesh.tets().iter().copied()));

    // One short step: whatever acts has hardly reached the neighbours.
    let step = |inputs: Inputs<f32>| {
        let mut solver = Solver::new(&model, &settings);
        let (mut state, mut balance) = (State::at_rest(&model), ForceBalance::default());
        solver.step(&model, &mut state, &inputs, 1e-4).expect("a legal step");
        solver.force_balance(&model, &state, &inputs, &mut balance).expect("a balance");
        (state, balance)
    };
    let farthest = |state: &State<f32>, wanted: usize| {
        largest(count, wanted, |v| f64::from((state.positions[v] - rest[v]).length()))
    };
    let pinned = [7u32, 12, 30];
    let target = |v: u32| rest[v as usize] + vec3(0.0, 0.0, 1e-5 * v as f32);
    let pins = pinned.map(|vertex| Pin { vertex, target: target(vertex) }).to_vec();
    let (state, balance) = step(Inputs { pins, ..Inputs::default() });
    for v in pinned {
        assert_eq!(state.positions[v as usize], target(v), "pin {v}");
    }
    let holding = largest(count, 3, |v| balance.residual[v].length());
    assert_eq!(holding, [7, 12, 30], "what holds the pins is at the pins");

    let forces = vec![(20, vec3(0.0, 1.0, 0.0))];
    let (state, _) = step(Inputs { forces, ..Inputs::default() });
    assert_eq!(farthest(&state, 1), [20], "the force is on its vertex");

    let anchors = held.map(|v| rest[v as usize] - vec3(1e-3, 0.0, 0.0)).to_vec();
    let (state, _) = step(Inputs { anchors, ..Inputs::default() });
    assert_eq!(farthest(&state, 3), [3, 17, 34], "anchors pull at their vertices");
}

/// The numbers of the vertices where a value is largest, ascending.
fn largest(count: usize, wanted: usize, value: impl Fn(usize) -> f64) -> Vec<usize> {
    let mut vertices: Vec<usize> = (0..count).collect();
    vertices.sort_by(|&a, &b| value(b).total_cmp(&value(a)));
    vertices.truncate(wanted);
    vertices.sort_unstable();
    vertices
}

#[test]
fn a_new_history_has_the_same_bits() {
    let model = everything::<f32>();
    let restarted = |threads: u32, instructions| {
        let threads = Threads::Count(threads);
        let settings = SolverSettings { threads, ..colored(Colors::Limited(4)) };
        let mut solver = Solver::new(&model, &settings);
        solver.use_instructions(instructions);
        let mut state = State::at_rest(&model);
        let mut random = Random(4);
        for x in &mut state.positions {
            *x += random.vector(3e-3).cast();
        }
        let inputs = Inputs::default();
        solver.restart(&model, &mut state, &inputs, 1e-3).expect("a new history");
        assert!(state.multipliers.iter().any(|l| *l != 0.0), "no forces to compare");
        bits(&state)
    };
    let expected = restarted(1, Avx2);
    for (threads, instructions) in [(8, Avx2), (1, Portable), (8, Portable)] {
        assert!(restarted(threads, instructions) == expected, "{threads} {instructions:?}");
    }
}
