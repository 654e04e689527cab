//! The front door: which format a file has, by its content.

use std::collections::BTreeMap;

use viscera::scalar::vec3;

use crate::affine::Affine;
use crate::collect::Collected;
use crate::error::{Fault, VolumeError, VolumeProblem, unsupported};
use crate::label_map::LabelMap;
use crate::nifti;
use crate::nrrd;
use crate::report::{NamesFrom, Note, Orientation, VolumeFormat, VolumeReport, WorldSpace};
use crate::source::{GZIP_START, Part, Source};

/// How much is read at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The most voxels of an image, of all its layers together.
    pub voxels: u64,
}

impl Default for Limits {
    /// 2^30 voxels, 2 GiB of labels: ten times the largest scans of the whole body.
    fn default() -> Self {
        Self { voxels: 1 << 30 }
    }
}

/// Reads a label map from the bytes of a NIfTI file (`.nii`, `.nii.gz`, version 1 or 2) or an NRRD
/// file (`.nrrd`, `.seg.nrrd`).
///
/// The content tells the format. `name` is the file's name, for errors. Sizes in the header are
/// checked against `limits` before anything is allocated, and memory grows only with the bytes that
/// are really there: at most 4 bytes for each voxel, and some megabytes beside.
///
/// # Errors
/// Each names the file, what was expected there, and what to do: a format that is not read, a file
/// that was cut short or damaged, sizes of 0 or above the limit, positions without a finite inverse,
/// an image without labels, and a scan in place of a label map: values that are negative, not whole,
/// above 65535, or of more than 1024 kinds.
pub fn read(
    name: &str,
    bytes: &[u8],
    limits: Limits,
) -> Result<(LabelMap, VolumeReport), VolumeError> {
    front_door(name, bytes, limits)
        .and_then(finish)
        .map_err(|Fault { line, problem }| VolumeError { file: name.to_owned(), line, problem })
}

/// The result of a format's reader.
pub(crate) struct Parsed {
    pub format: VolumeFormat,
    pub gzip: bool,
    pub dims: [usize; 3],
    pub collected: Collected,
    pub place: Place,
    pub names: BTreeMap<u16, String>,
    pub names_from: NamesFrom,
    pub notes: Vec<Note>,
}

/// Where voxels are.
pub(crate) struct Place {
    pub to_world: Affine,
    pub orientation: Orientation,
    pub space: WorldSpace,
}

const UNPACK: &str = "unpack it and give the NIfTI or NRRD file in it";
const SLICER: &str = "open it in 3D Slicer and save the segmentation as .nii.gz or .seg.nrrd";
/// Bytes that tell the format.
const START: usize = 12;

fn front_door(name: &str, bytes: &[u8], limits: Limits) -> Result<Parsed, Fault> {
    if bytes.is_empty() {
        return Err(VolumeProblem::Empty.into());
    }
    if bytes.starts_with(GZIP_START) {
        let mut source = Source::gzip(bytes);
        let mut part = Part::new("the header", START as u64);
        let mut start = [0; START];
        source.take(&mut part, &mut start)?;
        if start.starts_with(b"NRRD") {
            let advice = "unpack it first; NRRD compresses its voxels by itself (encoding: gzip)";
            return Err(unsupported("an NRRD file inside gzip", advice).into());
        }
        let version = nifti::find_version(&start).ok_or_else(|| unknown(name, &start))?;
        return nifti::read(version, &start, source, limits);
    }
    if bytes.starts_with(b"NRRD0") {
        return nrrd::read(bytes, limits);
    }
    match nifti::find_version(bytes) {
        Some(version) => nifti::read(version, &[], Source::plain(bytes), limits),
        None => Err(unknown(name, bytes).into()),
    }
}

/// Says what a file is that is not read, as far as that can be told.
fn unknown(name: &str, bytes: &[u8]) -> VolumeProblem {
    let extension = name.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
    if bytes.starts_with(b"PK\x03\x04") {
        return unsupported("a ZIP archive", UNPACK);
    }
    if bytes.starts_with(b"BZh") || bytes.starts_with(b"\xFD7zXZ") {
        return unsupported("a file compressed by bzip2 or xz", UNPACK);
    }
    if bytes.starts_with(b"\x1f\x8b") {
        return unsupported("a gzip file that is not compressed by deflate", UNPACK);
    }
    if bytes.get(128..132) == Some(b"DICM") {
        return unsupported("a DICOM file", SLICER);
    }
    if bytes.starts_with(b"ObjectType") {
        return unsupported("a MetaImage file (.mha, .mhd)", SLICER);
    }
    match extension.as_deref() {
        Some("img") => unsupported("the data half of a pair (.hdr, .img)", nifti::PAIR_ADVICE),
        Some("mgz" | "mgh") => unsupported("a FreeSurfer file (.mgz)", SLICER),
        _ => VolumeProblem::UnknownFormat,
    }
}

/// Checks that all formats share.
fn finish(parsed: Parsed) -> Result<(LabelMap, VolumeReport), Fault> {
    let Parsed { format, gzip, dims, collected, place, names, names_from, mut notes } = parsed;
    let Place { to_world, orientation, space } = place;
    notes.extend(odd_size(dims, &to_world));
    let left_handed = to_world.is_left_handed();
    let map = LabelMap::new(dims, collected.labels, to_world, names)?;
    let report = VolumeReport { format, gzip, orientation, space, left_handed, names_from, notes };
    Ok((map, report))
}

/// A note where the image has a size that no patient has.
fn odd_size(dims: [usize; 3], to_world: &Affine) -> Option<Note> {
    // From a biopsy under a microscope to a scan of the whole body.
    const USUAL: std::ops::Range<f64> = 1e-3..5.0;
    let size = to_world.voxel_size();
    let edges =
        vec3(dims[0] as f64, dims[1] as f64, dims[2] as f64).scale(vec3(size[0], size[1], size[2]));
    let longest_edge = edges.x.max(edges.y).max(edges.z);
    (!USUAL.contains(&longest_edge)).then_some(Note::OddSize { longest_edge })
}
