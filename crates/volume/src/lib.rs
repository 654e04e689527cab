//! Label maps, segmented CT and MR scans, from the bytes of a file.
//!
//! A label map gives each voxel of an image a whole number: 0 is background, every other number is
//! an organ or another structure. [`read`] takes NIfTI (`.nii`, `.nii.gz`) and NRRD (`.nrrd`,
//! `.seg.nrrd`) files, and tells in a [`VolumeReport`] what it found and what it assumed;
//! [`summarize`] lists the labels with their sizes and places.
//!
//! Positions are metres in the patient's frame of NIfTI, *RAS*: x to the patient's right, y to the
//! front (anterior), z to the head (superior). Files in other frames are turned into it.
//!
//! The readers are written here and no package is used for them: the header of NIfTI is 348 bytes,
//! and its sizes must be checked before anything is allocated.
//!
//! ```
//! use viscera_volume::{Limits, read, summarize};
//!
//! let file = b"NRRD0004
//! type: uint8
//! dimension: 3
//! sizes: 2 1 1
//! encoding: text
//! space: left-posterior-superior
//! space directions: (2,0,0) (0,2,0) (0,0,2)
//! space origin: (10,0,0)
//! Segment0_LabelValue:=5
//! Segment0_Name:=liver
//!
//! 0 5";
//! let (map, report) = read("tiny.seg.nrrd", file, Limits::default())?;
//! println!("{report}");
//! let liver = &summarize(&map)[0];
//! assert_eq!(liver.name.as_deref(), Some("liver"));
//! assert!((liver.milliliters - 0.008).abs() < 1e-15);
//! # Ok::<(), viscera_volume::VolumeError>(())
//! ```
//!
//! | file | what |
//! |---|---|
//! | `read` | the format of a file, by its content |
//! | `source` | bytes as they are, or inflated as far as they are needed |
//! | `values` | types of numbers, in both byte orders |
//! | `collect` | numbers to labels; refuses scans that are no label maps |
//! | `nifti`, `nrrd` | the formats |
//! | `label_map`, `affine` | the result |
//! | `report`, `error` | what was found, what is wrong |
//! | `organ`, `pieces` | labels as smooth shapes, without crumbs |
//! | `summary` | labels with their sizes and places |
//! | `total_segmentator`, `numbering` | names of the labels that TotalSegmentator gives, and whether labels are numbered so |
//! | `tissue` | which tissue each structure is made of, by its name |

mod affine;
mod collect;
mod error;
mod label_map;
mod nifti;
mod nrrd;
mod numbering;
mod organ;
mod pieces;
mod read;
mod report;
mod source;
mod summary;
pub mod tissue;
pub mod total_segmentator;
mod values;

pub use affine::{Affine, Side};
pub use error::{VolumeError, VolumeProblem};
pub use label_map::LabelMap;
pub use organ::{Organ, OrganError, OrganReport, Wall};
pub use read::{Limits, read};
pub use report::{NamesFrom, Note, Orientation, VolumeFormat, VolumeReport, WorldSpace};
pub use summary::{BorderFace, LabelSummary, summarize};
