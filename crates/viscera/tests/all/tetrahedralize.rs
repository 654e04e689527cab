//! Isosurface stuffing keeps what its paper proves: angles, conformity, accuracy.

use std::collections::{BTreeMap, BTreeSet};

use viscera::mesh::TetMesh;
use viscera::mesh::distance::{
    Capsule, Cuboid, Ellipsoid, SignedDistance, SmoothSubtraction, SmoothUnion, Sphere,
};
use viscera::mesh::liver::Liver;
use viscera::mesh::quality::{dihedral_angles, summarize_quality};
use viscera::mesh::tetrahedralize::{
    DIHEDRAL_BOUNDS_DEG, Spacing, TetrahedralizeError, surface, tetrahedralize,
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

fn assert_angles_hold(mesh: &TetMesh, what: &str) -> (f64, f64) {
    let quality = summarize_quality(mesh);
    let (smallest, largest) =
        (quality.min_dihedral.to_degrees(), quality.max_dihedral.to_degrees());
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
    for seed in 0..3 {
        for cell in [0.03, 0.06, 0.11] {
            let (mesh, report) = tetrahedralize(&Noise { seed, cell }, 0.1).unwrap();
            assert_conforming(&mesh, "noise");
            assert_angles_hold(&mesh, "noise");
            // Nothing resolves noise, and the report says so.
            assert!(report.components > 1 || report.non_manifold_edges > 0);
        }
    }
}

#[test]
fn smooth_shapes_become_closed_manifolds_with_the_proved_angles() {
    let capsule = Capsule { start: vec3(-0.7, 0.1, 0.0), end: vec3(0.6, -0.2, 0.3), radius: 0.4 };
    let mut shapes: Vec<(String, Box<dyn SignedDistance>, [f64; 3])> = vec![
        ("sphere".into(), Box::new(UNIT_SPHERE), [0.4, 0.17, 0.11]),
        ("capsule".into(), Box::new(capsule), [0.2, 0.11, 0.083]),
        ("liver".into(), Box::new(Liver::scaled(1.0)), [0.02, 0.0123, 0.0091]),
    ];
    // Grooves as thin as 0.2 and fillets as tight as 0.05 want fine lattices.
    for seed in 0..3 {
        shapes.push((format!("union {seed}"), random_union(seed), [0.083, 0.067, 0.06]));
    }
    for (name, shape, spacings) in &shapes {
        for &spacing in spacings {
            let what = format!("{name} at {spacing}");
            let (mesh, report) = tetrahedralize(shape, spacing).unwrap();
            let (smallest, largest) = assert_angles_hold(&mesh, &what);
            let boundary = assert_conforming(&mesh, &what);
            println!("{what}: {} tets, {smallest:.2} to {largest:.2} degrees", mesh.tets().len());
            assert_eq!((report.components, report.non_manifold_edges), (1, 0), "{what}");
            assert_closed_manifold(&boundary, &what);
        }
    }
}

/// Triangles by the bits of their corners.
fn places(triangles: &[[u32; 3]], mesh: &TetMesh) -> BTreeSet<[[u64; 3]; 3]> {
    let place = |v: u32| mesh.vertices()[v as usize].to_array().map(f64::to_bits);
    triangles
        .iter()
        .map(|triangle| {
            let mut places = triangle.map(place);
            places.sort_unstable();
            places
        })
        .collect()
}

/// To the round-off of a sum of that many.
fn assert_same_volume(mesh: &TetMesh, other: &TetMesh, what: &str) {
    let off = (mesh.volume() / other.volume() - 1.0).abs();
    assert!(off < other.tets().len() as f64 * f64::EPSILON, "{what}: {off:e}");
}

/// Cubes that grow inwards leave the surface as it is, fill what the small ones do, without gaps and overlaps, and with angles
/// of undisturbed cubes.
#[test]
fn graded_tetrahedra_fill_the_same_body() {
    let box_like =
        Cuboid { center: vec3(0.1, 0.0, -0.05), half_size: vec3(0.9, 0.7, 0.8), rounding: 0.1 };
    let shapes: [(&str, Box<dyn SignedDistance>, f64); 4] = [
        ("sphere", Box::new(UNIT_SPHERE), 0.07),
        ("box", Box::new(box_like), 0.12),
        ("liver", Box::new(Liver::scaled(1.0)), 0.007),
        ("union", random_union(1), 0.05),
    ];
    for (name, shape, spacing) in &shapes {
        let (uniform, _) = tetrahedralize(shape, *spacing).unwrap();
        let boundary = places(&assert_conforming(&uniform, name), &uniform);
        let mut before = uniform.tets().len();
        for doublings in [1, 3] {
            let what = format!("{name}, {doublings} doublings");
            let (mesh, report) =
                tetrahedralize(shape, Spacing { surface: *spacing, doublings }).unwrap();
            let boundary_triangles = assert_conforming(&mesh, &what);
            assert_eq!(places(&boundary_triangles, &mesh), boundary, "{what}");
            // Positive volumes that add up to the same within the same boundary overlap nowhere.
            assert_same_volume(&mesh, &uniform, &what);
            assert_eq!((report.components, report.non_manifold_edges), (1, 0), "{what}");
            assert_angles_hold(&mesh, &what);
            let outside: BTreeSet<u32> = boundary_triangles.iter().flatten().copied().collect();
            let is_inside = |tet: &[u32; 4]| tet.iter().all(|v| !outside.contains(v));
            for tet in mesh.tets().iter().filter(|tet| is_inside(tet)) {
                for angle in dihedral_angles(tet.map(|v| mesh.vertices()[v as usize])) {
                    let degrees = angle.to_degrees();
                    assert!((44.99..120.01).contains(&degrees), "{what}: {degrees}");
                }
            }
            println!("{what}: {} tets of {}", mesh.tets().len(), uniform.tets().len());
            assert!(mesh.tets().len() <= before, "{what}");
            before = mesh.tets().len();
        }
        assert!(before < uniform.tets().len(), "{name}");
    }
}

/// Holes everywhere stop cubes from growing, wherever they are.
#[test]
fn graded_noise_keeps_the_bounds() {
    // Where features are as small as cubes, what is inside ends right beside them.
    for (seed, cell) in [(0, 0.4), (1, 0.4), (2, 0.1), (3, 0.1)] {
        let noise = Noise { seed, cell };
        let (uniform, _) = tetrahedralize(&noise, 0.04).unwrap();
        let (mesh, _) = tetrahedralize(&noise, Spacing { surface: 0.04, doublings: 4 }).unwrap();
        assert!(mesh.tets().len() < uniform.tets().len());
        let boundary = |mesh: &TetMesh| places(&assert_conforming(mesh, "noise"), mesh);
        assert_eq!(boundary(&mesh), boundary(&uniform));
        assert_same_volume(&mesh, &uniform, "noise");
        assert_angles_hold(&mesh, "noise");
    }
}

#[test]
fn every_boundary_vertex_lies_on_the_zero_set() {
    for spacing in [0.3, 0.1] {
        let skin = surface(&UNIT_SPHERE, spacing).unwrap();
        for &vertex in &skin.vertices {
            // The root finder's tolerance, 1e-14 of the edge, and some round-off of positions.
            let distance = UNIT_SPHERE.distance(vertex);
            assert!(distance.abs() < 1e-14, "{distance:e}");
        }
        assert_closed_manifold(&skin.triangles, "sphere");
    }
}

#[test]
fn the_surface_encloses_what_the_tetrahedra_fill() {
    let shape = random_union(11);
    let skin = surface(&shape, 0.1).unwrap();
    let enclosed = skin.enclosed_volume();
    let filled = tetrahedralize(&shape, 0.1).unwrap().0.volume();
    // Some ten thousand summands of one sign each, round-off of both sums.
    assert!((enclosed - filled).abs() < 1e-12 * filled, "{enclosed} and {filled}");
}

#[test]
fn the_volume_of_a_sphere_converges_at_second_order() {
    let exact = 4.0 / 3.0 * std::f64::consts::PI;
    let errors = [0.2, 0.1, 0.05]
        .map(|spacing| exact - tetrahedralize(&UNIT_SPHERE, spacing).unwrap().0.volume());
    for pair in errors.windows(2) {
        // Halving the spacing divides the error of inscribed triangles by 4, up to the chance of
        // where the lattice falls.
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.2, "order {order}, errors {errors:?}");
    }
}

