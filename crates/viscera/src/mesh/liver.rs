//! A procedural liver, so that demonstrations need no patient data.
//!
//! Axes: +x towards the patient's left, +z up (towards the head), +y towards the back; a viewer in
//! front of the patient looks along +y and sees the right lobe on the left of the picture. The
//! origin lies where the lobes meet. Nothing here is measured from a person: proportions follow
//! anatomy textbooks. It is 22 cm wide, 16 cm tall, 12 cm deep, and holds 1.45 litres.
//!
//! Four ellipsoids run together by smooth unions; hollows and grooves are smoothly subtracted.

use super::distance::{Capsule, Ellipsoid, Placed, SignedDistance, rotation_about, smooth_minimum};
use crate::scalar::{Vec3, vec3};

/// The liver's signed distance; see the module's documentation for its axes.
#[derive(Clone, Debug)]
pub struct Liver {
    scale: f64,
    lobes: [(Placed<Ellipsoid>, f64); 4],
    hollows: [(Placed<Ellipsoid>, f64); 3],
    grooves: [(Capsule, f64); 4],
}

impl Liver {
    /// A life-size liver times a positive factor.
    pub fn scaled(scale: f64) -> Self {
        Self {
            scale,
            // Each lobe, with the length over which it runs into those before it [mm].
            lobes: [
                // Right lobe: the bulk, under the dome of the diaphragm.
                (ellipsoid([-40.0, 5.0, 0.0], [66.0, 60.0, 74.0], 12.0), 0.0),
                // Right inferior tip.
                (ellipsoid([-62.0, -4.0, -42.0], [40.0, 44.0, 52.0], 15.0), 40.0),
                // Middle, between dome and left lobe.
                (ellipsoid([14.0, -8.0, 16.0], [58.0, 46.0, 44.0], 12.0), 30.0),
                // Left lobe, flat, tapering to the left.
                (ellipsoid([54.0, -14.0, 24.0], [58.0, 32.0, 30.0], -4.0), 30.0),
            ],
            // What presses in from outside, and how rounded its rim is [mm].
            hollows: [
                // Underside: stomach, duodenum, colon and kidney leave a broad hollow that faces
                // down, back and left, and meets the front in the sharp inferior border.
                (ellipsoid([58.0, 78.0, -206.0], [200.0, 200.0, 215.0], 0.0), 8.0),
                // Under the left lobe: the stomach.
                (ellipsoid([86.0, 40.0, -32.0], [84.0, 72.0, 52.0], -8.0), 6.0),
                // Above the middle: the heart rests here.
                (ellipsoid([38.0, -5.0, 112.0], [55.0, 70.0, 53.0], 0.0), 20.0),
            ],
            grooves: [
                // Falciform notch between the lobes: from the inferior border ...
                (capsule([29.0, -36.0, -34.0], [24.0, -58.0, 6.0], 6.0), 10.0),
                // ... up the front ...
                (capsule([24.0, -58.0, 6.0], [22.0, -55.0, 34.0], 6.0), 10.0),
                // ... and over the top.
                (capsule([22.0, -55.0, 34.0], [18.0, -10.0, 66.0], 7.0), 12.0),
                // Gallbladder fossa, which also notches the inferior border.
                (capsule([-16.0, -52.0, -58.0], [-4.0, 25.0, -20.0], 10.0), 10.0),
            ],
        }
    }
}

impl SignedDistance for Liver {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        // The tables are in millimetres.
        let p = point * (1000.0 / self.scale);
        let mut distance = f64::INFINITY;
        for (lobe, blend) in &self.lobes {
            distance = smooth_minimum(distance, lobe.distance(p), *blend);
        }
        for (hollow, blend) in &self.hollows {
            distance = -smooth_minimum(-distance, hollow.distance(p), *blend);
        }
        for (groove, blend) in &self.grooves {
            distance = -smooth_minimum(-distance, groove.distance(p), *blend);
        }
        distance * (self.scale / 1000.0)
    }

    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        // Measured, with some millimetres to spare: the lobes' own boxes, turned and blended, would
        // hold three times the volume, and meshing evaluates the function all over them.
        let (lower, upper) = (vec3(-112.0, -60.0, -91.0), vec3(116.0, 69.0, 78.0));
        (lower * (self.scale / 1000.0), upper * (self.scale / 1000.0))
    }
}

/// An ellipsoid `[mm]`, turned in the frontal plane: positive degrees lower its left end.
fn ellipsoid(center: [f64; 3], radii: [f64; 3], degrees: f64) -> Placed<Ellipsoid> {
    Placed {
        shape: Ellipsoid { center: Vec3::ZERO, radii: Vec3::from_f64(radii) },
        rotation: rotation_about(vec3(0.0, 1.0, 0.0), degrees.to_radians()),
        scale: 1.0,
        translation: Vec3::from_f64(center),
    }
}

/// A capsule `[mm]`.
fn capsule(start: [f64; 3], end: [f64; 3], radius: f64) -> Capsule {
    Capsule { start: Vec3::from_f64(start), end: Vec3::from_f64(end), radius }
}
