//! The nearest triangle of a surface that moves: a sorted grid.
//!
//! ```text
//! cell of a triangle's middle -> bucket;  triangles sorted by (bucket, number);  first of each bucket
//! query: buckets of all cells within reach + largest radius + what has moved since the grid was sorted
//! ```
//!
//! What is found does not depend on when the grid was sorted: all triangles within reach are looked at where they are now,
//! the nearest one counts, of several the lowest. Cells that share a bucket cost time, and hide nothing.

use crate::mesh::nearest::nearest_weights;
use crate::scalar::Vec3;

/// The point of a triangle that is nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Barycentric weights of the corners.
    pub weights: [f64; 3],
    /// From it to the other point [m].
    pub away: Vec3<f64>,
    /// `(b - a) x (c - a)` [m^2]: outward, twice the area long.
    pub normal: Vec3<f64>,
}

/// What a query has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// The triangle's number.
    pub triangle: u32,
    /// Its nearest point.
    pub closest: Closest,
}

/// The point of a triangle nearest to `p` [m].
pub fn closest(p: Vec3<f64>, [a, b, c]: [Vec3<f64>; 3]) -> Closest {
    let weights = nearest_weights(p, [a, b, c]);
    let near = a * weights[0] + b * weights[1] + c * weights[2];
    Closest { weights, away: p - near, normal: (b - a).cross(c - a) }
}

/// Surfaces whose outward normals have a larger product, at an angle below 37 degrees, lie beside each other.
pub const PARALLEL: f64 = 0.8;

/// What is farther than something that is known to be near by less than this share counts: more than rounding makes of distances.
const SLACK: f64 = 1e-9;

/// What has happened since a grid was sorted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Since {
    /// All points have moved by this [m],
    pub drift: Vec3<f64>,
    /// and none further than this beside it [m].
    pub moved: f64,
}

impl Since {
    /// Nothing.
    pub const NOTHING: Self = Self { drift: Vec3 { x: 0.0, y: 0.0, z: 0.0 }, moved: 0.0 };
}

/// What is looked for around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    /// The point [m].
    pub p: Vec3<f64>,
    /// Triangles whose normal is nearly this are left out, see [`PARALLEL`]; none where it is zero.
    pub outward: Vec3<f64>,
    /// How far it reaches [m], and how far for what is only counted.
    pub reaches: [f64; 2],
    /// What has happened since the grid was sorted.
    pub since: Since,
    /// A triangle that is probably near, with the product of its normal with `outward`: it is looked at first, which saves time
    /// and changes nothing.
    pub first: Option<(u32, f64)>,
}

impl Query {
    /// Around a point [m], of a grid that was just sorted.
    pub fn around(p: Vec3<f64>, reach: f64) -> Self {
        Self { p, outward: Vec3::ZERO, reaches: [reach; 2], since: Since::NOTHING, first: None }
    }
}

/// Whether a triangle may be met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum May {
    /// However things move.
    Never,
    /// Not as it is turned.
    Later,
    /// As things are.
    Now,
}

/// A grid of triangles.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    /// Edge of the cells [m]; zero before it was sorted.
    cell: f64,
    /// Triangles in the order of their buckets: middles [m] and the farthest corners from them [m], when it was sorted.
    balls: Vec<(Vec3<f64>, f64)>,
    /// Their normals, in the same order.
    normals: Vec<Vec3<f64>>,
    largest: f64,
    /// Buckets and triangles, sorted.
    sorted: Vec<(u32, u32)>,
    /// The first of each bucket, and the end of the last.
    first: Vec<u32>,
}

