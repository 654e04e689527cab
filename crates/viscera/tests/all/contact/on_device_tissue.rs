//! Tissue that meets tissue on a graphics processor, by the quasi-Newton method.

use viscera::contact::TissueContact;
use viscera::mesh::TetMesh;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::scene::Scene;
use viscera::settings::{Count, Elements, Integrator, Method, SolverSettings};
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::balance::ForceBalance;
use viscera::solver::gpu::GpuSolver;
use viscera::solver::{Inputs, Meetings, Pin};
use viscera::state::State;

use super::Block;
use super::tissue::{Bodies, block_at, rubbing};
use crate::common::Random;
use crate::common::device::{adapter, device, largest};
use crate::common::tied::TIED;

fn with(iterations: u32, integrator: Integrator, elements: Elements) -> SolverSettings {
    let (method, iterations) = (Method::QuasiNewton, Count::Of(iterations));
    SolverSettings { method, iterations, integrator, elements, ..SolverSettings::default() }
}

/// Bodies whose steps a device computes.
struct OnDevice {
    bodies: Bodies<f32>,
    gpu: GpuSolver,
}

impl OnDevice {
    fn new(bodies: Bodies<f32>) -> Self {
        let gpu = GpuSolver::new(device(), &bodies.model, bodies.solver.settings());
        let mut gpu = gpu.expect("a model that fits");
        gpu.write(&bodies.model, &bodies.state).expect("a legal state");
        Self { bodies, gpu }
    }

    fn step(&mut self) {
        let Bodies { model, inputs, dt, .. } = &self.bodies;
        self.gpu.step(model, inputs, *dt).expect("a legal step");
    }

    fn read(&mut self) {
        let Bodies { model, state, .. } = &mut self.bodies;
        self.gpu.read_frame(model, state).expect("a device");
    }

    /// What is kept of contact comes along.
    fn read_all(&mut self) -> &State<f32> {
        self.read();
        let contact = self.gpu.contact(&self.bodies.model, &self.bodies.state);
        self.bodies.state.contact = contact.expect("a device");
        &self.bodies.state
    }

    fn balance(&self) -> ForceBalance {
        let mut balance = ForceBalance::default();
        let Bodies { model, state, inputs, .. } = &self.bodies;
        self.gpu.force_balance(model, state, inputs, &mut balance).expect("a balance");
        balance
    }

    fn reaction(&self, counts: impl Fn(u32) -> bool) -> Vec3<f64> {
        let balance = self.balance();
        let pins = self.bodies.inputs.pins.iter().map(|pin| pin.vertex).filter(|&v| counts(v));
        pins.fold(Vec3::ZERO, |sum, v| sum + balance.residual[v as usize])
    }
}

/// A block over another one, turned a little so that no places are as near as others.
fn stacked<S: Real>(settings: &SolverSettings, contact: &TissueContact) -> Bodies<S> {
    let lower = block_at([0.03, 0.03, 0.01], [5, 5, 2], Vec3::ZERO);
    let upper = block_at([0.02, 0.02, 0.01], [4, 4, 2], vec3(1e-3, -1.5e-3, 0.0112));
    let turn = viscera::scalar::rigid::rotation_matrix(vec3(0.0, 0.0, 0.3));
    let vertices = upper.vertices().iter().map(|x| turn * *x).collect();
    let upper = TetMesh::new(vertices, upper.tets().to_vec(), upper.regions().to_vec());
    let meshes = vec![lower, upper.expect("a mesh").0];
    Bodies::new(meshes, [1e4, 0.4, 5e-3], contact, (settings, 1))
}

/// Two organs, one above the other.
fn livers(settings: &SolverSettings) -> Bodies<f32> {
    let liver = viscera::mesh::shapes::liver(0.04, 1.0).expect("a liver");
    let (low, high) = (liver.tets.vertices().iter())
        .fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x.z), high.max(x.z)));
    let above = |x: &Vec3<f64>| *x + vec3(3e-3, 0.0, 0.86 * (high - low));
    let vertices = liver.tets.vertices().iter().map(above).collect();
    let regions = liver.tets.regions().to_vec();
    let other = TetMesh::new(vertices, liver.tets.tets().to_vec(), regions).expect("a mesh").0;
    Bodies::new(vec![liver.tets, other], [1e4, 0.4, 0.0], &rubbing(0.2), (settings, 1))
}

