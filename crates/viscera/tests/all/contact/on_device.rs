//! Contact with tools on a graphics processor, by the quasi-Newton method.

use super::meshes::surface;
use super::motion::{DOWNHILL, tilted};
use super::{Block, Scene, ramp};
use crate::common::device::{device, largest};
use std::sync::Arc;
use viscera::contact::{DistanceGrid, Shape, Tool, Wrench};
use viscera::scalar::rigid::rotation_matrix;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Count, Elements, Integrator, Method, SolverSettings};
use viscera::solver::Inputs;
use viscera::solver::balance::ForceBalance;
use viscera::solver::gpu::GpuSolver;
use viscera::state::{ContactState, State};

/// Integrators with the elements that tetrahedra are.
pub const ALL: [(Integrator, Elements); 3] = [
    (Integrator::Sdirk2, Elements::Plain),
    (Integrator::ImplicitEuler, Elements::Plain),
    (Integrator::Sdirk2, Elements::Recovered),
];

pub fn settings((integrator, elements): (Integrator, Elements)) -> SolverSettings {
    let method = Method::QuasiNewton;
    SolverSettings { method, integrator, elements, ..SolverSettings::default() }
}

fn with(iterations: u32, kind: (Integrator, Elements)) -> SolverSettings {
    SolverSettings { iterations: Count::Of(iterations), ..settings(kind) }
}

/// A ball that presses and is dragged aside, a box that turns as it comes down, a rod that stands in the tissue's way, and the
/// table below it.
pub fn tools() -> Vec<Tool> {
    let of = |shape| {
        let mut tool = Tool::new(shape);
        tool.law.friction = 0.5;
        tool
    };
    vec![
        of(Shape::Sphere { radius: 0.008 }),
        of(Shape::RoundedBox { half: vec3(0.004, 0.012, 0.006), radius: 0.002 }),
        of(Shape::Capsule { length: 0.03, radius: 0.004 }),
        of(Shape::HalfSpace),
    ]
}

/// Where they are at a time [s].
pub fn act(time: f64, tools: &mut [Tool]) {
    let (down, aside) = (ramp(time, 0.0, 0.1), ramp(time, 0.1, 0.2));
    let [ball, brick, rod, table] = tools else { panic!("four tools") };
    ball.pose.translation = vec3(-0.01 + 0.006 * aside, 0.002, 0.0295 - 0.005 * down);
    brick.pose.translation = vec3(0.012, 0.0, 0.0275 - 0.004 * down);
    brick.pose.rotation = rotation_matrix(vec3(0.0, 0.3 * down, 0.2 * aside));
    rod.pose.translation = vec3(0.0, -0.0255 + 0.003 * down, 0.002);
    table.pose.translation = vec3(0.0, 0.0, -0.0005);
}

/// Tissue that is held at one side.
pub fn scene<S: Real>(settings: &SolverSettings) -> Scene<S> {
    scene_of(settings, [5, 5, 3])
}

/// The same in so many cells.
fn scene_of<S: Real>(settings: &SolverSettings, cells: [usize; 3]) -> Scene<S> {
    let block = Block::new([0.04, 0.04, 0.02], cells, [1e4, 0.4, 0.0]);
    let pins = block.pins(|x| x.x > 0.0199);
    let inputs = Inputs { pins, tools: tools(), ..Inputs::default() };
    let mut scene = Scene::with(&block, settings, 1, inputs);
    act(0.0, &mut scene.inputs.tools);
    scene.state.contact = ContactState::of(&scene.inputs.tools);
    scene
}

/// A step of the processor, and the forces at its end.
pub fn advance<S: Real>(scene: &mut Scene<S>) -> Vec<Wrench> {
    scene.steps += 1;
    act(f64::from(scene.steps) * scene.dt, &mut scene.inputs.tools);
    let Scene { model, state, solver, inputs, dt, .. } = scene;
    solver.step(model, state, inputs, *dt).expect("a step");
    solver.wrenches().to_vec()
}

/// A device that goes on from a scene's state.
pub struct OnDevice {
    pub gpu: GpuSolver,
    pub state: State<f32>,
}