impl Grid {
    /// Room for so many triangles.
    pub fn new(count: usize) -> Self {
        Self {
            balls: Vec::with_capacity(count),
            normals: Vec::with_capacity(count),
            sorted: Vec::with_capacity(count),
            first: vec![0; count.next_power_of_two() + 1],
            ..Self::default()
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.balls.capacity() * size_of::<(Vec3<f64>, f64)>()
            + self.normals.capacity() * size_of::<Vec3<f64>>()
            + self.sorted.capacity() * size_of::<(u32, u32)>()
            + size_of_val(&self.first[..])
    }

    /// Sorts triangles of points at these places [m], for queries of about `reach` [m]. Takes no memory where it has room.
    pub fn sort(&mut self, triangles: &[[u32; 3]], at: &[Vec3<f64>], reach: f64) {
        let ball = |triangle: &[u32; 3]| {
            let corners = triangle.map(|point| at[point as usize]);
            let middle = (corners[0] + corners[1] + corners[2]) * (1.0 / 3.0);
            let squared = corners.map(|x| (x - middle).length_squared());
            (middle, squared[0].max(squared[1]).max(squared[2]).sqrt())
        };
        self.largest = triangles.iter().map(|triangle| ball(triangle).1).fold(0.0, f64::max);
        self.cell = (2.0 * self.largest).max(reach).max(f64::MIN_POSITIVE);
        let Self { balls, sorted, first, .. } = self;
        let buckets = first.len() as u32 - 1;
        sorted.clear();
        for (number, triangle) in (0..).zip(triangles) {
            sorted.push((bucket(cell_of(ball(triangle).0, self.cell), buckets), number));
        }
        // No two are equal, so the order is one whatever the sort does.
        sorted.sort_unstable();
        balls.clear();
        balls.extend(sorted.iter().map(|&(_, number)| ball(&triangles[number as usize])));
        first.fill(0);
        sorted.iter().for_each(|(bucket, _)| first[*bucket as usize + 1] += 1);
        for bucket in 1..first.len() {
            first[bucket] += first[bucket - 1];
        }
    }

    /// Takes over the normals of triangles after it was sorted.
    pub fn turn(&mut self, normals: &[Vec3<f64>]) {
        self.normals.clear();
        self.normals.extend(self.sorted.iter().map(|&(_, number)| normals[number as usize]));
    }

    /// The nearest triangle within reach that `may` be met and that `suits` as it lies; and the distance [m], at most the
    /// farther reach, of the nearest that may be met now or later. Of `may` the second argument is the product of the
    /// triangle's normal with `outward`.
    pub fn nearest(
        &self,
        query: &Query,
        corners: impl Fn(u32) -> [Vec3<f64>; 3],
        mut may: impl FnMut(u32, f64) -> May,
        mut suits: impl FnMut(u32, &Closest) -> bool,
    ) -> (Option<Found>, f64) {
        let Query { p, outward, reaches: [reach, farther], since, first } = *query;
        let mut best: Option<(f64, Found)> = None;
        let mut clearance = farther;
        // Looks at one triangle, and returns how far those are at most that may still count.
        let mut look = |triangle: u32, product: f64| {
            let may = may(triangle, product);
            if may != May::Never {
                let near = closest(p, corners(triangle));
                let squared = near.away.length_squared();
                // Nothing where it is no number, as beside triangles without area.
                if squared <= farther * farther {
                    clearance = clearance.min(squared.sqrt());
                }
                let is_nearer = best.is_none_or(|(least, found)| {
                    squared < least || (squared == least && triangle < found.triangle)
                });
                let is_within = may == May::Now && squared <= reach * reach;
                if is_within && is_nearer && suits(triangle, &near) {
                    best = Some((squared, Found { triangle, closest: near }));
                }
            }
            // What is known to be near hides what is farther.
            clearance.max(best.map_or(reach, |(squared, _)| squared.sqrt())) * (1.0 + SLACK)
        };
        let mut most = farther;
        if let Some((triangle, product)) = first.filter(|(_, product)| *product < PARALLEL) {
            most = look(triangle, product);
        }
        // Where the point would have been when the grid was sorted.
        let then = p - since.drift;
        self.visit(then, since.moved, &mut most, |place| {
            let product = outward.dot(self.normals[place]);
            // Most are sorted out here: because they look the same way.
            (product < PARALLEL).then(|| look(self.sorted[place].1, product))
        });
        (best.map(|(_, found)| found), clearance)
    }

    /// Calls with all triangles of which some point may have been within `most` [m] of a place when the grid was sorted and all
    /// had not moved by up to `moved` [m], nearer cells first; `most` becomes what `act` returns.
    fn visit(
        &self,
        then: Vec3<f64>,
        moved: f64,
        most: &mut f64,
        mut act: impl FnMut(usize) -> Option<f64>,
    ) {
        let mut see = |place: usize, most: &mut f64| {
            let (middle, radius) = self.balls[place];
            let wide = *most + moved + radius;
            if (middle - then).length_squared() <= wide * wide {
                *most = act(place).unwrap_or(*most);
            }
        };
        let others = moved + self.largest;
        let wide = Vec3::splat(*most + others);
        let (low, high) = (cell_of(then - wide, self.cell), cell_of(then + wide, self.cell));
        let spans = [0, 1, 2].map(|axis| (high[axis] - low[axis]).saturating_add(1));
        let cells = spans.iter().fold(1i64, |all, &span| all.saturating_mul(span));
        // A query over more cells than there are triangles looks at each triangle once.
        if cells > self.balls.len() as i64 {
            (0..self.balls.len()).for_each(|place| see(place, most));
            return;
        }
        let buckets = self.first.len() as u32 - 1;
        let middle = cell_of(then, self.cell);
        // Cells along an axis from the middle outwards, with how far they are [m], squared.
        let along = |axis: usize| {
            let (low, middle, high) = (low[axis], middle[axis], high[axis]);
            let farthest = (middle - low).max(high - middle);
            let cells = (0..=2 * farthest)
                .map(move |k| if k % 2 == 0 { middle + k / 2 } else { middle - (k + 1) / 2 });
            cells.filter(move |cell| (low..=high).contains(cell)).map(move |cell| {
                let [start, end] = [cell, cell + 1].map(|edge| edge as f64 * self.cell);
                let gap = (start - then[axis]).max(then[axis] - end).max(0.0);
                (cell, gap * gap)
            })
        };
        let is_near = |squared: f64, most: f64| {
            let wide = most + others;
            squared <= wide * wide * (1.0 + SLACK)
        };
        // A triangle in a bucket that two cells share is looked at twice, which changes nothing.
        for (x, away_x) in along(0) {
            for (y, away_y) in along(1) {
                if !is_near(away_x + away_y, *most) {
                    continue;
                }
                for (z, away_z) in along(2) {
                    if !is_near(away_x + away_y + away_z, *most) {
                        continue;
                    }
                    let bucket = bucket([x, y, z], buckets) as usize;
                    let range = self.first[bucket] as usize..self.first[bucket + 1] as usize;
                    range.for_each(|place| see(place, most));
                }
            }
        }
    }
}

/// The cell of a point; far away the outermost one.
fn cell_of(x: Vec3<f64>, cell: f64) -> [i64; 3] {
    const MOST: f64 = 1e15;
    x.to_array().map(|x| (x / cell).floor().clamp(-MOST, MOST) as i64)
}

/// One of so many buckets, a power of two.
fn bucket([x, y, z]: [i64; 3], count: u32) -> u32 {
    let mixed = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
        ^ (z as u64).wrapping_mul(0x1656_67b1_9e37_79f9);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 33) as u32 & (count - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    /// Numbers between -1 and 1 of a fixed sequence.
    fn number(i: usize, step: f64) -> f64 {
        2.0 * ((i as f64 * step) % 1.0) - 1.0
    }

    fn point(i: usize) -> Vec3<f64> {
        vec3(number(i, 0.618034), number(i, 0.754878), number(i, 0.569840))
    }

    /// Against the best of many points of the triangle.
    #[test]
    fn the_closest_point_is_no_farther_than_any_other() {
        for i in 1..400 {
            let triangle = [point(3 * i), point(3 * i + 1), point(3 * i + 2)];
            let p = point(7 * i + 5) * 2.0;
            let near = closest(p, triangle);
            let sum: f64 = near.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-12 && near.weights.iter().all(|w| *w >= -1e-12));
            let at = |w: [f64; 3]| triangle[0] * w[0] + triangle[1] * w[1] + triangle[2] * w[2];
            assert!((p - at(near.weights) - near.away).length() < 1e-12);
            let count = 24;
            for (u, v) in (0..=count).flat_map(|u| (0..=count - u).map(move |v| (u, v))) {
                let [u, v] = [u, v].map(|k| f64::from(k) / f64::from(count));
                let other = (p - at([1.0 - u - v, u, v])).length();
                assert!(near.away.length() <= other + 1e-12, "{i}");
            }
        }
    }

