//! Damaged files: cut anywhere, changed anywhere. Nothing may panic, nothing may take long.

use std::time::{Duration, Instant};

use proptest::prelude::*;
use viscera_volume::{Limits, read, summarize};

use crate::data::data_folder;
use crate::files::{BASIC, LPS, Nifti, Order, gzip, nrrd};

/// Small files of all kinds.
fn files() -> Vec<Vec<u8>> {
    let table = b"<LabelTable><Label Key=\"5\">liver</Label></LabelTable>   ".to_vec();
    let extensions = vec![(4, vec![1; 24]), (0, table)];
    let mut files = Vec::new();
    for second in [false, true] {
        for order in [Order::Little, Order::Big] {
            let file = Nifti { second, order, extensions: extensions.clone(), ..Nifti::default() };
            files.push(file.file());
            files.push(gzip(&file.file()));
        }
    }
    let data: Vec<u8> = (0..12).collect();
    let keys = ["Segment0_Name:=liver", "Segment0_LabelValue:=5", "Segment0_Layer:=0"];
    files.push(nrrd(&[&BASIC[..], &LPS, &keys, &["encoding: raw"]].concat(), &data));
    files.push(nrrd(&[&BASIC[..], &LPS, &keys, &["encoding: gzip"]].concat(), &gzip(&data)));
    files.push(nrrd(
        &[&BASIC[..], &["spacings: 1 2 3", "encoding: text"]].concat(),
        b"1 2 3 4 5 6 7 8 9 1 2 3",
    ));
    let layered = [
        "type: unsigned short",
        "endian: big",
        "dimension: 4",
        "sizes: 2 2 1 2",
        "kinds: list domain domain domain",
        "space directions: none (3,0,0) (0,3,0) (0,0,3)",
        "encoding: raw",
        "byte skip: 1",
        "Segment1_Layer:=1",
    ];
    files.push(nrrd(
        &[&layered[..], &keys].concat(),
        &[0, 0, 5, 0, 1, 0, 5, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0],
    ));
    files
}

/// Reads and sums up; what comes out, if anything, has a label for each voxel.
fn read_any(bytes: &[u8]) -> bool {
    let start = Instant::now();
    let result = read("damaged", bytes, Limits::default());
    match &result {
        Ok((map, report)) => {
            assert_eq!(map.labels().len(), map.dims().iter().product::<usize>());
            assert!(!report.to_string().is_empty());
            assert!(!summarize(map).is_empty());
        }
        Err(error) => assert!(error.to_string().starts_with("damaged")),
    }
    assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
    result.is_ok()
}

#[test]
fn files_are_in_order_before_they_are_damaged() {
    for (position, bytes) in files().iter().enumerate() {
        assert!(read_any(bytes), "{position}");
    }
}

#[test]
fn file_cut_at_any_byte_is_an_error() {
    for bytes in files() {
        for end in 0..bytes.len() {
            assert!(!read_any(&bytes[..end]), "{end} of {}", bytes.len());
        }
    }
}

#[test]
fn real_file_cut_anywhere_is_an_error() {
    let Some(folder) = data_folder() else { return };
    let bytes = std::fs::read(folder.join("abdomen_labels.nii.gz")).unwrap();
    for end in (0..bytes.len()).step_by(997).chain([bytes.len() - 1]) {
        assert!(!read_any(&bytes[..end]), "{end}");
    }
}

/// Numbers that headers do not expect.
const NUMBERS: [[u8; 8]; 8] = [
    [0xFF; 8],
    [0; 8],
    [0x7F; 8],
    [0x80, 0, 0, 0, 0, 0, 0, 0x80],
    // Infinity and "not a number" in both orders.
    [0, 0, 0x80, 0x7F, 0, 0, 0xF0, 0x7F],
    [0x7F, 0xF0, 0, 0, 0x7F, 0x80, 0, 0],
    [0, 0, 0xC0, 0x7F, 0, 0, 0xF8, 0x7F],
    [1, 0, 0, 0, 0, 0, 0, 1],
];

/// Words that mean something to NRRD.
const WORDS: [&str; 12] = [
    "none",
    "nan",
    "1e999",
    "-1",
    "99999999999",
    "(",
    ")",
    "\n\n",
    ":=",
    ": ",
    "NRRD0004\n",
    "\\n",
];

#[derive(Clone, Debug)]
enum Edit {
    Change { at: prop::sample::Index, byte: u8 },
    Number { at: prop::sample::Index, number: usize, width: usize },
    Word { at: prop::sample::Index, word: usize },
    Remove { at: prop::sample::Index, count: usize },
    Repeat { at: prop::sample::Index, count: usize },
}

fn edit() -> impl Strategy<Value = Edit> {
    let at = any::<prop::sample::Index>;
    prop_oneof![
        (at(), any::<u8>()).prop_map(|(at, byte)| Edit::Change { at, byte }),
        (at(), 0..NUMBERS.len(), 1_usize..9).prop_map(|(at, number, width)| Edit::Number {
            at,
            number,
            width
        }),
        (at(), 0..WORDS.len()).prop_map(|(at, word)| Edit::Word { at, word }),
        (at(), 1_usize..40).prop_map(|(at, count)| Edit::Remove { at, count }),
        (at(), 1_usize..40).prop_map(|(at, count)| Edit::Repeat { at, count }),
    ]
}

fn apply(bytes: &mut Vec<u8>, edit: &Edit) {
    let length = bytes.len();
    if length == 0 {
        return;
    }
    match edit {
        Edit::Change { at, byte } => bytes[at.index(length)] = *byte,
        Edit::Number { at, number, width } => {
            let at = at.index(length);
            let end = length.min(at + width);
            bytes[at..end].copy_from_slice(&NUMBERS[*number][..end - at]);
        }
        Edit::Word { at, word } => {
            let at = at.index(length);
            bytes.splice(at..at, WORDS[*word].bytes());
        }
        Edit::Remove { at, count } => {
            let at = at.index(length);
            bytes.drain(at..length.min(at + count));
        }
        Edit::Repeat { at, count } => {
            let at = at.index(length);
            let again = bytes[at..length.min(at + count)].to_vec();
            bytes.splice(at..at, again);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn damaged_files_never_panic(
        which in any::<prop::sample::Index>(),
        edits in prop::collection::vec(edit(), 1..6),
    ) {
        let mut bytes = which.get(&files()).clone();
        for edit in &edits {
            apply(&mut bytes, edit);
        }
        read_any(&bytes);
        // What gzip protects by its checksum is damaged inside as well.
        read_any(&gzip(&bytes));
    }

    #[test]
    fn bytes_behind_a_good_start_never_panic(
        which in any::<prop::sample::Index>(),
        bytes in prop::collection::vec(any::<u8>(), 0..700),
    ) {
        let starts = [&b"NRRD0004\n"[..], b"\x5c\x01\0\0", b"\0\0\x02\x1c", b"\x1f\x8b\x08\0", b""];
        read_any(&[which.get(&starts), &bytes[..]].concat());
    }
}