impl OnDevice {
    pub fn new(scene: &Scene<f32>) -> Self {
        let settings = scene.solver.settings();
        Self::of(GpuSolver::new(device(), &scene.model, settings), scene)
    }

    pub fn of(gpu: Result<GpuSolver, viscera::solver::gpu::GpuError>, scene: &Scene<f32>) -> Self {
        let mut gpu = gpu.expect("a model that fits");
        gpu.write(&scene.model, &scene.state).expect("a legal state");
        Self { gpu, state: scene.state.clone() }
    }

    pub fn step(&mut self, scene: &Scene<f32>) -> Vec<Wrench> {
        self.gpu.step(&scene.model, &scene.inputs, scene.dt).expect("a legal step");
        self.gpu.read_frame(&scene.model, &mut self.state).expect("a device");
        self.gpu.wrenches().to_vec()
    }

    pub fn residual(&self, scene: &Scene<f32>) -> f64 {
        let mut balance = ForceBalance::default();
        let Scene { model, inputs, .. } = scene;
        self.gpu.force_balance(model, &self.state, inputs, &mut balance).expect("a balance");
        balance.relative_residual()
    }
}

/// How far forces and torques are from the truth, of the largest force; torques over the size of the tissue [m].
pub fn off(found: &[Wrench], truth: &[Wrench]) -> f64 {
    let most = truth.iter().map(|wrench| wrench.force.length()).fold(0.0, f64::max);
    let apart = found.iter().zip(truth).map(|(found, truth)| {
        let force = (found.force - truth.force).length();
        force.max((found.torque - truth.torque).length() / 0.04)
    });
    apart.fold(0.0, f64::max) / most
}

/// Presses, turns and drags, to the end of every step: forces are those of the same steps in double precision, and what is
/// touched is the same but where a sample is as near as rounding is.
fn assert_agreement(steps: u32) {
    for kind in ALL {
        let mut truth = scene::<f64>(&with(60, kind));
        let mut here = scene::<f32>(&with(100, kind));
        let mut gpu = OnDevice::new(&here);
        for step in 0..steps {
            let expected = advance(&mut truth);
            advance(&mut here);
            let found = gpu.step(&here);
            let x = &truth.state.positions;
            let [places, single] =
                [&gpu.state, &here.state].map(|state| largest(&state.positions, x));
            let forces = off(&found, &expected);
            println!("{kind:?} {step}: places {places:.1e} m, forces {forces:.1e}");
            // The processor computes contact in double precision; here places of 4 cm are rounded, against what is stiff at a
            // hundred times the modulus over an edge.
            assert!(places < 2.0 * single + 1e-6, "{kind:?} {step}: {places:e} m, {single:e}");
            assert!(forces < 1e-4, "{kind:?} {step}: {forces:e}");
            for (found, expected) in found.iter().zip(&expected) {
                assert!(found.touches.abs_diff(expected.touches) <= 1, "{found:?}, {expected:?}");
                assert_eq!((found.left_out, found.has_jumped), (0, false));
                assert!((found.depth - expected.depth).abs() < 1e-6, "{found:?}, {expected:?}");
            }
        }
        let residual = gpu.residual(&here);
        // Places are stored to 4e-9 m, against 500 N/m at a sample: 2e-6 N, where vertices bear 1e-2 N.
        assert!(residual < 5e-4, "{kind:?}: {residual:e}");
    }
}

#[test]
fn forces_and_places_are_the_processors() {
    assert_agreement(14);
}

/// Two steps, for a second, slower driver.
#[test]
fn portable_contact_is_the_processors() {
    assert_agreement(2);
}

/// The same tools as closed surfaces.
fn solids() -> Vec<Tool> {
    let solid = |tool: Tool| match tool.shape {
        Shape::HalfSpace => tool,
        ref shape => {
            let grid = DistanceGrid::new(&surface(shape), 1e-3).expect("a solid");
            Tool { shape: Shape::Mesh(Arc::new(grid)), ..tool }
        }
    };
    tools().into_iter().map(solid).collect()
}

