//! A procedural liver, so that demonstrations need no patient data.
//!
//! Axes: +x towards the patient's left, +z up (towards the head), +y towards the back; a viewer in
//! front of the patient looks along +y and sees the right lobe on the left of the picture. The
//! origin lies in the right lobe. Nothing here is measured from a person: proportions follow
//! anatomy textbooks (a wedge about 20 cm wide and 15 cm tall, 1.2 to 1.5 litres).

use super::distance::{
    Capsule, Ellipsoid, Placed, SignedDistance, SmoothSubtraction, SmoothUnion, rotation_about,
};
use crate::scalar::{Vec3, vec3};

type Lobe = Placed<Ellipsoid>;

/// The liver's signed distance; see the module's documentation for its axes.
#[derive(Clone, Copy, Debug)]
pub struct Liver {
    scale: f64,
    lobes: SmoothUnion<SmoothUnion<Lobe, Lobe>, SmoothUnion<Lobe, Lobe>>,
}

impl Liver {
    /// A life-size liver times a positive factor.
    pub fn scaled(scale: f64) -> Self {
        let lobe = |center: Vec3<f64>, radii: Vec3<f64>, axis: Vec3<f64>, degrees: f64| Placed {
            shape: Ellipsoid { center: Vec3::ZERO, radii },
            rotation: rotation_about(axis, degrees.to_radians()),
            scale: 1.0,
            translation: center,
        };
        let y = vec3(0.0, 1.0, 0.0);
        let right = lobe(vec3(0.0, 0.0, 0.0), vec3(0.06, 0.06, 0.07), y, 0.0);
        let left = lobe(vec3(0.08, -0.02, 0.02), vec3(0.07, 0.04, 0.035), y, 0.0);
        let lobes = SmoothUnion {
            first: SmoothUnion { first: right, second: right, blend: 0.01 },
            second: SmoothUnion { first: left, second: left, blend: 0.01 },
            blend: 0.03,
        };
        Self { scale, lobes }
    }
}

impl SignedDistance for Liver {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        self.lobes.distance(point * (1.0 / self.scale)) * self.scale
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        let (lower, upper) = self.lobes.bounds();
        (lower * self.scale, upper * self.scale)
    }
}
