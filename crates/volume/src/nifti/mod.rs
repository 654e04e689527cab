//! NIfTI-1 and NIfTI-2 in one file, see `nifti1.h` and `nifti2.h` of the NIfTI data format working
//! group: a header of 348 or 540 bytes, extensions, voxels.

mod extension;
mod header;
mod orientation;

use std::collections::BTreeMap;

use crate::collect::Values;
use crate::error::{Fault, VolumeProblem, bad_field, sizes_text, unsupported};
use crate::read::{Limits, Parsed};
use crate::report::{NamesFrom, Note, VolumeFormat};
use crate::source::{Part, Source};
use crate::values::{ValueType, read_values};

use header::Header;
pub(crate) use header::{Version, find_version};

/// How to make one file of a pair.
pub(crate) const PAIR_ADVICE: &str =
    "save header and voxels as one file (.nii or .nii.gz), for example with 3D Slicer";

const ONE_VOLUME: &str = "save one of its volumes, for example with 3D Slicer or `fslroi`";

/// Reads a file whose first bytes, `start`, are already taken from its source.
pub(crate) fn read(
    version: Version,
    start: &[u8],
    mut source: Source<'_>,
    limits: Limits,
) -> Result<Parsed, Fault> {
    let gzip = source.is_gzip();
    let mut bytes = vec![0; version.header_size()];
    let rest = &mut bytes[start.len()..];
    let mut part = Part::new("the header", version.header_size() as u64);
    part.found = start.len() as u64;
    source.take(&mut part, rest)?;
    bytes[..start.len()].copy_from_slice(start);

    let mut notes = Vec::new();
    let header = Header::parse(version, &bytes)?;
    let value_type = value_type(header.datatype)?;
    let scale = scale(&header)?;
    let mut values = Values::new(sizes(&header)?, 1, limits)?.scaled_by(scale);
    notes.extend(scale.map(|(slope, intercept)| Note::Scaled { slope, intercept }));
    let place = orientation::place(&header, values.dims(), &mut notes)?;

    let offset = header.data_offset(&mut notes)?;
    let names = extension::read(&mut source, offset, version, &mut notes)?;
    let goes_on = read_values(source, value_type, version.order, &mut values)?;
    notes.extend(goes_on.then_some(Note::GoesOn));
    Ok(Parsed {
        format: if version.is_second { VolumeFormat::Nifti2 } else { VolumeFormat::Nifti1 },
        gzip,
        dims: values.dims(),
        collected: values.finish()?,
        place,
        names_from: names_from(&names),
        names,
        notes,
    })
}

fn names_from(names: &BTreeMap<u16, String>) -> NamesFrom {
    if names.is_empty() { NamesFrom::None } else { NamesFrom::Extension }
}

/// The codes of `datatype`.
fn value_type(code: i16) -> Result<ValueType, VolumeProblem> {
    const ADVICE: &str = "save label maps as whole numbers of 8 or 16 bits";
    Ok(match code {
        2 => ValueType::U8,
        4 => ValueType::I16,
        8 => ValueType::I32,
        16 => ValueType::F32,
        64 => ValueType::F64,
        256 => ValueType::I8,
        512 => ValueType::U16,
        768 => ValueType::U32,
        1024 => ValueType::I64,
        1280 => ValueType::U64,
        1 => return Err(unsupported("voxels of one bit (datatype 1)", ADVICE)),
        32 | 1792 | 2048 => {
            return Err(unsupported(format!("complex numbers (datatype {code})"), ADVICE));
        }
        128 | 2304 => return Err(unsupported(format!("colours (datatype {code})"), ADVICE)),
        1536 => return Err(unsupported("numbers of 128 bits (datatype 1536)", ADVICE)),
        _ => return Err(bad_field("datatype", "a code of NIfTI, such as 2 or 512", code)),
    })
}

/// Numbers of voxels along three axes.
fn sizes(header: &Header) -> Result<[u64; 3], VolumeProblem> {
    let count = header.dim[0];
    let Some(sizes) = usize::try_from(count).ok().and_then(|count| header.dim.get(1..=count))
    else {
        return Err(bad_field("dim[0]", "a number of dimensions from 1 to 7", count));
    };
    let Some((space, more)) = sizes.split_first_chunk::<3>() else {
        let advice = "label maps have three; export the whole stack of slices as one image";
        return Err(unsupported(format!("an image of {count} dimensions"), advice));
    };
    if space.iter().any(|&size| size < 1) {
        return Err(VolumeProblem::NoVoxels { sizes: sizes_text(space) });
    }
    // Some programs write 0 for a dimension that is not used.
    if let Some(several) = more.iter().find(|size| !(0..=1).contains(*size)) {
        let found = format!("an image of {count} dimensions ({several} volumes)");
        return Err(unsupported(found, ONE_VOLUME));
    }
    Ok(space.map(i64::cast_unsigned))
}

/// Slope and intercept, where they change anything.
fn scale(header: &Header) -> Result<Option<(f64, f64)>, VolumeProblem> {
    let (slope, intercept) = (header.scl_slope, header.scl_inter);
    // "If scl_slope is nonzero, values are scaled"; what is not finite was never set.
    if slope == 0.0 || !slope.is_finite() || (slope, intercept) == (1.0, 0.0) {
        return Ok(None);
    }
    if !intercept.is_finite() {
        return Err(bad_field("scl_inter", "a finite number", intercept));
    }
    Ok(Some((slope, intercept)))
}
