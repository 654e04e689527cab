//! Samples of the surface in the solver's numbering.

use crate::contact::{ContactLaw, Foundation, Sample};
use crate::model::{Model, Numbering};
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};

/// A point of the surface that tools touch, in the solver's numbering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LaidSample {
    /// The solver's vertices.
    pub vertices: [u32; 4],
    pub weights: [f64; 4],
    /// At rest [m^2].
    pub area: f64,
    /// Young's modulus over the length of edges there [Pa/m].
    pub stiffness: f64,
    /// The connected part.
    pub part: u32,
    /// Its number in the model.
    pub number: u32,
}

impl LaidSample {
    /// Where it is, `at` the places of vertices [m].
    pub fn place<S: Real>(&self, at: &[Point<S>]) -> Vec3<f64> {
        self.mean(|v| at[v].vec3())
    }

    /// The constants of contact between it and a tool.
    pub fn foundation(&self, law: &ContactLaw) -> Foundation {
        Foundation {
            area: self.area,
            stiffness: law.stiffness * self.stiffness,
            thickness: law.thickness,
        }
    }

    /// The mean of something that vertices have, by its weights.
    pub fn mean<S: Real>(&self, of: impl Fn(usize) -> Vec3<S>) -> Vec3<f64> {
        let corners = self.vertices.iter().zip(&self.weights);
        corners.fold(Vec3::ZERO, |sum, (&v, &weight)| sum + of(v as usize).cast::<f64>() * weight)
    }
}

/// Samples of a model, part by part.
pub(super) fn laid<S: Real>(
    model: &Model<S>,
    samples: &[Sample],
    numbering: &Numbering,
    part_of: &[u32],
) -> Vec<LaidSample> {
    let mut samples: Vec<LaidSample> = samples
        .iter()
        .enumerate()
        .map(|(number, sample)| {
            let vertices = sample.vertices.map(|v| numbering.of(v) as u32);
            LaidSample {
                vertices,
                weights: sample.weights,
                area: sample.area,
                stiffness: model.sample_stiffness(sample),
                part: part_of[vertices[0] as usize],
                number: number as u32,
            }
        })
        .collect();
    samples.sort_by_key(|sample| sample.part);
    samples
}

/// The part of each sample, in the model's order: parts have the numbers that the model gives them.
pub(super) fn parts<S: Real>(model: &Model<S>) -> Vec<u32> {
    let part = |sample: &Sample| model.part_of(sample.vertices[0]) as u32;
    model.samples.iter().map(part).collect()
}
