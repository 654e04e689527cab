//! Signed distance functions: shapes as numbers, negative inside, zero on the surface.
//!
//! Sphere, capsule and cuboid are exact distances. The ellipsoid and the smooth combinations are
//! not: their sign is exact and their value is a distance only to first order near the surface,
//! which is all that meshing asks for.
//!
//! Smooth union with blend length `k` (cubic polynomial, twice continuously differentiable):
//!
//! ```text
//! h = max(k - |a - b|, 0) / k        union(a, b) = min(a, b) - k h^3 / 6
//! subtraction(a, b) = -union(-a, b)
//! ```

use crate::scalar::{Mat3, Vec3, vec3};

/// A shape given by its signed distance.
pub trait SignedDistance {
    /// Distance to the surface `[m]`: negative inside, zero on the surface, positive outside.
    fn distance(&self, point: Vec3<f64>) -> f64;

    /// Lower and upper corner `[m]` of a box that holds the whole shape.
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>);
}

impl<T: SignedDistance + ?Sized> SignedDistance for &T {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        (**self).distance(point)
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        (**self).bounds()
    }
}

impl<T: SignedDistance + ?Sized> SignedDistance for Box<T> {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        (**self).distance(point)
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        (**self).bounds()
    }
}

/// A shape whose surface lies so much further out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset<A> {
    /// The shape.
    pub shape: A,
    /// How much [m]; inwards below zero.
    pub by: f64,
}

impl<A: SignedDistance> SignedDistance for Offset<A> {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        self.shape.distance(point) - self.by
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        let (lower, upper) = self.shape.bounds();
        let more = Vec3::splat(self.by.max(0.0));
        (lower - more, upper + more)
    }
}

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre `[m]`.
    pub center: Vec3<f64>,
    /// Radius `[m]`.
    pub radius: f64,
}

impl SignedDistance for Sphere {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        (point - self.center).length() - self.radius
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        let reach = Vec3::splat(self.radius);
        (self.center - reach, self.center + reach)
    }
}

/// All points within a radius of a line segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// First end of the segment `[m]`.
    pub start: Vec3<f64>,
    /// Other end of the segment `[m]`.
    pub end: Vec3<f64>,
    /// Radius `[m]`.
    pub radius: f64,
}

impl SignedDistance for Capsule {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        let (axis, offset) = (self.end - self.start, point - self.start);
        let length_squared = axis.length_squared();
        // Both ends in one place: a ball.
        let fraction = if length_squared > 0.0 {
            (offset.dot(axis) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (offset - axis * fraction).length() - self.radius
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        let reach = Vec3::splat(self.radius);
        (self.start.min(self.end) - reach, self.start.max(self.end) + reach)
    }
}

/// A box with edges along the axes, its edges and corners rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Centre `[m]`.
    pub center: Vec3<f64>,
    /// Half of the edge lengths `[m]`.
    pub half_size: Vec3<f64>,
    /// Radius of the rounded edges `[m]`, at most the smallest half size; zero is sharp.
    pub rounding: f64,
}

impl SignedDistance for Cuboid {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        let p = point - self.center;
        let q = vec3(p.x.abs(), p.y.abs(), p.z.abs()) - self.half_size + Vec3::splat(self.rounding);
        let outside = q.max(Vec3::ZERO).length();
        let inside = q.x.max(q.y).max(q.z).min(0.0);
        outside + inside - self.rounding
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        (self.center - self.half_size, self.center + self.half_size)
    }
}

/// An ellipsoid with axes along the coordinate axes. Sign exact; the value is the first-order
/// distance `k0 (k0 - 1) / k1` with `k0 = |p / r|`, `k1 = |p / r^2|`, exact on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Centre `[m]`.
    pub center: Vec3<f64>,
    /// Half axes `[m]`.
    pub radii: Vec3<f64>,
}

impl SignedDistance for Ellipsoid {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        let (p, r) = (point - self.center, self.radii);
        let scaled = vec3(p.x / r.x, p.y / r.y, p.z / r.z);
        let k0 = scaled.length();
        let k1 = vec3(scaled.x / r.x, scaled.y / r.y, scaled.z / r.z).length();
        if k1 > 0.0 { k0 * (k0 - 1.0) / k1 } else { -r.x.min(r.y).min(r.z) }
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        (self.center - self.radii, self.center + self.radii)
    }
}

