//! Contact with tools on a graphics processor, by explicit steps.

use super::grasps::{GRASPED, Plan};
use super::motion::DOWNHILL;
use super::on_device::{OnDevice, downhill, off, slide, tools};
use super::on_device_robust::Account;
use super::{Block, Scene, ramp};
use crate::common::Random;
use crate::common::device::{device, largest};
use crate::common::potential::Outside;
use viscera::contact::{Shape, Tool, Wrench};
use viscera::measure::measure_tets;
use viscera::scalar::rigid::rotation_matrix;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Elements, Method, SolverSettings};
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::Inputs;
use viscera::solver::gpu::GpuSolver;
use viscera::state::{ContactState, State};

const BOTH: [Elements; 2] = [Elements::Plain, Elements::Recovered];

fn explicit(elements: Elements, explicit_safety: f64) -> SolverSettings {
    let method = Method::Explicit;
    SolverSettings { method, elements, explicit_safety, ..SolverSettings::default() }
}

/// Tissue that is fixed below, of little viscosity, and a ball, a box that turns and a rod in its way.
fn pressed<S: Real>(settings: &SolverSettings) -> Scene<S> {
    let block = Block::new([0.04, 0.04, 0.02], [4, 4, 2], [1e4, 0.4, 0.002]);
    let inputs = Inputs { pins: block.fixed_below(), tools: tools(), ..Inputs::default() };
    let mut scene = Scene::with(&block, settings, 1, inputs);
    scene.inputs.tools.truncate(3);
    lead(0.0, &mut scene.inputs.tools);
    scene.state.contact = ContactState::of(&scene.inputs.tools);
    scene
}

/// Where they are at a time [s]: down, and aside.
fn lead(time: f64, tools: &mut [Tool]) {
    let (down, aside) = (ramp(time, 0.0, 0.06), ramp(time, 0.06, 0.12));
    let [ball, brick, rod] = tools else { panic!("three tools") };
    ball.pose.translation = vec3(-0.01 + 0.006 * aside, 0.002, 0.0295 - 0.005 * down);
    brick.pose.translation = vec3(0.012, 0.0, 0.0275 - 0.004 * down);
    brick.pose.rotation = rotation_matrix(vec3(0.0, 0.3 * down, 0.2 * aside));
    rod.pose.translation = vec3(0.0, -0.0255 + 0.003 * down, 0.002);
}

fn advance<S: Real>(scene: &mut Scene<S>) -> Vec<Wrench> {
    scene.steps += 1;
    lead(f64::from(scene.steps) * scene.dt, &mut scene.inputs.tools);
    let Scene { model, state, solver, inputs, dt, .. } = scene;
    solver.step(model, state, inputs, *dt).expect("a step");
    solver.wrenches().to_vec()
}

/// While tools press and drag, forces and places come to those of many more small steps in double precision: by the small steps of
/// the default they are about as far from them as the processor's own are, by short ones as single precision allows.
fn assert_agreement(steps: u32) {
    const USUAL: f64 = 0.8;
    const SHORT: f64 = 0.07;
    for elements in BOTH {
        let mut truth = pressed::<f64>(&explicit(elements, 0.5 * SHORT));
        let mut cpu = pressed::<f64>(&explicit(elements, USUAL));
        let mut inputs = [USUAL, SHORT].map(|safety| pressed::<f32>(&explicit(elements, safety)));
        let mut devices = inputs.each_ref().map(OnDevice::new);
        for step in 1..=steps {
            let expected = advance(&mut truth);
            let of_cpu = advance(&mut cpu);
            let x = &truth.state.positions;
            let [[usual_place, usual_force], [place, force]] = [0, 1].map(|i| {
                let (scene, device) = (&mut inputs[i], &mut devices[i]);
                lead(f64::from(step) * scene.dt, &mut scene.inputs.tools);
                let found = device.step(scene);
                for (found, expected) in found.iter().zip(&expected) {
                    let more = found.touches.abs_diff(expected.touches);
                    assert!(more <= 2, "{found:?}, {expected:?}");
                    assert_eq!((found.left_out, found.has_jumped), (0, false));
                }
                [largest(&device.state.positions, x), off(&found, &expected)]
            });
            // Accelerations are those in the middle of the last small step.
            for (scene, device) in inputs.iter().zip(&devices) {
                let residual = device.residual(scene);
                assert!(residual < 2e-2, "{elements:?} {step}: {residual:e}");
            }
            let of_cpu = [largest(&cpu.state.positions, x), off(&of_cpu, &expected)];
            println!(
                "{elements:?} {step}: {usual_place:.1e} m, {usual_force:.1e}; CPU {:.1e} m, {:.1e}; \
                 short {place:.1e} m, {force:.1e}",
                of_cpu[0], of_cpu[1]
            );
            // Of the 6 mm that tissue moves by a ten-thousandth, as of forces.
            assert!(usual_place < 1.5 * of_cpu[0] + 1e-5, "{elements:?} {step}: {usual_place:e} m");
            assert!(usual_force < 1.5 * of_cpu[1] + 5e-4, "{elements:?} {step}: {usual_force:e}");
            assert!(place < 6e-7 && force < 1e-4, "{elements:?} {step}: {place:e} m, {force:e}");
        }
        for device in devices {
            assert_eq!(device.gpu.rejected_steps().expect("a device"), 0);
        }
    }
}