    const DRIFT: Vec3<f64> = vec3(0.3, -0.1, 0.2);

    /// Also where points have moved since the grid was sorted.
    #[test]
    fn the_grid_finds_what_looking_at_all_triangles_finds() {
        let points: Vec<Vec3<f64>> = (0..600)
            .map(|i| {
                // Three by three close together.
                point(i / 3) * 0.1 + point(i + 17) * 0.006
            })
            .collect();
        let triangles: Vec<[u32; 3]> = (0..200).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut grid = Grid::new(triangles.len());
        grid.sort(&triangles, &points, 0.01);
        grid.turn(&vec![Vec3::ZERO; triangles.len()]);
        let later: Vec<Vec3<f64>> =
            points.iter().enumerate().map(|(i, x)| *x + DRIFT + point(i + 91) * 0.002).collect();
        let since = Since { drift: DRIFT, moved: 0.0035 };
        let mut met = 0;
        for i in 0..500 {
            let p = point(i + 1000) * 0.1 + DRIFT;
            let reach = 0.004 + 0.004 * number(i, 0.3).abs() + if i % 50 == 0 { 0.2 } else { 0.0 };
            let corners = |t: u32| triangles[t as usize].map(|corner| later[corner as usize]);
            let may = |t: u32| !t.is_multiple_of(5);
            let also = |t: u32, _: f64| match t % 5 {
                0 => May::Never,
                1 => May::Later,
                _ => May::Now,
            };
            let farther = 1.5 * reach;
            let outward = Vec3::ZERO;
            let first = (i % 3 == 0).then_some((i as u32 % 200, 0.0));
            let query = Query { p, outward, reaches: [reach, farther], since, first };
            let (found, clearance) = grid.nearest(&query, corners, also, |t, _| t % 3 != 0);
            let mut all: Vec<(f64, u32)> = (0..200)
                .filter(|&t| may(t))
                .map(|t| (closest(p, corners(t)).away.length(), t))
                .collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            let near = all.iter().find(|(d, t)| *d <= reach && t % 3 != 0 && t % 5 != 1);
            assert_eq!(found.map(|found| found.triangle), near.map(|(_, t)| *t), "{i}");
            assert!((clearance - all[0].0.min(farther)).abs() < 1e-15);
            met += usize::from(found.is_some());
        }
        assert!(met > 30, "{met}");
    }

    /// Of two triangles with a common edge the lower, whichever the grid has first; their middles are beyond the reach.
    #[test]
    fn of_triangles_that_are_as_near_the_lowest_is_found() {
        for i in 0..200 {
            let place = point(i);
            let points = [
                vec3(0.0, 0.0, 0.0),
                vec3(0.0, 1.0, 0.0),
                vec3(-2.0, 0.5, 0.0),
                vec3(2.0, 0.5, 0.0),
            ];
            let points = points.map(|x| place + x * 0.125);
            let triangles = [[0, 1, 2], [1, 0, 3]];
            let mut grid = Grid::new(2);
            grid.sort(&triangles, &points, 1e-3);
            grid.turn(&[Vec3::ZERO; 2]);
            let query = Query::around(points[0] - vec3(0.0, 5e-4, 0.0), 1e-3);
            let corners = |t: u32| triangles[t as usize].map(|v: u32| points[v as usize]);
            let (found, _) = grid.nearest(&query, corners, |_, _| May::Now, |_, _| true);
            assert_eq!(found.map(|found| found.triangle), Some(0), "{i}");
        }
    }
}
