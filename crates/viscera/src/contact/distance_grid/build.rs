//! A grid of distances from a surface.

use super::closed::Closed;
use super::error::{SolidError, Spot};
use super::tree::Tree;
use super::winding::{Crossings, winding};
use super::{BRICK, Cell, DistanceGrid, POINTS, WHOLE, point_index};
use crate::mesh::SurfaceMesh;
use crate::scalar::{Vec3, vec3};

/// Bytes of distances at most. An instrument takes some megabytes, the pelvis a hundred; the time grows alike.
const MOST_BYTES: u64 = 256 << 20;

/// Bricks at most, divided or not: each asks the tree once.
const MOST_BRICKS: f64 = 4e6;

/// Contact begins two cells from the surface. Cells are small to a bit more than that, so that neither a point which is
/// bent to a large cell nor half a cell around a sample reaches there.
const BAND_OUTSIDE: f64 = 5.0;

/// And so deep inside, four thicknesses: tissue is not pressed in so far, and what is, is pushed out all the same.
const BAND_INSIDE: f64 = 8.0;

/// Distances are exact up to so many cells.
const NEAR: f64 = 6.0;

/// Cells around the surface's box.
const MARGIN: f64 = 6.0;

/// The share of the surface that may be thinner than what is called its thinnest: slivers at edges and tips.
const THINNER: f64 = 0.02;

/// Triangles at which the thickness is measured, at most.
const MOST_MEASURED: usize = 20_000;

/// What is needed to find distances.
struct Maker<'a> {
    tree: &'a Tree,
    crossings: Crossings,
    origin: Vec3<f64>,
    cell: f64,
}

impl DistanceGrid {
    /// Of a closed surface [m], for contact that begins at a distance [m] from it: cells are half of that.
    pub fn new(surface: &SurfaceMesh, thickness: f64) -> Result<Self, SolidError> {
        if !(thickness > 0.0 && thickness.is_finite()) {
            return Err(SolidError::Thickness { thickness });
        }
        let Closed { surface, triangles, tree } = Closed::new(surface)?;
        let cell = 0.5 * thickness;
        let thinnest = thinnest(&triangles, &tree);
        if 2.0 * thinnest < cell {
            return Err(SolidError::TooThin { wall: 2.0 * thinnest, cell });
        }
        let (low, high) = surface
            .vertices
            .iter()
            .fold((surface.vertices[0], surface.vertices[0]), |(low, high), x| {
                (low.min(*x), high.max(*x))
            });
        let brick = BRICK as f64 * cell;
        let extent = high - low;
        let sizes = (extent + Vec3::splat(2.0 * MARGIN * cell)) * (1.0 / brick);
        let counts = sizes.to_array().map(|size| size.ceil().max(1.0));
        let all: f64 = counts.iter().product();
        // Bricks along the surface, about two deep, are divided.
        let area = surface.area() / (brick * brick);
        let bytes = 4.0 * (2.0 * all + 2.0 * area * (POINTS * POINTS * POINTS) as f64);
        if !(all <= MOST_BRICKS && bytes <= MOST_BYTES as f64) {
            let grows = (bytes / MOST_BYTES as f64).sqrt().max((all / MOST_BRICKS).cbrt());
            return Err(too_large(bytes, cell, grows));
        }
        let bricks = counts.map(|count| count as usize);
        let size = vec3(counts[0], counts[1], counts[2]) * brick;
        let origin = (low + high - size) * 0.5;
        let reach = surface.vertices.iter().map(|x| x.length()).fold(0.0, f64::max);
        let crossings = Crossings::new(&triangles, origin, cell);
        let maker = Maker { tree: &tree, crossings, origin, cell };
        let mut grid = Self {
            surface,
            origin,
            cell,
            bricks,
            corners: Vec::new(),
            divided: Vec::new(),
            points: Vec::new(),
            margin: MARGIN * cell,
            steepest: 1.0,
            thinnest,
            breadth: 0.5 * extent.x.min(extent.y).min(extent.z),
            reach,
        };
        grid.find_corners(&maker)?;
        let chosen = grid.divide(&maker)?;
        grid.find_points(&maker, &chosen)?;
        grid.bend(&chosen);
        grid.steepest = grid.find_steepest(&chosen).max(1.0);
        Ok(grid)
    }

