//! Whole scenes on a graphics processor: the same answers as on the CPU, and the same bits from run to
//! run. A software driver does; without any the tests fail and say what to install.

use crate::common::device::{device, device_within, everything};
use crate::common::{STVK, block, material};
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Clusters, Colors, Count, NeoHookean, Precision,
    RelaxationForm, SolverSettings,
};
use viscera::solver::gpu::{Device, GpuSolver, baseline};
use viscera::solver::plan::{Stage, XpbdStage};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const DT: f64 = 1.0 / 600.0;

/// A wall that moves, a force that comes and goes, anchors that drift.
fn inputs_at<S: Real>(model: &Model<f64>, step: u32) -> Inputs<S> {
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let away = vec3(0.0, 0.0, 1e-4 * f64::from(step));
    let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), ..Inputs::default() };
    for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
        inputs.pins.push(Pin { vertex: v as u32, target: (*x + away).cast() });
    }
    if (5..15).contains(&step) {
        inputs.forces.extend([(7, vec3(0.1, 0.2, 0.0).cast()), (7, vec3(0.0, 0.1, 0.0).cast())]);
    }
    inputs.anchors = model.rest_anchors.iter().map(|a| (*a + away).cast()).collect();
    inputs
}

/// Root mean square of distances [m].
fn distance(a: &[Vec3<f32>], b: &[Vec3<f64>]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a.cast::<f64>() - *b).length_squared());
    (squares.sum::<f64>() / a.len() as f64).sqrt()
}

/// How much is computed: a motion for each gravity [m/s^2] aside, so many steps, and how far things move at
/// least [m], on average.
#[derive(Clone, Copy)]
pub struct Length {
    pub tilts: &'static [f64],
    pub steps: u32,
    pub moved: f64,
}

pub const BRIEF: Length = Length { tilts: &[3.0], steps: 3, moved: 1e-5 };
pub const LONG: Length = Length { tilts: &[0.0, 3.0, -6.0], steps: 30, moved: 1e-3 };

/// Distances [m] from the f64 run, added up over moments of three motions: the CPU's and the GPU's; and
/// how far things have moved.
fn distances(device: &Device, settings: &SolverSettings, length: Length) -> [f64; 3] {
    let Length { tilts, steps, .. } = length;
    let (model32, model64) = (everything(), everything());
    let double = SolverSettings { precision: Precision::F64, ..settings.clone() };
    let mut cpu = Solver::<f32>::new(&model32, settings);
    let mut oracle = Solver::<f64>::new(&model64, &double);
    let mut gpu = GpuSolver::new(device, &model32, settings).expect("a model that fits");
    let rest = State::<f64>::at_rest(&model64);
    let mut sums = [0.0; 3];
    for &tilt in tilts {
        let (mut x32, mut x64) = (State::at_rest(&model32), State::at_rest(&model64));
        gpu.write(&model32, &x32).expect("a state that fits");
        let mut read = State::at_rest(&model32);
        for step in 0..steps {
            let mut inputs = inputs_at::<f32>(&model64, step);
            let mut inputs64 = inputs_at::<f64>(&model64, step);
            inputs.gravity.y = tilt as f32;
            inputs64.gravity.y = tilt;
            cpu.step(&model32, &mut x32, &inputs, DT).expect("a legal step");
            oracle.step(&model64, &mut x64, &inputs64, DT).expect("a legal step");
            gpu.step(&model32, &inputs, DT).expect("a legal step");
            if (step + 1) % (steps / 3) == 0 {
                gpu.read(&model32, &mut read).expect("a device");
                sums[0] += distance(&x32.positions, &x64.positions);
                sums[1] += distance(&read.positions, &x64.positions);
                sums[2] += distance(&x32.positions, &rest.positions);
            }
        }
    }
    sums.map(|sum| sum / (3 * tilts.len()) as f64)
}

