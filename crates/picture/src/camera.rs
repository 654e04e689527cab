//! Where a picture is taken from.
//!
//! A pinhole camera, z up. For tissue to fit between the sides of the view, with half-opening
//! tangent `t`, every position `p` (in camera axes, the camera looking along -z from `c`) must satisfy
//!
//! ```text
//! |p.x - c.x| <= t (c.z - p.z)
//! ```
//!
//! With `A = max(p.x + t p.z)` and `B = max(t p.z - p.x)` the nearest such place is
//! `c.z = (A + B) / 2t`, `c.x = (A - B) / 2`. The same holds for y; the farther `c.z` of the two wins.

use std::sync::LazyLock;

use viscera::scalar::{Vec3, vec3};

use crate::image::ImageSize;
use crate::overlay::Layout;

/// Coordinates beyond this [m] are taken for damage: they would leave no digits for the tissue.
const FARTHEST: f64 = 1e9;

/// True for a position that can be drawn.
pub(crate) fn is_drawable(p: Vec3<f64>) -> bool {
    // A comparison with NaN is false.
    p.x.abs() <= FARTHEST && p.y.abs() <= FARTHEST && p.z.abs() <= FARTHEST
}

/// A vector of length one, or zero where there is no direction.
pub(crate) fn unit(v: Vec3<f64>) -> Vec3<f64> {
    let length = v.length();
    if length > 0.0 && length.is_finite() { v * (1.0 / length) } else { Vec3::ZERO }
}

/// The extent of everything that will be seen. Include all frames of an animation, so that the
/// view does not jump.
///
/// Keeps the farthest position in each of many directions: a tighter fit than a box, at a size
/// that does not grow.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Lowest and highest corner of the axis-parallel box [m].
    corners: Option<(Vec3<f64>, Vec3<f64>)>,
    /// The farthest position [m] in each of [`DIRECTIONS`]; empty or complete.
    farthest: Vec<Vec3<f64>>,
}

/// Enough that what lies between two directions sticks out by less than 2 % of the size.
const DIRECTION_COUNT: usize = 96;

/// Unit vectors spread evenly over the sphere: a spiral with the golden angle.
static DIRECTIONS: LazyLock<Vec<Vec3<f64>>> = LazyLock::new(|| {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..DIRECTION_COUNT)
        .map(|k| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / DIRECTION_COUNT as f64;
            let (sin, cos) = libm::sincos(golden_angle * k as f64);
            let radius = (1.0 - z * z).sqrt();
            vec3(radius * cos, radius * sin, z)
        })
        .collect()
});

impl Bounds {
    /// The extent of some positions [m].
    pub fn of(positions: &[Vec3<f64>]) -> Self {
        let mut bounds = Self::default();
        bounds.include(positions);
        bounds
    }

    /// Grows by more positions [m]; what is not finite is left out.
    pub fn include(&mut self, positions: &[Vec3<f64>]) {
        for &p in positions.iter().filter(|&&p| is_drawable(p)) {
            self.corners =
                Some(self.corners.map_or((p, p), |(low, high)| (low.min(p), high.max(p))));
            if self.farthest.is_empty() {
                self.farthest = vec![p; DIRECTION_COUNT];
            }
            for (farthest, &direction) in self.farthest.iter_mut().zip(DIRECTIONS.iter()) {
                if p.dot(direction) > farthest.dot(direction) {
                    *farthest = p;
                }
            }
        }
    }

    /// Lowest and highest corner [m]; none where nothing was included.
    pub fn corners(&self) -> Option<(Vec3<f64>, Vec3<f64>)> {
        self.corners
    }

    /// Length of the box's diagonal [m].
    pub fn diagonal(&self) -> f64 {
        self.corners.map_or(0.0, |(low, high)| (high - low).length())
    }
}

/// Highest angle above and below the horizon [degrees]: at 90 there is no up.
pub const STEEPEST: f64 = 89.0;

/// From which side the tissue is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewDirection {
    /// Angle of the viewer around the z axis [degrees]: 0 on the +x side, -90 on the -y side.
    pub azimuth: f64,
    /// Angle of the viewer above the horizon [degrees], -89 to 89.
    pub elevation: f64,
}

impl ViewDirection {
    /// From the side that a vector of any length points to, away from the tissue.
    pub fn from_vector(v: Vec3<f64>) -> Self {
        let degrees = |y: f64, x: f64| libm::atan2(y, x).to_degrees();
        let elevation = degrees(v.z, libm::hypot(v.x, v.y)).clamp(-STEEPEST, STEEPEST);
        Self { azimuth: degrees(v.y, v.x), elevation }
    }

    /// To the right, up, and towards the viewer, of length 1.
    pub fn axes(self) -> [Vec3<f64>; 3] {
        let (sin_a, cos_a) = libm::sincos(self.azimuth.to_radians());
        let (sin_e, cos_e) = libm::sincos(self.elevation.to_radians());
        let backward = vec3(cos_a * cos_e, sin_a * cos_e, sin_e);
        let right = vec3(-sin_a, cos_a, 0.0);
        [right, backward.cross(right), backward]
    }
}

impl Default for ViewDirection {
    /// From the front, a little from the right and from above.
    fn default() -> Self {
        Self { azimuth: -65.0, elevation: 22.0 }
    }
}

/// Half the vertical opening, as a tangent: 13.5 degrees. Wider distorts the organ, narrower
/// flattens it.
pub const HALF_OPENING: f64 = 0.24;

