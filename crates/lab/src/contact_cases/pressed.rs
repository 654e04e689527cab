//! Two blocks of tissue that are pressed together, by the library and by truths that know nothing of pairs.
//!
//! ```text
//! mirror images:   d = 2 d',  p = k/2 (dh - d) = k (dh/2 - d')       d' to the plane between, k that of either
//! unlike columns:  F/A = w/(L_1/E_1 + L_2/E_2 + 1/k_1 + 1/k_2)       w: way beyond the touch, nu = 0
//! ```
//!
//! So a block that meets its mirror image with the stiffness `k` and the thickness `dh` is at rest as it is on a rigid plane in
//! the middle, with `k` and `dh/2`: the second stage of the law, which begins at half of the thickness, as well. The plane is a tool,
//! and contact with tools is what the Newton reference has. Where the surface is tilted by an angle `a` against the plane, the
//! nearest point of the image is nearer than the mirrored one by `1 - cos a`: that much, `a^2/2` of the thickness, the two may differ.

use anyhow::Result;
use viscera::contact::{ContactLaw, Shape, TissueContact, Tool};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::Block;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

use super::{Way, select};
use crate::load_cases::{FRAME_RATE, NEAR, tissue};
use crate::settling::{FRAMES, KEPT_VELOCITY};
use viscera_reference::Reference;

/// Frames in which the bodies are brought together.
const PATH_FRAMES: u32 = 40;

/// Parts of the way that the reference takes one after the other.
const PARTS: u32 = 4;

/// Two bodies, of which the first vertices of all are the lower one's.
#[derive(Clone, Debug)]
pub struct Pressed {
    /// Lower and upper, at rest.
    pub meshes: [TetMesh; 2],
    /// Of each.
    pub tissues: [Material; 2],
    /// Vertices of each by which it is held.
    pub held: [Vec<u32>; 2],
    /// How the two meet.
    pub law: ContactLaw,
    /// Between the two at rest [m].
    pub gap: f64,
    /// By which each is moved towards the other [m].
    pub ways: [f64; 2],
}

/// Where the two are at rest.
#[derive(Clone, Debug)]
pub struct Together {
    /// Of the lower body [m].
    pub positions: Vec<Vec3<f64>>,
    /// By which the holders push the bodies together [N]: the lower one upwards, the upper one downwards.
    pub forces: [f64; 2],
    /// Share of the steps that the guard has rejected.
    pub rejected: f64,
}

/// A block and its image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// By its whole back.
    Back,
    /// By the middle of its back, so that its rim gives way.
    Middle,
}

impl Pressed {
    /// A block of 30 x 30 x 15 mm, of so many cells along its height, and its mirror image, pressed together by `depth` [m].
    pub fn mirrored(cells: usize, held: Held, young: f64, depth: f64) -> Result<Self> {
        let size = vec3(0.03, 0.03, 0.015);
        let mesh = Block::new(size, [2 * cells, 2 * cells, cells]).mesh()?;
        let law = ContactLaw { friction: 0.0, ..ContactLaw::default() };
        let gap = 1.2 * law.thickness;
        let image = vertices_of(&mesh, |x| vec3(x.x, x.y, 2.0 * size.z + gap - x.z), true)?;
        let middle = vec3(0.5 * size.x, 0.5 * size.y, 0.0);
        let is_held = |x: Vec3<f64>| {
            let across = x - middle;
            let is_near = across.x.abs() < 0.25 * size.x && across.y.abs() < 0.25 * size.y;
            x.z < NEAR && (held == Held::Back || is_near)
        };
        let held = select(&mesh, is_held);
        let tissue = tissue(MaterialModel::StableNeoHookean, young, 0.45)?;
        let tissue = tissue.with_viscosity(VISCOSITY)?;
        let way = 0.5 * (gap - law.thickness + depth);
        Ok(Self {
            meshes: [mesh, image],
            tissues: [tissue, tissue],
            held: [held.clone(), held],
            law,
            gap,
            ways: [way, way],
        })
    }

