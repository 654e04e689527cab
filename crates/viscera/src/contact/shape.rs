//! Shapes of tools and obstacles, as signed distances in the tool's own frame.
//!
//! ```text
//! half-space   z                                   solid below z = 0
//! sphere       |x| - r                             around the origin
//! capsule      |x - (0, 0, clamp(z, 0, L))| - r    tip at the origin, shaft along +z
//! rounded box  |x - clamp(x, -c, c)| - r,  c = half extents - r;   inside c: max_i(|x_i| - c_i) - r
//! mesh         of a closed surface, on a grid (`distance_grid/`)
//! ```
//!
//! All but the last are convex, so that a tangent plane never has more of the tool in front of it than the distance says. A
//! mesh may have: no rule of contact may ask how far it reaches along a plane's normal. Where several points of the surface
//! are the nearest (axis of a capsule, middle of a box), the lowest axis decides.

use std::sync::Arc;

use super::distance::Distance;
use super::distance_grid::DistanceGrid;
use crate::scalar::{Vec3, vec3};

/// The shape of a tool or an obstacle. A copy of it takes no memory.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Solid below the plane `z = 0`: a table, a floor, a wall.
    HalfSpace,
    /// A ball around the origin.
    Sphere {
        /// [m].
        radius: f64,
    },
    /// A round rod: the middle of its tip's ball is the origin, its shaft goes along +z.
    Capsule {
        /// From the middle of one end's ball to the middle of the other's [m].
        length: f64,
        /// [m].
        radius: f64,
    },
    /// A box around the origin with rounded edges.
    RoundedBox {
        /// From the middle to the faces [m].
        half: Vec3<f64>,
        /// Of the edges [m], at most the smallest half extent.
        radius: f64,
    },
    /// Any closed surface.
    Mesh(Arc<DistanceGrid>),
}

/// Inside a sphere the curvature of the distance has no bound; up to this share of the radius it counts.
const INNERMOST: f64 = 0.1;

impl Shape {
    /// Distance and its gradient at a point [m] in the tool's frame.
    pub fn distance(&self, x: Vec3<f64>) -> Distance {
        match *self {
            Self::HalfSpace => {
                Distance { value: x.z, normal: vec3(0.0, 0.0, 1.0), slope: 1.0, curvature: 0.0 }
            }
            Self::Mesh(ref grid) => grid.distance(x),
            Self::Sphere { radius } => from_core(x, radius),
            Self::Capsule { length, radius } => {
                from_core(x - vec3(0.0, 0.0, x.z.clamp(0.0, length)), radius)
            }
            Self::RoundedBox { half, radius } => {
                let core = half - Vec3::splat(radius);
                let away = x - x.max(-core).min(core);
                if away == Vec3::ZERO {
                    inside_box(x, core, radius)
                } else {
                    from_core(away, radius)
                }
            }
        }
    }

    /// The tangent plane `n . x = o` at a point [m] in the tool's frame, of which the distance is known: `n` of length 1, and
    /// `o` [m] so that point and plane are as far from each other as point and shape.
    pub fn tangent(&self, x: Vec3<f64>, distance: &Distance) -> (Vec3<f64>, f64) {
        let normal = match self {
            Self::Mesh(grid) => grid.normal(x),
            _ => distance.normal,
        };
        (normal, normal.dot(x) - distance.value)
    }

    /// Whether a tangent plane has all of it behind.
    pub fn is_convex(&self) -> bool {
        !matches!(self, Self::Mesh(_))
    }

    /// Whether it is the same: of closed surfaces, whether it is the same one in memory.
    pub(crate) fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Mesh(a), Self::Mesh(b)) => Arc::ptr_eq(a, b),
            (Self::Mesh(_), _) | (_, Self::Mesh(_)) => false,
            _ => self == other,
        }
    }

    /// No two points have distances that differ by more than this times the way between them.
    pub fn steepest(&self) -> f64 {
        match self {
            Self::Mesh(grid) => grid.steepest(),
            _ => 1.0,
        }
    }

    /// The smallest radius of its surface [m]: how thin it is. Infinite for a half-space.
    pub fn thinnest(&self) -> f64 {
        match *self {
            Self::HalfSpace => f64::INFINITY,
            Self::Sphere { radius } | Self::Capsule { radius, .. } => radius,
            Self::RoundedBox { half, .. } => half.x.min(half.y).min(half.z),
            Self::Mesh(ref grid) => grid.thinnest(),
        }
    }

    /// Half of how broad it is where it is narrowest [m], walls around a hollow apart: what would slip between points that are
    /// farther from each other. Infinite for a half-space.
    pub fn breadth(&self) -> f64 {
        match self {
            Self::Mesh(grid) => grid.breadth(),
            _ => self.thinnest(),
        }
    }

    /// The radius of a ball around the origin that contains it [m]; infinite for a half-space.
    pub fn reach(&self) -> f64 {
        match *self {
            Self::HalfSpace => f64::INFINITY,
            Self::Sphere { radius } => radius,
            Self::Capsule { length, radius } => length + radius,
            Self::RoundedBox { half, .. } => half.length(),
            Self::Mesh(ref grid) => grid.reach(),
        }
    }

    /// What is wrong with its sizes, in words; nothing where they are legal.
    pub fn complaint(&self) -> Option<&'static str> {
        let is_length = |length: f64| length > 0.0 && length.is_finite();
        match *self {
            // A mesh is checked where its grid is made.
            Self::HalfSpace | Self::Mesh(_) => None,
            Self::Sphere { radius } if is_length(radius) => None,
            Self::Sphere { .. } => Some("a sphere needs a radius above zero"),
            Self::Capsule { length, radius }
                if is_length(radius) && length >= 0.0 && length.is_finite() =>
            {
                None
            }
            Self::Capsule { .. } => {
                Some("a capsule needs a radius above zero and a length of zero or more")
            }
            Self::RoundedBox { half, radius } => {
                let smallest = half.x.min(half.y).min(half.z);
                let fits = half.is_finite() && smallest > 0.0 && (0.0..=smallest).contains(&radius);
                let words =
                    "a box needs sizes above zero, and edges rounded by half the smallest at most";
                (!fits).then_some(words)
            }
        }
    }
}

