//! A ball that is pressed into a block, by the reference and by the library.

use anyhow::{Context as _, Result};
use viscera::contact::{ContactLaw, Sample, Shape, Tool, Wrench, sample_boundary};
use viscera::material::Material;
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::Block;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

use super::{Way, select};
use crate::load_cases::{FRAME_RATE, NEAR};
use crate::settling::{FRAMES, KEPT_VELOCITY};
use viscera_reference::Reference;

/// Frames in which the ball goes down.
const PATH_FRAMES: u32 = 20;

/// A body is at rest below this root mean square speed [m/s]: what swings ten times a second is then 0.03 micrometres
/// from its place.
const STILL: f64 = 2e-6;

/// Frames at most: the explicit method, which has no damping of its own, swings on under deep contact.
const MOST_FRAMES: u32 = 5 * FRAMES;

/// Parts of the way that the reference takes one after the other.
const PARTS: u32 = 4;

/// A ball that is pressed from above into a body that is held below.
#[derive(Clone, Debug)]
pub struct Pressing {
    /// The body at rest.
    pub mesh: TetMesh,
    /// Pinned where they are.
    pub fixed: Vec<u32>,
    /// What it is made of.
    pub tissue: Material,
    /// [m/s^2].
    pub gravity: Vec3<f64>,
    /// Samples of each triangle of the surface.
    pub samples: Sampling,
    /// Of the ball [m].
    pub radius: f64,
    /// How it meets the tissue.
    pub law: ContactLaw,
    /// Over which point of the top the ball is [m].
    pub over: Vec3<f64>,
    /// How far its lowest point is below the top at the end [m].
    pub depth: f64,
}

/// Samples of a triangle: the middles of its parts of equal area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// The library's, `4^cuts`.
    Cut(u32),
    /// Nine, each edge in three.
    Nine,
}

/// Where a body is at rest.
#[derive(Clone, Debug)]
pub struct Rest {
    /// [m], shape [vertex_count].
    pub positions: Vec<Vec3<f64>>,
    /// On the ball.
    pub wrench: Wrench,
    /// Newton steps, or the share of the steps that the guard has rejected.
    pub effort: f64,
    /// Frames until it was at rest; none of the reference.
    pub frames: u32,
}

impl Rest {
    /// With which the tissue pushes the ball up [N].
    pub fn force(&self) -> f64 {
        self.wrench.force.z
    }
}

impl Pressing {
    /// On the middle of a block of cubes with this edge [m]; without friction, gravity or depth.
    pub fn on_block(cells: [usize; 3], edge: f64, radius: f64, tissue: Material) -> Result<Self> {
        let size = Vec3::from_f64(cells.map(|count| edge * count as f64));
        let mesh = Block::new(size, cells).mesh()?;
        Ok(Self {
            fixed: select(&mesh, |x| x.z < NEAR),
            mesh,
            tissue,
            gravity: Vec3::ZERO,
            samples: Sampling::Cut(1),
            radius,
            law: ContactLaw { friction: 0.0, ..ContactLaw::default() },
            over: vec3(0.5 * size.x, 0.5 * size.y, size.z),
            depth: 0.0,
        })
    }

    /// Its model.
    pub fn model<S: Real>(&self) -> Result<Model<S>> {
        let mut builder = ModelBuilder::new();
        builder.add_body(&self.mesh, &self.tissue)?;
        match self.samples {
            Sampling::Cut(cuts) => builder.sample_surface(cuts),
            Sampling::Nine => builder.set_samples(nine(&self.mesh))?,
        }
        Ok(builder.build()?)
    }

    /// With the ball a share of the way down; at none its lowest point is at the top.
    pub fn inputs<S: Real>(&self, share: f64) -> Inputs<S> {
        let rest = self.mesh.vertices();
        let pin = |&vertex: &u32| Pin { vertex, target: rest[vertex as usize].cast() };
        let pins = self.fixed.iter().map(pin).collect();
        let middle = self.over + vec3(0.0, 0.0, self.radius - share * self.depth);
        let tool = Tool {
            pose: RigidTransform { translation: middle, ..RigidTransform::IDENTITY },
            law: self.law,
            ..Tool::new(Shape::Sphere { radius: self.radius })
        };
        Inputs { gravity: self.gravity.cast(), pins, tools: vec![tool], ..Inputs::default() }
    }

    /// At rest by Newton's method, the way down in parts.
    pub fn truth(&self) -> Result<Rest> {
        let model = self.model::<f64>()?;
        self.truth_from(&model.rest_positions, PARTS)
    }

