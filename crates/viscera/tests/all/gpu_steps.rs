//! Several steps in one submission to a graphics processor: each has inputs of its own.

use crate::common::device::{device, everything, handled};
use crate::contact::on_device::{act, scene, settings};
use viscera::scalar::vec3;
use viscera::scene::Scene;
use viscera::settings::{Count, Elements, Integrator, Method, SolverSettings};
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::Inputs;
use viscera::solver::gpu::GpuSolver;
use viscera::state::{ContactState, State};

const FRAME: f64 = 1.0 / 60.0;
const SUBSTEPS: u32 = 4;
const FRAMES: u32 = 5;

fn read(gpu: &GpuSolver, model: &viscera::model::Model<f32>) -> State<f32> {
    let mut state = State::at_rest(model);
    gpu.read(model, &mut state).expect("a device");
    state
}

/// Frames of several steps, and the same steps one by one: the same bits. Returns the submissions of each frame.
fn compare(settings: &SolverSettings, at: impl Fn(u32) -> Inputs<f32>) -> Vec<u64> {
    let model = everything::<f32>();
    let [mut one, mut all] =
        [(); 2].map(|()| GpuSolver::new(device(), &model, settings).expect("a model"));
    let dt = FRAME / f64::from(SUBSTEPS);
    let mut sent = Vec::new();
    for first in (0..FRAMES).map(|frame| frame * SUBSTEPS) {
        for step in first..first + SUBSTEPS {
            one.step(&model, &at(step), dt).expect("a legal step");
        }
        let before = all.submissions();
        let lead = |number: u32, inputs: &mut Inputs<f32>| *inputs = at(first + number - 1);
        all.steps(&model, &mut Inputs::default(), dt, SUBSTEPS, lead).expect("legal steps");
        sent.push(all.submissions() - before);
    }
    let method = settings.method;
    let [one_by_one, at_once] = [&one, &all].map(|gpu| read(gpu, &model));
    assert!(one_by_one.positions != model.rest_positions, "{method:?}: nothing moves");
    assert!(one_by_one.positions == at_once.positions, "{method:?}: positions");
    assert!(one_by_one.velocities == at_once.velocities, "{method:?}: velocities");
    assert!(one_by_one.multipliers == at_once.multipliers, "{method:?}: multipliers");
    assert!(one.submissions() >= u64::from(FRAMES * SUBSTEPS));
    println!("{method:?}: {sent:?} submissions");
    sent
}

/// Pins that move, loads, springs and anchors: what a submission may not mix up.
#[test]
fn steps_of_a_frame_have_the_bits_of_steps_one_by_one() {
    let wide = everything::<f64>();
    for method in [Method::Xpbd, Method::QuasiNewton, Method::Explicit] {
        let settings = SolverSettings { method, ..SolverSettings::xpbd() };
        let sent = compare(&settings, |step| handled(&wide, step, vec3(0.0, 5e-4, 8e-4)));
        // The first frame may find no room for its inputs.
        assert_eq!(sent[1..], [1; FRAMES as usize - 1], "{method:?}: {sent:?}");
    }
}

/// Loads on every vertex take more memory than there is at first: each frame that finds too little doubles it.
#[test]
fn room_for_inputs_grows() {
    let settings = SolverSettings { method: Method::QuasiNewton, ..SolverSettings::xpbd() };
    let model = everything::<f32>();
    let count = model.vertex_count() as u32;
    let sent = compare(&settings, |step| Inputs {
        forces: (0..count).map(|v| (v, vec3(1e-4 * step as f32, 0.0, -1e-4))).collect(),
        ..Inputs::default()
    });
    assert!(sent[0] > 1, "{count} vertices find room at once: {sent:?}");
    assert_eq!(sent[2..], [1; FRAMES as usize - 2], "{sent:?}");
}

/// A thousand dispatches at most: four solves of twice forty passes are two submissions.
#[test]
fn long_frames_are_several_submissions() {
    let method = Method::QuasiNewton;
    let iterations = Count::Of(40);
    let settings = SolverSettings { method, iterations, ..SolverSettings::xpbd() };
    let wide = everything::<f64>();
    let sent = compare(&settings, |step| handled(&wide, step, vec3(0.0, 5e-4, 8e-4)));
    assert!(sent[1..].iter().all(|&count| (2..=SUBSTEPS.into()).contains(&count)), "{sent:?}");
}

