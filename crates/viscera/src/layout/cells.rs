//! Tetrahedra in cells of space: the points that are nearest to a site of a body-centred cubic lattice.
//!
//! These cells are truncated octahedra, and four of them meet at a corner, as few as can be. The lattice has a colouring
//! by four classes in which touching cells differ; cells of one class are .45 of a cell's width apart, which is more
//! than two tetrahedra reach from some 400 tetrahedra a cell on. Any other way of cutting space needs more colours: boxes
//! need eight.
//!
//! ```text
//! sites       (X, Y, Z) a/2, all even or all odd
//! neighbours  (+-1, +-1, +-1), (+-2, 0, 0), (0, +-2, 0), (0, 0, +-2)
//! class       X + Y + Z mod 4, which none of these leaves as it is
//! ```
//!
//! Conway and Sloane, "Sphere Packings, Lattices and Groups", Springer 1999, chapters 4 and 21, have the lattice and its cells.

use crate::mesh::tet_volume;
use crate::scalar::Vec3;
use crate::sorting;

/// What a cell has at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Most {
    pub tets: usize,
    pub vertices: usize,
}

/// Tetrahedra that are close to each other.
#[derive(Clone, Debug, Default)]
pub(super) struct Cell {
    /// Cells of one class do not touch, where meshes are even.
    pub class: u32,
    pub tets: Vec<u32>,
    /// How many vertices they have.
    pub vertices: usize,
}

/// Classes of cells.
const CLASSES: u64 = 4;

/// Lattices that are tried, each with cells of so much of the volume of those before: cells of one volume do not have one
/// number of tetrahedra.
const TRIES: usize = 12;
const SMALLER: f64 = 0.93;

/// Slices of a box along an axis.
const SLICES: usize = 32;

/// Sites along an axis: as many as a key has bits for.
const MOST_SITES: f64 = (1 << 19) as f64;

/// The tetrahedra in cells that have what they may have at most. Those that come first come first in each cell.
pub(super) fn cells(tets: &[[u32; 4]], places: &[Vec3<f64>], most: Most) -> Vec<Cell> {
    let all = (0..tets.len() as u32).collect();
    let mut counter = Counter { tets, stamps: vec![0; places.len()], stamp: 0 };
    let whole = counter.cell(0, all);
    if whole.fits(most) {
        return vec![whole];
    }
    let corners = |tet: &[u32; 4]| tet.map(|v| places[v as usize]);
    let volume: f64 = tets.iter().map(|tet| tet_volume(corners(tet)).abs()).sum();
    let (mut low, mut high) = (places[0], places[0]);
    places.iter().for_each(|place| (low, high) = (low.min(*place), high.max(*place)));
    let center =
        |tet: &[u32; 4]| corners(tet).into_iter().fold(Vec3::ZERO, |sum, x| sum + x) * 0.25;
    let centers: Vec<_> = tets.iter().map(|tet| center(tet) - low).collect();

    let even = volume * most.tets as f64 / tets.len() as f64;
    let mut made = Vec::new();
    for spread in [centers.clone(), evened(&centers, high - low)] {
        let mut wanted = even;
        for _ in 0..TRIES {
            made = in_lattice(&spread, steps(high - low, wanted), &mut counter);
            if made.iter().all(|cell| cell.fits(most)) {
                return made;
            }
            wanted *= SMALLER;
        }
    }
    // Finer in one place than in another still.
    let mut halved = Vec::new();
    made.into_iter().for_each(|cell| halve(cell, &centers, most, &mut counter, &mut halved));
    halved
}

/// Centres where a mesh is finer in one place than in another: moved along each axis so that slices of the box around have one
/// number of tetrahedra each.
fn evened(centers: &[Vec3<f64>], size: Vec3<f64>) -> Vec<Vec3<f64>> {
    let mut moved = centers.to_vec();
    for axis in 0..3 {
        // Slices up to a place: whole ones, and how far into the next.
        let scale = SLICES as f64 / size[axis].max(f64::MIN_POSITIVE);
        let slice = |x: f64| ((x * scale).max(0.0) as usize).min(SLICES - 1);
        let mut below = [0.0; SLICES + 1];
        centers.iter().for_each(|center| below[slice(center[axis]) + 1] += 1.0);
        (0..SLICES).for_each(|i| below[i + 1] += below[i]);
        let share = size[axis] / centers.len() as f64;
        for center in &mut moved {
            let x = center[axis];
            let own = slice(x);
            let into = x * scale - own as f64;
            center[axis] = share * (below[own] + into * (below[own + 1] - below[own]));
        }
    }
    moved
}

