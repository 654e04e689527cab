//! What is refused, and what the message says of it.

use crate::files::Order::Little;
use crate::files::{BASIC, LPS, Nifti, encoded, gzip, message, nrrd};
use crate::memory::peak_of;
use viscera_volume::{Limits, VolumeProblem, read};

#[test]
fn files_of_other_formats_are_told_with_a_way_out() {
    let mut dicom = vec![0; 200];
    dicom[128..132].copy_from_slice(b"DICM");
    let cases = [
        (&b""[..], "a.nii", "a.nii: the file is empty; export the label map again"),
        (b"hello", "a.txt", "a.txt: not a label map known here; known are NIfTI (.nii, .nii.gz)"),
        (b"PK\x03\x04....", "a.zip", "a ZIP archive cannot be read here; unpack it"),
        (b"BZh9....", "a.bz2", "compressed by bzip2 or xz cannot be read here; unpack it"),
        (&dicom, "a.dcm", "a DICOM file cannot be read here; open it in 3D Slicer"),
        (b"ObjectType = Image\n", "a.mha", "a MetaImage file (.mha, .mhd) cannot be read here"),
        (&[1; 500], "scan.IMG", "the data half of a pair (.hdr, .img) cannot be read here; save"),
    ];
    for (bytes, name, wanted) in cases {
        let message = read(name, bytes, Limits::default()).unwrap_err().to_string();
        assert!(message.contains(wanted), "{message}");
    }
    let inside = gzip(&nrrd(&[], b""));
    assert!(message(&inside).contains("an NRRD file inside gzip cannot be read here; unpack it"));
    assert!(message(&gzip(b"some text, long enough")).contains("not a label map known here"));
}

#[test]
fn pairs_of_files_and_old_headers_are_refused() {
    let first = Nifti { magic: Some(b"ni1\0"), ..Nifti::default() };
    let second = Nifti { second: true, magic: Some(b"ni2\0\r\n\x1a\n"), ..Nifti::default() };
    for file in [first, second] {
        let message = message(&file.file());
        let wanted = "the header half of a pair (.hdr, .img) cannot be read here; save header and \
            voxels as one file (.nii or .nii.gz)";
        assert!(message.contains(wanted), "{message}");
    }
    let old = message(&Nifti { magic: Some(b"\0\0\0\0"), ..Nifti::default() }.file());
    assert!(old.contains("an Analyze 7.5 header (no NIfTI magic)"), "{old}");
    let text = Nifti { second: true, magic: Some(b"n+2\0\n\x1a\n\0"), ..Nifti::default() };
    let text = message(&text.file());
    assert!(text.contains("a transfer as text destroys"), "{text}");
}

#[test]
fn scan_is_told_from_a_label_map() {
    // Hounsfield units.
    let scan: Vec<i16> = vec![0, 40, -1024, 60, 3071, 0, 0, 0, 0, 0, 0, 0];
    let bytes = |order: &[i16]| order.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let file = Nifti { datatype: 4, data: bytes(&scan), ..Nifti::default() };
    assert_eq!(
        message(&file.file()),
        "test: this looks like a scan, not a label map: values from -1024 to 3071, -1024 at voxel \
        (0, 1, 0); segment it first, for example with TotalSegmentator or 3D Slicer"
    );
    let mut lines = [&BASIC[1..], &LPS, &["type: int16", "endian: little"]].concat();
    lines.push("encoding: gzip");
    let found = message(&nrrd(&lines, &gzip(&bytes(&scan))));
    assert!(found.contains("values from -1024 to 3071, -1024 at voxel (0, 1, 0)"), "{found}");

    let floats = |values: [f32; 3]| {
        let mut all = [0.0; 12];
        all[..3].copy_from_slice(&values);
        let data = all.iter().flat_map(|v| v.to_le_bytes()).collect();
        message(&Nifti { datatype: 16, data, ..Nifti::default() }.file())
    };
    let found = floats([1.0, 0.25, 2.0]);
    assert!(found.contains("values from 0 to 2, 0.25 at voxel (1, 0, 0)"), "{found}");
    let mut data = [0.0_f32; 12];
    data[6 + 2 + 1] = -0.5;
    let data = data.iter().flat_map(|v| v.to_le_bytes()).collect();
    let found = message(&Nifti { datatype: 16, data, ..Nifti::default() }.file());
    assert!(found.contains("values from -0.5 to 0, -0.5 at voxel (1, 1, 1)"), "{found}");
    let found = floats([1.0, 70000.0, 2.0]);
    assert!(found.contains("values from 0 to 70000, 70000 at voxel (1, 0, 0)"), "{found}");
    let found = floats([1.0, f32::NAN, 2.0]);
    assert!(found.contains("values from 0 to 2, NaN at voxel (1, 0, 0)"), "{found}");
    let found = floats([f32::INFINITY, f32::NEG_INFINITY, 2.0]);
    assert!(found.contains("values from -inf to inf, inf at voxel (0, 0, 0)"), "{found}");
}