/// Closed surfaces are on the device as they are here: distances between points, planes, and where nothing is near.
#[test]
fn forces_of_closed_surfaces_are_the_processors() {
    for kind in ALL {
        let mut here = scene::<f32>(&with(100, kind));
        here.inputs.tools = solids();
        act(0.0, &mut here.inputs.tools);
        let mut gpu = OnDevice::new(&here);
        for step in 0..10 {
            if step == 6 {
                // The middle one goes: what is left has other places, and is the same.
                here.inputs.tools[1].shape = Shape::Sphere { radius: 1e-3 };
            }
            let expected = advance(&mut here);
            let found = gpu.step(&here);
            let forces = off(&found, &expected);
            println!("{kind:?} {step}: forces {forces:.1e}");
            assert!(expected[0].force.z > 0.01, "{expected:?}");
            // Distances on a grid have edges, so that there is more than one place of rest: in other ways of solving single and
            // double precision end in two of them, on the processor as well. All are in balance.
            let is_same = kind == ALL[0];
            assert!(forces < if is_same { 1e-4 } else { 1e-2 }, "{kind:?} {step}: {forces:e}");
        }
        let residual = gpu.residual(&here);
        // Places are stored to 4e-9 m, against 500 N/m at a sample: 2e-6 N, where vertices bear 1e-2 N.
        assert!(residual < 5e-4, "{kind:?}: {residual:e}");
    }
}

/// From the middle of a motion on a device needs as many passes as the processor, and two more at most, to a hundredth and a
/// thousandth of what a step moves.
#[test]
fn passes_are_about_as_many_as_the_processors() {
    // Of the last mesh the coarsest level is not the only one on lattices.
    let usual = [5, 5, 3];
    let all = ALL.map(|kind| (kind, usual)).into_iter().chain([(ALL[0], [9, 9, 5])]);
    for (kind, cells) in all {
        let mut truth = scene_of::<f64>(&with(60, kind), cells);
        (0..4).for_each(|_| drop(advance(&mut truth)));
        let before = truth.state.clone();
        advance(&mut truth);
        let moved = largest(&before.positions, &truth.state.positions);
        let single = |all: &[Vec3<f64>]| all.iter().map(|x| x.cast()).collect();
        let scene = |passes: u32| {
            let mut here = scene_of::<f32>(&with(passes, kind), cells);
            here.state.positions = single(&before.positions);
            here.state.velocities = single(&before.velocities);
            here.state.contact = before.contact.clone();
            here.steps = truth.steps - 1;
            here
        };
        let off = |state: &State<f32>| largest(&state.positions, &truth.state.positions) / moved;
        let on_cpu = |passes: u32| {
            let mut here = scene(passes);
            advance(&mut here);
            off(&here.state)
        };
        let on_device = |passes: u32| {
            let mut here = scene(passes);
            let mut gpu = OnDevice::new(&here);
            act(f64::from(here.steps + 1) * here.dt, &mut here.inputs.tools);
            gpu.step(&here);
            off(&gpu.state)
        };
        for share in [1e-2, 1e-3] {
            let cpu = (2..60).find(|&passes| on_cpu(passes) < share).expect("it ends");
            let gpu = (cpu.max(4) - 2..=cpu + 2).find(|&passes| on_device(passes) < share);
            println!(
                "{kind:?}, {cells:?}: {share:.0e} of {moved:.1e} m after {gpu:?} passes, CPU {cpu}"
            );
            assert!(gpu.is_some(), "{kind:?}, {cells:?}, {share:e}: CPU {cpu} passes");
        }
    }
}

/// How far a block creeps [m], and its acceleration downhill [m/s^2], in the second of these times [s]; `gravity` at a step's beginning.
pub fn slide(
    gpu: &mut OnDevice,
    scene: &mut Scene<f32>,
    gravity: impl Fn(f64) -> Vec3<f64>,
    [before, during]: [f64; 2],
) -> [f64; 2] {
    let mut run = |time: f64| {
        for _ in 0..(time / scene.dt).round() as u32 {
            scene.inputs.gravity = gravity(f64::from(scene.steps) * scene.dt).cast();
            scene.steps += 1;
            gpu.gpu.step(&scene.model, &scene.inputs, scene.dt).expect("a legal step");
        }
        gpu.gpu.read_frame(&scene.model, &mut scene.state).expect("a device");
        let speed = scene.mean(|s, v| s.velocities[v]).dot(DOWNHILL);
        (scene.state.positions.clone(), speed)
    };
    let (first, slow) = run(before);
    let (last, fast) = run(during);
    let crept = last.iter().zip(&first).map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
    [crept.into(), (fast - slow) / during]
}

