//! A camera that goes around a point.

use viscera::scalar::Vec3;
use viscera_picture::{HALF_OPENING, STEEPEST, ViewDirection};

/// Where the viewer is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// What is looked at [m].
    pub target: Vec3<f64>,
    /// From there to the viewer [m].
    pub distance: f64,
    /// Angle of the viewer around the z axis [degrees]: 0 on the +x side, -90 on the -y side.
    pub azimuth: f64,
    /// Angle of the viewer above the horizon [degrees].
    pub elevation: f64,
}

impl Orbit {
    /// From the front, a little from the right and from above, so far away that a sphere around the
    /// positions [m] is seen. Positions that are not finite are left out.
    pub fn framing(positions: &[Vec3<f64>]) -> Self {
        let finite = || positions.iter().copied().filter(|x| x.is_finite());
        let low = finite().reduce(Vec3::min).unwrap_or_default();
        let high = finite().reduce(Vec3::max).unwrap_or_default();
        let ViewDirection { azimuth, elevation } = ViewDirection::default();
        // A single point is given some room.
        let radius = (0.5 * (high - low).length()).max(1e-3);
        Self {
            target: (low + high) * 0.5,
            distance: 1.05 * radius / HALF_OPENING,
            azimuth,
            elevation,
        }
    }

    /// Goes around the target by angles [degrees].
    pub fn turn(&mut self, azimuth: f64, elevation: f64) {
        self.azimuth = (self.azimuth + azimuth).rem_euclid(360.0);
        self.elevation = (self.elevation + elevation).clamp(-STEEPEST, STEEPEST);
    }

    /// Goes nearer (a factor below 1) or farther.
    pub fn zoom(&mut self, factor: f64) {
        if factor.is_finite() && factor > 0.0 {
            self.distance = (self.distance * factor).clamp(1e-4, 1e3);
        }
    }

    /// Moves what is looked at, by shares of the picture's height to the right and up.
    pub fn pan(&mut self, right: f64, up: f64) {
        let height = 2.0 * HALF_OPENING * self.distance;
        let [x, y, _] = self.axes();
        self.target = self.target - x * (right * height) - y * (up * height);
    }

    /// Where the viewer stands [m].
    pub fn position(&self) -> Vec3<f64> {
        self.target + self.axes()[2] * self.distance
    }

    /// To the right, up, and towards the viewer, of length 1.
    pub fn axes(&self) -> [Vec3<f64>; 3] {
        ViewDirection { azimuth: self.azimuth, elevation: self.elevation }.axes()
    }

    /// Where a ray through a place of the picture goes: its direction, of length 1. Places are shares of
    /// the width from the left and of the height from the top; `aspect` is width over height.
    pub fn ray(&self, place: [f64; 2], aspect: f64) -> Vec3<f64> {
        let [right, up, backward] = self.axes();
        let x = (2.0 * place[0] - 1.0) * HALF_OPENING * aspect;
        let y = (1.0 - 2.0 * place[1]) * HALF_OPENING;
        let direction = right * x + up * y - backward;
        direction * (1.0 / direction.length())
    }

    /// How many pixels of a picture of this height a metre at the target takes.
    pub fn pixels_per_meter(&self, height: u32) -> f64 {
        0.5 * f64::from(height) / (HALF_OPENING * self.distance)
    }

    /// What the shader multiplies sideways and upward distances by, over the depth.
    pub(crate) fn lens(aspect: f64) -> [f64; 2] {
        [1.0 / (HALF_OPENING * aspect.max(1e-3)), 1.0 / HALF_OPENING]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    #[test]
    fn axes_are_a_right_handed_frame_whatever_the_angle() {
        let mut orbit = Orbit::framing(&[vec3(0.0, 0.0, 0.0), vec3(0.1, 0.2, 0.3)]);
        for _ in 0..50 {
            orbit.turn(37.0, 11.0);
            let [x, y, z] = orbit.axes();
            assert!((x.cross(y) - z).length() < 1e-12 && x.dot(y).abs() < 1e-12);
            assert!(orbit.elevation.abs() <= STEEPEST);
        }
    }

    #[test]
    fn the_ray_through_the_middle_goes_to_the_target() {
        let orbit = Orbit::framing(&[vec3(1.0, 2.0, 3.0), vec3(1.1, 2.2, 3.1)]);
        let to_target = orbit.target - orbit.position();
        let ray = orbit.ray([0.5, 0.5], 1.6);
        assert!((ray * orbit.distance - to_target).length() < 1e-12);
        let corner = orbit.ray([0.0, 0.0], 1.6);
        let [right, up, _] = orbit.axes();
        assert!(corner.dot(right) < 0.0 && corner.dot(up) > 0.0);
    }

    #[test]
    fn a_metre_takes_its_pixels() {
        let orbit = Orbit::framing(&[vec3(0.0, 0.0, 0.0), vec3(0.1, 0.2, 0.3)]);
        // The height of what is seen at the target is twice the tangent of half the opening, times its
        // distance.
        let height = 2.0 * HALF_OPENING * orbit.distance;
        assert!((orbit.pixels_per_meter(300) * height - 300.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_number_moves_nothing() {
        let mut orbit = Orbit::framing(&[vec3(f64::NAN, 0.0, 0.0)]);
        let before = orbit;
        orbit.zoom(f64::NAN);
        orbit.zoom(-1.0);
        assert_eq!(orbit, before);
        assert!(orbit.position().is_finite());
    }
}
