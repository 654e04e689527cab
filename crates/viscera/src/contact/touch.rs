//! A sample of tissue at a tool in one step: what stays constant, what follows from places, and what is kept.
//!
//! ```text
//! path in the tool's frame from R_0^T (p_n - t_0) to R_1^T (p_n + dt v - t_1); where it comes within dh/2 of the tool, or
//! begins within dh, the tangent plane there is the tool for this step:  d = n.(R^T (p - t)) - o
//! u = (I - n n^T)(p - world_from_tool a)                              slip from the anchor a
//! end of step:  u *= min(1, mu min(N, N_new)/(K |u|)),  a = p - u,  N = N_new;   nothing is kept where N_new = 0
//! explicit:     u *= min(1, mu N_new/(K |u|)),  a = p - u   in every small step, N_new the normal force there
//! ```
//!
//! A plane remembers the side from which the tissue has come, so that a thin tool cannot jump past it, and makes the energy
//! convex. Samples whose path stays away keep the live distance: a plane in the air would be a wall where there is none. A
//! plane stays, normal and offset, while its sample is deep inside, where the distance's own direction has begun to turn
//! sideways. It is the one that the sample has met: of a tool that is not convex no other plane of that normal will do.
//!
//! Where a tool's distance is interpolated its gradient is no unit vector, `grad phi = s n`, and everything of the live
//! distance has its share of `s`: force `p s`, stiffness `c s^2`. Planes have unit normals, and are distances.

use super::law::{Dragged, Foundation, Friction, Squeezed, block, tangential};
use super::shape::Shape;
use super::{ContactLaw, Distance, Tool};
use crate::scalar::rigid::RigidTransform;
use crate::scalar::{Mat3, Vec3};

/// Evaluations of the distance along a path at most.
const MOST_TRACED: u32 = 24;

/// Deeper than this share of the tool's thinnest radius a plane keeps its normal.
const SHALLOW: f64 = 0.25;

/// Cosine of the angle by which a plane turns at most from small step to small step.
const SAME_SIDE: f64 = 0.5;

/// What is kept of a sample that a tool presses on, from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The sample's number.
    pub sample: u32,
    /// The tool's number.
    pub tool: u32,
    /// Where the sample would be without slip, in the tool's frame [m].
    pub anchor: Vec3<f64>,
    /// Of the plane `normal . x = offset`, in the tool's frame; of length 1.
    pub normal: Vec3<f64>,
    /// Of the same [m].
    pub offset: f64,
    /// Normal force at the end of the last step [N].
    pub pressed: f64,
    /// Force on the tissue at the end of the last step, friction included [N].
    pub force: Vec3<f64>,
    /// Where it acts [m].
    pub place: Vec3<f64>,
    /// Whether it is tied to the tool.
    pub is_tied: bool,
}

/// What a sample finds in its way in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// A plane in the tool's frame: `d = normal . x - offset`.
    Plane {
        /// Of length 1.
        normal: Vec3<f64>,
        /// [m].
        offset: f64,
    },
    /// The tool itself, wherever the sample is.
    Live,
}

/// A sample and a tool in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touching {
    /// The sample's number.
    pub sample: u32,
    /// The tool's number.
    pub tool: u32,
    /// The constants of contact.
    pub foundation: Foundation,
    /// What is in its way.
    pub side: Side,
    /// Friction, its anchor in the tool's frame; nothing in the first step of a contact.
    pub friction: Option<Friction>,
    /// Whether it is tied: then friction holds in every direction.
    pub is_tied: bool,
}

/// A tool's shape and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed<'a> {
    /// The shape.
    pub shape: &'a Shape,
    /// From its frame to the world.
    pub pose: &'a RigidTransform,
}

/// What a sample feels at a place: its energy and the derivatives of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    /// Distance from the tool, or from its plane [m].
    pub distance: f64,
    /// Of contact and friction [J].
    pub energy: f64,
    /// On the tissue, of both [N].
    pub force: Vec3<f64>,
    /// Normal force [N].
    pub pressed: f64,
    /// Away from the tool.
    pub normal: Vec3<f64>,
    /// Second derivative along the normal [N/m].
    pub stiffness: f64,
    /// A bound of it across the normal, friction's own [N/m].
    pub drag: f64,
    /// The same of friction along the normal: of what is tied [N/m].
    pub tie: f64,
    /// A bound of what is negative in it, because the distance's gradient turns [N/m].
    pub turning: f64,
}

impl Felt {
    /// The second derivative of the energy without what may be negative in it: positive semidefinite.
    pub fn curvature(&self) -> Mat3<f64> {
        block(self.normal, self.stiffness + self.tie, self.drag)
    }
}