/// At `away` from the nearest point of the shape's core, which is rounded by `radius`.
fn from_core(away: Vec3<f64>, radius: f64) -> Distance {
    let length = away.length();
    let normal = if length > 0.0 { away * (1.0 / length) } else { vec3(1.0, 0.0, 0.0) };
    let curvature = 1.0 / length.max(INNERMOST * radius);
    Distance { value: length - radius, normal, slope: 1.0, curvature }
}

/// At a point inside the core of a box: its nearest face decides.
fn inside_box(x: Vec3<f64>, core: Vec3<f64>, radius: f64) -> Distance {
    let depth = |axis: usize| x[axis].abs() - core[axis];
    let mut nearest = 0;
    for axis in 1..3 {
        if depth(axis) > depth(nearest) {
            nearest = axis;
        }
    }
    let mut normal = Vec3::ZERO;
    normal[nearest] = if x[nearest] < 0.0 { -1.0 } else { 1.0 };
    Distance { value: depth(nearest) - radius, normal, slope: 1.0, curvature: 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [Shape; 5] = [
        Shape::HalfSpace,
        Shape::Sphere { radius: 0.4 },
        Shape::Capsule { length: 1.0, radius: 0.2 },
        Shape::RoundedBox { half: vec3(0.3, 0.5, 0.7), radius: 0.1 },
        Shape::RoundedBox { half: vec3(0.3, 0.5, 0.2), radius: 0.0 },
    ];

    /// Points of a fixed sequence in a cube of edge 2.
    fn points() -> impl Iterator<Item = Vec3<f64>> {
        let number = |i: usize, step: f64| 2.0 * ((i as f64 * step) % 1.0) - 1.0;
        (1..2000).map(move |i| vec3(number(i, 0.618034), number(i, 0.754878), number(i, 0.569840)))
    }

    #[test]
    fn the_normal_is_the_gradient() {
        for shape in SHAPES {
            for x in points() {
                let Distance { value, normal, .. } = shape.distance(x);
                assert!((normal.length() - 1.0).abs() < 1e-12);
                let h = 1e-6;
                let mut rough = Vec3::ZERO;
                for axis in 0..3 {
                    let mut step = Vec3::ZERO;
                    step[axis] = h;
                    let [a, b] = [x + step, x - step].map(|x| shape.distance(x).value);
                    rough[axis] = (a - b) / (2.0 * h);
                }
                // Next to an edge of a box, or an axis, the gradient jumps.
                let is_smooth = (rough.length() - 1.0).abs() < 1e-4;
                assert!(!is_smooth || (rough - normal).length() < 1e-4, "{shape:?} at {x:?}");
                // On the surface that the normal leads to the distance is nothing.
                if value > 0.0 {
                    assert!(shape.distance(x - normal * value).value.abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn the_curvature_covers_how_the_normal_turns() {
        for shape in SHAPES {
            for x in points() {
                let here = shape.distance(x);
                for axis in 0..3 {
                    let mut step = Vec3::ZERO;
                    step[axis] = 1e-6;
                    let turned = shape.distance(x + step).normal - here.normal;
                    let jumps = turned.length() > 1e-3;
                    assert!(jumps || turned.length() <= 1e-6 * here.curvature * 1.001 + 1e-12);
                }
            }
        }
    }

    #[test]
    fn no_tangent_plane_cuts_the_shape() {
        for shape in SHAPES {
            for x in points() {
                let here = shape.distance(x);
                if here.value <= 0.0 {
                    continue;
                }
                let (normal, offset) = shape.tangent(x, &here);
                assert!((normal.dot(x) - offset - here.value).abs() < 1e-12);
                // Seen from elsewhere the plane is no farther than the shape.
                for y in points().step_by(37) {
                    let (plane, there) = (normal.dot(y) - offset, shape.distance(y).value);
                    assert!(plane <= there + 1e-12, "{shape:?} at {x:?}, {y:?}: {plane}, {there}");
                }
            }
        }
    }

    #[test]
    fn ties_go_to_the_lowest_axis() {
        let cube = Shape::RoundedBox { half: Vec3::splat(0.5), radius: 0.1 };
        assert_eq!(cube.distance(Vec3::ZERO).normal, vec3(1.0, 0.0, 0.0));
        assert_eq!(SHAPES[2].distance(vec3(0.0, 0.0, 0.5)).normal, vec3(1.0, 0.0, 0.0));
        assert_eq!(SHAPES[2].distance(vec3(0.0, 0.0, 0.5)).value, -0.2);
    }

    #[test]
    fn sizes_that_no_shape_has_are_refused() {
        for shape in SHAPES {
            assert_eq!(shape.complaint(), None, "{shape:?}");
        }
        for shape in [
            Shape::Sphere { radius: 0.0 },
            Shape::Sphere { radius: f64::NAN },
            Shape::Capsule { length: -1.0, radius: 0.1 },
            Shape::RoundedBox { half: vec3(0.1, 0.1, 0.0), radius: 0.0 },
            Shape::RoundedBox { half: Vec3::splat(0.1), radius: 0.2 },
        ] {
            assert!(shape.complaint().is_some(), "{shape:?}");
        }
    }
}
