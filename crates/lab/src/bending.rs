//! Loads that show whether a mesh is as stiff as the body that it stands for, on linear, recovered-gradient and
//! quadratic tetrahedra.
//!
//! | load | response |
//! |---|---|
//! | sag | a bar clamped at one end sinks under its weight: mean of the free end [m] |
//! | twist | its free end is turned about its axis: angle over torque [1/(N m)] |
//! | press | a quarter of a block's top is pressed by a pressure: mean indentation [m] |
//!
//! The truth is that of quadratic tetrahedra on two meshes, extrapolated to none: their error falls with the square of
//! the cells' size, as clamped edges have stress without bounds.

use std::fmt;

use anyhow::{Context as _, Result, ensure};
use viscera::layout::Smoothing;
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::{Block, Splitting};
use viscera::mesh::topology::{boundary_surface, edges};
use viscera::model::ModelBuilder;
use viscera::scalar::{Vec3, vec3};
use viscera::solver::{Inputs, Pin};

use crate::load_cases::{DrivenPath, GRAVITY, tissue};
use crate::reference::Reference;
use crate::unstructured::{relaxed, shuffled};

/// Edge lengths of the bar [m]. Of 50 kPa it sinks by a third of its length.
pub const BAR: [f64; 3] = [0.08, 0.02, 0.02];

/// Edge lengths of the block [m].
pub const BLOCK: [f64; 3] = [0.06, 0.06, 0.03];

/// Young's modulus [Pa].
pub const YOUNG: f64 = 5e4;

/// Largest distance [m] from a plane of what lies in it.
const NEAR: f64 = 1e-9;

/// Pressure on the block over Young's modulus, and turn [rad], of loads at which everything is linear to a thousandth.
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

/// How a body is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filling {
    /// Boxes of five tetrahedra.
    Five,
    /// Boxes of six.
    Six,
    /// Boxes of six whose inner vertices are pushed about.
    Jittered,
    /// In no order, and of sound shapes; with a seed.
    Relaxed(u64),
    /// In no order, and of poor shapes.
    Shuffled(u64),
}

impl fmt::Display for Filling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Five => f.write_str("boxes of five"),
            Self::Six => f.write_str("boxes of six"),
            Self::Jittered => f.write_str("boxes of six, jittered"),
            Self::Relaxed(seed) => write!(f, "unstructured {seed}"),
            Self::Shuffled(seed) => write!(f, "unstructured {seed}, poor shapes"),
        }
    }
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

    /// Whether everything is linear.
    fn is_small(self) -> bool {
        let (Self::Sag(size) | Self::Twist(size) | Self::Press(size)) = self;
        size <= SMALL
    }

    /// A block for what is pressed, a bar for all else.
    pub fn size(self) -> [f64; 3] {
        match self {
            Self::Press(_) => BLOCK,
            _ => BAR,
        }
    }

    /// Boxes along each axis where there are so many across.
    fn boxes(self, across: usize) -> [usize; 3] {
        match self {
            Self::Press(_) => [2 * across, 2 * across, across],
            _ => [4 * across, across, across],
        }
    }

    /// The body with so many boxes across, an even number where it is pressed.
    pub fn mesh(self, filling: Filling, across: usize) -> Result<TetMesh> {
        let block = Block {
            splitting: if filling == Filling::Five { Splitting::Five } else { Splitting::Six },
            jitter: if matches!(filling, Filling::Five | Filling::Six) { 0.0 } else { 0.6 },
            seed: 1,
            ..Block::new(Vec3::from_f64(self.size()), self.boxes(across))
        };
        let mesh = block.mesh().context("a body that bends")?;
        match filling {
            Filling::Relaxed(seed) => relaxed(&mesh, seed),
            Filling::Shuffled(seed) => shuffled(&mesh, seed),
            Filling::Five | Filling::Six | Filling::Jittered => Ok(mesh),
        }
    }
}

impl fmt::Display for Load {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Sag(_) => "bending",
            Self::Twist(_) => "twist",
            Self::Press(_) => "press",
        };
        if self.is_small() { write!(f, "small {name}") } else { write!(f, "large {name}") }
    }
}

/// A mesh with its middles of edges, if its tetrahedra have them.
struct Body {
    reference: Reference,
    mesh: TetMesh,
    /// Ascending pairs, in the order of the reference's vertices after the mesh's.
    edges: Option<Vec<[u32; 2]>>,
}

impl Body {
    fn new(mesh: &TetMesh, element: Element, tissue: &Material) -> Result<Self> {
        let linear = || {
            let mut builder = ModelBuilder::new();
            builder.add_body(mesh, tissue)?;
            builder.build::<f64>().context("a body that bends")
        };
        let (reference, edges) = match element {
            Element::Linear => (Reference::new(&linear()?), None),
            Element::Smooth(smoothing) => (Reference::recovered(&linear()?, smoothing), None),
            Element::Quadratic => (Reference::quadratic(mesh, tissue), Some(edges(mesh))),
        };
        Ok(Self { reference, mesh: mesh.clone(), edges })
    }

    fn rest(&self) -> &[Vec3<f64>] {
        &self.reference.problem().rest_positions
    }