/// Holds the lower one, leads the upper one down by 3 mm and aside.
fn press<S: Real>(bodies: &mut Bodies<S>, step: u32) {
    let (down, aside) =
        (super::ramp(f64::from(step), 0.0, 6.0), super::ramp(f64::from(step), 4.0, 12.0));
    let way = vec3(1e-3 * aside, 0.5e-3 * aside, -3e-3 * down);
    let below = bodies.of(0, |x| x.z < 1e-6);
    let above = bodies.of(1, |x| x.z > 0.0212 - 1e-6);
    let pin =
        |vertex: u32, way: Vec3<f64>| Pin { vertex, target: (bodies.rest(vertex) + way).cast() };
    let held = below.iter().map(|&v| pin(v, Vec3::ZERO));
    bodies.inputs.pins = held.chain(above.iter().map(|&v| pin(v, way))).collect();
}

/// What a device finds at places is what the processor does, but where two triangles are as near as rounding is.
fn assert_found(bodies: &mut OnDevice, least: usize) {
    let start = bodies.bodies.state.clone();
    bodies.gpu.write(&bodies.bodies.model, &start).expect("a state");
    let Bodies { model, dt, .. } = &bodies.bodies;
    let mut cpu = Meetings::<f32>::new(model, bodies.gpu.settings());
    cpu.meet(&start, *dt);
    let expected = cpu.found();
    bodies.gpu.step(model, &Inputs::default(), *dt).expect("a step");
    let found = bodies.gpu.found(model, &start).expect("a device");
    let length = |v: [f64; 3]| Vec3::<f64>::from_f64(v).length();
    let reach = start.positions.iter().map(|x| x.length()).fold(0.0, f32::max);
    let ulps = 4.0 * f64::from(f32::EPSILON * reach);
    let (mut ties, mut other) = (0, 0);
    for expected in &expected {
        let place = found.binary_search_by_key(&expected.sample, |found| found.sample);
        let Ok(place) = place else {
            // One at the edge of what is faced, or of the reach.
            other += 1;
            continue;
        };
        let found = &found[place];
        let apart = (length(found.away) - length(expected.away)).abs();
        assert!(apart < ulps, "{found:?} {expected:?}");
        if found.triangle != expected.triangle {
            ties += 1;
            continue;
        }
        // A share of 1e-3 of an edge of 4 mm or more is 4 um: directions of 0.1 mm turn by less.
        let turned = Vec3::<f64>::from_f64(found.normal) - Vec3::from_f64(expected.normal);
        let way = Vec3::<f64>::from_f64(found.away) - Vec3::from_f64(expected.away);
        assert!(
            turned.length() < 1e-4 + 4.0 * ulps / length(expected.away),
            "{found:?} {expected:?}"
        );
        assert!(way.length() < 1e-7, "{found:?} {expected:?}");
        // Directions make how much both face each other.
        let softer = (found.stiffness - expected.stiffness).abs();
        let most = expected.stiffness * 1e-3 + 1e-3 * ulps / length(expected.away);
        assert!(
            softer < most && (found.shift - expected.shift).abs() < 1e-9,
            "{found:?} {expected:?}"
        );
    }
    other += found.len().abs_diff(expected.len() - other);
    println!("{} found, {ties} ties, {other} at an edge", found.len());
    assert!(expected.len() >= least, "{}", expected.len());
    assert!(
        other <= 1 && ties * 20 <= expected.len(),
        "{ties} ties, {other} of {}",
        expected.len()
    );
}

