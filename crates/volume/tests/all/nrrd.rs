//! NRRD: types, encodings, byte orders, skipped bytes, axes that are no space.

use crate::files::{BASIC, LPS, ORDERS, Order, encoded, gzip, message, nrrd, read_well};
use viscera_volume::{Note, VolumeFormat};

fn all_lines<'a>(parts: &[&[&'a str]]) -> Vec<&'a str> {
    parts.concat()
}

const UNITS: &str = "space units: \"mm\" \"mm\" \"mm\"";

#[test]
fn every_type_order_and_encoding_gives_the_same_labels() {
    let labels: Vec<u16> = (0..12).map(|i| (i * 11) % 128).collect();
    for order in ORDERS {
        for (_, name, data) in encoded(&labels, order) {
            for encoding in ["raw", "gzip", "gz", "GZIP"] {
                let type_line = format!("type: {name}");
                let encoding_line = format!("encoding: {encoding}");
                let endian = if order == Order::Little { "endian: little" } else { "endian: big" };
                let basic = [&type_line, "dimension: 3", "sizes: 2 3 2", endian, &encoding_line];
                let lines = all_lines(&[&basic, &LPS, &[UNITS]]);
                let is_gzip = encoding != "raw";
                let data = if is_gzip { gzip(&data) } else { data.clone() };
                let (map, report) = read_well(&nrrd(&lines, &data));
                assert_eq!(map.labels(), labels, "{name} {order:?} {encoding}");
                assert_eq!((report.format, report.gzip), (VolumeFormat::Nrrd, is_gzip));
                assert_eq!(report.notes, []);
            }
        }
    }
}

#[test]
fn numbers_as_text_are_read() {
    for encoding in ["text", "txt", "ascii"] {
        let encoding_line = format!("encoding: {encoding}");
        let lines = all_lines(&[&BASIC, &LPS, &[&encoding_line, UNITS]]);
        let (map, report) = read_well(&nrrd(&lines, b"0 1 2\n3 4 5.0\r\n 6,7 8\t9 1e1 11\n"));
        assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
        assert_eq!(report.notes, []);
        let (_, report) = read_well(&nrrd(&lines, b"0 1 2 3 4 5 6 7 8 9 10 11 12"));
        assert_eq!(report.notes, [Note::GoesOn]);
        let few = message(&nrrd(&lines, b"0 1 2"));
        let wanted = "voxels: expected as many numbers as there are voxels, found `3 of 12`";
        assert!(few.contains(wanted), "{few}");
        let word = message(&nrrd(&lines, b"0 1 two"));
        assert!(word.contains("voxels: expected a number, found `two`"), "{word}");
        let fraction = message(&nrrd(&lines, b"0 1 2.5 0 0 0 0 0 0 0 0 0"));
        assert!(fraction.contains("values from 0 to 2.5, 2.5 at voxel (0, 1, 0)"), "{fraction}");
    }
}

#[test]
fn lines_may_end_as_on_windows_and_names_of_fields_are_free() {
    let text = "NRRD0005\r\n# a comment\r\nTYPE: unsigned char\r\nDimension: 3\r\nsizes:2 3 2\r\n\
        encoding: raw\r\nspaceorigin: (10,-20,30)\r\nspace: lps\r\nunknown field: 4\r\n\
        space directions: (-3,0,0) (0,-2,0) (0,0,4)\r\nsome: key:=is a field\r\nkey: 1:=2\r\n\
        kinds: domain domain domain\r\n\r\n";
    let mut bytes = text.as_bytes().to_vec();
    bytes.extend(0..12);
    let (map, _) = read_well(&bytes);
    assert_eq!(map.labels(), (0..12).collect::<Vec<u16>>());
    assert!((map.to_world().translation.x + 0.01).abs() < 1e-17);
}

