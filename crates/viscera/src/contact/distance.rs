//! What a shape says at a point.

use crate::scalar::Vec3;

/// Distance to a shape at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// [m], negative inside.
    pub value: f64,
    /// The direction of its gradient, of length 1.
    pub normal: Vec3<f64>,
    /// The gradient's magnitude: 1, but for a mesh, whose value is interpolated.
    pub slope: f64,
    /// The largest magnitude of its second derivative [1/m].
    pub curvature: f64,
}
