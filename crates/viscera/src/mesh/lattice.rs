//! The body-centred cubic lattice of isosurface stuffing: signs, cut points and warping.
//! What each step is for: [`super::tetrahedralize`](mod@super::tetrahedralize).
//!
//! ```text
//! vertex id = 2 (i + nx (j + ny k)) + grid       grid 0: cube corners, 1: cube centres
//! position  = origin + spacing ((i, j, k) + grid / 2)
//! ```

use super::distance::SignedDistance;
use super::tetrahedralize::error::{MAX_LATTICE_VERTICES, TetrahedralizeError};
use crate::scalar::{Vec3, vec3};

/// Warping threshold of long edges, as a fraction of the length. With [`ALPHA_SHORT`], the pair of
/// the largest smallest angle, which the paper gives as 10.7 degrees with a largest of 164.8.
/// A larger one lets three warped corners flatten a tetrahedron; a smaller one leaves slivers where
/// a cut point and a warped vertex come close. For comparison 0.24999 with 0.41189 bounds the
/// angles by 9.31 and 161.65 degrees.
pub(super) const ALPHA_LONG: f64 = 0.285;
/// Warping threshold of short edges, see [`ALPHA_LONG`].
pub(super) const ALPHA_SHORT: f64 = 0.399;

/// Where a lattice vertex lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    Inside,
    Surface,
    Outside,
}

/// A corner of a lattice tetrahedron.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub id: u32,
    /// Twice the position in units of the spacing: all even or all odd.
    pub coordinates: [u32; 3],
    pub sign: Sign,
}

impl Corner {
    /// Of two corners of one tetrahedron: true if a long edge joins them, false if a short one.
    pub fn is_long_neighbor(self, other: Self) -> bool {
        self.id % 2 == other.id % 2
    }
}

/// A zero of the function on a lattice edge.
#[derive(Clone, Copy, Debug)]
struct Cut {
    inside: u32,
    outside: u32,
    /// Where on the edge, from the inner to the outer end, between 0 and 1.
    fraction: f64,
}

/// A lattice sampled on a shape.
pub(super) struct Lattice<'a> {
    shape: &'a dyn SignedDistance,
    spacing: f64,
    origin: Vec3<f64>,
    /// Cubes along each axis.
    cubes: [usize; 3],
    /// Shape `[vertex_count]`.
    signs: Vec<Sign>,
    /// Ordered by (inside, outside).
    cuts: Vec<Cut>,
    /// Warped vertices and their positions `[m]`, ordered by id.
    warped: Vec<(u32, Vec3<f64>)>,
}

impl<'a> Lattice<'a> {
    /// Steps 1 and 2: evaluates the function and finds the cut points.
    ///
    /// There may be no vertex inside, where the shape is small.
    pub fn sample(
        shape: &'a dyn SignedDistance,
        spacing: f64,
    ) -> Result<Self, TetrahedralizeError> {
        let mut lattice = Self::around(shape, spacing)?;
        lattice.signs = Vec::with_capacity(lattice.vertex_count());
        for id in 0..lattice.vertex_count() as u32 {
            let sign = match lattice.evaluate(lattice.regular_position(id))? {
                value if value < 0.0 => Sign::Inside,
                value if value > 0.0 => Sign::Outside,
                _ => Sign::Surface,
            };
            if sign == Sign::Inside && lattice.is_on_rim(id) {
                let point = lattice.regular_position(id).to_array();
                return Err(TetrahedralizeError::BoundsTooTight { point });
            }
            lattice.signs.push(sign);
        }
        lattice.find_cuts()?;
        Ok(lattice)
    }

