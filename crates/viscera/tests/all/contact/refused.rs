//! Tools that tissue cannot meet, and tools in places where they should not be.

use viscera::contact::{Shape, Tool};
use viscera::model::ModelBuilder;
use viscera::scalar::{Vec3, vec3};
use viscera::settings::SolverSettings;
use viscera::solver::{Inputs, Solver, StepError};
use viscera::state::State;

use super::{Block, METHODS, Scene, ball};

fn block() -> Block {
    Block::new([0.03, 0.03, 0.02], [3, 3, 2], [1e4, 0.4, 0.01])
}

fn answer(tool: Tool) -> Result<(), StepError> {
    let block = block();
    let model = block.model::<f32>();
    let inputs = Inputs { tools: vec![tool], ..Inputs::default() };
    let mut solver = Solver::new(&model, &SolverSettings::default());
    solver.step(&model, &mut State::at_rest(&model), &inputs, 0.01)
}

#[test]
fn tools_that_cannot_be_are_refused_by_name() {
    let changed = |change: &dyn Fn(&mut Tool)| {
        let mut tool = ball(0.01);
        tool.pose.translation = vec3(0.0, 0.0, 0.05);
        change(&mut tool);
        answer(tool)
    };
    assert_eq!(changed(&|_| ()), Ok(()));
    type Change<'a> = &'a dyn Fn(&mut Tool);
    let bad: [(Change<'_>, &str); 7] = [
        (&|tool| tool.law.friction = 10.0, "coefficient of friction"),
        (&|tool| tool.law.friction = f64::NAN, "coefficient of friction"),
        (&|tool| tool.law.thickness = 0.0, "thickness"),
        (&|tool| tool.law.stiffness = -1.0, "stiffness"),
        (&|tool| tool.shape = Shape::Sphere { radius: 0.0 }, "radius"),
        (&|tool| tool.pose.translation.x = f64::NAN, "poses of tools"),
        (&|tool| tool.pose.rotation.columns[0] = vec3(2.0, 0.0, 0.0), "rotation matrix"),
    ];
    for (change, words) in bad {
        let error = changed(change).expect_err(words).to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn tools_need_samples_and_a_rebase() {
    let mut builder = ModelBuilder::new();
    let tissue =
        viscera::material::Material::new(crate::common::SNH, 1e4, 0.4, 1e3).expect("tissue");
    builder.add_body(&block().mesh, &tissue).expect("a body");
    let model = builder.build::<f32>().expect("a model");
    let inputs = Inputs { tools: vec![ball(0.01)], ..Inputs::default() };
    let mut solver = Solver::new(&model, &SolverSettings::default());
    let mut state = State::at_rest(&model);
    assert_eq!(solver.step(&model, &mut state, &inputs, 0.01), Err(StepError::NoSamples));
    builder.sample_surface(0);
    let model = builder.build::<f32>().expect("a model");
    let published = SolverSettings { rebase: false, ..SolverSettings::xpbd() };
    let mut solver = Solver::new(&model, &published);
    let answer = solver.step(&model, &mut state, &inputs, 0.01);
    assert_eq!(answer, Err(StepError::ContactNeedsRebase));
}

/// A tool that is put into the middle of an organ: reported, and the tissue finds its way out.
#[test]
fn a_tool_that_jumps_into_tissue_is_no_motion() {
    for name in METHODS {
        let block = Block::new([0.04, 0.04, 0.03], [6, 6, 4], [1e4, 0.4, 0.01]);
        let mut tool = ball(0.008);
        tool.pose.translation = vec3(0.0, 0.0, 1.03);
        let inputs = Inputs { pins: block.fixed_below(), tools: vec![tool], ..Inputs::default() };
        let mut scene = Scene::<f32>::new(&block, name, inputs);
        scene.run(0.05, |_, _| ());
        assert!(!scene.solver.wrenches()[0].has_jumped);
        scene.run(scene.dt, |_, tools| tools[0].pose.translation.z = 0.03);
        assert!(scene.solver.wrenches()[0].has_jumped, "{name}");
        scene.run(0.5, |_, _| ());
        assert!(!scene.solver.wrenches()[0].has_jumped);
        assert!(scene.state.is_finite(), "{name}");
        let fastest = scene.state.velocities.iter().map(|v| v.length()).fold(0.0, f32::max);
        assert!(fastest < 0.05, "{name}: {fastest} m/s");
        scene.run(0.5, |_, tools| tools[0].pose.translation.z = 0.2);
        assert!(scene.state.contact.touches.is_empty(), "{name}");
    }
}

/// What presses on vertices that are pinned is said.
#[test]
fn a_tool_on_a_pinned_patch_is_reported() {
    let block = block();
    let mut tool = ball(0.01);
    tool.pose.translation = vec3(0.0, 0.0, 0.0303);
    let inputs = Inputs { pins: block.pins(|_| true), tools: vec![tool], ..Inputs::default() };
    let mut scene = Scene::<f64>::new(&block, "quasi_newton", inputs);
    scene.run(0.1, |_, _| ());
    let wrench = scene.solver.wrenches()[0];
    assert!(wrench.touches > 0 && wrench.pinned == wrench.touches, "{wrench:?}");
    assert!(wrench.force.z > 0.0);
    let moved = scene.state.positions.iter().zip(&scene.model.rest_positions);
    assert!(moved.map(|(a, b): (&Vec3<f64>, _)| (*a - *b).length()).all(|way| way == 0.0));
}

/// Two obstacles that leave the tissue no room: finite, and no energy out of nothing.
#[test]
fn two_obstacles_driven_into_each_other_leave_numbers() {
    for name in METHODS {
        let block = block();
        let inputs = Inputs { tools: vec![ball(0.05), ball(0.05)], ..Inputs::default() };
        let mut scene = Scene::<f32>::new(&block, name, inputs);
        scene.run(0.5, |time, tools| {
            let gap = 0.012 - 0.012 * (time / 0.5);
            tools[0].pose.translation = vec3(0.0, 0.0, 0.06 + gap);
            tools[1].pose.translation = vec3(0.0, 0.0, -0.04 - gap);
        });
        assert!(scene.state.is_finite(), "{name}");
    }
}