#[test]
fn explicit_forces_and_places_are_the_processors() {
    assert_agreement(8);
}

/// Two steps, for a second, slower driver.
#[test]
fn portable_explicit_contact_is_the_processors() {
    assert_agreement(2);
}

/// Contact that is a hundred times as stiff, whatever small steps are by tissue alone: nothing is rejected, forces are those of the
/// processor, which makes small steps as short as that needs.
#[test]
fn contact_is_as_stiff_as_it_likes_in_explicit_steps() {
    for elements in BOTH {
        let mut truth = pressed::<f64>(&explicit(elements, 0.8));
        let mut here = pressed::<f32>(&explicit(elements, 0.8));
        truth.inputs.tools.iter_mut().for_each(|tool| tool.law.stiffness *= 100.0);
        here.inputs.tools.iter_mut().for_each(|tool| tool.law.stiffness *= 100.0);
        let mut gpu = OnDevice::new(&here);
        for step in 1..=8 {
            let expected = advance(&mut truth);
            lead(f64::from(step) * here.dt, &mut here.inputs.tools);
            let found = gpu.step(&here);
            let apart = largest(&gpu.state.positions, &truth.state.positions);
            let forces = off(&found, &expected);
            println!("{elements:?} {step}: {apart:.1e} m, {forces:.1e}");
            // Tools come at 0.08 m/s: the first forces are those of waves that start.
            assert!(apart < 3e-5, "{elements:?} {step}: {apart:e} m");
            assert!(forces < if step == 1 { 0.1 } else { 0.02 }, "{elements:?} {step}: {forces:e}");
        }
        assert_eq!(gpu.gpu.rejected_steps().expect("a device"), 0);
    }
}

/// Two runs have the same bits, whatever memory held before.
#[test]
fn explicit_contact_has_the_same_bits_whatever_the_memory_held() {
    for elements in BOTH {
        let run = |left_over: Option<f32>| {
            let mut here = pressed::<f32>(&explicit(elements, 0.8));
            let settings = here.solver.settings();
            let gpu = match left_over {
                None => GpuSolver::new(device(), &here.model, settings),
                Some(value) => GpuSolver::on_used_memory(device(), &here.model, settings, value),
            };
            let mut gpu = OnDevice::of(gpu, &here);
            let mut wrenches = Vec::new();
            for step in 1..=3 {
                lead(f64::from(step) * here.dt, &mut here.inputs.tools);
                wrenches = gpu.step(&here);
            }
            (gpu.state.positions, gpu.state.velocities, wrenches)
        };
        let first = run(None);
        assert!(first.2[0].force.z > 0.1, "{:?}", first.2);
        for left_over in [None, Some(f32::NAN)] {
            assert_eq!(run(left_over), first, "{elements:?}, {left_over:?}");
        }
    }
}

/// A block on a slope: it holds below the angle of friction, and slides as fast as it should above.
#[test]
fn a_block_slides_as_fast_as_it_should_by_explicit_steps() {
    const FRICTION: f64 = 0.5;
    let exact = libm::atan(FRICTION).to_degrees();
    for more in [-1.0, 4.0] {
        let block =
            Block { cuts: 0, ..Block::new([0.02, 0.02, 0.01], [2, 2, 1], [1e4, 0.3, 2e-3]) };
        let mut table = Tool::new(Shape::HalfSpace);
        table.law.friction = FRICTION;
        table.pose.translation = vec3(0.0, 0.0, -0.95e-3);
        let inputs = Inputs { tools: vec![table], ..Inputs::default() };
        let mut scene = Scene::<f32>::with(&block, &explicit(Elements::Plain, 0.8), 1, inputs);
        scene.state.contact = ContactState::of(&scene.inputs.tools);
        let mut gpu = OnDevice::new(&scene);
        let dt = scene.dt;
        let gravity = |time: f64| {
            let angle = (exact + more).to_radians() * ramp(time + dt, 0.1, 0.3);
            (DOWNHILL * libm::sin(angle) - vec3(0.0, 0.0, libm::cos(angle))) * 9.81
        };
        let [crept, found] = slide(&mut gpu, &mut scene, gravity, [0.6, 0.3]);
        let wanted = downhill(exact + more, FRICTION);
        println!(
            "{more}: {crept:e} m, {found} of {wanted} m/s^2, {} small steps",
            gpu.gpu.passes()
        );
        if more < 0.0 {
            assert!(crept < 1e-6, "{crept:e} m below the angle");
        } else {
            assert!((found / wanted - 1.0).abs() < 0.01, "{found} of {wanted} m/s^2");
        }
    }
}

/// What jaws that shake do to a block: the most energy that it has, what it has more at any time than the jaws have given [J], and
/// rejected steps.
struct Shaken {
    peak: f64,
    gain: f64,
    rejected: u64,
}

/// Steps in a hundredth of a second, in which jaws go from place to place.
const STEPS: u32 = 24;