/// Two shapes run together, the crease between them filled over a blend length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothUnion<A, B> {
    /// One shape.
    pub first: A,
    /// The other shape.
    pub second: B,
    /// Blend length `[m]`, positive: a fillet of about this radius; adds at most a sixth of it.
    pub blend: f64,
}

impl<A: SignedDistance, B: SignedDistance> SignedDistance for SmoothUnion<A, B> {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        smooth_minimum(self.first.distance(point), self.second.distance(point), self.blend)
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        let (a, b) = (self.first.bounds(), self.second.bounds());
        // The fillet adds blend / 6 to exact distances; the rest is for those that are not.
        let margin = Vec3::splat(self.blend);
        (a.0.min(b.0) - margin, a.1.max(b.1) + margin)
    }
}

/// One shape less another, the rim rounded over a blend length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothSubtraction<A, B> {
    /// The shape that is cut.
    pub shape: A,
    /// The shape that is taken away.
    pub removed: B,
    /// Blend length `[m]`, positive: the rim is rounded with about this radius.
    pub blend: f64,
}

impl<A: SignedDistance, B: SignedDistance> SignedDistance for SmoothSubtraction<A, B> {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        let (kept, removed) = (self.shape.distance(point), self.removed.distance(point));
        -smooth_minimum(-kept, removed, self.blend)
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        self.shape.bounds()
    }
}

/// A shape turned, scaled and moved: `x = rotation * (scale * x_local) + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed<A> {
    /// The shape in its own frame.
    pub shape: A,
    /// A rotation matrix.
    pub rotation: Mat3<f64>,
    /// Positive factor on all lengths.
    pub scale: f64,
    /// Where the local origin comes to lie `[m]`.
    pub translation: Vec3<f64>,
}

impl<A: SignedDistance> SignedDistance for Placed<A> {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        let local = self.rotation.transpose() * (point - self.translation) * (1.0 / self.scale);
        self.shape.distance(local) * self.scale
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        let (lower, upper) = self.shape.bounds();
        let corner = |index: usize| {
            let pick = |axis: usize| if index >> axis & 1 == 0 { lower[axis] } else { upper[axis] };
            self.rotation * (vec3(pick(0), pick(1), pick(2)) * self.scale) + self.translation
        };
        (1..8).map(corner).fold((corner(0), corner(0)), |(low, high), x| (low.min(x), high.max(x)))
    }
}

/// The rotation by an angle `[rad]` about an axis of any length: Rodrigues' formula.
pub fn rotation_about(axis: Vec3<f64>, angle: f64) -> Mat3<f64> {
    let n = axis * (1.0 / axis.length());
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    let cross =
        Mat3::from_columns(vec3(0.0, n.z, -n.y), vec3(-n.z, 0.0, n.x), vec3(n.y, -n.x, 0.0));
    Mat3::IDENTITY * cosine + cross * sine + Mat3::outer(n, n) * (1.0 - cosine)
}

