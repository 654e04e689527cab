//! Tetrahedra that elements are tested on.

use crate::common::Random;
use viscera::scalar::{Mat3, Vec3, vec3};

/// Step of the differences as a fraction of the tetrahedron's smallest height. The formula is of
/// fourth order: exact for the energies (quartic polynomials), so the step is as large as `|F|`,
/// the one function here that is no polynomial, allows.
pub const STEP: f64 = 2e-3;

pub const LAMBDA: f64 = 15e3;
pub const MU: f64 = 1.7e3;

/// A rest shape, a deformed shape and the smallest height of the rest shape.
pub struct Case {
    pub name: &'static str,
    pub inverse_rest_shape: Mat3<f64>,
    pub volume: f64,
    pub corners: [Vec3<f64>; 4],
    pub height: f64,
}

fn smallest_height(x: &[Vec3<f64>; 4]) -> f64 {
    let volume = viscera::mesh::tet_volume(*x).abs();
    let faces = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
    let areas = faces.map(|[a, b, c]| 0.5 * (x[b] - x[a]).cross(x[c] - x[a]).length());
    areas.iter().fold(f64::INFINITY, |h, area| h.min(3.0 * volume / area))
}

/// Tetrahedra of about 5 mm: random ones, rest shapes squeezed to a thousandth, deformed shapes
/// squeezed flat, turned inside out, and rotated.
pub fn cases() -> Vec<Case> {
    let mut random = Random(7);
    let mut cases = Vec::new();
    for round in 0..400 {
        let name = ["random", "flat at rest", "flattened", "inverted", "rotated"][round % 5];
        let mut rest: [Vec3<f64>; 4] = std::array::from_fn(|_| random.vector(0.005));
        if name == "flat at rest" {
            rest = rest.map(|x| vec3(x.x, x.y, 1e-3 * x.z));
        }
        if viscera::mesh::tet_volume(rest) < 0.0 {
            rest.swap(2, 3);
        }
        let longest = (rest[1] - rest[0]).length().max((rest[2] - rest[0]).length());
        let height = smallest_height(&rest);
        if height < 1e-5 * longest || (name != "flat at rest" && height < 0.05 * longest) {
            continue;
        }
        let rotation = random.rotation();
        let stretch = Mat3::from_columns(
            vec3(random.uniform(0.5, 2.0), random.uniform(-0.3, 0.3), 0.1),
            vec3(0.2, random.uniform(0.5, 2.0), random.uniform(-0.3, 0.3)),
            vec3(random.uniform(-0.3, 0.3), -0.1, random.uniform(0.5, 2.0)),
        );
        let squeeze =
            |z| Mat3::from_columns(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, z));
        let f = match name {
            "flattened" => squeeze(1e-3) * stretch,
            "inverted" => squeeze(-0.7) * stretch,
            "rotated" => rotation * stretch,
            _ => stretch,
        };
        let inverse_rest_shape = viscera::mesh::edge_matrix(rest).inverse();
        let volume = viscera::mesh::tet_volume(rest);
        cases.push(Case { name, inverse_rest_shape, volume, corners: rest.map(|x| f * x), height });
    }
    assert!(cases.len() > 250);
    for name in ["random", "flat at rest", "flattened", "inverted", "rotated"] {
        assert!(cases.iter().filter(|c| c.name == name).count() > 20, "too few: {name}");
    }
    cases
}

/// Kinds of [`deformation`].
pub const DEFORMATIONS: u64 = 10;

/// Deformations of every kind: at rest to the bit, small, large, turned, flat, a line, a point, inside
/// out. Their singular values take from none to all of the sweeps, so that lanes leave at different
/// times.
pub fn deformation(random: &mut Random, kind: u64) -> Mat3<f64> {
    let mut any = |size: f64| {
        Mat3::from_columns(random.vector(size), random.vector(size), random.vector(size))
    };
    let diagonal = |a: f64, b: f64, c: f64| {
        Mat3::from_columns(vec3(a, 0.0, 0.0), vec3(0.0, b, 0.0), vec3(0.0, 0.0, c))
    };
    match kind {
        0 => Mat3::IDENTITY,
        1 => Mat3::IDENTITY + any(1e-3),
        2 => any(2.0),
        3 => random.rotation() * diagonal(1.3, 1.0, 0.7),
        4 => random.rotation() * diagonal(1.0, 1.0, 0.0) * random.rotation(),
        5 => random.rotation() * diagonal(3.0, 0.0, 0.0) * random.rotation(),
        6 => Mat3::ZERO,
        7 => random.rotation() * diagonal(1.0, 0.9, -0.2) * random.rotation(),
        8 => diagonal(0.5, -2.0, 1.0),
        _ => any(1e3),
    }
}