/// Tools move within the frame.
#[test]
fn tools_are_where_each_step_has_them() {
    let settings = settings((Integrator::Sdirk2, Elements::Plain));
    let here = scene::<f32>(&settings);
    let mut tools = here.inputs.tools.clone();
    let dt = 0.1 / f64::from(FRAMES * SUBSTEPS);
    let [mut one, mut all] = [(); 2].map(|()| {
        let mut gpu = GpuSolver::new(device(), &here.model, &settings).expect("a model that fits");
        let contact = ContactState::of(&tools);
        let start = State { contact, ..State::at_rest(&here.model) };
        gpu.write(&here.model, &start).expect("a legal state");
        gpu
    });
    for frame in 0..FRAMES {
        let first = frame * SUBSTEPS;
        let mut inputs = here.inputs.clone();
        for step in first + 1..=first + SUBSTEPS {
            act(f64::from(step) * dt, &mut tools);
            inputs.tools.clone_from(&tools);
            one.step(&here.model, &inputs, dt).expect("a legal step");
        }
        let lead = |number: u32, inputs: &mut Inputs<f32>| {
            act(f64::from(first + number) * dt, &mut inputs.tools);
        };
        all.steps(&here.model, &mut inputs, dt, SUBSTEPS, lead).expect("legal steps");
    }
    let [mut first, mut second] = [State::at_rest(&here.model), State::at_rest(&here.model)];
    one.read_frame(&here.model, &mut first).expect("a device");
    all.read_frame(&here.model, &mut second).expect("a device");
    assert!(one.wrenches()[0].force.length() > 0.01, "{:?}", one.wrenches());
    assert!(first.positions == second.positions && first.velocities == second.velocities);
    assert!(one.wrenches() == all.wrenches(), "{:?}, {:?}", one.wrenches(), all.wrenches());
}

/// A step that fails ends the frame behind the steps before it.
#[test]
fn a_frame_ends_where_a_step_fails() {
    let settings = SolverSettings { method: Method::QuasiNewton, ..SolverSettings::xpbd() };
    let model = everything::<f32>();
    let [mut one, mut all] =
        [(); 2].map(|()| GpuSolver::new(device(), &model, &settings).expect("a model"));
    let good = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
    let bad = Inputs { gravity: vec3(f32::NAN, 0.0, 0.0), ..Inputs::default() };
    (0..2).for_each(|_| one.step(&model, &good, FRAME).expect("a legal step"));
    let lead = |number: u32, inputs: &mut Inputs<f32>| {
        *inputs = if number == 3 { bad.clone() } else { good.clone() };
    };
    let failed = all.steps(&model, &mut Inputs::default(), FRAME, SUBSTEPS, lead);
    assert!(failed.is_err());
    let [one_by_one, at_once] = [&one, &all].map(|gpu| read(gpu, &model));
    assert!(one_by_one.positions == at_once.positions);
    // And it goes on from there.
    one.step(&model, &good, FRAME).expect("a legal step");
    all.step(&model, &good, FRAME).expect("a legal step");
    assert!(read(&one, &model).positions == read(&all, &model).positions);
}

#[test]
fn a_frame_of_a_scene_is_one_submission() {
    let text = r#"
        solver = { method = "quasi_newton", substeps = 4 }
        [[body]]
        name = "bar"
        shape = "block"
        size = ["40 mm", "10 mm", "10 mm"]
        cells = [8, 2, 2]
        material = { young = "10 kPa", poisson = 0.4 }
        [[fixing]]
        name = "wall"
        body = "bar"
        half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
    "#;
    let scene = Scene::parse("bar.toml", text, &[]).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    let assembly = assembly.unwrap_or_else(|e| panic!("{e}"));
    let mut run =
        Simulation::<f32>::on_device(scene, assembly, device()).unwrap_or_else(|e| panic!("{e}"));
    let mut sent = || {
        run.advance_frame().unwrap_or_else(|e| panic!("{e}"));
        run.gpu().expect("a device").submissions()
    };
    let first = sent();
    assert_eq!([sent(), sent(), sent()], [first + 1, first + 2, first + 3]);
}
