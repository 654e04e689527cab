//! Contact with tools on a graphics processor, by the quasi-Newton method.

use super::{Block, Scene, ramp};
use crate::common::device::{device, largest};
use viscera::contact::{Shape, Tool, Wrench};
use viscera::scalar::rigid::rotation_matrix;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Count, Elements, Integrator, Method, SolverSettings};
use viscera::solver::Inputs;
use viscera::solver::balance::ForceBalance;
use viscera::solver::gpu::GpuSolver;
use viscera::state::{ContactState, State};

const FRAME: f64 = 1.0 / 60.0;

fn settings(integrator: Integrator, elements: Elements) -> SolverSettings {
    let (method, iterations) = (Method::QuasiNewton, Count::Auto);
    SolverSettings { method, integrator, elements, iterations, ..SolverSettings::default() }
}

fn tissue() -> Block {
    Block::new([0.04, 0.04, 0.02], [5, 5, 3], [1e4, 0.4, 0.0])
}

/// A ball that presses and is dragged aside, a box that turns as it comes down, a rod that stands in the tissue's way, and the
/// table below it.
fn tools() -> Vec<Tool> {
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
fn act(time: f64, tools: &mut [Tool]) {
    let (down, aside) = (ramp(time, 0.0, 0.1), ramp(time, 0.1, 0.2));
    let [ball, brick, rod, table] = tools else { panic!("four tools") };
    ball.pose.translation = vec3(-0.01 + 0.006 * aside, 0.002, 0.0295 - 0.005 * down);
    brick.pose.translation = vec3(0.012, 0.0, 0.0275 - 0.004 * down);
    brick.pose.rotation = rotation_matrix(vec3(0.0, 0.3 * down, 0.2 * aside));
    rod.pose.translation = vec3(0.0, -0.0255 + 0.003 * down, 0.002);
    table.pose.translation = vec3(0.0, 0.0, -0.0005);
}

/// A device that goes on beside the processor.
struct OnDevice {
    gpu: GpuSolver,
    state: State<f32>,
}

impl OnDevice {
    fn new(scene: &Scene<f32>) -> Self {
        let settings = scene.solver.settings();
        let mut gpu = GpuSolver::new(device(), &scene.model, settings).expect("a model that fits");
        gpu.write(&scene.model, &scene.state).expect("a legal state");
        Self { gpu, state: scene.state.clone() }
    }

    fn step(&mut self, scene: &Scene<f32>) -> Vec<Wrench> {
        self.gpu.step(&scene.model, &scene.inputs, scene.dt).expect("a legal step");
        self.gpu.read_frame(&scene.model, &mut self.state).expect("a device");
        self.gpu.wrenches().to_vec()
    }
}

fn scene<S: Real>(settings: &SolverSettings) -> Scene<S> {
    let block = tissue();
    let pins = block.pins(|x| x.x > 0.0199);
    let inputs = Inputs { pins, tools: tools(), ..Inputs::default() };
    let mut scene = Scene::with(&block, settings, 1, inputs);
    act(0.0, &mut scene.inputs.tools);
    scene.state.contact = ContactState::of(&scene.inputs.tools);
    scene
}

fn advance<S: Real>(scene: &mut Scene<S>, tools: &dyn Fn(f64, &mut [Tool])) -> Vec<Wrench> {
    scene.steps += 1;
    tools(f64::from(scene.steps) * scene.dt, &mut scene.inputs.tools);
    let Scene { model, state, solver, inputs, dt, .. } = scene;
    solver.step(model, state, inputs, *dt).expect("a step");
    solver.wrenches().to_vec()
}

/// Presses, turns and drags; every step from where the processor's last one has ended.
#[test]
fn steps_follow_the_processors() {
    for (integrator, elements) in [
        (Integrator::Sdirk2, Elements::Plain),
        (Integrator::ImplicitEuler, Elements::Plain),
        (Integrator::Sdirk2, Elements::Recovered),
    ] {
        let many = SolverSettings { iterations: Count::Of(std::env::var("IT").map_or(40, |t| t.parse().unwrap())), ..settings(integrator, elements) };
        let mut cpu = scene::<f64>(&many);
        let mut single = scene::<f32>(&many);
        let mut gpu = OnDevice::new(&single);
        for step in 0..14 {
            let expected = advance(&mut cpu, &act);
            let on_cpu = advance(&mut single, &act);
            let found = gpu.step(&single);
            let off = largest(&gpu.state.positions, &cpu.state.positions);
            let off_cpu = largest(&single.state.positions, &cpu.state.positions);
            println!("{integrator:?} {elements:?} {step}: {off:.1e} m, CPU {off_cpu:.1e}");
            for ((found, on_cpu), expected) in found.iter().zip(&on_cpu).zip(&expected) {
                println!(
                    "   {:.5?} {:.5?} {:.5?}  {} {} {}   {:.2e} {:.2e}",
                    found.force.to_array(), on_cpu.force.to_array(), expected.force.to_array(),
                    found.touches, on_cpu.touches, found.left_out,
                    (found.torque - expected.torque).length(), expected.torque.length(),
                );
            }
        }
        let mut balance = ForceBalance::default();
        gpu.gpu
            .force_balance(&single.model, &gpu.state, &single.inputs, &mut balance)
            .expect("a balance");
        println!("residual {:e}", balance.relative_residual());
        let mut of_cpu = ForceBalance::default();
        let Scene { model, state, solver, inputs, .. } = &mut single;
        solver.force_balance(model, state, inputs, &mut of_cpu).expect("a balance");
        println!("CPU {:e}", of_cpu.relative_residual());
    }
    let _ = (FRAME, Vec3::<f64>::ZERO);
}

/// A block on a slope: it holds below the angle of friction, and slides as fast as it should above.
#[test]
fn a_block_slides_as_fast_as_it_should() {
    use super::motion::{DOWNHILL, tilted};
    let settings = settings(Integrator::Sdirk2, Elements::Plain);
    let exact = libm::atan(0.5).to_degrees();
    for more in [-0.3, 3.0] {
        let (mut scene, gravity) = tilted::<f32>(&settings, 2, 10.0, 0.5, exact + more);
        scene.state.contact = ContactState::of(&scene.inputs.tools);
        let mut gpu = OnDevice::new(&scene);
        let mut run = |scene: &mut Scene<f32>, time: f64| {
            for _ in 0..(time / scene.dt).round() as u32 {
                scene.inputs.gravity = gravity(f64::from(scene.steps) * scene.dt).cast();
                scene.steps += 1;
                gpu.gpu.step(&scene.model, &scene.inputs, scene.dt).expect("a legal step");
            }
            gpu.gpu.read_frame(&scene.model, &mut scene.state).expect("a device");
            let speed = scene.mean(|s, v| s.velocities[v]).dot(DOWNHILL);
            (scene.state.positions.clone(), speed)
        };
        let (_, _) = run(&mut scene, 0.9);
        let (before, slow) = run(&mut scene, 0.2);
        let (after, fast) = run(&mut scene, 0.5);
        let crept = after.iter().zip(&before).map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
        let angle = (exact + more).to_radians();
        let wanted = 9.81 * (libm::sin(angle) - 0.5 * libm::cos(angle));
        println!("{more}: {crept:e} m, {} of {wanted}", (fast - slow) / 0.5);
        let mut balance = ForceBalance::default();
        gpu.gpu.force_balance(&scene.model, &scene.state, &scene.inputs, &mut balance).expect("a balance");
        println!("residual {:e}; {:?}", balance.relative_residual(), gpu.gpu.wrenches());
    }
}