    /// Distances at the corners of bricks.
    fn find_corners(&mut self, maker: &Maker<'_>) -> Result<(), SolidError> {
        let [nx, ny, nz] = self.bricks;
        self.corners.reserve_exact((nx + 1) * (ny + 1) * (nz + 1));
        for x in 0..=nx {
            for y in 0..=ny {
                let column = [BRICK * x, BRICK * y];
                let heights = (0..=nz).map(|z| BRICK * z);
                maker.add_column(column, heights, f64::INFINITY, &mut self.corners)?;
            }
        }
        Ok(())
    }

    /// Chooses the bricks to divide: those that the surface is near to.
    fn divide(&mut self, maker: &Maker<'_>) -> Result<Vec<[usize; 3]>, SolidError> {
        let half = 0.5 * BRICK as f64 * self.cell;
        let around = half * 3.0_f64.sqrt();
        let mut chosen = Vec::new();
        let [nx, ny, nz] = self.bricks;
        self.divided.reserve_exact(nx * ny * nz);
        for x in 0..nx {
            for y in 0..ny {
                for z in 0..nz {
                    let middle = maker.place([BRICK * x, BRICK * y, BRICK * z]) + Vec3::splat(half);
                    let corners = self.corners_of([x, y, z]);
                    let is_inside = corners.iter().all(|value| *value < 0.0);
                    let band = if is_inside { BAND_INSIDE } else { BAND_OUTSIDE };
                    let most = band * self.cell + around;
                    let is_near = maker.tree.nearest(middle, most, most) < most;
                    self.divided.push(if is_near { chosen.len() as u32 } else { WHOLE });
                    if is_near {
                        chosen.push([x, y, z]);
                    }
                }
            }
        }
        let bytes = 4 * (2 * self.divided.len() + chosen.len() * POINTS * POINTS * POINTS) as u64;
        if bytes > MOST_BYTES {
            let grows = (bytes as f64 / MOST_BYTES as f64).sqrt();
            return Err(too_large(bytes as f64, self.cell, grows));
        }
        Ok(chosen)
    }

    /// Distances at the points of divided bricks.
    fn find_points(&mut self, maker: &Maker<'_>, chosen: &[[usize; 3]]) -> Result<(), SolidError> {
        self.points.reserve_exact(chosen.len() * POINTS * POINTS * POINTS);
        for brick in chosen {
            let [x, y, z] = brick.map(|at| at * BRICK);
            let mut known = f64::INFINITY;
            for i in 0..POINTS {
                for j in 0..POINTS {
                    let first = self.points.len();
                    let heights = z..z + POINTS;
                    // The first of the column before is a cell away; of the row before, at most a brick's edge.
                    maker.add_column([x + i, y + j], heights, known, &mut self.points)?;
                    let ways = if j < BRICK { 1.0 } else { POINTS as f64 };
                    known = f64::from(self.points[first]).abs() + ways * self.cell;
                }
            }
        }
        Ok(())
    }

    /// Moves points on sides and edges that a divided brick has in common with an undivided one onto the function of the
    /// latter.
    fn bend(&mut self, chosen: &[[usize; 3]]) {
        for (number, brick) in chosen.iter().enumerate() {
            let first = number * POINTS * POINTS * POINTS;
            let corners = self.corners_of(*brick);
            for direction in directions() {
                let Some(neighbour) = self.neighbour(*brick, direction) else { continue };
                if self.divided[self.brick_index(neighbour)] != WHOLE {
                    continue;
                }
                let range = |axis: usize| match direction[axis] {
                    -1 => 0..1,
                    1 => BRICK..POINTS,
                    _ => 0..POINTS,
                };
                for x in range(0) {
                    for y in range(1) {
                        for z in range(2) {
                            let share = vec3(x as f64, y as f64, z as f64) * (1.0 / BRICK as f64);
                            let cell = Cell { values: corners, edge: 1.0, share };
                            self.points[first + point_index([x, y, z])] =
                                cell.interpolate().0 as f32;
                        }
                    }
                }
            }
        }
    }