/// Two runs in single precision differ by their round-off, which has no reason to be the same: the device
/// may be as far from the run in double precision as the CPU is, and as much again. Where the CPU is
/// lucky, round-off of the places themselves, which are a tenth of a metre from the origin, stays.
pub fn assert_agreement(name: &str, settings: &SolverSettings, length: Length) {
    let [cpu, gpu, moved] = distances(device(), settings, length);
    println!(
        "{name}, {:?}: CPU {cpu:.2e} m, GPU {gpu:.2e} m, moved {moved:.2e} m",
        settings.colors
    );
    let floor = 0.1 * f64::from(f32::EPSILON);
    assert!(moved > length.moved, "{name}: nothing moves");
    assert!(gpu <= 2.0 * cpu.max(floor), "{name}: {settings:?}");
}

/// Exact at rest, as published, every form, over-relaxed; coloured, cliques, Jacobi.
fn assert_sweeps_agree(length: impl Fn(&str) -> Length) {
    let plain =
        SolverSettings { step_guard: false, iterations: Count::Of(3), ..SolverSettings::xpbd() };
    let published = SolverSettings { rebase: false, keep_multipliers: false, ..plain.clone() };
    let pair = SolverSettings { neo_hookean: NeoHookean::Pair, ..plain.clone() };
    let relaxed = SolverSettings {
        relaxation: 0.9,
        relaxation_form: RelaxationForm::Published,
        ..published.clone()
    };
    for colors in [Colors::Unlimited, Colors::Limited(4), Colors::Limited(1)] {
        let all =
            [("exact", &plain), ("published", &published), ("pair", &pair), ("relaxed", &relaxed)];
        for (name, settings) in all {
            assert_agreement(name, &SolverSettings { colors, ..settings.clone() }, length(name));
        }
    }
}

#[test]
fn sweeps_agree_with_the_cpu() {
    assert_sweeps_agree(|_| BRIEF);
}

#[test]
#[ignore = "slow: hundreds of steps in twelve ways"]
fn sweeps_agree_with_the_cpu_at_length() {
    assert_sweeps_agree(|name| {
        let steps = if ["exact", "published"].contains(&name) { 120 } else { 30 };
        Length { steps, ..LONG }
    });
}

/// A few steps of everything at once, for a second, slower driver.
#[test]
fn portable_steps_agree_with_the_cpu() {
    let settings = SolverSettings {
        step_guard: false,
        iterations: Count::Of(2),
        acceleration: Acceleration::Anderson,
        ..SolverSettings::xpbd()
    };
    let length = Length { tilts: LONG.tilts, ..BRIEF };
    for colors in [Colors::Limited(4), Colors::Limited(1)] {
        let [cpu, gpu, moved] =
            distances(device(), &SolverSettings { colors, ..settings.clone() }, length);
        println!("{colors:?}: CPU {cpu:.2e} m, GPU {gpu:.2e} m, moved {moved:.2e} m");
        assert!(moved > 1e-5 && gpu <= 2.0 * cpu.max(0.1 * f64::from(f32::EPSILON)), "{colors:?}");
    }
}

/// Every acceleration by itself, as long as told by its name, with one colour and with many.
fn assert_accelerations_agree(length: impl Fn(&str, Colors) -> Option<Length>) {
    let plain =
        SolverSettings { step_guard: false, iterations: Count::Of(8), ..SolverSettings::xpbd() };
    let anderson = SolverSettings { acceleration: Acceleration::Anderson, ..plain.clone() };
    let chebyshev = SolverSettings {
        acceleration: Acceleration::Chebyshev,
        chebyshev_delay: 3,
        chebyshev_damping: 0.9,
        ..plain
    };
    // Until the window is full.
    let long = SolverSettings {
        anderson_window: 10,
        iterations: Count::Of(12),
        anderson_guard: AndersonGuard::None,
        ..anderson.clone()
    };
    let on = |anderson_on| SolverSettings { anderson_on, ..anderson.clone() };
    for colors in [Colors::Unlimited, Colors::Limited(1)] {
        for (name, settings) in [
            ("Chebyshev", chebyshev.clone()),
            ("Anderson", anderson.clone()),
            ("Anderson, window 10", long.clone()),
            ("Anderson on multipliers", on(AndersonOn::Multipliers)),
            ("Anderson on positions", on(AndersonOn::Positions)),
        ] {
            if let Some(length) = length(name, colors) {
                assert_agreement(name, &SolverSettings { colors, ..settings }, length);
            }
        }
    }
}

