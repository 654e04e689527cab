//! The point of a triangle that is nearest to another point.

use crate::scalar::Vec3;

/// Barycentric weights of the point of a triangle nearest to `p` [m]: by the regions of Ericson, "Real-time collision
/// detection", 2005, 5.1.5. Of corners in one place either will do.
pub fn nearest_weights(p: Vec3<f64>, [a, b, c]: [Vec3<f64>; 3]) -> [f64; 3] {
    let share = |part: f64, rest: f64| if part + rest > 0.0 { part / (part + rest) } else { 0.0 };
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let on_b = share(d1, -d3);
        return [1.0 - on_b, on_b, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let on_c = share(d2, -d6);
        return [1.0 - on_c, 0.0, on_c];
    }
    let va = d3 * d6 - d5 * d4;
    let (from_b, from_c) = (d4 - d3, d5 - d6);
    if va <= 0.0 && from_b >= 0.0 && from_c >= 0.0 {
        let on_c = share(from_b, from_c);
        return [0.0, 1.0 - on_c, on_c];
    }
    let sum = va + vb + vc;
    if sum <= 0.0 {
        // Without area its edges have decided, up to rounding.
        return [1.0, 0.0, 0.0];
    }
    let inverse = 1.0 / sum;
    let (on_b, on_c) = (vb * inverse, vc * inverse);
    [1.0 - on_b - on_c, on_b, on_c]
}

/// The point of a triangle nearest to a point.
pub fn closest_point_on_triangle(triangle: [Vec3<f64>; 3], point: Vec3<f64>) -> Vec3<f64> {
    let weights = nearest_weights(point, triangle);
    let corners = triangle.into_iter().zip(weights);
    corners.fold(Vec3::ZERO, |sum, (corner, weight)| sum + corner * weight)
}
