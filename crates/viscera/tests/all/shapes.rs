//! Ready-made shapes have the volumes and the meshes they promise.

use std::collections::BTreeMap;

use viscera::mesh::distance::SignedDistance;
use viscera::mesh::embed::Embedding;
use viscera::mesh::liver::Liver;
use viscera::mesh::shapes::{
    Block, LIVER_SPACING, ShapeError, Splitting, beam, block, capsule, liver, sphere,
};
use viscera::mesh::tetrahedralize::surface;
use viscera::mesh::topology::connected_components;
use viscera::mesh::{TetMesh, tet_volume};
use viscera::scalar::{Vec3, vec3};

/// How many faces belong to one tetrahedron; asserts that none belongs to more than two.
fn boundary_face_count(mesh: &TetMesh) -> usize {
    let mut faces: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    for &[a, b, c, d] in mesh.tets() {
        for mut face in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
            face.sort_unstable();
            *faces.entry(face).or_default() += 1;
        }
    }
    assert!(faces.values().all(|&count| count <= 2));
    faces.values().filter(|&&count| count == 1).count()
}

#[test]
fn blocks_conform_and_fill_their_box() {
    for splitting in [Splitting::Five, Splitting::Six] {
        for cells in [[1, 1, 1], [2, 1, 3], [3, 4, 5]] {
            let mut block = Block::new(vec3(0.3, 0.2, 0.1), cells);
            block.splitting = splitting;
            let mesh = block.mesh().unwrap();
            let [nx, ny, nz] = cells;
            let per_cell = if splitting == Splitting::Five { 5 } else { 6 };
            assert_eq!(mesh.tets().len(), per_cell * nx * ny * nz);
            assert_eq!(mesh.vertices().len(), (nx + 1) * (ny + 1) * (nz + 1));
            // Faces that do not match would add to the boundary's two triangles per square.
            assert_eq!(boundary_face_count(&mesh), 4 * (nx * ny + ny * nz + nz * nx));
            assert!((mesh.volume() - 0.006).abs() < 1e-16 * 100.0);
            assert!((0..mesh.tets().len()).all(|tet| tet_volume(mesh.corners(tet)) > 0.0));
        }
    }
}

#[test]
fn jitter_moves_interior_vertices_only_and_never_inverts() {
    for splitting in [Splitting::Five, Splitting::Six] {
        let regular = Block { splitting, ..Block::new(vec3(0.5, 0.2, 0.3), [6, 5, 4]) };
        let rest = regular.mesh().unwrap();
        for seed in 0..20 {
            let mesh = Block { jitter: 0.9, seed, ..regular.clone() }.mesh().unwrap();
            assert_eq!(mesh.tets(), rest.tets());
            assert!((0..mesh.tets().len()).all(|tet| tet_volume(mesh.corners(tet)) > 0.0));
            let moved = mesh.vertices().iter().zip(rest.vertices()).filter(|(a, b)| a != b);
            assert_eq!(moved.count(), 5 * 4 * 3);
            assert!((mesh.volume() - rest.volume()).abs() < 1e-14 * rest.volume());
        }
    }
}

#[test]
fn a_beam_has_cubic_cells_and_a_centred_cross_section() {
    let mesh = beam(0.2, 0.04, 0.02, 2, 0.0).unwrap();
    assert_eq!(mesh.tets().len(), 5 * 20 * 4 * 2);
    let (lower, upper) = mesh
        .vertices()
        .iter()
        .fold((Vec3::splat(1.0), Vec3::splat(-1.0)), |(low, high), &x| (low.min(x), high.max(x)));
    let error =
        (lower - vec3(0.0, -0.02, -0.01)).length() + (upper - vec3(0.2, 0.02, 0.01)).length();
    assert!(error < 1e-15, "{lower:?} {upper:?}");
}

