//! A block cut into boxes, every box into tetrahedra.
//!
//! [`Splitting::Five`] cuts four corners off each box and keeps the tetrahedron between them;
//! neighbouring boxes are mirror images, so that their faces match. [`Splitting::Six`] is Kuhn's:
//! one tetrahedron per order in which a path along the box's edges can take the three axes, all
//! around the box's diagonal.

use super::{MAX_TETS, ShapeError, check_length};
use crate::mesh::{TetMesh, tet_volume};
use crate::scalar::{Vec3, vec3};

/// How a box becomes tetrahedra. Corners are counted in binary: bit 0 is +x, 1 is +y, 2 is +z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Splitting {
    /// Five tetrahedra, mirrored from box to box like the colours of a chessboard. The default: it
    /// prefers no direction (with an even number of boxes across, a symmetric load bends a beam
    /// symmetrically), takes a sixth fewer tetrahedra, and the middle one of a cube is regular.
    #[default]
    Five,
    /// Six tetrahedra, the same in every box. All are alike and every interior vertex has 24 of
    /// them (the other splitting has 8 and 32 by turns), but the mesh is stiffer across the boxes'
    /// diagonal than along it: a beam in pure bending twists a little.
    Six,
}

const FIVE: [[usize; 4]; 5] =
    [[0, 3, 5, 6], [1, 0, 3, 5], [2, 0, 6, 3], [4, 0, 5, 6], [7, 3, 6, 5]];
const SIX: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

impl Splitting {
    /// The tetrahedra of the box at `(i, j, k)`, as corner numbers.
    fn tets(self, [i, j, k]: [usize; 3]) -> impl Iterator<Item = [usize; 4]> {
        let (tets, mirror): (&'static [[usize; 4]], usize) = match self {
            Self::Five => (&FIVE, (i + j + k) % 2),
            Self::Six => (&SIX, 0),
        };
        // Flipping one bit of every corner mirrors the box along x.
        tets.iter().map(move |tet| tet.map(|corner| corner ^ mirror))
    }

    fn tets_per_cell(self) -> usize {
        match self {
            Self::Five => FIVE.len(),
            Self::Six => SIX.len(),
        }
    }
}

/// A block and how to cut it.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// The corner with the smallest coordinates `[m]`.
    pub corner: Vec3<f64>,
    /// Edge lengths `[m]`.
    pub size: Vec3<f64>,
    /// Boxes along each axis.
    pub cells: [usize; 3],
    /// How each box is split.
    pub splitting: Splitting,
    /// Random displacement of interior vertices, from 0 to 0.9: a fraction of the largest one that
    /// cannot turn a tetrahedron inside out.
    pub jitter: f64,
    /// Which random displacement.
    pub seed: u64,
    /// Depth of a cut across x in the middle, from the upper side down, as a share of the height; rounded to whole
    /// boxes, of which the lowest is never cut. Its two sides touch, and are not connected.
    pub cut: f64,
}

impl Block {
    /// A regular block from the origin.
    pub fn new(size: Vec3<f64>, cells: [usize; 3]) -> Self {
        let splitting = Splitting::default();
        Self { corner: Vec3::ZERO, size, cells, splitting, jitter: 0.0, seed: 0, cut: 0.0 }
    }

