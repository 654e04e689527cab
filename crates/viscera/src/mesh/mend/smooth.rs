//! Vertices where the worst tetrahedron around them is best.
//!
//! Optimization-based smoothing: each vertex inside climbs the lowest worth of the tetrahedra around it, by a pattern search, as
//! that has kinks. The worth of a tetrahedron is how far its dihedral angles are from 0 and 180 degrees; of one that is inside
//! out, its volume, which is below zero: the lowest of several volumes has one maximum, as each is linear in the vertex. L. A.
//! Freitag, C. Ollivier-Gooch, "Tetrahedral mesh improvement using swapping and smoothing", International Journal for Numerical
//! Methods in Engineering 40 (1997); untangling by volumes: L. A. Freitag, P. Plassmann, "Local optimization-based simplicial mesh
//! untangling and improvement", the same 49 (2000).

use crate::mesh::corners::{boundary_vertices, edge_lengths, tet_volume};
use crate::mesh::quality::dihedral_angles;
use crate::scalar::{Vec3, vec3};

/// Tetrahedra below this worth need the work [rad]: 11 degrees.
const POOR: f64 = 0.2;

/// Sweeps over all vertices at most.
const SWEEPS: usize = 12;

/// The first step and the last one, as a share of the longest edge around.
const FIRST: f64 = 0.3;
const LAST: f64 = 1e-3;

/// A gain that is worth a move, as a share of what there is.
const GAIN: f64 = 1e-4;

/// Moves vertices that are on no boundary, neither of the mesh nor between regions.
pub fn smooth(places: &mut [Vec3<f64>], tets: &[[u32; 4]], regions: &[u32]) {
    let fixed = boundary_vertices(tets, regions, places.len());
    let mut starts = vec![0u32; places.len() + 1];
    tets.iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
    for v in 0..places.len() {
        starts[v + 1] += starts[v];
    }
    let mut around = vec![0u32; 4 * tets.len()];
    let mut next = starts.clone();
    for (tet, vertices) in tets.iter().enumerate() {
        for &v in vertices {
            around[next[v as usize] as usize] = tet as u32;
            next[v as usize] += 1;
        }
    }
    let star = |v: usize| &around[starts[v] as usize..starts[v + 1] as usize];
    for _ in 0..SWEEPS {
        // Where most is inside out first: that is the vertex to blame, and not its neighbours.
        let turned = |v: &usize, places: &[Vec3<f64>]| {
            let volumes =
                star(*v).iter().map(|&t| tet_volume(tets[t as usize].map(|w| places[w as usize])));
            volumes.filter(|volume| *volume < 0.0).sum::<f64>()
        };
        let inside = (0..places.len()).filter(|&v| !fixed[v]);
        let mut order: Vec<(f64, usize)> = inside.map(|v| (turned(&v, places), v)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut has_moved = false;
        for (_, v) in order {
            has_moved |= climb(v, star(v), tets, places);
        }
        if !has_moved {
            break;
        }
    }
}

/// See the head of this module; volumes in terms of one that is given [m^3].
pub fn worth(corners: [Vec3<f64>; 4], unit: f64) -> f64 {
    let volume = tet_volume(corners);
    if volume <= 0.0 {
        return volume / unit;
    }
    let angles = dihedral_angles(corners).map(|angle| angle.min(std::f64::consts::PI - angle));
    angles.into_iter().fold(f64::INFINITY, f64::min)
}

/// Moves one vertex; whether it did.
fn climb(v: usize, star: &[u32], tets: &[[u32; 4]], places: &mut [Vec3<f64>]) -> bool {
    let corners = |&tet: &u32| tets[tet as usize].map(|w| places[w as usize]);
    let given: Vec<[Vec3<f64>; 4]> = star.iter().map(corners).collect();
    let longest = given.iter().flat_map(|x| edge_lengths(*x)).fold(0.0, f64::max);
    let unit = longest * longest * longest;
    let worst = |x: Vec3<f64>, places: &[Vec3<f64>]| {
        let place = |w: u32| if w as usize == v { x } else { places[w as usize] };
        let all = star.iter().map(|&tet| worth(tets[tet as usize].map(place), unit));
        all.fold(f64::INFINITY, f64::min)
    };
    let begin = places[v];
    let mut best = (worst(begin, places), begin);
    if star.is_empty() || best.0 >= POOR {
        return false;
    }
    let center = given.iter().flatten().fold(Vec3::ZERO, |sum, x| sum + *x);
    let center = center * (1.0 / (4.0 * star.len() as f64));
    let mut step = FIRST * longest;
    while step > LAST * longest {
        let toward = center - best.1;
        let toward = toward * (step / toward.length().max(step));
        let axes = [vec3(step, 0.0, 0.0), vec3(0.0, step, 0.0), vec3(0.0, 0.0, step)];
        let ways = axes.into_iter().flat_map(|way| [way, -way]).chain([toward]);
        let tried = ways.map(|way| best.1 + way).map(|x| (worst(x, places), x));
        let found = tried.fold(best, |best, tried| if tried.0 > best.0 { tried } else { best });
        match found.0 > best.0 + GAIN * best.0.abs() {
            true => best = found,
            false => step *= 0.5,
        }
    }
    places[v] = best.1;
    best.1 != begin
}
