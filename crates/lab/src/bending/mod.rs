//! Loads that show whether a mesh is as stiff as the body that it stands for, on linear, recovered-gradient and
//! quadratic tetrahedra.
//!
//! | load | response |
//! |---|---|
//! | sag | a body held at one end sinks under its weight: mean of the free end, or of an organ's mass [m] |
//! | twist | a bar's free end is turned about its axis: angle over torque [1/(N m)] |
//! | press | a quarter of a block's top is pressed by a pressure: mean indentation [m] |
//!
//! | file | what |
//! |---|---|
//! | `bodies` | shapes and the meshes they are filled with |
//! | `truth` | the response of the body itself |
//! | `pressure` | how rough the pressure is |

pub mod bodies;
pub mod pressure;
pub mod truth;

use std::fmt;

use anyhow::{Context as _, Result, ensure};
use viscera::layout::Smoothing;
use viscera::material::{Material, MaterialModel};
use viscera::mesh::topology::{boundary_surface, edges};
use viscera::model::ModelBuilder;
use viscera::scalar::{Vec3, vec3};
use viscera::solver::{Inputs, Pin};

use crate::load_cases::{DrivenPath, GRAVITY, tissue};
use bodies::{BAR, Body, NEAR, Shape};
use viscera_reference::Reference;

/// Young's modulus [Pa].
pub const YOUNG: f64 = 5e4;

/// Young's modulus of the second material over that of the first.
const STIFFER: f64 = 10.0;

/// Pressure on the block over Young's modulus, turn [rad] and share of the weight of loads at which everything is linear
/// to a thousandth.
const SMALL: f64 = 1e-3;

/// What a tetrahedron is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Element {
    /// Linear.
    Linear,
    /// Averaged or recovered.
    Smooth(Smoothing),
    /// Ten vertices.
    Quadratic,
}

/// What acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// A share of gravity.
    Sag(f64),
    /// An angle [rad].
    Twist(f64),
    /// A pressure over Young's modulus.
    Press(f64),
}

impl Load {
    /// Bending, twist and press at which everything is linear.
    pub const SMALL: [Self; 3] = [Self::Sag(SMALL), Self::Twist(SMALL), Self::Press(SMALL)];

    /// Parts of it after which a body comes to rest, one after the other: fewer Newton steps in all, and no other
    /// minimum.
    fn parts(self) -> &'static [f64] {
        let (Self::Sag(size) | Self::Twist(size) | Self::Press(size)) = self;
        if size <= SMALL { &[1.0] } else { &[0.3, 0.65, 1.0] }
    }
}

impl fmt::Display for Load {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Sag(_) => "bending",
            Self::Twist(_) => "twist",
            Self::Press(_) => "press",
        };
        let size = if self.parts().len() == 1 { "small" } else { "large" };
        write!(f, "{size} {name}")
    }
}

/// A body of one kind of element.
struct Loaded<'a> {
    body: &'a Body,
    reference: Reference,
    /// Ascending pairs, in the order of the reference's vertices after the mesh's, where it has them.
    edges: Option<Vec<[u32; 2]>>,
}

impl<'a> Loaded<'a> {
    /// Of stable neo-Hookean tissue.
    fn new(body: &'a Body, element: Element, poisson: f64) -> Result<Self> {
        let of = |young| tissue(MaterialModel::StableNeoHookean, young, poisson);
        let (soft, stiff) = (of(YOUNG)?, of(STIFFER * YOUNG)?);
        Self::of_tissues(body, element, &soft, &stiff)
    }

    fn of_tissues(
        body: &'a Body,
        element: Element,
        soft: &Material,
        stiff: &Material,
    ) -> Result<Self> {
        let linear = || {
            let mut builder = ModelBuilder::new();
            let number = builder.add_body(&body.mesh, soft)?;
            builder.set_region_material(number, 1, stiff)?;
            builder.build::<f64>().context("a body that bends")
        };
        let (reference, edges) = match element {
            Element::Linear => (Reference::new(&linear()?), None),
            Element::Smooth(smoothing) => (Reference::recovered(&linear()?, smoothing), None),
            Element::Quadratic => {
                let reference = Reference::quadratic_of_two(&body.mesh, soft, stiff);
                (reference, Some(edges(&body.mesh)))
            }
        };
        Ok(Self { body, reference, edges })
    }

    fn rest(&self) -> &[Vec3<f64>] {
        &self.reference.problem().rest_positions
    }

    /// Vertices and middles of edges that are held.
    fn held(&self) -> Vec<u32> {
        let held = self.body.held.iter().copied();
        let between = |ends: &[u32; 2]| ends.iter().all(|&v| self.body.held[v as usize]);
        let held = held.chain(self.edges.iter().flatten().map(between));
        (0..).zip(held).filter(|(_, held)| *held).map(|(v, _)| v).collect()
    }