#[test]
fn round_shapes_have_their_volumes() {
    let pi = std::f64::consts::PI;
    let ball = sphere(0.05, 0.008).unwrap();
    let pill = capsule(0.03, 0.1, 0.006).unwrap();
    // Inscribed triangles with edges up to 1.5 spacings h lose about h^2 / 4 r per radius r.
    let lost = |radius: f64, spacing: f64| (spacing / radius).powi(2);
    let exact = 4.0 / 3.0 * pi * 0.05_f64.powi(3);
    let ratio = ball.tets.volume() / exact;
    assert!((1.0 - lost(0.05, 0.008)..1.0).contains(&ratio), "{ratio}");
    let exact = 4.0 / 3.0 * pi * 0.03_f64.powi(3) + pi * 0.03_f64.powi(2) * 0.1;
    let ratio = pill.tets.volume() / exact;
    assert!((1.0 - lost(0.03, 0.006)..1.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_liver_is_life_size_in_one_piece_of_about_three_thousand_tetrahedra() {
    let organ = liver(LIVER_SPACING, 1.0).unwrap();
    let count = organ.tets.tets().len();
    assert!((2500..3500).contains(&count), "{count} tetrahedra");
    assert_eq!((organ.report.components, organ.report.non_manifold_edges), (1, 0));
    let litres = organ.tets.volume() * 1000.0;
    assert!((1.2..1.5).contains(&litres), "{litres} l");
    let (lower, upper) = organ
        .surface
        .vertices
        .iter()
        .fold((Vec3::splat(1.0), Vec3::splat(-1.0)), |(low, high), &x| (low.min(x), high.max(x)));
    let width = upper.x - lower.x;
    assert!((0.19..0.23).contains(&width), "{width} m");
    // The pictures' surface binds to the tetrahedra: nowhere farther out than half a spacing.
    let embedding = Embedding::new(&organ.tets, &organ.surface).unwrap();
    assert!(embedding.max_distance() < 0.5 * LIVER_SPACING, "{}", embedding.max_distance());
    println!(
        "{count} tets, {} vertices, {litres:.3} l, {width:.3} m wide, surface {} triangles, out by {:.4} m",
        organ.tets.vertices().len(),
        organ.surface.triangles.len(),
        embedding.max_distance()
    );
}

#[test]
fn the_liver_stays_two_millimetres_inside_its_bounds() {
    let organ = Liver::scaled(1.0);
    let (lower, upper) = organ.bounds();
    // A lattice around enlarged bounds finds what reaches past the stated ones.
    struct Enlarged(Liver);
    impl SignedDistance for Enlarged {
        fn distance(&self, point: Vec3<f64>) -> f64 {
            self.0.distance(point)
        }
        fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
            (Vec3::splat(-0.16), Vec3::splat(0.16))
        }
    }
    let skin = surface(&Enlarged(organ), 0.006).unwrap();
    for x in skin.vertices {
        let spare = (x - lower).min(upper - x);
        assert!(spare.x.min(spare.y).min(spare.z) > 0.002, "{x:?}");
    }
}

#[test]
fn the_right_lobe_is_larger_than_the_left() {
    let organ = liver(LIVER_SPACING, 1.0).unwrap();
    // The falciform notch lies at x = 24 mm; the patient's right is -x.
    let (mut right, mut left) = (0.0, 0.0);
    for tet in 0..organ.tets.tets().len() {
        let corners = organ.tets.corners(tet);
        let center = corners.into_iter().fold(Vec3::ZERO, |sum, x| sum + x) * 0.25;
        *if center.x < 0.024 { &mut right } else { &mut left } += tet_volume(corners);
    }
    let share = right / (right + left);
    assert!((0.7..0.92).contains(&share), "{share}");
}

#[test]
fn a_scaled_liver_is_the_same_liver() {
    let (life_size, double) = (liver(0.02, 1.0).unwrap(), liver(0.04, 2.0).unwrap());
    assert_eq!(life_size.tets.tets(), double.tets.tets());
    // Scaling by two is exact; the tables' millimetres are not.
    for (a, b) in life_size.tets.vertices().iter().zip(double.tets.vertices()) {
        assert!((*a * 2.0 - *b).length() < 1e-13);
    }
}

#[test]
fn impossible_arguments_say_why() {
    let message = |result: Result<TetMesh, ShapeError>| result.unwrap_err().to_string();
    let unit = vec3(1.0, 1.0, 1.0);
    assert!(message(block(unit, [3, 0, 1])).contains("3 x 0 x 1 cells"));
    assert!(message(block(vec3(1.0, f64::NAN, 1.0), [1; 3])).contains("y size is NaN"));
    assert!(message(block(unit, [1000; 3])).contains("5.000e9 tetrahedra"));
    assert!(message(block(unit, [usize::MAX; 3])).contains("tetrahedra, more than"));
    assert!(message(beam(1.0, 0.1, 0.0, 2, 0.0)).contains("height is 0"));
    assert!(message(beam(1.0, 0.1, 0.1, 0, 0.0)).contains("empty"));
    assert!(message(beam(1e300, 1e-300, 1.0, 5, 0.0)).contains("tetrahedra, more than"));
    assert!(message(Block { jitter: 1.5, ..Block::new(unit, [2; 3]) }.mesh()).contains("jitter"));
    assert!(sphere(-1.0, 0.1).unwrap_err().to_string().contains("radius is -1"));
    assert!(capsule(0.1, f64::INFINITY, 0.1).is_err());
    assert!(liver(0.02, 0.0).unwrap_err().to_string().contains("scale is 0"));
    assert!(liver(1e-6, 1.0).unwrap_err().to_string().contains("use at least"));
    assert!(liver(0.5, 1.0).unwrap_err().to_string().contains("use at most"));
}

/// A cut leaves two sides that touch and are connected below its tip only: as many tetrahedra and the same volume, the
/// vertices of the cut twice, and no tetrahedron of one side with a vertex of the other.
#[test]
fn a_cut_beam_is_connected_below_the_cut() {
    let whole = beam(0.2, 0.04, 0.04, 4, 0.0).unwrap();
    let cut = beam(0.2, 0.04, 0.04, 4, 0.6).unwrap();
    // Two of four layers, rounded: two rows of five vertices above the tip.
    assert_eq!(cut.vertices().len(), whole.vertices().len() + 2 * 5);
    assert_eq!(cut.tets().len(), whole.tets().len());
    let on_cut = |x: &Vec3<f64>| (x.x - 0.1).abs() < 1e-12 && x.z > 1e-12;
    for tet in cut.tets() {
        let x = tet.map(|v| cut.vertices()[v as usize]);
        let is_left = x.iter().any(|x| x.x < 0.1 - 1e-12);
        for (v, x) in tet.iter().zip(&x).filter(|(_, x)| on_cut(x)) {
            let is_copy = *v as usize >= whole.vertices().len();
            assert_eq!(is_copy, !is_left, "vertex {v} at {x:?}");
        }
    }
    assert_eq!(connected_components(&cut).count, 1);
    // Always a layer is left, and the refused say what is allowed.
    assert!(beam(0.2, 0.04, 0.04, 4, 0.99).is_ok());
    for wrong in [-0.1, 1.0, f64::NAN] {
        let error = beam(0.2, 0.04, 0.04, 4, wrong).unwrap_err().to_string();
        assert!(error.contains("cut") && error.contains("0 to below 1"), "{error}");
    }
}
