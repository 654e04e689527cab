//! The shape of an organ: voxels without their steps, with their volume.
//!
//! ```text
//! f = g * [voxel is of the organ],   g: a Gaussian of 0.8 voxels along each axis of the image
//! inside:  f(p) > c,   f between voxels by trilinear interpolation;   c: that of as much volume as the voxels have
//! ```
//!
//! Gibson, "Constrained elastic surface nets", 1998, names the staircase; a blurred mask is the plainest cure, and the level `c` undoes
//! what blurring takes from thin parts. Beyond the image the mask goes on as it was at its border, and the image ends the
//! shape: organs that the scan has cut get flat caps.

use viscera::mesh::distance::SignedDistance;
use viscera::mesh::winding::Solid;
use viscera::scalar::{Vec3, vec3};

use crate::LabelMap;
use crate::affine::Affine;
use crate::pieces::Pieces;

/// Standard deviation of the blur, in voxels.
const BLUR: f64 = 0.8;
/// How far it reaches [voxels]: a Gaussian is 1e-3 of its middle there.
const REACH: usize = 3;
/// A voxel near the surface is asked at so many points for the level, in steps of a sequence that repeats nowhere: on a grid
/// many points of a flat shape would be alike. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
const SAMPLES: usize = 27;
const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3];
/// Pieces smaller than this share of the largest are left out: crumbs of a segmentation.
const CRUMB: f64 = 0.05;

/// Why there is no shape.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OrganError {
    /// No voxel has any of the labels.
    #[error("no voxel has the label {labels}; the labels there are: {known}")]
    NoVoxel {
        /// What was asked for.
        labels: String,
        /// Labels with voxels.
        known: String,
    },
}

/// What became of an organ's voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrganReport {
    /// Voxels of the shape.
    pub voxels: usize,
    /// Their volume [m^3].
    pub volume: f64,
    /// Unconnected pieces of the shape.
    pub pieces: usize,
    /// Pieces that were left out because they are smaller than a twentieth of the largest, and their voxels.
    pub crumbs: [usize; 2],
    /// Faces of the image that cut the organ.
    pub caps: usize,
    /// The level of the blurred mask that keeps the volume.
    pub level: f64,
}

/// The smooth shape of some labels of a map.
#[derive(Clone, Debug)]
pub struct Organ {
    /// Blurred mask of the box around the organ, first axis fastest.
    field: Vec<f32>,
    dims: [usize; 3],
    /// The voxel of the map that is the first of the box.
    first: [f64; 3],
    level: f64,
    to_world: Affine,
    /// Rows of the inverse: normals of the image's faces, a voxel long.
    normals: [Vec3<f64>; 3],
    /// Voxels of the image.
    image: [f64; 3],
    /// From the blurred mask to metres near the surface.
    scale: f64,
}