/// A camera for pictures of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    size: ImageSize,
    position: Vec3<f64>,
    right: Vec3<f64>,
    up: Vec3<f64>,
    backward: Vec3<f64>,
    /// Where the optical axis meets the picture [pixels].
    center: [f64; 2],
    /// Pixels per unit of tangent.
    focal: f64,
    /// Distance to the middle of what is framed [m].
    distance: f64,
    /// Radius of what is framed [m].
    radius: f64,
}

/// A position as the camera sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Projected {
    /// Column, row [pixels], pixel centres at one half.
    pub x: f64,
    pub y: f64,
    /// Framing distance over depth: 1 in the middle of the scene, larger for what is nearer.
    pub inverse_depth: f64,
}

impl Camera {
    /// A camera that sees all of it and leaves the margins to titles and scales.
    pub fn framing(bounds: &Bounds, direction: ViewDirection, size: ImageSize) -> Self {
        let usual = ViewDirection::default();
        let or_usual = |angle: f64, usual: f64| if angle.is_finite() { angle } else { usual };
        let azimuth = or_usual(direction.azimuth, usual.azimuth).rem_euclid(360.0);
        let elevation = or_usual(direction.elevation, usual.elevation);
        let elevation = elevation.clamp(-STEEPEST, STEEPEST);
        let [right, up, backward] = ViewDirection { azimuth, elevation }.axes();

        let (low, high) = bounds.corners().unwrap_or_default();
        let middle = (low + high) * 0.5;
        // A single point is shown as the middle of a millimetre, or of what its digits resolve.
        let smallest = 1e-3_f64.max(1e-6 * middle.length());
        let half = ((high - low) * 0.5).max(Vec3::splat(smallest * 0.5));

        let (width, height) = (f64::from(size.width()), f64::from(size.height()));
        let area = Layout::of(size).tissue_area();
        let focal = 0.5 * height.min(width) / HALF_OPENING;
        let center = [0.5 * (area.left + area.right), 0.5 * (area.top + area.bottom)];
        let tangent =
            [0.5 * (area.right - area.left) / focal, 0.5 * (area.bottom - area.top) / focal];

        // Positions about the middle; a single point or nothing at all is given some room.
        let mut positions: Vec<_> = bounds.farthest.iter().map(|&p| p - middle).collect();
        if bounds.diagonal() < smallest {
            positions =
                [right, up].into_iter().flat_map(|v| [v * smallest, -v * smallest]).collect();
        }
        let mut reach = [[f64::NEG_INFINITY; 2]; 2];
        for p in positions {
            for (axis, side) in [p.dot(right), p.dot(up)].into_iter().enumerate() {
                let near = tangent[axis] * p.dot(backward);
                reach[axis][0] = reach[axis][0].max(near + side);
                reach[axis][1] = reach[axis][1].max(near - side);
            }
        }
        let away = |axis: usize| (reach[axis][0] + reach[axis][1]) / (2.0 * tangent[axis]);
        let distance = away(0).max(away(1));
        let aside = |axis: usize| 0.5 * (reach[axis][0] - reach[axis][1]);
        let position = middle + right * aside(0) + up * aside(1) + backward * distance;
        Self { size, position, right, up, backward, center, focal, distance, radius: half.length() }
    }

    /// A camera that looks at a point [m] from a direction and a distance [m], with the point in the middle of the picture.
    pub fn at(target: Vec3<f64>, direction: ViewDirection, distance: f64, size: ImageSize) -> Self {
        let [right, up, backward] = direction.axes();
        let (width, height) = (f64::from(size.width()), f64::from(size.height()));
        Self {
            size,
            position: target + backward * distance,
            right,
            up,
            backward,
            center: [0.5 * width, 0.5 * height],
            focal: 0.5 * height / HALF_OPENING,
            distance,
            radius: distance * HALF_OPENING,
        }
    }

    /// Width and height of the pictures it takes.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// Where it stands [m].
    pub fn position(&self) -> Vec3<f64> {
        self.position
    }

    /// Where the optical axis meets the picture [pixels], and pixels per unit of tangent.
    pub fn center_and_focal_length(&self) -> ([f64; 2], f64) {
        (self.center, self.focal)
    }

    /// Pixels per metre in the middle of what is framed.
    pub fn pixels_per_meter(&self) -> f64 {
        self.focal / self.distance
    }

    pub(crate) fn distance(&self) -> f64 {
        self.distance
    }

    pub(crate) fn radius(&self) -> f64 {
        self.radius
    }

    /// The middle of what is framed [m], as nearly as the margins let it be in the middle of the picture.
    pub(crate) fn target(&self) -> Vec3<f64> {
        self.position - self.backward * self.distance
    }

    /// From camera axes (right, up, towards the viewer) to the world's.
    pub(crate) fn world_direction(&self, v: [f64; 3]) -> Vec3<f64> {
        self.right * v[0] + self.up * v[1] + self.backward * v[2]
    }

    /// Where a position appears; none where it cannot be drawn: behind the camera, or not finite.
    pub(crate) fn project(&self, p: Vec3<f64>) -> Option<Projected> {
        if !is_drawable(p) {
            return None;
        }
        let v = p - self.position;
        let depth = -v.dot(self.backward);
        if depth < 1e-3 * self.distance {
            return None;
        }
        let scale = self.focal / depth;
        Some(Projected {
            x: self.center[0] + v.dot(self.right) * scale,
            y: self.center[1] - v.dot(self.up) * scale,
            inverse_depth: self.distance / depth,
        })
    }

    /// The position that [`Camera::project`] takes to a place.
    pub(crate) fn unproject(&self, at: Projected) -> Vec3<f64> {
        let depth = self.distance / at.inverse_depth;
        let scale = depth / self.focal;
        self.position
            + self.right * ((at.x - self.center[0]) * scale)
            + self.up * ((self.center[1] - at.y) * scale)
            + self.backward * -depth
    }
}
