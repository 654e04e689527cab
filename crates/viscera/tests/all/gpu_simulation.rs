//! Scenes on a graphics processor: what is chosen and why, the same numbers as on the CPU, and devices
//! that fail. A software driver does; without any the tests fail and say what to install.

use crate::common::device::{adapter, device_within, own_device};
use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::settings::{Elements, Method, SolverSettings};
use viscera::simulation::{Assembly, FrameError, FrameReport, Simulation, SimulationError};
use viscera::solver::FrameReading::{Balance, Forces, State};
use viscera::solver::gpu::{GpuError, StepCost, baseline, shortfall};

/// Two bars, joined by springs; one viscous, one in an elastic fixing; a motion that lets go, a force.
/// Guards are off: what they decide may turn on the last digit.
const SCENE: &str = r#"
time = { duration = "1 s", velocity_factor = 0.9 }

[contact]
self = false
bodies = false

[[body]]
name = "upper"
shape = "block"
size = ["40 mm", "20 mm", "20 mm"]
cells = [4, 2, 2]
material = { young = "10 kPa", poisson = 0.45, density = "1000 kg/m^3", viscosity = "20 ms" }

[[body]]
name = "lower"
shape = "block"
size = ["40 mm", "20 mm", "20 mm"]
cells = [4, 2, 2]
position = [0, 0, "-30 mm"]
material = { young = "20 kPa", poisson = 0.3, density = "1000 kg/m^3", model = "saint_venant_kirchhoff" }

[[fixing]]
name = "wall"
body = "upper"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[fixing]]
name = "bed"
body = "lower"
half_space = { point = [0, 0, "-30 mm"], normal = [0, 0, -1] }
stiffness = "500 N/m"

[[motion]]
name = "grip"
body = "upper"
half_space = { point = ["40 mm", 0, 0], normal = [1, 0, 0] }
release = "0.12 s"
keys = [{ time = "0.1 s", translation = ["10 mm", 0, 0] }]

[[force]]
name = "push"
body = "lower"
half_space = { point = ["40 mm", 0, "-30 mm"], normal = [1, 0, 0] }
force = ["0.1 N", 0, 0]

[[spring]]
name = "tie"
stiffness = "50 N/m"
from = { body = "upper", half_space = { point = [0, 0, 0], normal = [0, 0, -1] } }
to = { body = "lower", half_space = { point = [0, 0, "-10 mm"], normal = [0, 0, 1] } }

[solver]
step_guard = false
"#;

fn assembled(overrides: &[(&str, &str)]) -> (Scene, Assembly) {
    // Both backends compute it.
    let overrides = [&[("solver.method", "xpbd")], overrides].concat();
    let scene = Scene::parse("scene.toml", SCENE, &overrides);
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    let assembly = Assembly::new(&scene, &mut |name| Err(format!("no file {name}")));
    (scene, assembly.unwrap_or_else(|error| panic!("{error}")))
}

fn simulation(overrides: &[(&str, &str)]) -> Result<Simulation<f32>, SimulationError> {
    let (scene, assembly) = assembled(overrides);
    Simulation::new(scene, assembly)
}

fn advanced(mut simulation: Simulation<f32>, frames: u32) -> Simulation<f32> {
    for _ in 0..frames {
        simulation.advance_frame().unwrap_or_else(|error| panic!("{error}"));
    }
    simulation
}

fn distance(a: &[Vec3<f32>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a.cast::<f64>() - *b).length()).fold(0.0, f64::max)
}

/// Every number of a report that round-off touches little, each over the size that it is measured by.
fn numbers(report: &FrameReport) -> Vec<(String, f64)> {
    let elastic = report.energy.elastic;
    let mut numbers = vec![
        ("residual".to_owned(), report.relative_residual),
        ("stiffness".to_owned(), report.stiffness_error),
        ("kinetic".to_owned(), report.energy.kinetic / elastic),
        ("gravitational".to_owned(), report.energy.gravitational / elastic),
        ("volume".to_owned(), report.deformation.volume_ratio),
        ("stretch".to_owned(), report.deformation.largest_stretch),
    ];
    let patches = report.patches.iter();
    numbers.extend(patches.flat_map(|p| p.force.map(|f| (format!("force at {}", p.name), f))));
    numbers
}

