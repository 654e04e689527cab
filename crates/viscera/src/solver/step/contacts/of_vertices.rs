//! Contact at vertices: what XPBD's rebase takes of it.
//!
//! ```text
//! Mh_i = (m_i + kappa d_i) I + dt^2 sum_s |b_is| sum_a |b_as| (C_s + turning I)         3 x 3, positive definite
//! x_i -= theta Mh_i^-1 r_i
//! ```
//!
//! Weights, not their squares: the row sums of all blocks, as for every other bound of the rebase. The sweep's inverse
//! masses know nothing of contact: with it in them, what is sheared along a tool would freeze.

use super::Contacts;
use crate::layout::Layout;
use crate::scalar::lanes::Point;
use crate::scalar::{Mat3, Real, Vec3};
use crate::solver::step::data::{Step, copies_of};

/// No place.
const NONE: u32 = u32::MAX;

/// Blocks of the vertices that contact bears on.
#[derive(Clone, Debug, Default)]
pub struct OfVertices {
    /// Of each vertex the place of its block.
    places: Vec<u32>,
    vertices: Vec<u32>,
    /// [kg].
    blocks: Vec<Mat3<f64>>,
}

impl OfVertices {
    /// Room for all vertices that have samples.
    pub fn new<S: Real>(layout: &Layout<S>) -> Self {
        let mut places = vec![NONE; layout.vertex_count()];
        let mut count = 0;
        for &v in layout.samples.iter().flat_map(|sample| &sample.vertices) {
            count += usize::from(std::mem::replace(&mut places[v as usize], 0) == NONE);
        }
        places.fill(NONE);
        Self { places, vertices: Vec::with_capacity(count), blocks: Vec::with_capacity(count) }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.places[..])
            + self.vertices.capacity() * size_of::<u32>()
            + self.blocks.capacity() * size_of::<Mat3<f64>>()
    }

    /// The block of a vertex [kg], where contact bears on it.
    pub fn block(&self, v: usize) -> Option<&Mat3<f64>> {
        match self.places.get(v) {
            None | Some(&NONE) => None,
            Some(&place) => self.blocks.get(place as usize),
        }
    }

    fn clear(&mut self) {
        for v in self.vertices.drain(..) {
            self.places[v as usize] = NONE;
        }
        self.blocks.clear();
    }

    fn add(&mut self, v: u32, block: Mat3<f64>) {
        let place = &mut self.places[v as usize];
        if *place == NONE {
            *place = self.blocks.len() as u32;
            self.vertices.push(v);
            self.blocks.push(Mat3::ZERO);
        }
        let sum = &mut self.blocks[*place as usize];
        *sum = *sum + block;
    }
}

impl Contacts {
    /// Adds `dt^2` times all forces of contact at `x` to the first copy of each vertex, and finds the blocks.
    pub fn load_vertices<S: Real>(
        &mut self,
        step: &Step<'_, S>,
        x: &[Point<S>],
        loads: &mut [Point<S>],
    ) {
        let mut of_vertices = std::mem::take(&mut self.of_vertices);
        of_vertices.clear();
        let squared = step.dt * step.dt;
        for part in 0..step.layout.part_count() {
            self.each(step, part, x, |sample, _, _, felt| {
                if felt.force == Vec3::ZERO && felt.drag == 0.0 {
                    return;
                }
                let block = (felt.curvature() + Mat3::IDENTITY * felt.turning) * squared;
                let sum: f64 = sample.weights.iter().map(|weight| weight.abs()).sum();
                for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
                    if weight == 0.0 {
                        continue;
                    }
                    let first = copies_of(step.layout, v as usize).start;
                    let load = (felt.force * (squared * weight)).cast();
                    loads[first].add(Point::new(load, S::ZERO));
                    of_vertices.add(v, block * (weight.abs() * sum));
                }
            });
        }
        self.of_vertices = of_vertices;
    }
}
