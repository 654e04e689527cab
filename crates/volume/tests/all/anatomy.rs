//! A real label map: TotalSegmentator's result for an abdomen, 3 mm voxels.

use crate::data::data_folder;
use viscera_volume::{
    Limits, NamesFrom, Note, Orientation, Side, VolumeFormat, read, summarize, total_segmentator,
};

#[test]
fn abdomen_has_its_organs_with_their_names_and_sizes() {
    let Some(folder) = data_folder() else { return };
    let bytes = std::fs::read(folder.join("abdomen_labels.nii.gz")).unwrap();
    let (map, report) = read("abdomen_labels.nii.gz", &bytes, Limits::default()).unwrap();
    assert_eq!(map.dims(), [122, 101, 30]);
    assert_eq!((report.format, report.gzip), (VolumeFormat::Nifti1, true));
    assert_eq!(report.orientation, Orientation::Sform);
    assert_eq!(report.names_from, NamesFrom::Extension);
    // The file's field of units is 0.
    assert_eq!(report.notes, [Note::UnitAssumed]);
    assert!(!report.left_handed);
    // The file names all labels of TotalSegmentator.
    assert_eq!(map.names().len(), total_segmentator::NAMES.len());
    for (&label, name) in map.names() {
        assert_eq!(total_segmentator::name(label), Some(name.as_str()));
    }

    let summaries = summarize(&map);
    // Counted by another program from the bytes behind the header.
    let counted = [(1, 9452), (2, 3947), (3, 3676), (4, 1333), (5, 38634), (52, 997), (117, 2100)];
    assert_eq!(summaries.len(), 41);
    for (label, voxels) in counted {
        let summary = summaries.iter().find(|summary| summary.label == label).unwrap();
        assert_eq!(summary.voxels, voxels, "{:?}", summary.name);
        assert_eq!(map.labels().iter().filter(|&&l| l == label).count() as u64, voxels);
    }
    let all: u64 = summaries.iter().map(|summary| summary.voxels).sum();
    assert_eq!(all, 122 * 101 * 30 - 259_435);

    let liver = summaries.iter().find(|s| s.name.as_deref() == Some("liver")).unwrap();
    // 38,634 voxels of 27 cubic millimetres: 1043 ml.
    let wanted = 38_634.0 * 0.027;
    assert!((liver.milliliters - wanted).abs() < 16.0 * wanted * f64::EPSILON);
    // The scan ends below the dome of the liver.
    let cut = liver.touches_border.iter().find(|face| face.side == Side::Superior).unwrap();
    assert!(cut.voxels > 1000, "{cut:?}");
    // The liver is on the right: x grows to the right, and most of it lies right of the spleen.
    let spleen = summaries.iter().find(|s| s.name.as_deref() == Some("spleen")).unwrap();
    assert!(liver.world_bounds[0].x > spleen.world_bounds[0].x);
    assert!(liver.world_bounds[1].x > spleen.world_bounds[1].x);
}
