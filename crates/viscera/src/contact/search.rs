//! The point of a triangle that is nearest to another point.

use crate::mesh::nearest::nearest_weights;
use crate::scalar::Vec3;

/// The point of a triangle that is nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Barycentric weights of the corners.
    pub weights: [f64; 3],
    /// From it to the other point [m].
    pub away: Vec3<f64>,
    /// `(b - a) x (c - a)` [m^2]: outward, twice the area long.
    pub normal: Vec3<f64>,
}

/// What a query has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// The triangle's number.
    pub triangle: u32,
    /// Its nearest point.
    pub closest: Closest,
}

/// The point of a triangle nearest to `p` [m].
pub fn closest(p: Vec3<f64>, [a, b, c]: [Vec3<f64>; 3]) -> Closest {
    let weights = nearest_weights(p, [a, b, c]);
    let near = a * weights[0] + b * weights[1] + c * weights[2];
    Closest { weights, away: p - near, normal: (b - a).cross(c - a) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    /// Numbers between -1 and 1 of a fixed sequence.
    fn number(i: usize, step: f64) -> f64 {
        2.0 * ((i as f64 * step) % 1.0) - 1.0
    }

    fn point(i: usize) -> Vec3<f64> {
        vec3(number(i, 0.618034), number(i, 0.754878), number(i, 0.569840))
    }

    /// Against the best of many points of the triangle.
    #[test]
    fn the_closest_point_is_no_farther_than_any_other() {
        for i in 1..400 {
            let triangle = [point(3 * i), point(3 * i + 1), point(3 * i + 2)];
            let p = point(7 * i + 5) * 2.0;
            let near = closest(p, triangle);
            let sum: f64 = near.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-12 && near.weights.iter().all(|w| *w >= -1e-12));
            let at = |w: [f64; 3]| triangle[0] * w[0] + triangle[1] * w[1] + triangle[2] * w[2];
            assert!((p - at(near.weights) - near.away).length() < 1e-12);
            let count = 24;
            for (u, v) in (0..=count).flat_map(|u| (0..=count - u).map(move |v| (u, v))) {
                let [u, v] = [u, v].map(|k| f64::from(k) / f64::from(count));
                let other = (p - at([1.0 - u - v, u, v])).length();
                assert!(near.away.length() <= other + 1e-12, "{i}");
            }
        }
    }
}
