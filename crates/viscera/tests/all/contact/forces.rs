//! Forces of tools at rest.

use viscera::contact::Tool;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::solver::Inputs;
use viscera::solver::balance::ForceBalance;

use super::{Block, METHODS, Scene, ball, ramp};

/// A ball of 15 mm pressed 5 mm into a block, at rest after a second.
fn pressed<S: Real>(name: &str, cells: [usize; 3], young: f64) -> Scene<S> {
    let block = Block::new([0.06, 0.06, 0.03], cells, [young, 0.45, 0.01]);
    let inputs =
        Inputs { pins: block.fixed_below(), tools: vec![ball(0.015)], ..Inputs::default() };
    let mut scene = Scene::<S>::new(&block, name, inputs);
    let press = |time: f64, tools: &mut [Tool]| {
        let depth = 0.005 * ramp(time, 0.0, 0.1);
        tools[0].pose.translation = vec3(0.0, 0.0, 0.046 - depth);
    };
    scene.run(1.2, press);
    scene
}

const COARSE: [usize; 3] = [8, 8, 4];

fn share(a: f64, b: f64) -> f64 {
    (a / b - 1.0).abs()
}

#[test]
fn the_force_does_not_depend_on_the_method() {
    for young in [1e4, 1e5] {
        let forces = METHODS.map(|name| {
            if name == "explicit" && young > 1e4 {
                return 0.0;
            }
            pressed::<f32>(name, COARSE, young).force(0).z
        });
        let [xpbd, quasi_newton, explicit] = forces;
        assert!(quasi_newton > 0.1);
        assert!(share(xpbd, quasi_newton) < 2e-3, "{forces:?}");
        assert!(explicit == 0.0 || share(explicit, quasi_newton) < 2e-3, "{forces:?}");
    }
}

#[test]
fn single_precision_finds_the_same_force() {
    let double = pressed::<f64>("quasi_newton", COARSE, 1e4);
    let single = pressed::<f32>("quasi_newton", COARSE, 1e4);
    assert!(share(double.force(0).z, single.force(0).z) < 1e-3);
}

/// What holds the block below feels what presses on it above.
#[test]
fn forces_of_tools_and_fixings_balance() {
    for name in METHODS {
        let mut scene = pressed::<f64>(name, [6, 6, 3], 1e4);
        let mut balance = ForceBalance::default();
        let Scene { model, state, solver, inputs, .. } = &mut scene;
        solver.force_balance(model, state, inputs, &mut balance).expect("a balance");
        let held = inputs
            .pins
            .iter()
            .fold(Vec3::ZERO, |sum: Vec3<f64>, pin| sum + balance.residual[pin.vertex as usize]);
        let force = scene.force(0);
        // On the tissue the ball presses down, and the fixing up.
        let apart = (held - force).length();
        assert!(apart < 1e-5 * force.z, "{name}: {held:?} and {force:?}");
        assert!(balance.relative_residual() < 1e-4, "{name}: {}", balance.relative_residual());
    }
}

/// A ball that is pressed beside the middle of its own frame: the torque is that of the force about it.
#[test]
fn the_torque_is_about_the_tools_origin() {
    let block = Block::new([0.04, 0.04, 0.02], [4, 4, 2], [1e4, 0.4, 0.01]);
    let mut tool = Tool::new(viscera::contact::Shape::Capsule { length: 0.1, radius: 0.01 });
    tool.law.friction = 0.0;
    tool.pose.translation = vec3(0.0, 0.0, 0.0285);
    let run = |tool: Tool| {
        let inputs = Inputs { pins: block.fixed_below(), tools: vec![tool], ..Inputs::default() };
        let mut scene = Scene::<f64>::new(&block, "quasi_newton", inputs);
        scene.run(1.0, |_, _| ());
        scene.solver.wrenches()[0]
    };
    let above = run(tool.clone());
    assert!(above.force.z > 0.01 && above.torque.length() < 1e-6 * above.force.z);
    // Turned about the middle of its tip it touches at the same place, and its origin is still there.
    let turn = vec3(0.3, 0.0, 0.0);
    let turned = viscera::scalar::rigid::rotation_matrix(turn);
    tool.pose.rotation = turned;
    let tilted = run(tool);
    assert!((tilted.force - above.force).length() < 1e-6 * above.force.z);
    // A sphere of which the middle is 30 mm beside the origin: the arm is 30 mm long.
    let mut arm = Tool::new(viscera::contact::Shape::Capsule { length: 0.03, radius: 0.01 });
    arm.law.friction = 0.0;
    arm.pose = viscera::scalar::rigid::RigidTransform::about(
        Vec3::ZERO,
        vec3(0.0, 0.5 * std::f64::consts::PI, 0.0),
        vec3(-0.045, 0.0, 0.0285),
    );
    let beside = run(arm);
    let expected = |x: f64| -(x + 0.045) * beside.force.z;
    assert!(beside.torque.y < expected(-0.021) && beside.torque.y > expected(-0.014), "{beside:?}");
}

