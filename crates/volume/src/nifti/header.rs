//! The fields of a header, of both versions.

use crate::error::{VolumeProblem, bad_field, unsupported};
use crate::report::Note;
use crate::values::ByteOrder;

use super::PAIR_ADVICE;

/// Which layout the header has, and which byte of a number comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Version {
    pub is_second: bool,
    pub order: ByteOrder,
}

impl Version {
    /// Bytes of the header, which its first number says.
    pub fn header_size(self) -> usize {
        if self.is_second { 540 } else { 348 }
    }
}

/// Both versions begin with the size of their header.
pub(crate) fn find_version(bytes: &[u8]) -> Option<Version> {
    let first = *bytes.first_chunk()?;
    [ByteOrder::Little, ByteOrder::Big].into_iter().find_map(|order| {
        let size = match order {
            ByteOrder::Little => i32::from_le_bytes(first),
            ByteOrder::Big => i32::from_be_bytes(first),
        };
        match size {
            348 => Some(Version { is_second: false, order }),
            540 => Some(Version { is_second: true, order }),
            _ => None,
        }
    })
}

/// The fields that matter for a label map, with the names of the format.
pub(super) struct Header {
    version: Version,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub pixdim: [f64; 8],
    vox_offset: f64,
    pub scl_slope: f64,
    pub scl_inter: f64,
    pub xyzt_units: i32,
    pub qform_code: i32,
    pub sform_code: i32,
    /// Components b, c, d of the quaternion.
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
}

impl Header {
    pub fn parse(version: Version, bytes: &[u8]) -> Result<Self, VolumeProblem> {
        let fields = Fields { bytes, order: version.order };
        check_magic(version, fields)?;
        Ok(if version.is_second {
            Self::parse_second(version, fields)
        } else {
            Self::parse_first(version, fields)
        })
    }

    fn parse_first(version: Version, fields: Fields<'_>) -> Self {
        let srow = |row: usize| [0, 1, 2, 3].map(|column| fields.f32(280 + 16 * row + 4 * column));
        Self {
            version,
            dim: [0, 1, 2, 3, 4, 5, 6, 7].map(|i| i64::from(fields.i16(40 + 2 * i))),
            datatype: fields.i16(70),
            pixdim: [0, 1, 2, 3, 4, 5, 6, 7].map(|i| fields.f32(76 + 4 * i)),
            vox_offset: fields.f32(108),
            scl_slope: fields.f32(112),
            scl_inter: fields.f32(116),
            xyzt_units: i32::from(fields.array::<1>(123)[0]),
            qform_code: i32::from(fields.i16(252)),
            sform_code: i32::from(fields.i16(254)),
            quatern: [256, 260, 264].map(|at| fields.f32(at)),
            qoffset: [268, 272, 276].map(|at| fields.f32(at)),
            srow: [0, 1, 2].map(srow),
        }
    }

    fn parse_second(version: Version, fields: Fields<'_>) -> Self {
        let srow = |row: usize| [0, 1, 2, 3].map(|column| fields.f64(400 + 32 * row + 8 * column));
        Self {
            version,
            dim: [0, 1, 2, 3, 4, 5, 6, 7].map(|i| fields.i64(16 + 8 * i)),
            datatype: fields.i16(12),
            pixdim: [0, 1, 2, 3, 4, 5, 6, 7].map(|i| fields.f64(104 + 8 * i)),
            vox_offset: fields.i64(168) as f64,
            scl_slope: fields.f64(176),
            scl_inter: fields.f64(184),
            xyzt_units: fields.i32(500),
            qform_code: fields.i32(344),
            sform_code: fields.i32(348),
            quatern: [352, 360, 368].map(|at| fields.f64(at)),
            qoffset: [376, 384, 392].map(|at| fields.f64(at)),
            srow: [0, 1, 2].map(srow),
        }
    }

    /// Where voxels begin, counting from the first byte of the header.
    pub fn data_offset(&self, notes: &mut Vec<Note>) -> Result<u64, VolumeProblem> {
        // Extensions hold names and notes; whole DICOM headers are a hundred times smaller.
        const FARTHEST: f64 = (1_u32 << 26) as f64;
        // Four bytes behind the header say whether extensions follow.
        let nearest = self.version.header_size() as u64 + 4;
        let offset = self.vox_offset;
        if offset == 0.0 {
            notes.push(Note::OffsetAssumed);
            return Ok(nearest);
        }
        if offset.fract() != 0.0 || !(nearest as f64..=FARTHEST).contains(&offset) {
            let expected = if self.version.is_second {
                "a whole number of bytes from 544 to 64 MiB"
            } else {
                "a whole number of bytes from 352 to 64 MiB"
            };
            return Err(bad_field("vox_offset", expected, format_args!("{offset:e}")));
        }
        Ok(offset as u64)
    }
}

/// The magic tells a file from a pair of files, and a NIfTI from an Analyze header.
fn check_magic(version: Version, fields: Fields<'_>) -> Result<(), VolumeProblem> {
    let magic: [u8; 8] = match version.is_second {
        true => fields.array(4),
        false => {
            let [a, b, c, d] = fields.array(344);
            [a, b, c, d, 0, 0, 0, 0]
        }
    };
    match (&magic, version.is_second) {
        (b"n+1\0\0\0\0\0", false) | (b"n+2\0\r\n\x1a\n", true) => Ok(()),
        (b"ni1\0\0\0\0\0", false) | ([b'n', b'i', b'2', b'\0', ..], true) => {
            Err(unsupported("the header half of a pair (.hdr, .img)", PAIR_ADVICE))
        }
        ([b'n', b'+', b'2', b'\0', ..], true) => Err(bad_field(
            "magic",
            "the line ends \\r \\n \\x1a \\n behind it, which a transfer as text destroys",
            magic[4..].escape_ascii(),
        )),
        (_, false) => {
            let advice = "its left and right are unknown; export the label map as NIfTI";
            Err(unsupported("an Analyze 7.5 header (no NIfTI magic)", advice))
        }
        _ => Err(bad_field("magic", "`n+2`", magic.escape_ascii())),
    }
}

/// Numbers at their places.
#[derive(Clone, Copy)]
struct Fields<'a> {
    bytes: &'a [u8],
    order: ByteOrder,
}

macro_rules! number_at {
    ($($type:ident -> $result:ty),*) => {
        $(fn $type(self, at: usize) -> $result {
            let bytes = self.array(at);
            match self.order {
                ByteOrder::Little => <$type>::from_le_bytes(bytes).into(),
                ByteOrder::Big => <$type>::from_be_bytes(bytes).into(),
            }
        })*
    };
}

impl Fields<'_> {
    number_at!(i16 -> i16, i32 -> i32, i64 -> i64, f32 -> f64, f64 -> f64);

    /// Bytes at a place; the header was read as a whole, so they are there.
    fn array<const N: usize>(self, at: usize) -> [u8; N] {
        self.bytes.get(at..).and_then(|bytes| bytes.first_chunk()).copied().unwrap_or([0; N])
    }
}
