//! The vertices that pairs bear on, each once.
//!
//! ```text
//! p - q = sum_i w_i x_i,   w: weights of the sample, less those of the triangle's point;   up to 16 vertices
//! ```
//!
//! Points of fine surfaces hang on the corners of tetrahedra that they share: of 16 corners about half are different ones.

use std::ops::Range;

use crate::contact::Pair;
use crate::layout::{LaidSample, LaidSkin};
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};

/// Of all pairs, in a row.
#[derive(Clone, Debug, Default)]
pub(super) struct Stencils {
    vertices: Vec<u32>,
    weights: Vec<f64>,
    /// Where each begins, and the end of the last.
    first: Vec<u32>,
}

/// Of one pair.
#[derive(Clone, Copy)]
pub(super) struct Stencil<'a> {
    vertices: &'a [u32],
    weights: &'a [f64],
}

impl Stencils {
    /// Room for so many pairs on a skin.
    pub fn new(skin: &LaidSkin, pairs: usize) -> Self {
        let bearing = |weights: &[f64; 4]| weights.iter().filter(|weight| **weight != 0.0).count();
        let of_points = skin.skin.points.iter().map(|point| bearing(&point.weights)).max();
        let of_samples = skin.samples.iter().map(|sample| bearing(&sample.weights)).max();
        let most = of_samples.unwrap_or(0) + 3 * of_points.unwrap_or(0);
        let mut first = Vec::with_capacity(pairs + 1);
        first.push(0);
        let room = most * pairs;
        Self { vertices: Vec::with_capacity(room), weights: Vec::with_capacity(room), first }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        (self.vertices.capacity() + self.first.capacity()) * size_of::<u32>()
            + self.weights.capacity() * size_of::<f64>()
    }

    pub fn clear(&mut self) {
        self.vertices.clear();
        self.weights.clear();
        self.first.truncate(1);
    }

    /// Adds that of a pair, the next one.
    pub fn push(&mut self, skin: &LaidSkin, pair: &Pair, sample: &LaidSample) {
        let start = self.vertices.len();
        let mut add = |v: u32, weight: f64| {
            if weight == 0.0 {
                return;
            }
            match self.vertices[start..].iter().position(|&known| known == v) {
                Some(at) => self.weights[start + at] += weight,
                None => {
                    self.vertices.push(v);
                    self.weights.push(weight);
                }
            }
        };
        sample.vertices.iter().zip(&sample.weights).for_each(|(&v, &weight)| add(v, weight));
        skin.each_corner(pair.triangle, &pair.weights, |v, weight| add(v as u32, -weight));
        self.first.push(self.vertices.len() as u32);
    }

    /// That of a pair by its number.
    pub fn of(&self, pair: usize) -> Stencil<'_> {
        let range: Range<usize> = self.first[pair] as usize..self.first[pair + 1] as usize;
        Stencil { vertices: &self.vertices[range.clone()], weights: &self.weights[range] }
    }
}

impl<'a> Stencil<'a> {
    /// Vertices and their weights.
    pub fn each(self) -> impl Iterator<Item = (usize, f64)> + 'a {
        self.vertices.iter().map(|&v| v as usize).zip(self.weights.iter().copied())
    }

    /// From the triangle's point to the sample, of something that vertices have.
    pub fn sum<S: Real>(self, of: impl Fn(usize) -> Vec3<S>) -> Vec3<f64> {
        self.each().fold(Vec3::ZERO, |sum, (v, weight)| sum + of(v).cast::<f64>() * weight)
    }

    /// The same at places of vertices, or along a direction [m].
    pub fn away<S: Real>(self, x: &[Point<S>]) -> Vec3<f64> {
        self.sum(|v| x[v].vec3())
    }

    /// The sum of the magnitudes of all weights.
    pub fn size(self) -> f64 {
        self.weights.iter().map(|weight| weight.abs()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Bond, Skin, TissueContact};
    use crate::layout::Layout;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::embed::Embedding;
    use crate::mesh::shapes;
    use crate::model::{Model, ModelBuilder};
    use crate::scalar::vec3;
    use crate::settings::SolverSettings;

    /// A fine surface on coarse tetrahedra, which meets itself.
    fn model() -> Model<f64> {
        let liver = shapes::liver(0.04, 1.0).expect("a liver");
        let law = MaterialModel::StableNeoHookean;
        let tissue = Material::new(law, 8e3, 0.45, 1050.0).expect("legal");
        let mut builder = ModelBuilder::new();
        builder.add_body(&liver.tets, &tissue).expect("a body");
        let embedding = Embedding::new(&liver.tets, &liver.surface).expect("a surface");
        let mut skin = Skin::default();
        skin.add_embedded(0, (&liver.surface, &embedding), (0, 0), builder.positions());
        builder.set_skin(skin, &TissueContact { itself: true, ..TissueContact::default() });
        builder.build().expect("a model")
    }

    /// Vertices that both have come once, and the way is that between their places.
    #[test]
    fn a_stencil_is_the_way_between_two_points() {
        let layout = Layout::new(&model(), &SolverSettings::default());
        let skin = layout.skin.as_ref().expect("tissue that meets tissue");
        let number = |i: usize| (i as f64 * 0.618_034) % 1.0;
        let place = |i: usize| vec3(number(3 * i), number(3 * i + 1), number(3 * i + 2));
        let x: Vec<Point<f64>> =
            (0..layout.vertex_count()).map(|i| Point::new(place(i), 0.0)).collect();
        let count = skin.skin.triangles.len();
        let mut stencils = Stencils::new(skin, skin.samples.len());
        let room = stencils.vertices.capacity();
        let pair = |sample: usize| Pair {
            sample: sample as u32,
            // Around the sample, and elsewhere.
            triangle: (sample * [2, 7][sample % 2] % count) as u32,
            weights: [0.2, 0.3, 0.5],
            normal: vec3(0.0, 0.0, 1.0),
            offset: Vec3::ZERO,
            bond: Bond::Tie { number: 0, stiffness: 1.0, rest: Vec3::ZERO },
        };
        let mut shared = 0;
        for (sample, laid) in skin.samples.iter().enumerate() {
            stencils.push(skin, &pair(sample), laid);
        }
        for (sample, laid) in skin.samples.iter().enumerate() {
            let Pair { triangle, weights, .. } = pair(sample);
            let stencil = stencils.of(sample);
            let way = laid.place(&x) - skin.place(triangle, &weights, &x);
            assert!((stencil.away(&x) - way).length() < 1e-12, "{sample}");
            let mut vertices: Vec<usize> = stencil.each().map(|(v, _)| v).collect();
            let all = vertices.len();
            vertices.sort_unstable();
            vertices.dedup();
            assert_eq!(vertices.len(), all, "{sample}");
            let size: f64 = stencil.each().map(|(_, weight)| weight.abs()).sum();
            assert_eq!(stencil.size(), size);
            shared += usize::from(all < 16);
        }
        assert!(shared > 0);
        assert_eq!(stencils.vertices.capacity(), room, "a step takes no memory");
    }
}