#[test]
fn the_same_arguments_give_the_same_bits() {
    let fingerprint = || {
        let (mesh, _) = tetrahedralize(&random_union(5), 0.09).unwrap();
        let positions = mesh.vertices().iter().flat_map(|x| x.to_array()).map(f64::to_bits);
        let indices = mesh.tets().iter().flatten().map(|&v| u64::from(v));
        positions.chain(indices).fold(0, |state, bits| hash(state ^ bits))
    };
    assert_eq!(fingerprint(), fingerprint());
}

#[test]
fn a_box_on_lattice_planes_is_filled_exactly() {
    // Lattice vertices fall exactly on the faces: sign zero, without warping.
    let half_size = Vec3::splat(0.5);
    let cube = Cuboid { center: Vec3::ZERO, half_size, rounding: 0.0 };
    let (mesh, report) = tetrahedralize(&cube, 0.25).unwrap();
    assert_angles_hold(&mesh, "cube");
    assert_closed_manifold(&assert_conforming(&mesh, "cube"), "cube");
    assert_eq!(report.components, 1);
    // The box's edges run along lattice edges, so not even they are rounded off. Some thousand
    // tetrahedra, round-off of the sum.
    assert!((mesh.volume() - 1.0).abs() < 1000.0 * f64::EPSILON);
}

