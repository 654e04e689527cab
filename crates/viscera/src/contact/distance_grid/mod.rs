//! Signed distances of a closed surface, on a grid: an instrument of any shape.
//!
//! ```text
//! phi(x) = sum over the eight corners of a cell of  u v w phi_c        trilinear, continuous everywhere in the grid
//! grad phi: the gradient of that same function, jumps from cell to cell;   |grad phi| <= L everywhere, L of the grid
//! n(x) = grad of the mean of phi over +- half a cell along each axis, of length 1: continuous; for planes
//! ```
//!
//! Force is the gradient of the energy to the bit of rounding, because both are of one function. A smoother gradient would
//! not be: guards would then take descents back.
//!
//! Cells are half of the contact's thickness where contact can be, and eight times as long elsewhere ("bricks" of 8 x 8 x 8
//! cells, divided or not). Where a divided brick meets an undivided one its points lie on the latter's trilinear function, so
//! that there is no step; none of them is as near to the surface as contact begins. Beyond the grid the value is a bound
//! from below.
//!
//! The sign is that of winding numbers (`winding.rs`), the magnitude the distance to the nearest triangle (`tree.rs`).

mod build;
mod closed;
mod error;
mod tree;
mod winding;

pub use closed::MOST_TRIANGLES;
pub use error::{SolidError, Spot};

use super::distance::Distance;
use crate::mesh::SurfaceMesh;
use crate::scalar::{Vec3, vec3};

/// Cells along each edge of a brick.
pub(crate) const BRICK: usize = 8;

/// Points along each edge of a brick.
const POINTS: usize = BRICK + 1;

/// Of a brick that is not divided.
pub(crate) const WHOLE: u32 = u32::MAX;

/// Signed distances around a closed surface.
#[derive(Clone)]
pub struct DistanceGrid {
    /// In its own frame [m].
    surface: SurfaceMesh,
    /// Lower corner of the grid [m].
    origin: Vec3<f64>,
    /// Edge of the small cells [m].
    cell: f64,
    /// Bricks along each axis.
    bricks: [usize; 3],
    /// Distances [m] at the corners of bricks, z fastest, shape [(x + 1) (y + 1) (z + 1)].
    corners: Vec<f32>,
    /// Of each brick, its number among the divided ones, or [`WHOLE`]; z fastest.
    divided: Vec<u32>,
    /// Distances [m] at the points of divided bricks, z fastest, shape [divided_count, 9, 9, 9].
    points: Vec<f32>,
    /// No point beyond the grid is nearer to the surface than this and its way to the grid [m].
    margin: f64,
    /// The largest magnitude of the gradient.
    steepest: f64,
    /// Half of the thickness of its walls at the thinnest [m].
    thinnest: f64,
    /// Half of the smallest edge of its box [m].
    breadth: f64,
    /// The radius of a ball around the origin that holds it [m].
    reach: f64,
}

/// Eight distances and a place between them.
struct Cell {
    /// [m], index 4 x + 2 y + z.
    values: [f64; 8],
    /// [m].
    edge: f64,
    /// From 0 to 1 along each axis.
    share: Vec3<f64>,
}

impl DistanceGrid {
    /// The surface, without repeated vertices.
    pub fn surface(&self) -> &SurfaceMesh {
        &self.surface
    }

    /// Edge of the cells near the surface [m].
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Lower corner of the grid [m].
    #[cfg(feature = "gpu")]
    pub(crate) fn origin(&self) -> Vec3<f64> {
        self.origin
    }

    /// Bricks along each axis.
    #[cfg(feature = "gpu")]
    pub(crate) fn bricks(&self) -> [usize; 3] {
        self.bricks
    }

    /// No point beyond the grid is nearer to the surface than this and its way to the grid [m].
    #[cfg(feature = "gpu")]
    pub(crate) fn margin(&self) -> f64 {
        self.margin
    }

