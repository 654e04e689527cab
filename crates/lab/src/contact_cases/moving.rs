//! Tools in motion: forces frame by frame, by the library and by many small steps.

use anyhow::Result;
use viscera::contact::{ContactLaw, Shape, Tool};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::Block;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::rigid::{RigidTransform, rotation_matrix};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Count, Method, SolverSettings};
use viscera::solver::{Inputs, Pin, Shadow, Solver};
use viscera::state::{ContactState, State};

use super::{Way, select};
use crate::load_cases::{FRAME_RATE, GRAVITY, NEAR, tissue};

/// Iterations of implicit steps that follow motion closely: short steps need few.
const TRUE_ITERATIONS: u32 = 12;

/// A frame [s].
const FRAME: f64 = 1.0 / FRAME_RATE;

/// What a hand does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deed {
    /// A probe is pressed into a block at 50 mm/s and held.
    Press,
    /// A ball that is pressed in is pulled aside.
    Rub,
    /// A ball taps on a block.
    Tap,
    /// Two balls take a fin between them, pull and turn it.
    Grasp,
    /// A rounded blade lifts the end of a beam that has no weight.
    Lift,
    /// A table on which a block lies is shaken.
    Shake,
    /// A beam falls on a blade that lifts it.
    Drop,
}

/// Those in which a hand leads all that happens: all but the fall.
pub const DEEDS: [Deed; 6] =
    [Deed::Press, Deed::Rub, Deed::Tap, Deed::Grasp, Deed::Lift, Deed::Shake];

impl Deed {
    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Press => "a probe is pressed in at 50 mm/s and held",
            Self::Rub => "a ball is pressed in and pulled aside",
            Self::Tap => "a ball taps four times a second",
            Self::Grasp => "two balls take a fin, pull and turn it",
            Self::Lift => "a blade lifts the end of a beam",
            Self::Shake => "a table with a block on it is shaken",
            Self::Drop => "a beam falls on a blade that lifts it",
        }
    }
}

/// A deed on a body.
#[derive(Clone, Debug)]
pub struct Moving {
    /// What is done.
    pub deed: Deed,
    mesh: TetMesh,
    fixed: Vec<u32>,
    tissue: Material,
}

/// Forces on tools [N], frame by frame, tool by tool, and the share of steps that the guard has rejected.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// On every tool.
    pub forces: Vec<Vec<Vec3<f64>>>,
    /// What they are said to be off by [N]; empty where nobody asked.
    pub errors: Vec<Vec<f64>>,
    /// Share of steps.
    pub rejected: f64,
}

impl Course {
    /// The largest force [N].
    pub fn peak(&self) -> f64 {
        self.forces.iter().flatten().map(|force| force.length()).fold(0.0, f64::max)
    }
}

impl Moving {
    /// On liver of 5 kPa with a viscosity of 10 ms.
    pub fn new(deed: Deed) -> Result<Self> {
        let (size, cells) = match deed {
            Deed::Press | Deed::Rub | Deed::Tap => ([0.06, 0.06, 0.03], [8, 8, 4]),
            Deed::Grasp => ([0.03, 0.012, 0.03], [6, 3, 6]),
            Deed::Lift | Deed::Drop => ([0.08, 0.02, 0.016], [10, 3, 2]),
            Deed::Shake => ([0.02, 0.02, 0.02], [4, 4, 4]),
        };
        let size = Vec3::from_f64(size);
        let corner = vec3(-0.5 * size.x, -0.5 * size.y, 0.0);
        let mesh = Block { corner, ..Block::new(size, cells) }.mesh()?;
        let fixed = select(&mesh, |x| match deed {
            Deed::Shake => false,
            Deed::Lift | Deed::Drop => x.x < -0.04 + NEAR,
            _ => x.z < NEAR,
        });
        let model = MaterialModel::StableNeoHookean;
        Ok(Self { deed, mesh, fixed, tissue: tissue(model, 5e3, 0.45)?.with_viscosity(0.01)? })
    }

    /// How long it takes [frames].
    pub fn frames(&self) -> u32 {
        FRAME_RATE as u32
    }

    /// Its model.
    pub fn model<S: Real>(&self) -> Result<Model<S>> {
        let mut builder = ModelBuilder::new();
        builder.add_body(&self.mesh, &self.tissue)?;
        builder.sample_surface(1);
        Ok(builder.build()?)
    }

    /// Tools and loads at a time [s].
    pub fn inputs<S: Real>(&self, time: f64) -> Inputs<S> {
        let rest = self.mesh.vertices();
        let pin = |&vertex: &u32| Pin { vertex, target: rest[vertex as usize].cast() };
        let pins = self.fixed.iter().map(pin).collect();
        let gravity = match self.deed {
            Deed::Drop | Deed::Shake => GRAVITY,
            _ => Vec3::ZERO,
        };
        let mut inputs =
            Inputs { gravity: gravity.cast(), pins, tools: self.tools(time), ..Inputs::default() };
        for tool in &mut inputs.tools {
            tool.law = ContactLaw {
                friction: if self.deed == Deed::Grasp { 0.8 } else { 0.3 },
                ..tool.law
            };
        }
        inputs
    }

