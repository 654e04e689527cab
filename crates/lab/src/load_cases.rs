//! Load cases that the studies share: a body, its fixings, what moves, for how long.
//!
//! | load case | what happens |
//! |---|---|
//! | cantilever | a bar fixed at one end droops under its weight |
//! | twist | a bar's end is turned by 60 degrees and pulled by 12 % |
//! | grab | a patch on a block is pulled up by 64 % of its height |
//! | press | half of a block's top is pressed down by 24 % of its height |
//! | organ | the procedural liver in elastic ligaments sags and is pulled by a spring |

use std::fmt;

use anyhow::{Context as _, Result, bail, ensure};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes;
use viscera::mesh::topology::BoundingBox;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Mat3, Real, Vec3, vec3};
use viscera::solver::{Inputs, Pin};

use crate::forms::Form;

/// Acceleration of gravity [m/s^2].
pub const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

/// Frames per second.
pub const FRAME_RATE: f64 = 60.0;

/// Density of all tissue here [kg/m^3].
pub const DENSITY: f64 = 1000.0;

/// Where driven vertices go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DrivenPath {
    /// By an offset [m].
    Shift(Vec3<f64>),
    /// Turned by an angle [rad] about an axis along x through a point, and shifted along x [m].
    Screw {
        /// A point on the axis [m].
        center: Vec3<f64>,
        /// [rad].
        angle: f64,
        /// [m].
        advance: f64,
    },
    /// Away from a point, by a factor along each axis.
    Stretch {
        /// The point that stays [m].
        center: Vec3<f64>,
        /// Per axis.
        factors: Vec3<f64>,
    },
}

impl DrivenPath {
    /// Where a point is after a share of the way.
    pub fn at(&self, x: Vec3<f64>, share: f64) -> Vec3<f64> {
        match *self {
            Self::Shift(offset) => x + offset * share,
            Self::Screw { center, angle, advance } => {
                let (sin, cos) = (libm::sin(angle * share), libm::cos(angle * share));
                let r = x - center;
                let turned = vec3(r.x, cos * r.y - sin * r.z, sin * r.y + cos * r.z);
                center + turned + vec3(advance * share, 0.0, 0.0)
            }
            Self::Stretch { center, factors } => {
                let growth = (factors - Vec3::splat(1.0)) * share;
                x + (x - center).scale(growth)
            }
        }
    }
}

/// An elastic hold of one vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElasticHold {
    /// The vertex.
    pub vertex: u32,
    /// [N/m].
    pub stiffness: f64,
    /// Whether its anchor follows the path.
    pub driven: bool,
}

/// A body with its fixings, loads and driven vertices. Reports call it a scene.
#[derive(Clone, Debug)]
pub struct LoadCase {
    /// One word.
    pub name: &'static str,
    /// The body at rest.
    pub mesh: TetMesh,
    /// What it is made of.
    pub tissue: Material,
    /// [m/s^2].
    pub gravity: Vec3<f64>,
    /// Pinned where they are.
    pub fixed: Vec<u32>,
    /// Pinned, and moved along the path.
    pub driven: Vec<u32>,
    /// Held elastically.
    pub holds: Vec<ElasticHold>,
    /// Where what is driven goes.
    pub path: DrivenPath,
    /// Frames that it takes to get there.
    pub path_frames: u32,
    /// How the whole scene is turned about the origin; the path is that of the scene before.
    pub turned: Mat3<f64>,
    /// What region 1 of the mesh is made of, where that is something else.
    pub inclusion: Option<Material>,
}

impl fmt::Display for LoadCase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (young, poisson) = (self.tissue.young() / 1e3, self.tissue.poisson());
        write!(f, "{} {young} kPa, nu {poisson}, {} tets", self.name, self.mesh.tets().len())
    }
}

impl LoadCase {
    /// A body that nothing holds and nothing pulls.
    pub fn bare(name: &'static str, mesh: TetMesh, tissue: Material) -> Self {
        Self {
            name,
            mesh,
            tissue,
            gravity: Vec3::ZERO,
            fixed: Vec::new(),
            driven: Vec::new(),
            holds: Vec::new(),
            path: DrivenPath::Shift(Vec3::ZERO),
            path_frames: 1,
            turned: Mat3::IDENTITY,
            inclusion: None,
        }
    }

    /// The load case of a name, with about as many tetrahedra.
    pub fn new(name: &'static str, size: Size, tissue: Material) -> Result<Self> {
        Self::of_form(name, Form::Usual, size, tissue)
    }

