//! The axes of a part's lattices: those of about the smallest box around it. What a body's own directions are must not
//! depend on how it lies in the scene: the twist of a bar that is turned by 37 degrees needs half as many iterations more
//! where its lattice is not turned with it.

use std::cmp::Ordering;

use crate::scalar::{Mat3, Vec3, vec3};

/// A box has to be smaller than that along the axes of the scene by this factor: bodies without directions keep those.
const SMALLER: f64 = 0.9;

/// Turns [rad] are refined to about what round-off leaves of them.
const FINEST: f64 = 1e-13;

/// A turn [rad] after which a box that is to be smaller is.
const CLEAR: f64 = 2e-3;

/// Parts of fewer vertices keep the axes of the scene: they have hardly a lattice.
const FEWEST: usize = 64;

/// Rounds over all turns by one step, at most.
const ROUNDS: u32 = 4;

/// The largest component of the directions in which the hull of a part is looked for.
const REACH: i32 = 2;

/// A rotation whose rows are the axes.
pub(super) fn axes(places: &[Vec3<f64>]) -> Mat3<f64> {
    if places.len() < FEWEST {
        return Mat3::IDENTITY;
    }
    let hull = extremes(places);
    let volume = |axes: &Mat3<f64>| box_volume(&hull, axes);
    let angles = (-3..3).map(|k| (15.0 * f64::from(k)).to_radians());
    let (mut best, mut least) = (Mat3::IDENTITY, volume(&Mat3::IDENTITY));
    for a in angles.clone() {
        for b in angles.clone() {
            for c in angles.clone() {
                let axes = turn(2, a) * turn(1, b) * turn(0, c);
                let found = volume(&axes);
                if found < least {
                    (best, least) = (axes, found);
                }
            }
        }
    }
    // By all places: the hull of something round has corners of its own. False for what is no number.
    let is_smaller =
        |axes: &Mat3<f64>| box_volume(places, axes) < SMALLER * box_volume(places, &Mat3::IDENTITY);
    let mut step = 7.5_f64.to_radians();
    while step > FINEST {
        // Not until nothing improves: along a skew valley that takes any number of rounds.
        for _ in 0..ROUNDS {
            let before = least;
            for axis in 0..3 {
                for angle in [step, -step] {
                    let axes = turn(axis, angle) * best;
                    let found = volume(&axes);
                    if found < least {
                        (best, least) = (axes, found);
                    }
                }
            }
            if least == before {
                break;
            }
        }
        // What has no directions of its own needs no finer turns.
        if step > CLEAR && 0.5 * step <= CLEAR && !is_smaller(&best) {
            return Mat3::IDENTITY;
        }
        step *= 0.5;
    }
    if is_smaller(&best) { best } else { Mat3::IDENTITY }
}

/// The farthest places in many directions. It does not depend on the order of places.
fn extremes(places: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
    let lexical = |a: &[f64], b: &[f64]| {
        let different = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
        different.fold(Ordering::Equal, Ordering::then)
    };
    let numbers = || (-REACH..=REACH).map(f64::from);
    let with = |x: f64| numbers().flat_map(move |y| numbers().map(move |z| vec3(x, y, z)));
    let mut found: Vec<Vec3<f64>> = Vec::new();
    for direction in numbers().flat_map(with).filter(|d| *d != Vec3::ZERO) {
        let mut farthest: Option<(f64, Vec3<f64>)> = None;
        for &place in places {
            let along = direction.dot(place);
            let is_farther = farthest.is_none_or(|(most, other)| {
                let is_later = || lexical(&place.to_array(), &other.to_array()).is_gt();
                along > most || (along == most && is_later())
            });
            if is_farther {
                farthest = Some((along, place));
            }
        }
        found.extend(farthest.map(|(_, place)| place));
    }
    // A box has eight.
    found.sort_by(|a, b| lexical(&a.to_array(), &b.to_array()));
    found.dedup();
    found
}

/// Of the box around places along these axes.
fn box_volume(places: &[Vec3<f64>], axes: &Mat3<f64>) -> f64 {
    let nothing = (Vec3::splat(f64::INFINITY), Vec3::splat(f64::NEG_INFINITY));
    let (low, high) = places.iter().fold(nothing, |(low, high), place| {
        let x = *axes * *place;
        (low.min(x), high.max(x))
    });
    let size = high - low;
    size.x * size.y * size.z
}

/// A turn about an axis of coordinates.
fn turn(axis: usize, angle: f64) -> Mat3<f64> {
    let (s, c) = libm::sincos(angle);
    match axis {
        0 => Mat3::from_columns(vec3(1.0, 0.0, 0.0), vec3(0.0, c, s), vec3(0.0, -s, c)),
        1 => Mat3::from_columns(vec3(c, 0.0, -s), vec3(0.0, 1.0, 0.0), vec3(s, 0.0, c)),
        _ => Mat3::from_columns(vec3(c, s, 0.0), vec3(-s, c, 0.0), vec3(0.0, 0.0, 1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::Block;

    /// A box that lies anyhow is found; one that lies along the axes, and a ball, keep them.
    #[test]
    fn a_turned_box_is_found() {
        let mesh = Block::new(vec3(0.2, 0.05, 0.05), [8, 3, 3]).mesh().expect("a block");
        let turned = |angles: [f64; 3]| {
            let r = turn(2, angles[0]) * turn(1, angles[1]) * turn(0, angles[2]);
            (r, mesh.vertices().iter().map(|x| r * *x).collect::<Vec<_>>())
        };
        for angles in [[0.6, -0.4, 0.3], [2.0, 1.1, -0.7], [0.1, 0.0, 0.0], [-0.77, 0.2, 3.0]] {
            let (r, places) = turned(angles);
            let product = axes(&places) * r;
            for column in product.columns {
                let largest = column.to_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
                assert!((largest - 1.0).abs() < 1e-9, "{angles:?}: {product:?}");
            }
        }
        assert_eq!(axes(mesh.vertices()), Mat3::IDENTITY);
        let ball: Vec<Vec3<f64>> = (0..500)
            .map(|i| {
                let (s, c) = libm::sincos(f64::from(i) * 2.4);
                let z = f64::from(i) / 250.0 - 0.998;
                let r = (1.0 - z * z).max(0.0).sqrt();
                vec3(r * c, r * s, z)
            })
            .collect();
        assert_eq!(axes(&ball), Mat3::IDENTITY);
        assert_eq!(axes(&[]), Mat3::IDENTITY);
        let mut odd = mesh.vertices().to_vec();
        (odd[5].x, odd[7].z) = (f64::NAN, f64::INFINITY);
        assert_eq!(axes(&odd), Mat3::IDENTITY);
    }
}