#[test]
fn accelerations_agree_with_the_cpu() {
    assert_accelerations_agree(|name, colors| match colors {
        // Shares of differences that are all but parallel have luck of their own: more moments.
        Colors::Limited(_) => Some(Length { tilts: LONG.tilts, ..BRIEF }),
        Colors::Unlimited => ["Chebyshev", "Anderson"].contains(&name).then_some(BRIEF),
    });
}

#[test]
#[ignore = "slow: ninety steps in ten ways"]
fn accelerations_agree_with_the_cpu_at_length() {
    assert_accelerations_agree(|_, _| Some(LONG));
}

/// The bits of everything that moves after some steps.
pub fn bits(model: &Model<f32>, gpu: &mut GpuSolver, steps: u32) -> Vec<u32> {
    let double: Model<f64> = everything();
    for step in 0..steps {
        gpu.step(model, &inputs_at(&double, step), DT).expect("a legal step");
    }
    let mut state = State::at_rest(model);
    gpu.read(model, &mut state).expect("a device");
    let vectors = state.positions.iter().chain(&state.velocities).flat_map(|v| v.to_array());
    vectors.chain(state.multipliers).map(f32::to_bits).collect()
}

/// Some runs, also after another scene ran and on memory that was used before.
fn assert_same_bits_again(runs: usize, steps: u32) {
    let settings = SolverSettings {
        colors: Colors::Limited(4),
        acceleration: Acceleration::Anderson,
        ..SolverSettings::xpbd()
    };
    let model = everything();
    let run = |left_over: Option<f32>, steps| {
        let gpu = match left_over {
            None => GpuSolver::new(device(), &model, &settings),
            Some(value) => GpuSolver::on_used_memory(device(), &model, &settings, value),
        };
        bits(&model, &mut gpu.expect("a model that fits"), steps)
    };
    let first = run(None, steps);
    let other = SolverSettings::xpbd();
    let other_model = everything();
    let mut another = GpuSolver::new(device(), &other_model, &other).expect("a model that fits");
    for again in 1..runs {
        if again == runs / 2 {
            bits(&other_model, &mut another, 1 + steps / 15);
        }
        let left_over = [None, Some(f32::NAN), Some(1e9)][again % 3];
        assert_eq!(run(left_over, steps), first, "run {again}, memory held {left_over:?}");
    }
}

#[test]
fn a_device_gives_the_same_bits_again() {
    assert_same_bits_again(3, 5);
}

#[test]
#[ignore = "slow: six runs of a hundred steps"]
fn a_device_gives_the_same_bits_again_at_length() {
    assert_same_bits_again(6, 100);
}

/// Published order, no rebase: what the device is asked to do in one iteration.
#[test]
fn dispatches_of_an_iteration_are_few() {
    let jacobi = SolverSettings {
        colors: Colors::Limited(1),
        rebase: false,
        keep_multipliers: false,
        ..SolverSettings::xpbd()
    };
    let mut builder = ModelBuilder::new();
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    builder.add_body(&mesh, &material(STVK, 2e4, 0.3)).expect("a body");
    for (acceleration, most) in [(Acceleration::None, 2), (Acceleration::Anderson, 4)] {
        let settings = SolverSettings { acceleration, ..jacobi.clone() };
        let model = builder.build().expect("a model");
        let gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
        let [before, iteration, after] = gpu.dispatches();
        println!("{acceleration:?}: {before} + {iteration} per iteration + {after}");
        assert!(iteration <= most, "{acceleration:?}: {iteration}");
        assert_eq!(GpuSolver::dispatches_of(&model, &settings), gpu.dispatches());
    }
}

/// A number of iterations that is set later gives the bits of a solver built with it.
#[test]
fn iterations_can_be_set_from_step_to_step() {
    let ends = [5, 2].map(|built_with| {
        let settings =
            SolverSettings { iterations: Count::Of(built_with), ..SolverSettings::xpbd() };
        let (model, double) = (everything(), everything());
        let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
        gpu.set_iterations(5);
        gpu.step(&model, &inputs_at(&double, 0), DT).expect("a legal step");
        let mut state = State::at_rest(&model);
        gpu.read(&model, &mut state).expect("a device");
        state
    });
    assert_eq!(ends[0], ends[1]);
}

