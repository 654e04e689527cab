//! The preconditioner on a device against the same levels in double precision.

use super::{Coarseness, Curvature, OfPart};
use crate::layout::{Before, Layout, Moments};
use crate::material::{Material, MaterialModel};
use crate::mesh::shapes::Block;
use crate::model::{Model, ModelBuilder};
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3, vec3};
use crate::settings::{Method, SolverSettings};
use crate::solver::gpu::{Adapter, GpuSolver, Slot};
use crate::solver::quasi_newton::on_device::share;
use crate::solver::step::data::Step;
use crate::solver::{Inputs, Pin, Solver};
use crate::state::State;

const DT: f64 = 1.0 / 60.0;

/// A part with three levels, one with one, one without; two laws, one of them viscous.
fn model<S: Real>() -> Model<S> {
    let mut builder = ModelBuilder::new();
    for (place, cells, law) in [
        (0.0, [24, 12, 12], MaterialModel::StableNeoHookean),
        (0.2, [8, 3, 3], MaterialModel::SaintVenantKirchhoff),
        (0.4, [2, 1, 1], MaterialModel::StableNeoHookean),
    ] {
        let size = cells.map(|count| 0.005 * f64::from(count));
        let mesh = Block::new(vec3(size[0], size[1], size[2]), cells.map(|count| count as usize));
        let mesh = mesh.mesh().expect("a block");
        let places = mesh.vertices().iter().map(|x| *x + vec3(0.0, place, 0.0)).collect();
        let (mesh, _) =
            crate::mesh::TetMesh::new(places, mesh.tets().to_vec(), mesh.regions().to_vec())
                .expect("a mesh");
        let viscosity = if place == 0.2 { 0.01 } else { 0.0 };
        let tissue = Material::new(law, 1e4, 0.4, 1000.0).expect("legal");
        builder.add_body(&mesh, &tissue.with_viscosity(viscosity).expect("legal")).expect("a body");
    }
    builder.build().expect("a model")
}

/// Turned, sheared and stretched, and moving; the wall is held.
fn state<S: Real>(rest: &Model<f64>) -> State<S> {
    let mut state = State::<S>::at_rest(&model::<S>());
    for (v, x) in rest.rest_positions.iter().enumerate() {
        let bent = vec3(
            1.05 * x.x * libm::cos(9.0 * x.x),
            x.y + 0.1 * x.x,
            x.z * 0.95 + x.x * libm::sin(9.0 * x.x),
        );
        state.positions[v] = bent.cast();
        state.velocities[v] = vec3(0.2, -0.3 * x.x, 0.1).cast();
    }
    state
}

/// `z = M g` of every part after a step, where blocks are still those of its start.
#[test]
fn the_device_applies_what_the_processor_applies() {
    let settings = SolverSettings { method: Method::QuasiNewton, ..SolverSettings::xpbd() };
    let (single, double) = (model::<f32>(), model::<f64>());
    let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
    let wall = (0..).zip(&double.rest_positions).filter(|(_, x)| x.x < 1e-9);
    inputs.pins =
        wall.map(|(vertex, x)| Pin { vertex, target: x.cast() }).collect::<Vec<Pin<f32>>>();
    let device = Adapter::find(None).and_then(|adapter| adapter.open());
    let device = device.unwrap_or_else(|error| panic!("{error}"));
    let mut gpu = GpuSolver::new(&device, &single, &settings).expect("a model that fits");
    gpu.write(&single, &state(&double)).expect("a state of this model");
    gpu.step(&single, &inputs, DT).expect("a legal step");
    let bytes = gpu.read_buffer(Slot::VertexData).expect("a device");
    let rows: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
    let stride = single.vertex_count().next_multiple_of(16);
    // Gradient and its image, `QN_GRADIENT` and `QN_Z`, by the user's numbers: rounded places may be sorted otherwise.
    let of_user = |place: usize, v: u32| {
        let [x, y, z, _] = rows[place * stride + gpu.layout().numbering.of(v)];
        vec3(x, y, z).cast::<f64>()
    };

    let layout = Layout::new(&double, &settings);
    let mut solver = Solver::new(&double, &settings);
    let before = state::<f64>(&double);
    let mut moved = before.clone();
    let pins = inputs.pins.iter().map(|pin| Pin { vertex: pin.vertex, target: pin.target.cast() });
    let wide_inputs =
        Inputs { gravity: vec3(0.0, 0.0, -9.81), pins: pins.collect(), ..Inputs::<f64>::default() };
    // Constants of the step: masses, and what is held.
    solver.step(&double, &mut moved, &wide_inputs, DT).expect("a legal step");
    let constants = &solver.memory.data.constants;
    let order = &layout.numbering.order;
    let at = |v: &u32| before.positions[*v as usize] + before.velocities[*v as usize] * (0.5 * DT);
    let x: Vec<Point<f64>> = order.iter().map(|v| Point::new(at(v), 0.0)).collect();
    let dt = DT * share(&settings);
    let moments = Moments { anchors: &layout.rest_anchors, start: Before::Places(&x), dt };
    let free: Vec<bool> = constants.inverse_masses.iter().map(|w| *w != 0.0).collect();
    let step = Step { layout: &layout, settings: &settings, inputs: &wide_inputs, dt };
    for (number, part) in layout.parts.iter().enumerate() {
        let mut levels = OfPart::new(&layout, part, Coarseness::ON_DEVICE);
        println!("{} vertices, {} levels", part.vertices.len(), levels.lattice.levels.len());
        levels.rebuild(&layout, number, &free[part.vertices.clone()]);
        let mut turns = vec![super::rotation::Turn::NONE; levels.groups.len()];
        let curvature = Curvature { dt, x: &x, moments: Moments { ..moments } };
        levels.refresh(&step, constants, &curvature, number, &mut turns, &free);
        let users = &order[part.vertices.clone()];
        let gradient: Vec<Vec3<f64>> = users.iter().map(|&v| of_user(6, v)).collect();
        let mut expected = vec![Vec3::ZERO; gradient.len()];
        levels.apply(&constants.workers, &gradient, &mut expected);
        let largest = expected.iter().map(|z| z.length()).fold(0.0, f64::max);
        assert!(largest > 0.0 && largest.is_finite());
        for ((expected, &user), v) in expected.iter().zip(users).zip(part.vertices.clone()) {
            if !free[v] {
                continue;
            }
            let away = (of_user(8, user) - *expected).length();
            // Rotations end within 1e-4 rad; dense levels of stiff tissue lose some digits of single precision.
            assert!(away < 2e-3 * largest, "part {number}, vertex {v}: {away:e} of {largest:e}");
        }
    }
}
