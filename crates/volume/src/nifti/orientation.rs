//! From voxels to the patient, see "3D image (volume) orientation and location in space" in
//! `nifti1.h`:
//!
//! - method 3, the sform: `x = srow [i j k 1]`;
//! - method 2, the qform: `x = R(a, b, c, d) diag(pixdim1, pixdim2, qfac pixdim3) [i j k] + qoffset`
//!   with the rotation of the unit quaternion `a + b i + c j + d k`, `a >= 0`;
//! - method 1, for Analyze: `x = diag(pixdim1, pixdim2, pixdim3) [i j k]`.

use viscera::scalar::{Mat3, Vec3, vec3};

use crate::affine::Affine;
use crate::error::{VolumeProblem, bad_field};
use crate::read::Place;
use crate::report::{Note, Orientation, WorldSpace};

use super::header::Header;

/// Where voxels are: by the sform, else by the qform, else by sizes alone.
pub(super) fn place(
    header: &Header,
    dims: [usize; 3],
    notes: &mut Vec<Note>,
) -> Result<Place, VolumeProblem> {
    let unit = unit(header.xyzt_units, notes)?;
    let (affine, orientation) = if header.sform_code > 0 {
        (sform(header), Orientation::Sform)
    } else if header.qform_code > 0 {
        (qform(header), Orientation::Qform)
    } else {
        (pixdim_only(header), Orientation::PixdimOnly)
    };
    let to_world = affine.in_meters(unit);
    to_world.check(orientation.name())?;
    if header.sform_code > 0 && header.qform_code > 0 {
        notes.extend(difference(&to_world, &qform(header).in_meters(unit), dims));
    }
    let space = match orientation {
        Orientation::PixdimOnly => WorldSpace::Unnamed,
        _ => WorldSpace::RightAnteriorSuperior,
    };
    Ok(Place { to_world, orientation, space })
}

/// The unit of lengths in the header `[m]`.
fn unit(xyzt_units: i32, notes: &mut Vec<Note>) -> Result<f64, VolumeProblem> {
    // The three lowest bits are of space, the next three of time.
    match xyzt_units & 7 {
        0 => {
            notes.push(Note::UnitAssumed);
            Ok(1e-3)
        }
        1 => Ok(1.0),
        2 => Ok(1e-3),
        3 => Ok(1e-6),
        code => {
            let expected = "a unit of length: 1 for metres, 2 for millimetres, 3 for micrometres";
            Err(bad_field("xyzt_units", expected, code))
        }
    }
}

fn sform(header: &Header) -> Affine {
    let [x, y, z] = header.srow;
    let column = |i: usize| vec3(x[i], y[i], z[i]);
    let matrix = Mat3::from_columns(column(0), column(1), column(2));
    Affine { matrix, translation: column(3) }
}

fn qform(header: &Header) -> Affine {
    let [_, dx, dy, dz, ..] = header.pixdim.map(f64::abs);
    let qfac = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
    let [x, y, z] = rotation(header.quatern).columns;
    Affine {
        matrix: Mat3::from_columns(x * dx, y * dy, z * (qfac * dz)),
        translation: Vec3::from_f64(header.qoffset),
    }
}

/// The rotation of the unit quaternion with these three components.
fn rotation([mut b, mut c, mut d]: [f64; 3]) -> Mat3<f64> {
    // Rounded to single precision, a half-turn may have components whose squares add up to more than
    // 1 by this much; then the first component is 0 and the others are made a unit.
    const ROUNDING: f64 = 1e-7;
    let squares = b * b + c * c + d * d;
    let mut a = 0.0;
    if 1.0 - squares < ROUNDING {
        let length = squares.sqrt();
        (b, c, d) = (b / length, c / length, d / length);
    } else {
        a = (1.0 - squares).sqrt();
    }
    Mat3::from_columns(
        vec3(a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)),
        vec3(2.0 * (b * c - a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d + a * b)),
        vec3(2.0 * (b * d + a * c), 2.0 * (c * d - a * b), a * a + d * d - b * b - c * c),
    )
}

fn pixdim_only(header: &Header) -> Affine {
    let [_, dx, dy, dz, ..] = header.pixdim.map(f64::abs);
    let matrix = Mat3::from_columns(vec3(dx, 0.0, 0.0), vec3(0.0, dy, 0.0), vec3(0.0, 0.0, dz));
    Affine { matrix, translation: Vec3::ZERO }
}

/// A note where two transforms put a corner of the image at different places.
fn difference(sform: &Affine, qform: &Affine, dims: [usize; 3]) -> Option<Note> {
    // A quaternion in single precision turns by 1e-7, which is less than this even across a
    // thousand voxels.
    const SHARE_OF_VOXEL: f64 = 0.1;
    let last = dims.map(|size| (size - 1) as f64);
    let mut distance: f64 = 0.0;
    for corner in 0..8 {
        let at = |axis: usize| if corner >> axis & 1 == 1 { last[axis] } else { 0.0 };
        let voxel = vec3(at(0), at(1), at(2));
        distance = distance.max((sform.to_world(voxel) - qform.to_world(voxel)).length());
    }
    let smallest = sform.voxel_size().into_iter().fold(f64::INFINITY, f64::min);
    (distance > SHARE_OF_VOXEL * smallest).then_some(Note::FormsDiffer { distance })
}
