//! A label for each voxel, and where voxels are.

use std::collections::BTreeMap;

use crate::affine::Affine;
use crate::error::{VolumeProblem, sizes_text};

/// A segmented image: a label for each voxel, 0 for background, and where the voxels are.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelMap {
    dims: [usize; 3],
    labels: Vec<u16>,
    to_world: Affine,
    names: BTreeMap<u16, String>,
}

impl LabelMap {
    /// A label map from its parts: numbers of voxels along the axes of the image, labels of shape
    /// `[dims[2]][dims[1]][dims[0]]` (the first axis is the fastest), the way from voxels to the
    /// patient `[m]`, and names of labels, also of some that no voxel has.
    ///
    /// # Errors
    /// A dimension of 0, another number of labels than of voxels, a transform without inverse.
    pub fn new(
        dims: [usize; 3],
        labels: Vec<u16>,
        to_world: Affine,
        names: BTreeMap<u16, String>,
    ) -> Result<Self, VolumeProblem> {
        if dims.contains(&0) {
            return Err(VolumeProblem::NoVoxels { sizes: sizes_text(&dims) });
        }
        let voxels = dims.iter().try_fold(1_usize, |product, &size| product.checked_mul(size));
        if voxels != Some(labels.len()) {
            let sizes = sizes_text(&dims);
            return Err(VolumeProblem::LabelCount { sizes, found: labels.len() });
        }
        to_world.check("transform")?;
        Ok(Self { dims, labels, to_world, names })
    }

    /// Numbers of voxels along the axes of the image; none is 0.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Labels, shape `[dims[2]][dims[1]][dims[0]]`: the first axis is the fastest.
    pub fn labels(&self) -> &[u16] {
        &self.labels
    }

    /// The label of a voxel; `None` outside the image.
    pub fn label_at(&self, voxel: [usize; 3]) -> Option<u16> {
        let [x, y, z] = voxel;
        let inside = voxel.iter().zip(&self.dims).all(|(index, size)| index < size);
        // Within the image the sum is at most the number of labels.
        inside.then(|| self.labels[x + self.dims[0] * (y + self.dims[1] * z)])
    }

    /// From indices of voxels to the patient `[m]`.
    pub fn to_world(&self) -> &Affine {
        &self.to_world
    }

    /// Names of labels, also of some that no voxel has.
    pub fn names(&self) -> &BTreeMap<u16, String> {
        &self.names
    }

    /// The name of a label, if it has one.
    pub fn name(&self, label: u16) -> Option<&str> {
        self.names.get(&label).map(String::as_str)
    }

    /// Gives labels other names; those of before are gone.
    pub fn set_names(&mut self, names: BTreeMap<u16, String>) {
        self.names = names;
    }
}