fn shaken(elements: Elements, shake: f64, speed: f64) -> Shaken {
    // Forces at the ends of longer steps do not say what jaws give that are as fast: by 1/600 s a fifth of the energy is missing.
    let dt = 1.0 / f64::from(100 * STEPS);
    let mut plan = Plan::new(3, false);
    // Nothing damps but what contact loses.
    plan.block.tissue[2] = 0.0;
    let mut inputs = plan.inputs::<f32>();
    plan.act(0.0, &mut inputs.tools);
    let model = plan.block.model::<f32>();
    let contact = ContactState::of(&inputs.tools);
    let mut state = State { contact, ..State::at_rest(&model) };
    let settings = explicit(elements, 0.8);
    let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
    gpu.write(&model, &state).expect("a legal state");
    let outside = Outside::new::<f32>(&plan.block.mesh, GRASPED[0], GRASPED[1], 1060.0);
    let outside = match elements {
        Elements::Recovered => outside.of_recovered(&plan.block.material()),
        _ => outside,
    };
    let mut account = Account::default();
    account.add(&inputs.tools, &[Wrench::default(); 2]);
    let mut random = Random(7);
    let mut places = [[Vec3::ZERO; 2]; 2];
    let mut found = Shaken { peak: 0.0, gain: f64::MIN, rejected: 0 };
    let mut cleared = f64::MAX;
    for step in 1..=(1.7 / speed / dt).round() as u32 {
        let time = f64::from(step) * dt * speed;
        plan.act(time, &mut inputs.tools);
        let share = f64::from(step % STEPS) / f64::from(STEPS);
        for (tool, [from, to]) in inputs.tools.iter_mut().zip(&mut places) {
            if step % STEPS == 0 {
                (*from, *to) = (*to, random.vector(if time < 1.2 { shake } else { 0.0 }));
            }
            tool.pose.translation += *from + (*to - *from) * share;
        }
        gpu.step(&model, &inputs, dt).expect("a legal step");
        gpu.read_frame(&model, &mut state).expect("a device");
        account.add(&inputs.tools, gpu.wrenches());
        let energy = outside.mechanical(&state, dt);
        found.peak = found.peak.max(energy.value);
        found.gain = found.gain.max(energy.value - energy.noise - account.work);
        // The jaws are clear of the tissue, which swings on.
        if time > 1.45 {
            assert!(energy.value <= 1.01 * cleared, "{:e} of {cleared:e} J", energy.value);
            cleared = cleared.min(energy.value);
        }
    }
    found.rejected = gpu.rejected_steps().expect("a device");
    assert!(state.is_finite(), "{elements:?}");
    let mut tets = Vec::new();
    measure_tets(&model, &state.positions, &mut tets);
    assert!(!tets.iter().any(|tet| tet.is_inverted()), "{elements:?}");
    found
}

/// Random places of the jaws up to 3 mm aside: 0.3 m/s.
fn assert_nothing_is_made(elements: Elements, shake: f64, speed: f64) {
    let Shaken { peak, gain, rejected } = shaken(elements, shake, speed);
    println!(
        "{elements:?}, {shake}: {:.1e} of {peak:.1e} J made, {rejected} rejected",
        gain / peak
    );
    assert!(gain < 1e-3 * peak && rejected < 5, "{elements:?}: {gain:e} of {peak:e} J");
}

#[test]
fn jaws_that_shake_make_no_energy_in_explicit_steps() {
    BOTH.into_iter().for_each(|elements| assert_nothing_is_made(elements, 3e-3, 10.0));
}

#[test]
#[ignore = "slow: many speeds"]
fn jaws_that_shake_make_no_energy_in_explicit_steps_at_length() {
    for elements in BOTH {
        for shake in [0.0, 1e-3, 3e-3, 6e-3] {
            assert_nothing_is_made(elements, shake, 4.0);
        }
    }
}

/// Through a scene: a device that is asked for by name, and the explicit method.
#[test]
fn scenes_with_tools_run_by_explicit_steps_on_a_device() {
    let text = crate::gpu_tools::SCENE.replace("[5, 5, 3]", "[3, 3, 2]");
    let text = text.replace("poisson = 0.4", "poisson = 0.4, viscosity = \"2 ms\"");
    let [here, there] = ["cpu", "gpu"].map(|device| {
        let settings = [("solver.method", "explicit"), ("solver.device", device)];
        let scene = viscera::scene::Scene::parse("tools.toml", &text, &settings);
        let scene = scene.unwrap_or_else(|e| panic!("{e}"));
        let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
        let run = Simulation::<f32>::new(scene, assembly.expect("a block"));
        let mut run = run.unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(run.is_on_device(), device == "gpu");
        (0..9).for_each(|_| run.advance_frame().unwrap_or_else(|e| panic!("{e}")));
        run.tool_forces()[0].clone()
    });
    println!("{here} and {there}");
    assert!(here.force[2] > 0.1 && here.force[0].abs() > 0.01, "{here}");
    for (here, there) in here.force.iter().zip(&there.force) {
        assert!((here - there).abs() < 0.01, "{here} and {there} N");
    }
}
