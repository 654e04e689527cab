//! Where a body is held.

use viscera::mesh::TetMesh;
use viscera::mesh::topology::{BoundingBox, connected_components};
use viscera::scalar::{Vec3, vec3};

/// Vertices that are held.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    /// Of the fixing.
    pub name: String,
    /// Which they are.
    pub place: Place,
    /// What the hold stands for, in words.
    pub reason: String,
}

/// A choice of vertices.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// On the side of a plane that its normal points to.
    Beyond {
        /// A point on the plane [m].
        point: Vec3<f64>,
        /// Of length 1.
        normal: Vec3<f64>,
    },
    /// In a box along the axes.
    Within(BoundingBox),
}

/// The share of a body's extent that is its back, and more of it that may have to be.
pub const BACK: f64 = 0.15;
pub const LARGER_BACKS: [f64; 2] = [0.3, 0.45];

/// More unconnected parts of a body get no holds of their own.
const MOST_PARTS: usize = 12;

/// Holds every unconnected part of a body by a share of its extent at its lowest end, where gravity pulls it to. `down` is
/// along an axis.
pub fn at_the_back(
    body: &str,
    mesh: &TetMesh,
    down: Vec3<f64>,
    (side, share): (&str, f64),
) -> Vec<Hold> {
    let parts = connected_components(mesh);
    let mut points = vec![Vec::new(); parts.count];
    for (&part, &x) in parts.labels.iter().zip(mesh.vertices()) {
        points[part as usize].push(x);
    }
    let hold = |(number, points): (usize, &Vec<Vec3<f64>>)| {
        let mut bounds = BoundingBox::around(points);
        let size = bounds.size();
        // Away from the lowest end all but a share is cut off.
        let cut = size.scale(down) * (1.0 - share);
        bounds.min += cut.max(Vec3::ZERO);
        bounds.max += cut.min(Vec3::ZERO);
        let name = match number {
            0 => format!("{body}_{side}"),
            _ => format!("{body}_{side}_{}", number + 1),
        };
        let percent = 100.0 * share;
        let reason = format!(
            "the {side} {percent:.0} % of it: a guess; organs hang on ligaments and lie on their neighbours"
        );
        Hold { name, place: Place::Within(bounds), reason }
    };
    points.iter().enumerate().take(MOST_PARTS).map(hold).collect()
}

/// Rounded to hundredths of a millimetre, so that a scene file stays readable.
pub fn rounded(x: Vec3<f64>) -> Vec3<f64> {
    let round = |value: f64| (value * 1e5).round() / 1e5 + 0.0;
    vec3(round(x.x), round(x.y), round(x.z))
}