    fn neighbour(&self, brick: [usize; 3], direction: [isize; 3]) -> Option<[usize; 3]> {
        let mut found = [0; 3];
        for axis in 0..3 {
            found[axis] = brick[axis].checked_add_signed(direction[axis])?;
            if found[axis] >= self.bricks[axis] {
                return None;
            }
        }
        Some(found)
    }

    /// The largest bound of the gradient's magnitude of all cells.
    fn find_steepest(&self, chosen: &[[usize; 3]]) -> f64 {
        let mut steepest = 0.0_f64;
        for number in 0..chosen.len() {
            for x in 0..BRICK {
                for y in 0..BRICK {
                    for z in 0..BRICK {
                        let inner = vec3(x as f64, y as f64, z as f64);
                        steepest = steepest.max(self.small_cell(number, inner).steepness());
                    }
                }
            }
        }
        let [nx, ny, nz] = self.bricks;
        for x in 0..nx {
            for y in 0..ny {
                for z in 0..nz {
                    if self.divided[self.brick_index([x, y, z])] == WHOLE {
                        let values = self.corners_of([x, y, z]);
                        let edge = BRICK as f64 * self.cell;
                        let cell = Cell { values, edge, share: Vec3::ZERO };
                        steepest = steepest.max(cell.steepness());
                    }
                }
            }
        }
        steepest
    }
}

impl Maker<'_> {
    /// Of a point, in cells from the origin.
    fn place(&self, [x, y, z]: [usize; 3]) -> Vec3<f64> {
        self.origin + vec3(x as f64, y as f64, z as f64) * self.cell
    }

    /// Adds the distances of points of one column, which are at the heights [cells], ascending; the first one's is at most
    /// `known` [m].
    fn add_column(
        &self,
        [x, y]: [usize; 2],
        heights: impl Iterator<Item = usize>,
        known: f64,
        distances: &mut Vec<f32>,
    ) -> Result<(), SolidError> {
        let line = self.crossings.of_line((x as u32, y as u32));
        let mut before: Option<(usize, f64)> = None;
        for z in heights {
            let place = self.place([x, y, z]);
            let most = match before {
                Some((below, distance)) => distance + (z - below) as f64 * self.cell,
                None => known,
            };
            // A bit more, so that rounding does not make the bound the answer.
            let distance = self.tree.nearest(place, most * (1.0 + 1e-6), NEAR * self.cell);
            before = Some((z, distance));
            match winding(line, z as f64) {
                0 => distances.push(distance as f32),
                1 => distances.push(-distance as f32),
                times => return Err(SolidError::Nested { at: Spot(place), times }),
            }
        }
        Ok(())
    }
}

fn too_large(bytes: f64, cell: f64, grows: f64) -> SolidError {
    // Rounded up, so that the next try fits.
    let thickness = (2.0 * cell * grows * 1.05 * 1e5).ceil() * 1e-5;
    SolidError::TooLarge { bytes: bytes as u64, allowed: MOST_BYTES, cell, thickness }
}

/// To neighbours that have a side or an edge in common.
fn directions() -> impl Iterator<Item = [isize; 3]> {
    let all = (0..27).map(|k| [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1]);
    all.filter(|direction| (1..3).contains(&direction.iter().filter(|at| **at != 0).count()))
}

/// Half of the thickness of walls [m], measured inwards from the middles of triangles; of a small share of the surface it is
/// less.
fn thinnest(triangles: &[[Vec3<f64>; 3]], tree: &Tree) -> f64 {
    let step = triangles.len().div_ceil(MOST_MEASURED);
    let mut walls = Vec::new();
    for (number, [a, b, c]) in (0..).zip(triangles).step_by(step) {
        let across = (*b - *a).cross(*c - *a);
        let area = across.length();
        if area > 0.0 {
            let middle = (*a + *b + *c) * (1.0 / 3.0);
            let wall = tree.along_ray(middle, across * (-1.0 / area), number);
            walls.extend(wall.map(|wall| (wall, area)));
        }
    }
    walls.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = walls.iter().map(|(_, area)| area).sum();
    let mut sum = 0.0;
    for (wall, area) in &walls {
        sum += area;
        if sum > THINNER * all {
            return 0.5 * wall;
        }
    }
    0.0
}