#[test]
fn values_of_more_than_1024_kinds_are_a_scan() {
    let file = |kinds: u16| {
        let labels: Vec<u16> = (0..kinds).collect();
        let (datatype, _, data) = encoded(&labels, Little).swap_remove(2);
        Nifti { datatype, data, dim: [3, i64::from(kinds), 1, 1, 1, 1, 1, 1], ..Nifti::default() }
            .file()
    };
    assert!(read("test", &file(1024), Limits::default()).is_ok());
    let message = message(&file(1025));
    assert!(message.contains("values from 0 to 1024, 1025 different ones"), "{message}");
}

#[test]
fn image_without_labels_is_refused() {
    let message = message(&Nifti { data: vec![0; 12], ..Nifti::default() }.file());
    assert_eq!(
        message,
        "test: all 12 voxels are background (0), so there is no organ in it; \
        export the segmentation, not an empty one"
    );
}

#[test]
fn file_that_was_cut_says_how_much_is_missing() {
    for second in [false, true] {
        let file = Nifti { second, ..Nifti::default() }.file();
        let cut = |end: usize| message(&file[..end]);
        let header = if second { 540 } else { 348 };
        let wanted =
            format!("ends inside the header: {header} bytes are needed, 100 are there; it was cut");
        assert!(cut(100).contains(&wanted), "{}", cut(100));
        let found = cut(header + 2);
        assert!(found.contains("inside the extensions of the header: 4 bytes are needed, 2 are"));
        let found = cut(file.len() - 5);
        assert!(found.contains("inside the voxels: 12 bytes are needed, 7 are there"), "{found}");
    }
    let lines = [&BASIC[..], &LPS, &["encoding: raw"]].concat();
    let found = message(&nrrd(&lines, &[1; 7]));
    assert!(found.contains("inside the voxels: 12 bytes are needed, 7 are there"), "{found}");
}

#[test]
fn gzip_that_was_cut_or_damaged_is_told_apart() {
    // Values without a pattern, so that there is something to cut.
    let mut state = 1_u32;
    let data: Vec<u8> = (0..20_000)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        })
        .collect();
    let file = Nifti { dim: [3, 20, 20, 50, 1, 1, 1, 1], data, ..Nifti::default() };
    let whole = gzip(&file.file());
    let half = message(&whole[..whole.len() / 2]);
    assert!(
        half.contains("the gzip stream breaks off inside the voxels: 20000 bytes are"),
        "{half}"
    );
    for end in [1, 4, 8] {
        let tail = message(&whole[..whole.len() - end]);
        assert!(tail.contains("the gzip stream breaks off"), "{tail}");
    }
    let start = message(&whole[..15]);
    assert!(start.contains("the gzip stream breaks off inside the header"), "{start}");
    // One bit of the checksum at the end.
    let mut changed = whole.clone();
    let at = changed.len() - 6;
    changed[at] ^= 1;
    let damaged = message(&changed);
    assert!(damaged.contains("the gzip stream is damaged inside the voxels"), "{damaged}");
    // The same where a little more follows behind the image.
    let longer = [file.file(), vec![7; 5000]].concat();
    let mut changed = gzip(&longer);
    let at = changed.len() - 6;
    changed[at] ^= 1;
    let damaged = message(&changed);
    assert!(damaged.contains("the gzip stream is damaged inside the voxels"), "{damaged}");
    // A block of a type that does not exist.
    let mut changed = whole.clone();
    changed[10] |= 6;
    let damaged = message(&changed);
    assert!(damaged.contains("the gzip stream is damaged inside the header"), "{damaged}");
    // Whole, but for less than the header says.
    let short = gzip(&file.file()[..1000]);
    let found = message(&short);
    assert!(found.contains("inside the voxels: 20000 bytes are needed, 648 are there"), "{found}");
}

