//! Segmentations of 3D Slicer.

use crate::files::{BASIC, LPS, message, nrrd, read_well};
use viscera_volume::{NamesFrom, Note};

const UNITS: &str = "space units: \"mm\" \"mm\" \"mm\"";

fn file(sizes: &[&str], keys: &[&str], data: &[u8]) -> Vec<u8> {
    nrrd(&[sizes, &["space: left-posterior-superior", UNITS, "encoding: raw"], keys].concat(), data)
}

/// 2 x 1 x 2 voxels in layers.
fn layered(count: usize, keys: &[&str], data: &[u8]) -> Vec<u8> {
    let size = format!("sizes: {count} 2 1 2");
    let lines = [
        "type: uint8",
        "dimension: 4",
        &size,
        "kinds: list domain domain domain",
        "space directions: none (3,0,0) (0,3,0) (0,0,3)",
        "space origin: (0,0,0)",
    ];
    file(&lines, keys, data)
}

#[test]
fn segments_of_one_layer_name_their_labels() {
    let keys = [
        "Segment0_ID:=Segment_1",
        "Segment0_Name:=liver",
        "Segment0_LabelValue:=5",
        "Segment0_Layer:=0",
        "Segment10_Name:=left\\nkidney \\\\ upper",
        "Segment10_LabelValue:=7",
        "Segment2_ID:=only an id",
        "Segment2_LabelValue:=9",
        "Segment2_Tags:=TerminologyEntry:x~y^z|",
        "Segmentation_MasterRepresentation:=Binary labelmap",
    ];
    let lines = [&BASIC[..], &LPS[1..]].concat();
    let (map, report) = read_well(&file(&lines, &keys, &(0..12).collect::<Vec<u8>>()));
    assert_eq!(report.names_from, NamesFrom::Segments);
    assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
    let names: Vec<_> = map.names().iter().map(|(&label, name)| (label, name.as_str())).collect();
    assert_eq!(names, [(5, "liver"), (7, "left kidney \\ upper"), (9, "only an id")]);
    assert_eq!(report.notes, []);
}

#[test]
fn layers_are_merged_and_later_segments_win() {
    let keys = [
        "Segment0_Name:=liver",
        "Segment0_LabelValue:=1",
        "Segment0_Layer:=0",
        "Segment1_Name:=tumour",
        "Segment1_LabelValue:=1",
        "Segment1_Layer:=1",
        "Segment2_Name:=vessel",
        "Segment2_LabelValue:=2",
        "Segment2_Layer:=0",
    ];
    // Layer 0 and layer 1 of each voxel in turn.
    let data = [1, 0, 1, 1, 2, 1, 3, 0];
    let (map, report) = read_well(&layered(2, &keys, &data));
    assert_eq!(map.labels(), [1, 2, 3, 0]);
    assert_eq!(map.dims(), [2, 1, 2]);
    let names: Vec<_> = map.names().values().map(String::as_str).collect();
    assert_eq!(names, ["liver", "tumour", "vessel"]);
    assert_eq!(report.notes, [Note::LayersMerged { layers: 2, overlaps: 2, strays: 1 }]);
    assert!(report.to_string().contains("2 voxels lie in several segments"), "{report}");
    assert!(report.to_string().contains("1 values stand for no segment"), "{report}");
}

#[test]
fn files_from_before_layers_have_a_volume_for_each_segment() {
    let keys = ["Segment0_Name:=a", "Segment1_Name:=b", "Segment2_Name:=c"];
    let data = [1, 0, 0, 0, 1, 0, 1, 0, 1, 0, 0, 0];
    let (map, report) = read_well(&layered(3, &keys, &data));
    assert_eq!(map.labels(), [1, 2, 3, 0]);
    assert_eq!(map.name(3), Some("c"));
    assert_eq!(report.notes, [Note::LayersMerged { layers: 3, overlaps: 1, strays: 0 }]);
}

#[test]
fn layers_without_segments_are_several_volumes() {
    let message = message(&layered(2, &[], &[1; 8]));
    let wanted = "line 5: an image of 2 layers without segments cannot be read here; save one";
    assert!(message.contains(wanted), "{message}");
}

#[test]
fn keys_that_are_wrong_are_named_with_their_line() {
    let lines = [&BASIC[..], &LPS[1..]].concat();
    let cases = [
        ("Segment0_LabelValue:=x", "Segment0_LabelValue: expected a label from 1 to 65535"),
        ("Segment0_LabelValue:=0", "Segment0_LabelValue: expected a label from 1 to 65535"),
        ("Segment0_LabelValue:=70000", "Segment0_LabelValue: expected a label from 1 to 65535"),
        ("Segment0_Layer:=-1", "Segment0_Layer: expected the number of a layer"),
        (
            "Segmentation_SourceRepresentation:=Fractional labelmap",
            "a fractional segmentation cannot be read here; export a binary label map",
        ),
    ];
    for (key, wanted) in cases {
        let message = message(&file(&lines, &[key], &[1; 12]));
        assert!(message.starts_with("test, line 11:") && message.contains(wanted), "{message}");
    }
    let keys = ["Segment0_Layer:=2"];
    let message = message(&layered(2, &keys, &[1; 8]));
    assert!(message.contains("Segment0_Layer: expected one of the layers of the image"));
}
