//! Rough treatment of contact with tools on a graphics processor: what it must never do, and what it refuses.

use std::ops::Range;

use super::Block;
use super::grasps::{GRASPED, Plan};
use super::on_device::{ALL, OnDevice, act, scene, settings, tools};
use crate::common::Random;
use crate::common::device::device;
use crate::common::potential::Outside;
use viscera::contact::{Shape, Tool, Wrench};
use viscera::measure::measure_tets;
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::rigid::{axis_times_sine, rotation_matrix};
use viscera::scalar::{Vec3, vec3};
use viscera::settings::{Elements, Integrator, SolverSettings};
use viscera::solver::gpu::GpuSolver;
use viscera::solver::{Inputs, Pin, StepError};
use viscera::state::{ContactState, State};

/// Two runs have the same bits, whatever memory held before.
#[test]
fn contact_has_the_same_bits_whatever_the_memory_held() {
    let run = |left_over: Option<f32>| {
        let mut here = scene::<f32>(&settings(ALL[2]));
        let gpu = match left_over {
            None => GpuSolver::new(device(), &here.model, here.solver.settings()),
            Some(value) => {
                GpuSolver::on_used_memory(device(), &here.model, here.solver.settings(), value)
            }
        };
        let mut gpu = OnDevice::of(gpu, &here);
        let mut wrenches = Vec::new();
        for step in 1..=4 {
            act(f64::from(step) * here.dt, &mut here.inputs.tools);
            wrenches = gpu.step(&here);
        }
        (gpu.state.positions, gpu.state.velocities, wrenches)
    };
    let first = run(None);
    assert!(first.2[0].force.z > 0.1);
    for left_over in [None, Some(f32::NAN), Some(1e30)] {
        assert_eq!(run(left_over), first, "{left_over:?}");
    }
}

/// More tools than a sample has room for: the farthest are left out, and that is counted.
#[test]
fn tools_that_find_no_room_are_counted() {
    let mut here = scene::<f32>(&settings(ALL[0]));
    let ball = |i: usize| {
        let mut tool = Tool::new(Shape::Sphere { radius: 0.006 });
        tool.pose.translation = vec3(1e-4 * i as f64 - 0.004, 0.0, 0.0255);
        tool
    };
    here.inputs.tools = (0..16).map(ball).collect();
    here.state.contact = ContactState::of(&here.inputs.tools);
    let mut gpu = OnDevice::new(&here);
    // It bounces first.
    let wrenches = (0..12).map(|_| gpu.step(&here)).last().expect("a step");
    assert_eq!(wrenches.len(), 16);
    let left_out: u32 = wrenches.iter().map(|wrench| wrench.left_out).sum();
    assert!(left_out > 0 && wrenches.iter().any(|wrench| wrench.force.z > 0.0), "{wrenches:?}");
    assert!(gpu.state.is_finite());
}

