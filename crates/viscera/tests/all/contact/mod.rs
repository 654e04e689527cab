//! Contact with tools and obstacles, by every method.

mod divided;
mod forces;
mod grasps;
mod held;
mod inside;
mod meshes;
mod motion;
pub mod on_device;
pub mod on_device_explicit;
mod on_device_robust;
mod on_device_tissue;
mod on_device_xpbd;
mod organs;
mod passes;
mod refused;
mod sheets;
mod ties;
mod tissue;
mod tissue_motion;
mod tissue_pairs;

use viscera::contact::{Shape, Tool};
use viscera::material::Material;
use viscera::mesh::{TetMesh, shapes};
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Count, Elements, Method, SolverSettings};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::{ContactState, State};

use crate::common::SNH;

/// A block of tissue, at rest with its middle above the origin and its lower face at `z = 0`.
pub struct Block {
    pub mesh: TetMesh,
    /// Young's modulus [Pa], Poisson's ratio, retardation time [s].
    pub tissue: [f64; 3],
    pub cuts: u32,
}

impl Block {
    pub fn new(size: [f64; 3], cells: [usize; 3], tissue: [f64; 3]) -> Self {
        let size = Vec3::from_f64(size);
        let made = shapes::block(size, cells).expect("a block");
        let low = made.vertices().iter().fold(Vec3::splat(f64::MAX), |low, x| low.min(*x));
        let shift = -low - vec3(0.5 * size.x, 0.5 * size.y, 0.0);
        let vertices = made.vertices().iter().map(|x| *x + shift).collect();
        let regions = made.regions().to_vec();
        let (mesh, _) = TetMesh::new(vertices, made.tets().to_vec(), regions).expect("a mesh");
        Self { mesh, tissue, cuts: 1 }
    }

    pub fn material(&self) -> Material {
        let [young, poisson, viscosity] = self.tissue;
        let tissue = Material::new(SNH, young, poisson, 1060.0).expect("a tissue");
        tissue.with_viscosity(viscosity).expect("a viscosity")
    }

    pub fn model<S: Real>(&self) -> Model<S> {
        let mut builder = ModelBuilder::new();
        builder.add_body(&self.mesh, &self.material()).expect("a body");
        builder.sample_surface(self.cuts);
        builder.build().expect("a model")
    }

    /// Pins of the vertices for which `holds`, where they are.
    pub fn pins<S: Real>(&self, holds: impl Fn(Vec3<f64>) -> bool) -> Vec<Pin<S>> {
        let held = (0u32..).zip(self.mesh.vertices()).filter(|(_, x)| holds(**x));
        held.map(|(vertex, x)| Pin { vertex, target: x.cast() }).collect()
    }

    /// Those of the lower face.
    pub fn fixed_below<S: Real>(&self) -> Vec<Pin<S>> {
        self.pins(|x| x.z < 1e-6)
    }
}

/// A method by its name, and the substeps of a frame it is used with.
pub fn method(name: &str) -> (SolverSettings, u32) {
    let plain =
        |method| SolverSettings { method, elements: Elements::Plain, ..SolverSettings::default() };
    match name {
        "xpbd" => {
            let iterations = Count::Of(5);
            (SolverSettings { iterations, elements: Elements::Plain, ..SolverSettings::xpbd() }, 4)
        }
        "quasi_newton" => (plain(Method::QuasiNewton), 2),
        "explicit" => (plain(Method::Explicit), 1),
        name => panic!("no method `{name}`"),
    }
}

pub const METHODS: [&str; 3] = ["xpbd", "quasi_newton", "explicit"];

/// The methods that a long test tries: these, or those that `VISCERA_METHODS=explicit,xpbd` names.
pub fn methods_or(usual: &[&'static str]) -> Vec<&'static str> {
    let Ok(asked) = std::env::var("VISCERA_METHODS") else { return usual.to_vec() };
    let known = |name: &str| METHODS.into_iter().find(|method| *method == name.trim());
    asked
        .split(',')
        .map(|name| known(name).unwrap_or_else(|| panic!("no method `{name}`")))
        .collect()
}

/// A running solver with everything it needs.
pub struct Scene<S> {
    pub model: Model<S>,
    pub state: State<S>,
    pub solver: Solver<S>,
    pub inputs: Inputs<S>,
    pub dt: f64,
    /// Steps so far.
    pub steps: u32,
}

impl<S: Real> Scene<S> {
    pub fn new(block: &Block, name: &str, inputs: Inputs<S>) -> Self {
        let (settings, substeps) = method(name);
        Self::with(block, &settings, substeps, inputs)
    }

    pub fn with(
        block: &Block,
        settings: &SolverSettings,
        substeps: u32,
        inputs: Inputs<S>,
    ) -> Self {
        let model = block.model::<S>();
        Self {
            state: State::at_rest(&model),
            solver: Solver::new(&model, settings),
            model,
            inputs,
            dt: 1.0 / 60.0 / f64::from(substeps),
            steps: 0,
        }
    }

    /// Goes on for a time [s]; `act` moves the tools to where they are at a time [s] from the beginning.
    pub fn run(&mut self, time: f64, mut act: impl FnMut(f64, &mut [Tool])) {
        if self.steps == 0 {
            act(0.0, &mut self.inputs.tools);
            self.state.contact = ContactState::of(&self.inputs.tools);
        }
        for _ in 0..(time / self.dt).round() as u32 {
            self.steps += 1;
            act(f64::from(self.steps) * self.dt, &mut self.inputs.tools);
            let Self { model, state, solver, inputs, dt, .. } = self;
            solver.lead(model, state, inputs, *dt).expect("held tools");
            solver.step(model, state, inputs, *dt).expect("a step");
        }
    }

    pub fn force(&self, tool: usize) -> Vec3<f64> {
        self.solver.wrenches()[tool].force
    }

    /// Of all vertices by their mass.
    pub fn mean(&self, of: impl Fn(&State<S>, usize) -> Vec3<S>) -> Vec3<f64> {
        let (mut sum, mut all) = (Vec3::<f64>::ZERO, 0.0);
        for (v, mass) in self.model.masses.iter().enumerate() {
            sum += of(&self.state, v).cast::<f64>() * mass.to_f64();
            all += mass.to_f64();
        }
        sum * (1.0 / all)
    }
}

/// A ball with the usual law, without friction.
pub fn ball(radius: f64) -> Tool {
    let mut tool = Tool::new(Shape::Sphere { radius });
    tool.law.friction = 0.0;
    tool
}

/// A share of the way from a time [s] to another.
pub fn ramp(time: f64, from: f64, to: f64) -> f64 {
    ((time - from) / (to - from)).clamp(0.0, 1.0)
}