#[test]
fn header_that_claims_terabytes_allocates_nothing() {
    let huge =
        Nifti { second: true, dim: [3, 100_000, 100_000, 1000, 1, 1, 1, 1], ..Nifti::default() };
    let wrapping =
        Nifti { second: true, dim: [3, i64::MAX, i64::MAX, 4, 1, 1, 1, 1], ..Nifti::default() };
    // Below the limit, but not there.
    let lying = Nifti { dim: [3, 1000, 1000, 1000, 1, 1, 1, 1], ..Nifti::default() };
    for (file, wanted) in [
        (huge, "100000 x 100000 x 1000 voxels are announced; at most 1073741824 are read. Crop or"),
        (wrapping, "voxels are announced; at most 1073741824 are read"),
        (lying, "1000000000 bytes are needed, 12 are there"),
    ] {
        for bytes in [file.file(), gzip(&file.file())] {
            let (found, peak) = peak_of(|| message(&bytes));
            assert!(found.contains(wanted), "{found}");
            // The decoder, one chunk, the marks of labels: each a power of two below 128 KiB.
            assert!(peak < 1 << 19, "{peak} bytes");
        }
    }
    let lines = |sizes| ["type: uint8", "dimension: 3", sizes, LPS[0], LPS[1], "encoding: gzip"];
    let found = message(&nrrd(&lines("sizes: 9999999 9999999 9999999"), &gzip(&[1; 10])));
    assert!(found.contains("at most 1073741824 are read"), "{found}");
    let found = message(&nrrd(&lines("sizes: 99999999999999999999 1 1"), &gzip(&[1; 10])));
    assert!(found.contains("sizes: expected as many whole numbers"), "{found}");
}

#[test]
fn limit_is_the_callers() {
    let file = Nifti::default().file();
    assert!(read("a", &file, Limits { voxels: 12 }).is_ok());
    let error = read("a", &file, Limits { voxels: 11 }).unwrap_err();
    let sizes = "2 x 3 x 2".to_owned();
    // No advice that a person cannot follow.
    assert!(error.to_string().ends_with("for example in 3D Slicer"), "{error}");
    assert_eq!(error.problem, VolumeProblem::TooLarge { sizes, limit: 11 });
}

#[test]
fn gzip_bomb_is_inflated_no_further_than_needed() {
    // 64 MiB of zeros behind a small image: 64 KiB of them are looked at.
    let mut file = Nifti::default().file();
    file.resize(file.len() + (1 << 26), 0);
    let bomb = gzip(&file);
    assert!(bomb.len() < 1 << 17);
    drop(file);
    let (read, peak) = peak_of(|| read("bomb", &bomb, Limits::default()));
    assert_eq!(read.unwrap().0.labels().len(), 12);
    assert!(peak < 1 << 19, "{peak} bytes");
}

#[test]
fn memory_grows_with_voxels_that_are_there() {
    // 1 MiB of voxels that are there, of 1 GB that are announced.
    let data = vec![1; 1 << 20];
    let file = Nifti { dim: [3, 1000, 1000, 1000, 1, 1, 1, 1], data, ..Nifti::default() };
    let bytes = gzip(&file.file());
    let (found, peak) = peak_of(|| message(&bytes));
    assert!(found.contains("1000000000 bytes are needed, 1048576 are there"), "{found}");
    // Labels of two bytes grow by doubling: twice of what is there, and once more while they move.
    assert!(peak < (4 + 2) << 20, "{peak} bytes");
}

