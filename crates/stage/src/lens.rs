//! Between places on a screen and points in the world.

use viscera::scalar::Vec3;
use viscera_render::Orbit;

/// A part of a screen, in whatever unit the caller counts in; y goes down.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Area {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// From left to right.
    pub width: f64,
    /// From top to bottom.
    pub height: f64,
}

impl Area {
    /// Whether a place lies in it.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        (self.left..self.left + self.width).contains(&x)
            && (self.top..self.top + self.height).contains(&y)
    }
}

/// A camera and the part of the screen that shows what it sees.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Where the viewer is.
    pub orbit: Orbit,
    /// Where on the screen.
    pub area: Area,
}

/// Pictures narrower than this see from farther away, so that what is wide fits in; what is framed takes as much of
/// a picture's height.
const NARROW: f64 = 0.95;

impl Lens {
    /// What a camera sees in a part of the screen whose right edge, so wide, is taken by something else: what is
    /// framed stays out of it.
    pub fn new(orbit: &Orbit, area: Area, taken: f64) -> Self {
        let mut lens = Self { orbit: *orbit, area };
        let (width, height) = (area.width, area.height.max(1.0));
        let taken = taken.min(0.5 * width);
        let farther = (NARROW * height / (width - taken).max(1.0)).clamp(1.0, 4.0);
        lens.orbit.distance *= farther;
        let reaches = 0.5 * NARROW * height / farther - (0.5 * width - taken);
        lens.orbit.pan(-reaches.clamp(0.0, 0.5 * taken) / height, 0.0);
        lens
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        self.area.width / self.area.height.max(1.0)
    }

    /// The direction, of length 1, in which a place of the screen lies.
    pub fn ray(&self, place: [f64; 2]) -> Vec3<f64> {
        let x = (place[0] - self.area.left) / self.area.width.max(1.0);
        let y = (place[1] - self.area.top) / self.area.height.max(1.0);
        self.orbit.ray([x, y], self.aspect())
    }

    /// Where a point [m] is seen; nothing where it lies behind the viewer.
    pub fn place(&self, point: Vec3<f64>) -> Option<[f64; 2]> {
        let [right, up, backward] = self.orbit.axes();
        let seen = point - self.orbit.position();
        let depth = -seen.dot(backward);
        // The tangent of half the opening, from the ray through the middle of the upper edge.
        let edge = self.orbit.ray([0.5, 0.0], self.aspect());
        let opening = edge.dot(up) / -edge.dot(backward);
        if depth <= 0.0 {
            return None;
        }
        let Area { left, top, width, height } = self.area;
        let shift = |along: Vec3<f64>| seen.dot(along) / (depth * opening) * 0.5 * height;
        Some([left + 0.5 * width + shift(right), top + 0.5 * height - shift(up)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    #[test]
    fn what_is_framed_stays_beside_the_legend() {
        let corners = [vec3(-0.1, -0.1, -0.1), vec3(0.1, 0.1, 0.1)];
        let orbit = Orbit::framing(&corners);
        for (width, height, taken) in [
            (1200.0, 500.0, 136.0),
            (694.0, 520.0, 136.0),
            (346.0, 520.0, 136.0),
            (346.0, 520.0, 0.0),
        ] {
            let area = Area { left: 40.0, top: 20.0, width, height };
            let lens = Lens::new(&orbit, area, taken);
            // The sphere that is framed.
            let radius = 0.1 * 3f64.sqrt();
            let right = lens.place(orbit.axes()[0] * radius).expect("in front");
            let left = lens.place(orbit.axes()[0] * -radius).expect("in front");
            // To a point, and the sphere's rim is seen a little larger than its section.
            assert!(right[0] < 40.0 + width - taken + 8.0, "{width}: {}", right[0]);
            assert!(left[0] > 40.0 - 8.0, "{width}: {}", left[0]);
        }
    }

    #[test]
    fn a_point_is_seen_where_its_ray_goes() {
        let orbit = Orbit::framing(&[vec3(-0.1, -0.05, 0.0), vec3(0.1, 0.05, 0.1)]);
        let area = Area { left: 40.0, top: 20.0, width: 800.0, height: 500.0 };
        let lens = Lens { orbit, area };
        for point in [vec3(0.0, 0.0, 0.0), vec3(0.08, -0.02, 0.06), vec3(-0.1, 0.04, 0.09)] {
            let towards = point - orbit.position();
            let towards = towards * (1.0 / towards.length());
            let place = lens.place(point).expect("in front");
            assert!((lens.ray(place) - towards).length() < 1e-12);
            assert!(area.contains(place));
        }
        let behind = orbit.position() + orbit.axes()[2];
        assert_eq!(lens.place(behind), None);
    }
}