    fn tools(&self, time: f64) -> Vec<Tool> {
        let at = |shape: Shape, translation: Vec3<f64>, turn: Vec3<f64>| Tool {
            pose: RigidTransform { rotation: rotation_matrix(turn), translation },
            ..Tool::new(shape)
        };
        let ball = |radius: f64, x: Vec3<f64>| at(Shape::Sphere { radius }, x, Vec3::ZERO);
        // At a speed [m/s] from a time [s] on, so far [m].
        let goes = |since: f64, speed: f64, way: f64| (speed * (time - since)).clamp(0.0, way);
        match self.deed {
            Deed::Press => {
                let depth = goes(0.05, 0.05, 0.009) - 0.001;
                let axis = Shape::Capsule { length: 0.1, radius: 0.005 };
                vec![at(axis, vec3(2e-3, 1e-3, 0.035 - depth), vec3(0.2, 0.0, 0.0))]
            }
            Deed::Rub => {
                let depth = goes(0.05, 0.05, 0.006) - 0.001;
                let aside = goes(0.3, 0.05, 0.025);
                vec![ball(0.008, vec3(-0.012 + aside, 1e-3 + 0.4 * aside, 0.038 - depth))]
            }
            Deed::Tap => {
                let depth = 2e-3 - 4e-3 * libm::cos(2.0 * std::f64::consts::PI * 4.0 * time);
                vec![ball(0.008, vec3(1e-3, 2e-3, 0.038 - depth))]
            }
            Deed::Grasp => {
                let closed = goes(0.05, 0.04, 0.004);
                let (lifted, turned) = (goes(0.3, 0.05, 0.006), goes(0.5, 2.0, 0.5));
                [-1.0, 1.0]
                    .map(|side: f64| {
                        let (sine, cosine) = (libm::sin(turned), libm::cos(turned));
                        let arm = side * (0.006 + 0.008 + 0.001 - closed);
                        ball(0.008, vec3(-sine * arm, cosine * arm, 0.02 + lifted))
                    })
                    .to_vec()
            }
            Deed::Lift | Deed::Drop => {
                let half_size = vec3(0.004, 0.015, 0.002);
                let shape = Shape::RoundedBox { half: half_size, radius: 0.002 };
                let lifted = goes(0.1, 0.06, 0.02);
                vec![at(shape, vec3(0.03, 0.0, -0.018 + lifted), vec3(0.0, 0.1, 0.0))]
            }
            Deed::Shake => {
                let sway =
                    3e-3 * libm::sin(2.0 * std::f64::consts::PI * 3.0 * (time - 0.1).max(0.0));
                vec![at(Shape::HalfSpace, vec3(sway, 0.4 * sway, -0.95e-3), Vec3::ZERO)]
            }
        }
    }

    /// By the library, with what forces are said to be off by.
    pub fn run(&self, way: &Way) -> Result<Course> {
        let settings = way.settings();
        if way.single {
            self.run_in::<f32>(&settings, true)
        } else {
            self.run_in::<f64>(&settings, true)
        }
    }

    /// By explicit steps in double precision, tools moving steadily in so many parts of every frame.
    pub fn truth(&self, substeps: u32) -> Result<Course> {
        let usual = Way::of(Method::Explicit).settings();
        let settings = SolverSettings { substeps: Count::Of(substeps), ..usual };
        self.run_in::<f64>(&settings, false)
    }

    /// By so many small implicit steps of every frame in double precision.
    pub fn implicit(&self, substeps: u32) -> Result<Course> {
        let settings = SolverSettings {
            substeps: Count::Of(substeps),
            iterations: Count::Of(TRUE_ITERATIONS),
            ..Way::of(Method::QuasiNewton).settings()
        };
        self.run_in::<f64>(&settings, false)
    }

    fn run_in<S: Real>(&self, settings: &SolverSettings, with_errors: bool) -> Result<Course> {
        let model = self.model::<S>()?;
        let mut solver = Solver::new(&model, settings);
        let mut state = State::at_rest(&model);
        let mut inputs = self.inputs::<S>(0.0);
        state.contact = ContactState::of(&inputs.tools);
        // As simulations do where nothing but tools holds a body.
        let least = if self.fixed.is_empty() { 2 } else { 1 };
        let substeps = solver.substeps(&inputs, FRAME).max(least);
        let mut shadow = with_errors.then(|| Shadow::new(&model, settings, &state));
        let mut course = Course::default();
        for frame in 0..self.frames() {
            let act = |count: u32| {
                let dt = FRAME / f64::from(count);
                move |substep: u32, inputs: &mut Inputs<S>| {
                    *inputs = self.inputs(f64::from(frame) * FRAME + f64::from(substep) * dt);
                }
            };
            let dt = |count: u32| FRAME / f64::from(count);
            solver.steps(&model, &mut state, &mut inputs, dt(substeps), substeps, act(substeps))?;
            let wrenches = solver.wrenches();
            course.forces.push(wrenches.iter().map(|wrench| wrench.force).collect());
            if let Some(shadow) = &mut shadow {
                let count = Shadow::<S>::count(substeps);
                if state.contact.touches.is_empty() {
                    shadow.follow(&state);
                }
                shadow.steps(&model, &mut inputs, dt(count), count, act(count))?;
                let all = wrenches.iter().zip(shadow.wrenches());
                let off = all.map(|(a, b)| Shadow::<S>::error(substeps, a.force, b.force));
                course.errors.push(off.collect());
            }
        }
        let steps = f64::from(substeps * self.frames());
        course.rejected = solver.rejected_steps() as f64 / steps;
        Ok(course)
    }
}
