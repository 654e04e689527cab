//! Names of labels: tables in extensions of NIfTI, TotalSegmentator's list.

use std::collections::BTreeMap;

use crate::files::{Nifti, ORDERS, gzip, read_well};
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera_volume::total_segmentator::{NAMES, name, name_labels, name_likely_labels};
use viscera_volume::{Affine, LabelMap, NamesFrom, Note, WorldSpace, summarize};

/// An extension in the way of TotalSegmentator, filled up to a multiple of 16 bytes.
fn table(labels: &str) -> Vec<u8> {
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?> <CaretExtension>  <Date><![CDATA[2013]]></Date>\
        <VolumeInformation Index=\"0\">   <LabelTable>\n{labels}\n  </LabelTable>\
        <VolumeType><![CDATA[Label]]></VolumeType></VolumeInformation></CaretExtension>\n   "
    );
    let mut bytes = text.into_bytes();
    bytes.resize((bytes.len() + 8).next_multiple_of(16) - 8, 0);
    bytes
}

#[test]
fn extension_names_labels_and_others_are_passed_over() {
    let labels = "<Label Key=\"0\">???</Label><Label Key=\"5\" Red=\"0.0\" Alpha=\"1\">\
        <![CDATA[liver]]></Label>\n<Label Key=\"7\"> right &amp; left\tkidney </Label>\
        <Label Key=\"-1\">no</Label><Label Key=\"9\"></Label><Label Key=\"70000\">no</Label>";
    for second in [false, true] {
        for order in ORDERS {
            for code in [0, 30] {
                let extensions =
                    vec![(6, vec![b'c'; 40]), (code, table(labels)), (2, vec![0xFF; 24])];
                let file = Nifti { second, order, extensions, ..Nifti::default() }.file();
                for bytes in [file.clone(), gzip(&file)] {
                    let (map, report) = read_well(&bytes);
                    assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
                    assert_eq!(map.names().len(), 2, "{:?}", map.names());
                    assert_eq!(map.name(5), Some("liver"));
                    assert_eq!(map.name(7), Some("right & left kidney"));
                    assert_eq!(report.names_from, NamesFrom::Extension);
                    assert_eq!(report.notes, []);
                }
            }
        }
    }
}

#[test]
fn damaged_extension_is_passed_over_and_said() {
    let unclosed = b"<LabelTable><Label Key=\"5\">liver</Label>".to_vec();
    let cases = [(unclosed, "not well-formed XML"), (b"<LabelTable>\xFF".to_vec(), "not UTF-8")];
    for (content, wanted) in cases {
        let extensions = vec![(0, content)];
        let (map, report) = read_well(&Nifti { extensions, ..Nifti::default() }.file());
        assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
        assert!(map.names().is_empty());
        assert!(report.to_string().contains(wanted), "{report}");
    }
    let large = table(&("<Label Key=\"5\">liver</Label>".to_owned() + &" ".repeat(1 << 20)));
    let (map, report) =
        read_well(&Nifti { extensions: vec![(0, large)], ..Nifti::default() }.file());
    assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
    assert!(map.names().is_empty() && report.to_string().contains("larger than 1 MiB"), "{report}");
    // Sizes that leave their place.
    for size in [-5_i32, 3, 1000] {
        let extensions = vec![(0, table("<Label Key=\"5\">liver</Label>"))];
        let mut file = Nifti { extensions, ..Nifti::default() }.file();
        file[352..356].copy_from_slice(&size.to_le_bytes());
        let (map, report) = read_well(&file);
        assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>(), "{size}");
        assert!(matches!(report.notes[..], [Note::ExtensionDamaged { .. }]), "{size} {report}");
    }
}

#[test]
fn xml_that_is_deep_or_grows_is_no_danger() {
    let deep = format!("<LabelTable>{}", "<a>".repeat(300_000)).into_bytes();
    let mut growing = String::from("<!DOCTYPE x [<!ENTITY e0 \"1 1 1 1 1 1 1 1 1 1\">");
    for level in 1..12 {
        let uses = format!("&e{};", level - 1).repeat(10);
        growing.push_str(&format!("<!ENTITY e{level} \"{uses}\">"));
    }
    growing.push_str("]><LabelTable><Label Key=\"1\">&e11;</Label></LabelTable>");
    for content in [deep, growing.into_bytes()] {
        let extensions = vec![(0, content)];
        let (map, report) = read_well(&Nifti { extensions, ..Nifti::default() }.file());
        assert!(map.names().is_empty());
        assert!(matches!(report.notes[..], [Note::ExtensionDamaged { .. }]), "{report}");
    }
}