/// Frames come while steps go on; none is older than the one before it.
fn assert_frames_arrive(steps: u32) {
    let settings = SolverSettings::xpbd();
    let (model, double) = (everything(), everything());
    let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
    let (mut seen, mut refused) = (Vec::new(), 0);
    for step in 0..steps {
        gpu.step(&model, &inputs_at(&double, step), DT).expect("a legal step");
        refused += u64::from(gpu.request().is_none());
        seen.extend(gpu.newest(&model).map(|frame| frame.number));
    }
    let mut state = State::at_rest(&model);
    gpu.read(&model, &mut state).expect("a device");
    let last = gpu.newest(&model);
    let places = last.as_ref().map(|frame| frame.positions.clone());
    seen.extend(last.map(|frame| frame.number));
    assert!(seen.is_sorted_by(|a, b| a < b), "{seen:?}");
    assert_eq!(
        seen.last(),
        Some(&(u64::from(steps) - refused)),
        "the last request has been answered"
    );
    if let (Some(places), 0) = (places, refused) {
        assert_eq!(places, state.positions);
    }
}

#[test]
fn frames_arrive_without_waiting() {
    assert_frames_arrive(12);
}

#[test]
#[ignore = "slow: two hundred steps"]
fn frames_arrive_without_waiting_at_length() {
    assert_frames_arrive(200);
}

/// A window's device that was opened with less than the baseline is refused, not met with a panic.
#[test]
fn a_device_below_the_baseline_is_refused() {
    let settings = SolverSettings::xpbd();
    let weak =
        device_within(wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..baseline() });
    let error = GpuSolver::new(&weak, &everything(), &settings).expect_err("too weak");
    let text = error.to_string();
    assert!(text.contains("4 where 8 is needed") && text.contains("cpu"), "{text}");
}

/// A model over the limits is refused before anything is allocated, with the numbers.
#[test]
fn a_model_over_the_limits_is_refused() {
    let settings = SolverSettings::xpbd();
    let limits = wgpu::Limits { max_storage_buffer_binding_size: 1 << 13, ..baseline() };
    let small = device_within(limits);
    let error = GpuSolver::new(&small, &everything(), &settings).expect_err("too large");
    let text = error.to_string();
    println!("{text}");
    assert!(text.contains("binds at most 8192") && text.contains("or fewer"), "{text}");
}

/// A step begun by the CPU and ended by the device, for every stage that it may change hands at.
fn assert_hands_change(iterations: u32, before: u32) {
    let guarded = SolverSettings { iterations: Count::Of(iterations), ..SolverSettings::xpbd() };
    let plain = SolverSettings { step_guard: false, ..guarded.clone() };
    let anderson = SolverSettings { acceleration: Acceleration::Anderson, ..plain.clone() };
    let clustered = SolverSettings { clusters: Clusters::OfTets(24), ..plain.clone() };
    let mut hands = 0;
    for (colors, settings) in [
        (Colors::Limited(1), &anderson),
        (Colors::Limited(4), &plain),
        (Colors::Unlimited, &clustered),
        (Colors::Unlimited, &guarded),
    ] {
        let settings = SolverSettings { colors, ..settings.clone() };
        let (model, double) = (everything(), everything());
        let mut cpu = Solver::<f32>::new(&model, &settings);
        let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
        // Something is under way when the step begins.
        let mut start = State::at_rest(&model);
        for step in 0..before {
            cpu.step(&model, &mut start, &inputs_at(&double, step), DT).expect("a legal step");
        }
        let inputs = inputs_at(&double, before);
        let mut whole = start.clone();
        cpu.step(&model, &mut whole, &inputs, DT).expect("a legal step");
        let moved = whole.positions.iter().zip(&start.positions);
        let moved = moved.map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
        let mut stages: Vec<Stage> = gpu.plan().split().first_pass().copied().collect();
        let is_color = |stage: &Stage| matches!(stage, Stage::Xpbd(XpbdStage::SolveColor(_)));
        stages.dedup_by(|a, b| is_color(a) && is_color(b));
        for stage in stages {
            let mut state = start.clone();
            let done = gpu.step_from(stage, &mut cpu, &model, &mut state, &inputs, DT);
            let done = done.expect("a legal step");
            gpu.read(&model, &mut state).expect("a device");
            let apart = state.positions.iter().zip(&whole.positions);
            let apart = apart.map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
            println!("{colors:?}, {done} stages by the CPU, then {stage:?}: {apart:e} m apart");
            // Round-off of places a tenth of a metre from the origin, and of a few sweeps.
            let limit = 16.0 * 0.1 * f32::EPSILON;
            assert!(apart < limit && moved > 1e-4, "{stage:?}: {apart:e} m apart of {moved:e} m");
            hands += 1;
        }
    }
    assert!(hands > 20, "{hands}");
}