    /// Columns of 20 x 20 mm, 20 and 12 mm high, of 10 and 20 kPa without Poisson's ratio, held by their ends.
    pub fn columns(law: ContactLaw, way: f64) -> Result<Self> {
        let gap = 1.02 * law.thickness;
        let lower = Block::new(vec3(0.02, 0.02, HEIGHTS[0]), [4, 4, 4]).mesh()?;
        let upper = Block::new(vec3(0.02, 0.02, HEIGHTS[1]), [4, 4, 3]).mesh()?;
        let upper = vertices_of(&upper, |x| x + vec3(0.0, 0.0, HEIGHTS[0] + gap), false)?;
        let top = HEIGHTS[0] + gap + HEIGHTS[1];
        let held = [select(&lower, |x| x.z < NEAR), select(&upper, |x| x.z > top - NEAR)];
        let [soft, stiff] = YOUNGS.map(|young| tissue(MaterialModel::StableNeoHookean, young, 0.0));
        let (meshes, tissues) = ([lower, upper], [soft?, stiff?]);
        Ok(Self { meshes, tissues, held, law, gap, ways: [0.0, way + gap - law.thickness] })
    }

    /// The force [N] of columns in the closed form, from the mean edge of a face of squares, each cut along a diagonal.
    pub fn closed_form(law: &ContactLaw, way: f64) -> f64 {
        let edge = 5e-3 * (2.0 + 2f64.sqrt()) / 3.0;
        let softness = |i: usize| (HEIGHTS[i] + edge / law.stiffness) / YOUNGS[i];
        0.02 * 0.02 * way / (softness(0) + softness(1))
    }

    fn model<S: Real>(&self) -> Result<Model<S>> {
        let mut builder = ModelBuilder::new();
        for (mesh, tissue) in self.meshes.iter().zip(&self.tissues) {
            builder.add_body(mesh, tissue)?;
        }
        builder.touch_tissue(&TissueContact { itself: false, bodies: true, law: self.law })?;
        Ok(builder.build()?)
    }

    /// With the bodies a share of their way together.
    fn inputs<S: Real>(&self, share: f64) -> Inputs<S> {
        let mut pins = Vec::new();
        let mut first = 0;
        for (body, mesh) in self.meshes.iter().enumerate() {
            let way = share * self.ways[body] * if body == 0 { 1.0 } else { -1.0 };
            pins.extend(self.held[body].iter().map(|&v| {
                let target = mesh.vertices()[v as usize] + vec3(0.0, 0.0, way);
                Pin { vertex: first + v, target: target.cast() }
            }));
            first += mesh.vertices().len() as u32;
        }
        Inputs { pins, ..Inputs::default() }
    }

    /// At rest by the library: brought together, then velocities die down.
    pub fn settle(&self, way: &Way) -> Result<Together> {
        if way.single { self.settle_in::<f32>(way) } else { self.settle_in::<f64>(way) }
    }

    fn settle_in<S: Real>(&self, way: &Way) -> Result<Together> {
        let model = self.model::<S>()?;
        let mut solver = Solver::new(&model, &way.settings());
        let mut state = State::at_rest(&model);
        let frame_time = 1.0 / FRAME_RATE;
        let substeps = solver.substeps(&self.inputs(0.0), frame_time);
        let dt = frame_time / f64::from(substeps);
        let kept = S::from_f64(KEPT_VELOCITY.powf(1.0 / f64::from(substeps)));
        for frame in 0..FRAMES {
            for substep in 1..=substeps {
                let time = f64::from(frame) + f64::from(substep) / f64::from(substeps);
                let inputs = self.inputs((time / f64::from(PATH_FRAMES)).min(1.0));
                solver.step(&model, &mut state, &inputs, dt)?;
                if (frame, substep) != (FRAMES - 1, substeps) {
                    state.velocities.iter_mut().for_each(|velocity| *velocity = *velocity * kept);
                }
            }
        }
        let mut balance = ForceBalance::default();
        let inputs = self.inputs(1.0);
        solver.force_balance(&model, &state, &inputs, &mut balance)?;
        let first = self.meshes[0].vertices().len();
        let mut forces = [0.0; 2];
        for pin in &inputs.pins {
            let force = balance.residual[pin.vertex as usize].z;
            let body = usize::from(pin.vertex as usize >= first);
            forces[body] += if body == 0 { force } else { -force };
        }
        let steps = f64::from(FRAMES) * f64::from(substeps);
        Ok(Together {
            positions: state.positions[..first].iter().map(|x| x.cast()).collect(),
            forces,
            rejected: solver.rejected_steps() as f64 / steps,
        })
    }