/// How a sample moves in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// Where it is at the start [m].
    pub from: Vec3<f64>,
    /// Where its velocity takes it [m].
    pub to: Vec3<f64>,
}

impl Touching {
    /// What a sample is to a tool in a step in which the tool goes from `start` to its pose; nothing where they are too far
    /// apart to meet. `kept` is what the last step has left.
    pub fn find(
        (sample, foundation): (u32, Foundation),
        (number, tool): (u32, &Tool),
        start: &RigidTransform,
        moved: &Moved,
        kept: Option<&Touch>,
    ) -> Option<Self> {
        let (from, to) = (start.undo(moved.from), tool.pose.undo(moved.to));
        let thickness = foundation.thickness;
        let first = tool.shape.distance(from);
        let way = (to - from).length();
        // The distance changes by no more than the way; beyond it the tissue around may push as far again.
        let farthest = 2.0 * (thickness + way) * tool.shape.steepest();
        if first.value > farthest && kept.is_none() {
            return None;
        }
        let side = if first.value < thickness {
            Self::plane(&tool.shape, from, &first, kept)
        } else {
            // Tissue may be dragged along, or held back: what stands still is looked at as well.
            let still = tool.pose.undo(moved.from);
            trace(&tool.shape, from, to, thickness)
                .or_else(|| trace(&tool.shape, from, still, thickness))
                .unwrap_or(Side::Live)
        };
        let friction = kept.and_then(|kept| friction(&tool.law, &foundation, kept));
        Some(Self {
            sample,
            tool: number,
            foundation,
            side,
            friction,
            is_tied: kept.is_some_and(|kept| kept.is_tied),
        })
    }

    /// The plane of a sample that begins in contact, at `from` [m] in the tool's frame.
    fn plane(shape: &Shape, from: Vec3<f64>, first: &Distance, kept: Option<&Touch>) -> Side {
        let is_shallow = first.value > -SHALLOW * shape.thinnest();
        match kept {
            Some(kept) if !is_shallow => Side::Plane { normal: kept.normal, offset: kept.offset },
            _ => tangent(shape, from, first),
        }
    }

    /// What the sample feels at a place [m].
    pub fn feel(&self, tool: Placed<'_>, place: Vec3<f64>) -> Felt {
        let Placed { shape, pose } = tool;
        let local = pose.undo(place);
        let Distance { value, normal, slope, curvature } = match self.side {
            Side::Plane { normal, offset } => {
                let value = normal.dot(local) - offset;
                Distance { value, normal, slope: 1.0, curvature: 0.0 }
            }
            Side::Live => shape.distance(local),
        };
        let normal = pose.turn(normal);
        let Squeezed { energy, force, stiffness } = self.foundation.squeeze(value);
        let pressed = force * slope;
        let mut felt = Felt {
            distance: value,
            energy,
            force: normal * pressed,
            pressed,
            normal,
            stiffness: stiffness * slope * slope,
            drag: 0.0,
            tie: 0.0,
            turning: force * curvature,
        };
        if let Some(friction) = &self.friction {
            self.drag(friction, place - pose.apply(friction.anchor), &mut felt);
        }
        felt
    }

    /// Adds friction to what is felt `away` [m] from the anchor.
    fn drag(&self, friction: &Friction, away: Vec3<f64>, felt: &mut Felt) {
        let slip = if self.is_tied { away } else { tangential(away, felt.normal) };
        let Dragged { energy, force, stiffness } = friction.drag(slip);
        felt.energy += energy;
        felt.force += force;
        felt.drag = stiffness;
        felt.tie = if self.is_tied { stiffness } else { 0.0 };
    }

    /// What the sample feels at a place [m] of explicit motion, which asks for no potential: friction gives way at once at
    /// `mu` times the normal force that is there, and its anchor comes after.
    pub fn slip(&mut self, tool: &Tool, placed: Placed<'_>, place: Vec3<f64>) -> Felt {
        if self.is_tied {
            return self.feel(placed, place);
        }
        self.turn(placed, place);
        let friction = self.friction.take();
        let mut felt = self.feel(placed, place);
        let limit = tool.law.friction * felt.pressed;
        if limit > 0.0 {
            let stiffness = self.foundation.area * self.foundation.stiffness;
            let anchor = friction.map_or(place, |friction| placed.pose.apply(friction.anchor));
            let slip = tangential(place - anchor, felt.normal);
            let elastic = stiffness * slip.length();
            let slip = slip * if elastic > limit { limit / elastic } else { 1.0 };
            let friction = Friction { anchor: placed.pose.undo(place - slip), stiffness, limit };
            self.drag(&friction, slip, &mut felt);
            self.friction = Some(friction);
        }
        felt
    }