/// Resting contact does not move, however little is done in a frame.
#[test]
fn resting_contact_stays_with_one_sweep_per_frame() {
    let block = Block::new([0.06, 0.06, 0.03], [6, 6, 3], [1e4, 0.45, 0.01]);
    let inputs =
        Inputs { pins: block.fixed_below(), tools: vec![ball(0.015)], ..Inputs::default() };
    let mut scene = Scene::<f64>::new(&block, "xpbd", inputs);
    let press = |time: f64, tools: &mut [Tool]| {
        tools[0].pose.translation = vec3(0.0, 0.0, 0.046 - 0.004 * ramp(time, 0.0, 0.1));
    };
    scene.run(3.0, press);
    let before = scene.state.positions.clone();
    scene.solver.set_iterations(1);
    scene.dt = 1.0 / 60.0;
    scene.steps = 1000;
    scene.run(1.0, press);
    let moved = scene.state.positions.iter().zip(&before).map(|(a, b)| (*a - *b).length());
    let moved = moved.fold(0.0, f64::max);
    assert!(moved < 1e-5 * 4e-3, "{moved:e} m");
}

/// A body that lies on a table weighs on it what it weighs.
#[test]
fn a_table_bears_the_weight() {
    let block = Block::new([0.02, 0.02, 0.01], [4, 4, 2], [2e4, 0.3, 0.01]);
    for name in METHODS {
        let mut table = Tool::new(viscera::contact::Shape::HalfSpace);
        table.pose.translation = vec3(0.0, 0.0, -0.95e-3);
        let gravity = vec3(0.0, 0.0, -9.81);
        let inputs = Inputs { gravity, tools: vec![table], ..Inputs::default() };
        let mut scene = Scene::<f64>::new(&block, name, inputs);
        scene.run(1.5, |_, _| ());
        let weight = 9.81 * scene.model.masses.iter().sum::<f64>();
        let force = scene.force(0);
        assert!(share(-force.z, weight) < 1e-3, "{name}: {force:?} N of {weight} N");
        assert!(force.x.hypot(force.y) < 1e-6 * weight, "{name}: {force:?}");
    }
}

/// The same bits for any number of threads, with AVX2 and without, and from a state that was kept.
#[test]
fn contact_has_the_same_bits_for_threads_and_instructions() {
    use viscera::scalar::lanes::Instructions;
    let block = Block::new([0.06, 0.06, 0.03], [8, 8, 4], [1e4, 0.45, 0.01]);
    for name in METHODS {
        let run = |threads: u32, instructions: Instructions| {
            let mut tool = ball(0.012);
            tool.law.friction = 0.4;
            let inputs =
                Inputs { pins: block.fixed_below(), tools: vec![tool], ..Inputs::default() };
            let (mut settings, substeps) = super::method(name);
            settings.threads = viscera::settings::Threads::Count(threads);
            let mut scene = Scene::<f32>::with(&block, &settings, substeps, inputs);
            scene.solver.use_instructions(instructions);
            scene.run(0.2, |time, tools| {
                let aside = 0.01 * ramp(time, 0.05, 0.2);
                tools[0].pose.translation = vec3(aside, 0.0, 0.043 - 0.004 * ramp(time, 0.0, 0.05));
            });
            (scene.state, scene.solver.wrenches().to_vec())
        };
        let one = run(1, Instructions::Portable);
        assert!(one.1[0].touches > 10, "{name}");
        assert_eq!(one, run(2, Instructions::detect()), "{name}");
        assert_eq!(one, run(1, Instructions::detect()), "{name}");
    }
}
