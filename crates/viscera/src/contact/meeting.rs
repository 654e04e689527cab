//! What a sample of tissue meets: the nearest triangle that faces it.
//!
//! ```text
//! area times s((-n_s.nu - 0.2)/0.5), s(t) = t^2 (3 - 2 t)     how much they face each other
//! d > -dh, on the body's own skin -dh/4    unless the sample was in touch there before: thin tissue looks turned through
//! ```
//!
//! Triangles near by on the same body are left out by the mesh, never by their distance at rest: the two sides of a narrow
//! fold are as close, and meet.

use super::search::{Closest, Found, closest};
use super::skin::{Skin, TissueContact};
use super::tree::{FACES, Query, SkinNow, Tree};
use crate::scalar::Vec3;

/// A sample faces what it meets not at all and wholly where the cosine of the angle between its normal and the way there is
/// this. Between them its pressure grows steadily: what came and went at once would never be at rest.
const FACING: [f64; 2] = [FACES, 0.7];

/// A sample stays with its triangle until another is nearer by this share of the thickness.
const STAYS: f64 = 0.1;

/// How deep a sample may be behind its own body's skin, in thicknesses, where it begins to touch; and behind another's in a
/// step: the far side of thin tissue looks as if it had been passed through.
const SHALLOW: f64 = 0.25;
pub const DEEPEST: f64 = 1.0;

/// Whether a triangle hangs on a vertex that a sample hangs on, or on a neighbour of one.
fn is_around(skin: &Skin, sample: u32, triangle: u32) -> bool {
    let sample = &skin.samples[sample as usize];
    let corners = skin.topology.corners(triangle);
    let bearing = sample.vertices.iter().zip(&sample.weights).filter(|(_, weight)| **weight != 0.0);
    bearing.into_iter().any(|(&v, _)| {
        let near = skin.topology.neighbours(v);
        corners.iter().any(|corner| *corner == v || near.binary_search(corner).is_ok())
    })
}

/// A skin at one moment.
#[derive(Clone, Copy)]
pub struct Moment<'a> {
    /// The skin.
    pub now: SkinNow<'a>,
    /// What may be near what.
    pub tree: &'a Tree,
    /// Which tissue meets which.
    pub contact: &'a TissueContact,
    /// How deep a sample may be behind another body's skin where it begins to touch, in thicknesses.
    pub deepest: f64,
}

/// A sample that looks for what it meets.
#[derive(Clone, Copy, Debug)]
pub struct Looking {
    /// Its number.
    pub sample: u32,
    /// Where it is [m].
    pub p: Vec3<f64>,
    /// The leaf that it is of.
    pub leaf: u32,
    /// The triangle that it was in touch with.
    pub kept: Option<u32>,
    /// One that was near lately: that saves time and changes nothing.
    pub near: Option<u32>,
}

/// Puts outward normals of triangles of points at these places [m] in the place of earlier ones; returns the longest chord
/// of those by which one has turned.
pub fn turn_normals(skin: &Skin, at: &[Vec3<f64>], normals: &mut Vec<Vec3<f64>>) -> f64 {
    normals.resize(skin.triangles.len(), Vec3::ZERO);
    let mut farthest = 0.0f64;
    for (normal, triangle) in normals.iter_mut().zip(&skin.triangles) {
        let [a, b, c] = triangle.map(|point| at[point as usize]);
        let now = (b - a).cross(c - a);
        let now = now * (1.0 / now.length());
        let squared = (now - *normal).length_squared();
        // What was no direction and now is one may have turned anyhow; what is none meets nothing.
        let is_new = now.is_finite() && !normal.is_finite();
        farthest = farthest.max(if is_new { 4.0 } else { squared });
        *normal = now;
    }
    farthest.sqrt()
}

/// How deep samples may be behind their own body's skin and others' [m], see [`Moment::deepest`].
pub fn depths(contact: &TissueContact, deepest: f64) -> [f64; 2] {
    [SHALLOW, deepest].map(|shallow| shallow * contact.law.thickness)
}

impl Moment<'_> {
    /// How much a sample faces what it has met, from 0 to 1.
    pub fn facing(&self, sample: u32, found: &Found) -> f64 {
        facing(self.outward(sample), found.closest.signed().1)
    }

    /// Outwards at a sample, of length 1.
    fn outward(&self, sample: u32) -> Vec3<f64> {
        let mean = self.now.mean_normal(sample);
        mean * (1.0 / mean.length())
    }

    /// What a sample meets within `reach` [m].
    pub fn meet(&self, looking: &Looking, reach: f64) -> Option<Found> {
        let Self { now, contact, tree, .. } = *self;
        let Looking { sample, p, leaf, kept, near } = *looking;
        let skin = now.skin;
        let body = skin.sample_bodies[sample as usize];
        let outward = self.outward(sample);
        let depths = depths(contact, self.deepest);
        let may = |triangle: u32| match skin.bodies[triangle as usize] == body {
            true => contact.itself && !is_around(skin, sample, triangle),
            false => contact.bodies,
        };
        let suits = |triangle: u32, near: &Closest| {
            let (distance, direction) = near.signed();
            if facing(outward, direction) == 0.0 {
                return false;
            }
            let is_own = skin.bodies[triangle as usize] == body;
            distance > -depths[usize::from(!is_own)]
                || kept.is_some_and(|kept| self.touch(kept, triangle))
        };
        let before =
            kept.map(|kept| Found { triangle: kept, closest: closest(p, now.corners(kept)) });
        // Whose nearest point is on its border it has slid off, and that would hold it back.
        let is_on = |near: &Closest| near.weights.iter().all(|weight| *weight > 0.0);
        let before = before.filter(|at| is_on(&at.closest) && suits(at.triangle, &at.closest));
        let query = Query { p, outward, reach, depths, body, leaf, kept, first: near };
        let found = tree.nearest(now, &query, may, suits);
        // In a hollow two triangles may be as near, and what went from one to the other and back would never be at rest.
        let far = |found: &Found| found.closest.away.length();
        let stays = before.filter(|before| {
            let nearest = found.as_ref().map_or(0.0, far);
            far(before) <= nearest + STAYS * contact.law.thickness
        });
        stays.or(found)
    }

    /// Whether two triangles are the same or have a point in common.
    fn touch(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a, b].map(|triangle| self.now.skin.triangles[triangle as usize]);
        a.iter().any(|point| b.contains(point))
    }
}

/// How much a sample with an outward normal faces what lies against a direction.
fn facing(outward: Vec3<f64>, direction: Vec3<f64>) -> f64 {
    let cosine = -outward.dot(direction);
    let [none, whole] = FACING;
    let share = ((cosine - none) / (whole - none)).clamp(0.0, 1.0);
    // Zero also for a NaN.
    if share > 0.0 { share * share * (3.0 - 2.0 * share) } else { 0.0 }
}