    /// Where a boundary face's uniform traction acts and its mean displacement is read, with the share of its area
    /// [m^2]: its corners, or on quadratic tetrahedra, whose corners carry none, the middles of its edges.
    fn face_points(&self) -> Vec<(u32, f64)> {
        let mesh = &self.body.mesh;
        let boundary = boundary_surface(mesh);
        let mut points = Vec::new();
        for triangle in &boundary.surface.triangles {
            let corners = triangle.map(|v| boundary.mesh_vertices[v as usize]);
            let [a, b, c] = corners.map(|v| mesh.vertices()[v as usize]);
            if [a, b, c].iter().all(|&x| self.body.is_read(x)) {
                let area = 0.5 * (b - a).cross(c - a).length();
                let [p, q, r] = corners;
                let carriers = match &self.edges {
                    None => corners,
                    Some(edges) => [[p, q], [q, r], [r, p]].map(|[v, w]| {
                        // Every edge of the mesh is in the list.
                        let place = edges.binary_search(&[v.min(w), v.max(w)]).unwrap_or_default();
                        (mesh.vertices().len() + place) as u32
                    }),
                };
                points.extend(carriers.map(|v| (v, area / 3.0)));
            }
        }
        points
    }

    /// What acts at a part of the load.
    fn inputs(&self, load: Load, part: f64) -> Inputs<f64> {
        let mut held = self.held();
        if let Load::Twist(_) = load {
            let at_end = self.rest().iter().enumerate().filter(|(_, x)| x.x > BAR[0] - NEAR);
            held.extend(at_end.map(|(v, _)| v as u32));
        }
        let pin = |&vertex: &u32| Pin { vertex, target: self.rest()[vertex as usize] };
        let mut inputs = Inputs { pins: held.iter().map(pin).collect(), ..Inputs::default() };
        match load {
            Load::Sag(share) => inputs.gravity = self.body.down * (GRAVITY.length() * share * part),
            Load::Twist(angle) => {
                let path = DrivenPath::Screw { center: axis(), angle, advance: 0.0 };
                for pin in inputs.pins.iter_mut().filter(|pin| pin.target.x > NEAR) {
                    pin.target = path.at(pin.target, part);
                }
            }
            Load::Press(pressure) => {
                let push = self.body.down * (pressure * part * YOUNG);
                let points = self.face_points();
                inputs.forces = points.into_iter().map(|(v, area)| (v, push * area)).collect();
            }
        }
        inputs
    }

    /// Places at rest [m] under a load, from places near it or by parts of the load.
    fn settle(&mut self, load: Load, near: Option<Vec<Vec3<f64>>>) -> Result<Vec<Vec3<f64>>> {
        let parts = if near.is_some() { &[1.0] } else { load.parts() };
        let mut x = near.unwrap_or_else(|| self.rest().to_vec());
        for &part in parts {
            let solution = self.reference.settle(&x, &self.inputs(load, part))?;
            ensure!(part < 1.0 || solution.convergence.minimum, "a saddle, not a state of rest");
            x = solution.positions;
        }
        Ok(x)
    }

    /// How far it gives at places `x` [m].
    fn response(&self, load: Load, x: &[Vec3<f64>]) -> Result<f64> {
        if let Load::Twist(angle) = load {
            let inputs = self.inputs(load, 1.0);
            let forces = self.reference.reactions(x, &inputs)?;
            let driven = inputs.pins.iter().zip(forces).filter(|(pin, _)| pin.target.x > NEAR);
            let torque: f64 = driven.map(|(pin, f)| (pin.target - axis()).cross(f).x).sum();
            return Ok(angle / torque);
        }
        let points = match self.body.shape {
            Shape::Liver => (0..).zip(self.reference.problem().masses.iter().copied()).collect(),
            _ => self.face_points(),
        };
        let all: f64 = points.iter().map(|(_, weight)| weight).sum();
        let sunk = |&(v, weight): &(u32, f64)| {
            (x[v as usize] - self.rest()[v as usize]).dot(self.body.down) * weight
        };
        Ok(points.iter().map(sunk).sum::<f64>() / all)
    }
}

/// A point of the axis about which bars are twisted.
fn axis() -> Vec3<f64> {
    vec3(0.0, 0.5 * BAR[1], 0.5 * BAR[2])
}

/// How far a mesh gives under a load.
pub fn response(body: &Body, element: Element, load: Load, poisson: f64) -> Result<f64> {
    let mut loaded = Loaded::new(body, element, poisson)?;
    let x = loaded.settle(load, None)?;
    loaded.response(load, &x)
}

/// The same of one tissue of any law; pressures and twists are those of [`YOUNG`].
pub fn response_of(body: &Body, element: Element, load: Load, tissue: &Material) -> Result<f64> {
    let mut loaded = Loaded::of_tissues(body, element, tissue, tissue)?;
    let x = loaded.settle(load, None)?;
    loaded.response(load, &x)
}
