//! Labels as shapes.

use std::collections::BTreeMap;

use viscera::mesh::distance::SignedDistance;
use viscera::mesh::tetrahedralize::{surface, tetrahedralize};
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera_volume::{Affine, LabelMap, Organ};

/// A map in which a shape's voxels have the label 1.
fn map_of(dims: [usize; 3], to_world: Affine, is_inside: impl Fn(Vec3<f64>) -> bool) -> LabelMap {
    let mut labels = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let at = to_world.to_world(vec3(x as f64, y as f64, z as f64));
                labels.push(u16::from(is_inside(at)));
            }
        }
    }
    LabelMap::new(dims, labels, to_world, BTreeMap::new()).expect("a map")
}

fn affine(columns: [Vec3<f64>; 3], translation: Vec3<f64>) -> Affine {
    let [a, b, c] = columns;
    Affine { matrix: Mat3::from_columns(a, b, c), translation }
}

fn millimetres(size: [f64; 3]) -> [Vec3<f64>; 3] {
    let [x, y, z] = size.map(|edge| 1e-3 * edge);
    [vec3(x, 0.0, 0.0), vec3(0.0, y, 0.0), vec3(0.0, 0.0, z)]
}

const CENTER: Vec3<f64> = vec3(0.03, -0.02, 0.1);
const RADIUS: f64 = 0.03;

fn ball(x: Vec3<f64>) -> bool {
    (x - CENTER).length() < RADIUS
}

/// Images of one ball: cubes, flat boxes, turned axes, a sheared frame, a mirrored one.
fn frames() -> Vec<([usize; 3], Affine)> {
    let start = CENTER - Vec3::splat(0.04);
    let (s, c) = (0.6f64, 0.8f64);
    let turned =
        [vec3(2e-3 * c, 2e-3 * s, 0.0), vec3(-2e-3 * s, 2e-3 * c, 0.0), vec3(0.0, 0.0, 2e-3)];
    let middle = |columns: [Vec3<f64>; 3], dims: [f64; 3]| {
        let half = columns[0] * dims[0] + columns[1] * dims[1] + columns[2] * dims[2];
        CENTER - half * 0.5
    };
    let sheared = [vec3(2e-3, 0.0, 0.0), vec3(5e-4, 2e-3, 0.0), vec3(0.0, 4e-4, 2e-3)];
    let mirrored = [vec3(-2e-3, 0.0, 0.0), vec3(0.0, 2e-3, 0.0), vec3(0.0, 0.0, 2e-3)];
    vec![
        ([41; 3], affine(millimetres([2.0; 3]), start)),
        ([115, 115, 17], affine(millimetres([0.7, 0.7, 5.0]), start)),
        ([50, 50, 41], affine(turned, middle(turned, [49.0, 49.0, 40.0]))),
        ([60, 50, 45], affine(sheared, middle(sheared, [59.0, 49.0, 44.0]))),
        ([41; 3], affine(mirrored, middle(mirrored, [40.0; 3]))),
    ]
}

#[test]
fn a_ball_has_its_voxels_volume_and_no_steps() {
    for (dims, to_world) in frames() {
        let map = map_of(dims, to_world, ball);
        let (organ, report) = Organ::new(&map, &[1]).expect("a ball");
        assert_eq!((report.pieces, report.crumbs, report.caps), (1, [0, 0], 0));
        let skin = surface(&organ, 2.5e-3).expect("a surface");
        let ratio = skin.enclosed_volume() / report.volume;
        // The lattice's triangles lie below a sphere by 0.2 %.
        assert!((ratio - 1.0).abs() < 0.01, "{dims:?}: {ratio}");
        // Half a voxel of the coarsest axis.
        let most = 0.5 * organ.voxel_size().into_iter().fold(0.0, f64::max);
        for x in &skin.vertices {
            let off = (*x - CENTER).length() - RADIUS;
            assert!(off.abs() < most, "{dims:?}: {off}");
        }
    }
}

#[test]
fn what_the_image_cuts_ends_in_a_flat_cap() {
    let start = vec3(CENTER.x, CENTER.y - 0.04, CENTER.z - 0.04);
    // The first voxels' middles are at the ball's centre: half of it, and half a voxel.
    let map = map_of([21, 41, 41], affine(millimetres([2.0; 3]), start), ball);
    let (organ, report) = Organ::new(&map, &[1]).expect("half a ball");
    assert_eq!(report.caps, 1);
    let (mesh, _) = tetrahedralize(&organ, 2.5e-3).expect("tetrahedra");
    let lowest = mesh.vertices().iter().fold(f64::INFINITY, |low, x| low.min(x.x));
    assert!((lowest - (CENTER.x - 1e-3)).abs() < 1e-12, "{lowest}");
    let on_cap = mesh.vertices().iter().filter(|x| (x.x - lowest).abs() < 1e-9).count();
    assert!(on_cap > 100, "{on_cap}");
    assert!((mesh.volume() / report.volume - 1.0).abs() < 0.01);
}

#[test]
fn thin_parts_keep_their_volume_and_crumbs_are_told() {
    // A sheet of one voxel, and a crumb far from it.
    let to_world = affine(millimetres([2.0; 3]), Vec3::ZERO);
    let map = map_of([40, 40, 20], to_world, |x| {
        let is_sheet =
            (x.z - 0.02).abs() < 1e-6 && x.x > 0.009 && x.x < 0.069 && x.y > 0.009 && x.y < 0.069;
        is_sheet || (x - vec3(0.004, 0.004, 0.004)).length() < 1e-6
    });
    let (organ, report) = Organ::new(&map, &[1]).expect("a sheet");
    assert_eq!((report.pieces, report.crumbs), (1, [1, 1]));
    let skin = surface(&organ, 1e-3).expect("a surface");
    let ratio = skin.enclosed_volume() / report.volume;
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    assert!(organ.distance(vec3(0.004, 0.004, 0.004)) > 0.0);
    let error = Organ::new(&map, &[2, 7]).expect_err("no voxel").to_string();
    assert_eq!(error, "no voxel has the label 2, 7; the labels there are: 1");
}