    /// Appends numbers of divided bricks, distances at corners of bricks, and those at points of divided ones, as words.
    #[cfg(feature = "gpu")]
    pub(crate) fn put_words(&self, into: &mut Vec<u32>) {
        into.extend_from_slice(&self.divided);
        into.extend(self.corners.iter().chain(&self.points).map(|distance| distance.to_bits()));
    }

    /// Bytes of its distances.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.corners[..])
            + size_of_val(&self.divided[..])
            + size_of_val(&self.points[..])
    }

    /// The largest magnitude that the gradient has, at least 1.
    pub fn steepest(&self) -> f64 {
        self.steepest
    }

    /// Half of the thickness of its walls where they are thinnest [m].
    pub fn thinnest(&self) -> f64 {
        self.thinnest
    }

    /// Half of the smallest edge of the box around it [m].
    pub fn breadth(&self) -> f64 {
        self.breadth
    }

    /// The radius of a ball around the origin that holds the surface [m].
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Distance and its gradient at a point [m]. Beyond the grid the value is a bound from below.
    pub fn distance(&self, x: Vec3<f64>) -> Distance {
        let Some(cell) = self.cell_at(x) else { return self.beyond(x) };
        let (value, gradient) = cell.interpolate();
        let slope = gradient.length();
        let normal = if slope > 0.0 { gradient * (1.0 / slope) } else { vec3(1.0, 0.0, 0.0) };
        // Within a cell the gradient turns as the function says, from cell to cell as the surface does.
        let round = 1.0 / (self.thinnest + value.max(0.0)).max(self.cell);
        Distance { value, normal, slope, curvature: cell.twist() + round }
    }

    /// The normal of the plane that stands for the solid near a point [m]: of length 1, continuous from cell to cell.
    pub fn normal(&self, x: Vec3<f64>) -> Vec3<f64> {
        let half = 0.5 * self.cell;
        let mut rise = Vec3::ZERO;
        for axis in 0..3 {
            let mut step = Vec3::ZERO;
            step[axis] = half;
            rise[axis] = self.value(x + step) - self.value(x - step);
        }
        let length = rise.length();
        // On a ridge of the distance, in the middle of a wall, there is no such normal.
        if length > 1e-3 * self.cell { rise * (1.0 / length) } else { self.distance(x).normal }
    }

    fn value(&self, x: Vec3<f64>) -> f64 {
        match self.cell_at(x) {
            Some(cell) => cell.interpolate().0,
            None => self.beyond(x).value,
        }
    }

    /// Of a point beyond the grid.
    fn beyond(&self, x: Vec3<f64>) -> Distance {
        let size = vec3(self.bricks[0] as f64, self.bricks[1] as f64, self.bricks[2] as f64);
        let high = self.origin + size * (BRICK as f64 * self.cell);
        let away = x - x.max(self.origin).min(high);
        let length = away.length();
        let normal = if length > 0.0 { away * (1.0 / length) } else { vec3(1.0, 0.0, 0.0) };
        Distance { value: length + self.margin, normal, slope: 1.0, curvature: 0.0 }
    }

    /// The cell, small or large, of a point in the grid.
    fn cell_at(&self, x: Vec3<f64>) -> Option<Cell> {
        let place = (x - self.origin) * (1.0 / self.cell);
        let mut brick = [0; 3];
        let mut inner = Vec3::ZERO;
        for axis in 0..3 {
            let (at, count) = (place[axis], self.bricks[axis]);
            let is_within = at >= 0.0 && at <= (count * BRICK) as f64;
            if !is_within {
                return None;
            }
            brick[axis] = (at as usize / BRICK).min(count - 1);
            inner[axis] = at - (brick[axis] * BRICK) as f64;
        }
        Some(match self.divided[self.brick_index(brick)] {
            WHOLE => Cell {
                values: self.corners_of(brick),
                edge: BRICK as f64 * self.cell,
                share: inner * (1.0 / BRICK as f64),
            },
            number => self.small_cell(number as usize, inner),
        })
    }

    fn small_cell(&self, number: usize, inner: Vec3<f64>) -> Cell {
        let low = [0, 1, 2].map(|axis| (inner[axis] as usize).min(BRICK - 1));
        let first = number * POINTS * POINTS * POINTS + point_index(low);
        // One bound for all eight.
        let near = &self.points[first..first + point_index([1, 1, 1]) + 1];
        let share = vec3(low[0] as f64, low[1] as f64, low[2] as f64);
        Cell { values: of_cell(near, POINTS, POINTS), edge: self.cell, share: inner - share }
    }

    fn brick_index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.bricks[1] + y) * self.bricks[2] + z
    }

    fn corner_index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * (self.bricks[1] + 1) + y) * (self.bricks[2] + 1) + z
    }

    /// Distances [m] at the corners of a brick.
    fn corners_of(&self, brick: [usize; 3]) -> [f64; 8] {
        let first = self.corner_index(brick);
        of_cell(&self.corners[first..], self.bricks[1] + 1, self.bricks[2] + 1)
    }
}