    /// The lower one of two mirror images, by Newton's method, against the plane between them.
    pub fn truth(&self) -> Result<Together> {
        let mut builder = ModelBuilder::new();
        builder.add_body(&self.meshes[0], &self.tissues[0])?;
        // One sample of each triangle, as tissue has against tissue.
        builder.sample_surface(0);
        let mut reference = Reference::new(&builder.build()?);
        let mut positions = self.meshes[0].vertices().to_vec();
        let top = positions.iter().fold(0.0, |top, x| f64::max(top, x.z));
        // Turned about x, so that it is solid above.
        let plane = RigidTransform::about(
            Vec3::ZERO,
            vec3(std::f64::consts::PI, 0.0, 0.0),
            vec3(0.0, 0.0, top + 0.5 * self.gap),
        );
        let law = ContactLaw { thickness: 0.5 * self.law.thickness, ..self.law };
        let tool = Tool { pose: plane, law, ..Tool::new(Shape::HalfSpace) };
        let own = self.held[0].len();
        let inputs = |part: u32| {
            let mut inputs = self.inputs::<f64>(f64::from(part) / f64::from(PARTS));
            inputs.pins.truncate(own);
            inputs.tools = vec![tool.clone()];
            inputs
        };
        for part in 1..=PARTS {
            positions = reference.settle(&positions, &inputs(part))?.positions;
        }
        let force = reference.wrenches(&positions, &inputs(PARTS), &[])?[0].force.z;
        Ok(Together { positions, forces: [force; 2], rejected: 0.0 })
    }

    /// Largest distance of the lower body's vertices from true places, over how far it is pressed in there: the way of its holder
    /// less that of its face.
    pub fn shape_error(&self, truth: &Together, ours: &Together) -> f64 {
        let rest = self.meshes[0].vertices();
        let way = vec3(0.0, 0.0, self.ways[0]);
        let apart = |a: &[Vec3<f64>], b: &[Vec3<f64>]| {
            a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
        };
        let moved: Vec<Vec3<f64>> = rest.iter().map(|x| *x + way).collect();
        apart(&truth.positions, &ours.positions) / apart(&truth.positions, &moved)
    }
}

/// Retardation time [s]. Of no account at rest; blocks without any, and without friction, do not come to rest by explicit and by
/// quasi-Newton steps: pairs that are found anew in every step give them energy.
const VISCOSITY: f64 = 0.01;

/// Heights [m] and moduli [Pa] of the columns.
const HEIGHTS: [f64; 2] = [0.02, 0.012];
const YOUNGS: [f64; 2] = [1e4, 2e4];

/// A mesh with its vertices elsewhere; turned inside out where it is an image in a mirror.
fn vertices_of(
    mesh: &TetMesh,
    to: impl Fn(Vec3<f64>) -> Vec3<f64>,
    image: bool,
) -> Result<TetMesh> {
    let vertices = mesh.vertices().iter().map(|x| to(*x)).collect();
    let turned = |&[a, b, c, d]: &[u32; 4]| if image { [b, a, c, d] } else { [a, b, c, d] };
    let tets = mesh.tets().iter().map(turned).collect();
    Ok(TetMesh::new(vertices, tets, mesh.regions().to_vec())?.0)
}
