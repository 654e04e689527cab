//! Where voxels are: the same affine transform, however a file says it.

use crate::files::{BASIC, LPS, Nifti, nrrd, read_well};
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera_volume::{Affine, Note, Orientation, Side, WorldSpace};

/// NIfTI-1 holds single precision; a sum of four such products, each below 0.1 m, is off by less.
const SINGLE: f64 = 4.0 * 0.1 * f32::EPSILON as f64;

fn assert_same(found: &Affine, wanted: &Affine, tolerance: f64) {
    for corner in 0..8 {
        let at = |axis: usize| if corner >> axis & 1 == 1 { 2.0 } else { 0.0 };
        let voxel = vec3(at(0), at(1), at(2));
        let difference = (found.to_world(voxel) - wanted.to_world(voxel)).length();
        assert!(difference <= tolerance, "{found:?}\n{wanted:?}\n{difference:e} m");
    }
}

/// Columns and origin in millimetres, by hand.
fn affine(columns: [[f64; 3]; 3], origin: [f64; 3]) -> Affine {
    let [a, b, c] = columns.map(|column| Vec3::from_f64(column) * 1e-3);
    Affine { matrix: Mat3::from_columns(a, b, c), translation: Vec3::from_f64(origin) * 1e-3 }
}

fn read_nifti(file: &Nifti) -> (Affine, viscera_volume::VolumeReport) {
    let (map, report) = read_well(&file.file());
    (*map.to_world(), report)
}

