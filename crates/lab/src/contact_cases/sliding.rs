//! A block on an inclined plane: whether it holds, creeps or slides.
//!
//! ```text
//! holds below atan(mu), slides above with  g (sin(angle) - mu cos(angle))
//! ```
//!
//! The plane is tilted about two axes from the beginning, and the body with it. Gravity turns from the plane's normal
//! to straight down while velocities die down, so that nothing swings; then everything is let go.

use anyhow::Result;
use viscera::contact::{ContactLaw, Shape, Tool};
use viscera::material::Material;
use viscera::mesh::shapes::Block;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::rigid::{RigidTransform, rotation_matrix};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

use super::Way;
use crate::load_cases::{FRAME_RATE, GRAVITY};
use crate::settling::KEPT_VELOCITY;
use viscera_reference::Reference;

/// Frames in which gravity turns, and in which the body comes to rest after that, if it does.
const TURNING: u32 = 30;
const RESTING: u32 = 30;

/// Frames after the body is let go that are left out of the acceleration.
const SKIPPED: usize = 6;

/// A block on a plane.
#[derive(Clone, Debug)]
pub struct Sliding {
    /// Edges [m].
    pub size: Vec3<f64>,
    /// Boxes along each.
    pub cells: [usize; 3],
    /// What the block is made of.
    pub tissue: Material,
    /// How it meets the plane.
    pub law: ContactLaw,
    /// Of the plane against the horizontal [rad].
    pub angle: f64,
    /// Frames for which it is let go.
    pub frames: u32,
}

/// What a block on a plane does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slide {
    /// Down the plane [m/s^2], by least squares over the mean velocities of frames.
    pub acceleration: f64,
    /// By which the block's middle has moved along the plane in the frames that count [m].
    pub way: f64,
    /// Tangential over normal force of the plane at the end.
    pub ratio: f64,
    /// Share of the steps that the guard has rejected since the block was let go.
    pub rejected: f64,
}

impl Sliding {
    /// The way the plane is tilted: about two axes of the world at once.
    fn pose(&self) -> RigidTransform {
        let axis = vec3(0.5 * 3f64.sqrt(), 0.5, 0.0);
        RigidTransform {
            rotation: rotation_matrix(axis * self.angle),
            translation: vec3(0.01, -0.02, 0.03),
        }
    }

    /// Down the plane, of length 1.
    fn slope(&self) -> Vec3<f64> {
        let normal = self.pose().turn(vec3(0.0, 0.0, 1.0));
        let down = GRAVITY - normal * normal.dot(GRAVITY);
        down * (1.0 / down.length())
    }

    /// Acceleration [m/s^2] of a block that slides as Coulomb's law says.
    pub fn exact(&self) -> f64 {
        GRAVITY.length() * (libm::sin(self.angle) - self.law.friction * libm::cos(self.angle))
    }