/// Positions of both are off by their round-off, so that the GPU may not be much further from double
/// precision than the CPU is: twice as far by chance, and twice for sums in another order. Numbers of a
/// report are differences of such positions, of 1e-8 m in bodies of 1e-2 m that deform by a tenth: five
/// digits are left, of forces, which are second differences, three.
fn assert_frames_and_reports_agree(frames: u64, substeps: &str, least_moved: f64) {
    for overrides in [
        &[][..],
        &[("solver.colors", "1"), ("solver.iterations", "6")],
        &[("solver.acceleration", "chebyshev"), ("solver.iterations", "14")],
        &[("time.velocity_factor", "1")],
    ] {
        let with = |device| {
            [overrides, &[("solver.device", device), ("solver.substeps", substeps)]].concat()
        };
        let mut cpu = simulation(&with("cpu")).expect("a simulation");
        let mut gpu = simulation(&with("gpu")).expect("a simulation");
        assert!(gpu.gpu().is_some() && cpu.gpu().is_none());
        let (scene, assembly) = assembled(&with("cpu"));
        let mut oracle = Simulation::<f64>::new(scene, assembly).expect("a simulation");
        for frame in 1..=frames {
            cpu.advance_frame().expect("a frame");
            gpu.advance_frame().expect("a frame");
            oracle.advance_frame().expect("a frame");
            let exact = &oracle.state().positions;
            let [on_cpu, on_gpu] = [&cpu, &gpu].map(|s| distance(&s.state().positions, exact));
            assert!(on_gpu <= 4.0 * on_cpu + 1e-8, "frame {frame}: {on_gpu:e} m, CPU {on_cpu:e} m");
            for ((name, a), (_, b)) in numbers(&cpu.report()).iter().zip(numbers(&gpu.report())) {
                assert!((a - b).abs() <= 2e-3, "{overrides:?}, frame {frame}, {name}: {a} and {b}");
            }
        }
        let rest = &oracle.model().rest_positions;
        let moved = distance(&gpu.state().positions, rest);
        assert!(moved > least_moved, "{moved} m: nothing has moved");
    }
}

#[test]
fn frames_and_reports_agree_with_the_cpu() {
    assert_frames_and_reports_agree(1, "3", 1e-4);
}

#[test]
#[ignore = "slow: twelve frames in four ways"]
fn frames_and_reports_agree_with_the_cpu_at_length() {
    assert_frames_and_reports_agree(12, "10", 5e-3);
}

/// Large steps, with the substeps that their oscillations ask for: against steps that are solved to their end, the device is
/// off by at most twice as much as the CPU is, and its reports are the CPU's within what such steps leave.
#[test]
fn solves_of_a_scene_are_as_near_as_the_cpus() {
    for elements in ["plain", "recovered"] {
        solves_are_as_near(elements);
    }
}

fn solves_are_as_near(elements: &'static str) {
    let with = |device, more: &[(&'static str, &'static str)]| {
        let method = [("solver.method", "quasi_newton"), ("solver.elements", elements)];
        [&method[..], &[("solver.device", device)], more].concat()
    };
    let mut cpu = simulation(&with("cpu", &[])).expect("a simulation");
    let mut gpu = simulation(&with("gpu", &[])).expect("a simulation");
    assert!(gpu.gpu().is_some() && cpu.gpu().is_none());
    assert_eq!(gpu.solver().method, Method::QuasiNewton);
    assert_eq!(gpu.substeps(), cpu.substeps());
    let (scene, assembly) = assembled(&with("cpu", &[("solver.iterations", "80")]));
    let mut oracle = Simulation::<f64>::new(scene, assembly).expect("a simulation");
    for frame in 1..=6 {
        cpu.advance_frame().expect("a frame");
        gpu.advance_frame().expect("a frame");
        oracle.advance_frame().expect("a frame");
        let exact = &oracle.state().positions;
        let [on_cpu, on_gpu] = [&cpu, &gpu].map(|s| distance(&s.state().positions, exact));
        assert!(on_gpu <= 2.0 * on_cpu + 1e-7, "frame {frame}: {on_gpu:e} m, CPU {on_cpu:e} m");
        for ((name, a), (_, b)) in numbers(&cpu.report()).iter().zip(numbers(&gpu.report())) {
            println!("{frame} {name}: {a} {b}");
            assert!((a - b).abs() <= 2e-2, "frame {frame}, {name}: {a} and {b}");
        }
    }
    let moved = distance(&gpu.state().positions, &oracle.model().rest_positions);
    assert!(moved > 1e-3, "{moved} m: nothing has moved");
    // Another tissue on the same device.
    let change = ("body.upper.material.young".to_owned(), "9 kPa".to_owned());
    gpu.change(std::slice::from_ref(&change)).expect("another tissue");
    gpu.advance_frame().expect("a frame");
    assert!(gpu.gpu().is_some());
}

