//! Between places in the window and points in the world.

use eframe::egui::{Pos2, Rect, pos2};
use viscera::scalar::Vec3;
use viscera_render::Orbit;

/// A camera and the part of the window that shows what it sees.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Where the viewer is.
    pub orbit: Orbit,
    /// Where in the window.
    pub rect: Rect,
}

/// Pictures narrower than this see from farther away, so that what is wide fits in; what is framed takes as much of
/// a picture's height.
const NARROW: f64 = 0.95;

impl Lens {
    /// What a camera sees in a part of the window whose right edge, so wide [points], is taken by something else:
    /// what is framed stays out of it.
    pub fn new(orbit: &Orbit, rect: Rect, taken: f32) -> Self {
        let mut lens = Self { orbit: *orbit, rect };
        let [width, height] = [rect.width(), rect.height().max(1.0)].map(f64::from);
        let taken = f64::from(taken).min(0.5 * width);
        let farther = (NARROW * height / (width - taken).max(1.0)).clamp(1.0, 4.0);
        lens.orbit.distance *= farther;
        let reaches = 0.5 * NARROW * height / farther - (0.5 * width - taken);
        lens.orbit.pan(-reaches.clamp(0.0, 0.5 * taken) / height, 0.0);
        lens
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.rect.width() / self.rect.height().max(1.0))
    }

    /// The direction, of length 1, in which a place of the window lies.
    pub fn ray(&self, place: Pos2) -> Vec3<f64> {
        let x = f64::from((place.x - self.rect.left()) / self.rect.width().max(1.0));
        let y = f64::from((place.y - self.rect.top()) / self.rect.height().max(1.0));
        self.orbit.ray([x, y], self.aspect())
    }

    /// Where a point [m] is seen; nothing where it lies behind the viewer.
    pub fn place(&self, point: Vec3<f64>) -> Option<Pos2> {
        let [right, up, backward] = self.orbit.axes();
        let seen = point - self.orbit.position();
        let depth = -seen.dot(backward);
        // The tangent of half the opening, from the ray through the middle of the upper edge.
        let edge = self.orbit.ray([0.5, 0.0], self.aspect());
        let opening = edge.dot(up) / -edge.dot(backward);
        if depth <= 0.0 {
            return None;
        }
        let half = 0.5 * f64::from(self.rect.height());
        let shift = |along: Vec3<f64>| (seen.dot(along) / (depth * opening) * half) as f32;
        let center = self.rect.center();
        Some(pos2(center.x + shift(right), center.y - shift(up)))
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
            let rect = Rect::from_min_max(pos2(40.0, 20.0), pos2(40.0 + width, 20.0 + height));
            let lens = Lens::new(&orbit, rect, taken);
            // The sphere that is framed.
            let radius = 0.1 * 3f64.sqrt();
            let right = lens.place(orbit.axes()[0] * radius).expect("in front");
            let left = lens.place(orbit.axes()[0] * -radius).expect("in front");
            // To a point, and the sphere's rim is seen a little larger than its section.
            assert!(
                right.x < rect.right() - taken + 8.0,
                "{width}: {} of {}",
                right.x,
                rect.right()
            );
            assert!(left.x > rect.left() - 8.0, "{width}: {}", left.x);
        }
    }

    #[test]
    fn a_point_is_seen_where_its_ray_goes() {
        let orbit = Orbit::framing(&[vec3(-0.1, -0.05, 0.0), vec3(0.1, 0.05, 0.1)]);
        let rect = Rect::from_min_max(pos2(40.0, 20.0), pos2(840.0, 520.0));
        let lens = Lens { orbit, rect };
        for point in [vec3(0.0, 0.0, 0.0), vec3(0.08, -0.02, 0.06), vec3(-0.1, 0.04, 0.09)] {
            let towards = point - orbit.position();
            let towards = towards * (1.0 / towards.length());
            let place = lens.place(point).expect("in front");
            // Places are single precision: 500 pixels to 2^-24.
            assert!((lens.ray(place) - towards).length() < 1e-6);
        }
        let behind = orbit.position() + orbit.axes()[2];
        assert_eq!(lens.place(behind), None);
    }
}
