//! Vertex normals, which make a triangle surface look smooth.

use crate::scalar::{Real, Vec3};

/// Unit normals of the vertices of a triangle surface, shape `[vertex_count]`: the sum of the
/// normals of the triangles around a vertex, weighted by their areas.
///
/// A vertex without triangles, or whose triangles cancel, gets the zero vector. A triangle that
/// names a vertex beyond `positions` is passed over.
pub fn vertex_normals<S: Real>(positions: &[Vec3<S>], triangles: &[[u32; 3]]) -> Vec<Vec3<S>> {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| vertex as usize);
        if a.max(b).max(c) >= positions.len() {
            continue;
        }
        // The cross product is as long as twice the area: the weight.
        let weighted = (positions[b] - positions[a]).cross(positions[c] - positions[a]);
        for vertex in [a, b, c] {
            normals[vertex] += weighted;
        }
    }
    for normal in &mut normals {
        let length = normal.length();
        *normal = if length > S::ZERO { *normal * (S::ONE / length) } else { Vec3::ZERO };
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::distance::Sphere;
    use crate::mesh::tetrahedralize::surface;
    use crate::scalar::vec3;

    #[test]
    fn normals_of_a_sphere_point_outwards() {
        let skin = surface(&Sphere { center: Vec3::ZERO, radius: 1.0 }, 0.1).unwrap();
        for (&x, normal) in
            skin.vertices.iter().zip(vertex_normals(&skin.vertices, &skin.triangles))
        {
            // Triangles with edges h are tilted against the sphere by at most about h / 2 r.
            assert!(normal.dot(x) > 1.0 - 0.1_f64.powi(2));
        }
    }

    #[test]
    fn larger_triangles_weigh_more_and_bad_ones_nothing() {
        let positions = [
            vec3(0.0_f32, 0.0, 0.0),
            vec3(2.0, 0.0, 0.0),
            vec3(0.0, 1.0, 0.0),
            vec3(0.0, 0.0, 1.0),
            vec3(9.0, 9.0, 9.0),
        ];
        let normals = vertex_normals(&positions, &[[0, 1, 2], [0, 2, 3], [0, 1, 77]]);
        // Areas 1 and 1/2, normals z and x.
        let expected = vec3(1.0, 0.0, 2.0) * (1.0 / 5.0_f32.sqrt());
        assert!((normals[0] - expected).length() < 4.0 * f32::EPSILON);
        assert_eq!(normals[4], Vec3::ZERO);
    }
}
