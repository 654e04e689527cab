//! A graphics device for whole scenes, and a model; a software driver will do.

use std::sync::OnceLock;

use crate::common::{SNH, STVK, block, material};
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::solver::gpu::{Adapter, Device};
use viscera::solver::{Inputs, Pin, Tether};

/// The first adapter there is. Without any the test fails and says what to install.
pub fn adapter() -> Adapter {
    Adapter::find(None).unwrap_or_else(|error| panic!("{error}"))
}

/// Its device, one for all tests of a program: kernels are compiled once.
pub fn device() -> &'static Device {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    DEVICE.get_or_init(own_device)
}

/// A device of the test's own: to be lost, or because nobody else's work may be on it.
pub fn own_device() -> Device {
    adapter().open().unwrap_or_else(|error| panic!("{error}"))
}

/// One within other limits.
pub fn device_within(limits: wgpu::Limits) -> Device {
    adapter().open_with(limits).unwrap_or_else(|error| panic!("{error}"))
}

/// Largest distance of vectors from the oracle's.
pub fn largest<S: Real>(a: &[Vec3<S>], oracle: &[Vec3<f64>]) -> f64 {
    let pairs = a.iter().zip(oracle);
    pairs.map(|(a, b)| (a.cast::<f64>() - *b).length()).fold(0.0, f64::max)
}

/// Of the viscous tissue [s].
pub const RETARDATION: f64 = 0.02;

/// Two bars, one above the other, joined by springs; the upper one viscous, with vertices that are attached
/// once and twice: everything a model can have.
pub fn everything<S: Real>() -> Model<S> {
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let up: Vec<_> = mesh.vertices().iter().map(|x| *x + vec3(0.0, 0.0, 0.05)).collect();
    let (above, _) =
        TetMesh::new(up, mesh.tets().to_vec(), mesh.regions().to_vec()).expect("a mesh");
    let viscous = material(SNH, 1e4, 0.4).with_viscosity(RETARDATION).expect("legal");
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &material(STVK, 2e4, 0.3)).expect("a body");
    builder.add_body(&above, &viscous).expect("a body");
    let half = mesh.vertices().len() as u32;
    for v in (0..half).step_by(3) {
        builder.add_spring([v, half + v], 40.0, Some(0.04)).expect("a spring");
        let anchor = above.vertices()[v as usize];
        builder.add_attachment(half + v, anchor, 30.0).expect("an attachment");
        if v % 2 == 0 {
            let away = anchor + vec3(0.004, 0.0, 0.002);
            builder.add_attachment(half + v, away, 10.0).expect("an attachment");
        }
    }
    builder.build().expect("a model")
}

/// What is done to [`everything`] in a step, where anchors, pins and places drift by so much a step [m]: a wall that moves and is
/// let go, one attached vertex held for a while, another led by a spring, a force, anchors that come back. What is free
/// changes three times.
pub fn handled<S: Real>(model: &Model<f64>, step: u32, drift: Vec3<f64>) -> Inputs<S> {
    let away = drift * f64::from(step);
    let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), ..Inputs::default() };
    let half = model.vertex_count() as u32 / 2;
    let place = |vertex: u32| (model.rest_positions[vertex as usize] + away).cast();
    if step < 4 {
        let wall = (0..half).filter(|v| model.rest_positions[*v as usize].x < 1e-9);
        inputs.pins.extend(wall.map(|vertex| Pin { vertex, target: place(vertex) }));
        inputs.anchors = model.rest_anchors.iter().map(|a| (*a + away).cast()).collect();
    }
    if step == 2 {
        inputs.pins.push(Pin { vertex: half, target: place(half) });
        inputs.forces.extend([(7, vec3(0.01, 0.02, 0.0).cast()), (7, vec3(0.0, 0.01, 0.0).cast())]);
    }
    if (1..4).contains(&step) {
        let vertex = model.vertex_count() as u32 - 1;
        let stiffness = S::from_f64(30.0);
        inputs.tethers.push(Tether { vertex, target: place(vertex), stiffness });
    }
    inputs
}