#[test]
fn the_choice_is_told_with_its_reason() {
    let choice =
        |overrides: &[(&str, &str)]| simulation(overrides).map(|s| s.device_choice().to_owned());
    let small = choice(&[]).expect("a simulation");
    assert!(
        small.starts_with("CPU: the mesh has 160 tetrahedra; a GPU pays from about "),
        "{small}"
    );
    assert_eq!(choice(&[("solver.device", "cpu")]).as_deref(), Ok("CPU: as asked for"));
    let name = adapter().name();
    let asked = choice(&[("solver.device", "gpu")]).expect("a simulation");
    assert_eq!(asked, format!("{name}: as asked for"));
    // Whatever its case.
    let part = name.split([' ', '(']).next().unwrap_or_default().to_uppercase();
    assert_eq!(choice(&[("solver.device", &format!("\"{part}\""))]), Ok(asked));

    let error = choice(&[("solver.device", "no such thing")]).expect_err("no such adapter");
    let error = error.to_string();
    assert!(error.starts_with("no adapter is called `no such thing`; there are: "), "{error}");
    assert!(error.contains(&name), "{error}");
}

/// Also after a change of the tissue. The expected error of its motion is reported.
#[test]
fn auto_is_quasi_newton_on_a_device_that_is_asked_for() {
    let auto = [("solver.method", "auto"), ("solver.device", "gpu"), ("solver.accuracy", "fine")];
    let mut on_device = simulation(&auto).expect("a simulation");
    let change = ("body.upper.material.young".to_owned(), "9 kPa".to_owned());
    for _ in 0..2 {
        assert!(on_device.gpu().is_some());
        assert_eq!(on_device.solver().method, Method::QuasiNewton);
        assert_eq!(on_device.solver().elements, Elements::Recovered);
        let expected = on_device.expected_errors().motion;
        assert!(expected.is_some_and(|share| share > 0.0 && share < 0.02), "{expected:?}");
        on_device.change(std::slice::from_ref(&change)).expect("another tissue");
    }
    on_device.change(&[("solver.device".to_owned(), "cpu".to_owned())]).expect("another device");
    assert!(on_device.gpu().is_none());
    assert_ne!(on_device.solver().method, Method::Xpbd);
}

/// A software adapter is slower than the CPU backend; it must be asked for.
#[test]
fn large_meshes_go_to_hardware_and_never_to_software_by_themselves() {
    let overrides = [("body.upper.cells", "[20, 20, 20]"), ("solver.iterations", "10")];
    let large = simulation(&overrides).expect("a simulation");
    let adapter = adapter();
    if adapter.is_software() {
        let told = format!("CPU: no graphics adapter but software ({})", adapter.name());
        assert_eq!((large.device_choice(), large.gpu().is_some()), (told.as_str(), false));
    } else {
        let told = large.device_choice();
        assert!(told.ends_with(": 40,080 tetrahedra") && large.gpu().is_some(), "{told}");
    }
}