    /// Its model.
    pub fn model<S: Real>(&self) -> Result<Model<S>> {
        let corner = vec3(-0.5 * self.size.x, -0.5 * self.size.y, self.law.thickness);
        let upright = Block { corner, ..Block::new(self.size, self.cells) }.mesh()?;
        let pose = self.pose();
        let places = upright.vertices().iter().map(|x| pose.apply(*x)).collect();
        let (tets, regions) = (upright.tets().to_vec(), upright.regions().to_vec());
        let mesh = viscera::mesh::TetMesh::new(places, tets, regions)?.0;
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &self.tissue)?;
        builder.sample_surface(1);
        Ok(builder.build()?)
    }

    /// With gravity a share of the way from the plane's normal to straight down.
    pub fn inputs<S: Real>(&self, share: f64) -> Inputs<S> {
        let pose = self.pose();
        let normal = pose.turn(vec3(0.0, 0.0, 1.0));
        let angle = share.min(1.0) * self.angle;
        let (along, across) = (self.slope() * libm::sin(angle), normal * -libm::cos(angle));
        let gravity = (along + across) * GRAVITY.length();
        let tool = Tool { pose, law: self.law, ..Tool::new(Shape::HalfSpace) };
        Inputs { gravity: gravity.cast(), tools: vec![tool], ..Inputs::default() }
    }

    /// By the library.
    pub fn slide(&self, way: &Way) -> Result<Slide> {
        self.slide_watched(way, &mut || ())
    }

    /// The same; `after` is called after each frame.
    pub fn slide_watched(&self, way: &Way, after: &mut dyn FnMut()) -> Result<Slide> {
        if way.single { self.slide_in::<f32>(way, after) } else { self.slide_in::<f64>(way, after) }
    }

    fn slide_in<S: Real>(&self, way: &Way, after: &mut dyn FnMut()) -> Result<Slide> {
        let model = self.model::<S>()?;
        let mut solver = Solver::new(&model, &way.settings());
        let mut state = State::at_rest(&model);
        let frame_time = 1.0 / FRAME_RATE;
        let substeps = solver.substeps(&self.inputs(0.0), frame_time);
        let dt = frame_time / f64::from(substeps);
        let masses: Vec<f64> = model.masses.iter().map(|mass| mass.to_f64()).collect();
        let mut course = Course::new(self, &masses);
        let mut rejected = 0;
        for frame in 0..TURNING + RESTING + self.frames {
            let is_free = frame >= TURNING + RESTING;
            for substep in 1..=substeps {
                let time = f64::from(frame) + f64::from(substep) / f64::from(substeps);
                let inputs = self.inputs(time / f64::from(TURNING));
                solver.step(&model, &mut state, &inputs, dt)?;
            }
            after();
            if is_free {
                course.add(&state);
            } else {
                damp(&mut state);
                rejected = solver.rejected_steps();
            }
        }
        let steps = f64::from(substeps) * f64::from(self.frames);
        let force = solver.wrenches().first().map_or(Vec3::ZERO, |wrench| wrench.force);
        Ok(course.end(force, (solver.rejected_steps() - rejected) as f64 / steps))
    }

    /// By exact implicit Euler with so many steps per frame.
    pub fn truth(&self, substeps: u32) -> Result<Slide> {
        let model = self.model::<f64>()?;
        let mut reference = Reference::new(&model);
        let mut state = State::at_rest(&model);
        let dt = 1.0 / FRAME_RATE / f64::from(substeps);
        let mut course = Course::new(self, &model.masses);
        let (mut touched, mut force) = (Vec::new(), Vec3::ZERO);
        for frame in 0..TURNING + RESTING + self.frames {
            for substep in 1..=substeps {
                let time = f64::from(frame) + f64::from(substep) / f64::from(substeps);
                let inputs = self.inputs(time / f64::from(TURNING));
                reference.step_touching(&mut state, &inputs, &touched, dt)?;
                force = reference.wrenches(&state.positions, &inputs, &touched)?[0].force;
                touched = reference.touched_after(&state.positions, &inputs, &touched)?;
            }
            if frame >= TURNING + RESTING { course.add(&state) } else { damp(&mut state) }
        }
        Ok(course.end(force, 0.0))
    }
}

fn damp<S: Real>(state: &mut State<S>) {
    for velocity in &mut state.velocities {
        *velocity = *velocity * S::from_f64(KEPT_VELOCITY);
    }
}

/// Places and speeds of a block's middle along the plane, frame by frame.
struct Course<'a> {
    masses: &'a [f64],
    slope: Vec3<f64>,
    normal: Vec3<f64>,
    places: Vec<f64>,
    speeds: Vec<f64>,
}

impl<'a> Course<'a> {
    fn new(sliding: &Sliding, masses: &'a [f64]) -> Self {
        let normal = sliding.pose().turn(vec3(0.0, 0.0, 1.0));
        Self { masses, slope: sliding.slope(), normal, places: Vec::new(), speeds: Vec::new() }
    }

    fn add<S: Real>(&mut self, state: &State<S>) {
        let mean = |values: &[Vec3<S>]| {
            let sum = values.iter().zip(self.masses);
            let sum: f64 = sum.map(|(x, mass)| mass * x.cast::<f64>().dot(self.slope)).sum();
            sum / self.masses.iter().sum::<f64>()
        };
        let (place, speed) = (mean(&state.positions), mean(&state.velocities));
        self.places.push(place);
        self.speeds.push(speed);
    }

    fn end(&self, force: Vec3<f64>, rejected: f64) -> Slide {
        let first = SKIPPED.min(self.places.len().saturating_sub(2));
        let counted = &self.speeds[first..];
        let middle = 0.5 * (counted.len() - 1) as f64;
        let (mut moment, mut square) = (0.0, 0.0);
        for (frame, speed) in counted.iter().enumerate() {
            let from_middle = frame as f64 - middle;
            moment += from_middle * speed;
            square += from_middle * from_middle;
        }
        let along = self.normal * self.normal.dot(force);
        Slide {
            acceleration: moment / square * FRAME_RATE,
            way: self.places[self.places.len() - 1] - self.places[first],
            ratio: (force - along).length() / along.length(),
            rejected,
        }
    }
}