/// The smaller of two distances, the step between them rounded over a blend length.
pub fn smooth_minimum(a: f64, b: f64, blend: f64) -> f64 {
    let h = (blend - (a - b).abs()).max(0.0) / blend;
    // A blend of zero is the plain minimum: 0 / 0 must not spoil it.
    if h > 0.0 { a.min(b) - h * h * h * blend / 6.0 } else { a.min(b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a grid through and around shapes of about unit size, off the symmetry planes.
    fn points() -> impl Iterator<Item = Vec3<f64>> {
        let at = |i: i32| f64::from(i) * 0.31 - 1.8;
        (0..1728).map(move |n| vec3(at(n % 12), at(n / 12 % 12), at(n / 144)))
    }

    fn slope(shape: &dyn SignedDistance, x: Vec3<f64>) -> f64 {
        let h = 1e-5;
        let along = |axis: Vec3<f64>| {
            (shape.distance(x + axis * h) - shape.distance(x - axis * h)) / (2.0 * h)
        };
        vec3(along(vec3(1.0, 0.0, 0.0)), along(vec3(0.0, 1.0, 0.0)), along(vec3(0.0, 0.0, 1.0)))
            .length()
    }

    const BALL: Sphere = Sphere { center: vec3(0.1, 0.2, -0.1), radius: 0.7 };
    const PILL: Capsule =
        Capsule { start: vec3(-0.5, 0.0, 0.1), end: vec3(0.4, 0.3, 0.2), radius: 0.4 };
    const CRATE: Cuboid =
        Cuboid { center: vec3(0.1, 0.0, 0.0), half_size: vec3(0.5, 0.6, 0.7), rounding: 0.1 };
    const EGG: Ellipsoid = Ellipsoid { center: vec3(0.1, -0.1, 0.0), radii: vec3(0.9, 0.5, 0.7) };

    #[test]
    fn exact_distances_have_slope_one_outside() {
        let shapes: [&dyn SignedDistance; 3] = [&BALL, &PILL, &CRATE];
        for shape in shapes {
            for x in points().filter(|&x| shape.distance(x) > 0.01) {
                // Central differences: h^2 times the third derivative, plus round-off over h.
                assert!((slope(shape, x) - 1.0).abs() < 1e-4, "{x:?}");
            }
        }
    }

    #[test]
    fn an_ellipsoid_has_the_right_sign_and_slope_one_on_its_surface() {
        for direction in points() {
            let n = direction * (1.0 / direction.length());
            let x = EGG.center + n.scale(EGG.radii);
            assert!(EGG.distance(EGG.center + n.scale(EGG.radii) * 0.999) < 0.0);
            assert!(EGG.distance(EGG.center + n.scale(EGG.radii) * 1.001) > 0.0);
            assert!((slope(&EGG, x) - 1.0).abs() < 1e-4);
        }
        assert_eq!(EGG.distance(EGG.center), -0.5);
    }

    #[test]
    fn a_union_holds_both_shapes_and_a_subtraction_nothing_of_what_was_removed() {
        let both = SmoothUnion { first: BALL, second: PILL, blend: 0.2 };
        let rest = SmoothSubtraction { shape: BALL, removed: PILL, blend: 0.2 };
        for x in points() {
            let (a, b) = (BALL.distance(x), PILL.distance(x));
            assert!(both.distance(x) <= a.min(b) && both.distance(x) >= a.min(b) - 0.2 / 6.0);
            assert!(rest.distance(x) >= a.max(-b) && rest.distance(x) <= a.max(-b) + 0.2 / 6.0);
        }
        assert_eq!(smooth_minimum(2.0, 1.0, 0.0), 1.0);
        assert_eq!(smooth_minimum(1.0, 1.0, 0.0), 1.0);
    }

    #[test]
    fn bounds_hold_the_shape() {
        let rotation = rotation_about(vec3(1.0, 2.0, -1.0), 0.7);
        let translation = vec3(0.2, -0.1, 0.3);
        let placed = Placed { shape: EGG, rotation, scale: 1.2, translation };
        let both = SmoothUnion { first: EGG, second: PILL, blend: 0.3 };
        let shapes: [&dyn SignedDistance; 6] = [&BALL, &PILL, &CRATE, &EGG, &placed, &both];
        for shape in shapes {
            let (lower, upper) = shape.bounds();
            for x in points().filter(|&x| shape.distance(x) <= 0.0) {
                assert_eq!((x.max(lower), x.min(upper)), (x, x));
            }
        }
    }

    #[test]
    fn placing_a_shape_moves_its_points() {
        let rotation = rotation_about(vec3(0.0, 0.0, 2.0), std::f64::consts::FRAC_PI_2);
        let placed =
            Placed { shape: CRATE, rotation, scale: 2.0, translation: vec3(1.0, 0.0, 0.0) };
        for x in points() {
            let moved = vec3(-x.y, x.x, x.z) * 2.0 + vec3(1.0, 0.0, 0.0);
            assert!((placed.distance(moved) - 2.0 * CRATE.distance(x)).abs() < 1e-14);
        }
    }
}