    /// A plane follows the tool's surface where its sample slides along it, as it would from step to step: not where the
    /// sample is deep or not there yet.
    fn turn(&mut self, Placed { shape, pose }: Placed<'_>, place: Vec3<f64>) {
        let Side::Plane { normal, .. } = self.side else { return };
        let local = pose.undo(place);
        let distance = shape.distance(local);
        let touches =
            (-SHALLOW * shape.thinnest()..self.foundation.thickness).contains(&distance.value);
        if touches && distance.normal.dot(normal) > SAME_SIDE {
            self.side = tangent(shape, local, &distance);
        }
    }

    /// The most that second derivatives at a place [m] add up to before the sample has moved by half the thickness [N/m]:
    /// what explicit steps must be small enough for.
    pub fn stiffness_near(&self, tool: &Tool, felt: &Felt) -> f64 {
        let near = self.foundation.stiffness_near(felt.distance).max(felt.stiffness);
        let rubs = near > 0.0 && tool.law.friction > 0.0;
        let drag = if rubs { self.foundation.area * self.foundation.stiffness } else { 0.0 };
        near + drag.max(felt.drag)
    }

    /// What is kept after a step that has ended with the sample at a place [m], where it feels this; nothing where it has
    /// left the tool.
    pub fn keep(&self, tool: &Tool, place: Vec3<f64>, felt: &Felt) -> Option<Touch> {
        let is_tied = tool.is_locked && (self.is_tied || felt.pressed > 0.0);
        if felt.pressed <= 0.0 && !is_tied {
            return None;
        }
        let anchor = match &self.friction {
            Some(friction) if self.is_tied && is_tied => friction.anchor,
            Some(friction) if !self.is_tied => {
                let slip = tangential(place - tool.pose.apply(friction.anchor), felt.normal);
                let elastic = friction.stiffness * slip.length();
                let most = friction.limit.min(tool.law.friction * felt.pressed);
                let share = if elastic > most { most / elastic } else { 1.0 };
                tool.pose.undo(place - slip * share)
            }
            _ => tool.pose.undo(place),
        };
        let (normal, offset) = match self.side {
            Side::Plane { normal, offset } => (normal, offset),
            Side::Live => {
                let local = tool.pose.undo(place);
                tool.shape.tangent(local, &tool.shape.distance(local))
            }
        };
        Some(Touch {
            sample: self.sample,
            tool: self.tool,
            anchor,
            normal,
            offset,
            pressed: felt.pressed,
            force: felt.force,
            place,
            is_tied,
        })
    }
}

/// The constants of friction in a step, from what the last one has left.
fn friction(law: &ContactLaw, foundation: &Foundation, kept: &Touch) -> Option<Friction> {
    let stiffness = foundation.area * foundation.stiffness;
    let limit = if kept.is_tied { f64::INFINITY } else { law.friction * kept.pressed };
    (limit > 0.0).then_some(Friction { anchor: kept.anchor, stiffness, limit })
}

/// The tangent plane at a point [m], which is as far from it as the shape.
fn tangent(shape: &Shape, at: Vec3<f64>, distance: &Distance) -> Side {
    let (normal, offset) = shape.tangent(at, distance);
    Side::Plane { normal, offset }
}

/// Goes along a path [m] in the tool's frame by sphere tracing; the plane where it first comes within half the thickness.
fn trace(shape: &Shape, from: Vec3<f64>, to: Vec3<f64>, thickness: f64) -> Option<Side> {
    let (way, length) = (to - from, (to - from).length());
    if length == 0.0 {
        return None;
    }
    let near = 0.5 * thickness;
    let longest = length * shape.steepest();
    let mut share = 0.0;
    let mut at = from;
    for _ in 0..MOST_TRACED {
        let distance = shape.distance(at);
        // A hundredth of the thickness from there is there.
        if distance.value <= near * 1.02 {
            return Some(tangent(shape, at, &distance));
        }
        share += (distance.value - near) / longest;
        if share >= 1.0 {
            let end = shape.distance(to);
            return (end.value <= near).then(|| tangent(shape, to, &end));
        }
        at = from + way * share;
    }
    // Grazing: so near for so long that it counts. Along a gap between two sides of a tool it may be near to neither.
    let distance = shape.distance(at);
    let is_met = distance.value < thickness || shape.is_convex();
    is_met.then(|| tangent(shape, at, &distance))
}

#[cfg(test)]
mod tests;
