//! Errors of reading label maps.

use std::fmt;

/// Why a file is no label map that can be read: which file, where in it, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}{}: {problem}", LineSuffix(*line))]
pub struct VolumeError {
    /// The name under which the bytes were given.
    pub file: String,
    /// The line of a text header, counting from 1, where the problem has one.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: VolumeProblem,
}

struct LineSuffix(Option<usize>);

impl fmt::Display for LineSuffix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(line) => write!(f, ", line {line}"),
            None => Ok(()),
        }
    }
}

/// The fault of a file, or of the parts of a label map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeProblem {
    /// No bytes.
    #[error("the file is empty; export the label map again")]
    Empty,
    /// The content identifies no format.
    #[error(
        "not a label map known here; known are NIfTI (.nii, .nii.gz) and NRRD (.nrrd, .seg.nrrd), \
        which 3D Slicer saves"
    )]
    UnknownFormat,
    /// A known format, or a variant of one, that is not read.
    #[error("{found} cannot be read here; {advice}")]
    Unsupported {
        /// What the file is.
        found: String,
        /// How to get a file that can be read.
        advice: &'static str,
    },
    /// The bytes stop before the data does.
    #[error(
        "the file ends inside {reading}: {needed} bytes are needed, {found} are there; \
        it was cut short, copy or export it again"
    )]
    Truncated {
        /// What was being read.
        reading: &'static str,
        /// Bytes that this part needs.
        needed: u64,
        /// Bytes of this part that are there.
        found: u64,
    },
    /// The compressed bytes stop before their end.
    #[error(
        "the gzip stream breaks off inside {reading}: {needed} bytes are needed, {found} could be \
        inflated; the file was cut short, copy or export it again"
    )]
    GzipCut {
        /// What was being read.
        reading: &'static str,
        /// Bytes that this part needs once inflated.
        needed: u64,
        /// Bytes of this part that could be inflated.
        found: u64,
    },
    /// The compressed bytes are no gzip stream, or not the one that was written.
    #[error(
        "the gzip stream is damaged inside {reading} ({reason}); copy or export the file again"
    )]
    GzipCorrupt {
        /// What was being read.
        reading: &'static str,
        /// What the decoder says.
        reason: String,
    },
    /// A field of the header is not what it must be.
    #[error("{field}: expected {expected}, found `{found}`; export the label map again")]
    Field {
        /// The field, as the format calls it.
        field: String,
        /// What belongs there.
        expected: &'static str,
        /// What is there, shortened.
        found: String,
    },
    /// A field that is needed is not there.
    #[error("the header has no `{field}`; {advice}")]
    MissingField {
        /// The field, as the format calls it.
        field: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// A dimension is zero or negative.
    #[error("the image has {sizes} voxels, so there is nothing in it; export the label map again")]
    NoVoxels {
        /// The sizes, as in "10 x 0 x 5".
        sizes: String,
    },
    /// More voxels than the caller allows.
    #[error(
        "{sizes} voxels are announced; at most {limit} are read. Crop or resample the label map, \
        for example in 3D Slicer"
    )]
    TooLarge {
        /// The sizes, as in "10 x 10 x 5".
        sizes: String,
        /// The most values that are read.
        limit: u64,
    },
    /// The system gives no memory for the labels.
    #[error("no memory for {voxels} voxels; crop or resample the label map")]
    Memory {
        /// The number of voxels.
        voxels: usize,
    },
    /// A number of the affine transform is infinite or not a number.
    #[error(
        "the {source} of the image is not finite; set its origin and spacing again, \
        for example in 3D Slicer, and save it", source = .orientation
    )]
    NonFiniteAffine {
        /// Where the transform comes from.
        orientation: &'static str,
    },
    /// Voxels have no extent along an axis.
    #[error(
        "voxels have size 0 along axis {axis} ({orientation}); set the spacing again, for example \
        in 3D Slicer, and save it"
    )]
    ZeroVoxelSize {
        /// The axis of the image, counting from 0.
        axis: usize,
        /// Where the transform comes from.
        orientation: &'static str,
    },
    /// The axes of the image lie in one plane.
    #[error(
        "the axes of the image lie in one plane ({orientation}), so voxels have no volume; set \
        its orientation again, for example in 3D Slicer, and save it"
    )]
    SingularAffine {
        /// Where the transform comes from.
        orientation: &'static str,
    },
    /// Values that labels do not have.
    #[error(
        "this looks like a scan, not a label map: values from {low} to {high}{note}; segment it \
        first, for example with TotalSegmentator or 3D Slicer", low = Plain(*.low),
        high = Plain(*.high)
    )]
    Scan {
        /// The lowest value.
        low: f64,
        /// The highest value.
        high: f64,
        /// What labels do not do, as in ", -1024 at voxel (0, 0, 0)".
        note: String,
    },
    /// No voxel has a label.
    #[error(
        "all {voxels} voxels are background (0), so there is no organ in it; \
        export the segmentation, not an empty one"
    )]
    AllBackground {
        /// The number of voxels.
        voxels: usize,
    },
    /// The number of labels is not that of the voxels.
    #[error("{sizes} voxels need one label each; {found} are given")]
    LabelCount {
        /// The sizes, as in "10 x 10 x 5".
        sizes: String,
        /// Labels given.
        found: usize,
    },
}

/// A problem and its line; becomes a [`VolumeError`] where the file's name is known.
#[derive(Debug)]
pub(crate) struct Fault {
    pub line: Option<usize>,
    pub problem: VolumeProblem,
}

impl Fault {
    pub fn at(line: usize, problem: VolumeProblem) -> Self {
        Self { line: Some(line), problem }
    }
}

impl From<VolumeProblem> for Fault {
    fn from(problem: VolumeProblem) -> Self {
        Self { line: None, problem }
    }
}

pub(crate) fn unsupported(found: impl Into<String>, advice: &'static str) -> VolumeProblem {
    VolumeProblem::Unsupported { found: found.into(), advice }
}

pub(crate) fn bad_field(
    field: impl Into<String>,
    expected: &'static str,
    found: impl fmt::Display,
) -> VolumeProblem {
    VolumeProblem::Field { field: field.into(), expected, found: shorten(&found.to_string()) }
}

/// A number as people write it; those that are very large or small with an exponent.
pub(crate) struct Plain(pub f64);

impl fmt::Display for Plain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if self.0 == 0.0 {
            f.write_str("0")
        } else if !(1e-3..1e9).contains(&size) {
            write!(f, "{:.3e}", self.0)
        } else {
            let text = format!("{:.4}", self.0);
            f.write_str(text.trim_end_matches('0').trim_end_matches('.'))
        }
    }
}

/// Sizes as in "10 x 10 x 5".
pub(crate) fn sizes_text<N: fmt::Display>(sizes: &[N]) -> String {
    sizes.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
}

/// A text for a message: short, in one line.
pub(crate) fn shorten(text: &str) -> String {
    const SHOWN: usize = 60;
    let mut short: String = text.chars().take(SHOWN).collect();
    if text.chars().nth(SHOWN).is_some() {
        short.push_str("...");
    }
    // Control characters could rewrite the terminal that shows the message.
    short.replace(char::is_control, "?")
}

/// The name of a structure on one line, or nothing where no letter is left.
pub(crate) fn clean_name(text: &str) -> Option<String> {
    /// Longer names fill a list without telling more.
    const LONGEST: usize = 200;
    let line = text.replace(char::is_control, " ");
    let name: String = line.trim().chars().take(LONGEST).collect();
    (!name.is_empty()).then_some(name)
}