    /// An empty lattice around the shape, centred on its bounds, with one cube to spare.
    pub fn around(
        shape: &'a dyn SignedDistance,
        spacing: f64,
    ) -> Result<Self, TetrahedralizeError> {
        if !(spacing > 0.0 && spacing.is_finite()) {
            return Err(TetrahedralizeError::Spacing { spacing });
        }
        let (lower, upper) = shape.bounds();
        let size = upper - lower;
        let is_box = (0..3).all(|axis| size[axis] >= 0.0 && size[axis].is_finite());
        if !is_box || !(lower + upper).is_finite() {
            return Err(TetrahedralizeError::Bounds);
        }
        let half_cubes = |spacing: f64| size.to_array().map(|s| (0.5 * s / spacing).ceil() + 1.0);
        let count =
            |spacing: f64| half_cubes(spacing).iter().map(|m| 2.0 * m + 1.0).product::<f64>();
        let (lattice_vertices, limit) = (2.0 * count(spacing), MAX_LATTICE_VERTICES as f64);
        if lattice_vertices > limit {
            let mut suggestion = spacing;
            while 2.0 * count(suggestion) > limit {
                suggestion *= 1.1;
            }
            return Err(TetrahedralizeError::TooFine { spacing, lattice_vertices, suggestion });
        }
        let half = half_cubes(spacing);
        let center = (lower + upper) * 0.5;
        Ok(Self {
            shape,
            spacing,
            origin: center - Vec3::from_f64(half) * spacing,
            cubes: half.map(|m| 2 * m as usize + 1),
            signs: Vec::new(),
            cuts: Vec::new(),
            warped: Vec::new(),
        })
    }

    /// Cubes along each axis; the last ones have no upper corners.
    pub fn cubes(&self) -> [usize; 3] {
        self.cubes
    }

    /// The vertex at a position, doubled: all three even or all three odd.
    pub fn corner(&self, at: [usize; 3]) -> Corner {
        let id = self.id(at[0] % 2, at.map(|n| n / 2));
        let coordinates = at.map(|n| n as u32);
        Corner { id, coordinates, sign: self.signs[id as usize] }
    }

    /// Number of lattice vertices.
    pub fn vertex_count(&self) -> usize {
        2 * self.cubes.iter().product::<usize>()
    }

    /// Number of edges whose ends have opposite signs before warping.
    pub fn cut_count(&self) -> usize {
        self.cuts.len()
    }

    fn id(&self, grid: usize, [i, j, k]: [usize; 3]) -> u32 {
        (2 * (i + self.cubes[0] * (j + self.cubes[1] * k)) + grid) as u32
    }

    fn indices(&self, id: u32) -> (usize, [usize; 3]) {
        let (grid, rest) = (id as usize % 2, id as usize / 2);
        let [nx, ny, _] = self.cubes;
        (grid, [rest % nx, rest / nx % ny, rest / nx / ny])
    }

    fn is_on_rim(&self, id: u32) -> bool {
        let (_, indices) = self.indices(id);
        (0..3).any(|axis| indices[axis] == 0 || indices[axis] + 1 == self.cubes[axis])
    }

    /// Position `[m]` before warping.
    fn regular_position(&self, id: u32) -> Vec3<f64> {
        let (grid, [i, j, k]) = self.indices(id);
        let offset = 0.5 * grid as f64;
        self.origin + vec3(i as f64 + offset, j as f64 + offset, k as f64 + offset) * self.spacing
    }

    /// Position `[m]` of a lattice vertex, warped if it is.
    pub fn position(&self, id: u32) -> Vec3<f64> {
        match self.warped.binary_search_by_key(&id, |&(warped, _)| warped) {
            Ok(found) => self.warped[found].1,
            Err(_) => self.regular_position(id),
        }
    }

    /// The 14 neighbours of a vertex that is not on the rim.
    fn neighbors(&self, id: u32) -> [u32; 14] {
        let (grid, at) = self.indices(id);
        std::array::from_fn(|neighbor| {
            let mut to = at;
            if neighbor < 6 {
                let axis = neighbor / 2;
                to[axis] = if neighbor % 2 == 0 { at[axis] + 1 } else { at[axis] - 1 };
                self.id(grid, to)
            } else {
                // Corner (i, j, k) touches the centres of cubes i - 1 and i; centre i the corners
                // i and i + 1.
                for axis in 0..3 {
                    to[axis] = at[axis] + grid + ((neighbor - 6) >> axis & 1) - 1;
                }
                self.id(1 - grid, to)
            }
        })
    }

