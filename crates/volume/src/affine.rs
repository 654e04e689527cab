//! From voxels to the patient.

use std::fmt;

use viscera::scalar::{Mat3, Vec3, vec3};

use crate::error::VolumeProblem;

/// Positions of voxels in the patient's frame, RAS: `matrix * (i, j, k) + translation` is the centre
/// of voxel `(i, j, k)` in metres, x to the right, y to the front, z to the head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// From one voxel to the next along each axis of the image `[m]`, one column per axis.
    pub matrix: Mat3<f64>,
    /// The centre of voxel (0, 0, 0) `[m]`.
    pub translation: Vec3<f64>,
}

impl Affine {
    /// The position of a point of the image `[m]`; whole numbers are centres of voxels.
    pub fn to_world(&self, voxel: Vec3<f64>) -> Vec3<f64> {
        self.matrix * voxel + self.translation
    }

    /// The point of the image at a position `[m]`, the inverse of [`Affine::to_world`].
    pub fn to_voxel(&self, position: Vec3<f64>) -> Vec3<f64> {
        self.matrix.inverse() * (position - self.translation)
    }

    /// Edges of a voxel along the three axes of the image `[m]`.
    pub fn voxel_size(&self) -> [f64; 3] {
        self.matrix.columns.map(Vec3::length)
    }

    /// Volume of a voxel `[m^3]`.
    pub fn voxel_volume(&self) -> f64 {
        self.matrix.determinant().abs()
    }

    /// True where the image's axes are a left-handed frame. Triangles of a surface that is traced in
    /// voxels then face inwards in the patient's frame.
    pub fn is_left_handed(&self) -> bool {
        self.matrix.determinant() < 0.0
    }

    /// The side of the patient at which an axis of the image (0 to 2) ends, the nearest of six.
    pub fn side_at_end(&self, axis: usize) -> Side {
        let along = self.matrix.columns[axis.min(2)].to_array();
        let mut main = 0;
        for component in 1..3 {
            if along[component].abs() > along[main].abs() {
                main = component;
            }
        }
        let positive = [Side::Right, Side::Anterior, Side::Superior][main];
        if along[main] < 0.0 { positive.opposite() } else { positive }
    }

    /// Tells whether the transform has an inverse; the error names `orientation`.
    pub(crate) fn check(&self, orientation: &'static str) -> Result<(), VolumeProblem> {
        // Headers hold single precision: three directions whose volume is smaller than this share
        // of a box's may as well lie in one plane.
        const FLATTEST: f64 = 1e-6;
        let is_finite = self.matrix.columns.iter().all(|column| column.is_finite());
        if !is_finite || !self.translation.is_finite() {
            return Err(VolumeProblem::NonFiniteAffine { orientation });
        }
        let size = self.voxel_size();
        if let Some(axis) = size.iter().position(|&edge| edge == 0.0) {
            return Err(VolumeProblem::ZeroVoxelSize { axis, orientation });
        }
        let volume = self.voxel_volume();
        let box_volume = size[0] * size[1] * size[2];
        if !volume.is_finite() || !box_volume.is_finite() {
            return Err(VolumeProblem::NonFiniteAffine { orientation });
        }
        if volume <= FLATTEST * box_volume {
            return Err(VolumeProblem::SingularAffine { orientation });
        }
        Ok(())
    }

    /// The same transform where x and y of the world count the other way.
    pub(crate) fn flipped(&self, flips: [bool; 3]) -> Self {
        let sign = |flip: bool| if flip { -1.0 } else { 1.0 };
        let signs = vec3(sign(flips[0]), sign(flips[1]), sign(flips[2]));
        let [a, b, c] = self.matrix.columns;
        Self {
            matrix: Mat3::from_columns(a.scale(signs), b.scale(signs), c.scale(signs)),
            translation: self.translation.scale(signs),
        }
    }

    /// The same transform in metres.
    pub(crate) fn in_meters(&self, unit: f64) -> Self {
        Self { matrix: self.matrix * unit, translation: self.translation * unit }
    }
}

/// A side of the patient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The patient's right, +x.
    Right,
    /// The patient's left, -x.
    Left,
    /// The front, +y.
    Anterior,
    /// The back, -y.
    Posterior,
    /// Towards the head, +z.
    Superior,
    /// Towards the feet, -z.
    Inferior,
}

impl Side {
    /// The side across.
    pub fn opposite(self) -> Self {
        match self {
            Self::Right => Self::Left,
            Self::Left => Self::Right,
            Self::Anterior => Self::Posterior,
            Self::Posterior => Self::Anterior,
            Self::Superior => Self::Inferior,
            Self::Inferior => Self::Superior,
        }
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Right => "right",
            Self::Left => "left",
            Self::Anterior => "anterior",
            Self::Posterior => "posterior",
            Self::Superior => "superior",
            Self::Inferior => "inferior",
        })
    }
}
