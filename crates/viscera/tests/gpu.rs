//! Whole scenes on a graphics processor: the same answers as on the CPU, and the same bits from run to
//! run. A software driver does; without any the tests fail and say what to install.

mod common;

use common::{SNH, STVK, block, material};
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{
    Acceleration, AndersonGuard, AndersonOn, Colors, NeoHookean, Precision, RelaxationForm,
    SolverSettings,
};
use viscera::solver::gpu::{Adapter, Device, GpuSolver};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const DT: f64 = 1.0 / 600.0;

fn device() -> Device {
    let adapter = Adapter::find(None).unwrap_or_else(|error| panic!("{error}"));
    adapter.open().unwrap_or_else(|error| panic!("{error}"))
}

/// Two bars, one above the other, joined by springs; one of Saint Venant-Kirchhoff, the other viscous,
/// neo-Hookean and in elastic attachments: everything a model can have.
fn everything<S: Real>(settings: &SolverSettings) -> Model<S> {
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let mut builder = ModelBuilder::new();
    let viscous = material(SNH, 1e4, 0.4).with_viscosity(0.05).expect("legal");
    builder.add_body(&mesh, &material(STVK, 2e4, 0.3)).expect("a body");
    let up = |x: &Vec3<f64>| *x + vec3(0.0, 0.0, 0.05);
    let vertices: Vec<_> = mesh.vertices().iter().map(up).collect();
    let regions = mesh.regions().to_vec();
    let (above, _) = TetMesh::new(vertices, mesh.tets().to_vec(), regions).expect("a mesh");
    builder.add_body(&above, &viscous).expect("a body");
    let half = mesh.vertices().len() as u32;
    for v in (0..half).step_by(3) {
        builder.add_spring([v, half + v], 40.0, Some(0.04)).expect("a spring");
        let anchor = above.vertices()[v as usize];
        builder.add_attachment(half + v, anchor, 30.0).expect("an attachment");
    }
    builder.build(settings).expect("a model")
}

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

fn largest(a: &[Vec3<f32>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a.cast::<f64>() - *b).length()).fold(0.0, f64::max)
}

/// Largest distances [m] from the f64 run after some steps: CPU's, GPU's; and the largest displacement.
fn distances(device: &Device, settings: &SolverSettings, steps: u32) -> [f64; 3] {
    let (model32, model64) = (everything(settings), everything(settings));
    let double = SolverSettings { precision: Precision::F64, ..settings.clone() };
    let mut cpu = Solver::<f32>::new(&model32, settings);
    let mut oracle = Solver::<f64>::new(&model64, &double);
    let mut gpu = GpuSolver::new(device, &model32, settings).expect("a model that fits");
    let (mut x32, mut x64) = (State::at_rest(&model32), State::at_rest(&model64));
    for step in 0..steps {
        cpu.step(&model32, &mut x32, &inputs_at(&model64, step), DT).expect("a legal step");
        oracle.step(&model64, &mut x64, &inputs_at(&model64, step), DT).expect("a legal step");
        gpu.step(&model32, &inputs_at(&model64, step), DT).expect("a legal step");
    }
    let mut read = State::at_rest(&model32);
    gpu.read(&model32, &mut read).expect("a device");
    let rest = State::<f64>::at_rest(&model64);
    [
        largest(&x32.positions, &x64.positions),
        largest(&read.positions, &x64.positions),
        largest(&x32.positions, &rest.positions),
    ]
}

#[test]
fn every_form_and_order_agrees_with_the_cpu() {
    let device = device();
    let plain = SolverSettings { step_guard: false, iterations: 3, ..SolverSettings::default() };
    let published = SolverSettings { rebase: false, keep_multipliers: false, ..plain.clone() };
    for colors in [Colors::Unlimited, Colors::Limited(4), Colors::Limited(1)] {
        for (name, settings) in [
            ("exact", plain.clone()),
            ("published", published.clone()),
            ("pair", SolverSettings { neo_hookean: NeoHookean::Pair, ..plain.clone() }),
            (
                "relaxed",
                SolverSettings {
                    relaxation: 0.9,
                    relaxation_form: RelaxationForm::Published,
                    ..published.clone()
                },
            ),
        ] {
            let settings = SolverSettings { colors, ..settings };
            let [cpu, gpu, moved] = distances(&device, &settings, 30);
            println!("{name}, {colors:?}: CPU {cpu:e}, GPU {gpu:e}, moved {moved:e}");
        }
    }
}

#[test]
fn every_acceleration_agrees_with_the_cpu() {
    let device = device();
    let plain = SolverSettings { step_guard: false, iterations: 8, ..SolverSettings::default() };
    for colors in [Colors::Unlimited, Colors::Limited(1)] {
        for (name, settings) in [
            (
                "chebyshev",
                SolverSettings {
                    acceleration: Acceleration::Chebyshev,
                    chebyshev_delay: 3,
                    ..plain.clone()
                },
            ),
            ("anderson", SolverSettings { acceleration: Acceleration::Anderson, ..plain.clone() }),
            (
                "anderson 10 unguarded",
                SolverSettings {
                    acceleration: Acceleration::Anderson,
                    anderson_window: 10,
                    anderson_guard: AndersonGuard::None,
                    ..plain.clone()
                },
            ),
            (
                "anderson on multipliers",
                SolverSettings {
                    acceleration: Acceleration::Anderson,
                    anderson_on: AndersonOn::Multipliers,
                    ..plain.clone()
                },
            ),
            (
                "anderson on positions",
                SolverSettings {
                    acceleration: Acceleration::Anderson,
                    anderson_on: AndersonOn::Positions,
                    ..plain.clone()
                },
            ),
        ] {
            let settings = SolverSettings { colors, ..settings };
            let [cpu, gpu, moved] = distances(&device, &settings, 30);
            println!("{name}, {colors:?}: CPU {cpu:e}, GPU {gpu:e}, moved {moved:e}");
        }
    }
}