    fn find_cuts(&mut self) -> Result<(), TetrahedralizeError> {
        let mut cuts = Vec::new();
        for inside in 0..self.vertex_count() as u32 {
            if self.signs[inside as usize] != Sign::Inside {
                continue;
            }
            for outside in self.neighbors(inside) {
                if self.signs[outside as usize] == Sign::Outside {
                    let fraction = self.find_zero(inside, outside)?;
                    cuts.push(Cut { inside, outside, fraction });
                }
            }
        }
        cuts.sort_unstable_by_key(|cut| (cut.inside, cut.outside));
        self.cuts = cuts;
        Ok(())
    }

    fn evaluate(&self, point: Vec3<f64>) -> Result<f64, TetrahedralizeError> {
        let value = self.shape.distance(point);
        if value.is_finite() {
            Ok(value)
        } else {
            Err(TetrahedralizeError::NotFinite { point: point.to_array() })
        }
    }

    /// A zero of the function between two vertices, as a fraction of the edge: false position with
    /// the Illinois rule, which halves the value of an end that stays twice in a row.
    fn find_zero(&self, inside: u32, outside: u32) -> Result<f64, TetrahedralizeError> {
        let (start, end) = (self.regular_position(inside), self.regular_position(outside));
        let (mut low, mut high) = (0.0, 1.0);
        let (mut low_value, mut high_value) = (self.evaluate(start)?, self.evaluate(end)?);
        let mut last_moved_low = None;
        // Converges in about 6 steps; a rough function may stop at the limit, in its bracket.
        for _ in 0..60 {
            let secant = low - low_value * (high - low) / (high_value - low_value);
            let middle = if secant > low && secant < high { secant } else { 0.5 * (low + high) };
            let value = self.evaluate(start + (end - start) * middle)?;
            let move_low = value < 0.0;
            if move_low {
                (low, low_value) = (middle, value);
                if last_moved_low == Some(true) {
                    high_value *= 0.5;
                }
            } else {
                (high, high_value) = (middle, value);
                if last_moved_low == Some(false) {
                    low_value *= 0.5;
                }
            }
            last_moved_low = Some(move_low);
            // A hundred times the round-off of the fraction itself.
            if value == 0.0 || high - low < 1e-14 || value.abs() < 1e-14 * self.spacing {
                return Ok(middle);
            }
        }
        Ok(0.5 * (low + high))
    }

    /// Position `[m]` of a cut point.
    pub fn cut_position(&self, cut: usize) -> Vec3<f64> {
        let Cut { inside, outside, fraction } = self.cuts[cut];
        let (start, end) = (self.regular_position(inside), self.regular_position(outside));
        start + (end - start) * fraction
    }

    /// The cut between two neighbours of opposite sign.
    pub fn find_cut(&self, inside: u32, outside: u32) -> usize {
        self.cuts.partition_point(|cut| (cut.inside, cut.outside) < (inside, outside))
    }

    /// Step 3: moves vertices that have a cut point too near onto it. Returns how many.
    pub fn warp(&mut self) -> usize {
        let mut by_outside: Vec<u32> = (0..self.cuts.len() as u32).collect();
        by_outside.sort_unstable_by_key(|&cut| {
            let Cut { inside, outside, .. } = self.cuts[cut as usize];
            (outside, inside)
        });
        // (vertex, cut) for both ends of each cut: grouped by vertex, in order of vertex ids.
        let from_inside =
            (0..self.cuts.len() as u32).map(|cut| (self.cuts[cut as usize].inside, cut));
        let from_outside = by_outside.iter().map(|&cut| (self.cuts[cut as usize].outside, cut));
        let mut ends: Vec<(u32, u32)> = from_inside.chain(from_outside).collect();
        ends.sort_unstable();
        for group in ends.chunk_by(|a, b| a.0 == b.0) {
            let vertex = group[0].0;
            let mut nearest: Option<(f64, u32)> = None;
            for &(_, index) in group {
                let cut = self.cuts[index as usize];
                let (other, fraction) = if cut.inside == vertex {
                    (cut.outside, cut.fraction)
                } else {
                    (cut.inside, 1.0 - cut.fraction)
                };
                let is_long = vertex % 2 == other % 2;
                let (alpha, length) =
                    if is_long { (ALPHA_LONG, 1.0) } else { (ALPHA_SHORT, 0.75_f64.sqrt()) };
                // A neighbour that moved earlier is on the surface: this edge is no longer cut.
                let is_cut = self.signs[other as usize] != Sign::Surface;
                let reach = fraction * length;
                if is_cut && fraction < alpha && nearest.is_none_or(|(best, _)| reach < best) {
                    nearest = Some((reach, index));
                }
            }
            if let Some((_, cut)) = nearest {
                self.signs[vertex as usize] = Sign::Surface;
                self.warped.push((vertex, self.cut_position(cut as usize)));
            }
        }
        self.warped.len()
    }