#[test]
fn names_of_total_segmentator_are_given_on_the_callers_word() {
    assert_eq!((name(1), name(5), name(117)), (Some("spleen"), Some("liver"), Some(NAMES[116])));
    assert_eq!((name(0), name(118), name(u16::MAX)), (None, None, None));
    let (mut map, mut report) = read_well(&Nifti::default().file());
    assert!(map.names().is_empty());
    name_labels(&mut map, &mut report).unwrap();
    assert_eq!(map.name(6), Some("stomach"));
    assert_eq!(report.names_from, NamesFrom::TotalSegmentator);

    let mut data = Nifti::default().data;
    data[3] = 118;
    let (mut map, mut report) = read_well(&Nifti { data, ..Nifti::default() }.file());
    let message = name_labels(&mut map, &mut report).unwrap_err().to_string();
    assert!(message.contains("label 118 in a label map of TotalSegmentator (1 to 117)"));
    assert!(map.names().is_empty() && report.names_from == NamesFrom::None);
}

/// A row of boxes along x, from the patient's right to the left: labels and millilitres.
fn boxes(labels: &[(u16, f64)]) -> LabelMap {
    // Voxels of 10 ml; 20 x 20 of them are a layer, and one layer apart.
    let edge = 1e-2 * 10f64.cbrt();
    let mut layers = vec![vec![0; 400]];
    for &(label, size) in labels {
        let count = (size / 10.0).round().max(1.0) as usize;
        // Apart from the image's border, where organs may be cut.
        let mut left = count;
        while left > 0 {
            let mut layer = vec![0; 400];
            for place in
                (0..400).filter(|n| (1..19).contains(&(n % 20)) && (1..19).contains(&(n / 20)))
            {
                if left > 0 {
                    layer[place] = label;
                    left -= 1;
                }
            }
            layers.push(layer);
        }
        layers.push(vec![0; 400]);
    }
    let (x, y, z) = (vec3(0.0, edge, 0.0), vec3(0.0, 0.0, edge), vec3(-edge, 0.0, 0.0));
    let to_world = Affine { matrix: Mat3::from_columns(x, y, z), translation: Vec3::ZERO };
    let dims = [20, 20, layers.len()];
    LabelMap::new(dims, layers.concat(), to_world, BTreeMap::new()).expect("a map")
}

#[test]
fn labels_are_total_segmentators_where_their_sizes_and_sides_are() {
    let named = |labels: &[(u16, f64)]| {
        let (_, mut report) = read_well(&Nifti::default().file());
        report.space = WorldSpace::RightAnteriorSuperior;
        let mut map = boxes(labels);
        let all = summarize(&map);
        let is_named = name_likely_labels(&mut map, &mut report, &all);
        assert_eq!(is_named, report.names_from == NamesFrom::TotalSegmentator);
        assert_eq!(is_named, map.name(1).is_some());
        let reason = report.notes.into_iter().find_map(|note| match note {
            Note::OtherNumbers { reason } => Some(reason),
            _ => None,
        });
        assert_eq!(is_named, reason.is_none());
        reason
    };
    // From right to left: liver, right kidney, gallbladder, stomach, left kidney, spleen.
    let abdomen = [(5, 1500.0), (2, 160.0), (4, 30.0), (6, 300.0), (3, 150.0), (1, 200.0)];
    assert_eq!(named(&abdomen), None);
    // One is sick.
    let mut enlarged = abdomen;
    enlarged[5].1 = 2500.0;
    assert_eq!(named(&enlarged), None);
    assert_eq!(named(&[(5, 1500.0), (1, 200.0)]), None);
    for (labels, reason) in [
        // The data set LiTS: a liver and its tumours.
        (&[(1, 1500.0), (2, 40.0)][..], "1 would be `spleen` of 1500.0 ml"),
        // KiTS: kidneys, a tumour, a cyst; sizes that could be.
        (&[(2, 60.0), (1, 320.0), (3, 70.0)], "too few organs"),
        // AMOS and BTCV begin as TotalSegmentator, and go on with esophagus, liver, stomach, aorta, vena cava.
        (
            &[
                (6, 1500.0),
                (2, 160.0),
                (4, 30.0),
                (3, 150.0),
                (1, 200.0),
                (5, 20.0),
                (7, 400.0),
                (8, 90.0),
                (9, 70.0),
            ],
            "5 would be `liver` of 20.0 ml",
        ),
        // Some of them.
        (&[(6, 1500.0), (2, 160.0), (4, 30.0), (3, 150.0), (1, 200.0)], "6 would be `stomach`"),
        // Mirrored.
        (&[(1, 200.0), (3, 150.0), (2, 160.0), (5, 1500.0)], "to the left"),
        (&[(5, 1500.0), (200, 200.0)], "end at 117"),
    ] {
        let found = named(labels).unwrap_or_else(|| panic!("{labels:?}"));
        assert!(found.contains(reason), "{labels:?}: {found}");
    }
}
