//! What a sample of tissue meets: the nearest triangle that faces it.
//!
//! ```text
//! area times s((-n_s.nu - 0.2)/0.5), s(t) = t^2 (3 - 2 t)     how much they face each other
//! d > -dh, on the body's own skin -dh/4    unless the sample was in touch there before: thin tissue looks turned through
//! ```
//!
//! Triangles near by on the same body are left out by the mesh, never by their distance at rest: the two sides of a narrow
//! fold are as close, and meet.

use super::search::{Closest, Found, Grid, May, Query, Since, closest};
use super::skin::{Site, Skin, TissueContact};
use crate::scalar::Vec3;

/// A sample faces what it meets not at all and wholly where the cosine of the angle between its normal and the way there is
/// this. Between them its pressure grows steadily: what came and went at once would never be at rest.
const FACING: [f64; 2] = [0.2, 0.7];

/// Surfaces do not meet where the product of their outward normals is more than this, at an angle below 60 degrees. A sample
/// need not look for those where it is more than [`PARALLEL`](super::search::PARALLEL) until both have turned by `TURNED` together.
const BESIDE: f64 = 0.5;

/// [rad].
const TURNED: f64 = 0.4;

/// A sample stays with its triangle until another is nearer by this share of the thickness.
const STAYS: f64 = 0.1;

/// How deep a sample may be behind its own body's skin, in thicknesses, where it begins to touch; and behind another's in a
/// step: the far side of thin tissue looks as if it had been passed through.
const SHALLOW: f64 = 0.25;
pub const DEEPEST: f64 = 1.0;

/// Marks of vertices near a sample.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    of_vertices: Vec<u32>,
    now: u32,
}

impl Marks {
    /// Of so many vertices.
    pub fn new(count: usize) -> Self {
        Self { of_vertices: vec![0; count], now: 0 }
    }

    /// Bytes of its array.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.of_vertices[..])
    }

    /// Marks the vertices of a sample and their neighbours, and no others.
    fn set(&mut self, skin: &Skin, sample: usize) {
        if self.now == u32::MAX {
            self.of_vertices.fill(0);
            self.now = 0;
        }
        self.now += 1;
        let sample = &skin.samples[sample];
        let bearing =
            sample.vertices.iter().zip(&sample.weights).filter(|(_, weight)| **weight != 0.0);
        for (&v, _) in bearing {
            self.of_vertices[v as usize] = self.now;
            for &near in skin.topology.neighbours(v) {
                self.of_vertices[near as usize] = self.now;
            }
        }
    }

    fn are_on(&self, vertices: &[u32]) -> bool {
        vertices.iter().any(|&v| self.of_vertices[v as usize] == self.now)
    }
}

/// A skin at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// The skin.
    pub skin: &'a Skin,
    /// Places of its points [m].
    pub at: &'a [Vec3<f64>],
    /// Normals of its triangles, of length 1.
    pub normals: &'a [Vec3<f64>],
    /// Sorted grid of its triangles.
    pub grid: &'a Grid,
    /// What has moved since it was sorted.
    pub since: Since,
    /// Which tissue meets which.
    pub contact: &'a TissueContact,
    /// How deep a sample may be behind another body's skin where it begins to touch, in thicknesses.
    pub deepest: f64,
}

/// Puts outward normals of triangles of points at these places [m] in the place of earlier ones; returns the largest angle
/// [rad] by which one has turned.
pub fn turn_normals(skin: &Skin, at: &[Vec3<f64>], normals: &mut Vec<Vec3<f64>>) -> f64 {
    normals.resize(skin.triangles.len(), Vec3::ZERO);
    let mut farthest = 0.0f64;
    for (normal, triangle) in normals.iter_mut().zip(&skin.triangles) {
        let [a, b, c] = triangle.map(|point| at[point as usize]);
        let now = (b - a).cross(c - a);
        let now = now * (1.0 / now.length());
        farthest = farthest.max((now - *normal).length_squared());
        *normal = now;
    }
    // No angle is more than this many times its chord.
    farthest.sqrt() * std::f64::consts::FRAC_PI_2
}

