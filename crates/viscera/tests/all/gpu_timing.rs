//! Steps that are timed are the steps that are not, and what is told of them fits together. Times
//! themselves are not judged. Needs a graphics adapter, for which a software driver does.

use crate::common::device::device;
use crate::common::{STVK, block, material};
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::vec3;
use viscera::settings::{Acceleration, Colors, Count, Method, SolverSettings};
use viscera::solver::Inputs;
use viscera::solver::gpu::{GpuSolver, MemoryCopy, StepPart, Traffic};
use viscera::state::State;

const DT: f64 = 1.0 / 600.0;

fn bar() -> Model<f32> {
    let mut builder = ModelBuilder::new();
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    builder.add_body(&mesh, &material(STVK, 2e4, 0.3)).expect("a body");
    builder.build().expect("a model")
}

/// The whole state, bit by bit.
fn bits(gpu: &GpuSolver, model: &Model<f32>) -> Vec<u32> {
    let mut state = State::at_rest(model);
    gpu.read(model, &mut state).expect("a device");
    let vectors = state.positions.iter().chain(&state.velocities).flat_map(|v| v.to_array());
    vectors.chain(state.multipliers).map(f32::to_bits).collect()
}

/// Three ways to make four steps, the guarded default, Anderson with one colour and an explicit method
/// with more small steps than one submission takes.
#[test]
fn timed_steps_are_ordinary_steps() {
    let device = device();
    let anderson = SolverSettings {
        colors: Colors::Limited(1),
        acceleration: Acceleration::Anderson,
        iterations: Count::Of(5),
        ..SolverSettings::xpbd()
    };
    let explicit = SolverSettings { method: Method::Explicit, ..SolverSettings::xpbd() };
    let one = SolverSettings { iterations: Count::Of(1), ..SolverSettings::xpbd() };
    for (settings, dt) in [(SolverSettings::xpbd(), DT), (anderson, DT), (one, DT), (explicit, 0.2)]
    {
        let model = bar();
        let inputs = Inputs { gravity: vec3(0.3, 0.0, -9.81), ..Inputs::default() };
        let make = || GpuSolver::new(device, &model, &settings).expect("a model that fits");
        let [mut plain, mut together, mut apart] = [make(), make(), make()];
        for _ in 0..4 {
            plain.step(&model, &inputs, dt).expect("a legal step");
        }
        let expected = bits(&plain, &model);
        let whole = together.time_steps(&model, &inputs, dt, 4).expect("a device");
        assert_eq!(bits(&together, &model), expected);
        assert_eq!(whole.is_some(), device.has_clock());

        let dispatches = apart.dispatches();
        for _ in 0..4 {
            let times = apart.time_step(&model, &inputs, dt).expect("a device");
            assert_eq!(times.is_some(), device.has_clock());
            let Some(times) = times else { continue };
            for (part, expected) in
                [StepPart::Prologue, StepPart::Iteration, StepPart::Epilogue].iter().zip(dispatches)
            {
                let of_part = times.stages.iter().filter(|stage| stage.part == *part);
                assert_eq!(of_part.map(|stage| stage.dispatches).sum::<usize>(), expected);
            }
            let sum = times.stages.iter().map(|stage| stage.seconds).sum::<f64>();
            let all = sum + times.later_seconds;
            // Passes follow one another; what lies between them counts in the whole alone.
            assert!(all > 0.0 && all <= times.seconds * (1.0 + 1e-9), "{times:?}");
            assert!(times.stages.iter().all(|stage| stage.seconds >= 0.0), "{times:?}");
            assert_eq!(times.later_seconds > 0.0, times.later_iterations > 0, "{times:?}");
        }
        assert_eq!(bits(&apart, &model), expected);
    }
}

#[test]
fn no_steps_take_no_time() {
    let settings = SolverSettings::xpbd();
    let model = bar();
    let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
    let before = bits(&gpu, &model);
    assert_eq!(gpu.time_steps(&model, &Inputs::default(), DT, 0).expect("a device"), None);
    assert_eq!(bits(&gpu, &model), before);
    assert!(gpu.time_step(&model, &Inputs::default(), -1.0).is_err(), "no such step");
}

/// WebGPU's least is bound whole: 128 MiB read, as many written.
#[test]
fn copies_move_the_bytes_that_they_name() {
    let device = device();
    let copy = MemoryCopy::new(device).expect("room");
    assert_eq!(copy.bytes(), 256 << 20);
    let seconds = copy.time(1).expect("a device");
    assert_eq!(seconds.is_some(), device.has_clock());
    assert!(seconds.is_none_or(|seconds| seconds > 0.0));
}

/// Without a device: the dispatches of a step that are sent, and the memory that is taken.
#[test]
fn counted_traffic_is_that_of_the_solver() {
    let xpbd = SolverSettings::xpbd();
    let jacobi = SolverSettings {
        colors: Colors::Limited(1),
        acceleration: Acceleration::Anderson,
        ..xpbd.clone()
    };
    let explicit = SolverSettings { method: Method::Explicit, ..xpbd.clone() };
    let quasi_newton = SolverSettings { method: Method::QuasiNewton, ..xpbd.clone() };
    for settings in [xpbd, jacobi, explicit, quasi_newton] {
        let model = bar();
        let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
        gpu.step(&model, &Inputs::default(), DT).expect("a legal step");
        let traffic = Traffic::new(&model, &settings, gpu.passes());
        assert_eq!(traffic.passes, gpu.passes(), "{:?}", settings.method);
        assert_eq!(traffic.dispatches.each_ref().map(Vec::len), gpu.dispatches());
        // The rest are jobs, 256 bytes each, copies' places of a small model, and the least size of a buffer.
        let counted: u64 = traffic.memory.iter().map(|(_, bytes)| bytes).sum();
        let rest = gpu.bytes() - counted;
        let jobs = 256 * (gpu.dispatches().iter().sum::<usize>() as u64 + 8);
        assert!(rest < jobs + (16 << 10), "{:?}: {rest} of {}", settings.method, gpu.bytes());
    }
}
