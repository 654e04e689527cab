//! Contact with tools on a graphics processor, by sweeps: XPBD with all that accelerates and guards it.

use super::motion::tilted;
use super::on_device::{OnDevice, act, advance, downhill, off, scene, slide};
use super::{Block, Scene, method};
use crate::common::Random;
use crate::common::device::{device, largest};
use crate::common::potential::Outside;
use viscera::contact::{Shape, Tool, Wrench};
use viscera::scalar::rigid::axis_times_sine;
use viscera::scalar::vec3;
use viscera::settings::{Acceleration, Clusters, Colors, Count, SolverSettings};
use viscera::solver::gpu::GpuSolver;
use viscera::solver::{Inputs, StepError};
use viscera::state::{ContactState, State};

/// Five sweeps a step, in every way that has kernels of its own.
fn variants() -> [(&'static str, SolverSettings); 5] {
    let plain = method("xpbd").0;
    let jacobi = SolverSettings { colors: Colors::Limited(1), ..plain.clone() };
    let with = |acceleration| SolverSettings { acceleration, ..jacobi.clone() };
    [
        ("colors", plain.clone()),
        ("clusters", SolverSettings { clusters: Clusters::OfTets(128), ..plain.clone() }),
        ("copies", SolverSettings { colors: Colors::Limited(4), ..plain }),
        ("Anderson", with(Acceleration::Anderson)),
        ("Chebyshev", with(Acceleration::Chebyshev)),
    ]
}

/// In single precision what a scene in double precision has come to.
fn single(truth: &Scene<f64>, here: &mut Scene<f32>) {
    let State { positions, velocities, multipliers, multiplier_dt, contact, .. } = &truth.state;
    here.state.positions = positions.iter().map(|x| x.cast()).collect();
    here.state.velocities = velocities.iter().map(|v| v.cast()).collect();
    here.state.multipliers = multipliers.iter().map(|&l| l as f32).collect();
    here.state.multiplier_dt = *multiplier_dt;
    here.state.contact = contact.clone();
    here.inputs.tools.clone_from(&truth.inputs.tools);
    here.steps = truth.steps;
}

/// Presses, turns and drags: forces and places are those of the same sweeps in double precision, wherever a step begins, and
/// what is touched is the same but where a sample is as near as rounding is.
#[test]
fn sweeps_end_where_the_processors_do() {
    for (name, settings) in variants() {
        let mut truth = scene::<f64>(&settings);
        let mut here = scene::<f32>(&settings);
        let mut gpu = OnDevice::new(&here);
        let mut worst = [0.0_f64; 2];
        for step in 0..10 {
            single(&truth, &mut here);
            gpu.gpu.write(&here.model, &here.state).expect("a legal state");
            let before = truth.state.positions.clone();
            let expected = advance(&mut truth);
            let on_cpu = advance(&mut here);
            let found = gpu.step(&here);
            let x = &truth.state.positions;
            let moved = largest(&before, x).max(1e-4);
            let places =
                [&gpu.state, &here.state].map(|state| largest(&state.positions, x) / moved);
            let forces = [&found, &on_cpu].map(|found| off(found, &expected));
            // Where the processor ends in single precision elsewhere, because rounding decides which steps are rejected.
            for ([found, single], worst) in [places, forces].into_iter().zip(&mut worst) {
                assert!(found < 2.0 * single + 1e-4, "{name} {step}: {found:e}, {single:e}");
                *worst = worst.max(if single < 1e-3 { found } else { 0.0 });
            }
            for (found, expected) in found.iter().zip(&expected) {
                assert!(found.touches.abs_diff(expected.touches) <= 2, "{found:?}, {expected:?}");
                assert_eq!((found.left_out, found.has_jumped), (0, false));
            }
        }
        let rejected = gpu.gpu.rejected_steps().expect("a device");
        println!("{name}: places {:.1e}, forces {:.1e}, {rejected} rejected", worst[0], worst[1]);
    }
}

/// From the same beginning, to the same end: after all has settled forces are those of double precision.
#[test]
fn settled_forces_of_sweeps_are_the_processors() {
    let (_, clusters) = &variants()[1];
    let settings = SolverSettings { iterations: Count::Of(10), ..clusters.clone() };
    // Where friction holds there is more than one place of rest, and which it is depends on the steps that were rejected on the way.
    for (friction, most) in [(0.0, 1e-4), (0.5, 5e-4)] {
        let mut truth = scene::<f64>(&settings);
        let mut here = scene::<f32>(&settings);
        for tools in [&mut truth.inputs.tools, &mut here.inputs.tools] {
            tools.iter_mut().for_each(|tool| tool.law.friction = friction);
        }
        let mut gpu = OnDevice::new(&here);
        let [mut places, mut forces] = [f64::NAN; 2];
        for _ in 0..35 {
            let expected = advance(&mut truth);
            here.steps += 1;
            act(f64::from(here.steps) * here.dt, &mut here.inputs.tools);
            let found = gpu.step(&here);
            places = largest(&gpu.state.positions, &truth.state.positions);
            forces = off(&found, &expected);
        }
        let residual = gpu.residual(&here);
        println!("mu {friction}: {places:.1e} m, forces {forces:.1e}, residual {residual:.1e}");
        assert!(forces < most && places < 0.2 * most, "{friction}: {forces:e}, {places:e} m");
        assert!(residual < 1e-3, "{residual:e}");
    }
}

/// Two runs have the same bits, whatever memory held before.
#[test]
fn contact_of_sweeps_has_the_same_bits() {
    let [.., (_, settings), _] = variants();
    let run = |left_over: Option<f32>| {
        let mut here = scene::<f32>(&settings);
        let settings = here.solver.settings();
        let gpu = match left_over {
            None => GpuSolver::new(device(), &here.model, settings),
            Some(value) => GpuSolver::on_used_memory(device(), &here.model, settings, value),
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

/// Without a rebase there is no contact, here as on the processor: nothing moves.
#[test]
fn sweeps_without_a_rebase_refuse_tools() {
    let settings = SolverSettings { rebase: false, ..method("xpbd").0 };
    let here = scene::<f32>(&settings);
    let mut gpu = OnDevice::new(&here);
    let answer = gpu.gpu.step(&here.model, &here.inputs, here.dt);
    assert_eq!(answer, Err(StepError::ContactNeedsRebase));
}

/// A block on a slope: it holds below the angle of friction, and slides as fast as it should above.
#[test]
fn a_block_slides_as_fast_as_it_should_by_sweeps() {
    const FRICTION: f64 = 0.5;
    let exact = libm::atan(FRICTION).to_degrees();
    let clusters = Clusters::OfTets(2048);
    let usual = SolverSettings { iterations: Count::Of(10), clusters, ..method("xpbd").0 };
    for more in [-0.3, 3.0] {
        let (mut scene, gravity) = tilted::<f32>(&usual, 4, 2.0, FRICTION, exact + more);
        scene.state.contact = ContactState::of(&scene.inputs.tools);
        let mut gpu = OnDevice::new(&scene);
        let [crept, found] = slide(&mut gpu, &mut scene, gravity, [0.75, 0.1]);
        let wanted = downhill(exact + more, FRICTION);
        println!("{more}: {crept:e} m, {found} of {wanted} m/s^2");
        if more < 0.0 {
            assert!(crept < 2e-6, "{crept:e} m below the angle");
        } else {
            assert!((found / wanted - 1.0).abs() < 0.02, "{found} of {wanted} m/s^2");
        }
    }
}

/// A ball that is struck against a block, here and there, faster than sweeps can follow; and the block.
fn struck(settings: &SolverSettings) -> (Block, Scene<f32>, Scene<f64>) {
    let block = Block::new([0.03, 0.03, 0.015], [4, 4, 2], [1e4, 0.45, 0.0]);
    let mut ball = Tool::new(Shape::Sphere { radius: 0.008 });
    (ball.law.friction, ball.law.stiffness) = (0.5, 50.0);
    ball.pose.translation = vec3(0.0, 0.0, 0.026);
    let tools = vec![ball];
    let inputs = Inputs { pins: block.fixed_below(), tools: tools.clone(), ..Inputs::default() };
    let mut here = Scene::<f32>::with(&block, settings, 1, inputs);
    let inputs = Inputs { pins: block.fixed_below(), tools, ..Inputs::default() };
    let mut truth = Scene::<f64>::with(&block, settings, 1, inputs);
    here.state.contact = ContactState::of(&here.inputs.tools);
    truth.state.contact = ContactState::of(&truth.inputs.tools);
    (block, here, truth)
}

/// Where the guard takes a step back, and where the limit slows it, both are the processor's: contact is part of what they
/// judge by.
#[test]
fn steps_that_are_rejected_end_where_the_processors_do() {
    let all = variants();
    // By the device, and by the processor.
    let (mut rejected, mut slowed, mut descended) = ([0; 2], [0; 2], 0);
    let few = SolverSettings { iterations: Count::Of(2), ..all[1].1.clone() };
    for (name, settings, stiffness, aside, [low, high], steps) in [
        ("clusters", &all[1].1, 50.0, 0.008, [-0.007, 0.004], 30),
        ("Chebyshev", &all[4].1, 50.0, 0.008, [-0.007, 0.004], 30),
        ("gently", &few, 10.0, 0.002, [0.001, 0.005], 60),
    ] {
        let (_, mut here, mut truth) = struck(settings);
        truth.inputs.tools[0].law.stiffness = stiffness;
        let mut gpu = OnDevice::new(&here);
        let mut random = Random(7);
        let mut others = 0;
        for step in 0..steps {
            single(&truth, &mut here);
            gpu.gpu.write(&here.model, &here.state).expect("a legal state");
            let aside = random.vector(aside);
            let place = vec3(aside.x, aside.y, 0.0195 + random.uniform(low, high));
            for tools in [&mut truth.inputs.tools, &mut here.inputs.tools] {
                tools[0].pose.translation = place;
            }
            let before = truth.state.positions.clone();
            strike(&mut truth);
            gpu.step(&here);
            let [there] = gpu.gpu.part_reports().expect("a device")[..] else { panic!("one part") };
            let [expected] = truth.solver.part_reports()[..] else { panic!("one part") };
            let searches = gpu.gpu.last_searches().expect("a device");
            let x = &truth.state.positions;
            let places = largest(&gpu.state.positions, x) / largest(&before, x).max(1e-4);
            let [fallen, wanted] = [&there, &expected].map(|end| end.limit - end.potential);
            for (k, end) in [there, expected].iter().enumerate() {
                rejected[k] += u32::from(end.rejected);
                slowed[k] += u32::from(end.kept_speed < 0.99);
            }
            descended += u32::from(there.rejected && searches[0][1] > 0.0);
            let slower = (there.kept_speed - expected.kept_speed).abs();
            let is_same = (fallen - wanted).abs() < 1e-3 * wanted + 1e-9 && slower < 1e-2;
            if !is_same || places > 1e-3 {
                println!("{name} {step}: {places:e}, {there:?}, {expected:?}");
                others += 1;
            }
        }
        // The first blow: what sweeps make of crushed tissue rounding decides, on the processor as well.
        assert!(others <= 1, "{name}: {others} steps end elsewhere");
    }
    println!("{rejected:?} rejected, {descended} descended, {slowed:?} slowed");
    assert!(rejected[0] > 2 && descended > 0 && slowed[0] > 0);
    assert_eq!((rejected[0], slowed[0]), (rejected[1], slowed[1]));
}

fn strike(scene: &mut Scene<f64>) {
    let Scene { model, state, solver, inputs, dt, steps } = scene;
    solver.step(model, state, inputs, *dt).expect("a step");
    *steps += 1;
}

/// Work [J] of a tool in a step, by the larger of the force at its end and the mean of both.
fn work([before, after]: [&(Tool, Wrench); 2]) -> f64 {
    let way = after.0.pose.translation - before.0.pose.translation;
    let about = axis_times_sine(&(after.0.pose.rotation * before.0.pose.rotation.transpose()));
    let of = |wrench: &Wrench| -(wrench.force.dot(way) + wrench.torque.dot(about));
    let [first, last] = [of(&before.1), of(&after.1)];
    last.max(0.5 * (first + last))
}

/// However a tool is thrown about, tissue has no more energy than the tool has given.
#[test]
fn violent_tools_give_what_tissue_gains() {
    let all = variants();
    for (name, settings) in [&all[1], &all[3]] {
        let (block, mut here, _) = struck(settings);
        let [young, poisson, _] = block.tissue;
        let outside = Outside::new::<f32>(&block.mesh, young, poisson, 1060.0);
        let mut gpu = OnDevice::new(&here);
        let mut random = Random(3);
        let mut last = (here.inputs.tools[0].clone(), Wrench::default());
        let (mut given, mut peak, mut gain) = (0.0, 0.0_f64, 0.0_f64);
        let mut before = None;
        for step in 0..45 {
            let aside = random.vector(0.008);
            let up = if step < 35 { random.uniform(-0.005, 0.004) } else { 0.02 };
            let tool = &mut here.inputs.tools[0];
            tool.pose.translation = vec3(aside.x, aside.y, 0.0195 + up);
            tool.pose.rotation = random.rotation();
            let tool = tool.clone();
            let wrench = gpu.step(&here)[0];
            assert!(!wrench.has_jumped && gpu.state.is_finite());
            let now = (tool, wrench);
            given += work([&last, &now]);
            let energy = outside.mechanical(&gpu.state, here.dt);
            let is_free = last.1.touches == 0 && wrench.touches == 0;
            let is_more = before.is_some_and(|before| is_free && energy.is_above(before));
            assert!(!is_more, "{name} {step}: {energy:?} after {before:?}");
            (last, before) = (now, Some(energy));
            peak = peak.max(energy.value);
            gain = gain.max(energy.value - energy.noise - given);
        }
        let rejected = gpu.gpu.rejected_steps().expect("a device");
        println!("{name}: gain {:.1e} of {peak:.1e} J, {rejected} rejected", gain / peak);
        assert!(peak > 1e-4 && gain < 1e-3 * peak, "{name}: {gain:e} of {peak:e} J");
    }
}
