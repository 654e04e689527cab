//! Delaunay's tetrahedra of a box filled with points in no order, none made better: among them are slivers, four points
//! about a circle, which no rule of empty spheres forbids.
//!
//! Point by point: tetrahedra whose sphere holds the new point go, and the faces around them are joined to it
//! (A. Bowyer; D. F. Watson, both The Computer Journal 24, 1981).

use anyhow::{Context as _, Result};
use viscera::mesh::topology::TET_FACES;
use viscera::mesh::{TetMesh, tet_volume};
use viscera::scalar::{Vec3, vec3};

use crate::load_cases::Random;

/// The farthest that a point lies from its place in the grid along each axis, of the grid's spacing: neighbours never
/// meet.
const AWAY: f64 = 0.3;

/// How much faces of the box bulge while spheres are compared, of half the box: points of one face then have no
/// tetrahedron of all four, but for such as are flat in the box. Much more than numbers round by, and far less than
/// slivers are thick.
const BULGE: f64 = 1e-7;

/// The first tetrahedron over the box: so large that spheres of tetrahedra that are not flat do not reach its corners.
const FAR: f64 = 1e4;

/// A box from the origin to `size` [m] with so many points along each axis, and one more. Points of a face lie anywhere
/// in it, those of an edge anywhere on it.
pub fn delaunay(size: Vec3<f64>, cells: [usize; 3], seed: u64) -> Result<TetMesh> {
    let points = scattered(cells, &mut Random(seed));
    let places: Vec<_> = points.iter().map(|x| bulged(*x).scale(size)).collect();
    let lies_in_a_face = |tet: &[u32; 4]| {
        let corners = tet.map(|v| points[v as usize]);
        let all_at = |axis, end| corners.iter().all(|x: &Vec3<f64>| x[axis] == end);
        (0..3).any(|axis| all_at(axis, -1.0) || all_at(axis, 1.0))
    };
    let mut tets = tetrahedra(places);
    tets.retain(|tet| !lies_in_a_face(tet));
    let vertices = points.iter().map(|x| (*x + Vec3::splat(1.0)).scale(size) * 0.5).collect();
    let regions = vec![0; tets.len()];
    Ok(TetMesh::new(vertices, tets, regions).context("Delaunay's tetrahedra of a box")?.0)
}

/// Points of the box from -1 to 1, by x, then y, then z. Those at its faces are there to the bit.
fn scattered(cells: [usize; 3], random: &mut Random) -> Vec<Vec3<f64>> {
    let along = |axis: usize, index: usize, shift: f64| match index {
        0 => -1.0,
        index if index == cells[axis] => 1.0,
        index => 2.0 * (index as f64 + shift) / cells[axis] as f64 - 1.0,
    };
    let mut points = Vec::new();
    for k in 0..=cells[2] {
        for j in 0..=cells[1] {
            for i in 0..=cells[0] {
                let shift = random.vector(AWAY);
                points.push(vec3(along(0, i, shift.x), along(1, j, shift.y), along(2, k, shift.z)));
            }
        }
    }
    points
}

/// A point of the box from -1 to 1 in one whose faces and edges are convex.
fn bulged(x: Vec3<f64>) -> Vec3<f64> {
    let [a, b, c] = x.to_array().map(|x| 0.5 * x * x);
    let out = vec3(1.0 - b - c, 1.0 - a - c, 1.0 - a - b);
    x + x.scale(out) * BULGE
}

/// Of points around the origin, no four on a circle and no five on a sphere.
fn tetrahedra(mut places: Vec<Vec3<f64>>) -> Vec<[u32; 4]> {
    let count = places.len() as u32;
    let far = FAR * places.iter().map(|x| x.length()).fold(0.0, f64::max);
    // The corners of a regular one.
    for [x, y, z] in [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]] {
        places.push(vec3(x, y, z) * far);
    }
    let wound = |mut tet: [u32; 4], places: &[Vec3<f64>]| {
        if tet_volume(tet.map(|v| places[v as usize])) < 0.0 {
            tet.swap(2, 3);
        }
        tet
    };
    let mut tets = vec![wound([count, count + 1, count + 2, count + 3], &places)];
    for point in 0..count {
        let sphere_holds =
            |tet: &[u32; 4]| is_inside(tet.map(|v| places[v as usize]), places[point as usize]);
        let (gone, mut kept): (Vec<_>, Vec<_>) = tets.into_iter().partition(sphere_holds);
        let mut faces: Vec<([u32; 3], [u32; 3])> = Vec::new();
        for tet in &gone {
            for face in TET_FACES {
                let face = face.map(|corner| tet[corner]);
                let mut key = face;
                key.sort_unstable();
                faces.push((key, face));
            }
        }
        faces.sort_unstable();
        let outer = faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1);
        kept.extend(outer.map(|same| {
            let [a, b, c] = same[0].1;
            wound([a, b, c, point], &places)
        }));
        tets = kept;
    }
    tets.retain(|tet| tet.iter().all(|&v| v < count));
    tets
}

/// Whether the sphere through a positively wound tetrahedron's corners holds a point.
fn is_inside(corners: [Vec3<f64>; 4], point: Vec3<f64>) -> bool {
    let [a, b, c, d] = corners.map(|x| x - point);
    let volume = |a: Vec3<f64>, b: Vec3<f64>, c: Vec3<f64>| a.dot(b.cross(c));
    let [p, q, r, s] = [a, b, c, d].map(|x| x.length_squared());
    p * volume(b, c, d) - q * volume(a, c, d) + r * volume(a, b, d) - s * volume(a, b, c) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::mesh::quality::shape_quality;

    #[test]
    fn a_sphere_holds_what_is_near_its_centre() {
        let axis = |k| Vec3::from_f64([0, 1, 2].map(|i| f64::from(u8::from(i == k))));
        let corners = [Vec3::ZERO, axis(0), axis(1), axis(2)];
        for (far, inside) in [(-0.01, false), (0.01, true), (0.99, true), (1.01, false)] {
            assert_eq!(is_inside(corners, Vec3::splat(far)), inside, "{far}");
        }
    }

    /// The box is filled, once, no vertex lies in the sphere of any tetrahedron, and there are slivers.
    #[test]
    fn empty_spheres_fill_the_box() {
        let size = vec3(0.08, 0.02, 0.02);
        let mesh = delaunay(size, [12, 3, 3], 1).expect("a mesh");
        assert_eq!(mesh.vertices().len(), 13 * 4 * 4);
        assert!((mesh.volume() / (size.x * size.y * size.z) - 1.0).abs() < 1e-12);
        // Corners of a tetrahedron lie on its sphere to rounding.
        let is_near = |x: Vec3<f64>, corners: &[Vec3<f64>; 4]| corners.contains(&x);
        let mut worst = 1.0f64;
        for tet in 0..mesh.tets().len() {
            let corners = mesh.corners(tet);
            worst = worst.min(shape_quality(corners));
            for &x in mesh.vertices().iter().filter(|x| !is_near(**x, &corners)) {
                let inward = corners.iter().fold(Vec3::ZERO, |sum, x| sum + *x) * 0.25 - x;
                // Bulging moved what lay nearly on a sphere.
                assert!(!is_inside(corners, x - inward * 1e-4), "tetrahedron {tet}");
            }
        }
        println!("{} tetrahedra, the worst of quality {worst}", mesh.tets().len());
        assert!(worst < 0.1, "{worst}");
    }
}