    /// The same with the bar or the block in another form.
    pub fn of_form(name: &'static str, form: Form, size: Size, tissue: Material) -> Result<Self> {
        let mut load_case = Self::bare(name, TetMesh::default(), tissue);
        match name {
            "cantilever" => {
                load_case.mesh = form.bar(size)?;
                load_case.gravity = GRAVITY;
                load_case.fixed = load_case.select(|x| x.x < NEAR);
            }
            "twist" => {
                load_case.mesh = form.bar(size)?;
                load_case.twist_ends(NEAR);
            }
            "grab" => {
                load_case.mesh = form.block(size)?;
                load_case.gravity = GRAVITY;
                load_case.fixed = load_case.select(|x| x.z < NEAR);
                let in_patch = |x: f64| (x - 0.5 * BLOCK[0]).abs() < 0.2 * BLOCK[0];
                load_case.driven =
                    load_case.select(|x| x.z > BLOCK[2] - NEAR && in_patch(x.x) && in_patch(x.y));
                load_case.path = DrivenPath::Shift(vec3(0.0, 0.0, 0.032));
                load_case.path_frames = 8;
            }
            "press" => {
                load_case.mesh = form.block(size)?;
                load_case.fixed = load_case.select(|x| x.z < NEAR);
                load_case.driven =
                    load_case.select(|x| x.z > BLOCK[2] - NEAR && x.x < 0.5 * BLOCK[0] + NEAR);
                load_case.path = DrivenPath::Shift(vec3(0.0, 0.0, -0.012));
                load_case.path_frames = 6;
            }
            "organ" => {
                let spacing = match size {
                    Size::Tiny => 0.06,
                    Size::Small => 0.04,
                    Size::Large => 0.022,
                    Size::Huge => 0.0085,
                    Size::Vast => 0.00395,
                };
                load_case.mesh = shapes::liver(spacing, 1.0)?.tets;
                load_case.gravity = GRAVITY;
                load_case.hold_organ();
                load_case.path = DrivenPath::Shift(vec3(0.0, 0.0, 0.05));
                load_case.path_frames = 12;
            }
            _ => bail!("there is no scene `{name}`; there are {}", NAMES.join(", ")),
        }
        form.finish(&mut load_case)?;
        Ok(load_case)
    }

    /// One end held, the other turned and pulled; what lies within `depth` [m] of an end belongs to it.
    fn twist_ends(&mut self, depth: f64) {
        let extent = BoundingBox::around(self.mesh.vertices());
        self.fixed = self.select(|x| x.x < extent.min.x + depth);
        self.driven = self.select(|x| x.x > extent.max.x - depth);
        let angle = std::f64::consts::PI / 3.0;
        let advance = 0.12 * extent.size().x;
        self.path = DrivenPath::Screw { center: extent.center(), angle, advance };
        self.path_frames = 12;
    }

    /// This scene of a bar with another body, which lies along x and whose ends are what lies within a
    /// twentieth of its length of them. Refuses one that could turn about what holds it, or cannot move.
    pub fn with_bar(mut self, mesh: TetMesh) -> Result<Self> {
        let extent = BoundingBox::around(mesh.vertices());
        let depth = 0.05 * extent.size().x;
        self.mesh = mesh;
        match self.driven.is_empty() {
            true => self.fixed = self.select(|x| x.x < extent.min.x + depth),
            false => {
                self.twist_ends(depth);
                self.check_end("high", &self.driven)?;
            }
        }
        self.check_end("low", &self.fixed)?;
        ensure!(
            !self.free().is_empty(),
            "every vertex lies within a twentieth of the body's length of an end along x, so that none \
             can move; refine it, or turn the body so that its length lies along x"
        );
        Ok(self)
    }

    /// Makes sure that pinned vertices leave no rotation free.
    fn check_end(&self, end: &str, pinned: &[u32]) -> Result<()> {
        let places: Vec<_> = pinned.iter().map(|&v| self.mesh.vertices()[v as usize]).collect();
        ensure!(
            span_a_plane(&places),
            "the {end} end along x, a twentieth of the body's length, has {} vertices and no three that \
             are not in a line, so that the body could turn about them; turn the body so that its length \
             lies along x and this end is broad, or refine it",
            places.len()
        );
        Ok(())
    }