    /// Where a boundary face's uniform traction acts and its mean displacement is read, with the share of its area
    /// [m^2]: its corners, or on quadratic tetrahedra, whose corners carry none, the middles of its edges.
    fn face_points(&self, inside: impl Fn(Vec3<f64>) -> bool) -> Vec<(u32, f64)> {
        let boundary = boundary_surface(&self.mesh);
        let mut points = Vec::new();
        for triangle in &boundary.surface.triangles {
            let corners = triangle.map(|v| boundary.mesh_vertices[v as usize]);
            let [a, b, c] = corners.map(|v| self.mesh.vertices()[v as usize]);
            if [a, b, c].iter().all(|&x| inside(x)) {
                let area = 0.5 * (b - a).cross(c - a).length();
                let [p, q, r] = corners;
                let carriers = match &self.edges {
                    None => corners,
                    Some(edges) => [[p, q], [q, r], [r, p]].map(|[v, w]| {
                        // Every edge of the mesh is in the list.
                        let place = edges.binary_search(&[v.min(w), v.max(w)]).unwrap_or_default();
                        (self.mesh.vertices().len() + place) as u32
                    }),
                };
                points.extend(carriers.map(|v| (v, area / 3.0)));
            }
        }
        points
    }

    fn pins(&self, inside: impl Fn(Vec3<f64>) -> bool) -> Vec<Pin<f64>> {
        let inside = self.rest().iter().enumerate().filter(|(_, x)| inside(**x));
        inside.map(|(v, x)| Pin { vertex: v as u32, target: *x }).collect()
    }

    /// How far it gives.
    fn response(&mut self, load: Load) -> Result<f64> {
        let mut inputs = Inputs::<f64>::default();
        let is_small = load.is_small();
        let x = match load {
            Load::Sag(share) => {
                inputs.gravity = GRAVITY * share;
                inputs.pins = self.pins(|x| x.x < NEAR);
                self.settle(&mut inputs, is_small, |inputs, part| {
                    inputs.gravity = GRAVITY * (share * part)
                })?
            }
            Load::Twist(angle) => {
                let center = vec3(0.0, 0.5 * BAR[1], 0.5 * BAR[2]);
                let path = DrivenPath::Screw { center, angle, advance: 0.0 };
                inputs.pins = self.pins(|x| x.x < NEAR || x.x > BAR[0] - NEAR);
                let rest: Vec<_> = inputs.pins.iter().map(|pin| pin.target).collect();
                let x = self.settle(&mut inputs, is_small, |inputs, part| {
                    for (pin, &rest) in inputs.pins.iter_mut().zip(&rest) {
                        if rest.x > NEAR {
                            pin.target = path.at(rest, part);
                        }
                    }
                })?;
                let forces = self.reference.reactions(&x, &inputs)?;
                let driven = inputs.pins.iter().zip(forces).filter(|(pin, _)| pin.target.x > NEAR);
                let torque: f64 = driven.map(|(pin, f)| (pin.target - center).cross(f).x).sum();
                return Ok(angle / torque);
            }
            Load::Press(pressure) => {
                inputs.pins = self.pins(|x| x.z < NEAR);
                let points = self.face_points(is_pressed);
                let press = |inputs: &mut Inputs<f64>, part: f64| {
                    let force = |&(v, area): &(u32, f64)| {
                        (v, vec3(0.0, 0.0, -pressure * part * YOUNG * area))
                    };
                    inputs.forces = points.iter().map(force).collect();
                };
                self.settle(&mut inputs, is_small, press)?
            }
        };
        let points = match load {
            Load::Press(_) => self.face_points(is_pressed),
            _ => self.face_points(|x| x.x > BAR[0] - NEAR),
        };
        let area: f64 = points.iter().map(|(_, area)| area).sum();
        let sunk = |&(v, area): &(u32, f64)| (self.rest()[v as usize].z - x[v as usize].z) * area;
        Ok(points.iter().map(sunk).sum::<f64>() / area)
    }

    /// At rest after parts of the load, one after the other: fewer Newton steps in all, and no other minimum.
    fn settle(
        &mut self,
        inputs: &mut Inputs<f64>,
        is_small: bool,
        set: impl Fn(&mut Inputs<f64>, f64),
    ) -> Result<Vec<Vec3<f64>>> {
        let mut x = self.rest().to_vec();
        let parts: &[f64] = if is_small { &[1.0] } else { &[0.3, 0.65, 1.0] };
        for &part in parts {
            set(inputs, part);
            let solution = self.reference.settle(&x, inputs)?;
            ensure!(part < 1.0 || solution.convergence.minimum, "a saddle, not a state of rest");
            x = solution.positions;
        }
        Ok(x)
    }
}

/// The quarter of the block's top in its middle.
fn is_pressed(x: Vec3<f64>) -> bool {
    let in_middle = |x: f64, edge: f64| (x - 0.5 * edge).abs() < 0.25 * edge + NEAR;
    x.z > BLOCK[2] - NEAR && in_middle(x.x, BLOCK[0]) && in_middle(x.y, BLOCK[1])
}

/// How far a mesh gives under a load, of stable neo-Hookean tissue.
pub fn response(mesh: &TetMesh, element: Element, load: Load, poisson: f64) -> Result<f64> {
    response_of(mesh, element, load, &tissue(MaterialModel::StableNeoHookean, YOUNG, poisson)?)
}

/// How far a mesh gives under a load, of any tissue; pressures and twists are those of [`YOUNG`].
pub fn response_of(mesh: &TetMesh, element: Element, load: Load, tissue: &Material) -> Result<f64> {
    Body::new(mesh, element, tissue)?.response(load)
}

/// The response of the body itself, from those of quadratic tetrahedra with so many boxes across, fewer first.
pub fn extrapolated(cells: [usize; 2], responses: [f64; 2]) -> f64 {
    let finer = (cells[1] as f64 / cells[0] as f64).powi(2);
    responses[1] + (responses[1] - responses[0]) / (finer - 1.0)
}