#[test]
fn transform_without_inverse_is_refused() {
    let sform = |srow| message(&Nifti { srow, ..Nifti::default() }.file());
    let good = Nifti::default().srow;
    let mut zero = good;
    zero[1][1] = 0.0;
    let found = sform(zero);
    assert!(found.contains("voxels have size 0 along axis 1 (sform); set the spacing again"));
    let mut flat = good;
    flat[2] = [3.0, 2.0, 0.0, 30.0];
    flat[0][2] = 4.0;
    flat[1][2] = 0.0;
    flat[0][0] = 3.0;
    flat[1][1] = 0.0;
    let found = sform(flat);
    assert!(found.contains("the axes of the image lie in one plane (sform)"), "{found}");
    for value in [f64::NAN, f64::INFINITY] {
        for (row, column) in [(0, 0), (2, 3)] {
            let mut broken = good;
            broken[row][column] = value;
            let found = sform(broken);
            assert!(found.contains("the sform of the image is not finite; set its origin"));
        }
    }
    let mut pixdim = Nifti::default().pixdim;
    pixdim[3] = 0.0;
    for (qform_code, name) in [(1, "qform"), (0, "pixdim")] {
        let file = Nifti { pixdim, qform_code, sform_code: 0, ..Nifti::default() };
        let found = message(&file.file());
        assert!(found.contains(&format!("voxels have size 0 along axis 2 ({name})")), "{found}");
    }
    let quatern = [f64::NAN, 0.0, 0.0];
    let file = Nifti { quatern, qform_code: 1, sform_code: 0, ..Nifti::default() };
    assert!(message(&file.file()).contains("the qform of the image is not finite"));
}

#[test]
fn fields_of_nifti_that_are_wrong_are_named() {
    let dim = |dim| message(&Nifti { dim, ..Nifti::default() }.file());
    for zero in [[3, 2, 0, 2, 1, 1, 1, 1], [3, 2, -3, 2, 1, 1, 1, 1]] {
        let found = dim(zero);
        assert!(found.contains("voxels, so there is nothing in it"), "{found}");
    }
    assert!(dim([2, 2, 3, 1, 1, 1, 1, 1]).contains("an image of 2 dimensions cannot be read"));
    for count in [-1, 8, 300] {
        let found = dim([count, 2, 3, 2, 1, 1, 1, 1]);
        assert!(found.contains("dim[0]: expected a number of dimensions from 1 to 7"), "{found}");
    }
    let datatype = |datatype| message(&Nifti { datatype, ..Nifti::default() }.file());
    assert!(datatype(128).contains("colours (datatype 128) cannot be read here; save label maps"));
    assert!(datatype(32).contains("complex numbers (datatype 32)"));
    assert!(datatype(1).contains("voxels of one bit (datatype 1)"));
    assert!(datatype(1536).contains("numbers of 128 bits (datatype 1536)"));
    assert!(
        datatype(77).contains("datatype: expected a code of NIfTI, such as 2 or 512, found `77`")
    );
    let units = message(&Nifti { units: 5, ..Nifti::default() }.file());
    assert!(units.contains("xyzt_units: expected a unit of length"), "{units}");
}

#[test]
fn messages_have_no_control_characters_of_the_file() {
    let lines = [&BASIC[..2], &["sizes: \x1b[31m red", LPS[0], LPS[1], "encoding: raw"]].concat();
    let found = message(&nrrd(&lines, &[1; 12]));
    assert!(found.contains("found `?[31m red`"), "{found}");
    let long = format!("sizes: {}", "9 ".repeat(1000));
    let lines = [&BASIC[..2], &[&long, LPS[0], LPS[1], "encoding: raw"]].concat();
    assert!(message(&nrrd(&lines, &[1; 12])).len() < 300);
}