/// What a device cannot do it refuses, with what can be done; nothing has moved.
#[test]
fn what_devices_cannot_do_is_refused() {
    let here = scene::<f32>(&settings(ALL[0]));
    let refused = |settings: &SolverSettings, tools: Vec<Tool>| {
        let mut gpu = OnDevice::of(GpuSolver::new(device(), &here.model, settings), &here);
        let inputs = Inputs { pins: here.inputs.pins.clone(), tools, ..Inputs::default() };
        let answer = gpu.gpu.step(&here.model, &inputs, here.dt);
        gpu.gpu.read_frame(&here.model, &mut gpu.state).expect("a device");
        assert_eq!(gpu.state.positions, here.state.positions);
        match answer {
            Err(error @ StepError::ContactOnDevice { .. }) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    let quasi_newton = settings(ALL[0]);
    let words = refused(&quasi_newton, vec![Tool::new(Shape::HalfSpace); 17]);
    assert!(words.contains("16 parts") && words.contains("cpu"), "{words}");
    let mut held = tools();
    held[0].held = Some(viscera::contact::Held {
        body: 0,
        hand: held[0].pose,
        spring: viscera::contact::Spring::default(),
    });
    assert!(refused(&quasi_newton, held).contains("spring"));
}

/// Energy that jaws seem to have put into tissue, and what the tissue has, computed outside: mean forces along the way.
#[derive(Default)]
pub struct Account {
    pub work: f64,
    before: Vec<(Tool, Wrench)>,
}

impl Account {
    pub fn add(&mut self, tools: &[Tool], wrenches: &[Wrench]) {
        for ((start, first), (end, last)) in self.before.iter().zip(tools.iter().zip(wrenches)) {
            let way = end.pose.translation - start.pose.translation;
            let turn = end.pose.rotation * start.pose.rotation.transpose();
            let about = axis_times_sine(&turn);
            let of = |wrench: &Wrench| wrench.force.dot(way) + wrench.torque.dot(about);
            self.work -= 0.5 * (of(first) + of(last));
        }
        self.before = tools.iter().cloned().zip(wrenches.iter().copied()).collect();
    }
}

/// One of several grasps beside each other: none knows of the others.
struct Grasped<'a> {
    plan: Plan,
    /// Where its block stands.
    place: Vec3<f64>,
    vertices: Range<usize>,
    outside: Outside<'a>,
    account: Account,
    peak: f64,
    gain: f64,
    lifted: f64,
}

impl Grasped<'_> {
    fn act(&self, time: f64, tools: &mut [Tool]) {
        self.plan.act(time, tools);
        for tool in tools {
            tool.pose.translation += self.place;
        }
    }

    /// Its part of a state.
    fn own(&self, state: &State<f32>) -> State<f32> {
        let of = |all: &[Vec3<f32>]| all[self.vertices.clone()].to_vec();
        let mut own = state.clone();
        (own.positions, own.velocities) = (of(&state.positions), of(&state.velocities));
        own
    }

    fn measure(&mut self, state: &State<f32>, dt: f64) -> f64 {
        let energy = self.outside.mechanical(&self.own(state), dt);
        self.peak = self.peak.max(energy.value);
        self.gain = self.gain.max(energy.value - energy.noise - self.account.work);
        energy.value
    }
}

/// Grasps that a device computes together: it has sixteen parts of tools.
const TOGETHER: usize = 8;

/// Where one of them stands: in two rows, further apart than jaws go.
fn place(number: usize) -> Vec3<f64> {
    vec3(0.1 * (number % 2) as f64, 0.07 * (number / 2) as f64, 0.0)
}

/// Squeezes, pulls, twists and lets go. At no time has the tissue more than the tools have given, and nothing stays behind.
fn grasp_on_a_device(seeds: Range<u64>, elements: Elements) {
    let (mut slipped, mut most_left, mut most_gain) = (0, 0.0_f64, 0.0_f64);
    let count = seeds.end - seeds.start;
    let all: Vec<u64> = seeds.collect();
    for seeds in all.chunks(TOGETHER) {
        for (seed, [lifted, gain, left]) in seeds.iter().zip(grasp_together(seeds, elements)) {
            // A plate swings on.
            assert!(seed % 2 == 0 || left < 1e-4, "seed {seed}: {left:e} of the peak is left");
            assert!(gain < 1e-2, "seed {seed}: {gain:e} of the peak is gained");
            slipped += u64::from(lifted < 0.8);
            most_gain = most_gain.max(gain);
            most_left = if seed % 2 == 0 { most_left } else { most_left.max(left) };
        }
    }
    println!("{elements:?}: {slipped} slipped, gain {most_gain:.1e}, left {most_left:.1e}");
    assert!(slipped * 20 <= count, "{slipped} slipped");
}

/// A plan's block where it stands.
fn moved(number: usize, plan: &Plan) -> TetMesh {
    let mesh = &plan.block.mesh;
    let vertices = mesh.vertices().iter().map(|x| *x + place(number)).collect();
    TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec()).expect("a mesh").0
}