impl Organ {
    /// Of all voxels that have one of the labels.
    pub fn new(map: &LabelMap, labels: &[u16]) -> Result<(Self, OrganReport), OrganError> {
        let pieces = Pieces::of(map, labels, CRUMB);
        let Some([low, high]) = pieces.bounds() else {
            let text = |labels: &mut dyn Iterator<Item = u16>| {
                labels.map(|label| label.to_string()).collect::<Vec<_>>().join(", ")
            };
            let mut known: Vec<u16> = map.labels().iter().copied().filter(|&l| l != 0).collect();
            known.sort_unstable();
            known.dedup();
            let (labels, known) = (text(&mut labels.iter().copied()), text(&mut known.into_iter()));
            return Err(OrganError::NoVoxel { labels, known });
        };
        // Room for the blur, and for a lattice that looks at it from outside.
        let margin = REACH + 1;
        let first = low.map(|index| index as f64 - margin as f64);
        let dims = [0, 1, 2].map(|axis| high[axis] - low[axis] + 1 + 2 * margin);
        let size = map.dims();
        let mut mask = vec![0.0f32; dims.iter().product()];
        let source = |axis: usize, index: usize| {
            let at = index as i64 + low[axis] as i64 - margin as i64;
            at.clamp(0, size[axis] as i64 - 1) as usize
        };
        let mut place = 0;
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                let (sy, sz) = (source(1, y), source(2, z));
                for x in 0..dims[0] {
                    if pieces.has([source(0, x), sy, sz]) {
                        mask[place] = 1.0;
                    }
                    place += 1;
                }
            }
        }
        let field = blurred(mask, dims);
        let to_world = *map.to_world();
        let inverse = to_world.matrix.inverse().transpose();
        let mut organ = Self {
            field,
            dims,
            first,
            level: 0.5,
            to_world,
            normals: inverse.columns,
            image: size.map(|size| size as f64),
            // A plane's blurred mask falls by this much for each voxel.
            scale: BLUR * (2.0 * std::f64::consts::PI).sqrt() * libm::cbrt(to_world.voxel_volume()),
        };
        organ.level = organ.level_of(pieces.voxels as f64);
        let report = OrganReport {
            voxels: pieces.voxels,
            volume: pieces.voxels as f64 * to_world.voxel_volume(),
            pieces: pieces.kept,
            crumbs: pieces.crumbs,
            caps: (0..3)
                .map(|axis| usize::from(low[axis] == 0) + usize::from(high[axis] + 1 == size[axis]))
                .sum(),
            level: organ.level,
        };
        Ok((organ, report))
    }

    /// The same organ whose surface lies so much [m] further out, by less than a voxel; caps stay where they are.
    pub fn offset(&self, by: f64) -> Offset<'_> {
        Offset { organ: self, by }
    }

    /// Edges of a voxel [m].
    pub fn voxel_size(&self) -> [f64; 3] {
        self.to_world.voxel_size()
    }

    /// The level of which so many voxels of the image lie inside.
    fn level_of(&self, voxels: f64) -> f64 {
        let mut sure = 0usize;
        let mut near: Vec<f32> = Vec::new();
        for z in 1..self.dims[2] - 1 {
            for y in 1..self.dims[1] - 1 {
                for x in 1..self.dims[0] - 1 {
                    let at = [x, y, z];
                    let is_of_image = (0..3).all(|axis| {
                        let index = at[axis] as f64 + self.first[axis];
                        index >= 0.0 && index < self.image[axis]
                    });
                    if !is_of_image {
                        continue;
                    }
                    let place = x + self.dims[0] * (y + self.dims[1] * z);
                    match self.field[place] {
                        // Deep inside, and far outside.
                        value if value > 0.999 => sure += SAMPLES,
                        value if value < 1e-4 => {}
                        _ => {
                            for _ in 0..SAMPLES {
                                let n = near.len() as f64;
                                let q =
                                    [0, 1, 2].map(|k| at[k] as f64 + (n * STEPS[k]) % 1.0 - 0.5);
                                near.push(self.blurred_at(q) as f32);
                            }
                        }
                    }
                }
            }
        }
        let wanted = (voxels * SAMPLES as f64) as usize;
        let wanted = wanted.saturating_sub(sure).min(near.len().saturating_sub(1));
        if near.is_empty() {
            return 0.5;
        }
        // So many are above.
        let (_, level, _) = near.select_nth_unstable_by(wanted, |a, b| b.total_cmp(a));
        f64::from(*level).clamp(0.02, 0.98)
    }

    /// The blurred mask at a place of the box [voxels].
    fn blurred_at(&self, q: [f64; 3]) -> f64 {
        let (mut base, mut share) = ([0; 3], [0.0; 3]);
        for axis in 0..3 {
            let q = q[axis].clamp(0.0, (self.dims[axis] - 1) as f64);
            base[axis] = (q as usize).min(self.dims[axis] - 2);
            share[axis] = q - base[axis] as f64;
        }
        let row = self.dims[0];
        let layer = row * self.dims[1];
        let start = base[0] + row * base[1] + layer * base[2];
        let value = |place: usize| f64::from(self.field[place]);
        let along = |place: usize| value(place) * (1.0 - share[0]) + value(place + 1) * share[0];
        let across = |place: usize| along(place) * (1.0 - share[1]) + along(place + row) * share[1];
        across(start) * (1.0 - share[2]) + across(start + layer) * share[2]
    }

    /// How much of an organ a point is inside of: more than the others' is its own.
    pub fn share_at(&self, point: Vec3<f64>) -> f64 {
        self.blurred_at(self.to_box(self.to_voxel(point)))
    }

    fn to_voxel(&self, point: Vec3<f64>) -> [f64; 3] {
        let way = point - self.to_world.translation;
        self.normals.map(|normal| normal.dot(way))
    }

    fn to_box(&self, voxel: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| voxel[axis] - self.first[axis])
    }
}

