//! What a file was, and what was assumed about it.

use std::fmt;

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum VolumeFormat {
    /// NIfTI-1, one file.
    Nifti1,
    /// NIfTI-2, one file.
    Nifti2,
    /// NRRD with its data behind the header.
    Nrrd,
}

impl fmt::Display for VolumeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nifti1 => "NIfTI-1",
            Self::Nifti2 => "NIfTI-2",
            Self::Nrrd => "NRRD",
        })
    }
}

/// Which part of a header tells where voxels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Orientation {
    /// The rows of NIfTI's sform.
    Sform,
    /// The quaternion of NIfTI's qform.
    Qform,
    /// NIfTI's sizes of voxels alone: the file knows neither left from right nor an origin.
    PixdimOnly,
    /// NRRD's `space directions`.
    NrrdDirections,
    /// NRRD's `spacings` alone: the file knows neither left from right nor an origin.
    NrrdSpacings,
}

impl Orientation {
    /// The name of that part of the header.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Sform => "sform",
            Self::Qform => "qform",
            Self::PixdimOnly => "pixdim",
            Self::NrrdDirections => "space directions",
            Self::NrrdSpacings => "spacings",
        }
    }
}

impl fmt::Display for Orientation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Sform => "the sform tells where voxels are",
            Self::Qform => "the qform tells where voxels are",
            Self::PixdimOnly => {
                "the header has sizes of voxels only (pixdim), so that left and right, front and \
                back are a guess"
            }
            Self::NrrdDirections => "space directions tell where voxels are",
            Self::NrrdSpacings => {
                "the header has sizes of voxels only (spacings), so that left and right, front and \
                back are a guess"
            }
        })
    }
}

/// The axes in which a file counts positions, before they are turned into RAS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WorldSpace {
    /// x to the right, y to the front, z to the head; the frame of NIfTI and of label maps here.
    RightAnteriorSuperior,
    /// x to the left, y to the back, z to the head; the frame of DICOM, and of 3D Slicer's files.
    LeftPosteriorSuperior,
    /// x to the left, y to the front, z to the head.
    LeftAnteriorSuperior,
    /// Axes without a relation to the patient; they are taken as they are.
    Unnamed,
}

impl WorldSpace {
    /// Which axes of the world turn round on the way to RAS.
    pub(crate) fn flips(self) -> [bool; 3] {
        match self {
            Self::RightAnteriorSuperior | Self::Unnamed => [false; 3],
            Self::LeftPosteriorSuperior => [true, true, false],
            Self::LeftAnteriorSuperior => [true, false, false],
        }
    }
}

impl fmt::Display for WorldSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RightAnteriorSuperior => "positions are right-anterior-superior (RAS)",
            Self::LeftPosteriorSuperior => {
                "positions were left-posterior-superior (LPS) and are turned to RAS"
            }
            Self::LeftAnteriorSuperior => {
                "positions were left-anterior-superior (LAS) and are turned to RAS"
            }
            Self::Unnamed => "the file does not relate its axes to the patient; RAS is assumed",
        })
    }
}

/// Where the names of labels come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NamesFrom {
    /// The file has none.
    None,
    /// A table of labels in an extension of NIfTI, as TotalSegmentator and Connectome Workbench write.
    Extension,
    /// The segments of 3D Slicer's `.seg.nrrd`.
    Segments,
    /// TotalSegmentator's numbers, on the caller's word or by the organs' sizes, see [`crate::total_segmentator`].
    TotalSegmentator,
    /// Whoever reads the file gave them.
    Given,
}

impl fmt::Display for NamesFrom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "labels have no names",
            Self::Extension => "names are those in the file's extension",
            Self::Segments => "names are those of the file's segments",
            Self::TotalSegmentator => "names are TotalSegmentator's, by the numbers of labels",
            Self::Given => "names are as given",
        })
    }
}

