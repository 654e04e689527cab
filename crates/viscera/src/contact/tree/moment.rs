//! A skin at one moment.

use super::bounds::Span;
use crate::contact::skin::{Site, Skin};
use crate::scalar::Vec3;

/// A skin's points and normals.
#[derive(Clone, Copy)]
pub struct SkinNow<'a> {
    pub skin: &'a Skin,
    /// Places of points [m].
    pub at: &'a [Vec3<f64>],
    /// Normals of triangles, of length 1.
    pub normals: &'a [Vec3<f64>],
}

impl SkinNow<'_> {
    /// Places of a triangle's corners [m].
    pub fn corners(&self, triangle: u32) -> [Vec3<f64>; 3] {
        self.skin.triangles[triangle as usize].map(|point| self.at[point as usize])
    }

    /// The mean of the normals at a sample.
    pub fn mean_normal(&self, sample: u32) -> Vec3<f64> {
        match self.skin.sites[sample as usize] {
            Site::Triangle(triangle) => self.normals[triangle as usize],
            Site::Point(point) => {
                let around = self.skin.topology.around(point);
                let normals = around.iter().map(|&triangle| self.normals[triangle as usize]);
                let sum = normals.fold(Vec3::ZERO, |sum, normal| sum + normal);
                sum * (1.0 / around.len().max(1) as f64)
            }
        }
    }

    /// Outwards at a sample, of length 1, with the chord by which it may turn while no normal turns by more than a chord.
    pub(super) fn outward(&self, sample: u32, turn: f64) -> (Vec3<f64>, f64) {
        let mean = self.mean_normal(sample);
        let steady = mean.length();
        // |a/|a| - b/|b|| <= 2 |a - b|/(|a| + |b|), and the mean turns no further than the normals.
        let turn = if steady > turn { 2.0 * turn / (2.0 * steady - turn) } else { 2.0 };
        (mean * (1.0 / steady), turn)
    }

    pub(super) fn triangle_span(&self, triangle: u32) -> Span {
        self.corners(triangle).into_iter().fold(Span::NOTHING, Span::with)
    }
}