/// All of them as one model, and what holds and grasps it.
fn beside_each_other<'a>(
    plans: Vec<Plan>,
    meshes: &'a [TetMesh],
    elements: Elements,
) -> (Model<f32>, Inputs<f32>, Vec<Grasped<'a>>) {
    let mut builder = ModelBuilder::new();
    let mut inputs = Inputs::<f32>::default();
    let mut grasps: Vec<Grasped<'_>> = Vec::new();
    let [young, poisson] = GRASPED;
    let tissue = crate::common::material(crate::common::SNH, young, poisson);
    for (number, (plan, mesh)) in plans.into_iter().zip(meshes).enumerate() {
        builder.add_body(mesh, &plan.block.material()).expect("a body");
        let first = grasps.last().map_or(0, |last| last.vertices.end);
        let own = plan.inputs::<f64>();
        inputs.tools.extend(own.tools);
        inputs.pins.extend(own.pins.iter().map(|pin| Pin {
            vertex: first as u32 + pin.vertex,
            target: (pin.target + place(number)).cast(),
        }));
        let outside = Outside::new::<f32>(mesh, young, poisson, 1060.0);
        grasps.push(Grasped {
            plan,
            place: place(number),
            vertices: first..first + mesh.vertices().len(),
            outside: match elements {
                Elements::Recovered => outside.of_recovered(&tissue),
                _ => outside,
            },
            account: Account::default(),
            peak: 0.0,
            gain: 0.0,
            lifted: 0.0,
        });
    }
    builder.sample_surface(1);
    (builder.build().expect("a model"), inputs, grasps)
}

/// How far each is lifted, of the lift; what it gains, and what is left at the end, of the most that it had.
fn grasp_together(seeds: &[u64], elements: Elements) -> Vec<[f64; 3]> {
    let plans: Vec<Plan> = seeds.iter().map(|&seed| Plan::new(seed, seed % 2 == 0)).collect();
    let meshes: Vec<TetMesh> = plans.iter().enumerate().map(|(i, plan)| moved(i, plan)).collect();
    let (model, mut inputs, mut grasps) = beside_each_other(plans, &meshes, elements);
    let act = |grasps: &[Grasped<'_>], time: f64, tools: &mut [Tool]| {
        grasps.iter().zip(tools.chunks_mut(2)).for_each(|(grasp, tools)| grasp.act(time, tools));
    };
    act(&grasps, 0.0, &mut inputs.tools);
    let contact = ContactState::of(&inputs.tools);
    let mut state = State { contact, ..State::at_rest(&model) };
    let settings = settings((Integrator::Sdirk2, elements));
    let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
    gpu.write(&model, &state).expect("a legal state");
    let none = [Wrench::default(); 2];
    let dt: f64 = 1.0 / 60.0;
    for step in 0..=(2.4 / dt).round() as u32 {
        let time = f64::from(step) * dt;
        act(&grasps, time, &mut inputs.tools);
        if step > 0 {
            gpu.step(&model, &inputs, dt).expect("a legal step");
            gpu.read_frame(&model, &mut state).expect("a device");
        }
        let (tools, wrenches) = (inputs.tools.chunks(2), gpu.wrenches().chunks(2));
        let wrenches = wrenches.chain(std::iter::repeat(&none[..]));
        for (grasp, (tools, wrenches)) in grasps.iter_mut().zip(tools.zip(wrenches)) {
            grasp.account.add(tools, wrenches);
            if step % 3 == 0 {
                grasp.measure(&state, dt);
            }
            if (1.18..1.2).contains(&time) {
                grasp.lifted = grasp.plan.lifted(&grasp.own(&state).positions);
            }
        }
    }
    let touches = gpu.contact(&model, &state).expect("a device").touches;
    assert!(state.is_finite() && touches.is_empty(), "{touches:?}");
    let mut tets = Vec::new();
    measure_tets(&model, &state.positions, &mut tets);
    assert!(!tets.iter().any(|tet| tet.is_inverted()));
    let end = |grasp: &mut Grasped<'_>| {
        let left = grasp.measure(&state, dt);
        [grasp.lifted, grasp.gain / grasp.peak, left / grasp.peak]
    };
    grasps.iter_mut().map(end).collect()
}

#[test]
fn grasps_on_a_device_make_no_energy() {
    grasp_on_a_device(0..4, Elements::Plain);
}