    /// Calls `visit` with each lattice tetrahedron that has a corner inside and lies in two cubes for which `is_wanted` says
    /// yes. The first two corners share a long edge, and so do the last two.
    pub fn for_each_tet(
        &self,
        is_wanted: impl Fn([usize; 3]) -> bool,
        mut visit: impl FnMut([Corner; 4]),
    ) {
        let [nx, ny, nz] = self.cubes;
        let corner = |grid: usize, at: [usize; 3]| self.corner(at.map(|n| 2 * n + grid));
        for k in 0..nz - 1 {
            for j in 0..ny - 1 {
                for i in 0..nx - 1 {
                    for axis in 0..3 {
                        // The two cubes share a face; each of its edges makes a tetrahedron with
                        // the two centres.
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let mut at = [i, j, k];
                        let is_first_wanted = is_wanted(at);
                        let first = corner(1, at);
                        at[axis] += 1;
                        if !(is_first_wanted && is_wanted(at)) {
                            continue;
                        }
                        let second = corner(1, at);
                        let ring = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
                            let mut at = at;
                            at[u] += du;
                            at[v] += dv;
                            corner(0, at)
                        });
                        for edge in 0..4 {
                            let tet = [first, second, ring[edge], ring[(edge + 1) % 4]];
                            if tet.iter().any(|corner| corner.sign == Sign::Inside) {
                                visit(tet);
                            }
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
impl<'a> Lattice<'a> {
    /// A lattice of 5 x 5 x 5 cubes of edge 2, outside everywhere: ground for one tetrahedron.
    pub fn blank(shape: &'a dyn SignedDistance) -> Self {
        let mut lattice = Self {
            shape,
            spacing: 2.0,
            origin: Vec3::ZERO,
            cubes: [5; 3],
            signs: Vec::new(),
            cuts: Vec::new(),
            warped: Vec::new(),
        };
        lattice.signs = vec![Sign::Outside; lattice.vertex_count()];
        lattice
    }

    /// Makes the centre of the middle cube lie inside, so that its tetrahedra are visited.
    pub fn mark_center_inside(&mut self) {
        let center = self.id(1, [2; 3]);
        self.signs[center as usize] = Sign::Inside;
    }

    /// Prescribes cut points (inside, outside, fraction) and warps (vertex, towards, fraction).
    pub fn prescribe(&mut self, cuts: &[(u32, u32, f64)], warps: &[(u32, u32, f64)]) {
        let cut =
            |&(inside, outside, fraction): &(u32, u32, f64)| Cut { inside, outside, fraction };
        self.cuts = cuts.iter().map(cut).collect();
        self.cuts.sort_unstable_by_key(|cut| (cut.inside, cut.outside));
        self.warped.clear();
        for &(vertex, towards, fraction) in warps {
            let (from, to) = (self.regular_position(vertex), self.regular_position(towards));
            self.warped.push((vertex, from + (to - from) * fraction));
        }
        self.warped.sort_unstable_by_key(|&(vertex, _)| vertex);
    }

    /// The neighbours along lattice edges, for tests.
    pub fn all_neighbors(&self, id: u32) -> [u32; 14] {
        self.neighbors(id)
    }
}
