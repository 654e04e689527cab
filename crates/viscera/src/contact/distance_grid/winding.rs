//! What is inside a closed surface: winding numbers along the lines of a grid.
//!
//! ```text
//! w(x, y, z) = sum over crossings of the line below z of  +1 where the surface leads in, -1 where it leads out
//! ```
//!
//! A line through an edge or a corner is moved aside by an infinitesimal step (e, e^2), the same for all triangles; with
//! places in whole numbers of a millionth of a cell every side of every edge is then exact, so that no line slips through
//! between two triangles and none is crossed twice.

use crate::scalar::Vec3;

/// Parts of a cell in which places are counted, as a power of two.
const FRACTION: u32 = 20;

/// Where a line crosses a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The line: its column along x and along y.
    line: (u32, u32),
    /// In cells above the origin.
    height: f64,
    /// 1 where the surface leads in, going up.
    enters: i8,
}

/// All crossings of the lines along z through the points of a grid, by line, then by height.
#[derive(Clone, Debug, Default)]
pub struct Crossings(Vec<Crossing>);

impl Crossings {
    /// Of a surface's triangles [m], all of it beyond `origin` [m] along all axes; `cell` [m] between lines.
    pub fn new(triangles: &[[Vec3<f64>; 3]], origin: Vec3<f64>, cell: f64) -> Self {
        let mut all = Vec::new();
        for triangle in triangles {
            cross(&triangle.map(|x| (x - origin) * (1.0 / cell)), &mut all);
        }
        all.sort_unstable_by(|a, b| {
            a.line
                .cmp(&b.line)
                .then_with(|| a.height.total_cmp(&b.height))
                .then_with(|| a.enters.cmp(&b.enters))
        });
        Self(all)
    }

    /// Those of one line, from below.
    pub fn of_line(&self, line: (u32, u32)) -> &[Crossing] {
        let first = self.0.partition_point(|crossing| crossing.line < line);
        let count = self.0[first..].partition_point(|crossing| crossing.line == line);
        &self.0[first..first + count]
    }
}

/// How often the surface is around a point of a line at a height [cells].
pub fn winding(line: &[Crossing], height: f64) -> i32 {
    let below = line.iter().take_while(|crossing| crossing.height < height);
    below.map(|crossing| i32::from(crossing.enters)).sum()
}

/// Adds the crossings of one triangle, corners in cells.
fn cross(corners: &[Vec3<f64>; 3], all: &mut Vec<Crossing>) {
    let scale = f64::from(1u32 << FRACTION);
    let [a, b, c] = corners.map(|x| [x.x, x.y].map(|x| (x * scale).round() as i64));
    let area = side(a, b, c);
    if area == 0 {
        return;
    }
    let range = |axis: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]);
        let high = a[axis].max(b[axis]).max(c[axis]);
        let whole = 1i64 << FRACTION;
        low.div_euclid(whole) + i64::from(low.rem_euclid(whole) != 0)..=high.div_euclid(whole)
    };
    for i in range(0) {
        for j in range(1) {
            let p = [i << FRACTION, j << FRACTION];
            let edges = [(b, c), (c, a), (a, b)];
            let is_inside = edges.iter().all(|&(from, to)| is_left(from, to, p) == (area > 0));
            if is_inside {
                let shares = edges.map(|(from, to)| side(from, to, p) as f64 / area as f64);
                let height: f64 = shares.iter().zip(corners).map(|(share, x)| share * x.z).sum();
                // Counter-clockwise from above: the surface leads out.
                let enters = if area > 0 { -1 } else { 1 };
                all.push(Crossing { line: (i as u32, j as u32), height, enters });
            }
        }
    }
}

/// Twice the area of the triangle of an edge and a point, above zero where the point is to the left.
fn side(from: [i64; 2], to: [i64; 2], p: [i64; 2]) -> i128 {
    let way = [0, 1].map(|axis| i128::from(to[axis] - from[axis]));
    let away = [0, 1].map(|axis| i128::from(p[axis] - from[axis]));
    way[0] * away[1] - way[1] * away[0]
}

/// Whether `p + (e, e^2)` is to the left of an edge that has a length.
fn is_left(from: [i64; 2], to: [i64; 2], p: [i64; 2]) -> bool {
    let side = side(from, to, p);
    if side != 0 {
        return side > 0;
    }
    if to[1] != from[1] { to[1] < from[1] } else { to[0] > from[0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    /// A cube from 1 to 4 of two triangles a face, so that lines go through its edges, corners and diagonals.
    fn cube() -> Vec<[Vec3<f64>; 3]> {
        let mut all = Vec::new();
        for axis in 0..3 {
            for outer in [false, true] {
                let corner = |u: f64, v: f64| {
                    let mut x = Vec3::ZERO;
                    x[axis] = if outer { 4.0 } else { 1.0 };
                    (x[(axis + 1) % 3], x[(axis + 2) % 3]) = (1.0 + 3.0 * u, 1.0 + 3.0 * v);
                    x
                };
                let [a, b, c, d] =
                    [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
                all.extend(if outer { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
            }
        }
        all
    }

    #[test]
    fn lines_through_edges_and_corners_are_crossed_once() {
        let crossings = Crossings::new(&cube(), Vec3::ZERO, 1.0);
        for i in 0..6 {
            for j in 0..6 {
                let line = crossings.of_line((i, j));
                // Moved aside by (e, e^2): what begins at 1 is within, what ends at 4 is not.
                let is_in = (1..4).contains(&i) && (1..4).contains(&j);
                assert_eq!(line.len(), if is_in { 2 } else { 0 }, "{i} {j}");
                for height in [0.5, 2.5, 4.5] {
                    let wanted = i32::from(is_in && height == 2.5);
                    assert_eq!(winding(line, height), wanted, "{i} {j} {height}");
                }
            }
        }
    }

    #[test]
    fn corners_of_a_sphere_are_inside_or_outside() {
        let ball = crate::mesh::shapes::sphere(1.0, 0.3).expect("a ball").surface;
        let middle = Vec3::splat(1.5);
        let moved: Vec<_> = ball.vertices.iter().map(|x| *x + middle).collect();
        let triangles = super::super::tree::corners_of(&moved, &ball.triangles);
        let cell = 0.125;
        let crossings = Crossings::new(&triangles, Vec3::ZERO, cell);
        for i in 0..24 {
            for j in 0..24 {
                let line = crossings.of_line((i, j));
                for k in 0..24 {
                    let at = vec3(f64::from(i), f64::from(j), f64::from(k));
                    let radius = (at * cell - middle).length();
                    if (radius - 1.0).abs() > 0.05 {
                        let wanted = i32::from(radius < 1.0);
                        assert_eq!(winding(line, f64::from(k)), wanted, "{at:?}");
                    }
                }
            }
        }
    }
}