/// See [`Organ::offset`].
#[derive(Clone, Copy, Debug)]
pub struct Offset<'a> {
    organ: &'a Organ,
    by: f64,
}

impl SignedDistance for Offset<'_> {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        self.organ.distance_from(point, self.by)
    }

    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        self.organ.bounds()
    }
}

impl Organ {
    /// To the surface that lies so much [m] further out.
    fn distance_from(&self, point: Vec3<f64>, out: f64) -> f64 {
        let voxel = self.to_voxel(point);
        let level = (self.level - out / self.scale).clamp(0.01, 0.99);
        let mut distance = (level - self.blurred_at(self.to_box(voxel))) * self.scale;
        // The image ends half a voxel beyond the middles of its last voxels.
        for axis in 0..3 {
            let beyond = (-0.5 - voxel[axis]).max(voxel[axis] - (self.image[axis] - 0.5));
            distance = distance.max(beyond / self.normals[axis].length());
        }
        distance
    }
}

impl SignedDistance for Organ {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        self.distance_from(point, 0.0)
    }

    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        let corner = |n: usize| {
            let voxel = |axis: usize| {
                // Beyond the image there is nothing.
                let last = self.first[axis] + (self.dims[axis] - 1) as f64;
                let at = if n >> axis & 1 == 0 { self.first[axis] } else { last };
                at.clamp(-0.5, self.image[axis] - 0.5)
            };
            self.to_world.to_world(vec3(voxel(0), voxel(1), voxel(2)))
        };
        (1..8).map(corner).fold((corner(0), corner(0)), |(low, high), x| (low.min(x), high.max(x)))
    }
}

/// The wall of a hollow organ: all of it that is no deeper than the wall is thick.
pub struct Wall<'a> {
    /// The organ with what is in it.
    pub organ: &'a Organ,
    /// Its surface.
    pub skin: &'a Solid,
    /// [m].
    pub thickness: f64,
}

impl SignedDistance for Wall<'_> {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        let outside = self.organ.distance(point);
        if outside >= 0.0 {
            outside
        } else {
            outside.max(self.skin.nearest(point) - self.thickness)
        }
    }

    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        self.organ.bounds()
    }
}

/// A Gaussian along each axis; what lies beyond the box is as its border.
fn blurred(mut field: Vec<f32>, dims: [usize; 3]) -> Vec<f32> {
    let weight = |k: i32| libm::exp(-0.5 * f64::from(k * k) / (BLUR * BLUR));
    let sum: f64 = (-(REACH as i32)..=REACH as i32).map(weight).sum();
    let weights: Vec<f32> =
        (-(REACH as i32)..=REACH as i32).map(|k| (weight(k) / sum) as f32).collect();
    let mut line = Vec::new();
    for axis in 0..3 {
        let stride = dims[..axis].iter().product::<usize>();
        let length = dims[axis];
        for start in 0..field.len() {
            // The first of each line along the axis.
            if start / stride % length != 0 {
                continue;
            }
            line.clear();
            line.extend((0..length).map(|index| field[start + index * stride]));
            for index in 0..length {
                let mut sum = 0.0;
                for (k, weight) in weights.iter().enumerate() {
                    let at = (index + k).saturating_sub(REACH).min(length - 1);
                    sum += weight * line[at];
                }
                field[start + index * stride] = sum;
            }
        }
    }
    field
}
