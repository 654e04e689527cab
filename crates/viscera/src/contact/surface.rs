//! Samples of tissue's surface: the points at which it is touched.
//!
//! ```text
//! p_s = sum_a b_a x_a,   sum_a b_a = 1;   A_s: area at rest;   E/h: modulus over the mean edge of the surface there
//! ```
//!
//! Vertices alone let a probe slip between them; several samples per triangle, at the middles of its parts of equal area,
//! do not. Where a fine surface is embedded in the tetrahedra its vertices are the samples: what is seen is what touches.

use std::collections::BTreeMap;

use crate::mesh::SurfaceMesh;
use crate::mesh::embed::Embedding;
use crate::mesh::topology::{TET_EDGES, boundary_faces};
use crate::scalar::Vec3;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The vertices that it hangs on; a weight of zero where it has fewer.
    pub vertices: [u32; 4],
    /// Sum to one.
    pub weights: [f64; 4],
    /// At rest [m^2].
    pub area: f64,
    /// Mean length of edges around it [m].
    pub edge: f64,
    /// The tetrahedron that it belongs to: its tissue is touched.
    pub tet: u32,
}

/// The area-weighted middles of the parts into which a triangle is cut: barycentric weights.
fn parts_of_triangle(cuts: u32) -> Vec<[f64; 3]> {
    let mut triangles = vec![[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]];
    let middle = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
    for _ in 0..cuts {
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let centroid = |[a, b, c]: [[f64; 3]; 3]| std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0);
    triangles.into_iter().map(centroid).collect()
}

/// Samples of the faces that belong to one tetrahedron only, `4^cuts` of each, by tetrahedron.
pub fn sample_boundary(tets: &[[u32; 4]], positions: &[Vec3<f64>], cuts: u32) -> Vec<Sample> {
    let outer = boundary_faces(tets);
    let edges = mean_edges(outer.iter().map(|(_, triangle)| *triangle), positions);
    let parts = parts_of_triangle(cuts);
    let mut samples = Vec::with_capacity(outer.len() * parts.len());
    for (tet, triangle) in outer {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let area = 0.5 * (b - a).cross(c - a).length() / parts.len() as f64;
        for weights in &parts {
            let edge = (0..3).map(|i| weights[i] * edges[&triangle[i]]).sum();
            samples.push(Sample {
                vertices: [triangle[0], triangle[1], triangle[2], triangle[0]],
                weights: [weights[0], weights[1], weights[2], 0.0],
                area,
                edge,
                tet,
            });
        }
    }
    samples
}

/// Samples at the vertices of a surface that is embedded in the tetrahedra of one body, of which the first vertex and the
/// first tetrahedron have these numbers, each with the number of its vertex; `positions` [m] are those of all bodies.
pub fn sample_embedded(
    surface: &SurfaceMesh,
    embedding: &Embedding,
    positions: &[Vec3<f64>],
    first_vertex: u32,
    first_tet: u32,
) -> Vec<(u32, Sample)> {
    let mut areas = vec![0.0; surface.vertices.len()];
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|v| surface.vertices[v as usize]);
        let third = (b - a).cross(c - a).length() / 6.0;
        triangle.iter().for_each(|&v| areas[v as usize] += third);
    }
    let bound = embedding.corners().iter().zip(embedding.weights()).zip(embedding.tets());
    let sampled = (0..).zip(bound.zip(areas)).filter(|(_, (_, area))| *area > 0.0);
    sampled
        .map(|(point, (((corners, weights), tet), area))| {
            let vertices = corners.map(|v| v + first_vertex);
            // The tissue's own edges: a finer surface makes it no stiffer.
            let places = vertices.map(|v| positions[v as usize]);
            let lengths = TET_EDGES.map(|[a, b]| (places[b] - places[a]).length());
            let edge = lengths.iter().sum::<f64>() / 6.0;
            (point, Sample { vertices, weights: *weights, area, edge, tet: tet + first_tet })
        })
        .collect()
}

/// The mean length [m] of the edges of triangles around each vertex.
fn mean_edges(
    triangles: impl Iterator<Item = [u32; 3]>,
    positions: &[Vec3<f64>],
) -> BTreeMap<u32, f64> {
    let mut sums = BTreeMap::<u32, (f64, f64)>::new();
    for [a, b, c] in triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let length = (positions[to as usize] - positions[from as usize]).length();
            for end in [from, to] {
                let (sum, count) = sums.entry(end).or_default();
                (*sum, *count) = (*sum + length, *count + 1.0);
            }
        }
    }
    sums.into_iter().map(|(vertex, (sum, count))| (vertex, sum / count)).collect()
}
