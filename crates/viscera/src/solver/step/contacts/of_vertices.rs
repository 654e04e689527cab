//! Contact at vertices: what XPBD's rebase takes of it.
//!
//! ```text
//! Mh_i = (m_i + kappa d_i) I + dt^2 sum_s |b_is| sum_a |b_as| (C_s + turning I)         3 x 3, positive definite
//! x_i -= theta Mh_i^-1 r_i
//! ```
//!
//! Weights, not their squares: the row sums of all blocks, as for every other bound of the rebase. The sweep's inverse
//! masses know nothing of contact: with it in them, what is sheared along a tool would freeze.

use crate::layout::Layout;
use crate::scalar::{Mat3, Real};

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
        let on_skin = layout.skin.iter().flat_map(|skin| {
            let of_points = skin.skin.points.iter().flat_map(|point| &point.vertices);
            skin.samples.iter().flat_map(|sample| &sample.vertices).chain(of_points)
        });
        for &v in layout.samples.iter().flat_map(|sample| &sample.vertices).chain(on_skin) {
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

    /// Forgets all blocks.
    pub fn clear(&mut self) {
        for v in self.vertices.drain(..) {
            self.places[v as usize] = NONE;
        }
        self.blocks.clear();
    }

    /// Adds a block [kg] to that of a vertex.
    pub fn add(&mut self, v: u32, block: Mat3<f64>) {
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