/// Something about a file that its reader should know.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// The file names no unit of length.
    UnitAssumed,
    /// The image is smaller or larger than what scanners take; the unit may be wrong.
    OddSize {
        /// The longest edge of the image `[m]`.
        longest_edge: f64,
    },
    /// NIfTI's sform and qform put voxels at different places; the sform counts.
    FormsDiffer {
        /// The largest distance between the two, over the corners of the image `[m]`.
        distance: f64,
    },
    /// Values are stored by a slope and an intercept, which were applied.
    Scaled {
        /// Factor of a stored value.
        slope: f64,
        /// Added after that.
        intercept: f64,
    },
    /// The header says that data begin at byte 0, where the header is; they were read behind it.
    OffsetAssumed,
    /// NRRD gives no origin; voxel (0, 0, 0) is put at the origin of the world.
    NoOrigin,
    /// An extension of NIfTI could not be read and was passed over.
    ExtensionDamaged {
        /// What is wrong with it.
        reason: String,
    },
    /// The file goes on behind the image; the rest was not read, nor a checksum at its end.
    GoesOn,
    /// Labels have no names, and are probably not numbered as by TotalSegmentator.
    OtherNumbers {
        /// What does not fit.
        reason: String,
    },
    /// Several layers were merged: segment `k` of the file, counting from 0, has label `k + 1`, and
    /// where segments overlap the later one stays.
    LayersMerged {
        /// How many layers.
        layers: usize,
        /// How many voxels lie in several segments.
        overlaps: u64,
        /// How many values in layers stand for no segment; they became background.
        strays: u64,
    },
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnitAssumed => {
                f.write_str("the file names no unit of length; millimetres are assumed")
            }
            Self::OddSize { longest_edge } => write!(
                f,
                "the longest edge of the image is {longest_edge:.3e} m; check the unit of the file"
            ),
            Self::FormsDiffer { distance } => write!(
                f,
                "sform and qform differ by up to {:.2} mm; the sform is used",
                1e3 * distance
            ),
            Self::Scaled { slope, intercept } => {
                write!(f, "stored values were multiplied by {slope}, then {intercept} was added")
            }
            Self::OffsetAssumed => f.write_str(
                "the header does not say where voxels begin; right behind it is assumed",
            ),
            Self::NoOrigin => f.write_str("the file has no origin; the first voxel is put at 0"),
            Self::ExtensionDamaged { reason } => {
                write!(f, "an extension of the header was passed over: {reason}")
            }
            Self::GoesOn => f.write_str("the file goes on behind the image; that was not read"),
            Self::OtherNumbers { reason } => write!(
                f,
                "labels do not look like TotalSegmentator's numbers ({reason}), and are called label_1, label_2 and so on; --names 1=liver,2=tumor names them"
            ),
            Self::LayersMerged { layers, overlaps, strays } => {
                write!(
                    f,
                    "{layers} layers were merged, segments are numbered from 1; {overlaps} voxels \
                    lie in several segments, of which the last stays"
                )?;
                if *strays > 0 {
                    write!(f, "; {strays} values stand for no segment and became background")?;
                }
                Ok(())
            }
        }
    }
}

/// The report of reading a file, beside the label map.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeReport {
    /// The format found.
    pub format: VolumeFormat,
    /// True where voxels were compressed by gzip.
    pub gzip: bool,
    /// Which part of the header tells where voxels are.
    pub orientation: Orientation,
    /// The axes in which the file counts positions.
    pub space: WorldSpace,
    /// True where the axes of the image are a left-handed frame, see [`crate::Affine::is_left_handed`].
    pub left_handed: bool,
    /// Where names of labels come from.
    pub names_from: NamesFrom,
    /// What else is worth knowing.
    pub notes: Vec<Note>,
}

impl VolumeReport {
    /// True where positions of the file were LPS, so that x and y were turned round.
    pub fn was_lps(&self) -> bool {
        self.space == WorldSpace::LeftPosteriorSuperior
    }
}

impl fmt::Display for VolumeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let packed = if self.gzip { ", gzip" } else { "" };
        let hand = if self.left_handed { "left-handed" } else { "right-handed" };
        write!(f, "{}{packed}: {}; {}; ", self.format, self.orientation, self.space)?;
        write!(f, "the image's axes are {hand}; {}", self.names_from)?;
        for note in &self.notes {
            write!(f, "; {note}")?;
        }
        f.write_str(".")
    }
}