/// A device computes no contact: that is said, or refused.
#[test]
fn contact_of_tissue_is_the_cpus() {
    let choice =
        |overrides: &[(&str, &str)]| simulation(overrides).map(|s| s.device_choice().to_owned());
    let gpu = ("solver.device", "gpu");
    let folds = choice(&[gpu, ("contact.self", "true")]).expect("a device");
    assert!(folds.contains("passes through itself"), "{folds}");
    let refused = choice(&[gpu, ("contact.bodies", "true")]).expect_err("several bodies");
    assert!(refused.to_string().contains("contact.bodies = false"), "{refused}");
    let published =
        [("solver.device", "cpu"), ("solver.method", "xpbd"), ("solver.rebase", "false")];
    let published = [&published[..], &[("contact.self", "true")]].concat();
    assert!(choice(&published).expect("the CPU").contains("passes through itself"));
}

#[test]
fn double_precision_stays_on_the_cpu() {
    let double = |overrides: &[(&str, &str)]| {
        let (scene, assembly) = assembled(overrides);
        Simulation::<f64>::new(scene, assembly).map(|s| s.device_choice().to_owned())
    };
    assert_eq!(double(&[]).as_deref(), Ok("CPU: double precision"));
    let error = double(&[("solver.device", "gpu")]);
    assert_eq!(error, Err(SimulationError::Gpu(GpuError::DoublePrecision)));
}

#[test]
fn auto_goes_on_with_the_cpu_where_the_device_is_lost() {
    let device = own_device();
    let (scene, assembly) = assembled(&[]);
    let on_device = Simulation::on_device(scene, assembly, &device).expect("a simulation");
    let mut lost = advanced(on_device, 5);
    assert_eq!(lost.device_warning(), None);
    device.wgpu().0.destroy();
    lost.advance_frame().expect("a frame on the CPU");
    let warning = lost.device_warning().expect("a warning").to_owned();
    assert!(
        warning.starts_with(&format!("after 0.0833 s {} was lost (", device.name())),
        "{warning}"
    );
    assert!(lost.device_choice().starts_with("CPU: after 0.0833 s"), "{}", lost.device_choice());
    let lost = advanced(lost, 6);
    assert_eq!(lost.frame(), 12);

    // As if the CPU had computed all of it, but for round-off, and for multipliers, which are gone with the device:
    // they are taken from the places, as after a change of settings.
    let cpu = advanced(simulation(&[("solver.device", "cpu")]).expect("a simulation"), 5);
    let mut cpu = cpu;
    cpu.change(&[("solver.threads".into(), "1".into())]).expect("a setting");
    let cpu = advanced(cpu, 7);
    let apart = lost.state().positions.iter().zip(&cpu.state().positions);
    let apart = apart.map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
    assert!(apart <= 1e-6, "{apart} m");
}

#[test]
fn a_device_that_was_asked_for_and_is_lost_ends_the_run_with_its_last_frame() {
    let device = own_device();
    let (scene, assembly) = assembled(&[("solver.device", "gpu")]);
    let on_device = Simulation::on_device(scene, assembly, &device).expect("a simulation");
    let mut lost = advanced(on_device, 2);
    let before = lost.state().clone();
    device.wgpu().0.destroy();
    for _ in 0..2 {
        let error = lost.advance_frame().expect_err("a lost device");
        assert!(matches!(error, FrameError::Gpu(GpuError::Lost { .. })), "{error}");
        assert_eq!(error.to_string().lines().count(), 1);
        assert_eq!((lost.frame(), lost.state()), (2, &before));
    }
    let (scene, assembly) = assembled(&[("solver.device", "gpu")]);
    let late = Simulation::on_device(scene, assembly, &device).map(|_| ());
    assert!(matches!(late, Err(SimulationError::Gpu(GpuError::Lost { .. }))), "{late:?}");
}

#[test]
fn a_mesh_beyond_the_limits_is_refused_with_the_size_that_fits() {
    let limits = wgpu::Limits { max_storage_buffer_binding_size: 16 << 10, ..baseline() };
    let device = device_within(limits);
    let (scene, assembly) = assembled(&[]);
    let error = Simulation::on_device(scene, assembly, &device).map(|_| ());
    let Err(SimulationError::Gpu(error)) = error else { panic!("{error:?}") };
    let GpuError::TooLarge { needed, limit, largest, .. } = error else { panic!("{error}") };
    assert!(needed > limit && limit == 16 << 10 && largest < 160, "{error}");
    assert_eq!(error.to_string().lines().count(), 1);
}