/// The acceleration of a block [m/s^2] on a slope [degrees], with friction.
pub fn downhill(slope: f64, friction: f64) -> f64 {
    let angle = slope.to_radians();
    9.81 * (libm::sin(angle) - friction * libm::cos(angle))
}

/// A block on a slope: it holds below the angle of friction, and slides as fast as it should above.
#[test]
fn a_block_slides_as_fast_as_it_should() {
    // So much that a block flutters by SDIRK2, which makes it 4e-3 too slow.
    const FRICTION: f64 = 0.8;
    let exact = libm::atan(FRICTION).to_degrees();
    let usual = settings(ALL[0]);
    for more in [-0.3, 3.0] {
        let (mut scene, gravity) = tilted::<f32>(&usual, 2, 10.0, FRICTION, exact + more);
        scene.state.contact = ContactState::of(&scene.inputs.tools);
        let mut gpu = OnDevice::new(&scene);
        let [crept, found] = slide(&mut gpu, &mut scene, gravity, [1.1, 0.5]);
        let wanted = downhill(exact + more, FRICTION);
        println!("{more}: {crept:e} m, {found} of {wanted} m/s^2");
        if more < 0.0 {
            // Places are stored to 2e-9 m.
            assert!(crept < 1e-7, "{crept:e} m below the angle");
        } else {
            assert!((found / wanted - 1.0).abs() < 1e-3, "{found} of {wanted} m/s^2");
        }
        let residual = OnDevice { gpu: gpu.gpu, state: scene.state.clone() }.residual(&scene);
        assert!(residual < 3e-2, "{residual:e}");
    }
}

/// What is kept of contact comes back to the host, and goes on elsewhere: on the processor, and on another device.
#[test]
fn contact_goes_on_from_what_was_read() {
    let mut here = scene::<f32>(&with(60, ALL[0]));
    let mut gpu = OnDevice::new(&here);
    for step in 1..=9 {
        act(f64::from(step) * here.dt, &mut here.inputs.tools);
        gpu.step(&here);
    }
    gpu.state.contact = gpu.gpu.contact(&here.model, &gpu.state).expect("a device");
    assert!(gpu.state.contact.touches.len() > 100, "{}", gpu.state.contact.touches.len());
    here.state = gpu.state.clone();
    let mut again = OnDevice::new(&here);
    act(10.0 * here.dt, &mut here.inputs.tools);
    let [on, other] = [gpu.step(&here), again.step(&here)];
    let Scene { model, state, solver, inputs, dt, .. } = &mut here;
    solver.step(model, state, inputs, *dt).expect("a step");
    let truth = solver.wrenches();
    // Forgotten anchors would take friction away.
    assert!(off(&on, truth) < 2e-3 && off(&other, truth) < 2e-3, "{on:?} {other:?} {truth:?}");
}

/// A ratchet holds what is pressed as it locks, though nothing presses it any more.
#[test]
fn what_is_tied_follows_its_tool() {
    let block = Block::new([0.02, 0.02, 0.02], [3, 3, 3], [1e4, 0.4, 0.0]);
    let plate = Shape::RoundedBox { half: vec3(0.01, 0.01, 0.002), radius: 0.0 };
    let mut tool = Tool::new(plate);
    tool.law.friction = 0.0;
    let inputs = Inputs { pins: block.fixed_below(), tools: vec![tool], ..Inputs::default() };
    let height = |time: f64| 0.0225 - 0.002 * ramp(time, 0.0, 0.1) + 0.004 * ramp(time, 0.2, 0.4);
    let lead = |time: f64, tools: &mut [Tool]| {
        tools[0].pose.translation = vec3(0.0, 0.0, height(time));
        tools[0].is_locked = time > 0.15;
    };
    let mut truth = Scene::<f64>::with(&block, &with(60, ALL[0]), 1, inputs.clone());
    truth.run(0.5, lead);
    let inputs = Inputs { pins: block.fixed_below(), tools: inputs.tools, ..Inputs::default() };
    let mut here = Scene::<f32>::with(&block, &with(60, ALL[0]), 1, inputs);
    lead(0.0, &mut here.inputs.tools);
    here.state.contact = ContactState::of(&here.inputs.tools);
    let mut gpu = OnDevice::new(&here);
    let mut found = Vec::new();
    for step in 1..=truth.steps {
        lead(f64::from(step) * here.dt, &mut here.inputs.tools);
        found = gpu.step(&here);
    }
    let expected = truth.solver.wrenches();
    assert!(expected[0].force.z < -0.1, "it is pulled up: {expected:?}");
    assert!(off(&found, expected) < 1e-3, "{found:?}, {expected:?}");
}