    /// The same from places [m], with the way down in so many parts.
    pub fn truth_from(&self, start: &[Vec3<f64>], parts: u32) -> Result<Rest> {
        let mut reference = Reference::new(&self.model::<f64>()?);
        let mut positions = start.to_vec();
        let mut steps = 0;
        for part in 1..=parts {
            let inputs = self.inputs(f64::from(part) / f64::from(parts));
            let what = || format!("the reference, {} mm deep", 1e3 * self.depth);
            let solution = reference.settle(&positions, &inputs).with_context(what)?;
            positions = solution.positions;
            steps += solution.convergence.steps;
        }
        let wrench = reference.wrenches(&positions, &self.inputs(1.0), &[])?[0];
        Ok(Rest { positions, wrench, effort: f64::from(steps), frames: 0 })
    }

    /// At rest by the library: the ball goes down, then velocities die down.
    pub fn settle(&self, way: &Way) -> Result<Rest> {
        if way.single { self.settle_in::<f32>(way) } else { self.settle_in::<f64>(way) }
    }

    fn settle_in<S: Real>(&self, way: &Way) -> Result<Rest> {
        let model = self.model::<S>()?;
        let mut solver = Solver::new(&model, &way.settings());
        let mut state = State::at_rest(&model);
        let frame_time = 1.0 / FRAME_RATE;
        let substeps = solver.substeps(&self.inputs(0.0), frame_time);
        let dt = frame_time / f64::from(substeps);
        // Not all at once where the frame ends: what swings thirty times a second may stand still just there.
        let kept = S::from_f64(KEPT_VELOCITY.powf(1.0 / f64::from(substeps)));
        let (mut frame, mut speed) = (0, f64::INFINITY);
        while frame < FRAMES || frame < MOST_FRAMES && speed > STILL {
            let mut fastest = 0.0_f64;
            for substep in 1..=substeps {
                let time = f64::from(frame) + f64::from(substep) / f64::from(substeps);
                let inputs = self.inputs((time / f64::from(PATH_FRAMES)).min(1.0));
                solver.step(&model, &mut state, &inputs, dt)?;
                let squares: f64 =
                    state.velocities.iter().map(|v| v.length_squared().to_f64()).sum();
                fastest = fastest.max(squares / state.velocities.len() as f64);
                state.velocities.iter_mut().for_each(|velocity| *velocity = *velocity * kept);
            }
            frame += 1;
            speed = fastest.sqrt();
        }
        let steps = f64::from(frame) * f64::from(substeps);
        Ok(Rest {
            positions: state.positions.iter().map(|x| x.cast()).collect(),
            wrench: solver.wrenches().first().copied().unwrap_or_default(),
            effort: solver.rejected_steps() as f64 / steps,
            frames: frame,
        })
    }

    /// Largest distance of vertices from true places, over the largest true displacement.
    pub fn shape_error(&self, truth: &Rest, ours: &Rest) -> f64 {
        let distance = |a: &[Vec3<f64>], b: &[Vec3<f64>]| {
            a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
        };
        distance(&truth.positions, &ours.positions)
            / distance(&truth.positions, self.mesh.vertices())
    }
}

/// Nine samples of each triangle, with the library's measure of edges: of the three vertices' by weight.
fn nine(mesh: &TetMesh) -> Vec<Sample> {
    // Twice cut, the parts at the corners have weights of 5/6 and 1/12 twice: they tell the edges there.
    let sixteen = sample_boundary(mesh.tets(), mesh.vertices(), 2);
    let mut samples = Vec::new();
    for of_triangle in sixteen.chunks(16) {
        let at_corner = |corner: usize| {
            let is_there = |sample: &&Sample| sample.weights[corner] > 0.8;
            of_triangle.iter().find(is_there).map_or(0.0, |sample| sample.edge)
        };
        let measured = [0, 1, 2].map(at_corner);
        let sum: f64 = measured.iter().sum();
        // measured = e/12 + (5/6 - 1/12) own, and e, the sum of all three, is that of the measured.
        let edges = measured.map(|edge| (edge - sum / 12.0) / 0.75);
        for i in 0..3 {
            for j in 0..3 - i {
                let upright = [i as f64 + 1.0 / 3.0, j as f64 + 1.0 / 3.0];
                let turned = [i as f64 + 2.0 / 3.0, j as f64 + 2.0 / 3.0];
                let parts = if i + j < 2 { vec![upright, turned] } else { vec![upright] };
                for [a, b] in parts {
                    let weights = [a / 3.0, b / 3.0, 1.0 - (a + b) / 3.0, 0.0];
                    let edge = weights.iter().zip(edges).map(|(weight, edge)| weight * edge).sum();
                    let area = of_triangle[0].area * 16.0 / 9.0;
                    samples.push(Sample { weights, area, edge, ..of_triangle[0] });
                }
            }
        }
    }
    samples
}