#[test]
fn qform_turns_as_worked_out_by_hand() {
    let half = 0.5_f64.sqrt();
    let spacing = [3.0, 2.0, 4.0];
    let offset = [-10.0, 20.0, 30.0];
    // Components b, c, d; qfac; where the axes of the image point, before spacing.
    let cases = [
        // No turn.
        ([0.0, 0.0, 0.0], 1.0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        ([0.0, 0.0, 0.0], -1.0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]),
        // A quarter turn about z takes x to y and y to -x.
        ([0.0, 0.0, half], 1.0, [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        // A quarter turn about x takes y to z and z to -y.
        ([half, 0.0, 0.0], 1.0, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
        // A quarter turn about y takes z to x and x to -z.
        ([0.0, half, 0.0], -1.0, [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
        // A half turn about z, as files from DICOM have it: a = 0.
        ([0.0, 0.0, 1.0], 1.0, [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]),
        // A half turn about (3, 4, 0) / 5: in single precision the squares add up to more than 1.
        ([0.6, 0.8, 0.0], 1.0, [[-0.28, 0.96, 0.0], [0.96, 0.28, 0.0], [0.0, 0.0, -1.0]]),
        // A third of a turn about (1, 1, 1) takes x to y, y to z and z to x.
        ([0.5, 0.5, 0.5], 1.0, [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    ];
    for second in [false, true] {
        for (quatern, qfac, mut columns) in cases {
            for (column, size) in columns.iter_mut().zip(spacing) {
                *column = column.map(|component| component * size);
            }
            let pixdim = [qfac, 3.0, 2.0, 4.0, 1.0, 1.0, 1.0, 1.0];
            let (found, report) = read_nifti(&Nifti {
                second,
                pixdim,
                quatern,
                qoffset: offset,
                qform_code: 1,
                sform_code: 0,
                ..Nifti::default()
            });
            assert_same(&found, &affine(columns, offset), SINGLE);
            assert_eq!(report.orientation, Orientation::Qform);
            assert_eq!(report.notes, []);
            let left_handed = affine(columns, offset).is_left_handed();
            assert_eq!(report.left_handed, left_handed, "{quatern:?}");
        }
    }
}

#[test]
fn sform_qform_and_nrrd_spaces_give_the_same_transform() {
    let wanted = affine([[3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 4.0]], [-10.0, 20.0, 30.0]);
    let (sform, report) = read_nifti(&Nifti::default());
    assert_eq!((report.orientation, report.left_handed), (Orientation::Sform, false));
    let qoffset = [-10.0, 20.0, 30.0];
    let (qform, _) =
        read_nifti(&Nifti { qform_code: 2, sform_code: 0, qoffset, ..Nifti::default() });
    let spaces = [
        (LPS, WorldSpace::LeftPosteriorSuperior),
        (
            ["space: LPS", "space directions: (-3,0,0) (0,-2,0) (0,0,4)", LPS[2]],
            WorldSpace::LeftPosteriorSuperior,
        ),
        (
            [
                "space: right-anterior-superior",
                "space directions: (3, 0, 0) (0, 2, 0) (0, 0, 4)",
                "space origin: (-10,20,30)",
            ],
            WorldSpace::RightAnteriorSuperior,
        ),
        (
            [
                "space: Left-Anterior-Superior",
                "space directions: (-3,0,0) (0,2,0) (0,0,4)",
                "space origin: (10,20,30)",
            ],
            WorldSpace::LeftAnteriorSuperior,
        ),
        (
            [
                "space: scanner-xyz",
                "space directions: (3,0,0) (0,2,0) (0,0,4)",
                "space origin: (-10,20,30)",
            ],
            WorldSpace::Unnamed,
        ),
    ];
    let mut found = vec![sform, qform];
    for (place, space) in spaces {
        let lines = [&BASIC[..], &place, &["encoding: raw"]].concat();
        let (map, report) = read_well(&nrrd(&lines, &(0..12).collect::<Vec<u8>>()));
        assert_eq!(report.space, space);
        assert_eq!(report.was_lps(), space == WorldSpace::LeftPosteriorSuperior);
        assert_eq!(report.orientation, Orientation::NrrdDirections);
        found.push(*map.to_world());
    }
    for affine in &found {
        assert_same(affine, &wanted, SINGLE);
    }
}

#[test]
fn sizes_of_voxels_alone_are_a_guess_that_is_said() {
    let wanted = affine([[3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 4.0]], [0.0; 3]);
    let (found, report) = read_nifti(&Nifti { sform_code: 0, ..Nifti::default() });
    assert_same(&found, &wanted, SINGLE);
    assert_eq!(report.orientation, Orientation::PixdimOnly);
    assert_eq!(report.space, WorldSpace::Unnamed);
    assert!(report.to_string().contains("left and right, front and back are a guess"), "{report}");

    let lines = [&BASIC[..], &["spacings: 3 2 4", "encoding: raw"]].concat();
    let (map, report) = read_well(&nrrd(&lines, &(0..12).collect::<Vec<u8>>()));
    assert_same(map.to_world(), &wanted, SINGLE);
    assert_eq!(report.orientation, Orientation::NrrdSpacings);
    assert_eq!(report.notes, [Note::UnitAssumed]);
}

#[test]
fn units_are_metres_millimetres_or_micrometres() {
    let size = |units| {
        let (found, report) = read_nifti(&Nifti { units, ..Nifti::default() });
        (found.voxel_size()[0], report.notes)
    };
    let near = |found: f64, wanted: f64| (found - wanted).abs() <= wanted * f64::EPSILON;
    let (meters, notes) = size(1);
    assert!(near(meters, 3.0), "{meters}");
    // 2 x 3 x 2 voxels of 3 x 2 x 4 m.
    assert_eq!(notes, [Note::OddSize { longest_edge: 8.0 }]);
    let dim = [3, 12, 1, 1, 1, 1, 1, 1];
    let (_, report) = read_nifti(&Nifti { units: 1, dim, ..Nifti::default() });
    assert_eq!(report.notes, [Note::OddSize { longest_edge: 36.0 }]);
    // Seconds in the bits of time change nothing.
    assert!(near(size(2 | 8).0, 3e-3));
    assert!(near(size(3).0, 3e-6));
    let (unknown, notes) = size(8);
    assert!(near(unknown, 3e-3));
    assert_eq!(notes, [Note::UnitAssumed]);

    let mut lines = [&BASIC[..], &LPS, &["encoding: raw"]].concat();
    let data: Vec<u8> = (0..12).collect();
    assert_eq!(read_well(&nrrd(&lines, &data)).1.notes, [Note::UnitAssumed]);
    lines.push("space units: \"cm\" \"cm\" \"cm\"");
    let (map, report) = read_well(&nrrd(&lines, &data));
    assert!(near(map.to_world().voxel_size()[0], 3e-2));
    assert_eq!(report.notes, []);
}

#[test]
fn sform_counts_where_the_qform_says_something_else() {
    let qform = |qoffset: [f64; 3]| Nifti { qform_code: 1, qoffset, ..Nifti::default() };
    let (found, report) = read_nifti(&qform([-10.0, 20.0, 35.0]));
    assert!((found.translation.z - 0.03).abs() < SINGLE);
    let [Note::FormsDiffer { distance }] = report.notes[..] else { panic!("{report:?}") };
    assert!((distance - 0.005).abs() < SINGLE, "{distance}");
    assert!(report.to_string().contains("differ by up to 5.00 mm; the sform is used"), "{report}");
    assert_eq!(read_nifti(&qform([-10.0, 20.0, 30.0])).1.notes, []);
}

#[test]
fn left_handed_image_is_said() {
    let srow = [[-3.0, 0.0, 0.0, 10.0], [0.0, 2.0, 0.0, 20.0], [0.0, 0.0, 4.0, 30.0]];
    let (found, report) = read_nifti(&Nifti { srow, ..Nifti::default() });
    assert!(report.left_handed && found.is_left_handed());
    assert!(report.to_string().contains("axes are left-handed"), "{report}");
    // 24 cubic millimetres either way.
    assert!((found.voxel_volume() - 24e-9).abs() < 24e-9 * 4.0 * f64::from(f32::EPSILON));
    assert_eq!(found.side_at_end(0), Side::Left);
}

#[test]
fn axes_end_at_the_nearest_side_of_the_patient() {
    let oblique = affine([[0.1, -2.0, 0.3], [0.2, 0.1, 3.0], [-1.5, 0.2, 0.1]], [0.0; 3]);
    let sides = [0, 1, 2].map(|axis| oblique.side_at_end(axis));
    assert_eq!(sides, [Side::Posterior, Side::Superior, Side::Left]);
    assert_eq!(Side::Posterior.opposite(), Side::Anterior);
}

#[test]
fn way_to_voxels_is_the_inverse_of_the_way_to_the_world() {
    let oblique = affine([[0.1, -2.0, 0.3], [0.2, 0.1, 3.0], [-1.5, 0.2, 0.1]], [5.0, -9.0, 80.0]);
    let voxel = vec3(17.0, -3.0, 101.5);
    let back = oblique.to_voxel(oblique.to_world(voxel));
    // Some twenty operations on numbers of this size, at voxels well-shaped within a factor of 2.
    assert!((back - voxel).length() < 100.0 * 101.5 * f64::EPSILON, "{back:?}");
}