#[test]
fn what_meets_is_what_the_processor_finds() {
    let settings = with(1, Integrator::ImplicitEuler, Elements::Plain);
    let mut random = Random(7);
    let mut run = |bodies: Bodies<f32>, shift: Vec3<f64>, least: usize| {
        let mut here = OnDevice::new(bodies);
        for _ in 0..3 {
            for v in 0..here.bodies.model.vertex_count() as u32 {
                let body = usize::from(here.bodies.meshes.len() > 1 && v >= here.bodies.first(1));
                let x = here.bodies.rest(v) + shift * body as f64;
                // A strip alone is closed.
                let alone = here.bodies.meshes.len() == 1;
                let x = if alone { x - vec3(0.0, 0.0, 2.7e-3 * x.z.signum()) } else { x };
                here.bodies.state.positions[v as usize] = (x + random.vector(2e-4)).cast();
                here.bodies.state.velocities[v as usize] = random.vector(0.02).cast();
            }
            assert_found(&mut here, least);
        }
    };
    run(stacked(&settings, &rubbing(0.3)), vec3(3e-4, 2e-4, -1.1e-3), 40);
    // Legs that are closed to half a millimetre.
    run(folded(&settings), Vec3::ZERO, 20);
    let mut both = livers(&settings);
    let low =
        vec3(0.0, 0.0, both.model.rest_positions.iter().map(|x| x.z).fold(0.0, f32::min).into());
    both.dt = 0.01;
    run(both, low * 0.1 + vec3(2e-3, 0.0, 0.0), 5);
}

/// Presses and rubs, to the end of every step: places and forces are those of the same steps in double precision.
#[test]
fn blocks_that_are_pressed_together_are_as_on_the_processor() {
    for (integrator, elements, steps) in [
        (Integrator::Sdirk2, Elements::Plain, 8),
        (Integrator::ImplicitEuler, Elements::Plain, 4),
        (Integrator::Sdirk2, Elements::Recovered, 4),
    ] {
        let mut truth = stacked::<f64>(&with(40, integrator, elements), &rubbing(0.3));
        let mut here = OnDevice::new(stacked(&with(60, integrator, elements), &rubbing(0.3)));
        for step in 1..=steps {
            press(&mut truth, step);
            press(&mut here.bodies, step);
            truth.step();
            here.step();
            here.read();
            let places = largest(&here.bodies.state.positions, &truth.state.positions);
            let above = |v: u32| v >= truth.first(1);
            let found = here.reaction(above);
            let first = truth.first(1);
            let expected = truth.reaction(|v| v >= first);
            let off = (found - expected).length() / expected.length().max(0.05);
            println!(
                "{integrator:?} {elements:?} {step}: places {places:.1e} m, {found:?} of {expected:?} N: {off:.1e}"
            );
            assert!(places < 2e-6, "{step}: {places:e} m");
            assert!(off < 1e-4, "{step}: {found:?} of {expected:?}");
        }
        let pairs = here.read_all().contact.pairs.clone();
        let wanted = &truth.state.contact.pairs;
        assert!(wanted.len() > 20);
        assert_eq!(
            pairs.iter().map(|pair| pair.sample).collect::<Vec<_>>(),
            wanted.iter().map(|pair| pair.sample).collect::<Vec<_>>()
        );
        let most = wanted.iter().map(|pair| pair.pressed).fold(0.0, f64::max);
        let pairs_off = pairs.iter().zip(wanted).map(|(a, b)| (a.pressed - b.pressed).abs());
        assert!(pairs_off.fold(0.0, f64::max) < 1e-2 * most);
        let residual = here.balance().relative_residual();
        assert!(residual < 5e-4, "{residual:e}");
    }
}

