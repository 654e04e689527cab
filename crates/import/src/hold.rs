//! Where a body is held.

use viscera::mesh::topology::BoundingBox;
use viscera::scalar::{Vec3, vec3};

/// Vertices on the side of a plane that its normal points to.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    /// Of the fixing.
    pub name: String,
    /// A point on the plane [m].
    pub point: Vec3<f64>,
    /// Of length 1.
    pub normal: Vec3<f64>,
    /// What it stands for, in words.
    pub reason: String,
}

/// The share of a body's extent that is its back.
const BACK: f64 = 0.15;

/// Holds a body at its lowest part: where gravity pulls it to.
pub fn at_the_back(body: &str, vertices: &[Vec3<f64>], down: Vec3<f64>, side: &str) -> Hold {
    let bounds = BoundingBox::around(vertices);
    let along = |x: Vec3<f64>| x.dot(down);
    let (low, high) =
        vertices.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
            (low.min(along(x)), high.max(along(x)))
        });
    let depth = high - BACK * (high - low);
    let center = bounds.center();
    Hold {
        name: format!("{body}_{side}"),
        point: center + down * (depth - along(center)),
        normal: down,
        reason: format!(
            "the {side} {:.0} % of it: a guess; organs hang on ligaments and lie on their neighbours",
            100.0 * BACK
        ),
    }
}

/// Rounded to hundredths of a millimetre, so that a scene file stays readable.
pub fn rounded(x: Vec3<f64>) -> Vec3<f64> {
    let round = |value: f64| (value * 1e5).round() / 1e5 + 0.0;
    vec3(round(x.x), round(x.y), round(x.z))
}
