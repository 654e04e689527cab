//! The dihedral bounds, by enumeration: one lattice tetrahedron, every combination of signs, and of
//! cut points and warped corners sampled over all that warping can leave. Not a formal proof: finer
//! sampling, tried up to six places, finds the same extremes.

use super::super::lattice::{ALPHA_LONG, ALPHA_SHORT};
use super::*;
use crate::mesh::distance::Sphere;
use crate::mesh::quality::dihedral_angles;
use crate::mesh::tet_volume;

const SIGNS: [Sign; 3] = [Sign::Inside, Sign::Surface, Sign::Outside];

/// Each cut point and each warp is tried at this many places: extremes lie at the ends of the
/// intervals or on smooth stretches between them.
const PLACES: usize = 3;

#[test]
fn no_stencil_leaves_the_dihedral_bounds() {
    let ball = Sphere { center: Vec3::ZERO, radius: 1.0 };
    let mut corners = None;
    let mut seeded = Lattice::blank(&ball);
    seeded.mark_center_inside();
    // One tetrahedron stands for all: the lattice's symmetries map any to any other or to its
    // mirror image, and the two mirror images meet the parity rule's two cases.
    seeded.for_each_tet(|_| true, |tet| corners = corners.or(Some(tet)));
    let corners = corners.unwrap();

    let (mut smallest, mut largest) = (180.0_f64, 0.0_f64);
    for pattern in 0..81_usize {
        let signs = [0, 1, 2, 3].map(|i| SIGNS[pattern / 3_usize.pow(i) % 3]);
        if !signs.contains(&Sign::Inside) {
            continue;
        }
        let mut signed = corners;
        for (corner, sign) in signed.iter_mut().zip(signs) {
            corner.sign = sign;
        }
        let (low, high) = enumerate(&ball, signed);
        (smallest, largest) = (smallest.min(low), largest.max(high));
    }
    println!("dihedral angles {smallest:.4} to {largest:.4} degrees");
    assert!(smallest >= DIHEDRAL_BOUNDS_DEG.0 && largest <= DIHEDRAL_BOUNDS_DEG.1);
    // And the bounds are those of these thresholds, not generous ones.
    assert!(smallest < DIHEDRAL_BOUNDS_DEG.0 + 0.02 && largest > DIHEDRAL_BOUNDS_DEG.1 - 0.02);
}

/// Smallest and largest dihedral angle over all cut points and warps of one sign pattern.
fn enumerate(ball: &Sphere, corners: [Corner; 4]) -> (f64, f64) {
    let mut lattice = Lattice::blank(ball);
    let with_sign = |sign| corners.into_iter().filter(move |corner| corner.sign == sign);
    let edges: Vec<(u32, u32)> = with_sign(Sign::Inside)
        .flat_map(|inside| with_sign(Sign::Outside).map(move |outside| (inside.id, outside.id)))
        .collect();
    let alpha = |a: u32, b: u32| if a % 2 == b % 2 { ALPHA_LONG } else { ALPHA_SHORT };
    let place = |place: usize| place as f64 / (PLACES - 1) as f64;
    let cut_choices: Vec<Vec<(u32, u32, f64)>> = edges
        .iter()
        .map(|&(inside, outside)| {
            let alpha = alpha(inside, outside);
            let at = |n| (inside, outside, alpha + (1.0 - 2.0 * alpha) * place(n));
            (0..PLACES).map(at).collect()
        })
        .collect();
    let warp_choices: Vec<Vec<(u32, u32, f64)>> = with_sign(Sign::Surface)
        .map(|corner| {
            // A vertex never warps towards another that is on the surface already, or comes to be.
            let surface: Vec<u32> = with_sign(Sign::Surface).map(|corner| corner.id).collect();
            let directions = lattice.all_neighbors(corner.id);
            directions
                .into_iter()
                .filter(|towards| !surface.contains(towards))
                .flat_map(|towards| {
                    let alpha = alpha(corner.id, towards);
                    (0..PLACES).map(move |n| (corner.id, towards, alpha * place(n)))
                })
                .collect()
        })
        .collect();
    let (mut smallest, mut largest) = (180.0_f64, 0.0_f64);
    for_each_choice(&warp_choices, |warps| {
        for_each_choice(&cut_choices, |cuts| {
            lattice.prescribe(cuts, warps);
            for tet in fill(&lattice, corners) {
                let (low, high) = dihedral_range(tet);
                (smallest, largest) = (smallest.min(low), largest.max(high));
            }
        });
    });
    (smallest, largest)
}

fn fill(lattice: &Lattice, corners: [Corner; 4]) -> Vec<[Vec3<f64>; 4]> {
    let mut builder = Builder {
        lattice_index: vec![NO_VERTEX; lattice.vertex_count()],
        cut_index: vec![NO_VERTEX; lattice.cut_count()],
        lattice,
        vertices: Vec::new(),
        on_surface: Vec::new(),
        tets: Vec::new(),
    };
    builder.fill(corners);
    builder.tets.iter().map(|tet| tet.map(|v| builder.vertices[v as usize])).collect()
}

/// Calls `visit` with one choice from each list, in all combinations.
fn for_each_choice<T: Copy>(lists: &[Vec<T>], mut visit: impl FnMut(&[T])) {
    let count: usize = lists.iter().map(Vec::len).product();
    let mut chosen = Vec::new();
    for mut n in 0..count {
        chosen.clear();
        for list in lists {
            chosen.push(list[n % list.len()]);
            n /= list.len();
        }
        visit(&chosen);
    }
}

/// Smallest and largest dihedral angle [degrees], zero for a tetrahedron that is inside out.
fn dihedral_range(x: [Vec3<f64>; 4]) -> (f64, f64) {
    if tet_volume(x) <= 0.0 {
        return (0.0, 180.0);
    }
    let degrees = dihedral_angles(x).map(f64::to_degrees);
    let smallest = degrees.into_iter().fold(f64::INFINITY, f64::min);
    let largest = degrees.into_iter().fold(0.0, f64::max);
    (smallest, largest)
}