#[test]
fn skipped_lines_and_bytes_are_passed_over() {
    let data: Vec<u8> = (0..12).collect();
    let file = |skips: &[&str], encoding, data: &[u8]| {
        nrrd(&all_lines(&[&BASIC, &LPS, skips, &[encoding]]), data)
    };
    let labels = |bytes: &[u8]| read_well(bytes).0.labels().to_vec();
    let wanted: Vec<u16> = (0..12).collect();
    let skips = ["line skip: 2", "byte skip: 3"];
    let raw = [b"one\ntwo\nxyz", &data[..]].concat();
    assert_eq!(labels(&file(&skips, "encoding: raw", &raw)), wanted);
    // Lines are skipped before, bytes after decompression.
    let packed = [b"one\ntwo\n", &gzip(&[b"xyz", &data[..]].concat())[..]].concat();
    assert_eq!(labels(&file(&skips, "encoding: gzip", &packed)), wanted);
    let last = [&[99; 1000], &data[..]].concat();
    assert_eq!(labels(&file(&["byteskip: -1"], "encoding: raw", &last)), wanted);

    for skip in ["byte skip: -2", "byte skip: 99999999999999999", "line skip: x", "line skip: 50"] {
        let message = message(&file(&[skip], "encoding: raw", &data));
        assert!(message.contains(&skip[..9]) && message.starts_with("test, line 9:"), "{message}");
    }
    let message = message(&file(&["byte skip: -1"], "encoding: gzip", &gzip(&data)));
    assert!(message.contains("byte skip"), "{message}");
}

#[test]
fn list_of_one_volume_is_read_wherever_it_stands() {
    let data: Vec<u8> = (0..12).collect();
    let cases = [
        [
            "sizes: 1 2 3 2",
            "space directions: none (-3,0,0) (0,-2,0) (0,0,4)",
            "kinds: list domain domain domain",
        ],
        ["sizes: 2 3 2 1", "space directions: (-3,0,0) (0,-2,0) (0,0,4) none", "content: x"],
        ["sizes: 1 2 3 2", "spacings: nan 3 2 4", "kinds: list space space space"],
        ["sizes: 2 3 2 1", "spacings: 3 2 4 1", "kinds: space space space vector"],
        ["sizes: 1 2 3 2", "spacings: 1 3 2 4", "content: x"],
    ];
    for case in cases {
        let basic = ["type: uchar", "dimension: 4", "encoding: raw", "space: LPS"];
        let (map, _) = read_well(&nrrd(&all_lines(&[&basic, &case]), &data));
        assert_eq!((map.dims(), map.labels()), ([2, 3, 2], &(0..12).collect::<Vec<u16>>()[..]));
        for (found, wanted) in map.to_world().voxel_size().into_iter().zip([3e-3, 2e-3, 4e-3]) {
            assert!((found - wanted).abs() < 1e-17, "{case:?}");
        }
    }
}

#[test]
fn several_volumes_one_after_the_other_are_refused() {
    let lines = [
        "type: uchar",
        "dimension: 4",
        "sizes: 2 3 1 2",
        "encoding: raw",
        "space: LPS",
        "space directions: (-3,0,0) (0,-2,0) (0,0,4) none",
        "Segment0_Name:=liver",
    ];
    let message = message(&nrrd(&lines, &[1; 12]));
    let wanted =
        "line 5: an image of 4 dimensions (2 volumes) cannot be read here; label maps have";
    assert!(message.contains(wanted), "{message}");
}

#[test]
fn first_of_two_axes_of_one_voxel_is_the_list() {
    let lines =
        ["type: uchar", "dimension: 4", "sizes: 1 3 4 1", "encoding: raw", "spacings: 9 3 2 4"];
    let (map, _) = read_well(&nrrd(&lines, &(0..12).collect::<Vec<u8>>()));
    assert_eq!(map.dims(), [3, 4, 1]);
    assert!((map.to_world().voxel_size()[0] - 3e-3).abs() < 1e-17);
}