/// The lattice's constant along each axis [m], for cells of about this volume [m^3]: the faces of the box around all lie on
/// sites, so that it cuts cells into halves, and none into slivers.
fn steps(size: Vec3<f64>, volume: f64) -> [f64; 3] {
    // There are two sites to a cube.
    let even = libm::cbrt(2.0 * volume).max(f64::MIN_POSITIVE);
    [size.x, size.y, size.z].map(|size| {
        let halves = (2.0 * size / even).round().min(MOST_SITES);
        if halves > 0.0 { 2.0 * size / halves } else { even }
    })
}

fn in_lattice(centers: &[Vec3<f64>], steps: [f64; 3], counter: &mut Counter<'_>) -> Vec<Cell> {
    let site = |center: &Vec3<f64>| -> [u64; 3] {
        let own = [center.x / steps[0], center.y / steps[1], center.z / steps[2]];
        let even = own.map(|x| (x + 0.5).floor());
        let odd = own.map(|x| x.floor() + 0.5);
        let squared = |site: [f64; 3]| {
            let away = [own[0] - site[0], own[1] - site[1], own[2] - site[2]];
            away[0] * away[0] + away[1] * away[1] + away[2] * away[2]
        };
        let nearest = if squared(even) <= squared(odd) { even } else { odd };
        nearest.map(|x| (2.0 * x) as u64)
    };
    let key = |[x, y, z]: [u64; 3]| (z << 42) | (y << 21) | x;
    let sites: Vec<_> = centers.iter().map(site).collect();
    let order = sorting::by_key(0..centers.len() as u32, |tet| [key(sites[tet as usize]), 0]);
    let cells = order.chunk_by(|&a, &b| sites[a as usize] == sites[b as usize]);
    let class = |[x, y, z]: [u64; 3]| ((x + y + z) % CLASSES) as u32;
    cells.map(|cell| counter.cell(class(sites[cell[0] as usize]), cell.to_vec())).collect()
}

/// Halves a cell across its longest side until the halves fit.
fn halve(
    cell: Cell,
    centers: &[Vec3<f64>],
    most: Most,
    counter: &mut Counter<'_>,
    into: &mut Vec<Cell>,
) {
    if cell.fits(most) {
        into.push(cell);
        return;
    }
    let (mut low, mut high) = (Vec3::splat(f64::INFINITY), Vec3::splat(f64::NEG_INFINITY));
    for &tet in &cell.tets {
        let center = centers[tet as usize];
        (low, high) = (low.min(center), high.max(center));
    }
    let size = high - low;
    let axis =
        (1..3).fold(0, |longest, axis| if size[axis] > size[longest] { axis } else { longest });
    // Centres are relative to the lowest corner: none is below zero, and the order of their bits is theirs.
    let mut low = sorting::by_key(cell.tets.iter().copied(), |tet| {
        [centers[tet as usize][axis].max(0.0).to_bits(), 0]
    });
    let mut high = low.split_off(low.len() / 2);
    for half in [&mut low, &mut high] {
        half.sort_unstable();
        let half = counter.cell(cell.class, std::mem::take(half));
        halve(half, centers, most, counter, into);
    }
}

impl Cell {
    fn fits(&self, most: Most) -> bool {
        self.tets.len() <= most.tets && self.vertices <= most.vertices
    }
}

/// Counts vertices.
struct Counter<'a> {
    tets: &'a [[u32; 4]],
    stamps: Vec<u32>,
    stamp: u32,
}

impl Counter<'_> {
    fn cell(&mut self, class: u32, tets: Vec<u32>) -> Cell {
        self.stamp += 1;
        let mut vertices = 0;
        for &v in tets.iter().flat_map(|&tet| &self.tets[tet as usize]) {
            let stamp = &mut self.stamps[v as usize];
            vertices += usize::from(*stamp != self.stamp);
            *stamp = self.stamp;
        }
        Cell { class, tets, vertices }
    }
}
