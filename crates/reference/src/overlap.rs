//! Whether tissue lies in tissue: a state of rest knows contact with tools only.

use viscera::mesh::embed::barycentric_weights;
use viscera::model::Model;
use viscera::scalar::Vec3;

/// A vertex at places `x` [m] that lies in a tetrahedron that it is no corner of, of the same body.
pub fn find_overlap(model: &Model<f64>, x: &[Vec3<f64>]) -> Option<u32> {
    model.bodies.iter().find_map(|body| {
        let of_body = model.tets().skip(body.tets.start).take(body.tets.len());
        let tets: Vec<[u32; 4]> = of_body.map(|tet| tet.vertices).collect();
        let corners = |tet: &[u32; 4]| tet.map(|v| x[v as usize]);
        // In the order of their left ends: a point is in none that begins right of it, or too far left.
        let left = |tet: &[u32; 4]| corners(tet).iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
        let right =
            |tet: &[u32; 4]| corners(tet).iter().map(|p| p.x).fold(f64::NEG_INFINITY, f64::max);
        let mut sorted: Vec<(f64, [u32; 4])> = tets.iter().map(|tet| (left(tet), *tet)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let widest = tets.iter().map(|tet| right(tet) - left(tet)).fold(0.0, f64::max);
        body.vertices.clone().map(|v| v as u32).find(|&v| {
            let place = x[v as usize];
            let first = sorted.partition_point(|(left, _)| *left < place.x - widest);
            let mut near = sorted[first..].iter().take_while(|(left, _)| *left < place.x);
            near.any(|(_, tet)| holds(&corners(tet), place))
        })
    })
}

/// Whether a point is inside a tetrahedron, not on its faces.
fn holds(corners: &[Vec3<f64>; 4], point: Vec3<f64>) -> bool {
    barycentric_weights(*corners, point).into_iter().all(|weight| weight > 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    #[test]
    fn a_tetrahedron_holds_what_is_in_it() {
        let [o, x, y, z] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(Vec3::<f64>::from_f64);
        for corners in [[o, x, y, z], [x, o, y, z]] {
            assert!(holds(&corners, vec3(0.2, 0.3, 0.4)), "either way round");
            for outside in [vec3(0.4, 0.4, 0.4), vec3(-0.1, 0.2, 0.2), vec3(0.2, -0.1, 0.2), o] {
                assert!(!holds(&corners, outside), "{outside:?}");
            }
            assert!(!holds(&corners, vec3(0.3, 0.3, 0.0)), "on a face");
        }
    }
}
