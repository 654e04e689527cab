//! Several steps in one submission to a graphics processor: each has inputs of its own.

use crate::common::device::{device, everything, handled};
use crate::contact::on_device::{act, scene, settings};
use viscera::scalar::vec3;
use viscera::scene::Scene;
use viscera::settings::{Elements, Integrator, Method, SolverSettings};
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

/// Pins that move, loads, springs and anchors; by what a submission may not mix up.
#[test]
fn steps_of_a_frame_have_the_bits_of_steps_one_by_one() {
    let methods = [Method::Xpbd, Method::QuasiNewton, Method::Explicit];
    for method in methods {
        let settings = SolverSettings { method, ..SolverSettings::xpbd() };
        let (model, wide) = (everything::<f32>(), everything::<f64>());
        let [mut one, mut all] =
            [(); 2].map(|()| GpuSolver::new(device(), &model, &settings).expect("a model"));
        let at = |step| handled::<f32>(&wide, step, vec3(0.0, 5e-4, 8e-4));
        let dt = FRAME / f64::from(SUBSTEPS);
        let mut sent = Vec::new();
        for frame in 0..FRAMES {
            let first = frame * SUBSTEPS;
            (first..first + SUBSTEPS)
                .for_each(|step| one.step(&model, &at(step), dt).expect("a legal step"));
            let before = all.submissions();
            let lead = |number: u32, inputs: &mut Inputs<f32>| *inputs = at(first + number - 1);
            all.steps(&model, &mut Inputs::default(), dt, SUBSTEPS, lead).expect("legal steps");
            sent.push(all.submissions() - before);
        }
        let [one_by_one, at_once] = [&one, &all].map(|gpu| read(gpu, &model));
        assert!(one_by_one.positions != model.rest_positions, "{method:?}: nothing moves");
        assert!(one_by_one.positions == at_once.positions, "{method:?}: positions");
        assert!(one_by_one.velocities == at_once.velocities, "{method:?}: velocities");
        assert!(one_by_one.multipliers == at_once.multipliers, "{method:?}: multipliers");
        // Where inputs find no room the first frame is several, and makes more.
        let most = SUBSTEPS as usize * all.dispatches()[1] * all.passes() as usize / 1024 + 1;
        println!("{method:?}: {sent:?} submissions of at least {most}");
        assert!(sent[1..].iter().all(|&count| count <= most as u64), "{method:?}: {sent:?}");
        assert!(one.submissions() >= u64::from(FRAMES * SUBSTEPS));
    }
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
