//! Isosurface stuffing keeps what its paper proves: angles, conformity, accuracy.

use std::collections::BTreeMap;

use viscera::mesh::TetMesh;
use viscera::mesh::distance::{
    Capsule, Cuboid, Ellipsoid, SignedDistance, SmoothSubtraction, SmoothUnion, Sphere,
};
use viscera::mesh::tetrahedralize::{
    DIHEDRAL_BOUNDS_DEG, TetrahedralizeError, surface, tetrahedralize,
};
use viscera::scalar::{Vec3, vec3};

/// SplitMix64, a small generator with a full period: same shapes on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        hash(self.0)
    }
    /// Uniform in [low, high).
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn point(&mut self, reach: f64) -> Vec3<f64> {
        vec3(self.within(-reach, reach), self.within(-reach, reach), self.within(-reach, reach))
    }
}

fn hash(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Value noise inside a ball: signs and cut points of neighbouring edges have little to do with
/// each other, so that every stencil meets every kind of cut.
struct Noise {
    seed: u64,
    cell: f64,
}

impl Noise {
    fn at(&self, i: i64, j: i64, k: i64) -> f64 {
        let mix = |state: u64, index: i64| hash(state.wrapping_add(index as u64));
        let bits = mix(mix(mix(self.seed, i), j), k);
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

impl SignedDistance for Noise {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        let p = point * (1.0 / self.cell);
        let base = [p.x.floor(), p.y.floor(), p.z.floor()];
        let f = [p.x - base[0], p.y - base[1], p.z - base[2]];
        let mut value = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut index = [0; 3];
            for axis in 0..3 {
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { f[axis] } else { 1.0 - f[axis] };
                index[axis] = base[axis] as i64 + upper;
            }
            value += weight * self.at(index[0], index[1], index[2]);
        }
        let ball = point.length() - 1.0;
        (self.cell * value).max(ball)
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        (Vec3::splat(-1.0), Vec3::splat(1.0))
    }
}

/// Smallest and largest dihedral angle [degrees].
fn dihedral_range(mesh: &TetMesh) -> (f64, f64) {
    let (mut smallest, mut largest) = (180.0_f64, 0.0_f64);
    for tet in 0..mesh.tets().len() {
        let x = mesh.corners(tet);
        for [a, b, c, d] in
            [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]]
        {
            // The angle between the parts of c and d that are normal to the edge ab.
            let (edge, to_c, to_d) = (x[b] - x[a], x[c] - x[a], x[d] - x[a]);
            let (u, v) = (edge.cross(to_c), edge.cross(to_d));
            let angle = u.cross(v).length().atan2(u.dot(v)).to_degrees();
            smallest = smallest.min(angle);
            largest = largest.max(angle);
        }
    }
    (smallest, largest)
}

fn assert_angles_hold(mesh: &TetMesh, what: &str) -> (f64, f64) {
    let (smallest, largest) = dihedral_range(mesh);
    let bounds = DIHEDRAL_BOUNDS_DEG;
    assert!(
        smallest >= bounds.0 && largest <= bounds.1,
        "{what}: dihedral angles {smallest} to {largest} degrees, outside {bounds:?}"
    );
    (smallest, largest)
}

/// Every face in one or two tetrahedra, wound oppositely; returns the boundary.
fn assert_conforming(mesh: &TetMesh, what: &str) -> Vec<[u32; 3]> {
    let mut faces: BTreeMap<[u32; 3], Vec<[u32; 3]>> = BTreeMap::new();
    for &[a, b, c, d] in mesh.tets() {
        for face in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
            let mut key = face;
            key.sort_unstable();
            faces.entry(key).or_default().push(face);
        }
    }
    for same in faces.values() {
        assert!(same.len() <= 2, "{what}: face {:?} is in {} tetrahedra", same[0], same.len());
        if let [a, b] = same[..] {
            let turned = |f: [u32; 3]| [[f[0], f[2], f[1]], [f[2], f[1], f[0]], [f[1], f[0], f[2]]];
            assert!(turned(a).contains(&b), "{what}: tetrahedra overlap at face {a:?}");
        }
    }
    faces.into_values().filter(|same| same.len() == 1).map(|same| same[0]).collect()
}

/// Each edge of a closed orientable surface is run through once in each direction.
fn assert_closed_manifold(triangles: &[[u32; 3]], what: &str) {
    let mut edges: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for &[a, b, c] in triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    for (&[a, b], &count) in &edges {
        assert_eq!(count, 1, "{what}: edge {a}-{b} twice in one direction");
        assert!(edges.contains_key(&[b, a]), "{what}: edge {a}-{b} has one triangle");
    }
}

fn volume(mesh: &TetMesh) -> f64 {
    (0..mesh.tets().len()).map(|tet| viscera::mesh::tet_volume(mesh.corners(tet))).sum()
}

fn random_union(seed: u64) -> Box<dyn SignedDistance> {
    let mut random = Random(seed);
    let mut shape: Box<dyn SignedDistance> = Box::new(Sphere { center: Vec3::ZERO, radius: 0.5 });
    for _ in 0..4 {
        let center = random.point(0.5);
        let radii = vec3(random.within(0.2, 0.5), random.within(0.2, 0.5), random.within(0.2, 0.5));
        shape = Box::new(SmoothUnion {
            first: shape,
            second: Ellipsoid { center, radii },
            blend: random.within(0.05, 0.3),
        });
    }
    let removed = Capsule { start: random.point(0.9), end: random.point(0.9), radius: 0.15 };
    Box::new(SmoothSubtraction { shape, removed, blend: 0.1 })
}

const UNIT_SPHERE: Sphere = Sphere { center: Vec3::ZERO, radius: 1.0 };

#[test]
fn dihedral_angles_stay_within_the_proved_bounds_for_noise() {
    let (mut smallest, mut largest) = (180.0_f64, 0.0_f64);
    for seed in 0..8 {
        for cell in [0.03, 0.06, 0.11] {
            let (mesh, _) = tetrahedralize(&Noise { seed, cell }, 0.1).unwrap();
            assert_conforming(&mesh, "noise");
            let range = assert_angles_hold(&mesh, "noise");
            smallest = smallest.min(range.0);
            largest = largest.max(range.1);
        }
    }
    println!("dihedral angles {smallest} to {largest} degrees");
    // The bounds are sharp: with so many configurations the worst ones come close.
    assert!(smallest < 12.5 && largest > 160.0, "{smallest} to {largest}: weaker than it was");
}