#[test]
fn pieces_that_fall_apart_are_counted() {
    let pair = SmoothUnion {
        first: Sphere { center: vec3(-1.0, 0.0, 0.0), radius: 0.5 },
        second: Sphere { center: vec3(1.0, 0.0, 0.0), radius: 0.5 },
        blend: 0.1,
    };
    let (_, report) = tetrahedralize(&pair, 0.15).unwrap();
    assert_eq!((report.components, report.non_manifold_edges), (2, 0));
}

#[test]
fn a_spacing_that_misses_the_shape_is_an_error_with_one_that_does_not() {
    // No lattice vertex of this coarse lattice lies in either of these balls.
    let pair = SmoothUnion {
        first: Sphere { center: vec3(-1.0, 0.1, 0.0), radius: 0.1 },
        second: Sphere { center: vec3(1.0, 0.0, 0.1), radius: 0.1 },
        blend: 0.01,
    };
    let error = tetrahedralize(&pair, 0.8).unwrap_err();
    let TetrahedralizeError::TooCoarse { suggestion, .. } = error else { panic!("{error}") };
    assert!(error.to_string().contains("use at most"), "{error}");
    assert!(tetrahedralize(&pair, suggestion).is_ok());
}

#[test]
fn a_lattice_too_large_is_an_error_with_a_spacing_that_fits() {
    for spacing in [1e-3, 1e-9, 1e-300] {
        let error = tetrahedralize(&UNIT_SPHERE, spacing).unwrap_err();
        let TetrahedralizeError::TooFine { suggestion, .. } = error else { panic!("{error}") };
        assert!((1e-3..1e-2).contains(&suggestion), "{suggestion}");
    }
}

#[test]
fn impossible_shapes_are_errors() {
    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = tetrahedralize(&UNIT_SPHERE, spacing).unwrap_err();
        assert!(matches!(error, TetrahedralizeError::Spacing { .. }), "{error}");
    }
    for radius in [-1.0, f64::NAN, f64::INFINITY] {
        let error = tetrahedralize(&Sphere { center: Vec3::ZERO, radius }, 0.1).unwrap_err();
        assert_eq!(error, TetrahedralizeError::Bounds);
    }
    let error = tetrahedralize(&Sphere { center: Vec3::ZERO, radius: 0.0 }, 0.1).unwrap_err();
    assert_eq!(error, TetrahedralizeError::Empty);
    struct Faulty(f64);
    impl SignedDistance for Faulty {
        fn distance(&self, _: Vec3<f64>) -> f64 {
            self.0
        }
        fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
            (Vec3::ZERO, Vec3::splat(1.0))
        }
    }
    let error = tetrahedralize(&Faulty(f64::NAN), 0.1).unwrap_err();
    assert!(matches!(error, TetrahedralizeError::NotFinite { .. }), "{error}");
    let error = tetrahedralize(&Faulty(-1.0), 0.1).unwrap_err();
    assert!(matches!(error, TetrahedralizeError::BoundsTooTight { .. }), "{error}");
}