/// Two blocks in free flight collide off their middles: no momentum is lost, and they part as they do on the processor.
#[test]
fn a_collision_in_free_flight_keeps_momentum_on_a_device() {
    let settings = with(20, Integrator::Sdirk2, Elements::Plain);
    let gravity = vec3(0.4, -0.3, 0.2);
    let made = || {
        let one = block_at([0.02, 0.02, 0.02], [4, 4, 4], vec3(0.0, 0.0, -0.01));
        let other = block_at([0.015, 0.02, 0.02], [3, 4, 4], vec3(0.021, 5e-3, -4e-3));
        let meshes = vec![one, other];
        let mut bodies =
            Bodies::<f32>::new(meshes, [1e4, 0.4, 2e-3], &rubbing(0.3), (&settings, 2));
        for v in 0..bodies.model.vertex_count() as u32 {
            let sign = if v < bodies.first(1) { 1.0 } else { -1.0 };
            bodies.state.velocities[v as usize] = vec3(0.25 * sign, 0.02, 0.0);
        }
        bodies.inputs.gravity = gravity.cast();
        bodies
    };
    let mut cpu = made();
    let mass = cpu.model.masses.iter().map(|m| f64::from(*m)).sum::<f64>();
    let [before, _] = cpu.momentum();
    let mut here = OnDevice::new(made());
    let (mut touched, mut lost) = (0, 0.0f64);
    for step in 1..=12 {
        here.step();
        cpu.step();
        touched += usize::from(!here.read_all().contact.pairs.is_empty());
        let gained = gravity * (mass * f64::from(step) * cpu.dt);
        let off = here.bodies.momentum()[0] - before - gained;
        lost = lost.max(off.length() / (0.25 * mass));
    }
    let speed = |bodies: &Bodies<f32>, body: usize| {
        let all = bodies.of(body, |_| true);
        let sum = all.iter().map(|&v| f64::from(bodies.state.velocities[v as usize].x));
        sum.sum::<f64>() / all.len() as f64
    };
    let [found, expected] = [&here.bodies, &cpu].map(|b| speed(b, 1) - speed(b, 0));
    println!(
        "lost {lost:.1e} of momentum; touched in {touched} steps; {found} of {expected} m/s apart"
    );
    assert!(touched > 1 && here.bodies.state.contact.pairs.is_empty(), "{touched}");
    assert!(lost < 2e-6, "{lost:e}");
    // Of 0.5 m/s before.
    assert!((found - expected).abs() < 0.015, "{found} {expected}");
}

/// A block that lies on a larger one, which is held, where it is tilted: it stays below the angle of friction, and slides as it
/// does on the processor above.
#[test]
fn a_block_slides_on_another_as_on_the_processor() {
    const FRICTION: f64 = 0.3;
    let settings = with(16, Integrator::Sdirk2, Elements::Plain);
    for more in [-0.03, 0.1] {
        let made = || {
            let lower = block_at([0.08, 0.03, 0.005], [8, 3, 1], Vec3::ZERO);
            let upper = block_at([0.01, 0.01, 0.005], [2, 2, 1], vec3(-0.03, 1e-3, 0.006));
            let mut contact = rubbing(FRICTION);
            contact.law.stiffness = 1.0;
            let tissue = [3e4, 0.3, 5e-3];
            let mut bodies =
                Bodies::<f32>::new(vec![lower, upper], tissue, &contact, (&settings, 4));
            let all = bodies.of(0, |_| true).into_iter();
            bodies.inputs.pins =
                all.map(|vertex| Pin { vertex, target: bodies.rest(vertex).cast() }).collect();
            bodies
        };
        let (mut cpu, mut here) = (made(), OnDevice::new(made()));
        let angle = libm::atan(FRICTION) + more;
        for step in 0..50 {
            let angle = if step < 20 { 0.0 } else { angle };
            let gravity = vec3(libm::sin(angle), 0.0, -libm::cos(angle)) * 9.81;
            for bodies in [&mut cpu, &mut here.bodies] {
                bodies.inputs.gravity = gravity.cast();
            }
            cpu.step();
            here.step();
        }
        here.read();
        let [found, expected] = [&here.bodies, &cpu].map(|bodies| {
            let all = bodies.of(1, |_| true);
            let sum = all.iter().map(|&v| f64::from(bodies.state.velocities[v as usize].x));
            sum.sum::<f64>() / all.len() as f64
        });
        println!("{more}: {found} of {expected} m/s");
        if more < 0.0 {
            assert!(found.abs() < 1e-4, "{found}");
        } else {
            assert!(expected > 0.1 && (found / expected - 1.0).abs() < 0.02, "{found} {expected}");
        }
    }
}

