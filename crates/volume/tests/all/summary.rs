//! Sizes, places, pieces and borders of labels.

use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera_volume::{Affine, LabelMap, Side, VolumeProblem, summarize};

/// Turned by a quarter about z, so that the image's x is the patient's y; voxels of 2 x 3 x 4 mm.
fn turned() -> Affine {
    let matrix =
        Mat3::from_columns(vec3(0.0, 2e-3, 0.0), vec3(-3e-3, 0.0, 0.0), vec3(0.0, 0.0, 4e-3));
    Affine { matrix, translation: vec3(0.1, 0.2, 0.3) }
}

fn map(dims: [usize; 3], labels: Vec<u16>) -> LabelMap {
    let names = BTreeMap::from([(3, "liver".to_owned()), (9, "unused".to_owned())]);
    LabelMap::new(dims, labels, turned(), names).unwrap()
}

#[test]
fn label_is_counted_measured_and_placed() {
    let mut labels = vec![0; 4 * 3 * 2];
    // Voxels (1, 1, 0), (2, 1, 0) and (2, 1, 1).
    for at in [1 + 4, 2 + 4, 2 + 4 + 12] {
        labels[at] = 3;
    }
    labels[0] = 1;
    let summaries = summarize(&map([4, 3, 2], labels));
    let [first, liver] = &summaries[..] else { panic!("{summaries:?}") };
    assert_eq!((first.label, first.name.as_deref(), first.voxels), (1, None, 1));
    assert_eq!((liver.label, liver.name.as_deref(), liver.voxels), (3, Some("liver"), 3));
    // 3 x 24 cubic millimetres.
    assert!((liver.milliliters - 0.072).abs() < 8.0 * 0.072 * f64::EPSILON);
    assert_eq!(liver.voxel_bounds, [[1, 1, 0], [2, 1, 1]]);
    assert_eq!(liver.components, 1);
    // x: 100 - 3 (1 +- 1/2); y: 200 + 2 (1 - 1/2) to 200 + 2 (2 + 1/2); z: 300 + 4 (-1/2 to 3/2).
    let wanted = [vec3(95.5, 201.0, 298.0), vec3(98.5, 205.0, 306.0)];
    for (found, wanted) in liver.world_bounds.iter().zip(wanted) {
        assert!((*found - wanted).length() < 8.0 * 400.0 * f64::EPSILON, "{found:?} {wanted:?}");
    }
    let faces: Vec<_> =
        liver.touches_border.iter().map(|f| (f.axis, f.at_end, f.side, f.voxels)).collect();
    assert_eq!(faces, [(2, false, Side::Inferior, 2), (2, true, Side::Superior, 1)]);
    let faces: Vec<_> =
        first.touches_border.iter().map(|f| (f.axis, f.at_end, f.side, f.voxels)).collect();
    assert_eq!(
        faces,
        [(0, false, Side::Posterior, 1), (1, false, Side::Right, 1), (2, false, Side::Inferior, 1)]
    );
}

#[test]
fn pieces_that_meet_at_edges_and_corners_only_are_apart() {
    // Across an edge, and across a corner.
    let edge = map([2, 2, 1], vec![1, 0, 0, 1]);
    assert_eq!(summarize(&edge)[0].components, 2);
    let corner = map([2, 2, 2], vec![1, 0, 0, 0, 0, 0, 0, 1]);
    assert_eq!(summarize(&corner)[0].components, 2);
    // A U whose arms meet in the last row.
    let joined = map([3, 2, 1], vec![1, 0, 1, 1, 1, 1]);
    assert_eq!(summarize(&joined)[0].components, 1);
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let new = |dims, count, affine| {
        LabelMap::new(dims, vec![1; count], affine, BTreeMap::new()).unwrap_err()
    };
    let none = new([2, 0, 2], 0, turned());
    assert_eq!(none, VolumeProblem::NoVoxels { sizes: "2 x 0 x 2".into() });
    let message = new([2, 2, 2], 7, turned()).to_string();
    assert_eq!(message, "2 x 2 x 2 voxels need one label each; 7 are given");
    let huge = new([usize::MAX, 2, 1], 7, turned());
    assert!(matches!(huge, VolumeProblem::LabelCount { .. }));
    let flat = Affine { matrix: Mat3::outer(Vec3::splat(1.0), Vec3::splat(1.0)), ..turned() };
    assert!(matches!(new([1, 1, 1], 1, flat), VolumeProblem::SingularAffine { .. }));
}

/// Pieces of a label by flooding, voxel by voxel.
fn flooded(dims: [usize; 3], labels: &[u16], label: u16) -> u64 {
    let mut open: BTreeSet<usize> = (0..labels.len()).filter(|&at| labels[at] == label).collect();
    let mut pieces = 0;
    while let Some(start) = open.pop_first() {
        pieces += 1;
        let mut front = vec![start];
        while let Some(at) = front.pop() {
            let (x, y, z) = (at % dims[0], at / dims[0] % dims[1], at / dims[0] / dims[1]);
            let mut reach = |inside: bool, other: usize| {
                if inside && open.remove(&other) {
                    front.push(other);
                }
            };
            let slice = dims[0] * dims[1];
            reach(x > 0, at.wrapping_sub(1));
            reach(x + 1 < dims[0], at + 1);
            reach(y > 0, at.wrapping_sub(dims[0]));
            reach(y + 1 < dims[1], at + dims[0]);
            reach(z > 0, at.wrapping_sub(slice));
            reach(z + 1 < dims[2], at + slice);
        }
    }
    pieces
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn pieces_bounds_and_borders_are_those_of_a_plain_count(
        dims in [1_usize..7, 1_usize..6, 1_usize..5],
        seeds in prop::collection::vec(0_u16..3, 7 * 6 * 5),
    ) {
        let labels = seeds[..dims.iter().product()].to_vec();
        let map = map(dims, labels.clone());
        let summaries = summarize(&map);
        let present: BTreeSet<u16> = labels.iter().copied().filter(|&label| label > 0).collect();
        prop_assert_eq!(summaries.iter().map(|s| s.label).collect::<BTreeSet<_>>(), present);
        for summary in &summaries {
            let mut counts = [[0; 2]; 3];
            let (mut low, mut high, mut voxels) = ([usize::MAX; 3], [0; 3], 0);
            for at in (0..labels.len()).filter(|&at| labels[at] == summary.label) {
                let voxel = [at % dims[0], at / dims[0] % dims[1], at / dims[0] / dims[1]];
                voxels += 1;
                for axis in 0..3 {
                    low[axis] = low[axis].min(voxel[axis]);
                    high[axis] = high[axis].max(voxel[axis]);
                    counts[axis][0] += u64::from(voxel[axis] == 0);
                    counts[axis][1] += u64::from(voxel[axis] + 1 == dims[axis]);
                }
            }
            prop_assert_eq!(summary.voxels, voxels);
            prop_assert_eq!(summary.voxel_bounds, [low, high]);
            prop_assert_eq!(summary.components, flooded(dims, &labels, summary.label));
            let mut found = [[0; 2]; 3];
            for face in &summary.touches_border {
                found[face.axis][usize::from(face.at_end)] = face.voxels;
            }
            prop_assert_eq!(found, counts);
        }
    }
}