#[test]
#[ignore = "slow: many seeds"]
fn grasps_on_a_device_make_no_energy_at_length() {
    grasp_on_a_device(4..12, Elements::Plain);
    grasp_on_a_device(20..28, Elements::Recovered);
}

/// Tools that go wild among bodies: nothing is lost, nothing is turned inside out for good.
#[test]
fn wild_tools_leave_tissue_whole() {
    for seed in 0..4 {
        let mut random = Random(seed);
        let mut here = scene::<f32>(&settings(ALL[2 * (seed as usize % 2)]));
        let mut gpu = OnDevice::new(&here);
        for step in 0..40 {
            let wild = step < 20;
            for tool in &mut here.inputs.tools[..3] {
                let mut at = || random.uniform(-0.03, 0.03);
                tool.pose.translation =
                    if wild { vec3(at(), at(), at()) } else { vec3(0.2, 0.2, 0.2) };
                tool.pose.rotation = rotation_matrix(vec3(at(), at(), at()) * 60.0);
            }
            let wrenches = gpu.step(&here);
            assert!(gpu.state.is_finite(), "seed {seed}, step {step}");
            assert!(wrenches.iter().all(|wrench| wrench.force.is_finite()), "{wrenches:?}");
        }
        let mut tets = Vec::new();
        measure_tets(&here.model, &gpu.state.positions, &mut tets);
        let inverted = tets.iter().filter(|tet| tet.is_inverted()).count();
        println!("seed {seed}: {inverted} of {} inverted", tets.len());
        assert!(inverted * 100 <= tets.len(), "seed {seed}: {inverted} of {}", tets.len());
    }
}

/// A body's step has the bits that it has alone, whatever tools do to another.
#[test]
fn a_body_beside_one_that_is_touched_has_the_bits_it_has_alone() {
    let alone = Block::new([0.02, 0.02, 0.02], [2, 2, 2], [1e4, 0.4, 0.0]);
    let tissue = crate::common::material(crate::common::SNH, 1e4, 0.4);
    let both = |count: usize| {
        let mut builder = ModelBuilder::new();
        for body in 0..count {
            let up = vec3(0.0, 0.0, 0.1) * body as f64;
            let moved = alone.mesh.vertices().iter().map(|x| *x + up).collect();
            let (tets, regions) = (alone.mesh.tets().to_vec(), alone.mesh.regions().to_vec());
            let (mesh, _) = TetMesh::new(moved, tets, regions).expect("a mesh");
            builder.add_body(&mesh, &tissue).expect("a body");
        }
        builder.sample_surface(1);
        builder.build::<f32>().expect("a model")
    };
    let run = |count: usize| {
        let model = both(count);
        let mut ball = Tool::new(Shape::Sphere { radius: 0.01 });
        ball.pose.translation = vec3(0.0, 0.0, 0.129);
        let mut state = State::at_rest(&model);
        state.contact = ContactState::of(std::slice::from_ref(&ball));
        let height = |x: &Vec3<f32>| x.z % 0.1;
        let held = (0u32..).zip(&model.rest_positions).filter(|(_, x)| height(x) < 1e-4);
        let pins = held.map(|(vertex, x)| Pin { vertex, target: *x }).collect();
        let gravity = vec3(0.0, 0.0, -9.81);
        let inputs = Inputs { gravity, pins, tools: vec![ball], ..Inputs::default() };
        let mut gpu = GpuSolver::new(device(), &model, &settings(ALL[0])).expect("it fits");
        gpu.write(&model, &state).expect("a legal state");
        for _ in 0..6 {
            gpu.step(&model, &inputs, 1.0 / 60.0).expect("a legal step");
        }
        gpu.read_frame(&model, &mut state).expect("a device");
        (state.positions, gpu.wrenches()[0])
    };
    let (one, quiet) = run(1);
    let (two, pressed) = run(2);
    assert!(quiet.touches == 0 && pressed.force.z > 0.0, "{quiet:?}, {pressed:?}");
    assert_eq!(one[..], two[..one.len()]);
}