#[test]
fn lines_that_are_wrong_are_named_with_their_number() {
    let good = all_lines(&[&BASIC, &LPS, &["encoding: raw"]]);
    let data: Vec<u8> = (0..12).collect();
    // Which line, what stands there, what the message says.
    let cases = [
        (0, "type: block", "line 3: type: expected a type of numbers"),
        (1, "dimension: three", "line 4: dimension: expected the number of axes"),
        (1, "dimension: 2", "line 4: an image of 2 dimensions cannot be read here"),
        (2, "sizes: 2 3", "line 5: sizes: expected as many whole numbers as dimensions"),
        (2, "sizes: 2 -3 2", "line 5: sizes: expected as many whole numbers as dimensions"),
        (2, "sizes: 2 0 2", "the image has 2 x 0 x 2 voxels"),
        (3, "space: left-posterior-superior-time", "line 6: space: expected left-posterior"),
        (
            4,
            "space directions: (3,0,0) (0,2,0)",
            "line 7: space directions: expected for each axis",
        ),
        (4, "space directions: (3,0) (0,2) (1,1)", "line 7: space directions: expected for each"),
        (
            4,
            "space directions: (3,0,0) (0,2,0) none",
            "line 4: an image of 3 dimensions that are not",
        ),
        (4, "space directions: (3,0,0) (0,0,0) (0,0,4)", "line 7: voxels have size 0 along axis 1"),
        (
            4,
            "space directions: (3,0,0) (6,0,0) (0,0,4)",
            "line 7: the axes of the image lie in one",
        ),
        (
            4,
            "space directions: (nan,0,0) (0,2,0) (0,0,4)",
            "line 7: the space directions of the image is not finite",
        ),
        (5, "space origin: 0 0 0", "line 8: space origin: expected a vector such as (0,0,0)"),
        (6, "encoding: zrl", "line 9: encoding: expected raw, gzip or text, found `zrl`"),
        (6, "encoding: bzip2", "line 9: encoding bzip2 cannot be read here; save it with encoding"),
        (6, "encoding: hex", "line 9: encoding hex cannot be read here"),
        (6, "no colon", "line 9: header: expected `field: value`, `key:=value`"),
        (6, "data file: voxels.raw", "line 9: a header with voxels in another file cannot be read"),
        (6, "datafile: LIST", "line 9: a header with voxels in another file cannot be read"),
        (6, "encoding: raw:=x", "line 9: encoding: expected raw, gzip or text, found `raw:=x`"),
        (6, "sizes: 1 1 1", "line 9: sizes: expected one line of this field"),
        (6, "content: x", "the header has no `encoding`"),
        (0, "content: x", "the header has no `type`"),
        (4, "content: x", "the header has no `space directions`; the size of voxels is unknown"),
    ];
    for (at, line, wanted) in cases {
        let mut lines = good.clone();
        lines[at] = line;
        let message = message(&nrrd(&lines, &data));
        assert!(message.contains(wanted), "{line}\n{message}");
    }
    let mut lines = good.clone();
    lines[0] = "type: short";
    let data = [0; 24];
    assert!(message(&nrrd(&lines, &data)).contains("the header has no `endian`; add the line"));
    lines.push("endian: middle");
    assert!(message(&nrrd(&lines, &data)).contains("line 10: endian: expected little or big"));
}

#[test]
fn versions_from_1_to_5_are_read_and_no_others() {
    let file = |magic: &str| {
        let lines = all_lines(&[&BASIC, &LPS, &["encoding: raw"]]);
        let mut bytes = nrrd(&lines, &(0..12).collect::<Vec<u8>>());
        bytes[..8].copy_from_slice(magic.as_bytes());
        bytes
    };
    for version in 1..=5 {
        read_well(&file(&format!("NRRD000{version}")));
    }
    for magic in ["NRRD0006", "NRRD0000", "NRRD0041"] {
        let wanted = "line 1: magic: expected NRRD0001 to NRRD0005";
        assert!(message(&file(magic)).contains(wanted), "{magic}");
    }
}

#[test]
fn file_without_origin_starts_at_zero_and_says_so() {
    let lines = all_lines(&[&BASIC, &LPS[..2], &["encoding: raw", UNITS]]);
    let (map, report) = read_well(&nrrd(&lines, &(0..12).collect::<Vec<u8>>()));
    assert_eq!(map.to_world().translation.length(), 0.0);
    assert_eq!(report.notes, [Note::NoOrigin]);
}

#[test]
fn header_that_never_ends_is_said() {
    let whole = nrrd(&all_lines(&[&BASIC, &LPS, &["encoding: raw"]]), b"");
    let message = message(&whole[..whole.len() - 1]);
    assert!(message.contains("no `empty line`; it stands between header and voxels"), "{message}");
}