impl Moment<'_> {
    /// Places of a triangle's corners [m].
    pub fn corners(&self, triangle: u32) -> [Vec3<f64>; 3] {
        self.skin.triangles[triangle as usize].map(|point| self.at[point as usize])
    }

    /// How much a sample faces what it has met, from 0 to 1.
    pub fn facing(&self, sample: usize, found: &Found) -> f64 {
        facing(self.outward(sample), found.closest.signed().1)
    }

    /// Outwards at a sample, of length 1.
    fn outward(&self, sample: usize) -> Vec3<f64> {
        let mean = self.mean_normal(sample);
        mean * (1.0 / mean.length())
    }

    /// The mean of the normals at a sample.
    fn mean_normal(&self, sample: usize) -> Vec3<f64> {
        match self.skin.sites[sample] {
            Site::Triangle(triangle) => self.normals[triangle as usize],
            Site::Point(point) => {
                let around = self.skin.topology.around(point);
                let normals = around.iter().map(|&triangle| self.normals[triangle as usize]);
                let sum = normals.fold(Vec3::ZERO, |sum, normal| sum + normal);
                sum * (1.0 / around.len().max(1) as f64)
            }
        }
    }

    /// By how much normals may turn [rad] until a sample may meet what [`Moment::meet`] has not counted.
    pub fn free_turn(&self, sample: usize) -> f64 {
        // The mean of normals that differ turns further than each.
        let steady = self.mean_normal(sample).length();
        if steady > 0.0 { TURNED * steady / (1.0 + steady) } else { 0.0 }
    }

    /// What a sample at `p` [m] meets within `reach` [m], `kept` being the triangle that it was in touch with; and how far
    /// the nearest triangle is that it could meet if neither turned further than [`Moment::free_turn`], at most `farther` [m].
    /// `near` was near lately: that saves time and changes nothing.
    pub fn meet(
        &self,
        marks: &mut Marks,
        (sample, p): (usize, Vec3<f64>),
        [kept, near]: [Option<u32>; 2],
        reaches: [f64; 2],
    ) -> (Option<Found>, f64) {
        let Self { skin, contact, .. } = *self;
        let body = skin.sample_bodies[sample];
        let outward = self.outward(sample);
        let mut is_marked = false;
        let may = |triangle: u32, product: f64| {
            let is_own = skin.bodies[triangle as usize] == body;
            if !(if is_own { contact.itself } else { contact.bodies }) {
                return May::Never;
            }
            if is_own {
                if !is_marked {
                    is_marked = true;
                    marks.set(skin, sample);
                }
                if marks.are_on(skin.topology.corners(triangle)) {
                    return May::Never;
                }
            }
            if product >= BESIDE { May::Later } else { May::Now }
        };
        let suits = |triangle: u32, near: &Closest| {
            let (distance, direction) = near.signed();
            if facing(outward, direction) == 0.0 {
                return false;
            }
            let is_own = skin.bodies[triangle as usize] == body;
            let shallow = if is_own { SHALLOW } else { self.deepest };
            distance > -shallow * contact.law.thickness
                || kept.is_some_and(|kept| self.touch(kept, triangle))
        };
        let before =
            kept.map(|kept| Found { triangle: kept, closest: closest(p, self.corners(kept)) });
        // Whose nearest point is on its border it has slid off, and that would hold it back.
        let is_on = |near: &Closest| near.weights.iter().all(|weight| *weight > 0.0);
        let before = before.filter(|at| is_on(&at.closest) && suits(at.triangle, &at.closest));
        let first = near.map(|near| (near, outward.dot(self.normals[near as usize])));
        let query = Query { p, outward, reaches, since: self.since, first };
        let (found, clearance) = self.grid.nearest(&query, |t| self.corners(t), may, suits);
        // In a hollow two triangles may be as near, and what went from one to the other and back would never be at rest.
        let far = |found: &Found| found.closest.away.length();
        let stays = before.filter(|before| {
            let nearest = found.as_ref().map_or(0.0, far);
            far(before) <= nearest + STAYS * contact.law.thickness
        });
        (stays.or(found), clearance)
    }

    /// Whether two triangles are the same or have a point in common.
    fn touch(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a, b].map(|triangle| self.skin.triangles[triangle as usize]);
        a.iter().any(|point| b.contains(point))
    }
}

/// How much a sample with an outward normal faces what lies against a direction.
fn facing(outward: Vec3<f64>, direction: Vec3<f64>) -> f64 {
    let cosine = -outward.dot(direction);
    let [none, whole] = FACING;
    let share = ((cosine - none) / (whole - none)).clamp(0.0, 1.0);
    // Nothing also where that is no number.
    if share > 0.0 { share * share * (3.0 - 2.0 * share) } else { 0.0 }
}
