//! NIfTI: every type of number in both byte orders and both versions; gzip; scales; extensions.

use crate::files::{Nifti, ORDERS, Order, encoded, gzip, message, read_well};
use viscera_volume::{NamesFrom, Note, VolumeFormat};

#[test]
fn every_type_in_both_orders_and_versions_gives_the_same_labels() {
    let labels: Vec<u16> = (0..12).map(|i| (i * 11) % 128).collect();
    for second in [false, true] {
        for order in ORDERS {
            for (datatype, name, data) in encoded(&labels, order) {
                let file = Nifti { second, order, datatype, data, ..Nifti::default() }.file();
                for (is_gzip, bytes) in [(false, file.clone()), (true, gzip(&file))] {
                    let (map, report) = read_well(&bytes);
                    assert_eq!(map.labels(), labels, "{name} {order:?} {second} {is_gzip}");
                    assert_eq!(map.dims(), [2, 3, 2]);
                    assert_eq!(report.gzip, is_gzip);
                    let format = if second { VolumeFormat::Nifti2 } else { VolumeFormat::Nifti1 };
                    assert_eq!(report.format, format);
                    assert_eq!(report.notes, []);
                    // Single precision holds these numbers exactly; millimetres become metres.
                    let corner = map.to_world().translation.to_array();
                    for (found, wanted) in corner.into_iter().zip([-0.01, 0.02, 0.03]) {
                        assert!((found - wanted).abs() < 1e-17, "{found} {wanted}");
                    }
                }
            }
        }
    }
}

#[test]
fn labels_reach_from_1_to_65535_and_lie_where_the_file_has_them() {
    let labels: [u16; 12] = [0, 1, 255, 256, 32767, 32768, 65534, 65535, 0, 7, 8, 9];
    for order in ORDERS {
        for (datatype, name, data) in encoded(&labels, order) {
            // Small types cannot hold them.
            if ["uint8", "signed char", "int16_t"].contains(&name) {
                continue;
            }
            let (map, _) = read_well(&Nifti { order, datatype, data, ..Nifti::default() }.file());
            assert_eq!(map.labels(), labels, "{name}");
            assert_eq!(map.label_at([1, 0, 0]), Some(1));
            assert_eq!(map.label_at([0, 1, 0]), Some(255));
            assert_eq!(map.label_at([1, 2, 1]), Some(9));
            assert_eq!(map.label_at([2, 0, 0]), None);
        }
    }
}

#[test]
fn one_volume_of_an_image_with_more_axes_is_a_label_map() {
    for dim in [[4, 2, 3, 2, 1, 1, 1, 1], [5, 2, 3, 2, 1, 1, 0, 0], [4, 2, 3, 2, 0, 9, 9, 9]] {
        assert_eq!(read_well(&Nifti { dim, ..Nifti::default() }.file()).0.dims(), [2, 3, 2]);
    }
    let dim = [4, 2, 3, 2, 7, 1, 1, 1];
    let message = message(&Nifti { dim, ..Nifti::default() }.file());
    assert_eq!(
        message,
        "test: an image of 4 dimensions (7 volumes) cannot be read here; \
        save one of its volumes, for example with 3D Slicer or `fslroi`"
    );
}

#[test]
fn scale_that_keeps_labels_whole_is_applied_and_said() {
    let scaled = |scale| Nifti { scale, ..Nifti::default() }.file();
    let whole: Vec<u16> = (0..12).collect();
    for nothing in [[0.0, 5.0], [1.0, 0.0], [f64::NAN, 1.0], [f64::INFINITY, 1.0]] {
        let (map, report) = read_well(&scaled(nothing));
        assert_eq!((map.labels(), &report.notes[..]), (&whole[..], &[][..]));
    }
    let (map, report) = read_well(&scaled([2.0, 3.0]));
    let labels: Vec<u16> = (0..12).map(|i| 2 * i + 3).collect();
    assert_eq!(map.labels(), labels);
    assert_eq!(report.notes, [Note::Scaled { slope: 2.0, intercept: 3.0 }]);
    assert!(report.to_string().contains("multiplied by 2, then 3 was added"), "{report}");
    assert!(message(&scaled([0.5, 0.0])).contains("a scan, not a label map: values from 0 to 5.5"));
    assert!(message(&scaled([2.0, f64::NAN])).contains("scl_inter: expected a finite number"));
}

#[test]
fn gzip_of_several_streams_is_read_to_its_end() {
    let file = Nifti::default().file();
    let mut bytes = gzip(&file[..100]);
    bytes.extend(gzip(&[]));
    bytes.extend(gzip(&file[100..]));
    let (map, report) = read_well(&bytes);
    assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
    assert_eq!(report.notes, []);
}

#[test]
fn bytes_behind_the_image_are_left_and_said() {
    let mut file = Nifti::default().file();
    file.extend([9; 100_000]);
    for bytes in [file.clone(), gzip(&file)] {
        let (map, report) = read_well(&bytes);
        assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
        assert_eq!(report.notes, [Note::GoesOn]);
    }
}

#[test]
fn bytes_behind_a_gzip_stream_do_not_matter() {
    let mut bytes = gzip(&Nifti::default().file());
    bytes.extend([0; 512]);
    assert_eq!(read_well(&bytes).0.labels(), (0..12).collect::<Vec<u16>>());
}

#[test]
fn voxels_begin_where_the_header_says() {
    for second in [false, true] {
        let mut file = Nifti { second, vox_offset: Some(640.0), ..Nifti::default() };
        let header = if second { 544 } else { 352 };
        let mut data = vec![77; 640 - header];
        data.append(&mut file.data);
        file.data = data;
        assert_eq!(read_well(&file.file()).0.labels(), (0..12).collect::<Vec<u16>>());
    }
    let (map, report) = read_well(&Nifti { vox_offset: Some(0.0), ..Nifti::default() }.file());
    assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
    assert_eq!(report.notes, [Note::OffsetAssumed]);
    for offset in [100.0, -352.0, 352.5, 1e12, f64::NAN] {
        let message = message(&Nifti { vox_offset: Some(offset), ..Nifti::default() }.file());
        assert!(message.contains("vox_offset: expected a whole number of bytes"), "{message}");
    }
}

#[test]
fn report_says_what_was_found_in_plain_words() {
    let (_, report) = read_well(&gzip(&Nifti { order: Order::Big, ..Nifti::default() }.file()));
    assert_eq!(report.names_from, NamesFrom::None);
    assert_eq!(
        report.to_string(),
        "NIfTI-1, gzip: the sform tells where voxels are; positions are right-anterior-superior \
        (RAS); the image's axes are right-handed; labels have no names."
    );
}