/// Forces come without anybody waiting for them, and are those that a reader who waits gets.
#[test]
fn the_newest_forces_come_by_themselves() {
    let mut here = scene::<f32>(&settings(ALL[0]));
    let mut gpu = OnDevice::new(&here);
    assert_eq!(gpu.gpu.newest_forces(), None);
    let mut last = 0;
    for step in 1..=6 {
        act(f64::from(step) * here.dt, &mut here.inputs.tools);
        gpu.gpu.step(&here.model, &here.inputs, here.dt).expect("a legal step");
        // Nobody takes them away: three are under way at most.
        last = gpu.gpu.request_forces().unwrap_or(last);
        gpu.gpu.wait().expect("a device");
        let (number, wrenches) = gpu.gpu.newest_forces().expect("forces");
        assert_eq!((number, wrenches.len()), (last, 4));
        gpu.gpu.read_frame(&here.model, &mut gpu.state).expect("a device");
        assert_eq!(wrenches, gpu.gpu.wrenches());
        assert!(step < 3 || wrenches[0].force.z > 0.1, "{wrenches:?}");
    }
    assert_eq!(last, 6);
}

/// A tool that is put elsewhere forgets what it touched, and says so.
#[test]
fn a_tool_that_jumps_is_no_motion() {
    let mut truth = scene::<f64>(&with(60, ALL[0]));
    let mut here = scene::<f32>(&with(60, ALL[0]));
    let mut gpu = OnDevice::new(&here);
    let mut step = |truth: &mut Scene<f64>, here: &mut Scene<f32>, shift: f64| {
        truth.steps += 1;
        let time = f64::from(truth.steps) * here.dt;
        act(time, &mut truth.inputs.tools);
        truth.inputs.tools[0].pose.translation.y += shift;
        here.inputs.tools.clone_from(&truth.inputs.tools);
        let Scene { model, state, solver, inputs, dt, .. } = truth;
        solver.step(model, state, inputs, *dt).expect("a step");
        (gpu.step(here), truth.solver.wrenches().to_vec())
    };
    for _ in 0..5 {
        step(&mut truth, &mut here, 0.0);
    }
    let (found, expected) = step(&mut truth, &mut here, 0.5);
    assert!(found[0].has_jumped && expected[0].has_jumped);
    assert!(!found[1].has_jumped && found[0].touches == 0);
    assert!(off(&found, &expected) < 1e-3, "{found:?}, {expected:?}");
}

/// Forces on samples of which all vertices are pinned say so.
#[test]
fn tools_on_what_is_pinned_say_so() {
    let block = Block::new([0.02, 0.02, 0.01], [2, 2, 2], [1e4, 0.4, 0.0]);
    let mut tool = Tool::new(Shape::HalfSpace);
    tool.pose.translation = vec3(0.0, 0.0, 2e-4);
    let inputs = Inputs { pins: block.fixed_below(), tools: vec![tool], ..Inputs::default() };
    let mut here = Scene::<f32>::with(&block, &settings(ALL[0]), 1, inputs);
    here.state.contact = ContactState::of(&here.inputs.tools);
    let [wrench] = OnDevice::new(&here).step(&here)[..] else { panic!("one tool") };
    // A wall at the side is free.
    assert!(wrench.pinned > 0 && wrench.pinned <= wrench.touches, "{wrench:?}");
    let Scene { model, state, solver, inputs, dt, .. } = &mut here;
    solver.step(model, state, inputs, *dt).expect("a step");
    let expected = solver.wrenches()[0];
    assert_eq!((wrench.pinned, wrench.touches), (expected.pinned, expected.touches));
}
