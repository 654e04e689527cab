//! The surface on which tissue meets tissue, in the solver's numbering.

#[cfg(feature = "gpu")]
use super::joined::Joined;
use super::samples::{LaidSample, laid};
use crate::contact::skin::{Tie, mean};
use crate::contact::tree::Tree;
use crate::contact::{Skin, TissueContact};
use crate::model::{Model, Numbering};
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};
use crate::settings::SolverSettings;

/// The skin of a model.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LaidSkin {
    /// Vertices in the solver's numbering, samples in the model's order.
    pub skin: Skin,
    pub contact: TissueContact,
    /// Samples, part by part.
    pub samples: Vec<LaidSample>,
    /// The part of each sample, in the model's order.
    pub sample_parts: Vec<u32>,
    /// Of each triangle.
    pub parts: Vec<u32>,
    /// Of each triangle, Young's modulus over the length of edges there [Pa/m].
    pub stiffness: Vec<f64>,
    /// Ties in the order of the samples' places, with those.
    pub ties: Vec<(u32, u32)>,
    /// Of the skin at rest.
    pub tree: Tree,
    /// Where parts of the model are one.
    #[cfg(feature = "gpu")]
    pub joined: Option<Joined>,
}

impl LaidSkin {
    /// Of a model whose tissue meets tissue.
    pub fn new<S: Real>(
        model: &Model<S>,
        settings: &SolverSettings,
        numbering: &Numbering,
        part_of: &[u32],
    ) -> Option<Self> {
        // A scene with contact between bodies is refused where the method computes none; of a fold a note says so.
        if !settings.takes_contact() {
            return None;
        }
        if !model.meets_itself() && !model.ties_bodies() {
            return None;
        }
        let of = |v: u32| numbering.of(v) as u32;
        let skin = model.skin.renumbered(of, &model.tet_vertices);
        let samples = laid(model, &model.skin.samples, numbering, part_of);
        let part = |triangle: &[u32; 3]| {
            let point = &skin.points[triangle[0] as usize];
            part_of[point.vertices[0] as usize]
        };
        let (mut places, mut sample_parts) = (vec![0; samples.len()], vec![0; samples.len()]);
        for (place, sample) in (0..).zip(&samples) {
            let number = sample.number as usize;
            (places[number], sample_parts[number]) = (place, sample.part);
        }
        let tie = |(number, tie): (u32, &Tie)| (places[tie.sample as usize], number);
        let mut ties: Vec<(u32, u32)> = (0..).zip(&skin.ties).map(tie).collect();
        ties.sort_unstable();
        let points = model.skin.points.iter();
        let at: Vec<Vec3<f64>> =
            points.map(|point| mean(point.vertices, point.weights, &model.places)).collect();
        Some(Self {
            tree: Tree::new(&skin, &at),
            parts: skin.triangles.iter().map(part).collect(),
            stiffness: model.skin_stiffness(),
            contact: model.tissue_contact,
            samples,
            sample_parts,
            ties,
            skin,
            #[cfg(feature = "gpu")]
            joined: None,
        })
    }

    /// The point of a triangle with these weights, `at` the places of vertices [m].
    pub fn place<S: Real>(&self, triangle: u32, weights: &[f64; 3], at: &[Point<S>]) -> Vec3<f64> {
        let mut sum = Vec3::ZERO;
        self.each_corner(triangle, weights, |v, weight| sum += at[v].vec3().cast::<f64>() * weight);
        sum
    }

    /// Calls with the vertices that such a point hangs on, and their weights; a vertex may come more than once.
    pub fn each_corner(&self, triangle: u32, weights: &[f64; 3], mut act: impl FnMut(usize, f64)) {
        for (&point, share) in self.skin.triangles[triangle as usize].iter().zip(weights) {
            let point = &self.skin.points[point as usize];
            for (&v, &weight) in point.vertices.iter().zip(&point.weights) {
                if weight != 0.0 {
                    act(v as usize, share * weight);
                }
            }
        }
    }

    /// The part of a sample, by its number; beyond all where there is no such sample.
    pub fn part_of(&self, number: u32) -> usize {
        self.sample_parts.get(number as usize).map_or(usize::MAX, |&part| part as usize)
    }

    /// The places of a part's samples.
    pub fn samples_of(&self, part: usize) -> std::ops::Range<usize> {
        let first =
            |part: usize| self.samples.partition_point(|sample| (sample.part as usize) < part);
        first(part)..first(part + 1)
    }

    #[cfg(feature = "gpu")]
    fn joined_bytes(&self) -> usize {
        self.joined.as_ref().map_or(0, Joined::bytes)
    }

    #[cfg(not(feature = "gpu"))]
    fn joined_bytes(&self) -> usize {
        0
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.joined_bytes()
            + self.skin.bytes()
            + size_of_val(&self.samples[..])
            + size_of_val(&self.sample_parts[..])
            + size_of_val(&self.parts[..])
            + size_of_val(&self.stiffness[..])
            + size_of_val(&self.ties[..])
            + self.tree.bytes()
    }
}