/// Curvature of contact is on all levels: from the middle of a motion few passes come as near as on the processor.
#[test]
fn few_passes_come_as_near_as_the_processors() {
    let settings = |passes| with(passes, Integrator::ImplicitEuler, Elements::Plain);
    let mut begun = stacked::<f64>(&settings(60), &rubbing(0.3));
    for step in 1..=5 {
        press(&mut begun, step);
        begun.step();
    }
    let single = |all: &[Vec3<f64>]| all.iter().map(|x| x.cast()).collect::<Vec<Vec3<f32>>>();
    let made = |passes| {
        let mut bodies = stacked::<f32>(&settings(passes), &rubbing(0.3));
        bodies.state.positions = single(&begun.state.positions);
        bodies.state.velocities = single(&begun.state.velocities);
        bodies.state.contact = begun.state.contact.clone();
        press(&mut bodies, 6);
        bodies
    };
    let at = |passes: u32| {
        let (mut cpu, mut here) = (made(passes), OnDevice::new(made(passes)));
        cpu.step();
        here.step();
        here.read();
        [cpu.state.positions, here.bodies.state.positions]
    };
    let [truth, _] = at(100);
    let truth: Vec<Vec3<f64>> = truth.iter().map(|x| x.cast()).collect();
    for passes in [8, 14] {
        let [cpu, gpu] = at(passes).map(|found| largest(&found, &truth));
        println!("{passes} passes: {gpu:.1e} m left, processor {cpu:.1e} m");
        assert!(gpu < 2.0 * cpu + 2e-7, "{passes}: {gpu:e} {cpu:e}");
    }
}

fn simulated(text: &str, settings: &[(&str, &str)]) -> Simulation<f32> {
    let scene = Scene::parse("scene.toml", text, settings).expect("a scene");
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("bodies");
    Simulation::new(scene, assembly).expect("a simulation")
}

fn named() -> String {
    adapter().name().split(['"', '\\']).next().unwrap_or("gpu").to_owned()
}

/// Ties pull as on the processor, and tear where they do.
#[test]
fn ties_are_as_on_the_processor() {
    for (strength, frames) in [("3 kPa", 16), ("0.5 kPa", 16)] {
        let device = named();
        let run = |device: &str| {
            let settings = [
                ("solver.method", "quasi_newton"),
                ("solver.device", device),
                ("solver.iterations", "12"),
                ("tie.bed.strength", strength),
            ];
            let mut simulation = simulated(TIED, &settings);
            (0..frames).for_each(|_| simulation.advance_frame().expect("a frame"));
            let ties = simulation.tie_forces();
            let report = simulation.report();
            let hand = report.patches.iter().find(|patch| patch.name == "hand").expect("a hand");
            (hand.force[2], ties[0].torn, ties[0].force[2])
        };
        let (found, expected) = (run(&device), run("cpu"));
        println!("{strength}: {found:?} of {expected:?}");
        assert_eq!(found.1, expected.1, "{strength}");
        let off = (found.0 - expected.0).abs().max((found.2 - expected.2).abs());
        assert!(off < 1e-3 * expected.0.abs().max(0.05), "{strength}: {found:?} {expected:?}");
    }
}

/// A strip folded to a U whose legs are pressed together.
fn folded<S: Real>(settings: &SolverSettings) -> Bodies<S> {
    let made = Block::new([0.072, 0.012, 0.006], [18, 3, 2], [0.0; 3]).mesh;
    let radius = 0.003 + 0.003;
    let bent = std::f64::consts::PI * radius;
    let leg = 0.5 * (0.072 - bent);
    let bend = |x: Vec3<f64>| {
        let (along, up) = (x.x, x.z - 0.003);
        if along.abs() < 0.5 * bent {
            let (out, angle) = (radius + up, along / radius);
            vec3(leg + out * libm::cos(angle), x.y, out * libm::sin(angle))
        } else {
            let sign = along.signum();
            vec3(leg - (along.abs() - 0.5 * bent), x.y, sign * (radius + up))
        }
    };
    let vertices = made.vertices().iter().map(|x| bend(*x)).collect();
    let mesh = TetMesh::new(vertices, made.tets().to_vec(), made.regions().to_vec());
    Bodies::new(vec![mesh.expect("a mesh").0], [1e4, 0.4, 5e-3], &rubbing(0.1), (settings, 2))
}