#[test]
fn a_step_changes_hands_at_any_stage() {
    assert_hands_change(1, 5);
}

#[test]
#[ignore = "slow: three iterations at every stage"]
fn a_step_changes_hands_at_any_stage_at_length() {
    assert_hands_change(3, 5);
}

/// Another model than the solver's is an error, whatever is asked, and nothing panics.
#[test]
fn another_model_is_refused() {
    let settings = SolverSettings::xpbd();
    let model = everything();
    let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
    let mut builder = ModelBuilder::new();
    let mesh = block([0.06, 0.03, 0.03], [9, 5, 5], 0.1);
    builder.add_body(&mesh, &material(STVK, 2e4, 0.3)).expect("a body");
    let other = builder.build::<f32>().expect("a model");
    let mut state = State::at_rest(&other);
    assert!(gpu.step(&other, &Inputs::default(), DT).is_err());
    assert!(gpu.restart(&other, &Inputs::default(), DT).is_err());
    assert!(gpu.write(&other, &state).is_err());
    assert!(gpu.read(&other, &mut state).is_err());
    assert!(gpu.newest(&other).is_none());
}

/// Tetrahedra so small and soft that weights of multipliers are far above any number of copies: what
/// lies behind the vertices is not taken for copies.
#[test]
fn small_soft_tetrahedra_are_joined_as_any_others() {
    let settings = SolverSettings {
        colors: Colors::Limited(1),
        acceleration: Acceleration::Anderson,
        iterations: Count::Of(4),
        step_guard: false,
        ..SolverSettings::xpbd()
    };
    let mesh = block([0.006, 0.003, 0.003], [6, 3, 3], 0.1);
    let models = |_: ()| {
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &material(STVK, 500.0, 0.3)).expect("a body");
        (builder.build::<f32>().expect("a model"), builder.build::<f64>())
    };
    let (model, double) = models(());
    let double: Model<f64> = double.expect("a model");
    let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
    let (mut cpu, mut oracle) = (Solver::new(&model, &settings), Solver::new(&double, &settings));
    let (mut x32, mut x64) = (State::at_rest(&model), State::at_rest(&double));
    let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81f32), ..Inputs::default() };
    let mut inputs64 = Inputs { gravity: vec3(0.0, 0.0, f64::from(-9.81f32)), ..Inputs::default() };
    for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
        inputs.pins.push(Pin { vertex: v as u32, target: x.cast() });
        inputs64.pins.push(Pin { vertex: v as u32, target: x.cast::<f32>().cast() });
    }
    for _ in 0..10 {
        gpu.step(&model, &inputs, DT).expect("a legal step");
        cpu.step(&model, &mut x32, &inputs, DT).expect("a legal step");
        oracle.step(&double, &mut x64, &inputs64, DT).expect("a legal step");
    }
    let mut read = State::at_rest(&model);
    gpu.read(&model, &mut read).expect("a device");
    let [cpu, gpu] = [&x32, &read].map(|state| distance(&state.positions, &x64.positions));
    println!("CPU {cpu:.2e} m, GPU {gpu:.2e} m");
    assert!(gpu <= 2.0 * cpu.max(0.01 * f64::from(f32::EPSILON)), "CPU {cpu:e} m, GPU {gpu:e} m");
}