#[test]
fn what_an_adapter_lacks_is_named() {
    assert_eq!(shortfall(&baseline()), None);
    let limits = wgpu::Limits {
        max_compute_invocations_per_workgroup: 128,
        max_storage_buffers_per_shader_stage: 4,
        ..baseline()
    };
    let lacking = shortfall(&limits).expect("too little");
    assert!(
        lacking.contains("max_storage_buffers_per_shader_stage 4 where 8 is needed"),
        "{lacking}"
    );
    assert!(lacking.contains("max_compute_invocations_per_workgroup 128 where 256"), "{lacking}");
}

/// The estimate counts what is sent in fact, whatever the method, and its threshold is where both are equal.
#[test]
fn the_estimate_of_a_step_counts_its_dispatches() {
    for overrides in [
        &[][..],
        &[("solver.colors", "4"), ("solver.acceleration", "anderson")],
        &[("solver.method", "quasi_newton")],
        &[("solver.method", "quasi_newton"), ("solver.integrator", "implicit_euler")],
        &[("solver.method", "explicit")],
    ] {
        let gpu = simulation(&[overrides, &[("solver.device", "gpu")]].concat());
        let mut gpu = gpu.expect("a simulation");
        gpu.advance_frame().expect("a frame");
        let settings: &SolverSettings = &gpu.scene().solver;
        let solver = gpu.gpu().expect("a GPU");
        let cost = StepCost::new(gpu.layout(), settings, solver.passes());
        let [before, each, after] = solver.dispatches();
        let sent = before + solver.passes() as usize * each + after;
        assert!(solver.passes() > 0 && each > 0, "{overrides:?}: {before}, {each}, {after}");
        assert_eq!(cost.dispatches, sent as u64, "{overrides:?}");
        let per_tet = cost.cpu / gpu.model().tet_count() as f64;
        assert!((cost.pays_from() as f64 * per_tet / cost.gpu - 1.0).abs() < 1e-2);
        assert_eq!(cost.gpu_pays(), gpu.model().tet_count() as u64 > cost.pays_from());
    }
}

/// A frame reads back positions and velocities; multipliers, the largest part of the state, stay on the device.
#[test]
fn a_frame_reads_back_what_is_shown() {
    let (scene, assembly) = assembled(&[]);
    let simulation = Simulation::<f32>::on_device(scene, assembly, crate::common::device::device());
    let mut simulation = simulation.expect("a device");
    let places = simulation.state().positions.as_ptr();
    (0..2).for_each(|_| simulation.advance_frame().expect("a frame"));
    let (gpu, model) = (simulation.gpu().expect("it is there"), simulation.model());
    let [forces, frame, balance] = [Forces, State, Balance].map(|all| gpu.bytes_of_frame(all));
    let whole = gpu.bytes_of_state();
    let vertices = model.vertex_count() as u64;
    assert!(forces < 64 && balance > frame + 48 * vertices, "{forces}, {balance}");
    assert!((32 * vertices..32 * vertices + 256).contains(&frame), "{frame}");
    assert!(whole > frame + 4 * simulation.layout().multiplier_count as u64 - 256, "{whole}");
    // The caller looks at positions in the same place all the time.
    assert_eq!(simulation.state().positions.as_ptr(), places);
    // Those that stay are forces: they are there where they are asked for.
    let multipliers = gpu.multipliers(model).expect("a device");
    assert_eq!(multipliers.len(), simulation.layout().multiplier_count);
    assert!(multipliers.iter().any(|&l| l != 0.0) && multipliers.iter().all(|l| l.is_finite()));
}

/// Takes over a frame when it is there; how often it was not yet.
fn arrived(simulation: &mut Simulation<f32>) -> Result<u32, FrameError> {
    let began = std::time::Instant::now();
    let mut misses = 0;
    while !simulation.take_frame()? {
        assert!(began.elapsed().as_secs() < 60, "the frame never arrives");
        misses += 1;
        std::thread::yield_now();
    }
    Ok(misses)
}