fn close<S: Real>(bodies: &mut Bodies<S>, step: u32) {
    let way = 3.4e-3 * super::ramp(f64::from(step), 0.0, 16.0);
    let held = bodies.of(0, |x| x.z.abs() > 0.009 - 1e-6 && x.x < 0.015);
    let target = |x: Vec3<f64>| (x - vec3(0.0, 0.0, way * x.z.signum())).cast();
    let pin = |&vertex: &u32| Pin { vertex, target: target(bodies.rest(vertex)) };
    bodies.inputs.pins = held.iter().map(pin).collect();
}

#[test]
fn a_folded_strip_meets_itself_as_on_the_processor() {
    let mut truth = folded::<f64>(&with(30, Integrator::Sdirk2, Elements::Plain));
    let mut here = OnDevice::new(folded(&with(30, Integrator::Sdirk2, Elements::Plain)));
    for step in 1..=18 {
        close(&mut truth, step);
        close(&mut here.bodies, step);
        truth.step();
        here.step();
    }
    here.read();
    let places = largest(&here.bodies.state.positions, &truth.state.positions);
    let rest: Vec<f64> = (0..truth.model.vertex_count() as u32).map(|v| truth.rest(v).z).collect();
    let expected = truth.reaction(|v| rest[v as usize] > 0.0);
    let found = here.reaction(|v| rest[v as usize] > 0.0);
    let count = truth.state.contact.pairs.len();
    println!("places {places:.1e} m, {found:?} of {expected:?} N, {count} pairs");
    assert!(count > 20 && expected.z < -0.02, "{count} {expected:?}");
    assert!(places < 2e-5, "{places:e}");
    assert!((found - expected).length() < 2e-3 * expected.length(), "{found:?} {expected:?}");
}

/// Two runs have the same bits, also where one was read and goes on from what was read.
#[test]
fn meetings_have_the_same_bits_again() {
    let settings = with(12, Integrator::Sdirk2, Elements::Plain);
    let run = |again: bool| {
        let mut here = OnDevice::new(stacked(&settings, &rubbing(0.3)));
        for step in 1..=8 {
            press(&mut here.bodies, step);
            here.step();
            if again {
                here.read_all();
            }
        }
        here.read_all();
        here.bodies.state
    };
    let one = run(false);
    assert!(one.contact.pairs.len() > 20);
    assert_eq!(one, run(true));
    // What is kept goes on on the processor.
    let mut here = OnDevice::new(stacked(&settings, &rubbing(0.3)));
    let mut cpu = stacked::<f32>(&settings, &rubbing(0.3));
    for bodies in [&mut here.bodies, &mut cpu] {
        bodies.state = one.clone();
        press(bodies, 9);
    }
    here.gpu.write(&here.bodies.model, &one).expect("a state");
    here.step();
    here.read();
    cpu.step();
    let first = cpu.first(1);
    let (found, expected) = (here.reaction(|v| v >= first), cpu.reaction(|v| v >= first));
    println!("{found:?} of {expected:?}");
    assert!((found - expected).length() < 5e-3 * expected.length(), "{found:?} {expected:?}");
}

/// A scene of two organs on a device that is asked for by its name.
#[test]
fn organs_are_pressed_on_a_named_device() {
    let text = include_str!("../../../../../scenes/organs_pressed.toml");
    let device = named();
    let settings = [
        ("solver.device", device.as_str()),
        ("solver.iterations", "3"),
        ("body.spleen.spacing", "12 mm"),
        ("body.kidney.spacing", "12 mm"),
    ];
    let mut simulation = simulated(text, &settings);
    assert!(simulation.device_choice().contains(&device), "{}", simulation.device_choice());
    (0..2).for_each(|_| simulation.advance_frame().expect("a frame"));
    assert!(simulation.state().is_finite());
}