/// Eight of an array's numbers, from its first; it has so many columns along y, and numbers in a column.
fn of_cell(numbers: &[f32], columns: usize, height: usize) -> [f64; 8] {
    std::array::from_fn(|corner| {
        let [x, y, z] = [corner >> 2, corner >> 1 & 1, corner & 1];
        f64::from(numbers[(x * columns + y) * height + z])
    })
}

/// Of a point of a divided brick.
fn point_index([x, y, z]: [usize; 3]) -> usize {
    (x * POINTS + y) * POINTS + z
}

impl Cell {
    /// The trilinear function and its gradient.
    fn interpolate(&self) -> (f64, Vec3<f64>) {
        let Self { values: v, edge, share } = self;
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        // Along z, then y, then x; slopes are differences of what is mixed.
        let of_z = [0, 2, 4, 6].map(|k| (mix(v[k], v[k + 1], share.z), v[k + 1] - v[k]));
        let of_y = [0, 2].map(|k| {
            let ((a, da), (b, db)) = (of_z[k], of_z[k + 1]);
            (mix(a, b, share.y), b - a, mix(da, db, share.y))
        });
        let [(a, ya, za), (b, yb, zb)] = of_y;
        let gradient = vec3(b - a, mix(ya, yb, share.x), mix(za, zb, share.x));
        (mix(a, b, share.x), gradient * (1.0 / edge))
    }

    /// A bound of the magnitude of its second derivative [1/m]: mixed ones only, so that it is `sqrt(2 sum of squares)`.
    fn twist(&self) -> f64 {
        let Self { values: v, edge, share } = self;
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let twist = |k: usize, a: usize, b: usize| v[k + a + b] - v[k + a] - v[k + b] + v[k];
        let xy = mix(twist(0, 4, 2), twist(1, 4, 2), share.z);
        let xz = mix(twist(0, 4, 1), twist(2, 4, 1), share.y);
        let yz = mix(twist(0, 2, 1), twist(4, 2, 1), share.x);
        (2.0 * (xy * xy + xz * xz + yz * yz)).sqrt() / (edge * edge)
    }

    /// A bound of the gradient's magnitude in it.
    fn steepness(&self) -> f64 {
        let v = &self.values;
        let along = |step: usize| {
            let lower = (0..8).filter(|k| k & step == 0);
            lower.map(|k| (v[k + step] - v[k]).abs()).fold(0.0, f64::max)
        };
        let [x, y, z] = [along(4), along(2), along(1)];
        (x * x + y * y + z * z).sqrt() / self.edge
    }
}

/// The grid follows from these.
impl PartialEq for DistanceGrid {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other) || self.cell == other.cell && self.surface == other.surface
    }
}

impl std::fmt::Debug for DistanceGrid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DistanceGrid")
            .field("triangles", &self.surface.triangles.len())
            .field("cell", &self.cell)
            .field("bytes", &self.bytes())
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
pub(super) mod tests;
