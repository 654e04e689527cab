//! Smooth normals that respect sharp edges.
//!
//! Each corner of a triangle has its own normal: the sum over the triangles around the vertex that
//! do not lie across a crease, weighted so that the result is exact on a sphere (N. Max, "Weights
//! for computing vertex normals from facet normals", 1999):
//!
//! ```text
//! n = sum a x b / (|a|^2 |b|^2)        a, b: the two edges of a triangle that leave the vertex
//! ```

use viscera::scalar::Vec3;

use crate::camera::unit;

/// Cosine of the angle between triangles from which an edge is sharp: 66 degrees. Coarse organs
/// have smooth places with 45 degrees, beams have edges with 90.
const CREASE_COSINE: f64 = 0.4;

/// Triangles around one vertex beyond which creases are not looked for: the search is quadratic,
/// and no tissue has such a vertex.
const MOST_NEIGHBORS: usize = 64;

/// One normal for each corner of each triangle, shape [triangle_count]. Zero where there is none
/// (no area, or a position that is not finite). All indices must be in range.
pub(crate) fn corner_normals(
    positions: &[Vec3<f64>],
    triangles: &[[u32; 3]],
) -> Vec<[Vec3<f64>; 3]> {
    let mut face_normals = Vec::with_capacity(triangles.len());
    let mut weighted = Vec::with_capacity(triangles.len());
    let mut first_corner = vec![0u32; positions.len() + 1];
    for triangle in triangles {
        let x = triangle.map(|v| positions[v as usize]);
        face_normals.push(unit((x[1] - x[0]).cross(x[2] - x[0])));
        weighted.push([0, 1, 2].map(|c| {
            let (a, b) = (x[(c + 1) % 3] - x[c], x[(c + 2) % 3] - x[c]);
            let n = a.cross(b) * (1.0 / (a.length_squared() * b.length_squared()));
            if n.is_finite() { n } else { Vec3::ZERO }
        }));
        for &v in triangle {
            first_corner[v as usize + 1] += 1;
        }
    }
    for v in 0..positions.len() {
        first_corner[v + 1] += first_corner[v];
    }
    // Corners sorted by vertex: corner 3 t + c belongs to triangle t.
    let mut corners = vec![0u32; 3 * triangles.len()];
    let mut next = first_corner.clone();
    for (corner, &v) in triangles.as_flattened().iter().enumerate() {
        corners[next[v as usize] as usize] = corner as u32;
        next[v as usize] += 1;
    }

    let sum_around = |vertex: u32, accepts: &dyn Fn(Vec3<f64>) -> bool| {
        let range = first_corner[vertex as usize]..first_corner[vertex as usize + 1];
        let mut sum = Vec3::ZERO;
        for &corner in &corners[range.start as usize..range.end as usize] {
            let (t, c) = (corner as usize / 3, corner as usize % 3);
            if accepts(face_normals[t]) {
                sum += weighted[t][c];
            }
        }
        unit(sum)
    };
    let mut crowded = vec![None; positions.len()];
    triangles
        .iter()
        .zip(&face_normals)
        .map(|(triangle, &own)| {
            triangle.map(|v| {
                let count = first_corner[v as usize + 1] - first_corner[v as usize];
                if count as usize > MOST_NEIGHBORS {
                    return *crowded[v as usize].get_or_insert_with(|| sum_around(v, &|_| true));
                }
                sum_around(v, &|other| own.dot(other) > CREASE_COSINE)
            })
        })
        .collect()
}