    /// Ligaments on the uppermost quarter, a spring at the rightmost point.
    fn hold_organ(&mut self) {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for x in self.mesh.vertices() {
            (low, high) = (low.min(x.z), high.max(x.z));
        }
        let top = self.select(|x| x.z > high - 0.25 * (high - low));
        // 2000 N/m in all: a liver of 1.5 kg sinks by some millimetres.
        let stiffness = 2000.0 / top.len() as f64;
        self.holds.extend(top.iter().map(|&vertex| ElasticHold {
            vertex,
            stiffness,
            driven: false,
        }));
        let vertices = self.mesh.vertices().iter().enumerate();
        let rightmost = vertices.max_by(|(_, a), (_, b)| a.x.total_cmp(&b.x));
        let vertex = rightmost.map_or(0, |(v, _)| v as u32);
        self.holds.push(ElasticHold { vertex, stiffness: 100.0, driven: true });
    }

    /// Vertices by where they are at rest.
    pub fn select(&self, inside: impl Fn(Vec3<f64>) -> bool) -> Vec<u32> {
        let vertices = self.mesh.vertices().iter().enumerate();
        vertices.filter(|(_, x)| inside(**x)).map(|(v, _)| v as u32).collect()
    }

    /// Its model.
    pub fn model<S: Real>(&self) -> Result<Model<S>> {
        let mut builder = ModelBuilder::new();
        let body = builder.add_body(&self.mesh, &self.tissue)?;
        if let Some(inclusion) = &self.inclusion {
            builder.set_region_material(body, 1, inclusion)?;
        }
        for hold in &self.holds {
            let anchor = self.mesh.vertices()[hold.vertex as usize];
            builder.add_attachment(hold.vertex, anchor, hold.stiffness)?;
        }
        builder.build().with_context(|| self.to_string())
    }

    /// What acts at the end of a frame, counted from 1; between frames at fractions.
    pub fn inputs<S: Real>(&self, frame: f64) -> Inputs<S> {
        let share = (frame / f64::from(self.path_frames)).min(1.0);
        let rest = self.mesh.vertices();
        let pin = |&vertex: &u32, target: Vec3<f64>| Pin { vertex, target: target.cast() };
        let mut pins: Vec<_> = self.fixed.iter().map(|v| pin(v, rest[*v as usize])).collect();
        let led = |x| self.turned * self.path.at(self.turned.transpose() * x, share);
        pins.extend(self.driven.iter().map(|v| pin(v, led(rest[*v as usize]))));
        let anchor = |hold: &ElasticHold| {
            let x = rest[hold.vertex as usize];
            if hold.driven { led(x).cast() } else { x.cast() }
        };
        let anchors = self.holds.iter().map(anchor).collect();
        Inputs { gravity: self.gravity.cast(), pins, anchors, ..Inputs::default() }
    }

    /// Vertices that are not pinned.
    pub fn free(&self) -> Vec<u32> {
        let mut is_free = vec![true; self.mesh.vertices().len()];
        for &v in self.fixed.iter().chain(&self.driven) {
            is_free[v as usize] = false;
        }
        (0..is_free.len() as u32).filter(|&v| is_free[v as usize]).collect()
    }
}

/// Whether three of the points are not in a line.
fn span_a_plane(points: &[Vec3<f64>]) -> bool {
    // Of the line's length. Single precision rounds places by some 1e-7: what is that close is in it.
    const OFF_THE_LINE: f64 = 1e-6;
    let Some(&first) = points.first() else { return false };
    let ways = || points.iter().map(|&x| x - first);
    let Some(longest) = ways().max_by(|a, b| a.length().total_cmp(&b.length())) else {
        return false;
    };
    ways().any(|way| longest.cross(way).length() > OFF_THE_LINE * longest.length_squared())
}

/// The names of all load cases.
pub const NAMES: [&str; 5] = ["cantilever", "twist", "grab", "press", "organ"];

/// How fine a load case is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Some 100 tetrahedra.
    Tiny,
    /// About 600 tetrahedra.
    Small,
    /// About 3000 tetrahedra.
    Large,
    /// About 50,000 tetrahedra.
    Huge,
    /// About 500,000 tetrahedra.
    Vast,
}

/// Distance [m] within which a vertex counts as lying on a face.
pub const NEAR: f64 = 1e-9;

/// Edge lengths of the bar [m].
pub const BAR: [f64; 3] = [0.2, 0.05, 0.05];

/// Edge lengths of the block [m].
pub const BLOCK: [f64; 3] = [0.1, 0.1, 0.05];

/// Tissue of the studies.
pub fn tissue(model: MaterialModel, young: f64, poisson: f64) -> Result<Material> {
    Ok(Material::new(model, young, poisson, DENSITY)?)
}

/// Seeded numbers (splitmix64): the same on every machine.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Each component uniform within `size`.
    pub fn vector(&mut self, size: f64) -> Vec3<f64> {
        vec3(self.uniform(-size, size), self.uniform(-size, size), self.uniform(-size, size))
    }
}