    /// Builds the mesh, all in region 0. Vertices are numbered along x first, then y, then z.
    pub fn mesh(&self) -> Result<TetMesh, ShapeError> {
        self.check()?;
        let [nx, ny, nz] = self.cells;
        let cell = self.cell_size();
        let reach = self.jitter * self.safe_displacement();
        let mut random = SplitMix64(self.seed);
        let mut vertices = Vec::with_capacity((nx + 1) * (ny + 1) * (nz + 1));
        for k in 0..=nz {
            for j in 0..=ny {
                for i in 0..=nx {
                    let at = vec3(i as f64, j as f64, k as f64).scale(cell);
                    let is_interior = [(i, nx), (j, ny), (k, nz)]
                        .iter()
                        .all(|&(index, n)| 0 < index && index < n);
                    let shift = if is_interior && reach > 0.0 {
                        random.point_in_ball() * reach
                    } else {
                        Vec3::ZERO
                    };
                    vertices.push(self.corner + at + shift);
                }
            }
        }
        let index = |i: usize, j: usize, k: usize| (i + (nx + 1) * (j + (ny + 1) * k)) as u32;
        // Behind the cut its vertices stand once more, where they are.
        let (middle, uncut) = (nx / 2, self.uncut_layers());
        let first_copy = vertices.len() as u32;
        for k in uncut + 1..=nz {
            for j in 0..=ny {
                vertices.push(vertices[index(middle, j, k) as usize]);
            }
        }
        let index = |cell: usize, i: usize, j: usize, k: usize| {
            let is_copy = i == middle && cell >= middle && k > uncut;
            let copy = || first_copy + (j + (ny + 1) * (k - uncut - 1)) as u32;
            if is_copy { copy() } else { index(i, j, k) }
        };
        let mut tets = Vec::with_capacity(nx * ny * nz * self.splitting.tets_per_cell());
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    let corner = |c: usize| index(i, i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                    for tet in self.splitting.tets([i, j, k]) {
                        let mut tet = tet.map(corner);
                        // Mirrored boxes turn the winding round.
                        if tet_volume(tet.map(|v| vertices[v as usize])) < 0.0 {
                            tet.swap(2, 3);
                        }
                        tets.push(tet);
                    }
                }
            }
        }
        let regions = vec![0; tets.len()];
        Ok(TetMesh::new(vertices, tets, regions)?.0)
    }

    fn check(&self) -> Result<(), ShapeError> {
        for (axis, name) in
            ["block's x size", "block's y size", "block's z size"].iter().enumerate()
        {
            check_length(name, self.size[axis])?;
        }
        if !self.corner.is_finite() {
            let value = self.corner.x + self.corner.y + self.corner.z;
            return Err(ShapeError::Length { name: "block's corner", value });
        }
        if self.cells.contains(&0) {
            return Err(ShapeError::NoCells { cells: self.cells });
        }
        if !(0.0..=0.9).contains(&self.jitter) {
            return Err(ShapeError::Jitter { jitter: self.jitter });
        }
        if !(0.0..1.0).contains(&self.cut) {
            return Err(ShapeError::Cut { cut: self.cut });
        }
        let per_cell = self.splitting.tets_per_cell();
        let tets = self.cells.iter().map(|&n| n as f64).product::<f64>() * per_cell as f64;
        if tets > MAX_TETS as f64 {
            return Err(ShapeError::TooManyTets { tets });
        }
        Ok(())
    }

    /// Layers of boxes below the cut; all of them where there is none, or no box on one side of it.
    fn uncut_layers(&self) -> usize {
        let [nx, _, nz] = self.cells;
        let cut = (self.cut * nz as f64).round() as usize;
        if nx < 2 { nz } else { nz - cut.min(nz - 1) }
    }

    fn cell_size(&self) -> Vec3<f64> {
        let [nx, ny, nz] = self.cells.map(|n| n as f64);
        vec3(self.size.x / nx, self.size.y / ny, self.size.z / nz)
    }

    /// How far `[m]` every vertex may move, in any direction, before a tetrahedron can go flat: half
    /// the smallest width. Were it flat, all its corners would lie in one plane, so before the move
    /// between two planes at most that width apart.
    fn safe_displacement(&self) -> f64 {
        let cell = self.cell_size();
        let corner =
            |c: usize| vec3((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64).scale(cell);
        self.splitting.tets([0; 3]).map(|tet| width(tet.map(corner))).fold(f64::INFINITY, f64::min)
            * 0.5
    }
}

/// Smallest distance `[m]` between two parallel planes that hold a tetrahedron between them: a corner
/// and its opposite face, or two opposite edges, lie in them.
fn width(x: [Vec3<f64>; 4]) -> f64 {
    let distance = |u: Vec3<f64>, v: Vec3<f64>, across: Vec3<f64>| {
        let normal = u.cross(v);
        normal.dot(across).abs() / normal.length()
    };
    let [a, b, c, d] = x;
    [
        distance(c - b, d - b, a - b),
        distance(c - a, d - a, b - a),
        distance(b - a, d - a, c - a),
        distance(b - a, c - a, d - a),
        distance(b - a, d - c, c - a),
        distance(c - a, d - b, b - a),
        distance(d - a, c - b, b - a),
    ]
    .into_iter()
    .fold(f64::INFINITY, f64::min)
}

/// G. L. Steele, D. Lea and C. H. Flood, "Fast splittable pseudorandom number generators", 2014.
struct SplitMix64(u64);

impl SplitMix64 {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in [-1, 1).
    fn symmetric(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Uniform in the unit ball, by rejection: about two draws.
    fn point_in_ball(&mut self) -> Vec3<f64> {
        loop {
            let point = vec3(self.symmetric(), self.symmetric(), self.symmetric());
            if point.length_squared() <= 1.0 {
                return point;
            }
        }
    }
}
