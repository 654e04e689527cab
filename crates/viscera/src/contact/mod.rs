//! Contact of tissue with tools and fixed obstacles: an energy on samples of the surface.
//!
//! ```text
//! E = sum_s A_s psi(phi(p_s)),   p_s = sum_a b_a x_a           phi: signed distance to the tool
//! f_a = b_a A p n                on the vertices;  -A p n on the tool, torque (p_s - t) x (-A p n) about its origin t
//! ```
//!
//! No constraint, no multiplier, no pair that could be dropped: every method adds the energy, its forces and its curvature to
//! its own. What a step holds constant (the pose at its end, the plane that a sample touches, the anchor of friction, the
//! normal force of the step before) is found before the step begins ([`Touching`]) and moves on after it has ended.
//!
//! Everything here is in double precision, whatever the state's is.

mod at_rest;
mod distance;
pub mod distance_grid;
pub mod held;
pub mod law;
mod meeting;
mod pair;
mod pressure;
pub(crate) mod search;
pub mod shape;
pub(crate) mod skin;
pub mod surface;
mod touch;
pub(crate) mod tree;

pub use at_rest::Overlap;
pub use distance::Distance;
pub use distance_grid::{DistanceGrid, SolidError};
pub use held::{Held, HeldMotion, Spring};
pub use law::{Foundation, Friction};
pub(crate) use meeting::{DEEPEST, Looking, Moment, depths, turn_normals};
pub use pair::Kept;
pub(crate) use pair::{Bond, Pair, from_edges, tie_rest};
pub use pressure::VertexPressures;
pub use shape::Shape;
pub use skin::TissueContact;
pub(crate) use skin::{Skin, Tie};
pub use surface::{Sample, sample_boundary, sample_embedded};
pub use touch::{Felt, Moved, Placed, Side, Touch, Touching};

use crate::scalar::Vec3;
use crate::scalar::rigid::RigidTransform;

/// How tissue and a tool meet. One default for all methods of solution, so that the force at a depth does not depend on
/// them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// Stiffness of contact in units of the tissue's modulus over its edge length, `kf` in `k = kf E/h`.
    pub stiffness: f64,
    /// Distance at which contact begins [m].
    pub thickness: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

impl Default for ContactLaw {
    fn default() -> Self {
        Self { stiffness: 10.0, thickness: 1e-3, friction: 0.3 }
    }
}

impl ContactLaw {
    /// What is wrong with it, in words; nothing where it is legal.
    pub fn complaint(&self) -> Option<&'static str> {
        let is_legal = |value: f64, least: f64, most: f64| (least..=most).contains(&value);
        if !is_legal(self.stiffness, 1e-3, 1e6) {
            return Some("a contact's stiffness is between 0.001 and 1000000 times E/h");
        }
        if !is_legal(self.thickness, 1e-9, 1e3) {
            return Some("a contact's thickness is above zero; 1 mm suits organs");
        }
        (!is_legal(self.friction, 0.0, 5.0)).then_some(
            "a coefficient of friction is between 0 and 5; 0.1 is slippery, 0.8 ridged jaws",
        )
    }
}

/// A tool or a fixed obstacle: moved from outside, whatever pushes against it, or held by a spring. A copy of it takes no memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// Its shape in its own frame.
    pub shape: Shape,
    /// Where it is at the end of the step: from its own frame to the world.
    pub pose: RigidTransform,
    /// How it meets tissue.
    pub law: ContactLaw,
    /// While it is, what the tool presses on is tied to it: jaws with a ratchet.
    pub is_locked: bool,
    /// Where a spring holds it: then `pose` is where it would be without tissue, and [`crate::solver::Solver::lead`] moves it.
    pub held: Option<Held>,
}

impl Tool {
    /// At rest at the origin, with the usual law.
    pub fn new(shape: Shape) -> Self {
        Self {
            shape,
            pose: RigidTransform::IDENTITY,
            law: ContactLaw::default(),
            is_locked: false,
            held: None,
        }
    }

    /// Moves a point [m] of the world into the tool's frame and returns the distance there, its gradient in the world.
    pub fn distance(&self, point: Vec3<f64>) -> Distance {
        let distance = self.shape.distance(self.pose.undo(point));
        Distance { normal: self.pose.turn(distance.normal), ..distance }
    }

    /// Whether a way [m] in a step of `dt` [s] is no motion: the tool was put elsewhere.
    pub fn jumps(&self, way: f64, dt: f64) -> bool {
        way > (FASTEST * dt).max(FARTHEST * self.shape.thinnest().min(1.0))
    }
}

/// Tools, and their parts, at most, that a graphics processor computes contact with.
pub(crate) const MOST_TOOLS_ON_DEVICES: usize = 16;

/// Why a graphics processor cannot compute contact with tools; of each part of one, whether a spring holds it.
pub(crate) fn beyond_devices(tools: impl Iterator<Item = bool>) -> Option<&'static str> {
    let mut count = 0;
    for is_held in tools {
        count += 1;
        if is_held {
            return Some("a tool that a spring holds does not move; leave out its `spring`");
        }
    }
    (count > MOST_TOOLS_ON_DEVICES).then_some("tools have 16 parts in all at most; use fewer")
}

/// A tool that is faster than this [m/s], or goes further than so many of its radii in a step where those are more, was put
/// elsewhere.
const FASTEST: f64 = 10.0;
const FARTHEST: f64 = 10.0;

/// Force and torque between a tool and the tissue that it touches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// On the tool [N].
    pub force: Vec3<f64>,
    /// On the tool, about its origin [N m].
    pub torque: Vec3<f64>,
    /// Samples of tissue that it presses on.
    pub touches: u32,
    /// Of these hang on pinned vertices only: nothing gives way there.
    pub pinned: u32,
    /// Samples that may meet it and were left out, because other tools are nearer: on devices alone.
    pub left_out: u32,
    /// The deepest that tissue is inside the contact's thickness [m].
    pub depth: f64,
    /// Whether the tool has moved too far in the step for motion: what it touched before is forgotten, and tissue inside
    /// it goes the shortest way out.
    pub has_jumped: bool,
}

impl Wrench {
    /// Adds the force [N] that a sample at `place` [m] of the world exerts on a tool at `origin` [m].
    pub fn add(&mut self, force: Vec3<f64>, place: Vec3<f64>, origin: Vec3<f64>) {
        self.force += force;
        self.torque += (place - origin).cross(force);
    }
}