#[test]
fn frames_that_nobody_waits_for_are_those_that_are_waited_for() {
    let on_device = || {
        let (scene, assembly) = assembled(&[]);
        let device = crate::common::device::device();
        Simulation::<f32>::on_device(scene, assembly, device).expect("a device")
    };
    let mut waited = advanced(on_device(), 6);
    let mut sent = on_device();
    for frame in 0..6 {
        assert!(!sent.take_frame().expect("nothing was sent") && !sent.is_under_way());
        sent.send_frame(if frame == 5 { Balance } else { State }).expect("a frame");
        assert!(sent.is_under_way() && sent.frame() == frame);
        arrived(&mut sent).expect("it arrives");
        assert_eq!(sent.frame(), frame + 1);
    }
    // From copies that came along with the frame: the device is not asked again.
    sent.measure().expect("measures");
    assert_eq!(sent.report(), waited.report());
    assert_eq!(sent.state(), waited.state());
    // The CPU computes at once, and its frames are taken over in the same way.
    let mut cpu = simulation(&[("solver.device", "cpu")]).expect("a simulation");
    cpu.send_frame(Balance).expect("a frame");
    assert_eq!(arrived(&mut cpu), Ok(0));
    cpu.measure().expect("measures");
    let other = advanced(simulation(&[("solver.device", "cpu")]).expect("a simulation"), 1);
    assert_eq!((cpu.state(), cpu.report()), (other.state(), other.report()));
    waited.advance_frame().expect("another frame");
}

#[test]
fn a_frame_under_way_gives_way_to_a_change_and_to_the_cpu() {
    let device = own_device();
    let (scene, assembly) = assembled(&[]);
    let mut lost = Simulation::on_device(scene, assembly, &device).expect("a simulation");
    lost.send_frame(State).expect("a frame");
    arrived(&mut lost).expect("it arrives");
    // A change between sending and taking over: the frame is computed again, with what was changed.
    lost.send_frame(State).expect("a frame");
    lost.change(&[("world.gravity".into(), "0 m/s^2".into())]).expect("a setting");
    assert!(!lost.is_under_way() && lost.frame() == 1);
    lost.send_frame(State).expect("a frame");
    device.wgpu().0.destroy();
    arrived(&mut lost).expect("computed by the CPU");
    assert_eq!(lost.frame(), 2);
    let warning = lost.device_warning().expect("a warning");
    assert!(warning.contains("the CPU went on from there"), "{warning}");
}

#[test]
fn another_device_goes_on_where_the_lost_one_was() {
    let device = own_device();
    let with = |device: &viscera::solver::gpu::Device| {
        let (scene, assembly) = assembled(&[("solver.device", "gpu")]);
        let simulation = Simulation::<f32>::with_device(scene, assembly, device.clone());
        simulation.expect("a simulation")
    };
    let mut lost = advanced(with(&device), 4);
    assert!(lost.is_on_device() && lost.device_choice().contains("as asked for"));
    let mut kept = advanced(with(crate::common::device::device()), 4);
    device.wgpu().0.destroy();
    lost.send_frame(State).expect_err("a lost device");
    lost.offer_device(Some(crate::common::device::device().clone())).expect("another device");
    assert!(lost.is_on_device() && lost.frame() == 4);
    // Multipliers are gone with the device, as after a change of settings.
    kept.change(&[("solver.threads".into(), "1".into())]).expect("a setting");
    let (lost, kept) = (advanced(lost, 3), advanced(kept, 3));
    let apart = lost.state().positions.iter().zip(&kept.state().positions);
    let apart = apart.map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
    assert!(apart <= 1e-6, "{apart} m");
    // Without any, what asks for one is refused, and what leaves the choice goes on with the CPU.
    let (scene, assembly) = assembled(&[]);
    let mut free = Simulation::on_device(scene, assembly, &device);
    assert!(free.is_err(), "a lost device takes nothing");
    let (scene, assembly) = assembled(&[]);
    free = Simulation::with_device(scene, assembly, crate::common::device::device().clone());
    let free = free.expect("small meshes are for the CPU");
    assert!(!free.is_on_device(), "{}", free.device_choice());
}
